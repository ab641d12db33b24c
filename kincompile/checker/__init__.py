"""Comparison of hand-derived formulas with the compiler's."""

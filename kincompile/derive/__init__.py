"""Differentiation of Phi, with its recorded steps."""

"""Teaching: derivations shown step by step, and hand-derived formulas checked against them."""

"""NumPy modules, inline and grouped."""

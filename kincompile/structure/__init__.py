"""Counts, matching and what they say of a mechanism."""

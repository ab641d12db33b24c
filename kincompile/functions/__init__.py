"""Loops as functions: their values, derivatives, inverse and limits, at run time."""

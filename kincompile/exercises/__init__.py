"""Exercises: a variant of a mechanism for each student, blanks to fill, marking."""

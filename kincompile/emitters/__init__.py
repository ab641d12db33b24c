"""Languages that a program is emitted in."""

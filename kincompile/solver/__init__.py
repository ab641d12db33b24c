"""The solver of emitted code, written once: its text, what its words mean, and what reads it."""

"""Mechanisms at rest: where loads balance, how stiffly they are held, and what it costs."""

"""Modules whose functions are compiled C."""

"""Singular configurations: branches, events, assemblies, condition numbers."""

"""Mechanisms in space: bodies with Euler parameters and their joints; `kincompile.spatial`."""

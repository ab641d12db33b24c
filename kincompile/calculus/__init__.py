"""The language constraints are written in: scalars, planar vectors, rotations."""

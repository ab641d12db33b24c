"""Descriptions of robots: URDF with its loops, and MJCF, as mechanisms in space."""

"""The symbols of spatial constraints: bodies i and j, points s, vectors a, and triads f, g, h."""

from __future__ import annotations

from kincompile.calculus.expressions import Basis, Vector, VectorSymbol
from kincompile.calculus.space import SpatialFrame

i, j = SpatialFrame("i"), SpatialFrame("j")
s_i, s_j, a_i, a_j, c, u = (
    VectorSymbol(name, 3) for name in ("s_i", "s_j", "a_i", "a_j", "c", "u")
)
f_i, g_i, h_i, f_j, g_j, h_j = (
    VectorSymbol(name, 3) for name in ("f_i", "g_i", "h_i", "f_j", "g_j", "h_j")
)
AXES = tuple(Basis(k, 3) for k in range(3))


def separation() -> Vector:
    """Return d = r_j + A_j s_j - r_i - A_i s_i, from the point on body i to that on body j."""
    return j.point(s_j) - i.point(s_i)

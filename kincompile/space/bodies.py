"""Bodies in space and their orientation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from kincompile.calculus.space import SpatialFrame
from kincompile.model.bodies import Body, BodyKind

if TYPE_CHECKING:
    import sympy

    from kincompile.model.expressions import Scalars

SPATIAL = BodyKind(
    frame=SpatialFrame,
    units=(None, None, None, "", "", "", ""),
    drivers=("AbsoluteX", "AbsoluteY", "AbsoluteZ", *("AbsoluteOrientation",) * 4),
)


@dataclass(frozen=True, slots=True, repr=False)
class SpatialBody(Body):
    """A rigid body in space: x, y, z [length] of its origin and Euler parameters e0 to e3.

    Made by `spatial.Mechanism.body`; the ground is `spatial.Mechanism.ground`.
    """

    guess: Scalars = SPATIAL.ground
    kind: BodyKind = field(default=SPATIAL, kw_only=True, repr=False)

    @property
    def z(self) -> sympy.Expr:
        """Symbol of the z coordinate of the body's origin."""
        return self._coordinate(2)

    @property
    def p(self) -> tuple[sympy.Expr, ...]:
        """Symbols of the Euler parameters."""
        return tuple(self._coordinate(k) for k in range(3, 7))


GROUND = SpatialBody("ground", is_ground=True)


def euler_parameters(orientation: Any) -> tuple[float, ...]:
    """Return Euler parameters (e0, e1, e2, e3) of an orientation, of length one.

    Parameters
    ----------
    orientation
        Four Euler parameters of any length but zero, a rotation matrix, shape (3, 3), or a
        `scipy.spatial.transform.Rotation`.
    """
    import numpy as np
    from scipy.spatial.transform import Rotation

    if not isinstance(orientation, Rotation):
        given = np.asarray(orientation, dtype=float)
        if given.shape == (4,):
            return tuple((given / np.linalg.norm(given)).tolist())
        orientation = Rotation.from_matrix(given)
    x, y, z, w = orientation.as_quat()
    return float(w), float(x), float(y), float(z)

"""`Mechanism` in space: the builder a person writes with."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile.model.mechanism import Mechanism as PlanarMechanism
from kincompile.space.bodies import GROUND, SpatialBody, euler_parameters
from kincompile.space.primitives import Normalization

if TYPE_CHECKING:
    from kincompile.model.constraint import Constraint
    from kincompile.model.equation import Equation
    from kincompile.model.expressions import Scalars


class Mechanism(PlanarMechanism):
    """Bodies in space, parameters and constraints; otherwise as `kincompile.Mechanism`.

    A body has seven coordinates, x, y, z and the Euler parameters e0 to e3, and an equation of its
    own, e0^2 + e1^2 + e2^2 + e3^2 = 1, called ``norm_<body>``. These come after all others.
    """

    fixed = GROUND

    def body(  # type: ignore[override]  # a place and an orientation; it has no mass yet
        self, name: str, position: Scalars = (0, 0, 0), orientation: Any = (1, 0, 0, 0)
    ) -> SpatialBody:
        """Add a body and return it.

        Parameters
        ----------
        name
            Name of the body.
        position
            Guess of x, y, z [length] for Newton's method.
        orientation
            Guess of its orientation: Euler parameters, a rotation matrix, or a
            `scipy.spatial.transform.Rotation`.
        """
        body = SpatialBody(name, (*position, *euler_parameters(orientation)))
        self.bodies.append(body)
        return body

    def written(self) -> list[Constraint | Equation]:
        """Return the constraints, then the normalization of each body."""
        own = [Normalization(f"norm_{body.name}", body) for body in self.bodies]
        return [*self.constraints, *own]

"""`Mechanism` in space: the builder a person writes with."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, cast

from kincompile.errors import KincompileWarning
from kincompile.model.mechanism import Mechanism as PlanarMechanism
from kincompile.space.bodies import GROUND, SpatialBody
from kincompile.space.guesses import IDENTITY, OrientationError, euler_parameters
from kincompile.space.limits import SpatialLimit
from kincompile.space.points import SpatialPoint
from kincompile.space.primitives import Normalization

if TYPE_CHECKING:
    from kincompile.model.arguments import BodyLike
    from kincompile.model.constraint import Constraint
    from kincompile.model.equation import Equation
    from kincompile.model.expressions import Scalar, Scalars


class Mechanism(PlanarMechanism):
    """Bodies in space, parameters and constraints; otherwise as `kincompile.Mechanism`.

    A body has seven coordinates, x, y, z and the Euler parameters e0 to e3, and an equation of its
    own, e0^2 + e1^2 + e2^2 + e3^2 = 1, called ``norm_<body>``. These come after all others.
    """

    fixed = GROUND
    point_type = SpatialPoint
    limit_type = SpatialLimit
    bodies: list[SpatialBody]  # type: ignore[assignment]

    def body(  # type: ignore[override]  # a place and an orientation
        self,
        name: str,
        position: Scalars = (0, 0, 0),
        orientation: Any = None,
        *,
        axis: Scalars | None = None,
        angle: Scalar | None = None,
        x: Scalars | None = None,
        y: Scalars | None = None,
        z: Scalars | None = None,
        mass: Scalar | None = None,
        inertia: Any = None,
        centre: Scalars = (0, 0, 0),
        outline: Any = (),
    ) -> SpatialBody:
        """Add a body and return it.

        Its orientation, a guess like its position, is given in one way: as `orientation`, by `axis`
        and `angle`, or by two of its axes; without, its axes are the ground's.

        Parameters
        ----------
        name
            Name of the body.
        position
            Guess of x, y, z [length] for Newton's method.
        orientation
            Euler parameters (e0, e1, e2, e3), a rotation matrix, or a
            `scipy.spatial.transform.Rotation`.
        axis, angle
            The direction about which it is turned, and the angle [rad], a number or an expression
            of parameters.
        x, y, z
            Directions of its axes in the ground's frame. Of two that are not at a right angle the
            first is kept.
        mass, inertia
            Mass, and the inertia about the centre of mass along the body's axes: its diagonal
            (J_xi, J_eta, J_zeta) or a matrix of three rows; numbers or expressions of parameters.
        centre
            Centre of mass (xi, eta, zeta) in the body's frame [length].
        outline
            Solids for pictures, each by the corners (xi, eta, zeta) of its hull in the body's frame
            [length], 4 or more; without, a hull of its joint points is drawn.

        Warns
        -----
        KincompileWarning
            If the Euler parameters have another length than one: they are divided by it.
        """
        given = {"x": x, "y": y, "z": z}
        axes = {key: item for key, item in given.items() if item is not None}
        p: Scalars = IDENTITY
        problem = ""
        try:
            p, remark = euler_parameters(orientation, axis, angle, axes)
        except OrientationError as error:
            problem = f"body {name!r}: {error}"
        else:
            if remark:
                warnings.warn(f"body {name!r}: {remark}", KincompileWarning, stacklevel=2)
        start = (*_flat(position), *p)
        body = SpatialBody(
            name, start, outline, problem=problem, mass=mass, inertia=inertia, centre=centre
        )
        self.bodies.append(body)
        return body

    def point(self, name: str, body: BodyLike, local: Scalars) -> SpatialPoint:
        """Name a point of a body and return it, as `kincompile.Mechanism.point`.

        Parameters
        ----------
        name
            Name of the point; the columns of a solution are ``x_<name>``, ``y_<name>`` and
            ``z_<name>`` [length], and their rates.
        body
            The body, or its name.
        local
            (xi, eta, zeta) in the body's frame [length], numbers or expressions of parameters.
        """
        return cast("SpatialPoint", super().point(name, body, local))

    def written(self) -> list[Constraint | Equation]:
        """Return the constraints, then the normalization of each body."""
        own = [Normalization(f"norm_{body.name}", body) for body in self.bodies]
        return [*self.constraints, *own]


def _flat(position: Any) -> tuple[Scalar, ...]:
    """Return the components of a position; anything else is kept, and refused later."""
    try:
        return tuple(position)
    except TypeError:
        return (position,)

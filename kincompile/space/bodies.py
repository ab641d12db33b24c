"""Bodies in space and their orientation."""

from __future__ import annotations

from collections.abc import Sized
from dataclasses import field
from typing import TYPE_CHECKING, Any

from kincompile.calculus.space import SpatialFrame
from kincompile.errors import ModelError
from kincompile.model import declared as kinds
from kincompile.model.bodies import Body, BodyKind
from kincompile.model.declared import declared, given
from kincompile.names import shown
from kincompile.space.points import SpatialPoint

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import sympy

    from kincompile.model.expressions import Scalars


def require_three(given: object, what: str) -> None:
    """Refuse what has not three components."""
    if not isinstance(given, Sized) or len(given) != SpatialFrame.size:
        raise ModelError(f"{what} is {shown(given)}: give three components")


ALIKE = (
    "AbsoluteX", "AbsoluteY", "AbsoluteDistance", "RelativeX", "RelativeY", "Distance", "Revolute",
    "Translational", "Force", "FollowerForce", "Torque", "Spring", "TorsionSpring", "HingeFriction",
    "SliderFriction",
)  # fmt: skip
"""Types of constraints and loads that have the names of planar ones."""

SPATIAL = BodyKind(
    frame=SpatialFrame,
    units=(None, None, None, "", "", "", ""),
    drivers=("AbsoluteX", "AbsoluteY", "AbsoluteZ", *("AbsoluteOrientation",) * 4),
    placed_by="x, y and z of its origin and the Euler parameters of its frame",
    written_in="Euler parameters",
    turning=("AbsoluteOrientation", "RelativeRotation", "Spherical", "Universal"),
    elsewhere={
        **{name: f"spatial.{name}" for name in ALIKE},
        "AbsoluteAngle": "spatial.RelativeRotation from the ground",
        "RelativeAngle": "spatial.RelativeRotation",
        "RevoluteTranslational": "spatial.PointOnLine",
        "TranslationalDistance": "spatial.RelativeTranslation",
        "Gear": "an Equation between two spatial.JointAngle",
        "RackAndPinion": "an Equation between a spatial.JointAngle and a way",
    },
    masses="kincompile.space.masses",
    home=f"{__name__}:SPATIAL",
)


_PLACE = kinds.components(3, words="[x, y, z]")
_ROWS = kinds.components(3, kinds.components(3, words="[., ., .]"))
INERTIA = kinds.any_of(kinds.components(3, words="[J_xi, J_eta, J_zeta]"), _ROWS) | {
    "description": "[J_xi, J_eta, J_zeta], or three rows of a matrix"
}
"""The kind of an inertia about the centre of mass."""


@declared(repr=False)
class Placed:
    """A body in space as it is written: where it is, and how its axes are turned."""

    name: str = given(kinds.NAME, "Name of the body.")
    position: Scalars = given(
        _PLACE, "Guess of its origin.", default=(0, 0, 0), unit="length", always=True
    )
    orientation: Any = given(
        kinds.any_of(kinds.components(4, words="[e0, e1, e2, e3]"), _ROWS)
        | {"description": "[e0, e1, e2, e3], or three rows of a matrix"},
        "Euler parameters, or a rotation matrix.", default=None,
    )  # fmt: skip
    axis: Any = given(_PLACE, "Direction about which it is turned.", default=None, kw_only=True)
    angle: Any = given(kinds.EXPRESSION, "By how much.", default=None, unit="rad", kw_only=True)
    x: Any = given(_PLACE, "Direction of its xi axis.", default=None, kw_only=True)
    y: Any = given(_PLACE, "Direction of its eta axis.", default=None, kw_only=True)
    z: Any = given(_PLACE, "Direction of its zeta axis.", default=None, kw_only=True)
    mass: Any = given(kinds.EXPRESSION, "Its mass.", default=None, kw_only=True)
    inertia: Any = given(
        INERTIA, "Its inertia about the centre of mass.", default=None, kw_only=True
    )
    centre: Scalars = given(
        kinds.components(3, words="[xi, eta, zeta]"), "Centre of mass in the body's frame.",
        default=(0, 0, 0), unit="length", kw_only=True,
    )  # fmt: skip
    outline: Any = given(
        kinds.array(kinds.array(kinds.components(3, words="[xi, eta, zeta]"), 4))
        | {"description": "a list of solids, each a list of corners [xi, eta, zeta], 4 or more"},
        "The hulls of corners in the body's frame, for pictures.", default=(), unit="length",
        kw_only=True,
    )  # fmt: skip


@declared(slots=True, repr=False)
class SpatialBody(Body):
    """A rigid body in space: x, y, z [length] of its origin and Euler parameters e0 to e3.

    Made by `spatial.Mechanism.body`; the ground is `spatial.Mechanism.ground`.
    """

    guess: Scalars = SPATIAL.ground
    centre: Scalars = field(default=(0, 0, 0), kw_only=True)
    kind: BodyKind = field(default=SPATIAL, kw_only=True, repr=False)

    def written(self) -> Placed:
        """Return what a file has of it: Euler parameters, whichever way they were given."""
        given = {"mass": self.mass, "inertia": self.inertia, "centre": self.centre}
        return Placed(self.name, self.guess[:3], self.guess[3:], outline=self.outline, **given)

    @property
    def solids(self) -> Sequence[tuple[str, Any]]:
        """The solids of its outline, numbered."""
        return [(f", solid {k}", corners) for k, corners in enumerate(self.outline, 1)]

    def outline_by(self, change: Callable[[Any], Any]) -> list[Any]:
        """Return its outline with other corners."""
        return [[change(corner) for corner in solid] for solid in self.outline]

    @property
    def z(self) -> sympy.Expr:
        """Symbol of the z coordinate of the body's origin."""
        return self._coordinate(2)

    @property
    def p(self) -> tuple[sympy.Expr, ...]:
        """Symbols of the Euler parameters."""
        return self.symbols[3:]

    @property
    def p_dot(self) -> tuple[sympy.Expr, ...]:
        """Symbols of the rates of the Euler parameters."""
        return tuple(map(self._rate, range(3, 7)))

    @property
    def z_dot(self) -> sympy.Expr:
        """Symbol of the rate of z."""
        return self._rate(2)

    def direction(self, local: Scalars) -> tuple[sympy.Expr, ...]:
        """Return the global components A v of a vector v that is fixed in the body."""
        require_three(local, f"a direction of {self.name!r}")
        origin = SpatialPoint(self.name, self, (0, 0, 0))
        ends = zip(
            SpatialPoint(self.name, self, local).coordinates, origin.coordinates, strict=True
        )
        return tuple((end - start).doit().expand() for end, start in ends)

    @property
    def omega(self) -> tuple[sympy.Expr, ...]:
        """The angular velocity in global components, 2 E p_dot (Haug 9.3)."""
        return self._spin(1)

    @property
    def omega_fixed(self) -> tuple[sympy.Expr, ...]:
        """The angular velocity in body-fixed components, 2 G p_dot (Haug 9.3)."""
        return self._spin(-1)

    def _spin(self, sign: int) -> tuple[sympy.Expr, ...]:
        """Return twice -e p0_dot + (e0 I + e~) p_dot, with -e~ for the sign -1."""
        (e0, *e), (e0_dot, *e_dot) = self.p, self.p_dot
        turned = (e[k - 2] * e_dot[k - 1] - e[k - 1] * e_dot[k - 2] for k in range(3))
        rows = zip(e, e_dot, turned, strict=True)
        return tuple(2 * (e0 * b - e0_dot * a + sign * c) for a, b, c in rows)

    @property
    def on_request(self) -> tuple[tuple[str, sympy.Expr, str], ...]:
        """Name, expression and unit of the components of its angular velocity."""
        axes = ("x", "y", "z", "xi", "eta", "zeta")
        spins = zip(axes, (*self.omega, *self.omega_fixed), strict=True)
        return tuple((f"omega_{axis}_{self.name}", spin, "rad/s") for axis, spin in spins)


GROUND = SpatialBody("ground", is_ground=True)

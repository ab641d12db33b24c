"""Bodies, the ground and parameters."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.calculus.symbols import Frame, PlaneFrame
from kincompile.html import Shown
from kincompile.model import declared as kinds
from kincompile.model.declared import declared, given
from kincompile.model.expressions import NotAnExpressionError, as_expression, number_in
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from kincompile.model.expressions import Scalar, Scalars


@dataclass(frozen=True, slots=True, eq=False)
class BodyKind:
    """A kind of body: what its coordinates are."""

    frame: type[Frame]  # the frame of a body i or j in the calculus, by its index
    units: tuple[str | None, ...]  # unit of each coordinate, None for that of lengths
    drivers: tuple[str, ...]  # name of the constraint type that drives each
    # What places a body, and what its formulas are written in, in words.
    placed_by: str
    written_in: str
    # What to take in place of constraint types of the other kinds of bodies, by their names.
    elsewhere: Mapping[str, str]
    # Where this constant is, which a copy in another process is again.
    home: str
    # The module that makes a load of a body's mass; loaded where a body has one.
    masses: str = "kincompile.model.masses"
    # Names of the types that drive all turning of a body, and one turn of it; of a ball joint, and
    # of the joint that holds the spin which two ball joints leave.
    turning: tuple[str, str, str, str] = ("", "", "", "")

    def __reduce__(self) -> tuple[Any, ...]:
        """Kinds are compared by identity: a pickle names the constant."""
        return resolve_name, (self.home,)

    @property
    def ground(self) -> tuple[int, ...]:
        """Values of the ground's coordinates."""
        return self.frame.ground

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the coordinates of a point in the body's frame."""
        return ("xi", "eta", "zeta")[: self.frame.size]

    @property
    def letters(self) -> tuple[str, ...]:
        """Letter of each coordinate; its name is the letter and the body's."""
        return self.frame.letters


PLANAR = BodyKind(
    frame=PlaneFrame,
    units=(None, None, "rad"),
    drivers=("AbsoluteX", "AbsoluteY", "AbsoluteAngle"),
    placed_by="x and y of its origin and the angle phi of its frame",
    written_in="sines and cosines",
    elsewhere={
        "Spherical": "Revolute",
        "Cylindrical": "Translational, or RevoluteTranslational",
        "RelativeRotation": "RelativeAngle",
        "RelativeTranslation": "TranslationalDistance",
        "PointOnLine": "RevoluteTranslational",
        "FollowerTorque": "Torque",
    },
    home=f"{__name__}:PLANAR",
)


@declared(slots=True, repr=False)
class Body(Shown):
    """A planar rigid body with coordinates x, y [length] of its origin and angle phi [rad].

    Made by `Mechanism.body`; the ground is `Mechanism.ground`. The corners of its outline are in
    its own frame. Where it has a mass, that has an inertia about its centre, or is a plate's.
    """

    name: str = given(kinds.NAME, "Name of the body.")
    guess: Scalars = given(
        kinds.components(3, words="[x, y, phi]"), "Start values for Newton's method.",
        default=(0, 0, 0), always=True,
    )  # fmt: skip
    outline: Sequence[Scalars] = given(
        kinds.array(kinds.components(2, words="[xi, eta]"), 3)
        | {"description": "a list of corners [xi, eta], 3 or more"},
        "A polygon in the body's frame, for pictures.", default=(), unit="length",
    )  # fmt: skip
    is_ground: bool = field(default=False, kw_only=True)
    kind: BodyKind = field(default=PLANAR, kw_only=True, repr=False)
    mass: Scalar | None = given(kinds.EXPRESSION, "Its mass.", default=None, kw_only=True)
    inertia: Any = given(
        kinds.EXPRESSION, "Its inertia about the centre of mass.", default=None, kw_only=True
    )
    centre: Scalars = given(
        kinds.components(2, words="[xi, eta]"), "Centre of mass in the body's frame.",
        default=(0, 0), unit="length", kw_only=True,
    )  # fmt: skip
    density: Scalar | None = given(
        kinds.EXPRESSION, "Density of a plate with its outline.", default=None, kw_only=True
    )
    thickness: Scalar | None = given(
        kinds.EXPRESSION, "Thickness of that plate.", default=None, unit="length", kw_only=True
    )
    # What is wrong with its guess, as it was given.
    problem: str = field(default="", kw_only=True, repr=False)

    def written(self) -> Any:
        """Return what a file has of it, as a declared class."""
        return self

    def to_text(self) -> str:
        """Return its name, coordinates and guess."""
        names = ", ".join(self.coordinates)
        return f"{self.name} with {names}, guess ({', '.join(map(str, self.guess))})"

    @property
    def solids(self) -> Sequence[tuple[str, Any]]:
        """What its outline is made of, the corners of each, and what tells it from others."""
        return [("", self.outline)]

    def outline_by(self, change: Callable[[Any], Any]) -> list[Any]:
        """Return its outline with other corners."""
        return [change(corner) for corner in self.outline]

    @property
    def is_heavy(self) -> bool:
        """Whether it was given anything that belongs to a mass."""
        given = (self.mass, self.inertia, self.density, self.thickness)
        return any(item is not None for item in given) or tuple(self.centre) != (0,) * len(
            self.kind.axes
        )

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates that a body of this name has, in order."""
        return tuple(f"{letter}_{self.name}" for letter in self.kind.letters)

    def _coordinate(self, index: int) -> sympy.Expr:
        ground: sympy.Expr = sympy.Integer(self.kind.ground[index])
        return ground if self.is_ground else sympy.Symbol(self.coordinates[index])

    def _rate(self, index: int) -> sympy.Expr:
        return sympy.S.Zero if self.is_ground else sympy.Symbol(rate(self.coordinates[index]))

    @property
    def symbols(self) -> tuple[sympy.Expr, ...]:
        """Symbols of the coordinates, in order; of the ground their values."""
        return tuple(map(self._coordinate, range(len(self.kind.letters))))

    @property
    def on_request(self) -> tuple[tuple[str, sympy.Expr, str], ...]:
        """Name, expression and unit of what a solution has beside coordinates: here nothing."""
        return ()

    @property
    def x(self) -> sympy.Expr:
        """Symbol of the x coordinate of the body's origin."""
        return self._coordinate(0)

    @property
    def y(self) -> sympy.Expr:
        """Symbol of the y coordinate of the body's origin."""
        return self._coordinate(1)

    @property
    def phi(self) -> sympy.Expr:
        """Symbol of the body's angle."""
        return self._coordinate(2)

    @property
    def x_dot(self) -> sympy.Expr:
        """Symbol of the rate of x."""
        return self._rate(0)

    @property
    def y_dot(self) -> sympy.Expr:
        """Symbol of the rate of y."""
        return self._rate(1)

    @property
    def phi_dot(self) -> sympy.Expr:
        """Symbol of the angular velocity."""
        return self._rate(2)


GROUND = Body("ground", is_ground=True)


def body_columns(bodies: Sequence[Body]) -> tuple[range, ...]:
    """Return the columns of each body's coordinates: bodies come first, in order."""
    ends = accumulate((len(body.kind.letters) for body in bodies), initial=0)
    return tuple(range(first, end) for first, end in pairwise(ends))


@declared(slots=True)
class Parameter:
    """A number that may change at run time without recompiling.

    `range` are the ends of the slider that a page has for it; None for half and double the default.
    """

    name: str = given(kinds.NAME, "Name of the parameter.")
    default: float | None = given(kinds.CONSTANT, "Its value where none is given at run time.")
    unit: str = given(kinds.UNIT, "Its unit, for documentation.", default="")
    # Not of the code, whose fingerprint is that of what is shown here.
    range: tuple[float, float] | None = given(
        kinds.components(2, words="[least, greatest]"), "Its values on the slider of a page.",
        default=None, is_shown=False,
    )  # fmt: skip


def default_values(parameters: Iterable[Parameter]) -> dict[str, float]:
    """Return the default values that are numbers; the parameters need not be checked yet."""
    found = {}
    for item in parameters:
        with suppress(NotAnExpressionError):
            value = number_in(as_expression(item.default), str(item.unit), {})
            if value is not None:
                found[str(item.name)] = value
    return found


@declared(slots=True)
class Coordinate:
    """A generalised coordinate: its name, the guess where Newton starts, and its unit."""

    name: str = given(kinds.NAME, "Name of the coordinate.")
    guess: float = given(
        kinds.EXPRESSION, "Start value for Newton's method.", default=0.0, always=True
    )
    unit: str = ""

"""The arguments of constraint types: kinds, types for editors, and how a type declares them.

    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")

declares a field, its symbol in the textbook's formula, and the line that documents it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, field
from enum import Enum
from typing import Any, TypeAlias

import numpy as np
import sympy
from numpy.typing import NDArray

from kincompile.model.bodies import Body
from kincompile.model.expressions import Scalar, Scalars

BodyLike: TypeAlias = Body | str
"""A body or its name; `Mechanism.ground`, or ``"ground"``, is the fixed frame."""

ValueLike: TypeAlias = Scalar
"""A number, or an expression of parameters; of `t` too, where it is the value of a driver."""

PointLike: TypeAlias = Scalars
"""A pair (xi, eta)."""

PlaceLike: TypeAlias = Scalars | str
"""A pair (xi, eta), or the name of a joint that is drawn on the body."""

ProfileLike: TypeAlias = (
    ValueLike
    | Callable[[sympy.Symbol], ValueLike]
    | tuple[Sequence[float] | NDArray[np.float64], Sequence[float] | NDArray[np.float64]]
)
"""A polar radius: an expression of `alpha`, a function of alpha, or a table (angles, radii)."""


class Kind(Enum):
    """What an argument of a constraint is."""

    BODY = "a body"
    POINT = "a point (xi, eta) in the body's frame"
    AXIS = "a direction (xi, eta) in the body's frame, not zero"
    SCALAR = "a number or an expression of parameters"
    RADIUS = "a radius, not zero"
    VALUE = "a number or an expression of parameters and t"
    DISTANCE = "a positive distance, or an expression of parameters and t"
    PROFILE = "a radius rho(alpha) or a table (angles, radii)"
    LOAD = "a number or an expression of parameters, t, coordinates and rates"
    LOADS = "components of a vector, each such an expression"


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument of a constraint type."""

    kind: Kind  # what may be given
    symbol: str  # its symbol in the textbook's formula
    # What it means, for the docstring; ``{on}`` stands for the argument that names its body,
    # ``{place}`` for its coordinates, ``{ground}`` for a remark on the ground.
    text: str
    # The symbol of the body whose frame a point or a direction is given in, ``"ground"`` for the
    # fixed frame; "" for what belongs to no frame.
    on: str = ""
    unit: str = ""  # ``"rad"`` of an angle, ``"length"`` of a length, "" of what is neither


_DRIVEN = "a number or an expression of parameters; with `t` in it, a driver."


def _declared(
    kind: Kind, symbol: str, text: str, on: str = "", unit: str = "length", default: Any = MISSING
) -> Any:
    made = Argument(kind, symbol, text, on, unit)
    return field(default=default, metadata={"argument": made})


def body(symbol: str) -> Any:
    """Declare a body; its symbol is the index of its coordinates, ``"i"`` or ``"j"``."""
    return _declared(Kind.BODY, symbol, "Body, or its name{ground}.", unit="")


def point(symbol: str, on: str, what: str = "Point") -> Any:
    """Declare a point in the frame of a body, or of the ground."""
    return _declared(Kind.POINT, symbol, f"{what} {{place}} [length].", on)


def axis(symbol: str, on: str) -> Any:
    """Declare a direction in the frame of a body."""
    text = "Direction {place}, of any length but zero."
    return _declared(Kind.AXIS, symbol, text, on, unit="")


def vector(symbol: str, on: str) -> Any:
    """Declare a vector in the frame of a body, whose length counts."""
    return _declared(Kind.AXIS, symbol, "Vector {place}, not zero.", on, unit="")


def cross(symbol: str, on: str) -> Any:
    """Declare the direction at a right angle to an axis from which a joint counts angles."""
    text = "Direction {place} at a right angle to the axis; what is along the axis is left out."
    return _declared(Kind.AXIS, symbol, text, on, unit="")


def value(unit: str = "length") -> Any:
    """Declare the value C of a constraint, which may be a function of time."""
    return _declared(Kind.VALUE, "C", f"C [{unit}], {_DRIVEN}", unit=unit)


def distance() -> Any:
    """Declare a distance C > 0, which may be a function of time."""
    return _declared(Kind.DISTANCE, "C", f"C > 0 [length], {_DRIVEN}")


def radius(symbol: str, what: str = "Pitch radius") -> Any:
    """Declare a length that is not zero, fixed in its body: a radius, a semi-axis."""
    text = f"{what} [length], a number or an expression of parameters, not zero."
    return _declared(Kind.RADIUS, symbol, text)


def angle(symbol: str, on: str, what: str) -> Any:
    """Declare a direction in the frame of a body, given by its angle."""
    return _declared(
        Kind.SCALAR, symbol, f"Direction [rad] {what}, in the frame of {{on}}.", on, "rad"
    )


def profile(symbol: str) -> Any:
    """Declare the profile of a cam."""
    text = (
        "Polar radius [length] about the centre: an expression of `alpha`, a function of alpha, or "
        "a table (angles [rad], radii) over one revolution."
    )
    return _declared(Kind.PROFILE, symbol, text)


def attribute(symbol: str, text: str, unit: str = "", default: ValueLike | None = None) -> Any:
    """Declare a number or an expression of parameters; with a default it may be left out."""
    about = f"{text}, a number or an expression of parameters."
    given = MISSING if default is None else default
    return _declared(Kind.SCALAR, symbol, about, unit=unit, default=given)


def load(symbol: str, text: str, default: ValueLike | None = None) -> Any:
    """Declare a force or a torque; with a default it may be left out."""
    about = f"{text}, a number or an expression of parameters, t, coordinates and rates."
    given = MISSING if default is None else default
    return _declared(Kind.LOAD, symbol, about, unit="", default=given)


def measured(symbol: str, text: str, default: None) -> Any:
    """Declare a coordinate that may be left out: the mechanism then gets one."""
    return _declared(Kind.LOAD, symbol, text, unit="", default=default)


def loads(symbol: str, text: str) -> Any:
    """Declare the components of a force."""
    about = f"{text}, numbers or expressions of parameters, t, coordinates and rates."
    return _declared(Kind.LOADS, symbol, about, unit="")

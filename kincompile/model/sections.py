"""Tables of a model's file besides its bodies and constraints: times, a cam's profile, a drawing.

A part of a drawing is a method of `Sketch`: its first field says which and its name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile.model import declared as kind
from kincompile.model import motion
from kincompile.model.bodies import Body
from kincompile.model.declared import declared, given
from kincompile.model.expressions import t
from kincompile.model.laws import RISES
from kincompile.model.limits import JointLimit
from kincompile.model.points import BodyPoint
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import sympy

MOST_POINTS = 10_000_000
"""Largest time grid that a file may ask for."""

SMOOTHNESS = 4
"""Continuous derivatives of a profile given by a table: it is a periodic quintic spline."""

_SMOOTH = (
    f"{SMOOTHNESS} (a table becomes a periodic quintic spline with {SMOOTHNESS} continuous "
    f"derivatives; write smoothness = {SMOOTHNESS})"
)


@declared
class Analysis:
    """The time grid that commands take where none is given."""

    end: Any = given(
        kind.CONSTANT, "The last time, a number or a formula of parameters.", default=1.0,
        always=True,
    )  # fmt: skip
    points: int = given(
        kind.whole(1, MOST_POINTS), "Equally spaced times from 0 to the end.", default=101,
        always=True,
    )  # fmt: skip


@declared
class Profile:
    """The profile of a cam by a table: a periodic spline goes through it."""

    angles: Sequence[float] = given(
        kind.array(kind.NUMBER, 6), "Polar angles over one revolution.", unit="rad"
    )
    radii: Sequence[float] = given(kind.array(kind.NUMBER, 6), "Polar radii.", unit="length")
    smoothness: int = given(
        {"const": SMOOTHNESS, "description": _SMOOTH},
        "Continuous derivatives of the spline through it.",
    )


_LAW = kind.one_of(RISES)
_LAWS = kind.any_of(_LAW, kind.array(_LAW)) | {
    "description": f"a law of motion, or a list of them ({listed(RISES, 20)})"
}
_COLUMN = kind.array(kind.EXPRESSION, 3) | {"description": "a list of three numbers or more"}


@declared
class Motion:
    """A motion as a table of a file."""

    def expression(self) -> sympy.Expr:
        """Return it as a function of time, or of what it is over."""
        raise NotImplementedError


@declared
class MotionSteps(Motion):
    """From rest to rest, with dwells: the arguments of `motion.sequence`."""

    points: Sequence[Any] = given(
        kind.array(kind.components(2, words="[time, value]"), 2)
        | {"description": "a list of points [time, value], 2 or more"},
        "Rising times, and where it rests; equal values in turn are a dwell.",
    )
    law: str | Sequence[str] = given(
        _LAWS, "The law of all steps, or that of each.", default="modified sine"
    )
    ramp: Any = given(
        kind.EXPRESSION,
        "Share of a step, for each ramp of the law constant velocity; a quarter without.",
        default=None,
    )

    def expression(self) -> sympy.Expr:
        """Return it as a function of time."""
        shape = {} if self.ramp is None else {"ramp": self.ramp}
        return motion.sequence(self.points, self.law, **shape)


@declared
class MotionRows(Motion):
    """A smooth spline through values over time: the arguments of `motion.table`."""

    times: Sequence[Any] = given(_COLUMN, "Rising times.")
    values: Sequence[Any] = given(_COLUMN, "The value at each.")
    velocities: Sequence[Any] = given(
        kind.components(2, words="[first, last]"), "Those at both ends.", default=(0, 0),
        always=True,
    )  # fmt: skip
    over: Any = given(
        kind.EXPRESSION, "What stands in the place of the time; `t` without.", default=None
    )

    def expression(self) -> sympy.Expr:
        """Return it as a function of time, or of what it is over."""
        made = motion.table(self.times, self.values, velocities=self.velocities)
        return made if self.over is None else made.subs(t, self.over)


_PLACE = kind.components(2, words="[x, y]")


@declared
class Drawing:
    """A drawing in place of bodies and joints, or beside them."""

    lengths: Mapping[str, float] | None = given(
        kind.named(kind.NUMBER), "Parameters in the unit of length.", default=None
    )
    ground: Mapping[str, Any] | None = given(
        kind.named(_PLACE), "Joints of the ground, exactly.", default=None, unit="length"
    )
    joints: Mapping[str, Any] | None = given(
        kind.named(_PLACE), "Joints, roughly.", default=None, unit="length"
    )
    live: bool | None = given(
        kind.FLAG, "Whether each number of a joint's place is a parameter, as `A_x` and `A_y`.",
        default=None,
    )  # fmt: skip
    parts: Sequence[Any] = given(
        kind.tables("part"), "Links and others, in their order.", kw_only=True
    )


@declared
class Heavy:
    """What has a mass: about its centre, in the frame of its body."""

    mass: Any = given(kind.EXPRESSION, "Its mass.", default=None, kw_only=True)
    inertia: Any = given(
        kind.EXPRESSION, "Its moment of inertia about the centre.", default=None, kw_only=True
    )
    centre: Any = given(_PLACE, "Its centre of mass.", unit="length", default=None, kw_only=True)


@declared
class Joined:
    """A rigid link, as it is drawn."""

    link: str = given(kind.NAME, "Name of the link and of its body.")
    joints: str = given(kind.TEXT, 'Its joints, as `"A B C"`.')


@declared
class Link(Joined, Heavy):
    """A rigid link; of more joints than two lengths and places are called as its joints are."""

    length: Any = given(
        kind.EXPRESSION, "Length of a link of two joints.", default=None, unit="length"
    )
    density: Any = given(
        kind.EXPRESSION, "In place of its mass: that by volume.", default=None, kw_only=True
    )
    width: Any = given(
        kind.EXPRESSION, "That of a straight bar.", unit="length", default=None, kw_only=True
    )
    thickness: Any = given(
        kind.EXPRESSION,
        "That of a plate; of a bar its width without.",
        unit="length",
        default=None,
        kw_only=True,
    )


@declared
class Wheel(Heavy):
    """A body that turns about one joint."""

    wheel: str = given(kind.NAME, "Name of the body.")
    joint: str = given(kind.TEXT, "The joint about which it turns.")


_ALONG = kind.any_of(kind.TEXT, _PLACE) | {
    "description": "two joints in quotes, or a direction [x, y]"
}


@declared
class Slider(Heavy):
    """A body that slides along a straight guide without turning."""

    slider: str = given(kind.NAME, "Name of the body.")
    joints: str = given(kind.TEXT, "Joints that it carries; the first is on the guide.")
    along: Any = given(_ALONG, 'Its guide: two joints of one link, `"C D"`, or a direction.')
    on: str | None = given(
        kind.TEXT, "The link that has the guide, the ground without.", default=None, kw_only=True
    )


@declared
class Slot:
    """A joint of a link that runs along a straight line of another."""

    slot: str = given(kind.TEXT, "Name of the joint.")
    along: Any = given(_ALONG, "The line, as that of a slider.")
    on: str | None = given(
        kind.TEXT, "The link that has the line, the ground without.", default=None, kw_only=True
    )


@declared
class Gear:
    """Two links roll on each other as gears."""

    gear: str = given(kind.NAME, "Name of the gear.")
    i: str = given(kind.TEXT, "A link or wheel.")
    centre_i: str = given(kind.TEXT, "The joint at its centre.")
    radius_i: Any = given(kind.EXPRESSION, "Its pitch radius.", unit="length")
    j: str = given(kind.TEXT, "Another link or wheel.")
    centre_j: str = given(kind.TEXT, "The joint at its centre.")
    radius_j: Any = given(kind.EXPRESSION, "Its pitch radius.", unit="length")


@declared
class Driven:
    """A motion that is prescribed."""

    drive: str = given(kind.TEXT, 'A link, a slider, two joints `"A B"`, or `"A.x"` of a joint.')
    value: Any = given(kind.VALUE, "What it is: a formula of `t`, or a motion.")


@declared
class Drive(Driven):
    """A motion that is prescribed, in the plane."""

    against: str | None = given(
        kind.TEXT, "The link from which the angle of a link is counted.", default=None
    )


@declared
class Point:
    """A joint whose place and path are asked for; free ends of links are points without it."""

    point: str = given(kind.TEXT, "Name of the joint.")


TABLES: Mapping[str, type] = {
    "body": Body, "point": BodyPoint, "limit": JointLimit, "sketch": Drawing,
}  # fmt: skip
"""Tables that are others in space."""

PARTS: Mapping[str, type] = {
    "link": Link, "wheel": Wheel, "slider": Slider, "slot": Slot, "gear": Gear, "drive": Drive,
    "point": Point,
}  # fmt: skip
"""Parts of a drawing: methods of `Sketch`, and their arguments in order."""

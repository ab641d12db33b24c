"""What a sketch knows so far: joints, links and problems; names and numbers are read here."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.model.bodies import Body, default_values
from kincompile.model.expressions import (
    CALCULATED,
    NotAnExpressionError,
    Scalar,
    as_expression,
)
from kincompile.model.link_shape import (
    Outline,
    drawn_angle,
    listed_pairs,
    number,
    pairs_by_name,
)
from kincompile.names import listed, suggestion

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.model.arguments import BodyLike, PointLike
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.scope import Point


@dataclass(frozen=True, slots=True)
class Link:
    """A link as it was made."""

    body: Body
    places: Mapping[str, Point]  # its joints in the frame of the body
    angle: Scalar = 0.0  # angle of the body in the drawing [rad]
    guide: Line | None = None  # of a slider, the line along which it slides
    # In space the axis of the first hinge in which it hangs, on the other link.
    hinge: Line | None = None

    def turned(self, vector: Point) -> Point:
        """Return a vector of the drawing in the frame of the link."""
        if not self.angle:
            return vector
        cosine: Scalar
        sine: Scalar
        if isinstance(self.angle, sympy.Expr):
            cosine, sine = sympy.cos(self.angle), sympy.sin(self.angle)
        else:
            cosine, sine = float(CALCULATED.cos(self.angle)), float(CALCULATED.sin(self.angle))
        x, y = vector
        return x * cosine + y * sine, y * cosine - x * sine


@dataclass(frozen=True, slots=True)
class Line:
    """A straight line of a link, by a point and a direction in the link's frame."""

    link: Link
    point: Point
    axis: Point


def minus(point: Point, other: Point) -> Point:
    """Return the vector to a point from another."""
    return tuple(there - here for there, here in zip(point, other, strict=True))


@dataclass(slots=True)
class Drawn:
    """The joints, links and problems of a sketch so far.

    Nothing is refused here: a problem is noted, and what is returned lets the drawing go on.
    """

    mechanism: Mechanism
    joints: dict[str, Point] = field(default_factory=dict)
    links: dict[str, Link] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    axes: dict[str, Point] = field(default_factory=dict)  # of hinges in space
    is_live: bool = False  # whether places of joints are parameters

    def __post_init__(self) -> None:
        ground = self.mechanism.ground
        self.keep(Link(ground, {}))

    def keep(self, link: Link) -> None:
        """Note a link, whose joints its constraints and outputs may name."""
        self.links[link.body.name] = link
        self.mechanism.drawn[link.body.name] = link.places

    @property
    def size(self) -> int:
        """How many components a place has."""
        return len(self.mechanism.ground.kind.axes)

    @property
    def line_words(self) -> str:
        """How a line is given."""
        example = (1, *(0,) * (self.size - 1))
        return f"two joints of one link, along='C D', or a direction, along={example}"

    def first(self, joint: str) -> Link | None:
        """Return the first link that has a joint, or None."""
        return next((link for link in self.links.values() if joint in link.places), None)

    def holder(self, joint: str, what: str) -> Link | None:
        """Return the first link that has a joint; note a problem where none has it."""
        link = self.first(joint)
        if link is None and joint in self.joints:
            self.problems.append(f"{what}: no link has the joint {joint!r} yet; make it first")
        return link

    def link_of(self, given: Body | str, what: str) -> Link | None:
        """Return a link by its name or body; note a problem where there is none."""
        name = given.name if isinstance(given, Body) else given
        if name in self.links:
            return self.links[name]
        self.problems.append(
            f"{what}: there is no link {name!r}{suggestion(str(name), self.links)}; links so far "
            f"are: {listed(self.links)}"
        )
        return None

    def named(
        self, given: str | Iterable[str], what: str, least: int, most: int = 1000
    ) -> tuple[str, ...] | None:
        """Return names of joints; note what is wrong with them."""
        if not isinstance(given, Iterable):
            self.problems.append(f"{what}: {given!r} names no joints; give 'A B'")
            return None
        names = tuple(given.replace(",", " ").split() if isinstance(given, str) else given)
        unknown = [name for name in names if name not in self.joints]
        before = len(self.problems)
        if unknown:
            self.problems.append(
                f"{what}: unknown joints {listed(unknown)}"
                f"{suggestion(unknown[0], self.joints)}; joints are: {listed(self.joints)}"
            )
        if len(set(names)) < len(names):
            self.problems.append(f"{what}: {listed(names)} names a joint twice; name it once")
        if not least <= len(names) <= most:
            alone = "; a body with one joint is a wheel: s.wheel(name, joint)" if most > 2 else ""
            wanted = f"{least} or more" if most > least else f"{least}"
            self.problems.append(f"{what} has {len(names)} joints, and needs {wanted}{alone}")
        return names if len(self.problems) == before else None

    def outline(
        self,
        joints: Sequence[str],
        lengths: Mapping[frozenset[str], Scalar] | None = None,
        places: Mapping[str, Point] | None = None,
    ) -> Outline:
        """Return what is known of a link with these joints."""
        unit = self.mechanism.length_unit
        return Outline(joints, self.joints, lengths or {}, places or {}, self.values, unit)

    def angle(self, one: str, other: str) -> Scalar:
        """Return the direction from one joint to another [rad], of a live drawing an expression."""
        if not self.is_live:
            return drawn_angle(self.outline((one, other)), one, other)
        x, y = minus(self.joints[other], self.joints[one])
        angle: sympy.Expr = sympy.atan2(y, x)
        return angle

    @property
    def values(self) -> dict[str, float]:
        """Default values of the parameters declared so far."""
        return default_values(self.mechanism.parameters)

    def _scalar(self, given: Any, what: str) -> Scalar:
        """Return a number or an expression; note a problem with it, and take 1 instead."""
        try:
            value = as_expression(given)
        except NotAnExpressionError as error:
            self.problems.append(f"{what}: {error}; give a number or an expression of parameters")
            return 1
        if math.isnan(number(value, self.values)):
            self.problems.append(
                f"{what}: {value} has no value at the default parameters; declare what it depends "
                "on with s.parameter or s.length"
            )
            return 1
        return value

    def place(self, given: Any, what: str, expected: str = "") -> Point:
        """Return two or three numbers or expressions; note what is wrong with them."""
        try:
            found = () if isinstance(given, str) else tuple(given)
        except (TypeError, ValueError):
            found = ()
        if len(found) != self.size:
            expected = expected or f"a place ({', '.join('xyz'[: self.size])})"
            self.problems.append(f"{what}: {given!r} is not {expected}")
            return (0,) * self.size
        return tuple(self._scalar(item, what) for item in found)

    def lengths(
        self, what: str, joints: Sequence[str], length: Any, given: Mapping[str, Any]
    ) -> tuple[dict[frozenset[str], Scalar], dict[str, Point]]:
        """Return lengths by pairs of joints, and places by joint; note what is wrong with them."""
        lengths: dict[frozenset[str], Scalar] = {}
        places: dict[str, Point] = {}
        pairs = pairs_by_name(joints)
        if length is not None and len(joints) > 2:
            self.problems.append(
                f"{what} has {len(joints)} joints: name each length by its two joints, as "
                f"{joints[0]}{joints[1]}=..."
            )
        elif length is not None:
            given = {" ".join(joints): length, **given}
        for key, value in given.items():
            where = f"{what}, {key}"
            if key in joints[2:]:
                places[key] = self.place(value, where, "a place (xi, eta) in the frame of the link")
            elif len(meant := pairs.get(key, [])) == 1:
                lengths[meant[0]] = self._length(value, where)
            else:
                self.problems.append(f"{where}: {_not_a_length(key, joints, meant)}")
        return lengths, places

    def _length(self, given: Any, what: str) -> Scalar:
        value = self._scalar(given, what)
        size = number(value, self.values)
        if size > 0:
            return value
        self.problems.append(f"{what}: the length is {size:g}; give one that is positive")
        return 1

    def direction(self, given: Any, what: str, expected: str) -> Point:
        """Return a direction; note what is wrong with it."""
        found = self.place(given, what, expected)
        if all(number(part, self.values) == 0 for part in found):
            self.problems.append(f"{what}: the direction {found} has zero length; {expected}")
        return found

    def line(self, joint: str, along: str | PointLike, on: BodyLike, what: str) -> Line | None:
        """Return a line through two joints of a link, or through a drawn joint; note problems."""
        if isinstance(along, str):
            ends = self.named(along, what, 2, most=2)
            return None if ends is None else self._through(ends, what)
        link, axis = self.link_of(on, what), self.direction(along, what, self.line_words)
        named = self.named(joint, what, 1, most=1)
        if link is None or named is None:
            return None
        start = self.joints[joint]
        if not link.body.is_ground:
            start = link.turned(minus(start, self.joints[next(iter(link.places), joint)]))
        return Line(link, start, link.turned(axis))

    def _through(self, ends: Sequence[str], what: str) -> Line | None:
        """Return the line through two joints of one link; note a problem where none has both."""
        for link in self.links.values():
            if link.places.keys() >= set(ends):
                start, end = (link.places[joint] for joint in ends)
                return Line(link, start, minus(end, start))
        self.problems.append(
            f"{what}: no link has both {ends[0]} and {ends[1]}; give {self.line_words}"
        )
        return None


def _not_a_length(key: str, joints: Sequence[str], meant: Sequence[frozenset[str]]) -> str:
    """Say why a name is not that of a length or a joint of the link."""
    if len(meant) > 1:
        both = listed_pairs(meant, joints)
        return f"this may be {both}; write the two joints with _ between them"
    if key in joints:
        return f"{joints[0]} and {joints[1]} carry the frame of the link; give their distance"
    return (
        f"{key} is not a pair of its joints {listed(joints)}; name a length by two of them, as "
        f"{joints[0]}{joints[1]}=..., or the place of one, as P=(xi, eta)"
    )

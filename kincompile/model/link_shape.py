"""The shape of a link from a drawing and lengths: where its joints are in its own frame.

The frame has its origin at the first joint and its xi axis through the second. A joint whose place
is not given follows from its distances to two joints whose places are known (law of cosines), on
the side on which the drawing has it; without lengths it is where the drawing has it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import sympy

from kincompile.model.expressions import CALCULATED, Scalar, as_sympy, evaluate
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from kincompile.model.scope import Point

    Pair = frozenset[str]

FLAT = 1e-9
"""Height of a triangle, relative to its longest side, up to which it is a line."""


@dataclass(frozen=True, slots=True)
class Outline:
    """What is known of a link."""

    joints: Sequence[str]  # its joints; the first two carry the frame
    drawn: Mapping[str, Point]  # where the drawing has them
    lengths: Mapping[Pair, Scalar]  # distances of pairs of joints, as far as they are given
    places: Mapping[str, Point]  # joints whose place in the frame is given
    values: dict[str, float]
    unit: str


class ShapeError(ValueError):
    """Lengths that no link can have; it says which."""


def number(value: Scalar, values: dict[str, float]) -> float:
    """Return a value at the defaults; NaN where it has none."""
    found = evaluate(value, values)
    return math.nan if found is None else found


def shape(link: Outline) -> dict[str, Point]:
    """Return where each joint is in the frame of the link.

    Raises
    ------
    ShapeError
        Where the lengths are too few, too many, or cannot be met, and by how much.
    """
    first, second, *others = link.joints
    reach = link.lengths.get(frozenset((first, second)), drawn_distance(link, first, second))
    if number(drawn_distance(link, first, second), link.values) == 0:
        raise ShapeError(f"{first} and {second} are drawn at one place; draw them apart")
    found: dict[str, Point] = {first: (0, 0), second: (reach, 0), **link.places}
    used = {frozenset((first, second))}
    for joint in others:
        if joint not in found and not any(joint in pair for pair in link.lengths):
            found[joint] = _as_drawn(link, joint)
    while missing := [joint for joint in others if joint not in found]:
        placed = _next(link, missing, found)
        found[placed[0]] = _by_lengths(link, found, *placed)
        used |= {frozenset((placed[0], other)) for other in placed[1:]}
    if surplus := [pair for pair in link.lengths if pair not in used]:
        raise ShapeError(
            f"the link is over-dimensioned; remove the lengths {listed_pairs(surplus, link.joints)}"
        )
    return found


def drawn_distance(link: Outline, one: str, other: str) -> Scalar:
    """Return the distance of two joints in the drawing."""
    x, y = _from_to(link, one, other)
    if not (isinstance(x, sympy.Expr) or isinstance(y, sympy.Expr)):
        return math.hypot(x, y)
    distance: sympy.Expr = sympy.sqrt(as_sympy(x) ** 2 + as_sympy(y) ** 2)
    return distance


def drawn_angle(link: Outline, one: str, other: str) -> float:
    """Return the direction from one joint to another in the drawing [rad]."""
    x, y = (number(item, link.values) for item in _from_to(link, one, other))
    return float(CALCULATED.atan2(y, x))


def _from_to(link: Outline, one: str, other: str) -> Point:
    (x, y), (to_x, to_y) = link.drawn[one], link.drawn[other]
    return to_x - x, to_y - y


def _as_drawn(link: Outline, joint: str) -> Point:
    """Return a joint where the drawing has it, relative to the line of the first two."""
    first, second, *_ = link.joints
    reach = drawn_distance(link, first, second)
    along_x, along_y = _from_to(link, first, second)
    x, y = _from_to(link, first, joint)
    xi, eta = (x * along_x + y * along_y) / reach, (y * along_x - x * along_y) / reach
    size = number(reach, link.values)
    is_flat = abs(number(eta, link.values)) <= FLAT * size and _is_zero(eta)
    return (xi, 0 if is_flat else eta)


def _is_zero(value: Scalar) -> bool:
    """Return whether a number that is nearly zero is so at all values of its parameters."""
    return not isinstance(value, sympy.Expr) or not value.free_symbols or sympy.expand(value) == 0


def _next(link: Outline, missing: Sequence[str], found: Iterable[str]) -> tuple[str, str, str]:
    """Return a joint with lengths to two joints whose places are known, and those two."""
    for joint in missing:
        known = [other for other in found if frozenset((joint, other)) in link.lengths]
        if len(known) >= 2:
            return joint, known[0], known[1]
    joint = missing[0]
    given = [pair for pair in link.lengths if joint in pair]
    raise ShapeError(
        f"{joint} has only {listed_pairs(given, link.joints)}: give its lengths to two other "
        f"joints, or none, or its place in the frame of the link, {joint}=(xi, eta)"
    )


def _by_lengths(
    link: Outline, found: Mapping[str, Point], joint: str, one: str, other: str
) -> Point:
    """Return the apex of a triangle from its three sides, on the side where the drawing has it."""
    (x, y), (to_x, to_y) = found[one], found[other]
    base = _base(link, found, one, other)
    near, far = (link.lengths[frozenset((joint, end))] for end in (one, other))
    along = (near**2 - far**2 + base**2) / (2 * base)
    height = _height(link, (joint, one, other), (base, near, far), along)
    across_x, across_y = (to_x - x) / base, (to_y - y) / base
    return (
        x + along * across_x - height * across_y,
        y + along * across_y + height * across_x,
    )


def _base(link: Outline, found: Mapping[str, Point], one: str, other: str) -> Scalar:
    (x, y), (to_x, to_y) = found[one], found[other]
    if (x, y) == (0, 0) and to_y == 0:
        return to_x
    given = link.lengths.get(frozenset((one, other)))
    return sympy.sqrt((to_x - x) ** 2 + (to_y - y) ** 2) if given is None else given


def _height(
    link: Outline, corners: tuple[str, str, str], sides: tuple[Scalar, ...], along: Scalar
) -> Scalar:
    """Return the height of the apex above its base, negative on the right of it."""
    joint, one, other = corners
    base, near, far = (number(side, link.values) for side in sides)
    longest, rest = max(base, near, far), sum(sorted((base, near, far))[:2])
    if longest - rest > FLAT * longest:
        raise ShapeError(_no_triangle(link, corners, (base, near, far)))
    square = as_sympy(sides[1]) ** 2 - as_sympy(along) ** 2
    if rest - longest <= FLAT * longest:
        return _no_height(corners, square)
    x, y = (number(item, link.values) for item in _from_to(link, one, other))
    to_x, to_y = (number(item, link.values) for item in _from_to(link, one, joint))
    area, size = x * to_y - y * to_x, math.hypot(x, y) * math.hypot(to_x, to_y)
    if abs(area) <= FLAT * size:
        raise ShapeError(
            f"the drawing has {joint} on the line through {one} and {other}; draw it on the side "
            "on which it is"
        )
    height = math.sqrt(square) if square.is_number else sympy.sqrt(square)
    return height if area > 0 else -height


def _no_height(corners: tuple[str, str, str], square: sympy.Expr) -> Scalar:
    """Return 0, the height of three joints on a line, if they are on it at all parameters."""
    if _is_zero(square):
        return 0
    raise ShapeError(
        f"{listed(corners)} are on one line, and another value of a parameter would tear them "
        f"apart: give the place of {corners[0]} in the frame of the link, {corners[0]}=(xi, 0)"
    )


def _no_triangle(
    link: Outline, corners: tuple[str, str, str], sides: tuple[float, float, float]
) -> str:
    joint, one, other = corners
    named = dict(zip((f"{one} {other}", f"{joint} {one}", f"{joint} {other}"), sides, strict=True))
    longest = max(named, key=named.__getitem__)
    rest = [name for name in named if name != longest]
    total, unit = sum(named[name] for name in rest), f" {link.unit}" if link.unit else ""
    return (
        f"{joint}, {one} and {other} make no triangle: {longest} = {named[longest]:g}{unit} is "
        f"{named[longest] - total:.6g}{unit} longer than {rest[0]} and {rest[1]} together "
        f"({total:g}{unit})"
    )


def listed_pairs(pairs: Iterable[Pair], joints: Sequence[str]) -> str:
    """Name pairs of joints, in the order of their link."""
    return listed(" ".join(sorted(pair, key=joints.index)) for pair in pairs)


def pairs_by_name(joints: Sequence[str]) -> dict[str, list[Pair]]:
    """Return the pairs of joints that a name such as ``AB``, ``A_B`` or ``A B`` may mean."""
    found: dict[str, list[Pair]] = {}
    for one, other in combinations(joints, 2):
        for first, second in ((one, other), (other, one)):
            for name in dict.fromkeys((first + second, f"{first}_{second}", f"{first} {second}")):
                found.setdefault(name, []).append(frozenset((one, other)))
    return found

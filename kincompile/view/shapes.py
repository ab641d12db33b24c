"""`drawing`: the one description of a mechanism's shapes, from which plots and the page draw."""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.model.arguments import Kind
from kincompile.model.joints import Revolute
from kincompile.model.mechanism import system_of
from kincompile.model.resolve import Joint
from kincompile.view.body_shapes import links, outlines
from kincompile.view.joint_shapes import marks_of
from kincompile.view.marks import (
    GROUND_FRAME,
    Block,
    Drive,
    Mark,
    Pin,
    Place,
    Point,
    Rail,
    Span,
    moves_with,
    reach,
)
from kincompile.view.placed import Placed, Scene, frame_of, number_pair, world

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import TypeAlias

    from numpy.typing import ArrayLike, NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

    Array: TypeAlias = NDArray[np.float64]

PARTS = 50
"""Marks are measured in this part of the mechanism's diagonal."""

PITCH_LINE = ("s_P", "s_Q")
"""Symbols of the points between which a rack is drawn."""

OVERHANG = 3
"""How far a guide goes on beyond the motion, in sizes of marks."""


@dataclass(frozen=True, slots=True)
class JointLabel:
    """A constraint as it is pointed at.

    Attributes
    ----------
    name, kind
        Its name, and the name of its type.
    place
        Where it is; on a moving body where it has one. None for a free equation.
    is_driver
        Whether its value is a function of time.
    rows
        First row of Phi and number of rows.
    """

    name: str
    kind: str
    place: Place | None
    is_driver: bool
    rows: tuple[int, int]


@dataclass(frozen=True, slots=True)
class Drawing:
    """What a mechanism looks like.

    Attributes
    ----------
    name
        Name of the mechanism.
    bodies
        Names of the bodies; their index is their frame, and body k has the coordinates
        q[3k : 3k + 3].
    marks
        Everything that is drawn, from back to front.
    joints
        The constraints, in order.
    size
        A length in which pins and blocks are measured.
    """

    name: str
    bodies: tuple[str, ...]
    marks: tuple[Mark, ...]
    joints: tuple[JointLabel, ...]
    size: float

    @property
    def ground(self) -> tuple[Mark, ...]:
        """The marks that stand still."""
        return tuple(mark for mark in self.marks if moves_with(mark) == {GROUND_FRAME})

    def extent(self, q: ArrayLike) -> tuple[float, float, float, float]:
        """Return smallest x, largest x, smallest y, largest y of all marks.

        Parameters
        ----------
        q : array_like, shape (n,) or (N, n)
            Positions; those that are not finite are left out.
        """
        (x_low, y_low), (x_high, y_high) = _box(self.marks, _finite(q))
        pad = 2 * self.size
        return float(x_low - pad), float(x_high + pad), float(y_low - pad), float(y_high + pad)

    def to_json(self) -> dict[str, Any]:
        """Return the drawing as plain data; each mark has its type, in small letters, as `kind`."""
        data = asdict(self)
        data["marks"] = [
            {"kind": type(mark).__name__.lower(), **asdict(mark)} for mark in self.marks
        ]
        return data


def drawing(
    model: Mechanism | ConstraintSystem,
    p: Mapping[str, float] | None = None,
    q: ArrayLike | None = None,
) -> Drawing:
    """Derive from a mechanism what it looks like.

    Parameters
    ----------
    model
        A mechanism or a system; one of free equations alone has no bodies and no marks.
    p
        Values of parameters by name; others have their defaults.
    q : array_like, shape (n,) or (N, n), optional
        Positions that rails are to be long enough for; without, the guess.

    Raises
    ------
    ModelError
        If the model cannot be used as written; every problem is listed.
    """
    system = system_of(model)
    guess = [item.guess for item in system.coordinates]
    positions = _finite(guess if q is None else q)
    if not len(positions):
        positions = _finite(guess)
    frames = {body.name: k for k, body in enumerate(system.bodies)}
    values = {item.name: item.default or 0.0 for item in system.parameters} | dict(p or {})
    joints = [item for item in system.constraints if isinstance(item, Joint)]
    attached = _attached(joints, frames, values)
    bearings = _bearings(joints, frames, values)
    scene = Scene(values, frames, positions, bearings, _blocks(joints, frames, values))
    marks = {joint.name: marks_of(joint.written, Placed(joint, scene)) for joint in joints}
    bodies: list[Mark] = [*outlines(system.bodies, values)]
    drawn = _uncovered(itertools.chain(*marks.values()), set().union(*map(moves_with, bodies)))
    bodies += links(len(frames), attached, [*bodies, *drawn])
    drawn = [*bodies, *drawn]
    size = _size(drawn, positions)
    places = {
        joint.name: _pointed_at(marks[joint.name], _attached([joint], frames, values))
        for joint in joints
    }
    ordered = sorted((_lengthened(mark, OVERHANG * size) for mark in drawn), key=_depth)
    return Drawing(system.name, tuple(frames), tuple(ordered), _labels(system, places), size)


def _labels(system: ConstraintSystem, places: Mapping[str, Place | None]) -> tuple[JointLabel, ...]:
    """Return the constraints as they are pointed at, in order."""
    return tuple(
        JointLabel(
            item.name,
            item.template.type_name if isinstance(item, Joint) else "Equation",
            places.get(item.name),
            item.is_driver,
            (first, len(item.equation_names)),
        )
        for item, first in zip(system.constraints, system.row_offsets, strict=True)
    )


def _finite(q: ArrayLike) -> Array:
    """Return the positions that are finite, shape (N, n)."""
    positions = np.atleast_2d(np.asarray(q, dtype=np.float64))
    return positions[np.isfinite(positions).all(axis=1)]


def _attached(
    joints: Iterable[Joint], frames: Mapping[str, int], values: Mapping[str, float]
) -> list[Place]:
    """Return every point that a constraint holds, in its frame; a rack shows its own."""
    return [
        Place(frame_of(joint, item.symbol, frames), number_pair(joint.points[item.symbol], values))
        for joint in joints
        for item in joint.written.arguments().values()
        if item.kind is Kind.POINT and item.symbol not in PITCH_LINE
    ]


def _bearings(
    joints: Iterable[Joint], frames: Mapping[str, int], values: Mapping[str, float]
) -> dict[int, Place]:
    """Return for each frame the point of its first revolute joint, one with the ground first."""
    revolutes = [joint for joint in joints if isinstance(joint.written, Revolute)]
    revolutes.sort(key=lambda joint: not any(body.is_ground for body in joint.bodies))
    found: dict[int, Place] = {}
    for place in _attached(revolutes, frames, values):
        found.setdefault(place.frame, place)
    return found


def _blocks(
    joints: Iterable[Joint], frames: Mapping[str, int], values: Mapping[str, float]
) -> frozenset[int]:
    """Return the frames with one point for all joints, in a revolute joint of moving bodies."""
    points: dict[int, set[Point]] = {}
    for place in _attached(joints, frames, values):
        points.setdefault(place.frame, set()).add(place.point)
    pins = [
        joint
        for joint in joints
        if isinstance(joint.written, Revolute) and not any(body.is_ground for body in joint.bodies)
    ]
    held = {place.frame for place in _attached(pins, frames, values)}
    return frozenset(frame for frame in held if len(points[frame]) == 1)


def _pointed_at(marks: Iterable[Mark], attached: Iterable[Place]) -> Place | None:
    """Return where a joint is pointed at: at its pin or drive, else at its last moving point."""
    pins = [mark.second for mark in marks if isinstance(mark, Pin)]
    drives = [mark.place for mark in marks if isinstance(mark, Drive)]
    moving = [place for place in attached if place.frame != GROUND_FRAME]
    found = pins or drives or moving
    return found[-1] if found else None


def _box(marks: Iterable[Mark], q: Array) -> tuple[Array, Array]:
    """Return the lower left and the upper right corner of what marks reach at positions q."""
    corners = [
        world(q, place) + offset
        for mark in marks
        for place, radius in reach(mark)
        for offset in (-radius, radius)
    ]
    if not corners or not len(q):
        return np.array((-1.0, -1.0)), np.array((1.0, 1.0))
    points = np.concatenate(corners)
    return points.min(axis=0), points.max(axis=0)


def _size(marks: Iterable[Mark], q: Array) -> float:
    """Return a part of the diagonal of what marks reach; of a single point, of a unit length."""
    low, high = _box(marks, q)
    return (float(np.hypot(*(high - low))) or 1.0) / PARTS


def _lengthened(mark: Mark, overhang: float) -> Mark:
    """Return a guide with more at both ends, so that what slides on it is not at its end."""
    if not isinstance(mark, Rail) or mark.style != "guide":
        return mark
    start, end = np.array(mark.start), np.array(mark.end)
    along = overhang * np.array(mark.axis)
    return replace(mark, start=tuple((start - along).tolist()), end=tuple((end + along).tolist()))


def _uncovered(marks: Iterable[Mark], outlined: set[int]) -> list[Mark]:
    """Return the marks without slides and sleeves that are seen otherwise.

    A cylinder takes the place of its slide; two outlined bodies show by themselves how they slide.
    """
    found = list(marks)
    spans = [mark for mark in found if isinstance(mark, Span)]
    cylinders = {(mark.first, mark.second) for mark in spans if mark.style == "cylinder"}
    covered = {
        mark.joint
        for mark in spans
        if (mark.style == "slide" and (mark.first, mark.second) in cylinders)
        or {mark.first.frame, mark.second.frame} <= outlined
    }
    return [
        mark for mark in found if not (isinstance(mark, Span | Block) and mark.joint in covered)
    ]


_DEPTHS = ("rail", "wheel", "profile", "outline", "link", "span", "block", "pin", "drive")


def _depth(mark: Mark) -> int:
    """Return the place of a mark in the order from back to front."""
    return _DEPTHS.index(type(mark).__name__.lower())

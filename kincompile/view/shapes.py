"""`drawing`: the one description of a mechanism's shapes, from which plots and the page draw."""

from __future__ import annotations

import itertools
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.model.constraint import Kind
from kincompile.model.joints import Revolute
from kincompile.model.resolve import Joint
from kincompile.view.joint_shapes import marks_of
from kincompile.view.marks import (
    GROUND_FRAME,
    Block,
    Drive,
    Link,
    Mark,
    Outline,
    Pin,
    Place,
    Profile,
    Rail,
    Span,
    Wheel,
)
from kincompile.view.placed import Placed, Scene, frame_of, number_pair, world

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import TypeAlias

    from numpy.typing import ArrayLike, NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.view.marks import Point

    Array: TypeAlias = NDArray[np.float64]

PARTS = 50
"""Marks are measured in this part of the mechanism's diagonal."""

SAME_POINT = 1e-9
"""Distance, relative to the coordinates, up to which two points of a body are one."""


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
        return tuple(mark for mark in self.marks if _frames(mark) == {GROUND_FRAME})

    def extent(self, q: ArrayLike) -> tuple[float, float, float, float]:
        """Return smallest x, largest x, smallest y, largest y of all marks.

        Parameters
        ----------
        q : array_like, shape (n,) or (N, n)
            Positions; those that are not finite are left out.
        """
        positions = _finite(q)
        corners = [
            world(positions, place) + offset
            for mark in self.marks
            for place, radius in _reach(mark)
            for offset in ((-radius, -radius), (radius, radius))
        ]
        if not corners or not len(positions):
            return -1.0, 1.0, -1.0, 1.0
        points = np.concatenate(corners)
        (x_low, y_low), (x_high, y_high) = points.min(axis=0), points.max(axis=0)
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
    system = model.system()
    guess = [item.guess for item in system.coordinates]
    positions = _finite(guess if q is None else q)
    if not len(positions):
        positions = _finite(guess)
    frames = {body.name: k for k, body in enumerate(system.bodies)}
    values = {item.name: item.default or 0.0 for item in system.parameters} | dict(p or {})
    joints = [item for item in system.constraints if isinstance(item, Joint)]
    attached = _attached(joints, frames, values)
    scene = Scene(values, frames, positions, _bearings(joints, frames, values),
                  _size(positions, attached))  # fmt: skip
    placed = {joint.name: Placed(joint, scene) for joint in joints}
    marks = [mark for joint in joints for mark in marks_of(joint.written, placed[joint.name])]
    links = _links(len(frames), attached, marks)
    labels = [
        JointLabel(
            item.name,
            item.template.type_name if isinstance(item, Joint) else "Equation",
            _place_of(item, frames, values, scene) if isinstance(item, Joint) else None,
            item.is_driver,
            (first, len(item.equation_names)),
        )
        for item, first in zip(system.constraints, system.row_offsets, strict=True)
    ]
    ordered = sorted([*links, *marks], key=_depth)
    return Drawing(system.name, tuple(frames), tuple(ordered), tuple(labels), scene.size)


def _finite(q: ArrayLike) -> Array:
    """Return the positions that are finite, shape (N, n)."""
    positions = np.atleast_2d(np.asarray(q, dtype=np.float64))
    return positions[np.isfinite(positions).all(axis=1)]


def _attached(
    joints: Iterable[Joint], frames: Mapping[str, int], values: Mapping[str, float]
) -> list[Place]:
    """Return every point that a constraint holds, in its frame."""
    return [
        Place(frame_of(joint, item.symbol, frames), number_pair(joint.points[item.symbol], values))
        for joint in joints
        for item in joint.written.arguments().values()
        if item.kind is Kind.POINT
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


def _place_of(
    joint: Joint, frames: Mapping[str, int], values: Mapping[str, float], scene: Scene
) -> Place:
    """Return where a joint is pointed at: at its last point on a moving body."""
    moving = [place for place in _attached([joint], frames, values) if place.frame != GROUND_FRAME]
    return moving[-1] if moving else Placed(joint, scene).bearing()


def _size(q: Array, attached: Iterable[Place]) -> float:
    """Return a part of the diagonal of what the joints reach; of one point, of a unit square."""
    points = [world(q, place) for place in attached]
    points += [q[:, :2]] if q.shape[1] > 1 else []
    if not points:
        return 1.0 / PARTS
    every = np.concatenate(points)
    diagonal = float(np.hypot(*(every.max(axis=0) - every.min(axis=0))))
    return (diagonal or 1.0) / PARTS


def _links(count: int, attached: Iterable[Place], marks: Iterable[Mark]) -> list[Link]:
    """Return each body's hull; a body of one point only where no mark shows it."""
    shown = {frame for mark in marks for frame in _frames(mark)}
    links = []
    for frame in range(count):
        points = _distinct(place.point for place in attached if place.frame == frame)
        if len(points) < 2:
            points = _distinct([*points, (0.0, 0.0)])
        if len(points) > 1 or frame not in shown:
            links.append(Link(frame, _hull(points)))
    return links


def _distinct(points: Iterable[Point]) -> list[Point]:
    """Return the points without repetitions."""
    found: list[Point] = []
    for point in points:
        tolerance = SAME_POINT * (1 + max(map(abs, point)))
        if all(max(abs(a - b) for a, b in zip(point, other, strict=True)) > tolerance
               for other in found):  # fmt: skip
            found.append(point)
    return found


def _hull(points: Iterable[Point]) -> tuple[Point, ...]:
    """Return the convex hull, counterclockwise; of points on a line the two ends.

    Andrew's monotone chain.
    """
    ordered = sorted(points)
    if len(ordered) < 3:
        return tuple(ordered)
    chains = []
    for chain in (ordered, ordered[::-1]):
        kept: list[Point] = []
        for point in chain:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], point) <= 0:
                kept.pop()
            kept.append(point)
        chains.append(kept[:-1])
    return tuple(itertools.chain(*chains))


def _turn(a: Point, b: Point, c: Point) -> float:
    """Return twice the signed area of a triangle."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _frames(mark: Mark) -> set[int]:
    """Return the frames that a mark moves with."""
    return {place.frame for place, _ in _reach(mark)}


def _reach(mark: Mark) -> list[tuple[Place, float]]:
    """Return the points of a mark, each with how far it reaches beyond."""
    match mark:
        case Wheel():
            return [(mark.place, mark.radius)]
        case Link() | Outline() | Profile():
            points = mark.points
        case Rail():
            points = (mark.start, mark.end)
        case Pin() | Span():
            return [(mark.first, 0.0), (mark.second, 0.0)]
        case Block() | Drive():
            return [(mark.place, 0.0)]
    return [(Place(mark.frame, point), 0.0) for point in points]


_DEPTHS = ("rail", "wheel", "profile", "outline", "link", "span", "block", "pin", "drive")


def _depth(mark: Mark) -> int:
    """Return the place of a mark in the order from back to front."""
    return _DEPTHS.index(type(mark).__name__.lower())

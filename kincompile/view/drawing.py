"""`drawing`: the one description of a mechanism's shapes, for plots and pages."""

from __future__ import annotations

import functools
import itertools
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from kincompile.model.four_bars import FourBarLoop, four_bar_loops
from kincompile.model.mechanism import system_of
from kincompile.model.resolve import Joint
from kincompile.view.body_shapes import links, outlines
from kincompile.view.geometry import Geometry, JointGeometry
from kincompile.view.hands import Hand, guess_of, hands_of
from kincompile.view.joint_shapes import marks_of
from kincompile.view.marks import (
    GROUND_FRAME,
    BodyFrame,
    Dot,
    Drive,
    FramePoint,
    Mark,
    Pin,
    Rail,
    Slider,
    Span,
    Symbol,
    in_ground,
    moves_with,
    reach,
    shape_of,
)
from kincompile.view.shapes import SHAPES
from kincompile.view.worlds import PLANE, SPACE, dimension_of, drawn_by

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import ArrayLike

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.scope import Point
    from kincompile.model.system import ConstraintSystem
    from kincompile.view.marks import Array

PARTS = 50
"""The mechanism's diagonal in sizes of marks."""

OVERHANG = 3
"""Length of a guide beyond the motion, in sizes of marks."""


@dataclass(frozen=True, slots=True)
class JointLabel:
    """The name and place of a constraint, for labels and for pointing at it."""

    name: str
    kind: str
    # Where it is; on a moving body where it has one. None for a free equation.
    place: FramePoint | None
    is_driver: bool  # whether its value is a function of time
    rows: tuple[int, int]  # first row of Phi and number of rows
    # Lengths that must be positive; none that is a function of time.
    distances: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Drawing:
    """A mechanism as shapes that move with q: what matplotlib and the page draw."""

    name: str
    # bodies, frames: name and frame of each body, in the order of the mechanism.
    bodies: tuple[str, ...]
    frames: tuple[BodyFrame, ...]
    marks: tuple[Mark, ...]  # all shapes, from back to front
    joints: tuple[JointLabel, ...]
    size: float  # the length in which pins and blocks are measured
    four_bars: tuple[FourBarLoop, ...] = ()  # with numbers as lengths
    # For a page: what can be pulled, and where the solver starts.
    hands: tuple[Hand, ...] = ()
    guess: tuple[float, ...] = ()

    @property
    def dots(self) -> tuple[Dot, ...]:
        """The named points of bodies, in order."""
        return tuple(mark for mark in self.marks if isinstance(mark, Dot))

    @property
    def places(self) -> list[FramePoint]:
        """Where joints and named points are, which no other name should cover."""
        shown = [
            mark
            for mark in self.marks
            if isinstance(mark, Pin | Span | Slider | Drive | Dot | Symbol)
        ]
        return [place for mark in shown for place, _ in reach(mark)]

    @property
    def is_spatial(self) -> bool:
        """Whether its bodies move in space."""
        return self.dimension > PLANE

    @property
    def dimension(self) -> int:
        """Components of a point: 2, or 3 in space."""
        return SPACE if self.frames and len(self.frames[0].columns) > SPACE else PLANE

    def extent(self, q: ArrayLike) -> tuple[float, ...]:
        """Return smallest x, largest x, smallest y, largest y of all marks, in space z too.

        Parameters
        ----------
        q : array_like, shape (n,) or (N, n)
            Positions; those that are not finite are left out.
        """
        low, high = _box(self.marks, _finite(q), self.dimension)
        pad = 2 * self.size
        ends = zip(low - pad, high + pad, strict=True)
        return tuple(map(float, itertools.chain(*ends)))

    def to_json(self) -> dict[str, Any]:
        """Return the drawing as plain data; each mark has its type, in small letters, as `kind`."""
        data = asdict(self)
        data["marks"] = [
            {"kind": type(mark).__name__.lower(), "shape": shape_of(mark), **asdict(mark)}
            for mark in self.marks
        ]
        data["overhang"] = OVERHANG * self.size
        data["four_bars"] = [item._asdict() for item in self.four_bars]
        looks: dict[str, Any] = drawn_by("looks", self.dimension)()
        return data | looks


def drawing(
    model: Mechanism | ConstraintSystem,
    p: Mapping[str, float] | None = None,
    q: ArrayLike | None = None,
    drawn: Mapping[str, Mapping[str, Point]] | None = None,
) -> Drawing:
    """Derive the shapes of a mechanism.

    Parameters
    ----------
    model
        A mechanism or a system; one of free equations alone has no bodies and no marks.
    p
        Values of parameters by name; others have their defaults.
    q : array_like, shape (n,) or (N, n), optional
        Positions that the rails must reach; without, the guess.
    drawn
        Joints of a drawing, as `Mechanism.drawn`: the hands and the guess are found too.

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
    joints = [item for item in system.constraints if isinstance(item, Joint)]
    frames = tuple(BodyFrame(k, tuple(own)) for k, own in enumerate(system.body_columns))
    names = tuple(body.name for body in system.bodies)
    geometry = Geometry(
        joints,
        {item.name: item.default or 0.0 for item in system.parameters} | dict(p or {}),
        dict(zip(names, frames, strict=True)),
        positions,
    )
    dimension = dimension_of(system)
    drawings = drawn_by("joints", dimension)
    by_joint = {
        joint.name: marks_of(joint.written, JointGeometry(joint, geometry), drawings)
        for joint in joints
    }
    bodies: list[Mark] = [*outlines((*system.bodies, system.ground), geometry)]
    marks = _uncovered(itertools.chain(*by_joint.values()), set().union(*map(moves_with, bodies)))
    marks = [*bodies, *marks]
    dots = [Dot(item.name, geometry.on_body(item)) for item in system.body_points]
    attached = [*geometry.points(joints), *(dot.place for dot in dots)]
    marks += links(frames, attached, marks, dimension)
    marks += dots
    size = _size(marks, positions, dimension)
    places = {
        joint.name: _pointed_at(by_joint[joint.name], geometry.points([joint])) for joint in joints
    }
    lengthened = [_lengthened(mark, OVERHANG * size) for mark in marks]
    # In space what is nearer depends on the view.
    ordered = lengthened if dimension > PLANE else sorted(lengthened, key=_depth)
    labels = _labels(system, places, geometry)
    four_bars = tuple(
        item._replace(lengths=tuple(map(geometry.number, item.lengths)))
        for item in four_bar_loops(system)
    )
    found = Drawing(system.name, names, frames, tuple(ordered), labels, size, four_bars)
    if drawn is None:
        return found
    hands, start = hands_of(system, drawn, geometry), guess_of(system, geometry)
    return replace(found, hands=hands, guess=start)


def _labels(
    system: ConstraintSystem, places: Mapping[str, FramePoint | None], geometry: Geometry
) -> tuple[JointLabel, ...]:
    return tuple(
        JointLabel(
            item.name,
            item.type_name if isinstance(item, Joint) else "Equation",
            places.get(item.name),
            item.is_driver,
            (first, len(item.equation_names)),
            geometry.distances(item) if isinstance(item, Joint) else (),
        )
        for item, first in zip(system.constraints, system.row_offsets, strict=True)
    )


def _finite(q: ArrayLike) -> Array:
    """Return the positions that are finite, shape (N, n)."""
    positions = np.atleast_2d(np.asarray(q, dtype=np.float64))
    return positions[np.isfinite(positions).all(axis=1)]


def _pointed_at(marks: Iterable[Mark], attached: Iterable[FramePoint]) -> FramePoint | None:
    """Return the place of a joint: its pin or drive, else its last moving point."""
    pins = [mark.second for mark in marks if isinstance(mark, Pin)]
    drives = [mark.place for mark in marks if isinstance(mark, Drive)]
    moving = [place for place in attached if place.frame != GROUND_FRAME]
    found = pins or drives or moving
    return found[-1] if found else None


def _box(marks: Iterable[Mark], q: Array, dimension: int) -> tuple[Array, Array]:
    """Return the lowest and the highest coordinates of the marks at positions q."""
    fixed: dict[BodyFrame, list[tuple[float, ...]]] = {}
    for mark in marks:
        for place, radius in reach(mark):
            fixed.setdefault(place.frame, []).append((*place.point, radius))
    if not fixed or not len(q):
        return np.full(dimension, -1.0), np.full(dimension, 1.0)
    low, high = [], []
    for frame, circles in fixed.items():
        numbers = np.array(circles)
        points, radii = in_ground(q[:, None], frame, numbers[:, :-1]), numbers[:, -1:]
        low.append((points - radii).min(axis=(0, 1)))
        high.append((points + radii).max(axis=(0, 1)))
    return np.min(low, axis=0), np.max(high, axis=0)


def _size(marks: Iterable[Mark], q: Array, dimension: int) -> float:
    """Return a part of the diagonal of the marks; of a single point, of a unit length."""
    low, high = _box(marks, q, dimension)
    return (float(functools.reduce(np.hypot, high - low)) or 1.0) / PARTS


def _lengthened(mark: Mark, overhang: float) -> Mark:
    """Return a guide with an overhang, so that its block never stands at its end."""
    if not _is_guide(mark):
        return mark
    low, high = mark.reach
    return replace(mark, reach=(low - overhang, high + overhang))


def _is_guide(mark: Mark) -> TypeGuard[Rail | Symbol]:
    """Return whether something slides on a mark."""
    if isinstance(mark, Symbol):
        return mark.follower is not None
    return isinstance(mark, Rail) and mark.style in ("guide", "slot")


def _uncovered(marks: Iterable[Mark], outlined: set[BodyFrame]) -> list[Mark]:
    """Return the marks without slides, sleeves and slots that other marks already show.

    A cylinder takes the place of its slide; two outlined bodies show by themselves how they slide.
    """
    found = list(marks)
    spans = [mark for mark in found if isinstance(mark, Span)]
    cylinders = {(mark.first, mark.second) for mark in spans if mark.style == "cylinder"}
    covered = {
        mark.joint
        for mark in found
        if (isinstance(mark, Span) and mark.style == "slide"
            and (mark.first, mark.second) in cylinders)
        or (isinstance(mark, Span) and moves_with(mark) <= outlined)
        or (isinstance(mark, Rail) and {mark.frame, mark.follower.frame} <= outlined)
    }  # fmt: skip
    return [
        mark
        for mark in found
        if not (isinstance(mark, Span | Slider | Rail) and mark.joint in covered)
    ]


def _depth(mark: Mark) -> int:
    """Return the position of a mark in the order from back to front."""
    return list(SHAPES).index(shape_of(mark))

"""Bodies that may turn though nothing sees it: rods between two balls, pins shared by two frames.

Geometry alone: where the joints of a body have their centres, and about which lines that lets it
turn while all centres stay. Whether it does turn is a matter of the rank (`ir/holding.py`). A body
that hangs on one other is not among them: a wheel or a tool is there to be turned.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import SLIGHT
from kincompile.model.arguments import Kind
from kincompile.model.expressions import evaluate
from kincompile.model.resolve import Joint

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.model.bodies import Body
    from kincompile.model.expressions import Scalar
    from kincompile.model.system import ConstraintSystem

    Array = NDArray[np.float64]

RIGID = ("Fixed", "Translational")
"""Joints whose bodies turn together. Their points are no centres."""
HINGES = ("Revolute", "Cylindrical", "Screw", "Planar", "Parallel")
"""Joints whose bodies turn about one axis relative to each other."""


@dataclass(frozen=True, slots=True, eq=False)
class Loose:
    """A body that may turn while the centres of its joints stay.

    `centres` (c, size) are those of its joints, `directions` (k, 3) those about which it may
    turn, of length one, both in its frame; in the plane the axis is (0, 0, 1).
    """

    centres: Array
    directions: Array


@dataclass(frozen=True, slots=True, eq=False)
class Web:
    """Which bodies are joined: for each its joints and the names of the others, or the ground."""

    joints: Sequence[Joint]
    own: Mapping[str, Sequence[Joint]]
    others: Mapping[str, frozenset[str]]

    @classmethod
    def of(cls, system: ConstraintSystem) -> Web:
        """Return who is joined to whom; a constraint of one body joins it to the ground."""
        joints = [x for x in system.constraints if isinstance(x, Joint) and not x.written.is_own]
        own: dict[str, list[Joint]] = {body.name: [] for body in system.bodies}
        others: dict[str, set[str]] = {name: set() for name in own}
        for item in joints:
            names = {body.name for body in item.bodies}
            names |= {system.ground.name} if len(names) == 1 else set()
            for name in names & own.keys():
                own[name].append(item)
                others[name] |= names - {name}
        return cls(joints, own, {name: frozenset(some) for name, some in others.items()})

    def groups(self, names: Collection[str]) -> Iterator[set[str]]:
        """Yield bodies out of some that hang together."""
        left = set(names)
        while left:
            group, waiting = set[str](), [min(left)]
            while waiting:
                name = waiting.pop()
                group.add(name)
                waiting += (self.others[name] & left) - group
            left -= group
            yield group

    def hangs_between(self, group: Collection[str]) -> bool:
        """Return whether a group hangs on two other bodies, and not on one alone."""
        return len(set().union(*(self.others[name] for name in group)) - set(group)) > 1


def loose_bodies(system: ConstraintSystem) -> dict[str, Loose]:
    """Return the bodies that may turn while the centres of all joints stay, by name."""
    web = Web.of(system)
    defaults = {x.name: float(x.default or 0.0) for x in system.parameters}
    joined = [body for body in system.bodies if len(web.others[body.name]) > 1]
    # Angles alone hold no body in place: what is missing there is a joint.
    found = {body.name: _centres(body, web.own[body.name], defaults) for body in joined}
    centres = {name: own for name, own in found.items() if len(own)}
    size = max((np.abs(x).max(initial=0.0) for x in centres.values()), default=0.0)
    left = {name: _loose(own, size) for name, own in centres.items()}
    while True:
        before = left
        left = {name: _narrowed(name, before, web.own[name], defaults) for name in before}
        left = {name: item for name, item in left.items() if len(item.directions)}
        if [len(x.directions) for x in left.values()] == [
            len(x.directions) for x in before.values()
        ]:
            between = {x for some in web.groups(left) if web.hangs_between(some) for x in some}
            if between == left.keys():
                return left
            left = {name: item for name, item in left.items() if name in between}


def _sides(item: Joint) -> Iterator[tuple[str, str]]:
    """Yield name and letter of each body of a joint."""
    yield from zip((body.name for body in item.bodies), "ij", strict=False)


def _centres(body: Body, joints: Sequence[Joint], defaults: Mapping[str, float]) -> Array:
    """Return the centres of a body's joints, in its frame."""
    found = [
        _numbers(item.points[given.symbol], defaults)
        for item in joints
        if item.type_name not in RIGID
        for name, letter in _sides(item)
        if name == body.name
        for given in item.written.arguments().values()
        if given.kind is Kind.POINT and given.on == letter
    ]
    return np.array(found).reshape(-1, body.kind.frame.size)


def _loose(centres: Array, size: float) -> Loose:
    """Return what the centres of its joints leave to a body in a mechanism of some size."""
    apart, turns = spread(centres, size), np.eye(3)
    if centres.shape[1] == 2:
        return Loose(centres, turns[:0] if apart else turns[2:])
    if apart != 1:
        return Loose(centres, turns[:0] if apart else turns)
    ways = centres - centres[0]
    longest = ways[np.argmax(np.linalg.norm(ways, axis=1))]
    return Loose(centres, longest[np.newaxis] / np.linalg.norm(longest))


def spread(points: Array, size: float) -> int:
    """Return 0 for points (k, 2 or 3) in one place, 1 on a line, more otherwise.

    A small part of the size of the mechanism is a rounding error.
    """
    return int(np.linalg.matrix_rank(points - points[:1], SLIGHT * size)) if len(points) else 0


def _numbers(given: Sequence[Scalar], defaults: Mapping[str, float]) -> list[float]:
    return [float(evaluate(x, dict(defaults)) or 0.0) for x in given]


def _narrowed(
    name: str, found: Mapping[str, Loose], joints: Sequence[Joint], defaults: Mapping[str, float]
) -> Loose:
    """Return a body with the axes that its joints to bodies at rest leave to it."""
    own = found[name]
    for item in joints:
        letters = dict(_sides(item))
        if any(x != name and x in found for x in letters):
            continue
        if item.type_name in RIGID:
            return replace(own, directions=own.directions[:0])
        if item.type_name not in HINGES or own.centres.shape[1] == 2:
            continue
        axis = np.array(_numbers(item.points[f"h_{letters[name]}"], defaults))
        axis = axis / np.linalg.norm(axis)
        across = own.directions - np.outer(own.directions @ axis, axis)
        may_turn = len(own.directions) == 3 or np.abs(across).max(initial=SLIGHT) <= SLIGHT
        own = replace(
            own,
            directions=axis[np.newaxis] if may_turn and len(own.directions) else own.directions[:0],
        )
    return own

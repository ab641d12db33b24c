"""A mechanism in space, turned as a whole: the same motion, seen from elsewhere."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kincompile import spatial
from kincompile.model.arguments import Kind

Place = NDArray[np.float64]
SLIDES = {spatial.AbsoluteX: 0, spatial.AbsoluteY: 1, spatial.AbsoluteZ: 2}


def turned_copy(
    m: spatial.Mechanism, turn: Rotation, shift: NDArray[np.float64]
) -> spatial.Mechanism:
    """Return a copy whose ground, with all that stands on it, is turned and then moved.

    A point on the ground goes to A s + shift, a direction to A v; bodies keep their own frames, and
    their guesses follow. A global coordinate becomes that along an axis of the turned ground.
    """
    matrix = turn.as_matrix()
    copy = spatial.Mechanism(m.name, end=m.end_given, points=m.points)
    copy.parameters = list(m.parameters)
    for body in m.system().bodies:
        values = {item.name: item.default for item in m.parameters}
        guess = np.array([float(_number(item, values)) for item in body.guess])
        p = turn * Rotation.from_quat(guess[[4, 5, 6, 3]])
        copy.body(body.name, matrix @ guess[:3] + shift, p)
    for item in m.constraints:
        copy.add(_turned(copy, item, matrix, shift))
    return copy


def _number(item: Any, values: dict[str, float | None]) -> Any:
    return item.subs(values) if hasattr(item, "subs") else item


def _turned(copy: spatial.Mechanism, item: Any, matrix: Any, shift: Any) -> Any:
    kind, given = type(item), {}
    if kind in SLIDES:
        axis = np.eye(3)[SLIDES[kind]]
        start = (copy.ground, shift, matrix @ axis)
        return spatial.RelativeTranslation(
            item.name, *start, item.body.name, item.point, item.value
        )
    bodies: dict[str, str] = {}
    for name, argument in kind.arguments().items():
        value = getattr(item, name)
        if argument.kind is Kind.BODY:
            bodies[argument.symbol] = value = getattr(value, "name", value)
        elif argument.kind in (Kind.POINT, Kind.AXIS) and _is_fixed(bodies, kind, argument):
            value = matrix.dot(np.array(value, dtype=object))
            value = value + shift if argument.kind is Kind.POINT else value
        given[name] = value
    if kind.contacts:
        given["guess"] = item.guess
    return kind(item.name, **given)


def _is_fixed(bodies: dict[str, str], kind: Any, argument: Any) -> bool:
    """Return whether a point is one of the ground, whose body is read before it."""
    return bodies.get(argument.on, "") == "ground" or argument.on == "ground"

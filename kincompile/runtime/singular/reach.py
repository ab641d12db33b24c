"""What a driver or a distance asks for, and what the other joints can give it.

Where a mechanism cannot be assembled, one equation is freed: the others leave a curve of positions,
along which its value has extremes. They are the turning points of the curve of
Phi_row(q) = s, the others zero, in q and s together, which `curve` follows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import SAME_POSITION, ZERO
from kincompile.runtime.march import State
from kincompile.runtime.problem import nearest
from kincompile.runtime.singular.assemblies import MOST_COORDINATES
from kincompile.runtime.singular.curve import Curve
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.problem import Problem
    from kincompile.runtime.singular.curve import CurvePoint

PLACES = 3
"""Positions without a pattern at which the form of an equation is seen."""

MOST_TURNS = 24
"""Extremes after which a curve is given up."""

LATER = (0.0, 0.01, 0.3, 2.0)
"""Times after one that is looked at, at which a driver may move."""

MOST_NAMED = 3
"""Equations of which a message says what they ask for."""


@dataclass(frozen=True, slots=True)
class Measure:
    """How the number that an equation is about follows from its row of Phi."""

    unit: str
    # What is added to Phi; to its square where the equation is one of squares. None where the
    # number itself is not known, and only differences are.
    offset: float | None
    # Whether Phi is the square of a distance, less that of the one that is asked for.
    is_square: bool = False

    def value(self, residual: float) -> float:
        """Return the number where the row of Phi has a value."""
        moved = residual + (self.offset or 0.0)
        return math.sqrt(max(moved, 0.0)) if self.is_square else moved

    def residual(self, value: float) -> float:
        """Return what the row of Phi has where the number has a value; none below zero."""
        moved = max(value, 0.0) ** 2 if self.is_square else value
        return moved - (self.offset or 0.0)

    def text(self, number: float) -> str:
        """Return a number with its unit."""
        return f"{number:.4g} {self.unit}".rstrip()


def measure(equations: Problem, row: int, q: Array, t: float) -> Measure | None:
    """Return what an equation measures, by its form at positions without a pattern.

    A squared distance has |grad|^2 = 4 d^2; an equation of lengths has a gradient of length 1 by
    the coordinates of a body's origin; one of angles has a constant gradient.
    """
    rng = np.random.default_rng(row)
    points = [
        equations.at(q + equations.reference * rng.uniform(-1, 1, q.size), t) for _ in range(PLACES)
    ]
    known = [(point.q, point.Phi[row], point.Phi_q[row]) for point in points if point is not None]
    if len(known) < PLACES:
        return None
    code = equations.code
    if not any(np.any(slope[~code.angular]) for _, _, slope in known):
        return _of_angles(known)
    for columns in _origins(equations, known[0][2]):
        unit = code.units[code.coordinates[columns[0]]]
        squares = [float(slope[columns] @ slope[columns]) for _, _, slope in known]
        if all(abs(square - 1) <= ZERO for square in squares):
            return Measure(unit, None)
        offsets = [square / 4 - Phi for square, (_, Phi, _) in zip(squares, known, strict=True)]
        if np.ptp(offsets) <= ZERO * max(squares) and min(offsets) > 0:
            return Measure(unit, offsets[0], is_square=True)
    return None


def _of_angles(known: Sequence[tuple[Array, float, Array]]) -> Measure | None:
    """Return the measure of an equation of angles, whose gradient is constant."""
    slope = known[0][2]
    offsets = [float(slope @ q - Phi) for q, Phi, _ in known]
    same = all(np.allclose(other, slope, rtol=0, atol=ZERO) for _, _, other in known)
    if not same or np.ptp(offsets) > ZERO * (1 + max(map(abs, offsets))):
        return None
    return Measure("rad", offsets[0])


def _origins(equations: Problem, slope: Array) -> Iterator[list[int]]:
    """Yield the columns of the origin of each body that an equation is about, or of all lengths."""
    code = equations.code
    for _, first, count in code.bodies:
        columns = [k for k in range(first, first + count) if not code.angular[k]]
        if np.any(slope[columns]):
            yield columns
    if not code.bodies:
        yield np.flatnonzero(~code.angular).tolist()


def missed(equations: Problem, point: Point, row: int) -> str:
    """Say by how much an equation is missed at a position, in its units as far as they are seen."""
    name, residual = equations.code.equations[row], float(point.Phi[row])
    form = None
    if point.q.size <= MOST_COORDINATES:
        form = measure(equations, row, point.q, point.t)
    if form is None:
        return f"{name} = {residual:.3g}"
    if not form.is_square:
        return f"{name} = {residual:.3g} {form.unit}".rstrip()
    return f"{name} is {form.text(form.value(residual))} instead of {form.text(form.value(0.0))}"


def impossible(equations: Problem, q: Array, t: float) -> list[str]:
    """Say of drivers and distances what they ask for, and what the others can give at most.

    A sentence for each equation that asks for what is impossible, as far as that was found from the
    position nearest to an assembled one.
    """
    code = equations.code
    if q.size > MOST_COORDINATES or len(code.equations) != q.size:
        return []
    found = []
    driven = _driven(equations, q, t)
    for row in range(q.size):
        form = measure(equations, row, q, t)
        if form is not None and (form.is_square or driven[row]):
            span = _span(equations, row, q, t)
            if span is not None and not span[0] <= 0 <= span[1]:
                found.append(_sentence(code.equations[row], form, *span))
    return found[:MOST_NAMED]


def _driven(equations: Problem, q: Array, t: float) -> NDArray[np.bool_]:
    """Return which equations depend on time, now or soon: a driver may begin at rest."""
    found = np.zeros(q.size, dtype=bool)
    for later in LATER:
        found |= np.abs(equations.nu(q, t + later)) > 0
    return found


def _sentence(name: str, form: Measure, least: float, most: float) -> str:
    """Say what an equation asks for and what it can have."""
    if form.offset is None:
        miss = least if least > 0 else -most
        end = "less than the least" if least > 0 else "more than the most"
        text = f"{name} asks for {form.text(miss)} {end} that it can have"
        if form.unit != "rad":  # its zero is not known here
            text += "; a way counts from the point of its guide"
    else:
        ends = (("at least", least), ("at most", most))
        limits = [f"{form.text(form.value(end))} {word}" for word, end in ends if np.isfinite(end)]
        text = f"{name} is {form.text(form.value(0.0))}; it can be {', '.join(limits)}"
    return f"{text} (found by moving the other joints)."


def _span(equations: Problem, row: int, q: Array, t: float) -> tuple[float, float] | None:
    """Return the extremes of a row of Phi where the others hold; infinite where there is none."""
    start = _with_the_others(equations, row, q, t)
    if start is None:
        return None
    curve, state = freed_curve(equations, row, start, t)
    here = float(start.Phi[row])
    least, most = here, here
    for direction in (math.copysign(1.0, -here), math.copysign(1.0, here)):
        ends, is_closed = _extremes(curve, state, direction)
        least, most = min([least, *ends]), max([most, *ends])
        if least <= 0 <= most or is_closed:
            return least, most
        if direction > 0:
            most = math.inf
        else:
            least = -math.inf
    return least, most


def _with_the_others(equations: Problem, row: int, q: Array, t: float) -> Point | None:
    """Return a position near one at which all equations but one hold; None where none is found."""
    rest = np.where(np.arange(q.size) == row, 0.0, 1.0)

    def position(q: Array, t: float, p: Array) -> tuple[Array, Array]:
        Phi, Phi_q = equations.code.position(q, t, p)
        return rest * Phi, rest[:, np.newaxis] * Phi_q

    attempt = nearest(equations.with_functions(position=position), t, q)
    return equations.at(attempt.last.q, t) if attempt.status is Status.CONVERGED else None


def freed_curve(equations: Problem, row: int, start: Point, t: float) -> tuple[Curve, State]:
    """Return the curve on which all equations but one hold, and the start on it.

    What stands for time is the value of the row.
    """
    unit = np.eye(start.q.size)[row]

    def position(q: Array, value: float, p: Array) -> tuple[Array, Array]:
        Phi, Phi_q = equations.code.position(q, t, p)
        return Phi - value * unit, Phi_q

    freed = equations.with_functions(position=position, nu=lambda q, value, p: unit)
    value = float(start.Phi[row])
    point = replace(start, t=value, Phi=start.Phi - value * unit, factors=None)
    nothing = np.zeros(start.q.size)
    state = State(value, point, nothing, nothing, np.ones(1))
    duration = max(abs(value), float(equations.magnitude[row]))
    return Curve(freed, state, duration), state


def _extremes(curve: Curve, state: State, direction: float) -> tuple[list[float], bool]:
    """Return the extremes along a curve in one direction, and whether it closes."""
    place = curve.start(state, direction)
    found: list[CurvePoint] = []
    for _ in range(MOST_TURNS):
        bracket = None if place is None else curve.next_singular(place, direction * math.inf)
        if bracket is None:
            return [item.t for item in found], False
        if bracket.turns and (turn := curve.singular_point(bracket)) is not None:
            away = (curve.equations.distance(turn[0].q, other.q) for other in found)
            if any(distance <= math.sqrt(SAME_POSITION) for distance in away):
                return [item.t for item in found], True
            found.append(turn[0])
            if (turn[0].t > 0) != (state.t > 0):
                return [item.t for item in found], True  # what is asked for lies between
        place = bracket.second
    return [item.t for item in found], False

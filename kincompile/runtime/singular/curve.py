r"""The solution curve of :math:`\Phi(q, t) = 0` in q and t together, followed by its arc length.

Time is a coordinate like any other here, so that the curve can be followed where the motion cannot:
around a lock-up, where it turns back in time, and through a bifurcation, where another curve
crosses it. Both ends of a step tell which of them lies between (Allgower and Georg, Numerical
Continuation Methods, chapters 2 and 8): at a lock-up the tangent's component along t changes its
sign, at a bifurcation det Phi_q changes its own and the tangent goes on.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile import criteria
from kincompile.runtime.engine.linear import solve_linear
from kincompile.runtime.engine.scales import weights_of

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from kincompile.runtime.engine.linear import Array as Vector
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.march import State
    from kincompile.runtime.problem import Problem


@dataclass(frozen=True, slots=True, eq=False)
class CurvePoint:
    """A point of the curve."""

    q: Vector  # (n,): the position
    t: float
    point: Point
    # (m, n + 1): derivatives of Phi with respect to q and t, in scales of the equations and
    # coordinates
    matrix: Vector
    # (n + 1,): unit vector along the curve, in scales of the coordinates and of time
    tangent: Vector


@dataclass(frozen=True, slots=True, eq=False)
class Bracket:
    """Two points of the curve with a singular configuration between them."""

    # first, second: the points, in the direction of the motion
    first: CurvePoint
    second: CurvePoint
    length: float  # the step from one to the other
    turns: bool  # whether the curve turns back in time


class Curve:
    """The curve through a good point of a motion, for which `duration` is a long time."""

    def __init__(self, equations: Problem, state: State, duration: float) -> None:
        self.equations = equations
        self.scale = np.append(equations.reference, duration)
        self._weights = weights_of(equations.terms(state.point, equations.reference))

    def start(self, state: State, direction: float) -> CurvePoint | None:
        """Return a point of the motion as one of the curve, looking forward or back in time."""
        towards = direction * np.append(state.q_dot, 1.0) / self.scale
        return self._place(state.point.q, state.t, towards)

    def step(self, place: CurvePoint, length: float) -> CurvePoint | None:
        """Go a length along the curve; None where it cannot be followed so far."""
        y = np.append(place.q, place.t) + length * place.tangent * self.scale
        predicted = y.copy()
        last = math.inf
        for _ in range(
            criteria.ARC_CORRECTIONS
        ):  # in time too, whose rounding no equation's terms show
            found = self._derivatives(y[:-1], float(y[-1]))
            if found is None:
                return None
            point, matrix = found
            away = place.tangent @ ((y - predicted) / self.scale)
            try:
                change = solve_linear(
                    np.vstack((matrix, place.tangent)), np.append(self._weights * point.Phi, away)
                )
            except np.linalg.LinAlgError:
                return None
            y = y - change * self.scale
            size = float(np.max(np.abs(change)))
            if size <= criteria.SMALL_CORRECTION or (
                size <= criteria.TOLERABLE_CORRECTION and size > last / 4
            ):
                break
            last = size
        else:
            return None
        moved = float(np.linalg.norm((y - predicted) / self.scale))
        if not moved <= max(abs(length) / 4, criteria.TOLERABLE_CORRECTION):
            return None
        return self._place(y[:-1], float(y[-1]), place.tangent)

    def next_singular(self, place: CurvePoint, latest: float) -> Bracket | None:
        """Follow the curve up to a time, or to the first step that contains a singular point."""
        length = criteria.FIRST_ARC
        forward = math.copysign(1.0, latest - place.t)
        for _ in range(criteria.MAX_ARCS):
            following = self.step(place, length)
            if following is None or following.tangent @ place.tangent < criteria.STRAIGHT:
                length /= 2
                if length < criteria.SHORTEST_ARC:
                    return None
                continue
            turns = following.tangent[-1] * place.tangent[-1] <= 0
            if turns or self._changed(place, following):
                return Bracket(place, following, length, turns)
            if (following.t - latest) * forward > 0:
                return None
            place, length = following, min(2 * length, criteria.LONGEST_ARC)
        return None

    def singular_point(self, bracket: Bracket) -> tuple[CurvePoint, float] | None:
        """Return the singular configuration in a bracket, and how far along it lies."""
        first = bracket.first
        if bracket.turns:
            at = self._zero(bracket, lambda place: float(place.tangent[-1]))
            # Where several movements become free at once no step ends; beside it t is the same.
            for offset in criteria.BESIDE:
                place = self.step(first, at + offset)
                if place is not None:
                    return place, at + offset
            return None
        blocks = self._changed(first, bracket.second)
        at = self._zero(bracket, lambda place: float(self._parts(first, place, blocks).min()))
        before = self.step(first, at - criteria.AROUND)
        parts = np.zeros(len(blocks)) if before is None else self._parts(first, before, blocks)
        return self._between(first, at, blocks[int(np.argmin(parts))])

    def _between(self, first: CurvePoint, at: float, block: int) -> tuple[CurvePoint, float] | None:
        """Return a bifurcation by interpolation of places so far from it that they are accurate."""
        places = [
            self.step(first, at + offset * criteria.AROUND) for offset in criteria.AROUND_OFFSETS
        ]
        known = [place for place in places if place is not None]
        if len(known) < len(criteria.AROUND_OFFSETS):
            return None
        powers = np.vander(criteria.AROUND_OFFSETS)
        values = np.array([
            [*place.q, place.t, self._value(place, first, block)] for place in known
        ])  # fmt: skip
        coefficients = np.linalg.solve(powers, values)
        roots = np.roots(coefficients[:, -1])
        real = roots.real[
            np.abs(roots.imag) <= np.abs(roots.real) * criteria.SLIGHT + criteria.SLIGHT
        ]
        x = float(real[np.argmin(np.abs(real))]) if real.size else 0.0
        y = np.vander([x], len(criteria.AROUND_OFFSETS))[0] @ coefficients[:, :-1]
        place = self._place(y[:-1], float(y[-1]), first.tangent)
        return None if place is None else (place, at + x * criteria.AROUND)

    def _value(self, place: CurvePoint, first: CurvePoint, block: int) -> float:
        """Return the determinant of a block at a place."""
        return float(self.equations.engine.determinants(place.point, first.point)[block])

    def _zero(self, bracket: Bracket, value: Callable[[CurvePoint], float]) -> float:
        """Return the length of the step from the first point at whose end a value is zero."""

        def at(length: float) -> float:
            place = self.step(bracket.first, length) if length else bracket.first
            return math.nan if place is None else value(place)

        return root(at, 0.0, bracket.length, criteria.ROOT_LENGTH)

    def _parts(self, before: CurvePoint, after: CurvePoint, blocks: list[int] | slice) -> Vector:
        """Return the determinants of blocks, as parts of what they were."""
        there, here = (
            self.equations.engine.determinants(place.point, before.point)
            for place in (before, after)
        )
        with np.errstate(all="ignore"):
            return np.asarray((here / there)[blocks])

    def _changed(self, before: CurvePoint, after: CurvePoint) -> list[int]:
        """Return the blocks whose determinant has changed its sign, or is zero."""
        parts = self._parts(before, after, slice(None))
        return [int(block) for block in np.flatnonzero(~(parts > 0))]

    def _derivatives(self, q: Vector, t: float) -> tuple[Point, Vector] | None:
        """Return the equations and their scaled derivatives by q and t; None where not finite."""
        point = self.equations.at(q, t)
        if point is None:
            return None
        slopes = np.column_stack((point.Phi_q, -self.equations.nu(q, t)))
        matrix = self._weights[:, np.newaxis] * slopes * self.scale
        return (point, matrix) if np.isfinite(matrix).all() else None

    def _place(self, q: Vector, t: float, towards: Vector) -> CurvePoint | None:
        found = self._derivatives(q, t)
        if found is None:
            return None
        point, matrix = found
        return CurvePoint(q, t, point, matrix, _tangent(matrix, towards))


def _tangent(matrix: Vector, towards: Vector) -> Vector:
    """Return the unit vector that a matrix takes to zero, in a direction."""
    along = np.zeros(matrix.shape[0] + 1)
    along[-1] = 1.0
    try:  # a tenth of the time of singular values
        tangent = solve_linear(np.vstack((matrix, towards)), along)
    except np.linalg.LinAlgError:
        tangent = np.linalg.svd(matrix)[2][-1]
        tangent = tangent if tangent @ towards >= 0 else -tangent
    return tangent / np.linalg.norm(tangent)


def zero(low: float, high: float, width: float) -> Generator[float, tuple[float, float], None]:
    """Yield places, the last of them a zero to a width, or one where rounding errors hide it.

    The value of the function there is sent, NaN if there is none, and its slope, NaN if not known.
    """
    at_low, _ = yield low
    if at_low == 0 or not math.isfinite(at_low):
        return
    (before, value_before), (earlier, last) = (low, at_low), (math.inf, math.inf)
    t = (low + high) / 2
    for _ in range(criteria.ROOT_STEPS):
        value, slope = yield t
        if value == 0 or not math.isfinite(value):
            return
        is_known = math.isfinite(slope)
        if not is_known:
            slope = (value - value_before) / (t - before)
        low, high = (t, high) if (value > 0) == (at_low > 0) else (low, t)
        step = -value / slope if slope else math.inf
        if abs(step) <= width:
            if is_known:
                return
            step = math.copysign(width / 2, step)  # just beyond the zero, if the secant is right
        elif 2 * abs(step) > earlier:
            step = math.inf
        following = t + step
        if (following - low) * (following - high) > 0:
            following = (low + high) / 2
        if following == t or abs(high - low) <= width:
            return
        (before, value_before), (earlier, last) = (t, value), (last, abs(following - t))
        t = following


def root(function: Callable[[float], float], low: float, high: float, width: float) -> float:
    """Return a zero of a function whose slope is not known."""
    search = zero(low, high, width)
    t = next(search)
    with suppress(StopIteration):
        while True:
            t = search.send((function(t), math.nan))
    return t

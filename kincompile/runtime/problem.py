"""The equations at given parameters, and the scales by which their numbers are judged.

Nothing here compares a length with an angle, or a residual with a fixed number: a coordinate is
compared with its own scale (the size of the mechanism, or a radian), an equation with the sum of
what its terms contribute at those scales. So a mechanism in millimetres and the same one in metres
get the same verdicts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import NO_SIZE, ROUNDING, STEEP, WILD, probe_of, size_of
from kincompile.runtime.engine.code import Array, Code, code_of
from kincompile.runtime.engine.dense import Dense
from kincompile.runtime.engine.staged import Staged

if TYPE_CHECKING:
    from collections.abc import Iterable
    from types import ModuleType

    from kincompile.runtime.engine.engine import Engine, Point


@dataclass(slots=True, eq=False)
class Problem:
    """A module with its parameters set, and its scales.

    Attributes
    ----------
    code
        The module.
    engine
        What solves its equations.
    p : ndarray, shape (k,)
        Parameters.
    angular : ndarray of bool, shape (n,)
        Which coordinates are angles.
    reference : ndarray, shape (n,)
        Scale of each coordinate: 1 rad for angles, the size of the mechanism for the others.
    probe : ndarray, shape (m,)
        Numbers of size 1/2 to 1 and either sign without a pattern.
    magnitude : ndarray, shape (m,)
        What the terms of each equation contribute at a generic position.
    limit : ndarray, shape (m,)
        What they contribute at most, wherever they are.
    """

    code: Code
    engine: Engine
    p: Array
    angular: np.ndarray[tuple[int], np.dtype[np.bool_]]
    reference: Array
    probe: Array
    magnitude: Array
    limit: Array | float = np.inf

    def at(self, q: Array, t: float) -> Point | None:
        """Evaluate the equations, or give None where they have no finite value."""
        point = self.engine.evaluate(q, t)
        return point if math.isfinite(point.residual) else None

    def scale(self, q: Array) -> Array:
        """Give the scale of each coordinate at a position."""
        reference = column(self.reference, q)
        return np.minimum(np.maximum(np.abs(q), reference), WILD * reference)

    def spread(self, q: Array) -> Array:
        """Give the distance that is large for each coordinate: 1 rad, or the size of the mechanism.

        A mechanism that starts folded at the origin shows its size only later.
        """
        if q.ndim > 1:
            return self.reference[:, np.newaxis]
        lengths = self.code.lengths
        size = (np.abs(q) * lengths).max(initial=0.0)
        return np.asarray(np.maximum(self.reference, size * lengths))

    def is_small(self, correction: Array, q: Array, tolerance: float) -> bool:
        """Say whether a correction that led to q is small, or all that floating point can give."""
        allowed = tolerance * self.reference + ROUNDING * np.abs(q)
        return bool((np.abs(correction) <= allowed).all())

    def terms(self, point: Point, scale: Array) -> Array:
        """Give what the terms of each equation contribute at the scales of the coordinates.

        At a dead point a whole row of Phi_q may vanish. What it contributes elsewhere keeps the
        equation from being measured by nothing. For a batch that has to do.
        """
        if point.q.ndim > 1:
            return self.magnitude[:, np.newaxis]
        sizes = np.abs(point.Phi_q)
        if sizes.ndim > 1:
            terms = sizes @ scale
        else:
            rows, columns = self.code.pattern.T
            terms = np.bincount(rows, sizes * scale[columns], self.magnitude.size)
        return np.asarray(np.maximum(self.magnitude, np.minimum(terms, self.limit)))

    def holds(self, point: Point, tolerance: float) -> Any:
        """Say where every equation holds, relative to what its terms contribute.

        The reference is the scale here: a wild iterate must not become a solution because its own
        coordinates are huge.
        """
        if point.q.ndim == 1 and within(point.Phi, tolerance * self.magnitude):
            return True  # nearly always; the terms are never less, and cost a pass over Phi_q
        terms = self.terms(point, self.reference)
        return within(point.Phi, tolerance * terms)

    def holds_to_rounding(self, point: Point) -> Any:
        """Say where every equation holds as well as floating point permits."""
        terms = self.terms(point, self.scale(point.q))
        return within(point.Phi, ROUNDING * terms)


def problem(
    module: ModuleType,
    p: Array,
    q: Array,
    t: float,
    guess: Array | None = None,
    *,
    staged: bool = False,
    engine: Engine | None = None,
) -> Problem:
    """Set a module's parameters; a position and the guess give the size of the mechanism.

    The guess is the module's where none is given. With `staged`, a module that has stages is solved
    by them, without a dense matrix. An engine with these parameters may be given.
    """
    code = code_of(module)
    m, angular = len(code.equations), code.angular
    if engine is None:
        engine = Staged(code, p) if staged and code.stages else Dense(code, p)
    equations = Problem(code, engine, p, angular, np.ones(q.size), probe_of(m), np.zeros(m))
    size = size_of(angular, q, code.guess if guess is None else guess)
    if not size and isinstance(engine, Dense) and (point := equations.at(q, t)) is not None:
        size = _size_in_equations(point, angular)
    if size > NO_SIZE:
        equations.reference = np.where(angular, 1.0, size)
    generic = equations.at(q + equations.reference * equations.probe[: q.size], t)
    if generic is not None and np.isfinite(generic.Phi_q).all():
        equations.magnitude = terms = equations.terms(generic, equations.reference)
        equations.limit = np.where(terms > 0, STEEP * terms, np.inf)
    return equations


def within(values: Array | Iterable[Array], limits: Array) -> Any:
    """Say where no value, of a row of a batch, is beyond the limit of its row.

    Nearly always all of a batch together meet what each must meet, and one number costs less than
    a mask.
    """
    if isinstance(values, np.ndarray) and values.ndim == 1:
        return (np.abs(values) <= limits).all()
    good: Any = np.True_
    for row, limit in zip(values, limits.ravel().tolist(), strict=True):
        if not np.dot(row, row) <= limit * limit:
            good = good & (np.abs(row) <= limit)
            if not good.any():
                break
    return good


def largest(rows: Iterable[Any], count: int) -> Array:
    """Return the largest size in the rows of a batch, for each of it."""
    result = np.zeros(count)
    for row in rows:
        np.maximum(result, np.abs(row), out=result)
    return result


def column(values: Array, q: Array) -> Array:
    """Return a number for each coordinate or equation in the shape that fits positions."""
    return values if q.ndim == 1 else values[:, np.newaxis]


def _size_in_equations(point: Point, angular: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> float:
    """Give the largest length that the equations show where all coordinates are zero.

    Divided by the derivative with respect to a length, a residual is a distance still to go and
    the derivative with respect to an angle is a lever arm.
    """
    slopes = np.abs(point.Phi_q)
    along = np.max(slopes, axis=1, where=~angular, initial=0.0)
    shown = np.abs(point.Phi) + np.max(slopes, axis=1, where=angular, initial=0.0)
    rows = along > 0
    size = float(np.max(shown[rows] / along[rows], initial=0.0))
    return size if math.isfinite(size) else 0.0

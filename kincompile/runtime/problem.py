"""One position: its equations, their dense matrix, and the scales by which numbers are judged.

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

from kincompile.criteria import (
    AGREEMENT,
    FOLDED,
    NO_SIZE,
    RESIDUAL_FACTOR,
    ROUNDING,
    STEEP,
    WILD,
    probe_of,
    size_of,
)
from kincompile.runtime.engine.code import Array, Code, code_of
from kincompile.runtime.engine.engine import Point, Rates
from kincompile.runtime.engine.planned import Planned
from kincompile.runtime.engine.staged import Staged
from kincompile.runtime.engine.stages import StagedSolver
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Iterable
    from types import ModuleType

    from kincompile.runtime.engine.engine import Engine

LARGEST_POWER = 700.0
"""Power of e beyond which no determinant is given: floating point ends at 709."""


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
        return point if math.isfinite(point.Phi.sum()) else None

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

    def leaves_branch(self, guess: Point, found: Point) -> bool:
        """Say whether a guess shows a branch, and a position found from it lies on another."""
        wanted = self.engine.signs(guess)
        return all(wanted) and self.engine.signs(found) != wanted

    def is_folded(self, guess: Point, found: Point) -> bool:
        """Say whether a guess shows no branch: beside a position, a determinant is zero there."""
        here, there = (self.engine.determinants(point, point).tolist() for point in (guess, found))
        return any(abs(one) <= FOLDED * abs(two) for one, two in zip(here, there, strict=True))

    def has_converged(self, before: Point, point: Point, tolerance: float, crawls: bool) -> bool:
        """Say whether Newton's method is at its end: the last correction small, and Phi zero.

        Near a singular configuration rounding alone keeps the corrections above any tolerance; then
        they crawl, shrinking no faster than towards a double root, by halves.
        """
        small = self.is_small(point.q - before.q, point.q, tolerance)
        if small and self.holds(point, RESIDUAL_FACTOR * tolerance):
            return True
        return (small or crawls) and bool(self.holds_to_rounding(point))

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
    """Say where no value, of a row of a batch, is beyond the limit of its row."""
    if isinstance(values, np.ndarray) and values.ndim == 1:
        return (np.abs(values) <= limits).all()
    good: Any = np.True_
    for row, limit in zip(values, limits.ravel().tolist(), strict=True):
        if not np.dot(row, row) <= limit * limit:
            good = good & (np.abs(row) <= limit)
    return good


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


class Dense:
    """An engine of one point at a time, whose Phi_q is a matrix (m, n).

    Signs and sizes of blocks come from the planned solve, in one piece or in stages, where the
    module has one. Where redundant equations forbid a determinant, that of the equations'
    independent combinations takes its place: these turn slowly along a motion, and are those of the
    point before.

    Parameters
    ----------
    code
        A module.
    p : ndarray, shape (k,)
        Parameters.
    """

    def __init__(self, code: Code, p: Array) -> None:
        self.code, self._p = code, p
        self._stages = StagedSolver(code) if code.stages else None

    def evaluate(self, q: Array, t: float) -> Point:
        """Evaluate Phi and Phi_q at one point."""
        try:
            return Point(q, t, *self.code.position(q, t, self._p))
        except (ArithmeticError, ValueError):  # of math.sqrt, log, or 1/0; NaN or infinity in q
            m = len(self.code.equations)
            return Point(q, t, np.full(m, np.nan), np.full((m, q.size), np.nan))

    def factor(self, point: Point) -> None:
        """Do nothing: LAPACK factors with each right side."""

    def solve(self, point: Point, b: Array) -> Array:
        """Return x of Phi_q x = b, b of shape (m,) or (m, k)."""
        try:
            return solve_linear(point.Phi_q, b)
        except np.linalg.LinAlgError:
            return np.full((point.q.size, *b.shape[1:]), np.nan)

    def solve_transposed(self, point: Point, b: Array) -> Array:
        """Return x of Phi_q^T x = b; of redundant equations the shortest."""
        try:
            if point.Phi_q.shape[0] == point.Phi_q.shape[1]:
                return np.asarray(np.linalg.solve(point.Phi_q.T, b), dtype=np.float64)
            return np.asarray(np.linalg.lstsq(point.Phi_q.T, b, rcond=None)[0], dtype=np.float64)
        except np.linalg.LinAlgError:
            return np.full((point.Phi.size, *b.shape[1:]), np.nan)

    def rates(self, point: Point, besides: Array | None) -> Rates:
        """Return the rates at a point, and x of Phi_q x = besides if that is asked for."""
        nothing = np.full(point.q.size, np.nan)
        sides = np.empty((point.Phi.size, 2))
        sides[:, 1] = 0.0 if besides is None else besides  # a second right side costs nothing
        try:
            sides[:, 0] = self.code.nu(point.q, point.t, self._p)
        except (ArithmeticError, ValueError):
            sides[:, 0] = np.nan
        q_dot, movement = self.solve(point, sides).T
        try:
            gamma = self.code.gamma(point.q, q_dot, point.t, self._p)
        except (ArithmeticError, ValueError):
            return Rates(q_dot, nothing, movement)
        q_ddot = self.solve(point, gamma)
        agree = _agree(point.Phi_q, q_dot, sides[:, 0]) and _agree(point.Phi_q, q_ddot, gamma)
        return Rates(q_dot, q_ddot, movement, agree)

    def determinants(self, point: Point, before: Point) -> Array:
        """Return the determinants of the blocks; without any, one relative to the point before."""
        found = self._blocks(point)
        if found is not None or point is before:
            return np.ones(1) if found is None else found
        matrix, reference = point.Phi_q, before.Phi_q
        if matrix.shape[0] != matrix.shape[1]:
            basis = np.linalg.svd(reference, full_matrices=False)[0].T
            matrix, reference = basis @ matrix, basis @ reference
        sign, size = np.linalg.slogdet(matrix)
        sign_there, size_there = np.linalg.slogdet(reference)
        return np.array([sign * sign_there * math.exp(min(size - size_there, LARGEST_POWER))])

    def signs(self, point: Point) -> tuple[float, ...]:
        """Return the signs of the determinants; none where equations are redundant."""
        found = self._blocks(point)
        if found is not None:
            return tuple(np.sign(found).tolist())
        matrix = point.Phi_q
        square = matrix.shape[0] == matrix.shape[1]
        return (float(np.linalg.slogdet(matrix)[0]),) if square else ()

    def _blocks(self, point: Point) -> Array | None:
        """Return the determinants of the blocks that the module knows, if it knows any."""
        if point.factors is None and self.code.lanes is not None:
            point.factors = self._planned(point)
        elif point.factors is None and self._stages is not None:
            point.factors = self._stages.determinants_of(point.Phi_q[tuple(self.code.pattern.T)])
        return None if point.factors is None else np.asarray(point.factors)

    def _planned(self, point: Point) -> Array:
        """Return the determinants by the planned solve."""
        lanes, p = self.code.lanes, self._p.tolist()
        assert lanes is not None
        q, t = point.q, point.t
        values = lanes.position(lanes.floats, q.tolist(), t, p)
        try:
            found = lanes.factor(lanes.floats, values[len(self.code.equations) :])[1]
        except ArithmeticError:  # floats refuse 1/0 in the factors of a singular block
            batch = Planned(self.code, self._p)
            return batch.determinants(batch.evaluate(q[:, np.newaxis], t))[:, 0]
        return np.array(found, dtype=np.float64)


def _agree(matrix: Array, rates: Array, sides: Array) -> bool:
    """Say whether redundant equations are all met by the rates that solve them best."""
    if matrix.shape[0] == matrix.shape[1]:
        return True
    terms = np.abs(matrix) @ np.abs(rates) + np.abs(sides)
    missing = np.abs(matrix @ rates - sides)
    return bool(np.max(missing) <= AGREEMENT * np.max(terms))


def solve_linear(matrix: Array, sides: Array) -> Array:
    """Return x of matrix x = sides; of more equations than unknowns in the sense of least squares.

    Redundant equations that agree change nothing. That they do agree is for the caller to check.

    Parameters
    ----------
    matrix : ndarray, shape (m, n)
        With m >= n.
    sides : ndarray, shape (m,) or (m, k)
        Right-hand sides.

    Raises
    ------
    numpy.linalg.LinAlgError
        When the rank is less than n.
    """
    m, n = matrix.shape
    if m == n:
        return np.asarray(np.linalg.solve(matrix, sides), dtype=np.float64)
    solution, _, rank, _ = np.linalg.lstsq(matrix, sides, rcond=None)
    if rank < n:
        raise np.linalg.LinAlgError("dependent columns")
    return np.asarray(solution, dtype=np.float64)


def norm(vector: Array) -> float:
    """Return the Euclidean norm; three times as fast as `numpy.linalg.norm`."""
    return math.sqrt(vector @ vector)


def unsolvable(point: Point) -> Status:
    """Say why Phi_q x = b has no solution at a point."""
    return Status.SINGULAR if np.isfinite(point.Phi_q).all() else Status.NOT_FINITE

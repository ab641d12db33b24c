"""One position: its equations, their dense matrix, and the scales by which numbers are judged.

Nothing here compares a length with an angle, or a residual with a fixed number: a coordinate is
compared with its own scale (the size of the mechanism, or a radian), an equation with the sum of
what its terms contribute at those scales. So a mechanism in millimetres and the same one in metres
get the same verdicts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import (
    ASTRAY,
    FAR,
    FOLDED,
    MIRROR_STEP,
    MOST_MIRRORED,
    NEAR_ANGLE,
    NEAR_PART,
    RESIDUAL_FACTOR,
    ROUNDING,
    SETTLED,
    STEEP,
    WILD,
    probe_of,
    rounded,
    size_of,
)
from kincompile.runtime.engine.code import Array, Code, code_of
from kincompile.runtime.engine.engine import Point, Rates, agree
from kincompile.runtime.engine.planned import Planned
from kincompile.runtime.engine.staged import Staged
from kincompile.runtime.engine.stages import StagedSolver
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from types import ModuleType

    from kincompile.runtime.engine.engine import Engine

LARGEST_CAREFUL = 1000
"""Coordinates up to which a large mechanism is left to dense matrices where the stages fail: there
a step takes a fraction of a second."""

THROWN = 10.0
"""Distance from a guess, in those up to which it is near, beyond which an iterate is thrown far."""

LARGEST_POWER = 700.0
"""Power of e beyond which no determinant is given: floating point ends at 709."""


@dataclass(slots=True, eq=False)
class Problem:
    """A module with its parameters set, and its scales."""

    code: Code
    engine: Engine  # what solves its equations
    p: Array  # (k,): parameters
    angular: np.ndarray[tuple[int], np.dtype[np.bool_]]  # (n,), bool: which coordinates are angles
    size: float  # the size of the mechanism
    # (n,): scale of each coordinate: 1 rad for angles, the size of the mechanism for the others
    reference: Array
    # (n,): how far from zero each coordinate is at a guess, or in the assembled mechanism
    place: Array
    # Correction, in scales, below which there are only rounding errors of so far a place.
    floor: float
    probe: Array  # (m,): numbers of size 1/2 to 1 and either sign without a pattern
    magnitude: Array  # (m,): what the terms of each equation contribute at a generic position
    # (m,): what rounding errors of so large coordinates leave of each equation
    noise: Array
    limit: Array | float = np.inf  # (m,): what they contribute at most, wherever they are

    def at(self, q: Array, t: float) -> Point | None:
        """Evaluate the equations, or give None where they have no finite value."""
        point = self.engine.evaluate(q, t)
        return point if math.isfinite(point.Phi.sum()) else None

    def scale(self, q: Array) -> Array:
        """Give how large each coordinate is at a position, as far as it is not gone wild."""
        return np.minimum(np.maximum(np.abs(q), self.reference), WILD * self.reference + self.place)

    def is_small(self, correction: Array, q: Array, tolerance: float) -> bool:
        """Say whether a correction that led to q is small, or all that floating point can give."""
        allowed = max(tolerance, self.floor) * self.reference + ROUNDING * np.abs(q)
        return bool((np.abs(correction) <= allowed).all())

    def leaves_branch(self, guess: Point, found: Point) -> bool:
        """Say whether a guess shows a branch, and a position found from it lies on another."""
        wanted = self.engine.signs(guess)
        return all(wanted) and self.engine.signs(found) != wanted

    @property
    def is_careful(self) -> bool:
        """Whether matrices are dense and code is in Python, or the mechanism too large for it."""
        is_written = isinstance(self.engine, Dense) and self.engine.is_written
        return is_written or self.place.size > LARGEST_CAREFUL

    def careful(self) -> Problem:
        """Give the same with dense matrices and code in Python.

        Where Newton's method throws an iterate far, the last digit decides where it ends: so it has
        to be the same in all forms of a module.
        """
        return replace(self, engine=Dense(self.code, self.p, is_written=True))

    @property
    def near(self) -> Array:
        """How far each coordinate of a guess may be from an assembly that it is near."""
        return self.reference * np.where(self.angular, NEAR_ANGLE, NEAR_PART)

    def away(self, q: Array, guess: Array) -> Any:
        """Give how far a position, or each of a batch, is from a guess; up to 1.0 it is near."""
        return (np.abs(q - guess) / column(self.near, q)).max(axis=0)

    def is_far(self, q: Array, guess: Array) -> Any:
        """Say whether an angle of a position, or of each of a batch, is far from a guess's."""
        return (np.abs(q - guess)[self.code.may_turn] > FAR).any(axis=0)

    def strays(self, guess: Point, found: Point) -> bool:
        """Say whether a position found from a guess is not what the guess shows."""
        is_far = self.is_far(found.q, guess.q) or self.away(found.q, guess.q) > ASTRAY
        return bool(is_far) or self.leaves_branch(guess, found)

    def is_settled(self, way: Sequence[Point]) -> bool:
        """Say whether a way led from a guess to an assembly so near that no nearer one is sought.

        In compiled code it must not have gone far: where it ends then, rounding would decide.
        """
        iterates = np.array([point.q for point in way]).T
        away = self.away(iterates, iterates[:, :1])
        return bool(away[-1] <= SETTLED and (self.is_careful or (away <= THROWN).all()))

    def other_side(self, point: Point) -> Array:
        r"""Give about where a mechanism can be assembled beyond the nearest singular position.

        Two ways to assemble a dyad lie on both sides of the position in which it is stretched,
        along the movement that is free there. So the smallest singular value
        :math:`\sigma = u^T \Phi_q v` of one falls along :math:`v`, to zero half way to the other.
        NaN where the mechanism is too large, or nothing bends.
        """
        if point.q.size > MOST_MIRRORED:
            return np.full_like(point.q, np.nan)
        rows, scale = self.weights()[:, np.newaxis], self.near
        here = rows * point.Phi_q * scale
        if not np.isfinite(here).all():  # LAPACK would say so on the terminal
            return np.full_like(point.q, np.nan)
        left, sizes, right = np.linalg.svd(here, full_matrices=False)
        u, size, v = left[:, -1], sizes[-1], right[-1]
        moved = self.engine.evaluate(point.q + MIRROR_STEP * scale * v, point.t)
        bend = u @ (rows * moved.Phi_q * scale - here) @ v / MIRROR_STEP
        return np.asarray(point.q - 2 * size / bend * scale * v)

    def is_folded(self, guess: Point, found: Point) -> bool:
        """Say whether a guess shows no branch: beside a position, a determinant is zero there."""
        here, there = (self.engine.determinants(point, point) for point in (guess, found))
        return bool((np.abs(here) <= FOLDED * np.abs(there)).any())

    def has_converged(
        self, before: Point, point: Point, tolerance: float, corrections: list[float]
    ) -> bool:
        """Say whether Newton's method is at its end: the last correction small, and Phi zero.

        Near a singular configuration rounding alone keeps the corrections above any tolerance: they
        crawl.
        """
        small = self.is_small(point.q - before.q, point.q, tolerance)
        if small and self.holds(point, RESIDUAL_FACTOR * tolerance):
            return True
        return (small or crawls(corrections)) and bool(self.holds_to_rounding(point))

    def weights(self) -> Array:
        """Give by what equations of different units are multiplied to count alike."""
        return weights_of(self.magnitude)

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
        noise = column(self.noise, point.q)
        return within(point.Phi, tolerance * self.terms(point, self.reference) + noise)

    def holds_to_rounding(self, point: Point) -> Any:
        """Say where every equation holds as well as floating point permits."""
        terms = self.terms(point, self.scale(point.q))
        return within(point.Phi, ROUNDING * terms)


def problem(
    module: ModuleType,
    p: Array,
    q: Array,
    t: float,
    *,
    staged: bool = False,
    engine: Engine | None = None,
) -> Problem:
    """Set a module's parameters; the equations at a guess or a position give the scales.

    With `staged`, a module that has stages is solved by them, without a dense matrix. An engine
    with these parameters may be given.
    """
    code = code_of(module)
    m, angular, pattern = len(code.equations), code.angular, code.pattern
    if engine is None:
        engine = Staged(code, p) if staged and code.stages else Dense(code, p)

    def entries(q: Array) -> tuple[Array, Array]:
        point = engine.evaluate(q, t)
        values = point.Phi_q
        return point.Phi, values if values.ndim == 1 else values[pattern[:, 0], pattern[:, 1]]

    size = float(rounded(size_of(entries, pattern, angular, q))) or 1.0
    reference = np.where(angular, 1.0, size)
    place, probe = np.abs(q), probe_of(m)
    floor = float(ROUNDING * (place[~angular] / size).max(initial=0.0))
    none = np.zeros(m)
    equations = Problem(code, engine, p, angular, size, reference, place, floor, probe, none, none)
    generic = equations.at(q + reference * probe_of(q.size), t)
    if generic is not None and np.isfinite(generic.Phi_q).all():
        equations.magnitude = rounded(equations.terms(generic, reference))
        here = equations.terms(generic, reference + equations.place)
        equations.noise = ROUNDING * here
        equations.limit = np.where(here > 0, STEEP * here, np.inf)
    return equations


def weights_of(terms: Array) -> Array:
    """Return by what equations are multiplied whose terms contribute so much, to count alike."""
    return np.asarray(1 / np.where(terms > 0, terms, 1.0))


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


class Dense:
    """An engine of one point at a time, whose Phi_q is a matrix (m, n).

    Signs and sizes of blocks come from the planned solve, in one piece or in stages, where the
    module has one. Where redundant equations forbid a determinant, that of the equations'
    independent combinations takes its place: these turn slowly along a motion, and are those of the
    point before. With `is_written` code in Python evaluates Phi and Phi_q of a compiled module too.
    """

    def __init__(self, code: Code, p: Array, *, is_written: bool = False) -> None:
        self.code, self._p = code, p
        self._position = code.written if is_written else code.position
        self.is_written = self._position is code.written
        self._stages = StagedSolver(code) if code.stages else None

    def evaluate(self, q: Array, t: float) -> Point:
        """Evaluate Phi and Phi_q at one point."""
        try:
            return Point(q, t, *self._position(q, t, self._p))
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
        holds = agree(point.Phi_q, q_dot, sides[:, 0]) and agree(point.Phi_q, q_ddot, gamma)
        return Rates(q_dot, q_ddot, movement, bool(holds))

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
        if self.code.redundant:
            return None  # those of the planned solve are of the independent equations alone
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


def solve_linear(matrix: Array, sides: Array) -> Array:
    """Return x of matrix x = sides; of more equations than unknowns in the sense of least squares.

    `matrix` (m, n) has m >= n and rank n, else `numpy.linalg.LinAlgError` is raised; `sides` are
    (m,) or (m, k). Redundant equations that agree change nothing, and the caller checks that they
    do.
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


def crawls(corrections: Sequence[float]) -> bool:
    """Say whether corrections shrink no faster than towards a double root, by halves."""
    return len(corrections) > 1 and corrections[-1] > corrections[-2] / 4


def unsolvable(point: Point) -> Status:
    """Say why Phi_q x = b has no solution at a point."""
    return Status.SINGULAR if np.isfinite(point.Phi_q).all() else Status.NOT_FINITE

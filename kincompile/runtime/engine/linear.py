"""What solves with a module's equations: one base class, whatever the mechanism and its form.

| class | linear systems | for |
| --- | --- | --- |
| `Planned` | the elimination planned at compile time | batches of points or variants |
| `Dense` | LAPACK with pivoting; least squares for redundant equations | single points |
| `Floats` | the planned elimination, on plain floats | a start from a guess that is near |
| `Sparse` | equal blocks of a large sparse matrix side by side | the grouped form |

A compiled module needs none of its own: its functions take the place of the NumPy ones. A solve for
rates knows what it misses of them; a correction of Newton's method is judged by the next one.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.criteria import (
    AGREEMENT,
    LARGEST_POWER,
    SLOW,
    SMALLEST_DETERMINANT,
    SOLVED,
    TINY,
)
from kincompile.runtime.engine.blocks import BlockSolver
from kincompile.runtime.engine.scales import Point
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.runtime.engine.code import Compiled, LaneFunctions
    from kincompile.runtime.engine.scales import Scales

Array = NDArray[np.float64]
Lanes = Sequence[Any] | Array
"""One lane a coordinate or an equation: a float, or an array (N,) over a batch."""

LARGEST_CAREFUL = 1000
"""Coordinates up to which a large mechanism is left to dense matrices where the blocks fail: there
a step takes a fraction of a second."""

SEED = 1989
"""Of the weights of points."""


@dataclass(slots=True, eq=False)
class Rates:
    """Velocity and acceleration at a position."""

    # q_dot, q_ddot, in the shape of q: the rates; not finite where they cannot be had
    q_dot: Array
    q_ddot: Array
    movement: Array  # in the shape of q: the solution for the extra right side
    # nu, gamma: the right sides, (m,), or of a batch a row each
    nu: Any
    gamma: Any
    are_met: Any = False  # bool or (N,), bool: where both equations are known to hold


class Linear(ABC):
    """The equations of a module with parameters set, and the linear systems of their Phi_q.

    No method raises on numbers: what cannot be had is not finite.
    """

    code: Compiled

    @abstractmethod
    def evaluate(self, q: Array, t: Any) -> Point:
        """Evaluate Phi and Phi_q at positions (n,) or (n, N) and times () or (N,)."""

    @abstractmethod
    def solve(self, point: Point, b: Array) -> Any:
        """Return x of Phi_q x = b, b of shape (m,) or (m, N); of a batch also as a row each."""

    @abstractmethod
    def missing(self, point: Point, x: Array, b: Any) -> Any:
        """Return Phi_q x - b, of a batch a row each."""

    @abstractmethod
    def rates(self, point: Point, extra_rhs: Array | None) -> Rates:
        """Return the rates at a point; with `extra_rhs` also x of Phi_q x = extra_rhs."""

    @abstractmethod
    def determinants(self, point: Point, before: Point) -> Array:
        """Return the determinants of the blocks of Phi_q, shape (blocks,) or (blocks, N).

        Where there are no blocks it is one number, relative to that of a point before.
        """

    def signs(self, point: Point) -> tuple[float, ...]:
        """Return their signs at one point; none where redundant equations forbid a determinant."""
        return tuple(np.sign(self.determinants(point, point)).ravel().tolist())

    def solved(self, scales: Scales, point: Point, extra_rhs: Array | None = None) -> Rates:
        """Return the rates at a point as `rates` does, with where they meet their equations."""
        rates = self.rates(point, extra_rhs)
        rates.are_met = self.meet(scales, point, rates)
        return rates

    def meet(self, scales: Scales, point: Point, rates: Rates) -> Any:
        """Say where Phi_q q_dot = nu and Phi_q q_ddot = gamma hold for rates that were solved for.

        Each equation is measured by its own coefficients and the largest rate, in scales.
        """
        parts = self.parts(scales, point)
        speed, growth = sizes_of(scales, rates)
        good: Any = np.isfinite(speed + growth)
        for x, b, size in ((rates.q_dot, rates.nu, speed), (rates.q_ddot, rates.gamma, growth)):
            missing = self.missing(point, x, b)
            if point.q.ndim == 1:
                good = good and bool((np.abs(missing) <= parts * size).all())
                continue
            for row, part in zip(missing, parts.tolist(), strict=True):
                good = good & (np.abs(row) <= part * size)
        return good

    def parts(self, scales: Scales, point: Point) -> Array:
        """Return what each equation may be missed by at rates of one scale, shape (m,)."""
        # By least squares all miss a little.
        part = AGREEMENT if scales.code.redundant else SOLVED
        return np.asarray(part * scales.terms(point, scales.reference).ravel())


def sizes_of(scales: Scales, rates: Rates) -> tuple[Any, Any]:
    """Return how large velocities and accelerations are, in scales.

    The size of accelerations is also the square of the velocities, which gamma is made of.
    """
    speed = scales.extent(rates.q_dot) + TINY
    return speed, scales.extent(rates.q_ddot) + speed * speed


@dataclass(slots=True, eq=False)
class Planned(Linear):
    """An engine whose linear systems go by the elimination that was planned at compile time."""

    code: Compiled  # a module with a planned solve
    p: Lanes  # (k,) or (k, N), or sequence of float: parameters, of all points or a set for each
    # The module's elementary functions of floats, where positions are lists of floats: one of them
    # then takes as long as a few calls of NumPy. None for those of arrays.
    functions: Any = None

    @property
    def _own(self) -> tuple[LaneFunctions, Any]:
        """The code of the mechanism, and the elementary functions that it is given."""
        own = self.code.lanes
        assert own is not None
        return own, self.functions or own.arrays

    def evaluate(self, q: Any, t: Any) -> Point:
        """Evaluate Phi and the varying entries of Phi_q."""
        own, functions = self._own
        values = own.position(functions, q, t, self.p)
        m = len(self.code.equations)
        return Point(q, t, values[:m], values[m:])

    def factor(self, point: Point) -> None:
        """Factor Phi_q of a point, once; the determinants of its blocks come with it."""
        if point.factors is None:
            own, functions = self._own
            point.factors = own.factor(functions, point.Phi_q)

    def solve(self, point: Point, b: Lanes) -> Any:
        """Return x of Phi_q x = b, one lane a coordinate."""
        self.factor(point)
        own, functions = self._own
        return own.solve(functions, point.factors[0], b)

    def velocity_and_acceleration(self, point: Point) -> tuple[Lanes, Lanes, Lanes, Lanes]:
        """Return nu, q_dot, gamma and q_ddot at a point, one lane an equation or coordinate."""
        own, functions = self._own
        nu = own.nu(functions, point.q, point.t, self.p)
        q_dot = self.solve(point, nu)
        gamma = own.gamma(functions, point.q, q_dot, point.t, self.p)
        return nu, q_dot, gamma, self.solve(point, gamma)

    def rates(
        self, point: Point, extra_rhs: Array | None, into: tuple[Array, Array] | None = None
    ) -> Rates:
        """Return the rates at a point, in arrays (n, N) that are given or new ones; see there."""
        nu, q_dot, gamma, q_ddot = self.velocity_and_acceleration(point)
        movement = () if extra_rhs is None else self.solve(point, extra_rhs)
        points = point.q.shape[1]
        velocity, acceleration = into or np.empty((2, len(q_dot), points))
        fill(velocity, q_dot)
        fill(acceleration, q_ddot)
        return Rates(velocity, acceleration, stacked(movement, points), nu, gamma)

    def missing(self, point: Point, x: Array, b: Lanes) -> Lanes:
        """Return Phi_q x - b, a row each."""
        rows, varying = [-right for right in b], iter(point.Phi_q)
        for row, column, number in self.code.entries:
            rows[row] = rows[row] + (next(varying) if number is None else number) * x[column]
        return rows

    def meet(self, scales: Scales, point: Point, rates: Rates) -> Any:
        """Say where the equations of rates hold; all together, where all points of a batch do."""
        together = self._meet_together(scales, point, rates)
        return together or Linear.meet(self, scales, point, rates)

    def parts(self, scales: Scales, point: Point) -> Array:
        """Return what each equation may be missed by; the solve leaves some of them out."""
        code, part = scales.code, np.asarray(SOLVED)
        if code.redundant:
            part = np.where(np.isin(code.equations, code.redundant), AGREEMENT, SOLVED)
        return np.asarray(part * scales.magnitude)

    def _meet_together(self, scales: Scales, point: Point, rates: Rates) -> bool:
        """Say whether all points of a batch meet together what each of them must meet.

        They do nearly always, and one number a row costs less than a mask. Velocities and
        accelerations are divided by their sizes and added up with weights of size 1/2 to 1, drawn
        at random with their signs: no errors cancel. Nearly always one coordinate shows how fast
        all are, and gives the sizes.
        """
        middle = np.abs(rates.q_dot[:, rates.q_dot.shape[1] // 2]) / scales.reference
        fast = int(np.argmax(middle))
        speed = np.abs(rates.q_dot[fast]) / scales.reference[fast]
        growth = speed * speed
        if not speed.min() > SLOW * speed.max():  # it turns back, or all are at rest
            speed, growth = sizes_of(scales, rates)
        parts = self.parts(scales, point)
        q_dot, q_ddot = rates.q_dot, rates.q_ddot
        weights = weights_of_points(speed.size)
        first, second = weights[0] / speed, weights[1] / growth
        sums = q_dot @ first + q_ddot @ second
        row, column = self.code.pattern.T
        known = np.nan_to_num(self.code.numbers) * sums[column]
        rows = np.bincount(row, known, len(self.code.equations)).tolist()
        for row, (nu, gamma) in enumerate(zip(rates.nu, rates.gamma, strict=True)):
            rows[row] -= sum_of(first, nu) + sum_of(second, gamma)
        x, part = np.empty_like(first), np.empty_like(first)
        for column, entries in self.code.varying:
            np.multiply(q_dot[column], first, out=x)
            np.multiply(q_ddot[column], second, out=part)
            x += part
            for row, place in entries:
                rows[row] += sum_of(x, point.Phi_q[place])
        return bool((np.abs(rows) <= 0.5 * parts).all())

    def determinants(self, point: Point, before: Point | None = None) -> Array:
        """Return the determinants of the blocks, shape (blocks, N)."""
        self.factor(point)
        return stacked(point.factors[1], point.q.shape[1])


@lru_cache(maxsize=16)
def weights_of_points(count: int) -> Array:
    """Return numbers of size 1/2 to 1 and either sign, drawn at random, (2, count)."""
    drawn = np.random.default_rng(SEED).uniform(-0.5, 0.5, (2, count))
    weights = np.asarray(drawn + np.copysign(0.5, drawn))
    weights.setflags(write=False)
    return weights


def sum_of(weights: Array, lane: Any) -> Any:
    """Return the weighted sum of a lane, which may be one number for all points."""
    if isinstance(lane, np.ndarray):
        return weights.dot(lane)
    return lane * weights.sum() if lane else 0.0


def stacked(lanes: Lanes, points: int) -> Array:
    """Return lanes, some of which may be one number for all points, as an array (..., N)."""
    result = np.empty((len(lanes), points))
    fill(result, lanes)
    return result


def fill(rows: Array, lanes: Lanes) -> None:
    """Write lanes into the rows of an array (..., N)."""
    for row, lane in zip(rows, lanes, strict=True):
        row[:] = lane


def trusted(missed: Array, determinants: Array) -> NDArray[np.bool_]:
    """Return at which of N points solves by elimination can be trusted.

    They are by what part of their terms equations are missed, (N,), and by determinants,
    (blocks, N): near a singular configuration errors are large though the equations hold.
    """
    sizes = np.abs(determinants)
    smallest = SMALLEST_DETERMINANT * np.max(sizes, axis=1, initial=0.0, where=sizes < np.inf)
    found: NDArray[np.bool_] = np.all(sizes > smallest[:, np.newaxis], axis=0)
    return found & (missed <= SOLVED)


class Floats(Linear):
    """An engine of one point at a time, by the planned elimination and on plain floats.

    It takes a fifth of the time of matrices and has no pivots: what it finds is looked at. Phi_q
    is the entries of its pattern. Equations must not be redundant.
    """

    def __init__(self, code: Compiled, p: Array) -> None:
        assert code.lanes is not None
        self.code, self._p, self._own, self._varies = code, p, code.lanes, np.isnan(code.numbers)

    def _run(self, function: Callable[..., Any], *given: Any) -> Any:
        """Call code of the mechanism; where floats refuse, as 1/0, with NumPy's numbers."""
        own = self._own
        try:
            floats = [x.tolist() if isinstance(x, np.ndarray) else x for x in given]
            return function(own.floats, *floats)
        except (ArithmeticError, ValueError):
            return function(own.arrays, *map(np.asarray, given))

    def _at(self, function: Callable[..., Any], t: float, *states: Array) -> Array:
        """Return what code of the mechanism gives at a point."""
        return np.array(self._run(function, *states, t, self._p), dtype=np.float64)

    def evaluate(self, q: Array, t: float) -> Point:
        """Evaluate Phi and the entries of Phi_q at one point."""
        values, m = self._at(self._own.position, t, q), len(self.code.equations)
        entries = self.code.numbers.copy()
        entries[self._varies] = values[m:]
        return Point(q, t, values[:m], entries)

    def _factor(self, point: Point) -> Any:
        """Return the factors of Phi_q of a point, which is factored once, and the determinants."""
        if point.factors is None:
            point.factors = self._run(self._own.factor, point.Phi_q[self._varies])
        return point.factors

    def solve(self, point: Point, b: Array) -> Array:
        """Return x of Phi_q x = b, b of shape (m,)."""
        return np.array(self._run(self._own.solve, self._factor(point)[0], b), dtype=np.float64)

    def missing(self, point: Point, x: Array, b: Array) -> Array:
        """Return Phi_q x - b."""
        rows, columns = self.code.pattern.T
        return np.asarray(np.bincount(rows, point.Phi_q * x[columns], b.size) - b)

    def parts(self, scales: Scales, point: Point) -> Array:
        """Return what each equation may be missed by: terms cost more, and are never less."""
        return np.asarray(SOLVED * scales.magnitude)

    def rates(self, point: Point, extra_rhs: Array | None) -> Rates:
        """Return the rates at a point; with `extra_rhs` also x of Phi_q x = extra_rhs."""
        nu = self._at(self._own.nu, point.t, point.q)
        q_dot = self.solve(point, nu)
        gamma = self._at(self._own.gamma, point.t, point.q, q_dot)
        movement = np.empty(0) if extra_rhs is None else self.solve(point, extra_rhs)
        return Rates(q_dot, self.solve(point, gamma), movement, nu, gamma)

    def determinants(self, point: Point, before: Point) -> Array:
        """Return the determinants of the blocks."""
        return np.array(self._factor(point)[1], dtype=np.float64)


class Dense(Linear):
    """An engine of one point at a time, whose Phi_q is a matrix (m, n).

    Signs and sizes of blocks come from the planned solve or the block triangular form, where the
    module has one. Where redundant equations forbid a determinant, that of the equations'
    independent combinations takes its place: these turn slowly along a motion, and are those of the
    point before. With `is_written` code in Python evaluates Phi and Phi_q of a compiled module too.
    """

    def __init__(self, code: Compiled, p: Array, *, is_written: bool = False) -> None:
        self.code, self._p = code, p
        self._position = code.written if is_written else code.position
        self.is_written = self._position is code.written
        self._sparse = BlockSolver(code) if code.blocks else None

    def evaluate(self, q: Array, t: float) -> Point:
        """Evaluate Phi and Phi_q at one point."""
        try:
            return Point(q, t, *self._position(q, t, self._p))
        except (ArithmeticError, ValueError):  # of math.sqrt, log, or 1/0; NaN or infinity in q
            m = len(self.code.equations)
            return Point(q, t, np.full(m, np.nan), np.full((m, q.size), np.nan))

    def solve(self, point: Point, b: Array) -> Array:
        """Return x of Phi_q x = b, b of shape (m,) or (m, k)."""
        try:
            return solve_linear(point.Phi_q, b)
        except np.linalg.LinAlgError:
            return np.full((point.q.size, *b.shape[1:]), np.nan)

    def missing(self, point: Point, x: Array, b: Array) -> Array:
        """Return Phi_q x - b."""
        return np.asarray(point.Phi_q @ x - b)

    def rates(self, point: Point, extra_rhs: Array | None) -> Rates:
        """Return the rates at a point; with `extra_rhs` also x of Phi_q x = extra_rhs."""
        nothing = np.full(point.q.size, np.nan)
        sides = np.empty((point.Phi.size, 2))
        sides[:, 1] = 0.0 if extra_rhs is None else extra_rhs  # a second right side costs nothing
        try:
            sides[:, 0] = self.code.nu(point.q, point.t, self._p)
        except (ArithmeticError, ValueError):
            sides[:, 0] = np.nan
        q_dot, movement = self._solve_by_rows(point, sides).T
        try:
            gamma = self.code.gamma(point.q, q_dot, point.t, self._p)
        except (ArithmeticError, ValueError):
            return Rates(q_dot, nothing, movement, sides[:, 0], nothing)
        return Rates(q_dot, self._solve_by_rows(point, gamma), movement, sides[:, 0], gamma)

    def _solve_by_rows(self, point: Point, b: Array) -> Array:
        """Return the same x, with all digits where equations have coefficients of other sizes.

        Corrections of Newton's method need not have them: the next one mends the last.
        """
        matrix = point.Phi_q
        if matrix.shape[0] != matrix.shape[1]:
            return self.solve(point, b)
        powers = powers_of_rows(matrix)
        return self.solve(replace(point, Phi_q=powers[:, np.newaxis] * matrix), (b.T * powers).T)

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
            floats = Floats(self.code, self._p)
            point.factors = floats.determinants(floats.evaluate(point.q, point.t), point)
        elif point.factors is None and self._sparse is not None:
            factors = self._sparse.factor(point.Phi_q[tuple(self.code.pattern.T)])
            point.factors = self._sparse.determinants(factors)
        return None if point.factors is None else np.asarray(point.factors)


def powers_of_rows(matrix: Array) -> Array:
    """Return powers of two, (..., m), by which rows of matrices (..., m, n) get entries of size 1.

    So no digits are lost where equations have coefficients of other sizes.
    """
    return np.asarray(np.ldexp(1.0, -np.frexp(np.abs(matrix).max(axis=-1, initial=0.0))[1]))


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


def unsolvable(point: Point) -> Status:
    """Say why Phi_q x = b has no solution at a point."""
    return Status.SINGULAR if np.isfinite(point.Phi_q).all() else Status.NOT_FINITE

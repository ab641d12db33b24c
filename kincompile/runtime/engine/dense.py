"""The dense matrix of one point, solved by LAPACK."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from kincompile.runtime.engine.blocks import BlockSolver
from kincompile.runtime.engine.linear import Linear, Rates
from kincompile.runtime.engine.planned import Planned
from kincompile.runtime.engine.scales import Point
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array, Compiled

LARGEST_CAREFUL = 1000
"""Coordinates up to which a large mechanism is left to dense matrices where the blocks fail: there
a step takes a fraction of a second."""

LARGEST_POWER = 700.0
"""Power of e beyond which no determinant is given: floating point ends at 709."""


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
            point.factors = self._planned(point)
        elif point.factors is None and self._sparse is not None:
            factors = self._sparse.factor(point.Phi_q[tuple(self.code.pattern.T)])
            point.factors = self._sparse.determinants(factors)
        return None if point.factors is None else np.asarray(point.factors)

    def _planned(self, point: Point) -> Array:
        """Return the determinants by the planned solve."""
        lanes, p = self.code.lanes, self._p.tolist()
        assert lanes is not None
        q, t = point.q, point.t
        try:
            values = lanes.position(lanes.floats, q.tolist(), t, p)
            found = lanes.factor(lanes.floats, values[len(self.code.equations) :])[1]
        except ArithmeticError:  # floats refuse 1/0, as of a singular block or of an angle of zeros
            batch = Planned(self.code, self._p)
            return batch.determinants(batch.evaluate(q[:, np.newaxis], t))[:, 0]
        return np.array(found, dtype=np.float64)


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

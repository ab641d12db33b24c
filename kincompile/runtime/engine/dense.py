"""The engine of single points: LAPACK with pivoting, and least squares for redundant equations."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import AGREEMENT
from kincompile.runtime.engine.engine import Point, Rates
from kincompile.runtime.engine.lanes import LaneCode
from kincompile.runtime.engine.linear import solve_linear
from kincompile.runtime.engine.stages import StagedSolver

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array, Code

LARGEST_POWER = 700.0
"""Power of e beyond which no determinant is given: floating point ends at 709."""


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
        try:
            found = LaneCode(self.code, lanes.floats, p).position(q.tolist(), t).determinants
        except ArithmeticError:  # floats refuse 1/0 in the factors of a singular block
            code = LaneCode(self.code, lanes.arrays, p)
            found = code.position(q[:, np.newaxis], t).determinants
        return np.array([float(np.ravel(value)[0]) for value in found])


def _agree(matrix: Array, rates: Array, sides: Array) -> bool:
    """Say whether redundant equations are all met by the rates that solve them best."""
    if matrix.shape[0] == matrix.shape[1]:
        return True
    terms = np.abs(matrix) @ np.abs(rates) + np.abs(sides)
    missing = np.abs(matrix @ rates - sides)
    return bool(np.max(missing) <= AGREEMENT * np.max(terms))

"""The last steps of a fit: to the end of least squares, and into its limits, one start at a time.

Motions are followed through all times at every step, so that the end is one motion on one branch.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import optimize

from kincompile.design.rows import EAGERNESS
from kincompile.design.trial import EXCESS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.design.trial import Trial, Workbench

    Array = NDArray[np.float64]

_SCIPY: Any = optimize
"""Its types leave out what it exports."""

CHANGE, EVALUATIONS = 1e-14, 200
"""Relative change at which least squares ends, and motions that it tries."""

MOST_STEPS = 200
"""Steps of the minimizer that keeps limits."""


@dataclass(frozen=True, slots=True)
class Norm:
    """What makes a trial better than another: the sum of squares, or the largest deviation."""

    is_largest: bool

    def of(self, trial: Trial) -> float:
        """Return its measure of deviations."""
        return trial.largest if self.is_largest else trial.error

    def rank(self, trial: Trial) -> tuple[bool, float]:
        """Return what is smaller of a better trial: limits first."""
        is_out = trial.excess > EXCESS
        return is_out, self.of(trial) + (EAGERNESS * trial.excess if is_out else 0.0)


def finished(bench: Workbench, trial: Trial, bounds: Array, minimizer: str, norm: Norm) -> Trial:
    """Follow a trial to the end, and into its limits."""
    end = _followed(bench, trial, bounds)
    if end.excess <= EXCESS and not norm.is_largest:
        return end
    return min(end, _Minimum(bench, end, bounds, norm).found(minimizer), key=norm.rank)


def _followed(bench: Workbench, first: Trial, bounds: Array) -> Trial:
    """Follow a trial to a minimum by least squares."""
    low, high = bounds.T
    run = _Run(bench, first, low, high - low)
    u = np.clip((first.x - low) / run.span, 0.0, 1.0)
    with np.errstate(all="ignore"):
        _SCIPY.least_squares(
            run.residuals, u, run.jacobian, (0.0, 1.0), max_nfev=EVALUATIONS,
            ftol=CHANGE, xtol=CHANGE, gtol=CHANGE, x_scale="jac",
        )  # fmt: skip
    return run.best


@dataclass(slots=True, eq=False)
class _Run:
    """What SciPy asks for, on variables of the unit interval; it stays on the first's branch."""

    bench: Workbench
    best: Trial
    low: Array
    span: Array
    last: Trial | None = None
    branch: Any = None

    def at(self, u: Array) -> Trial | None:
        """Return the trial at variables; None where it cannot move, or left the branch."""
        x = self.low + self.span * u
        if self.last is not None and np.array_equal(self.last.x, x):
            return self.last
        motion = self.best.motion
        if self.branch is None:
            self.branch = motion.branch[0]
        trial = self.bench.solved(x, motion.q[0], self.branch)
        if trial is not None:
            self.last = trial
            if trial.cost < self.best.cost:
                self.best = trial
        return trial

    def residuals(self, u: Array) -> Array:
        """Return deviations, and what limits are exceeded by; NaN where it cannot move."""
        trial = self.at(u)
        if trial is None:
            return np.full(self.best.residuals.size + self.best.gaps.size, np.nan)
        return np.concatenate((trial.residuals, EAGERNESS * np.minimum(trial.gaps, 0.0)))

    def jacobian(self, u: Array) -> Array:
        """Return the derivatives of `residuals`."""
        trial = self.at(u)
        assert trial is not None
        by_x, gaps_by_x = self.bench.derivatives(trial)
        gaps_by_x = EAGERNESS * gaps_by_x * (trial.gaps < 0)[:, np.newaxis]
        found: Array = np.concatenate((by_x, gaps_by_x)) * self.span
        return found


class _Minimum:
    """The least error within all limits, or the least of the largest deviation, from a trial.

    The latter is one more variable h, the largest in parts of the first one, with limits
    -h <= r <= h for every deviation.
    """

    def __init__(self, bench: Workbench, start: Trial, bounds: Array, norm: Norm) -> None:
        low, high = bounds.T
        self._bench, self._start, self._norm = bench, start, norm
        self._best, self._run = start, _Run(bench, start, low, high - low)
        # The error may be tiny: a minimizer that stops at absolute changes needs it near one.
        size = start.largest if norm.is_largest else start.error**0.5
        self._scale = 1 / max(size, float(np.finfo(float).tiny) ** 0.5)

    def found(self, minimizer: str) -> Trial:
        """Return what a minimizer of SciPy finds."""
        run, more = self._run, int(self._norm.is_largest)
        u = np.clip((self._start.x - run.low) / run.span, 0.0, 1.0)
        bounds = [(0.0, 1.0)] * u.size + [(0.0, 2.0)] * more
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # SciPy's, of steps clipped to the bounds
            warnings.simplefilter("ignore", RuntimeWarning)
            _SCIPY.minimize(
                self._error,
                np.append(u, np.ones(more)),
                jac=self._gradient,
                bounds=bounds,
                constraints=self._constraints(minimizer),
                method=minimizer,
                options={"maxiter": MOST_STEPS},
            )
        return self._best

    def _noted(self, u: Array) -> Trial | None:
        trial = self._run.at(u[: self._run.low.size])
        if trial is not None:
            self._best = min(self._best, trial, key=self._norm.rank)
        return trial

    def _error(self, u: Array) -> float:
        trial = self._noted(u)
        if trial is None:
            return 1e6
        return float(u[-1]) if self._norm.is_largest else self._scale * trial.error

    def _gradient(self, u: Array) -> Array:
        if self._norm.is_largest:
            return np.append(np.zeros(u.size - 1), 1.0)
        trial = self._noted(u)
        if trial is None:
            return np.zeros_like(u)
        by_x, _ = self._bench.derivatives(trial)
        found: Array = 2 * self._scale * (trial.residuals @ by_x) * self._run.span
        return found

    def _left(self, u: Array) -> Array:
        """Return what is left to all limits."""
        trial = self._noted(u)
        if not self._norm.is_largest:
            return np.full(self._start.gaps.size, -1.0) if trial is None else trial.gaps
        if trial is None:
            return np.full(self._start.gaps.size + 2 * self._start.residuals.size, -1.0)
        parts = self._scale * trial.residuals
        return np.concatenate((trial.gaps, u[-1] - parts, u[-1] + parts))

    def _left_by_u(self, u: Array) -> Array:
        trial = self._noted(u)
        if trial is None:
            return np.zeros((self._left(u).size, u.size))
        by_x, gaps_by_x = self._bench.derivatives(trial)
        slopes: Array = gaps_by_x * self._run.span
        if not self._norm.is_largest:
            return slopes
        by_u = self._scale * by_x * self._run.span
        one, zero = np.ones((len(by_u), 1)), np.zeros((len(slopes), 1))
        return np.block([[slopes, zero], [-by_u, one], [by_u, one]])

    def _constraints(self, minimizer: str) -> Any:
        """Return the limits as the minimizer takes them."""
        if minimizer == "SLSQP":
            return {"type": "ineq", "fun": self._left, "jac": self._left_by_u}
        return _SCIPY.NonlinearConstraint(self._left, 0.0, np.inf, jac=self._left_by_u)

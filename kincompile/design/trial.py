"""One trial of a fit: the motion at some variables, its deviations, and their derivatives.

The motion goes through all times of the targets without a break, so that no branch is left between
them. From one trial to the next the branch is that of the first, by the signs of determinants;
redundant equations have none, and Newton's method starts near the position before.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.compiler import compile as compile_model
from kincompile.criteria import MAX_ITERATIONS, TOLERANCE
from kincompile.design.demands import ORDERS, read_demands
from kincompile.design.rows import EAGERNESS, Motions
from kincompile.errors import KincompileWarning
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.follow import follow
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.results.sensitivities import sensitivities
from kincompile.runtime.solve import solution_of
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.design.demands import Demands
    from kincompile.design.targets import Target
    from kincompile.model.mechanism import Mechanism
    from kincompile.runtime.results.sensitivities import Sensitivities
    from kincompile.runtime.results.solution import Solution

    Array = NDArray[np.float64]

EXCESS = 1e-7
"""Part of a limit by which it may be exceeded."""


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A motion that was tried."""

    x: Array  # (nx,): the variables
    motion: Solution  # through all times that are asked for
    residuals: Array  # (R,): weighted deviations of the targets
    gaps: Array  # (G,): what is left to the limits, negative where they are exceeded

    @property
    def error(self) -> float:
        """The sum of squares of the weighted deviations."""
        return float(self.residuals @ self.residuals)

    @property
    def largest(self) -> float:
        """The largest weighted deviation."""
        return float(np.abs(self.residuals).max())

    @property
    def cost(self) -> float:
        """The error, with what limits are exceeded by."""
        over = np.minimum(self.gaps, 0.0)
        return self.error + EAGERNESS**2 * float(over @ over)

    @property
    def excess(self) -> float:
        """The most by which a limit is exceeded."""
        return float(np.max(-self.gaps, initial=0.0))


@dataclass(slots=True, eq=False)
class Workbench:
    """Evaluates trials of one mechanism."""

    # module, demands: the mechanism, and what is asked of it
    module: ModuleType
    demands: Demands
    names: tuple[str, ...]  # the parameters that are varied
    fixed: dict[str, float]  # values of the others
    # motions, gradients: how many of each were evaluated
    motions: int = 0
    gradients: int = 0

    @classmethod
    def of(
        cls, model: Mechanism, targets: Sequence[Target], names: tuple[str, ...],
        fixed: dict[str, float],
    ) -> Workbench:  # fmt: skip
        """Return what evaluates trials of a model, whose limits are outputs of it."""
        module = compile_model(model)
        return cls(module, read_demands(module, model.system(), targets), names, fixed)

    def solved(self, x: Array, guess: Array | None, branch: Any = None) -> Trial | None:
        """Return the trial of some variables (nx,); None where the mechanism does not get through.

        The guess (n,) is nearly its position at the first time. The determinants there must have
        the signs of the branch, if one is given.
        """
        p = self.fixed | dict(zip(self.names, x.tolist(), strict=False))
        instants = self.demands.instants(x[len(self.names) :])
        times = np.unique(np.concatenate([self.demands.grid, *instants, np.empty(0)]))
        self.motions += 1
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", KincompileWarning)
            inputs = read_inputs(self.module, times, p, guess, TOLERANCE, MAX_ITERATIONS)
            with np.errstate(all="ignore"):
                points, outcome = follow(inputs, explains=False)
            if outcome.status is not Status.CONVERGED:
                return None
            motion = solution_of(inputs, points, outcome)
        if branch is not None and not np.array_equal(motion.branch[0], branch):
            return None
        seen = self._seen(motion, instants)
        (residuals,), (gaps,) = seen.rows()[0], seen.gaps()[0]
        trial = Trial(x, motion, residuals, gaps)
        return trial if np.isfinite(residuals).all() and np.isfinite(gaps).all() else None

    def sets(self, x: Array) -> Array:
        """Return the values of all parameters (B, k) at variables (B, nx)."""
        p, place = code_of(self.module).defaults.copy(), self.module.PARAMETERS.index
        for name, value in self.fixed.items():
            p[place(name)] = value
        sets = np.repeat(p[np.newaxis], len(x), axis=0)
        sets[:, [place(name) for name in self.names]] = x[:, : len(self.names)]
        return sets

    def derivatives(self, trial: Trial) -> tuple[Array, Array]:
        """Return the derivatives of residuals (R, nx) and of gaps (G, nx)."""
        self.gradients += 1
        found = sensitivities(trial.motion, self.names, self.demands.columns)
        seen = self._seen(trial.motion, self.demands.instants(trial.x[len(self.names) :]), found)
        (by,), (gaps_by,) = (np.asarray(part[1]) for part in (seen.rows(), seen.gaps()))
        return by, gaps_by

    def _seen(
        self, motion: Solution, instants: list[Array], found: Sensitivities | None = None
    ) -> Motions:
        """Return the columns of a motion, as the targets ask for them."""

        def slope(name: str, order: int) -> Array:
            assert found is not None
            of = name + ORDERS[order]
            return np.array([found[of, parameter] for parameter in self.names]).T[np.newaxis]

        return Motions(
            self.demands, motion.t[np.newaxis], np.searchsorted(motion.t, self.demands.grid),
            [np.searchsorted(motion.t, at)[np.newaxis] for at in instants],
            lambda name, order: motion[name + ORDERS[order]][np.newaxis],
            None if found is None else slope,
        )  # fmt: skip

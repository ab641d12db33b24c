"""Dimensions with which a mechanism does what is asked of it: kinematic synthesis.

targets  -> Demands       columns and times; limits become outputs     demands
bounds   -> Search        many sets of parameters, all assemblies      search
starts   -> least squares each from where the search was best          SciPy, exact Jacobians
best     -> minimizer     with the limits as constraints               SLSQP or trust-constr
         -> Fit           the model again, and what it reaches         fitted
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy
from scipy import optimize

from kincompile.compiler import compile as compile_model
from kincompile.design.demands import limit_name, read_demands
from kincompile.design.deviation import MOST
from kincompile.design.fitted import Counts, Fit, fitted
from kincompile.design.search import Search
from kincompile.design.targets import Limit, Moves, Passing, Shaped, TimeRatio
from kincompile.design.trial import EAGERNESS, Trial, Workbench
from kincompile.design.variation import require_mechanism
from kincompile.errors import InputError, KincompileWarning, UnsupportedError
from kincompile.model import tasks
from kincompile.model.declared import require
from kincompile.model.mechanism import changed
from kincompile.model.outputs import Output
from kincompile.names import listed, suggestion
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.inputs import mapping_of
from kincompile.runtime.singular.assemblies import assemblies

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.design.targets import Target
    from kincompile.model.mechanism import Mechanism

    Array = NDArray[np.float64]

_SCIPY: Any = optimize
"""Its types leave out what it exports."""

BRIEFLY, TO_THE_END = (1e-6, 40), (1e-14, 200)
"""Relative change at which least squares ends, and motions that it tries from one start."""

FINALISTS = 4
"""Starts that are followed to the end, after all were followed briefly."""

MOST_STEPS = 200
"""Steps of the minimizer that keeps limits."""

EXCESS = 1e-7
"""Part of a limit by which it may be exceeded."""


def fit(
    model: Mechanism,
    targets: Target | Sequence[Target],
    parameters: Sequence[str] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    *,
    p: Mapping[str, float] | None = None,
    samples: int = tasks.Fit.samples,
    starts: int = tasks.Fit.starts,
    search: str = tasks.Fit.search,
    minimizer: str = tasks.Fit.minimizer,
    seed: int = tasks.Fit.seed,
) -> Fit:
    """Find dimensions with which a mechanism reaches targets, within limits.

    Parameters
    ----------
    model
        A mechanism; it is not changed.
    targets
        What it is to do, of `kc.targets`.
    parameters
        Names of the parameters that may change; without, those that have bounds.
    bounds
        By the name of a parameter its least and greatest value; where one has none, the range
        that `Mechanism.parameter` was given.
    p
        Values of the other parameters.
    samples
        Sets of parameters of which the global search looks for starts.
    starts
        How many of them are followed to the end, the best first.
    search : {"sobol", "differential evolution"}
        How the sets are chosen: evenly spread over the bounds, or bred over generations.
    minimizer : {"SLSQP", "trust-constr"}
        The solver of a fit with limits.
    seed
        Of the search: the result is the same on every run.

    Returns
    -------
    Fit
        ``.model`` is the mechanism with these dimensions, ``print(found)`` what it reaches.

    Raises
    ------
    InputError
        If a parameter is unknown, bounds are the wrong way round or missing, a target names an
        unknown column, or the mechanism cannot be assembled within the bounds. One message has
        all problems.
    """
    begun = time.perf_counter()
    model = require_mechanism(model, "kc.fit")
    wanted = _targets(targets)
    fixed = dict(mapping_of(p, "p"))
    names, limits = _read_bounds(model, parameters, bounds, fixed)
    require(
        tasks.Fit, samples=samples, starts=starts, search=search, minimizer=minimizer, seed=seed
    )
    extended = _with_limits(model, wanted)
    module = compile_model(extended)
    _require_plan(module)
    demands = read_demands(module, extended.system(), wanted)
    bench = Workbench(module, demands, names, fixed)
    guesses = _guesses(module, demands.first_time, p)
    finder = Search(module, demands, names, fixed, limits, guesses)
    (finder.spread if search == "sobol" else finder.breed)(samples, seed)
    chosen = finder.ranked(starts)
    every = np.concatenate((limits, np.reshape(demands.time_bounds(), (-1, 2))))
    begun_well = [bench.solved(np.clip(item.x, *every.T), item.q) for item in chosen]
    ends = [_followed(bench, first, every, *BRIEFLY) for first in begun_well if first is not None]
    if not ends:
        raise InputError(_nowhere(model, finder))
    ends.sort(key=_cost)
    ends[:FINALISTS] = [_finished(bench, end, every, minimizer) for end in ends[:FINALISTS]]
    best = min(ends, key=_rank)
    counts = Counts(
        finder.tried, len(chosen), bench.motions, bench.gradients, time.perf_counter() - begun
    )
    return fitted(model, demands, best, names, counts, ends, EXCESS)


def _rank(trial: Trial) -> tuple[bool, float]:
    """Return what is smaller of a better trial: limits first, then the error."""
    is_out = trial.excess > EXCESS
    return is_out, trial.error + (EAGERNESS * trial.excess if is_out else 0.0)


def _targets(given: Any) -> list[Target]:
    """Return the targets as a list; refuse anything else."""
    kinds = (Passing, Shaped, TimeRatio, Limit, Moves)
    found = [given] if isinstance(given, kinds) or not isinstance(given, Iterable) else list(given)
    problems = [
        f"{item!r} is not a target: make one with kc.targets.path, value, pose, time_ratio or limit"
        for item in found
        if not isinstance(item, kinds)
    ]
    if not any(isinstance(item, Passing | Shaped | TimeRatio) for item in found) and not problems:
        problems.append("there is nothing to reach: give a path, values, poses or a time ratio")
    if problems:
        raise InputError(problems)
    return found


def _read_bounds(
    model: Mechanism, parameters: Any, bounds: Any, fixed: Mapping[str, float]
) -> tuple[tuple[str, ...], Array]:
    """Return the parameters that may change, and their bounds, shape (k, 2)."""
    given = dict(bounds or {})
    names = (
        tuple(given)
        if parameters is None
        else tuple((parameters,) if isinstance(parameters, str) else parameters)
    )
    known = {item.name: item for item in model.system().parameters}
    problems, rows = [], []
    for name in dict.fromkeys((*names, *given, *fixed)):
        if name not in known:
            near = suggestion(str(name), known) or "."
            problems.append(
                f"{model.name} has no parameter {name!r}{near} The parameters are {listed(known)}."
            )
    for name in names:
        if name not in known:
            continue
        limits = given.get(name, known[name].range)
        rows.append(_checked_bounds(name, limits, problems))
        if name in fixed:
            problems.append(
                f"{name!r} is both a design variable and fixed in p; remove one of the two"
            )
    if not names:
        problems.append(f"{model.name} has no design variables; give bounds={{'a': (0.1, 2)}}")
    if len(set(names)) < len(names):
        problems.append(f"parameters names one twice: {listed(names)}")
    if extra := [name for name in given if name in known and name not in names]:
        problems.append(f"there are bounds of {listed(extra)}, which may not change")
    if problems:
        raise InputError(problems)
    return names, np.array(rows)


def _checked_bounds(name: str, limits: Any, problems: list[str]) -> tuple[float, float]:
    """Return the bounds of a parameter, and note what is wrong with them."""
    if limits is None:
        problems.append(
            f"{name!r} has no bounds: give (least, greatest), as {{{name!r}: (0.1, 2)}}"
        )
        return 0.0, 1.0
    try:
        low, high = (float(item) for item in limits)
    except (TypeError, ValueError):
        problems.append(f"the bounds of {name!r} are {limits!r}: give (least, greatest)")
        return 0.0, 1.0
    if not (math.isfinite(low) and math.isfinite(high)):
        problems.append(f"the bounds of {name!r} are {low:g} and {high:g}: give finite numbers")
    elif max(-low, high) > MOST or 0 < low < 1 / MOST:
        problems.append(
            f"the bounds of {name!r} are {low:g} and {high:g}: give sizes from {1 / MOST:g} to "
            f"{MOST:g}"
        )
    elif not low < high:
        problems.append(
            f"the bounds of {name!r} go from {low:g} to {high:g}: give the least value first"
        )
    return low, high


def _with_limits(model: Mechanism, targets: Sequence[Target]) -> Mechanism:
    """Return a mechanism whose outputs are also the expressions that have limits.

    So they are evaluated and differentiated as everything else is.
    """
    limits = [item for item in targets if isinstance(item, Limit)]
    more = [
        Output(limit_name(number), item.what)
        for number, item in enumerate(limits)
        if isinstance(item.what, sympy.Expr)
    ]
    return changed(model, outputs=[*model.outputs, *more])


def _require_plan(module: ModuleType) -> None:
    """Check that many sets of parameters can be solved together."""
    if code_of(module).lanes is None:
        raise UnsupportedError(
            f"{module.NAME} is large: kc.fit takes mechanisms that are compiled in the inline form."
        )


def _guesses(module: ModuleType, t: float, p: Mapping[str, float] | None) -> Array:
    """Return positions from which sets are assembled: the model's assemblies, and its guess."""
    guess = np.array(module.GUESS, dtype=np.float64)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", KincompileWarning)
        found = assemblies(module, t, dict(p or {}))
    return found if len(found) else guess[np.newaxis]


def _followed(
    bench: Workbench, first: Trial, bounds: Array, change: float, evaluations: int
) -> Trial:
    """Follow a trial towards a minimum by least squares, up to a relative change of the error."""
    low, high = bounds.T
    span = high - low
    run = _Run(bench, first, low, span)
    u = np.clip((first.x - low) / span, 0.0, 1.0)
    with np.errstate(all="ignore"):
        _SCIPY.least_squares(
            run.residuals, u, run.jacobian, (0.0, 1.0), max_nfev=evaluations,
            ftol=change, xtol=change, gtol=change, x_scale="jac",
        )  # fmt: skip
    return run.best


def _finished(bench: Workbench, trial: Trial, bounds: Array, minimizer: str) -> Trial:
    """Follow a trial to the end, and into its limits."""
    end = _followed(bench, trial, bounds, *TO_THE_END)
    if end.excess == 0.0:
        return end
    return min(end, _within_limits(bench, end, bounds, minimizer), key=_rank)


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
            if _cost(trial) < _cost(self.best):
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


def _cost(trial: Trial) -> float:
    """Return the error, with what limits are exceeded by."""
    over = np.minimum(trial.gaps, 0.0)
    return trial.error + EAGERNESS**2 * float(over @ over)


def _within_limits(bench: Workbench, start: Trial, bounds: Array, minimizer: str) -> Trial:
    """Return the least error within all limits that a minimizer finds from a trial."""
    low, high = bounds.T
    run = _Run(bench, start, low, high - low)
    best = start

    def noted(u: Array) -> Trial | None:
        nonlocal best
        trial = run.at(u)
        if trial is not None:
            best = min(best, trial, key=_rank)
        return trial

    # The error may be tiny: a minimizer that stops at absolute changes needs it near one.
    scale = 1 / max(start.error, np.finfo(float).tiny) ** 0.5

    def error(u: Array) -> float:
        trial = noted(u)
        return 1e6 if trial is None else scale * trial.error

    def gradient(u: Array) -> Array:
        trial = noted(u)
        if trial is None:
            return np.zeros_like(u)
        by_x, _ = bench.derivatives(trial)
        found: Array = 2 * scale * (trial.residuals @ by_x) * run.span
        return found

    def gaps(u: Array) -> Array:
        trial = noted(u)
        return np.full(start.gaps.size, -1.0) if trial is None else trial.gaps

    def gaps_by_u(u: Array) -> Array:
        trial = noted(u)
        if trial is None:
            return np.zeros((start.gaps.size, u.size))
        found: Array = bench.derivatives(trial)[1] * run.span
        return found

    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # SciPy's, of steps clipped to the bounds
        warnings.simplefilter("ignore", RuntimeWarning)
        _SCIPY.minimize(
            error,
            np.clip((start.x - low) / run.span, 0.0, 1.0),
            jac=gradient,
            bounds=[(0.0, 1.0)] * len(low),
            constraints=_constraints(gaps, gaps_by_u, minimizer),
            method=minimizer,
            options={"maxiter": MOST_STEPS},
        )
    return best


def _constraints(gaps: Any, gaps_by_u: Any, minimizer: str) -> Any:
    """Return the limits as the minimizer takes them."""
    if minimizer == "SLSQP":
        return {"type": "ineq", "fun": gaps, "jac": gaps_by_u}
    return _SCIPY.NonlinearConstraint(gaps, 0.0, np.inf, jac=gaps_by_u)


def _nowhere(model: Mechanism, finder: Search) -> str:
    """Say that no set of parameters gets through the times, and how far they got."""
    if finder.moved and (ratios := finder.demands.ratios):
        return (
            f"{model.name} moves through the times, but there is no "
            f"{listed(item.title for item, _ in ratios)}: a time ratio needs a column that rises "
            "and falls once within the times of the model."
        )
    how_far = (
        "none could be assembled at the first time"
        if not math.isfinite(finder.farthest)
        else f"the farthest came to t = {finder.farthest:.6g}"
    )
    redundant = code_of(finder.module).redundant
    hint = (
        f" Equations that repeat others, {listed(redundant)}, have to agree at all values: make "
        "one parameter of all dimensions that have to change together."
        if redundant
        else ""
    )
    return (
        f"{model.name} does not move through the times of the targets with any of "
        f"{finder.tried} sets of parameters within the bounds: {how_far}. Give other bounds, more "
        f"samples, or a guess nearer to an assembly.{hint}"
    )

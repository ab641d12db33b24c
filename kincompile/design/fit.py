"""Dimensions with which a mechanism does what is asked of it: kinematic synthesis.

targets  -> Demands       columns and times; limits become outputs     demands
bounds   -> Exploration   starts, and what they come to side by side   explore
ends     -> Trial         those whose motions are whole                judge
best     -> minimizer     with the limits as constraints               SLSQP or trust-constr
         -> Fit           the model again, and what it reaches         fitted
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Iterable
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.design.demands import limit_name
from kincompile.design.deviation import MOST
from kincompile.design.explore import Budget, Plan, explore
from kincompile.design.finish import Norm, finished
from kincompile.design.fitted import Counts, Fit, fitted
from kincompile.design.judge import distinct, judge
from kincompile.design.targets import Grashof, Limit, Moves, Passing, Shaped, TimeRatio
from kincompile.design.trial import EXCESS, Workbench
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
    from collections.abc import Callable, Mapping, Sequence
    from concurrent.futures import Executor
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.design.demands import Demands
    from kincompile.design.explore import Explored
    from kincompile.design.targets import Target
    from kincompile.model.mechanism import Mechanism

    Array = NDArray[np.float64]

FINALISTS = 3
"""Designs that are followed to the end one by one."""


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
    norm: str = tasks.Fit.norm,
    seconds: int | None = tasks.Fit.seconds,
    evaluations: int | None = tasks.Fit.evaluations,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
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
        How many of them are followed to the end: those that come nearest in the first steps.
    search : {"sobol", "differential evolution"}
        How the sets are chosen: evenly spread over the bounds, or bred over generations.
    minimizer : {"SLSQP", "trust-constr"}
        The solver of a fit with limits.
    seed
        Of the search: the result is the same on every run.
    norm : {"squares", "maximum"}
        What is least in the end: the sum of squares, or the largest weighted deviation.
    seconds, evaluations
        Budget of the search: time [s], and motions that are followed side by side. What was found
        until then is finished.
    executor : concurrent.futures.Executor, optional
        Where parts of 4,096 sets are searched; without, here, one after the other.
    progress : callable, optional
        Called as ``progress(done, total)`` with steps of the search.

    Returns
    -------
    Fit
        ``.model`` is the mechanism with these dimensions, ``print(found)`` what it reaches;
        ``.others`` are the next best designs that are unlike it.

    Raises
    ------
    InputError
        If a parameter is unknown, bounds are the wrong way round or missing, a target names an
        unknown column, or the mechanism cannot be assembled within the bounds. One message has
        all problems.
    """
    begun = time.perf_counter()
    model = require_mechanism(model, "kc.fit")
    wanted = _targets(targets, model)
    fixed = dict(mapping_of(p, "p"))
    names, limits = _read_bounds(model, parameters, bounds, fixed)
    budget = {"seconds": seconds, "evaluations": evaluations}
    require(
        tasks.Fit, samples=samples, starts=starts, search=search, minimizer=minimizer, seed=seed,
        norm=norm, **{name: most for name, most in budget.items() if most is not None},
    )  # fmt: skip
    extended = _with_limits(model, wanted)
    bench = Workbench.of(extended, wanted, names, fixed)
    module, demands = bench.module, bench.demands
    _require_plan(module)
    every = np.concatenate((limits, np.reshape(demands.time_bounds(), (-1, 2))))
    plan = Plan(
        extended, wanted, names, limits, fixed, _guesses(module, demands.first_time, p), samples,
        starts, search, seed, Budget(seconds, evaluations),
    )  # fmt: skip
    explored = explore(plan, bench, executor, progress)
    if not explored.starts.error.size:
        raise InputError(_nowhere(module, demands, explored))
    judged = judge(bench, explored, every)
    if not judged.ends:
        raise InputError(_nowhere(module, demands, explored))
    measure = Norm(norm == "maximum")
    ends = [finished(bench, end, every, minimizer, measure) for end in judged.ends[:FINALISTS]]
    ends = sorted([*ends, *judged.ends[FINALISTS:]], key=measure.rank)
    counts = Counts(
        explored.sampled, explored.followed, explored.motions + bench.motions, bench.gradients,
        time.perf_counter() - begun, explored.is_cut,
    )  # fmt: skip
    designs = distinct(ends, every, len(names))
    found = [fitted(model, demands, end, names, counts, EXCESS) for end in designs]
    drawn = explored.drawn
    moved = None if drawn is None else dict(zip(names, drawn.tolist(), strict=False))
    return replace(found[0], others=tuple(found[1:]), dropped=judged.dropped, drawn=moved)


def _targets(given: Any, model: Mechanism) -> list[Target]:
    """Return the targets as a list, with types of four-bars as limits; refuse anything else."""
    kinds = (Passing, Shaped, TimeRatio, Limit, Moves, Grashof)
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
    system = model.system()
    parts = [item.limits(system) if isinstance(item, Grashof) else [item] for item in found]
    return list(chain.from_iterable(parts))


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


def _nowhere(module: ModuleType, demands: Demands, found: Explored) -> str:
    """Say that no set of parameters gets through the times, and how far they got."""
    if found.moved and (ratios := demands.ratios):
        return (
            f"{module.NAME} moves through the times, but there is no "
            f"{listed(item.title for item, _ in ratios)}: a time ratio needs a column that rises "
            "and falls once within the times of the model."
        )
    how_far = (
        "none could be assembled at the first time"
        if not math.isfinite(found.farthest)
        else f"the farthest came to t = {found.farthest:.6g}"
    )
    redundant = code_of(module).redundant
    hint = (
        f" Equations that repeat others, {listed(redundant)}, have to agree at all values: make "
        "one parameter of all dimensions that have to change together."
        if redundant
        else ""
    )
    return (
        f"{module.NAME} does not move through the times of the targets with any of "
        f"{found.sampled} sets of parameters within the bounds: {how_far}. Give other bounds, more "
        f"samples, or a guess nearer to an assembly.{hint}"
    )

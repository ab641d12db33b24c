"""The global stage of a fit: starts over all bounds, each followed to where least squares ends.

The sets are taken in parts, which are independent: an executor may have them, and what is found is
the same wherever they are.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.design.descent import ITERATIONS, Descent
from kincompile.design.designs import Designs
from kincompile.design.search import Search
from kincompile.design.together import Together
from kincompile.design.trial import Workbench
from kincompile.design.variables import Variables

if TYPE_CHECKING:
    from collections.abc import Callable
    from concurrent.futures import Executor

    from numpy.typing import NDArray

    from kincompile.design.targets import Target
    from kincompile.model.mechanism import Mechanism

    Array = NDArray[np.float64]
    Progress = Callable[[int, int], None]

PART = 4096
"""Sets of parameters of a part."""

LED = 32
"""Of that many sets one is led to its targets without being assembled before."""


@dataclass(frozen=True, slots=True)
class Budget:
    """What a search may take: seconds, and motions."""

    seconds: float | None = None
    evaluations: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A search, as it is sent to workers."""

    model: Mechanism  # with its limits as outputs
    targets: list[Target]
    names: tuple[str, ...]
    bounds: Array  # (k, 2)
    fixed: dict[str, float]
    guesses: Array  # (g, n): positions from which the mechanism is assembled
    samples: int
    starts: int
    search: str
    seed: int
    budget: Budget

    @property
    def parts(self) -> int:
        """How many parts there are."""
        return -(-self.samples // PART) if self.search == "sobol" else 1


@dataclass(frozen=True, slots=True, eq=False)
class Explored:
    """What was found: starts, and where they came to, the best first."""

    starts: Designs
    ends: Designs
    sampled: int  # sets of parameters that were tried
    moved: int  # how many times one got through all times
    farthest: float  # the latest time that a set has reached
    followed: int  # starts that were followed
    motions: int  # that were evaluated side by side
    is_cut: bool  # whether the budget was spent before the end
    # What the model's own values were moved to, (k,), where they do not get through all times;
    # empty if nothing was found near them.
    drawn: Array | None


def explore(
    plan: Plan, bench: Workbench, executor: Executor | None, progress: Progress | None
) -> Explored:
    """Search all parts, with an executor or here."""
    begun, total = time.perf_counter(), plan.parts * ITERATIONS
    found: list[Explored] = []
    if executor is not None:
        for one in executor.map(_part, [plan] * plan.parts, range(plan.parts)):
            found.append(one)
            if progress:
                progress(len(found) * ITERATIONS, total)
        return _together(found)
    for number in range(plan.parts):
        steps = None
        if progress:
            first, tell = number * ITERATIONS, progress

            def steps(step: int, first: int = first, tell: Progress = tell) -> None:
                tell(first + step, total)

        found.append(_part(plan, number, bench, begun, steps))
        if found[-1].is_cut:
            break
    return _together(found)


def _part(
    plan: Plan,
    number: int,
    bench: Workbench | None = None,
    begun: float | None = None,
    steps: Callable[[int], None] | None = None,
) -> Explored:
    """Search one part; a worker makes its own workbench."""
    bench = bench or Workbench.of(plan.model, plan.targets, plan.names, plan.fixed)
    begun = time.perf_counter() if begun is None else begun
    variables = Variables(plan.bounds)
    search = Search(bench, variables, plan.guesses)
    count = min(PART, plan.samples - number * PART) if plan.search == "sobol" else plan.samples
    (search.spread if plan.search == "sobol" else search.breed)(count, (plan.seed, number))
    every = np.concatenate((plan.bounds, np.reshape(bench.demands.time_bounds(), (-1, 2))))
    descent, budget, is_cut = Descent(bench, Variables(every)), plan.budget, False

    def is_late() -> bool:
        return budget.seconds is not None and time.perf_counter() - begun > budget.seconds

    drawn = _led(search, descent, 0 if is_late() else count // LED, (plan.seed, number))
    starts = search.found

    def is_over(step: int) -> bool:
        nonlocal is_cut
        if steps:
            steps(step)
        most = None if budget.evaluations is None else budget.evaluations / plan.parts
        is_cut = is_late() or (most is not None and descent.motions >= most)
        return is_cut

    ends = Designs.none()
    if starts.error.size:
        ends = descent.run(starts.x, starts.q, plan.starts, is_over)
    followed = min(plan.starts, starts.error.size)
    return Explored(
        starts, ends, search.tried, search.moved, search.farthest, followed, descent.motions,
        is_cut, drawn,
    )  # fmt: skip


def _led(search: Search, descent: Descent, count: int, seed: tuple[int, int]) -> Array | None:
    """Try also what the first sets are led to; return what the model's own values are moved to.

    None if those get through the times, empty if nothing near them does. Where nothing was found
    at all, more sets are led.
    """
    own = search.drawing()
    is_stuck = own is not None and np.isinf(search.first)
    if not (count or is_stuck or search.is_empty):
        return None
    together, guesses, drawn = Together(descent), search.guesses, None

    def tried(sets: Array) -> tuple[Array, Array]:
        found, q = together.led(sets, guesses)
        return found, search.scores(search.variables.to_u(found), q)

    if count:
        tried(search.sets(count, seed))
    if own is not None and is_stuck:
        near, errors = tried(np.repeat([own], len(guesses), axis=0))
        drawn = near[errors.argmin()] if np.isfinite(errors).any() else own[:0]
    if search.is_empty:
        tried(search.sets(max(LED, 2 * count), seed))
    return drawn


def _together(parts: list[Explored]) -> Explored:
    """Return what several parts have found, the best first."""
    return Explored(
        Designs.best([x.starts for x in parts]),
        Designs.best([x.ends for x in parts]),
        sum(x.sampled for x in parts),
        sum(x.moved for x in parts),
        max(x.farthest for x in parts),
        sum(x.followed for x in parts),
        sum(x.motions for x in parts),
        any(x.is_cut for x in parts),
        parts[0].drawn,
    )

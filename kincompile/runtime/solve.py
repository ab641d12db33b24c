"""The motion over a time grid: position, velocity and acceleration at every point.

inputs    checked, in the solver's form          inputs.read_inputs
  -> of a compiled module, its own march           native.make_native
  -> assemble the first point from the guess     march.start      (newton.assemble)
  -> solve all points together                   grid.solve_grid  (coarse.coarse_march)
  -> follow what cannot be trusted point by point  march.advance  (newton.iterate)
  -> find what ends the motion, or go through it   events.locate
  -> say how it went                             verdict.verdict
"""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from kincompile.errors import (
    BranchSwitchWarning,
    InputError,
    SingularConfigurationWarning,
    SolveError,
)
from kincompile.runtime.events import branch_switch, locate, singular_start
from kincompile.runtime.grid import CORRECTIONS_ON_GRID, GridResult, solve_grid
from kincompile.runtime.inputs import Inputs, read_inputs
from kincompile.runtime.lanes import has_planned_solve
from kincompile.runtime.large import LargeMarch, LargeState
from kincompile.runtime.march import (
    SMALL_ERROR,
    TOO_NEAR,
    Outcome,
    State,
    advance,
    complete,
    leaves_branch,
    start,
)
from kincompile.runtime.motion import Motion
from kincompile.runtime.newton import RESIDUAL_FACTOR
from kincompile.runtime.problem import Point, problem
from kincompile.runtime.solution import Solution
from kincompile.runtime.staged import is_staged
from kincompile.runtime.status import Status
from kincompile.runtime.variants import read_variants, solve_in_turn, solve_variants
from kincompile.runtime.verdict import verdict

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import ModuleType

    from numpy.typing import ArrayLike, NDArray

    from kincompile.runtime.events import Passage
    from kincompile.runtime.inputs import Values
    from kincompile.runtime.problem import Problem

    Progress: TypeAlias = Callable[[int, int], object]


LARGEST_CAREFUL = 1000
"""Coordinates up to which a large mechanism is left to the careful march where its own fails: there
a step takes a fraction of a second."""

SMALLEST_GRID = 32
"""Points from which on a grid is faster than a march."""


def solve(
    module: ModuleType,
    t: ArrayLike,
    p: Values = None,
    guess: Values = None,
    *,
    tolerance: float = 1e-10,
    max_iterations: int = 25,
    method: str | None = None,
    through: str | None = None,
    throw: bool = False,
    progress: Progress | None = None,
) -> Solution:
    """Solve position, velocity and acceleration of a mechanism over time.

    Parameters
    ----------
    module
        An emitted module, from ``kc.compile`` or ``kc.load``, with as many equations as
        coordinates.
    t : float or array_like, shape (N,)
        Times, rising or falling. One time gives a solution with N = 1.
    p : array_like, shape (k,), or mapping, or None
        Parameters; a mapping from names to values overrides the module's DEFAULTS. An array of
        shape (B, 1, k) holds B variants: all are solved, and the solution's arrays get a leading
        axis of length B.
    guess : array_like, shape (n,), or mapping, or None
        Where Newton starts at the first time; a mapping overrides the module's GUESS.
    tolerance : float
        Norm of Newton's correction, relative to 1 + ||q||, at which to stop.
    max_iterations : int
        Cap on Newton's iterations in one attempt.
    method : {"grid", "march"}, optional
        ``"march"`` goes from point to point; ``"grid"`` solves all points together and leaves to
        the march what it cannot trust. Both give the same; without a choice the faster is taken,
        which is the compiled march of a module that has one.
    through : {"smooth"}, optional
        Go on past a bifurcation, along the branch on which velocity and acceleration are
        continuous; a `BranchSwitchWarning` says when. Without it the motion ends there.
    throw : bool
        Raise `SolveError` unless every point converged.
    progress : callable, optional
        Called as ``progress(done, total)`` after each point.

    Returns
    -------
    Solution
        With a status per point. After a point that failed the others are not tried; `.events` says
        what ended the motion where it is a lock-up, a bifurcation or a jump.

    Raises
    ------
    InputError
        When a value has the wrong name, shape, type or is not finite; all that is wrong at once.
    StructuralError
        When the module has not as many equations as coordinates.
    SolveError
        With `throw`, when a point failed; `.solution` holds what was found.

    Warns
    -----
    BranchSwitchWarning
        When the motion went through a bifurcation, with the time.
    SingularConfigurationWarning
        When it converged at points so near to a singular configuration that their rates have lost
        digits, with the time. A motion that ends at one has a status and an event instead.
    """
    sets = read_variants(module, p)
    inputs = read_inputs(module, t, p if sets is None else None, guess, tolerance, max_iterations)
    on_grid = _takes_grid(module, inputs.t.size, method)
    if through not in (None, "smooth"):
        raise InputError(f"through is {through!r}: give 'smooth', or nothing.")

    def solve_one(inputs: Inputs, progress: Progress | None = None) -> Solution:
        return _solve_one(inputs, on_grid, method is None, through == "smooth", progress)

    if sets is None:
        solution = solve_one(inputs, progress)
    elif has_planned_solve(module):
        solution = solve_variants(inputs, sets, progress)
    else:
        solution = solve_in_turn(inputs, sets, solve_one, progress)
    if throw and not solution.success:
        raise SolveError(solution.message, solution)
    return solution


def _solve_one(
    inputs: Inputs, on_grid: bool, may_be_compiled: bool, smooth: bool, progress: Progress | None
) -> Solution:
    """Solve with one set of parameters."""
    motion = Motion.over(inputs)
    with np.errstate(all="ignore"):  # what is not finite gets a status, not a warning
        if is_staged(inputs.module):
            outcome = _follow_large(inputs, motion, may_be_compiled, smooth, progress)
        elif may_be_compiled and _march_compiled(inputs, motion):
            outcome = Outcome(Status.CONVERGED, 0, None)
        else:
            outcome = _follow(inputs, motion, on_grid, smooth, progress)
    for event in motion.passed:
        text = f"{inputs.module.NAME} goes through a bifurcation at t = {event.t:.10g}, and on"
        warnings.warn(f"{text} along the smooth branch.", BranchSwitchWarning, stacklevel=3)
    if motion.near and outcome.status is Status.CONVERGED:
        warnings.warn(_nearly(inputs, motion.near), SingularConfigurationWarning, stacklevel=3)
    return _solution(inputs, motion, outcome)


def _nearly(inputs: Inputs, near: list[int]) -> str:
    """Say that points of a motion, given by their numbers, are nearly singular."""
    more = f" and {len(near) - 1} more times" if len(near) > 1 else ""
    return (
        f"{inputs.module.NAME} is nearly singular at t = {inputs.t[near[0]]:.10g}{more}: its rates "
        "have few good digits there (see .condition). Drive another coordinate near this time, or "
        "change a length slightly."
    )


def _takes_grid(module: ModuleType, points: int, method: str | None) -> bool:
    """Say whether the points of a grid are solved together."""
    if method not in (None, "grid", "march"):
        raise InputError(f"method is {method!r}: give 'grid', 'march', or nothing.")
    if method == "grid" and not has_planned_solve(module):
        raise InputError(
            f"{module.NAME} goes from point to point, as all redundant mechanisms and those in the "
            "grouped form do: use method='march', or compile it with form='inline'."
        )
    return method == "grid" or (
        method is None and points >= SMALLEST_GRID and has_planned_solve(module)
    )


def _march_compiled(inputs: Inputs, motion: Motion) -> bool:
    """Let a compiled module follow the motion; say whether all went well.

    Where anything did not, the careful march finds out what it is, from the first time on.
    """
    march = getattr(inputs.module, "march", None)
    if march is None:
        return False
    states = motion.q.T, motion.q_dot.T, motion.q_ddot.T
    status, iterations = np.empty((2, inputs.t.size), dtype=np.intc)
    if march(inputs, states, motion.residual, status, iterations) < inputs.t.size:
        return False
    # A large step of Newton's from the guess may have ended on another branch.
    time = float(inputs.t[0])
    equations = problem(inputs.module, inputs.p, inputs.guess, time)
    guess, found = (equations.at(q, time) for q in (inputs.guess, motion.q[0].copy()))
    if guess is None or found is None or leaves_branch(equations, time, guess, found):
        return False
    motion.status[:], motion.iterations[:] = status, iterations
    motion.statistics["compiled"] = inputs.t.size
    return True


def _follow(
    inputs: Inputs, motion: Motion, on_grid: bool, smooth: bool, progress: Progress | None
) -> Outcome:
    """Go through the grid up to its end, or to the first point that fails."""
    t = float(inputs.t[0])
    at_guess = problem(inputs.module, inputs.p, inputs.guess, t)
    outcome = start(at_guess, t, inputs)
    motion.put(0, outcome)
    if progress:
        progress(1, inputs.t.size)
    motion.note = _other_branch(at_guess, inputs, outcome.position)
    # The guess may be rough: from here on the assembled mechanism gives the size.
    assembled = inputs.guess if outcome.position is None else outcome.position.q
    equations = problem(inputs.module, inputs.p, assembled, t)
    return _go_on(equations, inputs, motion, 1, outcome, on_grid, smooth, progress)


def _other_branch(equations: Problem, inputs: Inputs, position: Point | None) -> str:
    """Say so where the first position lies on another branch than the guess."""
    time = float(inputs.t[0])
    guess = equations.at(inputs.guess, time)
    if guess is None or position is None or not leaves_branch(equations, time, guess, position):
        return ""
    return (
        f" The position at t = {time:.10g} is on another branch than the guess: kc.assemblies "
        "gives all of them, and each serves as a guess."
    )


def _go_on(
    equations: Problem,
    inputs: Inputs,
    motion: Motion,
    index: int,
    outcome: Outcome,
    on_grid: bool,
    smooth: bool,
    progress: Progress | None,
) -> Outcome:
    """Go from the point before an index to the end, or to the first point that fails."""
    index, outcome = _run(equations, inputs, motion, index, outcome, on_grid, progress)
    while outcome.status is not Status.CONVERGED:
        passage = _explain(equations, inputs, motion, index - 1, outcome)
        if passage is None or not smooth:
            break
        motion.passed.append(motion.events[-1])
        index, outcome = _pass(equations, inputs, motion, index - 1, passage)
        index, outcome = _run(equations, inputs, motion, index, outcome, on_grid, progress)
    motion.forget(index)
    return outcome


def _run(
    equations: Problem,
    inputs: Inputs,
    motion: Motion,
    index: int,
    outcome: Outcome,
    on_grid: bool,
    progress: Progress | None,
) -> tuple[int, Outcome]:
    """Follow a motion from the point before an index as far as it goes; return the next index."""
    times = inputs.t
    trusted = np.zeros(len(times), dtype=bool)
    if on_grid and outcome.state is not None and outcome.state.t == times[index - 1]:
        trusted[index - 1 :] = _grid(equations, inputs, motion, outcome.state, index - 1)
    while index < len(times) and outcome.status is Status.CONVERGED:
        state = outcome.state
        if state is None:
            break
        stop = _end_of_run(trusted, index)
        if stop > index and _continues(equations, motion, state, index):
            motion.status[index:stop] = Status.CONVERGED
            outcome = _taken_up(equations, motion, float(times[stop - 1]), stop - 1)
            index = stop
        else:
            outcome = advance(equations, state, float(times[index]), inputs)
            motion.put(index, outcome)
            motion.statistics["marched"] += 1
            index += 1
            # Rates near a singularity are too uncertain to predict from: the point before serves.
            if outcome.state and outcome.state.sensitivity > max(TOO_NEAR, state.sensitivity):
                outcome = replace(outcome, state=state)
        if progress:
            progress(index, len(times))
    return index, outcome


def _explain(
    equations: Problem, inputs: Inputs, motion: Motion, index: int, outcome: Outcome
) -> Passage | None:
    """Find the event that ends the motion at a point; return the way through it if there is one."""
    t, state = float(inputs.t[index]), outcome.state
    if state is None:
        if outcome.status is Status.SINGULAR and outcome.position is not None:
            motion.events += filter(None, [singular_start(equations, outcome.position, t)])
        return None
    duration = abs(t - float(inputs.t[0]))
    found = locate(equations, state, t, duration)
    if found is not None:
        motion.events.append(found[0])
        return found[1]
    if outcome.attempt is not None and outcome.attempt.status is Status.CONVERGED:
        q = outcome.attempt.last.q
        motion.events.append(branch_switch(inputs.module, state, t, q, equations.spread(q)))
    return None


def _pass(
    equations: Problem, inputs: Inputs, motion: Motion, index: int, passage: Passage
) -> tuple[int, Outcome]:
    """Fill the points within the passage through a bifurcation, and take the next one."""
    times, after = inputs.t.tolist(), passage.after
    forward = math.copysign(1.0, after.t - passage.before.t)
    while index < len(times) and (times[index] - after.t) * forward <= 0:
        q, q_dot, q_ddot = passage.at(times[index])
        point = equations.at(q, times[index])
        if point is None or not equations.holds(point, RESIDUAL_FACTOR * inputs.tolerance):
            return index + 1, Outcome(Status.SINGULAR, 0, passage.before, None)
        motion.put(
            index,
            Outcome(Status.CONVERGED, 0, State(times[index], point, q_dot, q_ddot, ()), point),
        )
        index += 1
    if index == len(times):
        return index, Outcome(Status.CONVERGED, 0, after, after.point)
    outcome = advance(equations, after, times[index], inputs)
    motion.put(index, outcome)
    motion.statistics["marched"] += 1
    return index + 1, outcome


def _follow_large(
    inputs: Inputs,
    motion: Motion,
    may_be_compiled: bool,
    smooth: bool,
    progress: Progress | None,
) -> Outcome:
    """Go through the grid with the module of a large mechanism.

    Where it has a march of its own, that goes as far as it can, here one point is added, and so on.
    """
    march, times = _large_march(inputs, motion), inputs.t.tolist()
    good, outcome, index = None, Outcome(Status.CONVERGED, 0, None), 0
    while outcome.status is Status.CONVERGED and index < len(times):
        done = _run_compiled(march, motion, index) if may_be_compiled and index else 0
        if done:
            good, index = None, index + done
        if index < len(times):
            good, found = _next_large(march, motion, times, index, good)
            outcome = _large_outcome(found, good)
            motion.put(index, outcome)
            motion.statistics["marched"] += index > 0
            if isinstance(found, LargeState):
                good, index = found, index + 1
        if progress and index < len(times):
            progress(index, len(times))
    if march.pivoted:
        motion.statistics["pivoted"] = march.pivoted
    if outcome.status is Status.CONVERGED or inputs.guess.size > LARGEST_CAREFUL:
        if progress:
            progress(len(times), len(times))
        return outcome
    if good is None:
        return _follow(inputs, motion, False, smooth, progress)
    equations = problem(inputs.module, inputs.p, good.q, times[0])
    outcome = _taken_up(equations, motion, good.t, index - 1)
    return _go_on(equations, inputs, motion, index, outcome, False, smooth, progress)


def _large_march(inputs: Inputs, motion: Motion) -> LargeMarch:
    """Return the march of a large mechanism, whose start is on the guess's branch if it can be."""
    march, t = LargeMarch(inputs), float(inputs.t[0])
    if inputs.guess.size > LARGEST_CAREFUL:
        return march
    found = march.start(t)
    if isinstance(found, Status) or not march.leaves_branch(found):
        return march
    at_guess = problem(inputs.module, inputs.p, inputs.guess, t)
    careful = start(at_guess, t, inputs).position
    motion.note = _other_branch(at_guess, inputs, careful or at_guess.at(found.q, t))
    return march if careful is None else LargeMarch(replace(inputs, guess=careful.q))


def _run_compiled(march: LargeMarch, motion: Motion, index: int) -> int:
    """Let compiled code fill the points from an index on; return how many it could."""
    states = motion.q, motion.q_dot, motion.q_ddot
    done = march.run_compiled(index, states, motion.residual, motion.iterations)
    if done:
        motion.status[index : index + done] = Status.CONVERGED
        motion.statistics["compiled"] = motion.statistics.get("compiled", 0) + done
    return done


def _next_large(
    march: LargeMarch, motion: Motion, times: Sequence[float], index: int, good: LargeState | None
) -> tuple[LargeState | None, LargeState | Status]:
    """Return the state before a point, which is found again if it is not given, and the point."""
    if index == 0:
        return None, march.start(times[0])
    if good is None:
        known = march.take_up(motion.q[index - 1], times[index - 1])
        if isinstance(known, Status):
            return None, known
        good = known
    return good, march.advance(good, times[index])


def _large_outcome(found: LargeState | Status, good: LargeState | None) -> Outcome:
    """Return a point of a large mechanism's motion, or how it failed after a good one."""
    if isinstance(found, LargeState):
        point = Point(found.q, found.Phi, np.empty((0, 0)), 0.0)
        state = State(found.t, point, found.q_dot, found.q_ddot, ())
        return Outcome(Status.CONVERGED, found.iterations, state, point)
    last = None if good is None else _large_outcome(good, None).state
    return Outcome(found, 0, last)


def _grid(
    equations: Problem, inputs: Inputs, motion: Motion, first: State, index: int
) -> NDArray[np.bool_]:
    """Solve all points from an index on together, and tell which of them can be trusted."""
    times = inputs.t[index:]
    trusted = np.zeros(times.size, dtype=bool)
    q, q_dot, q_ddot = (values[index:].T for values in (motion.q, motion.q_dot, motion.q_ddot))
    result = GridResult(q, q_dot, q_ddot, motion.residual[index:], trusted)
    motion.statistics["coarse"] += solve_grid(equations, times, first, inputs.tolerance, result)
    motion.iterations[index + 1 :] = CORRECTIONS_ON_GRID
    return trusted


def _end_of_run(trusted: NDArray[np.bool_], index: int) -> int:
    """Return where a run of trusted points that begins at an index ends."""
    rest = trusted[index:]
    return index + (rest.size if rest.all() else int(np.argmin(rest)))


def _continues(equations: Problem, motion: Motion, state: State, index: int) -> bool:
    """Say whether a point of the grid lies on the branch that the march came by.

    After trusted points it does. Where the march went on by itself, the grid's next point must be
    near its prediction.
    """
    if motion.status[index - 1] == Status.CONVERGED and motion.statistics["marched"] == 0:
        return True
    distance = np.abs(motion.q[index] - state.point.q) / equations.spread(state.point.q)
    return bool(np.max(distance) <= SMALL_ERROR)


def _taken_up(equations: Problem, motion: Motion, t: float, index: int) -> Outcome:
    """Return a point of the grid as one from which the march can go on."""
    if index == motion.status.size - 1:
        point = Point(motion.q[index], np.empty(0), np.empty((0, 0)), 0.0)
        state = State(t, point, motion.q_dot[index], motion.q_ddot[index], ())
        return Outcome(Status.CONVERGED, 0, state, point)
    at = equations.at(np.ascontiguousarray(motion.q[index]), t)
    assert at is not None  # it was evaluated on the grid
    following = complete(equations, t, at)
    if isinstance(following, Status):
        return Outcome(following, 0, None, at)
    return Outcome(Status.CONVERGED, 0, following, at)


def _solution(inputs: Inputs, motion: Motion, outcome: Outcome) -> Solution:
    """Put names, parameters and the verdict to the numbers."""
    module = inputs.module
    message = verdict(inputs, motion.status, motion.residual, outcome, motion.events)
    return Solution(
        t=inputs.t,
        q=motion.q,
        q_dot=motion.q_dot,
        q_ddot=motion.q_ddot,
        status=motion.status,
        residual=motion.residual,
        iterations=motion.iterations,
        success=outcome.status is Status.CONVERGED,
        message=message + motion.note,
        name=module.NAME,
        coordinates=module.COORDINATES,
        equations=module.EQUATIONS,
        units=dict(module.UNITS),
        parameters=dict(zip(module.PARAMETERS, inputs.p.tolist(), strict=True)),
        statistics=motion.statistics,
        events=motion.events,
        module=module,
    )

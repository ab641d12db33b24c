"""The motion over a time grid: position, velocity and acceleration at every point.

inputs    checked, in the solver's form            inputs.read_inputs
  -> go through the times                          follow.follow
       assemble the first point from the guess     start.start
       solve all points together                   grid.solve_grid
       point by point what cannot be trusted       march.March
       find what ends the motion, or go through it events.locate
  -> say how it went                               solution_of

What all of them stand on is one position with its scales: problem.Problem.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile import criteria
from kincompile.errors import (
    AssemblyWarning,
    BranchSwitchWarning,
    CornerWarning,
    InputError,
    SingularConfigurationWarning,
    SolveError,
)
from kincompile.names import listed
from kincompile.runtime.follow import follow
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.problem import problem
from kincompile.runtime.results.solution import Solution
from kincompile.runtime.singular.assemblies import assembly_guess, unchosen
from kincompile.runtime.singular.reach import impossible, missed
from kincompile.runtime.start import is_folded
from kincompile.runtime.status import Status
from kincompile.runtime.variants import solve_in_turn, solve_variants
from kincompile.tables import pose

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import ArrayLike, NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.follow import Progress
    from kincompile.runtime.inputs import Inputs, Values

    Mask = NDArray[np.bool_]
    from collections.abc import Iterator, Sequence

    from kincompile.runtime.engine.code import Compiled
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.follow import Motion
    from kincompile.runtime.march import Outcome
    from kincompile.runtime.singular.events import Event

NAMED_TIMES = 6
"""How many corners a message names."""

ENTRIES = 1_000_000
"""Entries of nu that are evaluated at a time."""

NAMED_EQUATIONS = 3
"""How many equations a message names."""

NAMED_BODIES = 6
"""Of how many bodies a message gives the position."""

CANNOT_BE = "No position was found: the mechanism cannot be assembled"
CHANGE = "Change lengths, or what the drivers demand."

WORDS = {
    "converged": "{name}: {points} converged; the largest residual is {residual}.",
    "failed": "{name} failed at t = {t}, point {point} of {count} ({status}).",
    "one before": "The point before it is good",
    "before": "The {before} points before it are good",
    "followed": "; the motion was followed to t = {t}",
    # There is no motion yet where a first point does not converge.
    "not assembled": f"{CANNOT_BE} at this time, or the guess is too far away. Change lengths, or "
    "what the drivers demand, or give a guess nearer to the assembled mechanism; "
    "kc.assemblies(module) looks for positions.",
    "exhausted": f"Between these two times {criteria.MAX_SUBSTEPS:,} steps were not enough: ask "
    "for more times.",
    "found": "The position there was found.",
    "jumps": "A position exists at that time, but the motion does not lead there continuously.",
}
"""What is said of a motion, and of how it ended."""

UNREACHED = (Status.NOT_CONVERGED, Status.NOT_ASSEMBLED, Status.LOCK_UP)
"""Statuses of a point at which no position was found."""


def solve(
    module: ModuleType,
    t: ArrayLike,
    p: Values = None,
    guess: Values = None,
    *,
    tolerance: float = criteria.TOLERANCE,
    max_iterations: int = criteria.MAX_ITERATIONS,
    method: str | None = None,
    through: str | None = None,
    assembly: int | None = None,
    product: bool = False,
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
        Parameters; a mapping from names to values overrides the module's DEFAULTS. Where a value is
        an array, ``{"L": [0.2, 0.3, 0.4]}``, or `p` is one of shape (B, 1, k), B variants are
        solved, and the solution's arrays get a leading axis of length B. Several arrays are taken
        in pairs. All are on the branch on which the guess assembles the first set, or else the
        module's DEFAULTS: they are reached along the line of parameters from it, or are
        NOT_CONVERGED where only another branch is.
    guess : array_like, shape (n,), or mapping, or None
        Where Newton starts at the first time; a mapping overrides the module's GUESS, with names as
        in a solution: ``{"rod.phi": 1}``.
    tolerance : float
        Newton's correction at which to stop, relative to the scales of the coordinates: one radian
        for an angle, for a length the size of the mechanism. The same in every system of units.
    max_iterations : int
        Cap on Newton's iterations in one attempt.
    method : {"grid", "march"}, optional
        ``"march"`` goes from point to point; ``"grid"`` solves all points together and leaves to
        the march what it cannot trust. Both give the same; without a choice the faster is taken,
        which is the compiled march of a module that has one.
    through : {"smooth"}, optional
        Go on past a bifurcation, along the branch on which velocity and acceleration are
        continuous; a `BranchSwitchWarning` says when. Without it the motion ends there. Of several
        variants those that meet a bifurcation are followed alone, at some milliseconds each.
    assembly : int, optional
        Start in this one of the ways to assemble the mechanism at the first time, counted from 1 in
        the order of `kc.assemblies`, instead of at a guess.
    product : bool
        Solve every combination of the arrays in `p`, the values of the last one running fastest.
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
        When the equations cannot determine the coordinates: what is wrong, and what to do.
    SolveError
        With `throw`, when a point failed; `.solution` holds what was found.

    Warns
    -----
    BranchSwitchWarning
        When the motion went through a bifurcation, with the time.
    AssemblyWarning
        When there are several ways to assemble the mechanism, and no guess chooses one.
    CornerWarning
        When a driver has a corner at one of the times, with the times.
    SingularConfigurationWarning
        When it converged at points so near to a singular configuration that their rates have lost
        digits, with the time. A motion that ends at one has a status and an event instead.
    """
    limits = (tolerance, max_iterations)
    given = (module, t, p, guess, *limits, method, through, product)
    solution = _solved(given, assembly, None, progress)
    if throw and not solution.success:
        raise SolveError(solution.message, solution)
    return solution


def solve_sets(
    module: ModuleType,
    t: ArrayLike,
    sets: Array,
    guess: Array,
    p: Array,
    *,
    through: str | None = None,
) -> Solution:
    """Solve sets of parameters (B, k) on the branch of a position (n,) with parameters p (k,).

    So the chunks of a sweep are on one branch, whichever sets they have.
    """
    limits = criteria.TOLERANCE, criteria.MAX_ITERATIONS
    given = (module, t, sets[:, np.newaxis], guess, *limits, None, through, False)
    return _solved(given, None, p, None)


def _solved(
    given: tuple[Any, ...], assembly: int | None, p: Array | None, progress: Progress | None
) -> Solution:
    """Check what is given, and solve; sets start with the first parameters, or with p (k,)."""
    inputs = read_inputs(*given)
    if assembly is not None:
        inputs = _at_assembly(inputs, given[3], assembly)
    if p is not None:
        inputs = replace(inputs, p=p)
    times, corners = inputs.t, _corners_of(inputs)
    inputs = _after_corners(inputs, corners)
    with np.errstate(all="ignore"):  # what is not finite gets a status, not a warning
        if inputs.sets is None:
            motion, outcome = follow(inputs, progress)
            start = start_of(inputs, motion)
            solution = solution_of(inputs, motion, outcome)
        else:
            solve_all = solve_in_turn if inputs.code.lanes is None else solve_variants
            solution = solve_all(inputs, inputs.sets, progress)
            start = start_of_first(inputs, solution)
    solution = finite(solution)
    if start:
        warnings.warn(start, AssemblyWarning, stacklevel=3)
        solution = replace(solution, message=f"{start} {solution.message}")
    if corners is not None:
        solution = _with_corners(solution, times, corners)
    return solution


def _at_assembly(inputs: Inputs, guess: Values, number: int) -> Inputs:
    """Return inputs whose guess is one of the assemblies, of variants those of the first."""
    if guess is not None:
        raise InputError("guess and assembly are both given: give one of them.")
    return replace(inputs, guess=assembly_guess(inputs, number), without_guess=())


# Corners of drivers are times at which a velocity jumps, so that there is no acceleration. A module
# whose model allows them says so (`CORNERS`). A corner is where nu jumps from one side of a time to
# the other; so it is found whatever parameters it depends on.


def _corners_of(inputs: Inputs) -> Mask | None:
    """Return at which times a driver has a corner, shape (N,), of B variants (B, N).

    None if no time has one, or the model allows no corners.
    """
    if not inputs.code.corners:
        return None
    if inputs.sets is None:
        found = _corners(inputs, inputs.p)
    else:
        found = np.array([_corners(inputs, p) for p in inputs.sets])
    return found if found.any() else None


def _after_corners(inputs: Inputs, corners: Mask | None) -> Inputs:
    """Return the inputs with times just after the corners: there the velocity has one value."""
    if corners is None:
        return inputs
    everywhere = corners.reshape(-1, inputs.t.size).all(axis=0)
    return replace(inputs, t=np.where(everywhere, inputs.t + reach_of(inputs.t), inputs.t))


def _with_corners(solution: Solution, t: Array, corners: Mask) -> Solution:
    """Return a solution without acceleration at its corners, at the times that were asked for."""
    marked = corners & (solution.status == Status.CONVERGED)
    status, q_ddot = solution.status.copy(), solution.q_ddot.copy()
    status[marked], q_ddot[marked] = Status.CORNER, np.nan
    times = listed(
        (f"{time:.10g}" for time in t[marked.reshape(-1, t.size).any(axis=0)]), NAMED_TIMES
    )
    text = f"{solution.name}: a driver has a corner at t = {times}"
    warnings.warn(f"{text}: the velocity jumps, and there is no acceleration.", CornerWarning, 4)
    note = f" At t = {times} a driver has a corner, and there is no acceleration."
    return replace(solution, t=t, status=status, q_ddot=q_ddot, message=solution.message + note)


def _corners(inputs: Inputs, p: Array) -> Mask:
    """Return where nu jumps, with one parameter set."""
    code, t, q = inputs.code, inputs.t, inputs.guess
    largest = np.zeros(len(code.equations))
    size, reach = max(1, ENTRIES // largest.size), reach_of(t)
    parts = [t[first : first + size] for first in range(0, t.size, size)]
    jumps = np.concatenate([jumps_of_nu(code, q, part, p, reach, largest) for part in parts])
    return np.asarray((jumps > criteria.CORNER * largest).any(axis=1))


def jumps_of_nu(
    code: Compiled, q: Array, t: Array, p: Array, reach: float, largest: Array
) -> Array:
    """Return by how much nu jumps at times (N,), (N, m), and note its largest values (m,)."""
    with np.errstate(all="ignore"):  # the position may lie where an equation has no value
        before, after = (code.nu(q, t + side * reach, p) for side in (-1, 1))
        sizes = np.fmax(np.abs(before), np.abs(after))
        np.fmax(largest, np.fmax.reduce(sizes), out=largest)
        return np.abs(np.asarray(after - before))


def reach_of(t: Array) -> float:
    """Return how far two times may be apart that differ by rounding alone."""
    return criteria.SAME_TIME * float(np.abs(t).max())


def finite(solution: Solution) -> Solution:
    """Take no point for converged whose numbers are not all finite, whichever march found it.

    The compiled march has checked its points; a second check would read them from memory again.
    """
    if solution.statistics.get("compiled") == solution.t.size:
        return solution
    numbers = solution.q, solution.q_dot, solution.q_ddot
    if math.isfinite(sum(values.ravel("K").sum() for values in numbers)):
        return solution  # nearly always, and one number costs less than a mask
    is_finite = np.isfinite(sum(values.sum(axis=-1) for values in numbers))
    wrong = (solution.status == Status.CONVERGED) & ~is_finite
    if not wrong.any():
        return solution
    status = np.where(wrong, Status.NOT_FINITE, solution.status)
    text = f"{solution.name} failed: {wrong.sum()} points have numbers that are not finite."
    message = f"{text} {Status.NOT_FINITE.sentence}"
    return replace(solution, status=status, success=False, message=message)


def start_of(inputs: Inputs, motion: Motion) -> str:
    """Say that a start does not choose between ways to assemble the mechanism, if it does not."""
    may_be_open = motion.is_folded or inputs.without_guess
    if not may_be_open or motion.status[0] != Status.CONVERGED:
        return ""
    return unchosen(inputs, motion.states[0, :, 0].copy(), motion.is_folded)


def start_of_first(inputs: Inputs, solution: Solution) -> str:
    """Say of variants what is said of the first."""
    if solution.status[0, 0] != Status.CONVERGED:
        return ""
    q, time = solution.q[0, 0].copy(), float(inputs.t[0])
    equations = problem(inputs.code, inputs.p, inputs.guess, time)
    guess, found = (equations.at(position, time) for position in (inputs.guess, q))
    return unchosen(inputs, q, bool(guess and found and is_folded(equations, guess, found)))


def solution_of(inputs: Inputs, motion: Motion, outcome: Outcome) -> Solution:
    """Put names, parameters and a verdict to the numbers, and warn of what was passed."""
    warn(inputs, motion, outcome, 5)
    message, reasons = explained(inputs, motion, outcome)
    fields = motion.fields()
    beyond = inputs.limits_left(fields["q"], 5)
    return Solution(
        success=outcome.status is Status.CONVERGED,
        message=" ".join(filter(None, (message, motion.note, beyond))),
        doubt=motion.note,
        reasons=reasons,
        t=inputs.t,
        **fields,
        **inputs.about(),
    )


def warn(inputs: Inputs, motion: Motion, outcome: Outcome, level: int) -> None:
    """Warn of what a motion passed; the level is that of `warnings.warn`."""
    for event in motion.passed:
        text = f"{inputs.code.name} goes through a bifurcation at t = {event.t:.10g}, and on"
        text += " along the smooth branch."
        warnings.warn(text, BranchSwitchWarning, stacklevel=level)
    if motion.near and outcome.status is Status.CONVERGED:
        warnings.warn(_nearly(inputs, motion.near), SingularConfigurationWarning, stacklevel=level)


def _nearly(inputs: Inputs, near: list[int]) -> str:
    """Say that points of a motion, given by their numbers, are nearly singular."""
    more = f" and {len(near) - 1} more times" if len(near) > 1 else ""
    return (
        f"{inputs.code.name} is nearly singular at t = {inputs.t[near[0]]:.10g}{more}: its rates "
        "have few good digits there (see .condition). Drive another coordinate near this time, or "
        "change a length slightly."
    )


def verdict(inputs: Inputs, motion: Motion, outcome: Outcome) -> str:
    """Say in words how a motion went; the outcome is that of the last point that was tried."""
    return explained(inputs, motion, outcome)[0]


def explained(inputs: Inputs, motion: Motion, outcome: Outcome) -> tuple[str, tuple[str, ...]]:
    """Say how a motion went; of one that failed also what, its limit, what to do, and details."""
    name, times, events = inputs.code.name, inputs.t, motion.events
    if outcome.status is Status.CONVERGED:
        points = f"all {times.size} points" if times.size > 1 else "the point"
        passed = "".join(f" Passed: {event.kind} at t = {event.t:.10g}." for event in events)
        largest = motion.residual.max()
        said = WORDS["converged"].format(name=name, points=points, residual=f"{largest:.2g}")
        held = "".join(f" {sentence}." for sentence in dict.fromkeys(inputs.code.held.values()))
        return said + passed + held, ()
    index = int(np.argmax(motion.status != Status.CONVERGED))
    why, asked = _why(outcome, events, times[index], _asked(inputs, outcome))
    failed = WORDS["failed"].format(
        name=name,
        t=f"{times[index]:.10g}",
        point=index + 1,
        count=times.size,
        status=outcome.status.name,
    )
    before, there = _before(outcome, index), _there(inputs, outcome)
    why = motion.undriven or why
    what, _, remedy = why.partition(". ")
    if why == CANNOT_BE:
        why, remedy = f"{why} at this time:", CHANGE
    when = "" if " at t = " in what else f" at t = {times[index]:.10g}"
    details = " ".join(filter(None, (failed, before, there)))
    reasons = f"{name}{when}: {what.rstrip('.')}.", asked, remedy, details
    return " ".join(filter(None, (failed, before, why, asked, there))), reasons


def _before(outcome: Outcome, index: int) -> str:
    """Say how far the motion was followed."""
    if outcome.state is None:
        return ""
    good = WORDS["before" if index > 1 else "one before"].format(before=index)
    reached = WORDS["followed"].format(t=f"{outcome.state.t:.10g}")
    return f"{good}{'' if outcome.position else reached}."


def _asked(inputs: Inputs, outcome: Outcome) -> str:
    """Say which drivers and distances ask for more than the mechanism can give, and how much."""
    point = outcome.nearest
    if point is None or outcome.jumps or outcome.status not in UNREACHED:
        return ""
    equations = problem(inputs.code, inputs.p, point.q, point.t)
    return " ".join(impossible(equations, point.q, point.t))


def _why(outcome: Outcome, events: Sequence[Event], t: float, asked: str) -> tuple[str, str]:
    """Say why the motion ended, and what to do, by the event between its end and the failed time.

    Without one, what the status may mean is said in general, and the last event on the way. What is
    `asked` for comes second, where it is known.
    """
    if outcome.status is Status.NOT_ASSEMBLED:
        return (CANNOT_BE, asked) if asked else (WORDS["not assembled"], "")
    if outcome.exhausted:
        return WORDS["exhausted"], ""
    general = " ".join((outcome.status.sentence, *(event.message for event in events[-1:])))
    if events and outcome.state is not None:
        event, end = events[-1], outcome.state.t
        if abs(event.t - end) + abs(event.t - t) <= abs(t - end) + criteria.LATE:
            general = event.message
    return general, asked


def _there(inputs: Inputs, outcome: Outcome) -> str:
    """Name the equations that do not hold at the time of failure, or say what else is there."""
    if outcome.position is not None:
        return WORDS["found"]
    if outcome.jumps:
        return WORDS["jumps"]
    return "" if outcome.nearest is None else _unmet(inputs, outcome.nearest)


def _unmet(inputs: Inputs, point: Point) -> str:
    """Say by how much which equations are missed at the best position, and where its bodies are."""
    sizes = np.abs(point.Phi)
    order = np.argsort(-sizes, kind="stable")[:NAMED_EQUATIONS]
    rows = [row for row in order.tolist() if sizes[row] > criteria.ZERO * sizes[order[0]]]
    equations = problem(inputs.code, inputs.p, point.q, point.t)
    worst = ", ".join(missed(equations, point, row) for row in rows)
    places = listed(_places(inputs.code, point.q), most=NAMED_BODIES)
    return (
        f"The equations with the largest residuals at the nearest position: {worst}. "
        f"There: {places}."
    )


def _places(code: Compiled, q: Array) -> Iterator[str]:
    """Yield where each body is, and the values of coordinates that belong to none."""
    values = dict(zip(code.coordinates, q.tolist(), strict=True))
    places = {body: slice(first, first + count) for body, first, count in code.bodies}
    for owner in dict.fromkeys(code.owners().values()):
        if owner in places:
            yield f"{owner} {pose(q[places[owner]].tolist())}"
        else:
            yield f"{owner} = {values[owner]:.4g}"

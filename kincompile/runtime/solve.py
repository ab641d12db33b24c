"""The motion over a time grid: position, velocity and acceleration at every point.

inputs    checked, in the solver's form            inputs.read_inputs
  -> of a compiled module, its own march           native.make_native
  -> go through the times                          follow.follow
       assemble the first point from the guess     march.start      (newton.assemble)
       solve all points together                   grid.solve_grid  (coarse.coarse_march)
       point by point what cannot be trusted       march.March
       find what ends the motion, or go through it events.locate
  -> say how it went                               verdict.verdict
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import MAX_ITERATIONS, TOLERANCE
from kincompile.errors import (
    BranchSwitchWarning,
    InputError,
    SingularConfigurationWarning,
    SolveError,
)
from kincompile.runtime.corners import after_corners, corners_of, with_corners
from kincompile.runtime.follow import follow
from kincompile.runtime.inputs import Inputs, read_inputs
from kincompile.runtime.march import Outcome, leaves_branch
from kincompile.runtime.motion import Motion
from kincompile.runtime.problem import problem
from kincompile.runtime.results.solution import Solution
from kincompile.runtime.status import Status
from kincompile.runtime.variants import read_variants, solve_in_turn, solve_variants
from kincompile.runtime.verdict import verdict

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import ArrayLike

    from kincompile.runtime.engine.code import Code
    from kincompile.runtime.inputs import Values
    from kincompile.runtime.motion import Progress


SMALLEST_GRID = 32
"""Points from which on a grid is faster than a march."""


def solve(
    module: ModuleType,
    t: ArrayLike,
    p: Values = None,
    guess: Values = None,
    *,
    tolerance: float = TOLERANCE,
    max_iterations: int = MAX_ITERATIONS,
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
        When the equations cannot determine the coordinates: what is wrong, and what to do.
    SolveError
        With `throw`, when a point failed; `.solution` holds what was found.

    Warns
    -----
    BranchSwitchWarning
        When the motion went through a bifurcation, with the time.
    CornerWarning
        When a driver has a corner at one of the times, with the times.
    SingularConfigurationWarning
        When it converged at points so near to a singular configuration that their rates have lost
        digits, with the time. A motion that ends at one has a status and an event instead.
    """
    sets = read_variants(module, p)
    inputs = read_inputs(module, t, p if sets is None else None, guess, tolerance, max_iterations)
    on_grid = _takes_grid(inputs.code, inputs.t.size, method)
    if through not in (None, "smooth"):
        raise InputError(f"through is {through!r}: give 'smooth', or nothing.")

    def solve_one(inputs: Inputs, progress: Progress | None = None) -> Solution:
        return _solve_one(inputs, on_grid, method is None, through == "smooth", progress)

    t_given, corners = inputs.t, corners_of(inputs, sets)
    inputs = after_corners(inputs, corners)
    if sets is None:
        solution = solve_one(inputs, progress)
    elif inputs.code.lanes is not None:
        solution = solve_variants(inputs, sets, progress)
    else:
        solution = solve_in_turn(inputs, sets, solve_one, progress)
    solution = with_corners(solution, t_given, corners)
    if throw and not solution.success:
        raise SolveError(solution.message, solution)
    return solution


def _solve_one(
    inputs: Inputs, on_grid: bool, may_be_compiled: bool, smooth: bool, progress: Progress | None
) -> Solution:
    """Solve with one set of parameters."""
    motion = Motion.over(inputs)
    with np.errstate(all="ignore"):  # what is not finite gets a status, not a warning
        if may_be_compiled and _march_compiled(inputs, motion):
            outcome = Outcome(Status.CONVERGED, 0, None)
        else:
            outcome = follow(inputs, motion, on_grid, smooth, progress)
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


def _takes_grid(code: Code, points: int, method: str | None) -> bool:
    """Say whether the points of a grid are solved together."""
    if method not in (None, "grid", "march"):
        raise InputError(f"method is {method!r}: give 'grid', 'march', or nothing.")
    if method == "grid" and code.lanes is None:
        raise InputError(
            f"{code.name} goes from point to point, as all redundant mechanisms and those in the "
            "grouped form do: use method='march', or compile it with form='inline'."
        )
    return method == "grid" or (
        method is None and points >= SMALLEST_GRID and code.lanes is not None
    )


def _march_compiled(inputs: Inputs, motion: Motion) -> bool:
    """Let a compiled module follow the motion; say whether all went well.

    Where anything did not, the careful march finds out what it is, from the first time on.
    """
    march = inputs.code.march
    if march is None:
        return False
    states = motion.q.T, motion.q_dot.T, motion.q_ddot.T
    status, iterations = np.empty((2, inputs.t.size), dtype=np.intc)
    if march(inputs, states, motion.residual, status, iterations) < inputs.t.size:
        return False
    # A large step of Newton's from the guess may have ended on another branch.
    time = float(inputs.t[0])
    equations = problem(inputs.module, inputs.p, inputs.guess, time, inputs.guess)
    guess, found = (equations.at(q, time) for q in (inputs.guess, motion.q[0].copy()))
    if guess is None or found is None or leaves_branch(equations, guess, found):
        return False
    motion.status[:], motion.iterations[:] = status, iterations
    motion.statistics["compiled"] = inputs.t.size
    return True


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

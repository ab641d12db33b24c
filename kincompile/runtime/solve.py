"""The motion over a time grid: position, velocity and acceleration at every point.

inputs    checked, in the solver's form            inputs.read_inputs
  -> go through the times                          follow.follow
       assemble the first point from the guess     start.start
       solve all points together                   grid.solve_grid
       point by point what cannot be trusted       march.March
       find what ends the motion, or go through it events.locate
  -> say how it went                               verdict.solution_of

What all of them stand on is one position with its scales: problem.Problem.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import CORNER, MAX_ITERATIONS, SAME_TIME, TOLERANCE
from kincompile.errors import AssemblyWarning, CornerWarning, InputError, SolveError
from kincompile.names import listed
from kincompile.runtime.follow import follow
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.singular.assemblies import assembly_guess
from kincompile.runtime.status import Status
from kincompile.runtime.variants import solve_in_turn, solve_variants
from kincompile.runtime.verdict import finite, solution_of, start_of, start_of_first

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import ArrayLike, NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.follow import Progress
    from kincompile.runtime.inputs import Inputs, Values
    from kincompile.runtime.results.solution import Solution

    Mask = NDArray[np.bool_]

NAMED_TIMES = 6
"""How many corners a message names."""

ENTRIES = 1_000_000
"""Entries of nu that are evaluated at a time."""


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
    limits = TOLERANCE, MAX_ITERATIONS
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
    return replace(inputs, t=np.where(everywhere, inputs.t + _reach(inputs.t), inputs.t))


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
    jumps, reach = [], _reach(t)
    size = max(1, ENTRIES // largest.size)
    with np.errstate(all="ignore"):  # the guess may lie where an equation has no value
        for first in range(0, t.size, size):
            times = t[first : first + size]
            before, after = (code.nu(q, times + side * reach, p) for side in (-1, 1))
            largest = np.fmax(largest, np.fmax.reduce(np.fmax(np.abs(before), np.abs(after))))
            jumps.append(np.abs(after - before))
    return np.asarray((np.concatenate(jumps) > CORNER * largest).any(axis=1))


def _reach(t: Array) -> float:
    """Return how far two times may be apart that differ by rounding alone."""
    return SAME_TIME * float(np.abs(t).max())

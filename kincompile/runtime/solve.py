"""The motion over a time grid: position, velocity and acceleration at every point.

inputs    checked, in the solver's form          inputs.read_inputs
  -> assemble the first point from the guess     march.start      (newton.assemble)
  -> follow the motion from point to point       march.advance    (newton.iterate)
  -> say how it went                             _message
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from kincompile.errors import SolveError
from kincompile.runtime.inputs import Inputs, read_inputs
from kincompile.runtime.march import Outcome, advance, start
from kincompile.runtime.problem import problem
from kincompile.runtime.solution import Solution
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from numpy.typing import ArrayLike, NDArray

    from kincompile.runtime.inputs import Values
    from kincompile.runtime.problem import Point, Vector

    Progress: TypeAlias = Callable[[int, int], object]


NAMED_EQUATIONS = 3
"""How many equations a message names."""


def solve(
    module: ModuleType,
    t: ArrayLike,
    p: Values = None,
    guess: Values = None,
    *,
    tolerance: float = 1e-10,
    max_iterations: int = 25,
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
        Parameters; a mapping from names to values overrides the module's DEFAULTS.
    guess : array_like, shape (n,), or mapping, or None
        Where Newton starts at the first time; a mapping overrides the module's GUESS.
    tolerance : float
        Norm of Newton's correction, relative to 1 + ||q||, at which to stop.
    max_iterations : int
        Cap on Newton's iterations in one attempt.
    throw : bool
        Raise `SolveError` unless every point converged.
    progress : callable, optional
        Called as ``progress(done, total)`` after each point.

    Returns
    -------
    Solution
        With a status per point. After a point that failed the others are not tried.

    Raises
    ------
    InputError
        When a value has the wrong name, shape, type or is not finite; all that is wrong at once.
    StructuralError
        When the module has not as many equations as coordinates.
    SolveError
        With `throw`, when a point failed; `.solution` holds what was found.
    """
    inputs = read_inputs(module, t, p, guess, tolerance, max_iterations)
    motion = _Motion.over(inputs)
    with np.errstate(all="ignore"):  # what is not finite gets a status, not a warning
        outcome = _march(inputs, motion, progress)
    solution = _solution(inputs, motion, outcome)
    if throw and not solution.success:
        raise SolveError(solution.message, solution)
    return solution


@dataclass(slots=True, eq=False)
class _Motion:
    """The arrays of a solution while they are being filled."""

    q: Vector
    q_dot: Vector
    q_ddot: Vector
    status: NDArray[np.int64]
    residual: Vector
    iterations: NDArray[np.int64]

    @classmethod
    def over(cls, inputs: Inputs) -> _Motion:
        """Make the arrays for a time grid, with nothing reached."""
        points = inputs.t.size
        shape = (points, inputs.guess.size)
        return cls(
            np.full(shape, np.nan),
            np.full(shape, np.nan),
            np.full(shape, np.nan),
            np.full(points, int(Status.NOT_REACHED)),
            np.full(points, np.nan),
            np.zeros(points, dtype=np.int64),
        )

    def put(self, index: int, outcome: Outcome) -> None:
        """Write down what became of a point."""
        self.status[index] = outcome.status
        self.iterations[index] = outcome.iterations
        if outcome.position is not None:
            self.q[index] = outcome.position.q
            self.residual[index] = np.max(np.abs(outcome.position.Phi))
        elif (point := _unassembled(outcome)) is not None:
            self.residual[index] = np.max(np.abs(point.Phi))
        if outcome.status is Status.CONVERGED and outcome.state is not None:
            self.q_dot[index] = outcome.state.q_dot
            self.q_ddot[index] = outcome.state.q_ddot


def _march(inputs: Inputs, motion: _Motion, progress: Progress | None) -> Outcome:
    """Go through the grid up to its end, or to the first point that fails."""
    times = inputs.t.tolist()
    outcome = start(problem(inputs.module, inputs.p, inputs.guess, times[0]), times[0], inputs)
    motion.put(0, outcome)
    if progress:
        progress(1, len(times))
    # The guess may be rough: from here on the assembled mechanism gives the size.
    assembled = inputs.guess if outcome.position is None else outcome.position.q
    equations = problem(inputs.module, inputs.p, assembled, times[0])
    for index in range(1, len(times)):
        if outcome.status is not Status.CONVERGED or outcome.state is None:
            break
        outcome = advance(equations, outcome.state, times[index], inputs)
        motion.put(index, outcome)
        if progress:
            progress(index + 1, len(times))
    return outcome


def _unassembled(outcome: Outcome) -> Point | None:
    """Give the position nearest to an assembled one, where the mechanism does not assemble."""
    attempt = outcome.attempt
    if attempt is None or not attempt.points or attempt.status is Status.CONVERGED:
        return None
    return attempt.last


def _solution(inputs: Inputs, motion: _Motion, outcome: Outcome) -> Solution:
    """Put names, parameters and the verdict to the numbers."""
    module = inputs.module
    return Solution(
        t=inputs.t,
        q=motion.q,
        q_dot=motion.q_dot,
        q_ddot=motion.q_ddot,
        status=motion.status,
        residual=motion.residual,
        iterations=motion.iterations,
        success=outcome.status is Status.CONVERGED,
        message=_message(inputs, motion, outcome),
        name=module.NAME,
        coordinates=module.COORDINATES,
        equations=module.EQUATIONS,
        units=dict(module.UNITS),
        parameters=dict(zip(module.PARAMETERS, inputs.p.tolist(), strict=True)),
    )


def _message(inputs: Inputs, motion: _Motion, outcome: Outcome) -> str:
    """Say in words how it went."""
    name, times = inputs.module.NAME, inputs.t
    if outcome.status is Status.CONVERGED:
        points = f"all {times.size} points" if times.size > 1 else "the point"
        return f"{name}: {points} converged; the largest residual is {motion.residual.max():.2g}."
    index = int(np.argmax(motion.status != Status.CONVERGED))
    parts = [
        f"{name} failed at t = {times[index]:.10g}, point {index + 1} of {times.size}"
        f" ({outcome.status.name}).",
        _before(outcome, index),
        _there(inputs.module, outcome),
        outcome.status.sentence,
    ]
    return " ".join(part for part in parts if part)


def _before(outcome: Outcome, index: int) -> str:
    """Say how far the motion was followed."""
    if outcome.state is None:
        return ""
    good = f"The {index} points before it are good" if index > 1 else "The point before it is good"
    reached = f"; the motion was followed to t = {outcome.state.t:.10g}"
    return f"{good}{'' if outcome.position else reached}."


def _there(module: ModuleType, outcome: Outcome) -> str:
    """Name the equations that do not hold at the time of failure, or say what else is there."""
    if outcome.position is not None:
        return "The position there was found."
    if outcome.attempt is not None and outcome.attempt.status is Status.CONVERGED:
        return "A position exists at that time, but the motion does not lead there continuously."
    point = _unassembled(outcome)
    if point is None:
        return ""
    largest = np.argsort(-np.abs(point.Phi), kind="stable")[:NAMED_EQUATIONS]
    worst = ", ".join(f"{module.EQUATIONS[row]} = {point.Phi[row]:.3g}" for row in largest)
    return f"The equations with the largest residuals at the nearest position: {worst}."

"""`kc.newton`: the position at one time from a guess, with the way to it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import MAX_ITERATIONS, TOLERANCE
from kincompile.html import Shown
from kincompile.runtime.engine.scales import norm
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.problem import problem
from kincompile.runtime.start import assemble
from kincompile.tables import counted, indented, table

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.inputs import Values
    from kincompile.runtime.problem import Attempt
    from kincompile.runtime.status import Status

    Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class NewtonResult(Shown):
    """The way of Newton's method from a guess to a position.

    Attributes
    ----------
    q : ndarray, shape (n,)
        The last iterate, with angles that the equations leave free by whole turns nearest to the
        guess.
    status : Status
        CONVERGED, or why not.
    iterates : ndarray, shape (k + 1, n)
        The guess, or where another attempt began, and the positions after each correction.
    corrections : ndarray, shape (k,)
        Euclidean norm of each correction.
    residuals : ndarray, shape (k + 1,)
        Euclidean norm of Phi at each iterate.
    residual : float
        Largest absolute value of Phi there; NaN where it has none.
    iterations : int
        The number k of corrections.
    """

    q: NDArray[np.float64]
    status: Status
    iterates: NDArray[np.float64]
    corrections: NDArray[np.float64]
    residuals: NDArray[np.float64]
    residual: float
    iterations: int

    def to_text(self) -> str:
        """Return the outcome, and the norms of Phi and of the correction in each iteration."""
        rows = [
            [str(k), f"{residual:.3g}", f"{self.corrections[k]:.3g}" if k < self.iterations else ""]
            for k, residual in enumerate(self.residuals)
        ]
        outcome = f"{self.status.name} after {counted(self.iterations, 'iteration')}"
        lines = table(("k", "|Phi|", "|correction|"), rows, ("k", "|Phi|", "|correction|"))
        return "\n".join([f"{outcome}, residual {self.residual:.3g}", *indented(lines)])


def newton(
    module: ModuleType,
    t: float,
    q0: Values,
    p: Values = None,
    *,
    tolerance: float = TOLERANCE,
    max_iterations: int = MAX_ITERATIONS,
) -> NewtonResult:
    """Solve Phi(q, t) = 0 for the position at one time.

    Parameters
    ----------
    module
        An emitted module with as many equations as coordinates.
    t : float
        Time.
    q0 : array_like, shape (n,), or mapping, or None
        Start; a mapping from coordinates to values overrides the module's GUESS, None is GUESS.
    p : array_like, shape (k,), or mapping, or None
        Parameters; a mapping overrides the module's DEFAULTS.
    tolerance : float
        The correction at which to stop, relative to the scales of the coordinates: one radian for
        an angle, for a length the size of the mechanism.
    max_iterations : int
        Cap on the iterations of each of the two attempts, plain and safeguarded.

    Returns
    -------
    NewtonResult
        The plain attempt where it converges, else the safeguarded one.

    Raises
    ------
    InputError
        When a value has the wrong name, shape, type or is not finite.
    StructuralError
        When the equations cannot determine the coordinates: what is wrong, and what to do.
    """
    inputs = read_inputs(module, t, p, q0, tolerance, max_iterations)
    time = inputs.one_time("newton works at one time", "use solve for a grid")
    with np.errstate(all="ignore"):
        equations = problem(inputs.code, inputs.p, inputs.guess, time)
        attempt = assemble(equations, time, inputs.guess, inputs.tolerance, inputs.max_iterations)
    return _result(attempt, inputs.guess)


def _result(attempt: Attempt, guess: Vector) -> NewtonResult:
    """Turn the record into arrays."""
    points, found = attempt.points, attempt.found
    return NewtonResult(
        q=guess if found is None else found.q,
        status=attempt.status,
        iterates=np.array([point.q for point in points] or [guess]),
        corrections=np.array(attempt.corrections),
        residuals=np.array([norm(point.Phi) for point in points] or [np.nan]),
        residual=math.nan if found is None else float(np.max(np.abs(found.Phi))),
        iterations=len(attempt.corrections),
    )

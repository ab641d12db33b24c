"""All ways of assembling a mechanism at one time, by Newton's method from many starts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kincompile.errors import InputError
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.newton import SAME, iterate, safeguarded_step, unwound
from kincompile.runtime.problem import norm, problem
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.engine.engine import Array as Vector
    from kincompile.runtime.engine.engine import Point
    from kincompile.runtime.inputs import Values
    from kincompile.runtime.problem import Problem

SEED = 1989
"""Any will do; fixed, so that the result is the same on every run."""

FIRST_STARTS, MOST_STARTS = 60, 400
"""Starts that are tried at least and at most."""

PATIENCE = 6
"""The search ends when it has tried this many times the starts after which the last way to assemble
was found."""

TOLERANCE, MAX_ITERATIONS = 1e-12, 40
"""Of Newton's method from each start."""


def assemblies(module: ModuleType, t: float = 0.0, p: Values = None) -> Vector:
    """Find the distinct positions in which a mechanism can be assembled at one time.

    Parameters
    ----------
    module
        An emitted module, from ``kc.compile`` or ``kc.load``.
    t : float
        The time.
    p : array_like, shape (k,), or mapping, or None
        Parameters; a mapping overrides the module's DEFAULTS.

    Returns
    -------
    ndarray, shape (k, n)
        The positions, nearest to the module's GUESS first, the same on every run. Angles that the
        equations leave free by whole turns are those nearest to the guess. Shape (0, n) where the
        mechanism cannot be assembled. Any row serves as `guess` of `solve`.

    Raises
    ------
    InputError
        When a value has the wrong name, shape, type or is not finite.
    StructuralError
        When the equations cannot determine the coordinates: what is wrong, and what to do.

    Notes
    -----
    The search is by chance, with a fixed seed: what is rarely met may be missed. What the equations
    allow counts, also where the parts would have to be taken apart to get there: a translational
    joint holds as well with a body turned by half a turn, so that a slider-crank whose slider is
    held by one has 4 assemblies, and 2 where the slider's angle is given. Singular
    positions, of which there may be infinitely many together, count where Newton's method
    ends.
    """
    inputs = read_inputs(module, t, p, None, TOLERANCE, MAX_ITERATIONS)
    if inputs.t.size > 1:
        raise InputError(
            f"assemblies are those of one time, got {inputs.t.size}: call it for each."
        )
    time = float(inputs.t[0])
    with np.errstate(all="ignore"):
        equations = problem(module, inputs.p, inputs.guess, time)
        equations.angular = equations.angular | _periodic(equations, time, inputs.guess)
        found: list[Vector] = []
        last = 0
        for k, start in enumerate(_starts(equations, inputs.guess), 1):
            point = _assembled(equations, time, start)
            if point is not None:
                q = unwound(equations, time, point, inputs.guess, TOLERANCE).q
                if all(_distance(equations, q, other) > SAME for other in found):
                    found.append(q)
                    last = k
            if k >= max(FIRST_STARTS, PATIENCE * last):
                break
        order = sorted(found, key=lambda q: _rank(equations, q, inputs.guess))
    return np.array(order).reshape(len(order), inputs.guess.size)


def _periodic(equations: Problem, t: float, guess: Vector) -> NDArray[np.bool_]:
    """Return which coordinates are 2 pi-periodic in every equation.

    A free coordinate has no unit that says that it is an angle.
    """
    generic = equations.at(guess + equations.reference * equations.probe[: guess.size], t)
    periodic = np.zeros(guess.size, dtype=bool)
    if generic is None:
        return periodic
    for column in range(guess.size):
        q = generic.q.copy()
        q[column] += math.tau
        turned = equations.at(q, t)
        periodic[column] = turned is not None and bool(
            np.allclose(turned.Phi, generic.Phi, rtol=1e-11, atol=1e-11 * norm(generic.Phi))
        )
    return periodic


def _starts(equations: Problem, guess: Vector) -> Vector:
    """Return the guess, and positions spread over all angles and twice the mechanism's size."""
    random = np.random.default_rng(SEED)
    offsets = random.uniform(-1, 1, (MOST_STARTS - 1, guess.size))
    reach = np.where(equations.angular, math.pi, 2 * equations.reference)
    return np.vstack((guess, guess + offsets * reach))


def _assembled(equations: Problem, t: float, start: Vector) -> Point | None:
    """Return where Newton's method ends, plain or safeguarded; None where it does not converge."""
    for step in (None, safeguarded_step):
        attempt = iterate(equations, t, start, TOLERANCE, MAX_ITERATIONS, step)
        if attempt.status is Status.CONVERGED:
            return attempt.last
    return None


def _distance(equations: Problem, q: Vector, other: Vector) -> float:
    """Return how far two positions are apart, angles modulo a turn."""
    return float(np.max(np.abs(_difference(equations, q, other)), initial=0.0))


def _difference(equations: Problem, q: Vector, other: Vector) -> Vector:
    away = (q - other) / equations.reference
    return np.where(equations.angular, np.remainder(away + math.pi, math.tau) - math.pi, away)


def _rank(equations: Problem, q: Vector, guess: Vector) -> tuple[float, ...]:
    """Return what positions are ordered by: the distance from the guess, then the coordinates."""
    away = _difference(equations, q, guess)
    return (round(float(np.linalg.norm(away)), 6), *np.round(away, 6).tolist())

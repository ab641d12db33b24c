"""All ways of assembling a mechanism at one time, by Newton's method from many starts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import SAME_POSITION, SMALL_CORRECTION, STILL
from kincompile.errors import InputError
from kincompile.names import listed
from kincompile.runtime.engine.scales import norm
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.problem import iterate, problem, safeguarded_step
from kincompile.runtime.start import unwound
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.engine.linear import Array as Vector
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.inputs import Inputs, Values
    from kincompile.runtime.problem import Problem

SEED = 1989
"""Any will do; fixed, so that the result is the same on every run."""

FIRST_STARTS, ASIDE, MOST_STARTS = 60, 120, 400
"""Starts that are tried at least, at most beside a solve, and at most."""

PATIENCE = 6
"""The search ends when it has tried this many times the starts after which the last way to assemble
was found."""

MAX_ITERATIONS = 40
"""Iterations of Newton's method from each start."""

MOST_COORDINATES = 60
"""Coordinates up to which a start is looked at that chooses no assembly: a search takes seconds in
larger mechanisms."""

NOTICEABLE = 0.3
"""Angle [rad] by which a body without a guess must turn before the other way is looked at."""


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
        equations leave free by whole turns are those nearest to the guess, and of Euler parameters
        p and -p, which are one orientation, the nearer. Shape (0, n) where the
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
    inputs = read_inputs(module, t, p, None, SMALL_CORRECTION, MAX_ITERATIONS)
    inputs.one_time("assemblies are those of one time", "call it for each")
    return assembled_positions(inputs)


def assembled_positions(inputs: Inputs) -> Vector:
    """Return what `assemblies` does, at the first time, for inputs that are checked."""
    return _searched(inputs, MOST_STARTS)[0]


def _searched(inputs: Inputs, most: int) -> tuple[Vector, bool]:
    """Return assemblies that are found from starts, and whether more starts promise no more."""
    time = float(inputs.t[0])
    with np.errstate(all="ignore"):
        equations = _equations(inputs)
        found: list[Vector] = []
        last = 0
        for k, start in enumerate(spread_starts(equations, inputs.guess)[:most], 1):
            point = _assembled(equations, time, start)
            if point is not None:
                q = unwound(equations, time, point, inputs.guess, SMALL_CORRECTION).q
                if is_new(equations, q, found):
                    found.append(q)
                    last = k
            if k >= max(FIRST_STARTS, PATIENCE * last):
                break
        order = sorted(found, key=lambda q: _rank(equations, q, inputs.guess))
    return np.array(order).reshape(len(order), inputs.guess.size), k >= PATIENCE * last


def is_new(equations: Problem, q: Vector, others: Iterable[Vector]) -> bool:
    """Say whether a position differs from all others, apart from whole turns."""
    return all(equations.distance(q, other) > SAME_POSITION for other in others)


def assembly_guess(inputs: Inputs, number: object) -> Vector:
    """Return one of the assemblies at the first time, as a guess; they are counted from 1."""
    count = "no integer"
    if isinstance(number, int | np.integer) and not isinstance(number, bool):
        found = assembled_positions(inputs)
        if 1 <= number <= len(found):
            return np.asarray(found[number - 1])
        count = f"{inputs.code.name} has {len(found)} assemblies"
    raise InputError(
        f"assembly is {number!r}: {count} at t = {inputs.t[0]:.10g}; they count from 1, and "
        "kc.assemblies, kincompile assemblies, show them."
    )


def unchosen(inputs: Inputs, q: Vector, is_folded: bool) -> str:
    """Say that a start q (n,) does not choose between ways to assemble; "" where it does.

    Where a determinant is zero at the guess, `is_folded`, it shows no branch.
    """
    without = inputs.without_guess
    if q.size > MOST_COORDINATES or not (is_folded or _is_open(inputs, q, without)):
        return ""
    found, is_whole = _searched(inputs, ASIDE)
    equations = _equations(inputs)
    away = [equations.distance(q, other) for other in found]
    if len(found) < 2:
        return ""
    taken = int(np.argmin(away))
    other = found[1 if taken == 0 else 0]
    moved = np.abs(_difference(equations, q, other)) > SAME_POSITION
    owners = inputs.code.owners()
    differing = dict.fromkeys(owners[inputs.code.coordinates[k]] for k in np.flatnonzero(moved))
    missing = [body for body in differing if body in without]
    cause = f"there is no guess of {listed(missing)}" if missing else "the guess lies folded"
    count = f"there are {len(found)}" if is_whole else f"there are at least {len(found)}"
    number = f"this is number {taken + 1}. Take another with assembly={2 if taken == 0 else 1}"
    if not is_whole:  # in the order of all of them it may have another number
        number = "take one of kc.assemblies by its number"
    return (
        f"{inputs.code.name}: {cause}, and {count} assemblies at t = {inputs.t[0]:.10g}, which "
        f"differ in {listed(differing)}; {number} (--assembly on the command line; "
        "kincompile assemblies draws them), or give a guess nearer to it."
    )


def _equations(inputs: Inputs) -> Problem:
    """Return the equations as a search judges them, with angles that have no unit among them."""
    time = float(inputs.t[0])
    equations = problem(inputs.code, inputs.p, inputs.guess, time)
    equations.angular = equations.angular | _periodic(equations, time, inputs.guess)
    return equations


def _is_open(inputs: Inputs, q: Vector, without: Sequence[str]) -> bool:
    """Say whether bodies without a guess, turned the other way, assemble as near to the guess."""
    places = {body: range(first, first + count) for body, first, count in inputs.code.bodies}
    columns = [column for body in without for column in places[body]]
    angles = [column for column in columns if inputs.code.angular[column]]
    if np.max(np.abs(q[angles]), initial=0.0) < NOTICEABLE:
        return False
    time = float(inputs.t[0])
    equations = problem(inputs.code, inputs.p, inputs.guess, time)
    mirrored = q.copy()
    mirrored[angles] = -q[angles]
    found = _assembled(equations, time, mirrored)
    if found is None or equations.distance(q, found.q) <= SAME_POSITION:
        return False
    other = found.q
    here, there = (
        np.abs(_difference(equations, x, inputs.guess))[angles].max() for x in (q, other)
    )
    moved = np.abs(_difference(equations, q, other))[columns]
    return bool(there <= 2 * here and (moved > SAME_POSITION).any())


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
            np.allclose(turned.Phi, generic.Phi, rtol=STILL, atol=STILL * norm(generic.Phi))
        )
    return periodic


def spread_starts(equations: Problem, guess: Vector) -> Vector:
    """Return the guess, and positions spread over all angles and twice the mechanism's size."""
    random = np.random.default_rng(SEED)
    offsets = random.uniform(-1, 1, (MOST_STARTS - 1, guess.size))
    reach = np.where(equations.angular, math.pi, 2 * equations.reference)
    return np.vstack((guess, guess + offsets * reach))


def _assembled(equations: Problem, t: float, start: Vector) -> Point | None:
    """Return where Newton's method ends, plain or safeguarded; None where it does not converge."""
    for step in (None, safeguarded_step):
        attempt = iterate(equations, t, start, SMALL_CORRECTION, MAX_ITERATIONS, step)
        if attempt.status is Status.CONVERGED:
            return attempt.last
    return None


def _difference(equations: Problem, q: Vector, other: Vector) -> Vector:
    return equations.apart(q, other) / equations.reference


def _rank(equations: Problem, q: Vector, guess: Vector) -> tuple[float, ...]:
    """Return what positions are ordered by: the distance from the guess, then the coordinates."""
    away = _difference(equations, q, guess)
    return (round(float(np.linalg.norm(away)), 6), *np.round(away, 6).tolist())

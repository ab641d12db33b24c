"""Forward dynamics: the motion that follows from masses and forces.

inputs     checked; the equations of motion are compiled on request   equations.Equations
  -> a state that the constraints allow                               position_at, velocity_at
  -> step by step, led back to the constraints after each             integrate.Integration
       a singular configuration is foreseen, and stepped across       happenings.passage
       what happens within a step is located                          happenings.Watch
  -> a Solution, with energies and drift as columns                   simulate

What is given at the start is held. Of what is left open, coordinates are those nearest to the
guess, and the velocities those of the least kinetic energy: without given velocities it is at rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import HALF, MAX_ITERATIONS, RANK, STEP_TOLERANCE, TOLERANCE
from kincompile.errors import InputError, SolveError
from kincompile.names import METRES, column_name, force_units, listed, rate, suggestion
from kincompile.runtime.dynamics.equations import Equations, dynamics_of
from kincompile.runtime.dynamics.happenings import Watch
from kincompile.runtime.dynamics.integrate import Integration
from kincompile.runtime.inputs import mapping_of, read_inputs
from kincompile.runtime.problem import nearest
from kincompile.runtime.results.solution import Solution
from kincompile.runtime.singular.reach import missed
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

    from numpy.typing import ArrayLike

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.follow import Progress
    from kincompile.runtime.inputs import Inputs, Values

ADDED = ("kinetic_energy", "work", "energy_drift", "constraint_drift")
"""Columns that a simulation adds to those of the motion."""


def simulate(
    module: ModuleType,
    t: ArrayLike,
    p: Values = None,
    guess: Values = None,
    *,
    position: Mapping[str, float] | None = None,
    velocity: Values = None,
    events: Mapping[str, ArrayLike] | None = None,
    stops: Mapping[str, ArrayLike] | None = None,
    method: str = "DOP853",
    rtol: float = STEP_TOLERANCE,
    atol: float | None = None,
    max_step: float = math.inf,
    through: str | None = None,
    throw: bool = False,
    progress: Progress | None = None,
) -> Solution:
    r"""Simulate a mechanism: the motion that follows from its masses and forces.

    Solves :math:`M \ddot q + \Phi_q^T \lambda = Q`, :math:`\Phi_q \ddot q = \gamma` for the
    accelerations by code that is planned at compile time, lets a library integrate them, and leads
    the state back to :math:`\Phi = 0` and :math:`\Phi_q \dot q = \nu` after every step.

    Parameters
    ----------
    module
        A module of `kc.compile`, of a mechanism whose bodies have masses. It may have drivers, and
        as many degrees of freedom besides as it likes.
    t : array_like, shape (N,)
        Times, rising or falling; the motion begins at the first.
    p, guess
        Parameters, and where the position at the first time is looked for, as in `kc.solve`.
    position : mapping, optional
        Coordinates that are given exactly at the first time, ``{"crank.phi": 0.3}``; the others are
        those near the guess that the constraints allow.
    velocity : mapping or array_like, shape (n,), optional
        Velocities at the first time, ``{"crank.phi_dot": 2}``, in space angular velocities too,
        ``{"rotor.omega_zeta": 20}``; the others are those of the least
        kinetic energy that the constraints allow. As an array, the velocities that are allowed and
        nearest to it. Without it all that no driver moves begins at rest.
    events, stops : mapping, optional
        Values of coordinates or outputs, ``{"slider.x": 0.35}`` or ``{"slider.x": (0.1, 0.35)}``,
        at which an event is located in time; the motion goes on, or it ends there.
    method : {"DOP853", "Radau", "BDF", "CVODE"}
        SciPy's explicit method of order 8, or for stiff systems its implicit one of order 5, its
        multistep method, or that of SUNDIALS (``pip install -e '.[stiff]'``). Implicit ones
        are given the exact derivatives of the accelerations.
    rtol, atol : float
        Relative tolerance of a step; absolute one, in radians and sizes of the mechanism and per
        second, without it as `rtol`.
    max_step : float
        The longest step [s].
    through : {"smooth"}, optional
        Go on through singular configurations along the smooth branch; without it the motion ends
        at the first.
    throw : bool
        Raise `SolveError` unless every point was found.
    progress : callable, optional
        Called as ``progress(done, total)`` with the times that were reached.

    Returns
    -------
    Solution
        Of the times, as `kc.solve` gives it. Its further columns are ``kinetic_energy``; ``work``,
        what loads and drivers have done since the start; ``energy_drift``, kinetic energy less that
        at the start less the work; and ``constraint_drift``, the largest correction, in radians or
        sizes of the mechanism, that led back to the constraints since the point before. ``.events``
        are what was located, ``.statistics`` steps, evaluations and Jacobians.

    Raises
    ------
    InputError
        When a value has the wrong name, shape, type or is not finite, or the module has no loads.
    StructuralError
        When a body has no mass, or constraints contradict each other.
    UnsupportedError
        When a package is missing, or the module is in grouped form.
    SolveError
        With `throw`, when a point was not reached; `.solution` has what was found.
    """
    inputs = read_inputs(
        module, t, p, guess, TOLERANCE, MAX_ITERATIONS, None, through, may_move=True
    )
    code = inputs.code
    dynamics, names = dynamics_of(code), code.coordinates
    _check(inputs, rtol, atol, max_step)
    held = given_values(names, position, 0, "position")
    rates = {}
    if isinstance(velocity, Mapping):
        known = (*names, *moving(code)[1]) if code.covers.size else names
        rates = given_values(known, velocity, 1, "velocity")
        velocity = None
    elif velocity is not None and np.shape(velocity) != (len(names),):
        raise InputError(
            f"velocity has shape {np.shape(velocity)}, expected ({len(names)},): a velocity for "
            f"each of {listed(names)}, or a dict of those that are given."
        )
    with np.errstate(all="ignore"):
        equations = Equations(inputs, dynamics)
        watch = Watch(equations, inputs, events, stops, smooth=through is not None)
        integration = Integration(equations, inputs, watch, progress)
        try:
            first = float(inputs.t[0])
            point = position_at(equations, inputs.guess, first, held)
            equations.measure_at(point.q, first)
            state = velocity_at(equations, point, rates, velocity)
        except NotAssembledError as error:
            integration.never_began(str(error))
        else:
            integration.run(np.concatenate((point.q, state, [0.0])), method, rtol, atol, max_step)
    solution = _solution(inputs, integration)
    if throw and not solution.success:
        raise SolveError(solution.message, solution)
    return solution


def _check(inputs: Inputs, rtol: Any, atol: Any, max_step: Any) -> None:
    """Refuse tolerances and names that cannot be."""
    problems = [
        f"{name} is {value!r}: give a positive number."
        for name, value in (("rtol", rtol), ("atol", atol), ("max_step", max_step))
        if value is not None and not (isinstance(value, int | float | np.number) and value > 0)
    ]
    times, names = inputs.t, inputs.code.outputs
    if times.size < 2 or times[0] == times[-1]:
        problems.append("t has no span: give the time of the start and at least one other time.")
    if taken := {*ADDED}.intersection((*names, *inputs.code.coordinates)):
        problems.append(
            f"{inputs.code.name} has the name {min(taken)!r}, which is that of a column of a "
            "simulation: rename it."
        )
    if problems:
        raise InputError(problems)


def _solution(inputs: Inputs, found: Integration) -> Solution:
    """Return the motion, with its energies as columns."""
    code = inputs.code
    names = ("t", "q", "q_dot", "q_ddot", "status", "residual", "statistics", "events")
    beyond = replace(inputs, t=found.t).limits_left(found.q, 4)
    solution = Solution(
        iterations=found.steps,
        message=f"{found.message} {beyond}".rstrip(),
        success=bool((found.status == Status.CONVERGED).all()),
        **{name: getattr(found, name) for name in names},
        **inputs.about(),
    )
    length = code.units[code.coordinates[code.bodies[0][1]]] if code.bodies else ""
    energy, metres = force_units(length)[2], METRES.get(length, 1.0)
    units = dict(zip(ADDED, (energy, energy, energy, ""), strict=True))
    energies = (metres * item for item in (found.kinetic, found.work, found.energy_drift))
    columns = np.stack((*energies, found.drift), axis=-1)
    return solution.observing(solution.observed.joined(ADDED, units, columns))


def given_values(
    known: Sequence[str], given: Mapping[str, Any] | None, order: int, what: str
) -> dict[str, float]:
    """Return values by name, of rates with or without ``_dot``; refuse other names and values."""
    found: dict[str, float] = {}
    problems = []
    for key, value in mapping_of(given, what).items():
        name = column_name(str(key))
        if order and name not in known:
            name = name.removesuffix(rate("", order))
        if name not in known:
            near = suggestion(name, known) or "."
            problems.append(f"{what}: there is no coordinate {key!r}{near}")
        elif not (isinstance(value, int | float | np.number) and np.isfinite(value)):
            problems.append(f"{what} of {key!r} is {value!r}: give a finite number.")
        else:
            found[name] = float(value)
    if problems:
        problems[-1] += f" There are {listed(known)}."
        raise InputError(problems)
    return found


class NotAssembledError(Exception):
    """No position was found, or no velocity; the sentence says what is missed."""


def position_at(equations: Equations, guess: Array, t: float, given: Mapping[str, float]) -> Point:
    """Return the position near a guess at which the constraints hold and some values are given.

    A `NotAssembledError` says what is missed where there is none.
    """
    names, q = equations.code.coordinates, guess.copy()
    held = [names.index(name) for name in given]
    q[held] = list(given.values())
    attempt = nearest(equations.joints, t, q, held)
    if attempt.status is not Status.CONVERGED:
        point = None if attempt.status is Status.NOT_FINITE else attempt.last
        raise NotAssembledError(_unmet(equations, point, list(given)))
    return attempt.last


def _unmet(equations: Equations, point: Point | None, fixed: Sequence[str]) -> str:
    """Say which equation is missed most."""
    if point is None:
        return "an equation has no finite value there: give a guess nearer to the mechanism."
    row = int(np.argmax(np.abs(point.Phi) * equations.joints.weights()))
    given = f" with {listed(fixed)} as given" if fixed else ""
    return (
        f"no position was found{given}: nearest, {missed(equations.joints, point, row)}. Give a "
        "guess nearer to the assembled mechanism, or values that it can have."
    )


def velocity_at(
    equations: Equations, point: Point, given: Mapping[str, float], wanted: Values
) -> Array:
    """Return velocities that the constraints allow, nearest to those wanted (n,), or else to rest.

    Those that are given by name, rates of coordinates or columns of `moving`, are held; a
    `NotAssembledError` says where they contradict the constraints.
    """
    q, t, n = point.q, point.t, point.q.size
    scale, weights = equations.scale, equations.joints.weights()
    rows = _rates(equations, point, list(given))
    near = np.zeros(n) if wanted is None else np.asarray(wanted, dtype=np.float64)
    sizes = np.abs(rows * scale).max(axis=1, initial=0.0)
    asked = 1 / np.where(sizes > 0, sizes, 1.0)
    matrix = np.vstack((weights[:, np.newaxis] * point.Phi_q, asked[:, np.newaxis] * rows)) * scale
    values = np.array(list(given.values()))
    sides = np.concatenate((weights * equations.joints.nu(q, t), asked * values))
    sides = sides - matrix @ (near / scale)
    _, sizes, right = np.linalg.svd(matrix)
    rank = int((sizes > RANK * sizes[:1]).sum())
    found = np.linalg.lstsq(matrix, sides, rcond=RANK)[0]
    free = right[rank:].T
    inertia = scale[:, np.newaxis] * equations.inertia(q, t) * scale
    if free.size:
        reduced = free.T @ inertia @ free
        found = found - free @ np.linalg.lstsq(reduced, free.T @ inertia @ found, rcond=None)[0]
    rest = np.abs(matrix @ found - sides)
    level = np.abs(matrix) @ np.abs(found) + np.abs(sides)
    if (rest > HALF * level.max(initial=0.0)).any():
        raise NotAssembledError(
            f"the velocities of {listed(given)} cannot all be as given: constraints connect them. "
            f"Give those of as many coordinates as there are degrees of freedom, such as "
            f"{listed(equations.names_free) or 'none, for drivers determine all'}."
        )
    return np.asarray(near + scale * found)


def moving(code: Compiled) -> tuple[Compiled, tuple[str, ...]]:
    """Return what has velocities beside the coordinates: angular velocities in space."""
    points = code.points()
    return points, tuple(name for name in points.outputs if name.startswith("omega_"))


def _rates(equations: Equations, point: Point, names: Sequence[str]) -> Array:
    """Return how velocities depend on those of the coordinates, shape (k, n).

    An angular velocity is linear in them: its values at unit rates are its coefficients.
    """
    n, own = point.q.size, equations.code.coordinates
    rows = np.zeros((len(names), n))
    for k, name in enumerate(names):
        if name in own:
            rows[k, own.index(name)] = 1.0
            continue
        points = equations.code.points()
        place, unit = points.outputs.index(name), np.eye(n)
        q, t = np.broadcast_to(point.q, (n, n)), np.full(n, point.t)
        rows[k] = np.asarray(points.observe(q, unit, 0 * unit, t, equations.parameters)[0])[
            :, place
        ]
    return rows

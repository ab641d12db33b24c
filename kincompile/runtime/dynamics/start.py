"""The state from which a motion begins: positions and velocities that the constraints allow.

What is given is held. Of what is left open, coordinates are those nearest to the guess, and the
velocities those of the least kinetic energy: a mechanism without given velocities is at rest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import HALF, RANK
from kincompile.errors import InputError
from kincompile.names import column_name, listed, rate, suggestion
from kincompile.runtime.inputs import mapping_of
from kincompile.runtime.problem import nearest
from kincompile.runtime.singular.reach import missed
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.runtime.dynamics.equations import Equations
    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.engine.scales import Point
    from kincompile.runtime.inputs import Values


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
    sides = np.concatenate((weights * equations.nu(q, t), asked * values))
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

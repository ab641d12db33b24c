"""Equations that hold freedoms which nothing sees.

A spin is held by an equation that is linear in Euler parameters. With the relative orientation r of
a body, as Euler parameters, each c with c^T r = 0 chooses one spin for every direction of the axis
but one, where it is singular: opposite to the direction that c itself has. No choice of one spin is
regular for all directions. So c is chosen, and the body that r is relative to, such that the axis
stays far from there, as far as the motion can be followed.
"""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import sympy

from kincompile.ir.redundancy import driver_rows, evaluation
from kincompile.model.resolve import SPIN, FreeEquation
from kincompile.structure.choice import along_motion
from kincompile.structure.idle import Web
from kincompile.structure.rank import ANGLES_FIRST, DEPENDENT, drivers_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.ir.program import Program
    from kincompile.model.bodies import Body
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.idle import Loose
    from kincompile.structure.rank import RankReport

    Array = NDArray[np.float64]
    Parts = Sequence[Any] | NDArray[Any]

SPACE = 3
"""Components of a point of a body in space, whose other coordinates are Euler parameters."""
DIGITS = 3
"""Decimals of the numbers in an equation that holds: any do, and few are readable."""
RATHER = 0.3
"""By how much farther from singular than the ground another body keeps an axis that it holds."""
TIMES = 16
"""Positions along the motion at which the direction of an axis is looked at."""
OPPOSITE = 1e-3
"""1 + cos of the angle between directions, below which they are opposite."""


def holding(
    system: ConstraintSystem,
    program: Program,
    ranks: RankReport,
    motions: Array,
    loose: Mapping[str, Loose],
) -> list[FreeEquation]:
    """Return equations that hold motions (k, n), in scales, about as they are at the start.

    `loose` are the bodies that may turn, by geometry.
    """
    names = [item.name for item in system.coordinates]
    spins = spins_of(system, ranks.state[0][0])
    solids = {body.name: body for body in system.bodies if body.name in spins}
    turns = {name for body in solids.values() for name in body.coordinates[SPACE:]}
    web = Web.of(system)
    rows, weights = list[Any](), list[float]()
    wanted: list[tuple[str, Array | None]] = []
    for name, row, item in zip(names, np.eye(len(names)), system.coordinates, strict=True):
        if name not in turns:
            rows.append(row)
            weights.append(ANGLES_FIRST if item.unit == "rad" else 1.0)
            wanted.append((name, None))
    for body in solids:
        axes = loose[body].directions if body in loose else np.eye(3)
        for axis in axes:
            row = axis @ spins[body] * ranks.scale
            rows.append(row / np.linalg.norm(row))
            weights.append(ANGLES_FIRST * (ANGLES_FIRST if len(axes) == 1 else 1.0))
            wanted.append((body, axis if len(axes) == 1 else None))
    taken, _ = drivers_of(motions, np.array(rows), np.array(weights))
    path = _path(system, program, ranks, motions)
    moving = np.abs(motions).max(axis=0) > DEPENDENT
    still = {
        body.name
        for body, columns in zip(system.bodies, system.body_columns, strict=True)
        if not moving[list(columns)].any()
    }
    found: list[FreeEquation] = []
    for k in taken:
        name, axis = wanted[k]
        if name in solids:
            turning = spins[name] @ (motions.T @ (motions @ rows[k]) * ranks.scale)
            axis = turning / np.linalg.norm(turning) if axis is None else axis
            others = [solids[x] for x in sorted(web.others[name] & still)]
            expression = _spin(names, solids[name], axis, others, path)
            holds = f"{SPIN}{name}"
        else:
            expression, holds = sympy.Symbol(name) - _rounded(path[0, names.index(name)]), name
        found.append(_equation(system, found, name, expression, holds))
    return found


def _equation(
    system: ConstraintSystem,
    others: Sequence[FreeEquation],
    name: str,
    expression: sympy.Expr,
    holds: str,
) -> FreeEquation:
    """Return an equation beside others, under a name of its own."""
    taken = {item.name for item in (*system.constraints, *others)}
    titles = (f"held_{name}" + (f"_{k}" if k > 1 else "") for k in count(1))
    title = next(x for x in titles if x not in taken)
    symbols = {str(x) for x in expression.free_symbols}
    columns = tuple(x.name for x in system.coordinates if x.name in symbols)
    return FreeEquation(title, (expression,), columns, (title,), "held", holds=holds)


def _rounded(number: float) -> sympy.Float:
    return sympy.Float(round(float(number), DIGITS) + 0.0)


def spins_of(system: ConstraintSystem, q: Array) -> dict[str, Array]:
    """Return angular velocities of bodies in space, in their components, by rates, (3, n) each."""
    found = {}
    for body, columns in zip(system.bodies, system.body_columns, strict=True):
        if body.kind.frame.size == SPACE:
            found[body.name] = np.zeros((3, q.size))
            found[body.name][:, columns[SPACE:]] = spin_rows(q[columns[SPACE:]])
    return found


def spin_rows(p: Array) -> Array:
    """Return 2 G (3, 4): the angular velocity in the body's components by rates of p (4,)."""
    return 2 * np.array([product(_inverse(p), unit)[1:] for unit in np.eye(4)]).T


def _path(system: ConstraintSystem, program: Program, ranks: RankReport, held: Array) -> Array:
    """Return positions, the start first: along the motion, or where drivers may lead from it."""
    start, evaluate, end = ranks.nearest, evaluation(program), float(system.end)
    Phi = evaluate(np.array([start, start]), np.array([0.0, end / TIMES]))[0]
    if (Phi[0] != Phi[1]).any():
        return np.array([start, *(q for q, _ in along_motion(evaluate, ranks, end, TIMES))])
    matrix = evaluate(start[np.newaxis], np.zeros(1))[1][0] * ranks.scale
    joints = np.vstack([np.delete(matrix, driver_rows(system), axis=0), held])
    _, values, tangents = np.linalg.svd(joints)
    free = tangents[np.sum(values > DEPENDENT * values.max()) :]
    free = free / np.abs(free).max(axis=1, keepdims=True)
    return np.vstack([start, *(start + side * ranks.scale * free for side in (1, -1))])


def _spin(
    names: Sequence[str], body: Body, axis: Array, others: Sequence[Body], path: Array
) -> sympy.Expr:
    """Return what is zero while a body keeps its spin about an axis of its own."""
    at = {x.name: path[:, [names.index(k) for k in x.coordinates[SPACE:]]] for x in (body, *others)}
    turned = {name: p / np.linalg.norm(p, axis=1, keepdims=True) for name, p in at.items()}
    symbols = {x.name: [sympy.Symbol(k) for k in x.coordinates[SPACE:]] for x in (body, *others)}
    own, given = turned[body.name].T, symbols[body.name]
    choices: list[tuple[float, Array, Parts]] = [(*_choice(own, axis, RATHER), given)]
    for other in others:
        relative = product(_inverse(turned[other.name].T), own)
        expressions = product(_inverse(symbols[other.name]), given)
        choices.append((*_choice(relative, axis, 0.0), expressions))
    _, c, parts = max(choices, key=lambda x: x[0])
    terms = (_rounded(number) * x for number, x in zip(c, parts, strict=True))
    return cast("sympy.Expr", sympy.expand(sympy.Add(*terms)))


def _choice(r: Parts, axis: Array, more: float) -> tuple[float, Array]:
    """Return how far from singular orientations r, four of (S,), stay, plus more; and c (4,)."""
    u = (0.0, *axis)
    directions = np.array(product(product(r, u), _inverse(r))[1:]).T
    mean, normal = directions.mean(axis=0), np.linalg.svd(directions, full_matrices=False)[2][-1]
    middles = [x / np.linalg.norm(x) for x in (mean, normal, -normal, directions[0]) if x.any()]
    margins = [float((directions @ x).min()) for x in middles]
    margin = max(margins)
    to = middles[margins.index(margin)]
    half = np.array([1 + axis @ to, *np.cross(axis, to)])
    if not half[0] > OPPOSITE:  # half a turn, about anything across
        half = np.array([0.0, *np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])])
    beside, start = np.array(product(half, u)), np.array([x[0] for x in r])
    c = (start @ beside) * half - (start @ half) * beside
    return margin + more, c / np.linalg.norm(c)


def product(a: Parts, b: Parts) -> tuple[Any, ...]:
    """Return the Euler parameters of one rotation after another, A(a) A(b)."""
    (a0, a1, a2, a3), (b0, b1, b2, b3) = a, b
    return (
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
        a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
    )


def _inverse(p: Parts) -> tuple[Any, ...]:
    """Return the Euler parameters of the rotation back."""
    return p[0], -p[1], -p[2], -p[3]

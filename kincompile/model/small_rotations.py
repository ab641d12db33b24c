"""Haug's r-omega form of a system in space: columns of r and of small rotations pi'.

A small rotation about the body's own axes by pi' changes the Euler parameters by dp = G^T pi'/2, so
that A changes by A pi'~. Phi_q then has six columns a body, Phi_r and Phi_pi' = Phi_p G^T/2, the
norm rows vanish, and gamma belongs to (r_ddot, omega'_dot).

Joints are differentiated by the rules of the vector calculus, free equations by SymPy.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import sympy

from kincompile.calculus.space import TurnedFrame
from kincompile.derive.equations import derive_equation
from kincompile.model.matrices import EquationRow, joint_rows
from kincompile.model.resolve import FreeEquation, Joint
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.calculus.symbols import Frame
    from kincompile.model.bodies import Body
    from kincompile.model.system import ConstraintSystem


BY_P, BY_OMEGA = "r-p", "r-omega"
"""The names of the two forms."""


def is_norm(constraint: Joint | FreeEquation) -> bool:
    """Return whether a constraint is the norm row of a body, which small rotations keep."""
    return constraint.name in {f"norm_{body.name}" for body in constraint.bodies}


def turned_columns(body: Body) -> tuple[str, ...]:
    """Return the names of the columns of a body: x, y, z and pi' in its own frame."""
    return tuple(f"{letter}_{body.name}" for letter in TurnedFrame.letters)


def spin_names(body: Body) -> tuple[str, ...]:
    """Return the names of the components of omega' of a body, in its own frame."""
    return tuple(name for name, _, _ in body.on_request[3:])


def turned_joint(joint: Joint) -> Joint:
    """Return a joint whose formulas are derivatives by r and pi'.

    p and omega' are vectors of its formulas that are known by name, as its points are.
    """
    points, columns = dict(joint.points), list[str | None]()
    frames: list[Frame] = []
    for frame, body in zip(joint.template.frames, joint.bodies, strict=True):
        frames.append(TurnedFrame(frame.index))
        points[f"p_{frame.index}"] = body.symbols[3:]
        spins = map(sympy.Symbol, spin_names(body))
        points[f"omega_{frame.index}"] = (0,) * 3 if body.is_ground else tuple(spins)
        columns += [None] * 6 if body.is_ground else turned_columns(body)
    columns += joint.columns[sum(len(body.coordinates) for body in joint.bodies) :]
    template = replace(joint.template, frames=tuple(frames))
    return replace(joint, template=template, points=points, columns=tuple(columns))


def turned_constraints(system: ConstraintSystem) -> tuple[Joint | FreeEquation, ...]:
    """Return the constraints of a system in space without norm rows, joints by r and pi'."""
    return tuple(
        turned_joint(item)
        if isinstance(item, Joint)
        else replace(item, columns=_with_turns(item.columns, system.bodies))
        for item in system.constraints
        if not is_norm(item)
    )


def _with_turns(columns: Sequence[str], bodies: Sequence[Body]) -> tuple[str, ...]:
    """Return the columns of a free equation, all pi' of a body in place of any of its p."""
    turns = {name: turned_columns(body)[3:] for body in bodies for name in body.coordinates[3:]}
    return tuple(dict.fromkeys(new for name in columns for new in turns.get(name, (name,))))


def turned_rows(
    constraints: Sequence[Joint | FreeEquation], bodies: Sequence[Body]
) -> list[EquationRow]:
    """Return the rows of such constraints as SymPy expressions of p and omega'."""
    rows: list[EquationRow] = []
    for item in constraints:
        if isinstance(item, Joint):
            rows += joint_rows(item)
        else:
            rows += (_free_row(expression, item, bodies) for expression in item.expressions)
    return rows


def _free_row(
    expression: sympy.Expr, equation: FreeEquation, bodies: Sequence[Body]
) -> EquationRow:
    turns = {name for body in bodies for name in turned_columns(body)[3:]}
    parameters = [name for body in bodies for name in body.coordinates[3:]]
    columns = [*(name for name in equation.columns if name not in turns), *parameters]
    found = derive_equation(expression, columns)
    entries = dict(zip(columns, found.Phi_q, strict=True))
    gamma, rates = found.gamma, dict[sympy.Expr, sympy.Expr]()
    for body in bodies:
        names = body.coordinates[3:]
        p_dot = [sympy.Symbol(rate(name)) for name in names]
        spins = sympy.Matrix([spin for _, spin, _ in body.on_request[3:]])  # 2 G p_dot
        half_g = spins.jacobian(p_dot) / 4
        omega = sympy.Matrix(sympy.symbols(spin_names(body)))
        by_p = sympy.Matrix([entries.pop(name, 0) for name in names])
        entries |= dict(zip(turned_columns(body)[3:], half_g * by_p, strict=True))
        rates |= dict(zip(p_dot, half_g.T * omega, strict=True))
        gamma += omega.dot(omega) / 4 * by_p.dot(sympy.Matrix(body.symbols[3:]))
    return EquationRow(found.Phi, entries, found.nu, gamma.xreplace(rates))

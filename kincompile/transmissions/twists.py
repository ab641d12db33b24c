"""Outputs that are velocities, such as the angular velocity of a body, whose Jacobian has no x.

The components of a twist are linear in the rates of coordinates, B(q) q_dot, so their Jacobian is
B S with the slopes S of the coordinates by the inputs; but they are the rates of nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.criteria import probe_of
from kincompile.errors import InputError
from kincompile.ir.interpret import interpret
from kincompile.model.outputs import Output
from kincompile.model.points import rate
from kincompile.names import rate as rate_name
from kincompile.structure.rank import DEPENDENT

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from numpy.typing import NDArray

    from kincompile.ir.program import Program
    from kincompile.model.system import ConstraintSystem

    Array = NDArray[np.float64]


def with_spins(system: ConstraintSystem, outputs: Sequence[str]) -> ConstraintSystem:
    """Return the system with the angular velocities that are named among the outputs."""
    there = {item.name for item in system.outputs}
    spins = {given[0]: given for body in system.bodies for given in body.on_request}
    wanted = [x for x in dict.fromkeys(outputs) if x in spins and x not in there]
    if not wanted:
        return system
    return system.rewritten(system.constraints, [], None, [Output(*spins[x]) for x in wanted])


def twists_in(system: ConstraintSystem, names: Sequence[str]) -> tuple[str, ...]:
    """Return the outputs that read velocities."""
    rates = {rate_name(x.name, order) for x in system.coordinates for order in (1, 2)}
    expressions = {x.name: sympy.sympify(x.expression) for x in system.outputs}

    def reads(name: str) -> bool:
        found = expressions.get(name, sympy.Integer(0))
        symbols = {x.name for x in found.free_symbols if isinstance(x, sympy.Symbol)}
        return found.has(rate) or not rates.isdisjoint(symbols)

    return tuple(name for name in names if reads(name))


def require_linear(
    system: ConstraintSystem,
    program: Program,
    twists: Sequence[str],
    state: tuple[Array, Any],
) -> None:
    """Refuse outputs that read velocities and are not linear in them, at a generic state."""
    if not twists:
        return
    one = probe_of(state[0].shape[-1])
    other = one[::-1]
    rates = np.array([0 * one, one, other, one + other])
    q, t = np.repeat(state[0], 4, axis=0), np.repeat(state[1], 4)
    with np.errstate(all="ignore"):
        moved, pushed = (
            interpret(program, q, rates, t, None, q_ddot)[4] for q_ddot in (None, rates)
        )
    names = [item.name for item in system.outputs]
    for name in twists:
        own = moved[:, names.index(name)]
        apart = max(abs(own[0]), abs(own[1] + own[2] - own[3]))
        apart = max(apart, np.abs(own - pushed[:, names.index(name)]).max())
        if not apart <= DEPENDENT * np.abs(own).max():
            raise InputError(
                f"the output {name!r} of {system.name} reads velocities and is not linear in them, "
                "so it has no Jacobian: choose positions, or components of velocities such as "
                "omega_x_<body>."
            )

"""Phi_q, nu and gamma of free SymPy equations, differentiated by the symbols that occur in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy

from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Sequence

_T = sympy.Symbol("t")


@dataclass(frozen=True, slots=True)
class EquationDerivatives:
    r"""Derivatives of one free equation; the letters are those of `RowBlock`."""

    Phi: sympy.Expr
    Phi_q: tuple[sympy.Expr, ...]
    velocity: sympy.Expr
    nu: sympy.Expr
    gamma_terms: tuple[sympy.Expr, sympy.Expr, sympy.Expr]
    gamma: sympy.Expr


def derive_equation(Phi: sympy.Expr, columns: Sequence[str]) -> EquationDerivatives:
    """Differentiate a free equation by the coordinates named in `columns` and by time."""
    q = [sympy.Symbol(name) for name in columns]
    q_dot = [sympy.Symbol(rate(name)) for name in columns]
    Phi_q = [Phi.diff(symbol) for symbol in q]
    Phi_t = Phi.diff(_T)
    velocity = sympy.Add(*(entry * speed for entry, speed in zip(Phi_q, q_dot, strict=True)))
    terms = (
        -sympy.Add(
            *(velocity.diff(symbol) * speed for symbol, speed in zip(q, q_dot, strict=True))
        ),
        -2 * velocity.diff(_T),
        -Phi_t.diff(_T),
    )
    return EquationDerivatives(Phi, tuple(Phi_q), velocity, -Phi_t, terms, sympy.Add(*terms))

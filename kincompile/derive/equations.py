"""Phi_q, nu and gamma of free SymPy equations, differentiated by the symbols that occur in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy
from sympy.functions.elementary.hyperbolic import HyperbolicFunction

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
    Phi_q = [derivative(Phi, symbol) for symbol in q]
    Phi_t = derivative(Phi, _T)
    velocity = sympy.Add(*(entry * speed for entry, speed in zip(Phi_q, q_dot, strict=True)))
    terms = (
        -sympy.Add(*(derivative(velocity, x) * speed for x, speed in zip(q, q_dot, strict=True))),
        -2 * derivative(velocity, _T),
        -derivative(Phi_t, _T),
    )
    return EquationDerivatives(Phi, tuple(Phi_q), velocity, -Phi_t, terms, sympy.Add(*terms))


def derivative(expression: sympy.Expr, symbol: sympy.Symbol) -> sympy.Expr:
    """Return the derivative of an expression by a symbol.

    SymPy's own asks if a derivative is zero, and if what it multiplies by zero is finite: of a long
    hyperbolic cosine it takes minutes to say.
    """
    if not expression.has(symbol):
        return sympy.S.Zero
    if isinstance(expression, sympy.Add):
        return sympy.Add(*(derivative(term, symbol) for term in expression.args))
    if isinstance(expression, sympy.Mul):
        factors = expression.args
        rates = ((k, derivative(factor, symbol)) for k, factor in enumerate(factors))
        terms = (sympy.Mul(*factors[:k], rate, *factors[k + 1 :]) for k, rate in rates if rate != 0)
        return sympy.Add(*terms)
    if isinstance(expression, HyperbolicFunction):
        return sympy.Mul(expression.fdiff(), derivative(expression.args[0], symbol))
    found: sympy.Expr = expression.diff(symbol)
    return found

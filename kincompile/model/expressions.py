"""Numbers and SymPy expressions as users give them, and which of them are allowed."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from functools import lru_cache
from numbers import Integral, Rational, Real
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import mpmath
import numpy as np
import sympy
from numpy.typing import NDArray
from sympy.core.function import AppliedUndef
from sympy.core.relational import Relational
from sympy.core.singleton import Singleton
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import BooleanAtom, BooleanFunction

from kincompile.model.laws import MotionLaw
from kincompile.model.piecewise import gap_problem
from kincompile.model.spline import PeriodicSpline
from kincompile.names import listed, suggestion

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

CALCULATED = mpmath.MPContext()  # type: ignore[attr-defined,no-untyped-call]
"""Functions of floats for numbers that stand in emitted text. Their digits are the same on every
processor, which those of `math` are not, and whatever precision mpmath is set to."""

t = sympy.Symbol("t")
"""Time. The same symbol as `sympy.physics.mechanics.dynamicsymbols._t`."""

pi = sympy.pi


class Degree(sympy.NumberSymbol, metaclass=Singleton):
    """The degree, pi/180, as a number of its own: so a length can tell that it is in degrees."""

    is_real = True
    is_positive = True
    is_irrational = True
    is_number = True

    def _as_mpf_val(self, prec: int) -> Any:
        with mpmath.workprec(prec):
            return (mpmath.pi / 180)._mpf_

    def approximation_interval(self, number_cls: type) -> None:
        """Return no bounds: SymPy compares by the value."""

    def _sympystr(self, printer: Any) -> str:
        return "deg"

    def _latex(self, printer: Any) -> str:
        return r"^{\circ}"


deg: sympy.Expr = Degree()  # type: ignore[no-untyped-call]
"""One degree, in the radians in which every angle is counted."""

alpha = sympy.Symbol("alpha")
"""The polar angle of a cam profile rho(alpha)."""

Scalar: TypeAlias = int | float | sympy.Expr

Scalars: TypeAlias = Sequence[Scalar] | NDArray[np.float64]
"""Several in order: a point (xi, eta), a guess (x, y, phi)."""

SMOOTH = (
    sympy.sin, sympy.cos, sympy.tan, sympy.cot, sympy.sec, sympy.csc,
    sympy.asin, sympy.acos, sympy.atan, sympy.atan2,
    sympy.sinh, sympy.cosh, sympy.tanh, sympy.asinh, sympy.acosh, sympy.atanh,
    sympy.exp, sympy.log, sympy.Piecewise, PeriodicSpline,
)  # fmt: skip
"""Functions that can be differentiated as often as needed and printed by every target."""

NOT_SMOOTH = (
    sympy.Abs, sympy.sign, sympy.floor, sympy.ceiling, sympy.frac, sympy.Heaviside,
    sympy.DiracDelta, sympy.Min, sympy.Max, sympy.Mod,
)  # fmt: skip

_KNOWN = (
    sympy.Symbol, sympy.Number, sympy.NumberSymbol, sympy.Add, sympy.Mul, sympy.Pow,
    sympy.Function, Relational, BooleanFunction, BooleanAtom, ExprCondPair,
)  # fmt: skip


_LARGEST = sys.float_info.max


class NotAnExpressionError(ValueError):
    """A value that is neither a finite real number nor a SymPy expression; it says what it is."""


def as_expression(value: object) -> Scalar:
    """Return a number as int or float, anything else as a SymPy expression."""
    if (type(value) is float or type(value) is int) and -_LARGEST <= value <= _LARGEST:
        return value  # the common case, and the cheapest
    if isinstance(value, bool):
        raise NotAnExpressionError(f"{value} is a truth value, not a number")
    if isinstance(value, Integral | Rational):
        _require_range(value)
        if isinstance(value, Integral):
            return int(value)
        fraction: sympy.Rational = sympy.Rational(value.numerator, value.denominator)
        return fraction
    if isinstance(value, Real) and not isinstance(value, sympy.Expr):
        if not math.isfinite(value):
            raise NotAnExpressionError(f"{float(value)} is not finite")
        return float(value)
    if isinstance(value, sympy.Eq):
        value = value.lhs - value.rhs
    if not isinstance(value, sympy.Expr) or isinstance(value, sympy.Lambda):
        raise NotAnExpressionError(f"{value!r} is not a number or a SymPy expression")
    if isinstance(value, sympy.Float):
        _require_range(value)
    if value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
        raise NotAnExpressionError(f"{value} is not finite")
    if value.has(sympy.I) or (value.is_number and value.is_real is False):  # asin(2) has no I
        raise NotAnExpressionError(f"{value} is not real")
    return _by_name(value)


def _require_range(value: Rational | sympy.Float) -> None:
    """Refuse an exact number that no float can hold."""
    try:
        is_in_range = math.isfinite(float(value))
    except OverflowError:
        is_in_range = False
    if not is_in_range:
        raise NotAnExpressionError("the number is beyond 1e308, the range of floats")


def as_sympy(value: Scalar) -> sympy.Expr:
    """Return a number or an expression as an expression; text is refused, it would be run."""
    if isinstance(value, sympy.Expr):
        return value
    return sympy.Integer(value) if isinstance(value, int) else sympy.Float(value)


def _by_name(expression: sympy.Expr) -> sympy.Expr:
    """Replace symbols with assumptions, and functions of time, by plain symbols of their names."""
    functions = {
        applied: sympy.Symbol(applied.func.__name__) for applied in _functions_of_time(expression)
    }
    if functions:
        expression = expression.xreplace(functions)
    plain = {symbol: sympy.Symbol(symbol.name) for symbol in _symbols(expression)}
    changed = {symbol: other for symbol, other in plain.items() if symbol != other}
    return expression.xreplace(changed) if changed else expression


def _symbols(expression: sympy.Expr) -> set[sympy.Symbol]:
    """Return the scalars among the free symbols; matrices and indexed names are refused later."""
    return {symbol for symbol in expression.free_symbols if isinstance(symbol, sympy.Symbol)}


def _functions_of_time(expression: sympy.Expr) -> set[AppliedUndef]:
    """Return x(t), ... where there are no derivatives: Derivative(x(t), t) stays, to be refused."""
    if expression.has(sympy.Derivative):
        return set()
    return {applied for applied in expression.atoms(AppliedUndef) if str(applied.args) == "(t,)"}


@lru_cache(maxsize=1024)
def symbol_names(value: Scalar) -> frozenset[str]:
    """Return the names of the symbols in an expression."""
    if not isinstance(value, sympy.Expr):
        return frozenset()
    return frozenset(symbol.name for symbol in _symbols(value))


_ELEMENTARY = "write it with elementary functions"


@lru_cache(maxsize=1024)
def smoothness_problem(
    value: Scalar, *, corners: bool = False, known: tuple[type[sympy.Function], ...] = ()
) -> str | None:
    """Return a message about a function that cannot be differentiated or emitted, or None.

    With `corners` the slope may jump from one time to the next; `known` are functions that are
    allowed beside those of `SMOOTH`.
    """
    if not isinstance(value, sympy.Expr):
        return None
    if value.has(sympy.Derivative):
        return (
            f"{value} contains a time derivative; a constraint Phi(q, t) may contain coordinates "
            "and time only"
        )
    for node in sympy.preorder_traversal(value):
        if isinstance(node, NOT_SMOOTH):
            return (
                f"{node} has no continuous derivative; write a smooth function, or a "
                "sympy.Piecewise whose pieces meet with equal value and slope"
            )
        if isinstance(node, sympy.Piecewise) and not _has_value_everywhere(node):
            return (
                f"{node} has no value where none of its conditions holds; end it with a piece "
                "(expression, True)"
            )
        if isinstance(node, AppliedUndef):
            return f"the function {node} is not defined; give it as an expression"
        if isinstance(node, sympy.Function) and not isinstance(node, (*SMOOTH, MotionLaw, *known)):
            return f"the function {node.func.__name__} is not supported; {_ELEMENTARY}"
        if not isinstance(node, _KNOWN):
            return f"{type(node).__name__} in {value} is not supported; {_ELEMENTARY}"
    return gap_problem(value, corners=corners) if value.has(sympy.Piecewise, MotionLaw) else None


def _has_value_everywhere(node: sympy.Piecewise) -> bool:
    """Return whether the conditions are seen to cover every case, as `t < 1` and `t >= 1` do."""
    pieces = cast("tuple[ExprCondPair, ...]", node.args)
    return bool(sympy.Or(*(piece.cond for piece in pieces)) == sympy.true)


def unknown_problem(value: Scalar, declared: Collection[str], what: str) -> str | None:
    """Return a message about undeclared symbols, or None."""
    unknown = sorted(name for name in symbol_names(value) if name not in declared)
    if not unknown:
        return None
    verb = "is" if len(unknown) == 1 else "are"
    return (
        f"{what} contains {listed(unknown)}, which {verb} not declared"
        f"{suggestion(unknown[0], declared)}; declare it as a parameter or use one of: "
        f"{listed(sorted(declared))}"
    )


def in_radians(value: sympy.Expr) -> sympy.Expr:
    """Return an expression with pi/180 for every degree."""
    radians: sympy.Expr = value.xreplace({deg: pi / 180})
    return radians


def has_degrees(value: object) -> bool:
    """Return whether a degree is part of a value, not of the argument of a function in it."""
    if value is deg:
        return True
    if not isinstance(value, sympy.Basic) or not value.has(deg):
        return False
    parts = value.args
    if isinstance(value, sympy.Piecewise):
        parts = tuple(piece.expr for piece in cast("tuple[ExprCondPair, ...]", parts))
    elif isinstance(value, sympy.Function):
        return False
    return any(has_degrees(part) for part in parts)


def degrees_problem(value: object, unit: str) -> str | None:
    """Return a message about degrees in what is no angle, or None."""
    if not has_degrees(value) or not unit or str(unit).startswith(("rad", "deg")):
        return None
    what = "a length" if unit == "length" else f"in {unit}"
    return (
        f"{value} is in degrees, and this is no angle but {what}; write an arc as its radius times "
        "the angle in radians, pi/180 for a degree"
    )


def evaluate(value: Scalar, values: dict[str, float]) -> float | None:
    """Return the value of an expression at values of its symbols; None if it is not a number."""
    if not isinstance(value, sympy.Expr):
        return float(value)
    names = symbol_names(value)
    if names - set(values):
        return None
    numbers = {sympy.Symbol(name): sympy.Float(values[name]) for name in names}
    value = in_radians(value)
    try:
        number = value.xreplace(numbers).evalf()
        is_number = number.is_number and number.is_real and math.isfinite(float(number))
        return float(number) if is_number else None
    except OverflowError:  # exp(exp(exp(9)))
        return None


def number_in(value: Scalar, unit: str, values: dict[str, float]) -> float | None:
    """Return the number an expression is in a unit: what is counted in degrees stays in them."""
    if isinstance(value, sympy.Expr) and unit.startswith("deg"):
        value = cast("sympy.Expr", value.xreplace({deg: sympy.S.One}))
    return evaluate(value, values)


def depends_on(value: Scalar, names: Iterable[str]) -> bool:
    """Return whether any of the names occurs in an expression."""
    return not symbol_names(value).isdisjoint(names)

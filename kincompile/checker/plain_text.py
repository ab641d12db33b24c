"""Vector expressions as plain text, in the notation of the textbook: A_i s_i, B_j s_j w_j^2."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.calculus import expressions as ex
from kincompile.calculus.rotations import PlaneRotation
from kincompile.calculus.space import EulerRotation

if TYPE_CHECKING:
    from fractions import Fraction


def described(expression: ex.Expression) -> str:
    """Return an expression as plain text."""
    match expression:
        case ex.Number(value):
            return str(value)
        case ex.Pi():
            return "pi"
        case ex.Symbol(name):
            return _symbol(name)
        case ex.TimeFunction(name, order) | ex.ProfileFunction(name, _, order):
            return name + "'" * order
        case ex.Sum(terms) | ex.VectorSum(terms):
            return _sum([described(term) for term in terms]) if terms else "0"
        case ex.Product(factors):
            return _product(factors)
        case ex.Power(base, exponent):
            return f"{_factor(base)}^{exponent}"
        case ex.Norm(vector):
            return f"|{described(vector)}|"
        case ex.Circular(name, argument):
            return f"{name}({described(argument)})"
        case ex.Angle(sine, cosine):
            return f"atan2({described(sine)}, {described(cosine)})"
        case ex.Dot(left, right):
            return f"({described(left)})^T {_factor(right)}"
        case ex.VectorSymbol(name):
            return f"{name}'" if name.startswith(("omega_", "pi_")) else name
        case ex.Basis(axis, size):
            return f"e_{'xyz'[axis]}" if size < 4 else f"e_{axis}"
        case ex.Rotated(EulerRotation(p), vector, along):
            if not along:
                return f"A_{p.name.removeprefix('p_')} {_factor(vector)}"
            first, last = (p, *along)[-2:]
            return f"B({described(first)}, {described(vector)}) {_factor(last)}"
        case ex.RotationSlope(EulerRotation(p), vector, True):
            return f"A_{p.name.removeprefix('p_')} {_factor(vector)}~"
        case ex.Cross(left, right):
            return f"{_factor(left)}~ {_factor(right)}"
        case ex.TimesG(p, vector, is_transposed):
            mark = "^T" if is_transposed else ""
            return f"G_{described(p).removeprefix('p_')}{mark} {_factor(vector)}"
        case ex.RotationSlope(EulerRotation(p), vector):
            return f"B({p.name}, {described(vector)})"
        case ex.RowOfSlope(left, slope):
            return f"({described(left)})^T {described(slope)}"
        case ex.Rotated(PlaneRotation(angle) as rotation, vector):
            letter = rotation.letters[expression.order]
            of_body = isinstance(angle, ex.Symbol) and angle.name.startswith("phi_")
            index = described(angle).removeprefix("phi") if of_body else f"({described(angle)})"
            return f"{letter}{index} {_factor(vector)}"
        case ex.Perpendicular(vector):
            return f"R {_factor(vector)}"
        case ex.Scaled(factor, vector):
            number, rest = ex.split_coefficient(factor)
            parts = [_number(number), *(_factor(item) for item in rest)]
            return " ".join([*filter(None, parts), _factor(vector)])
    raise TypeError(f"not an expression: {expression!r}")


def _symbol(name: str) -> str:
    """Write the angular velocity of a body as w."""
    if name.startswith("phi_") and name.endswith("_dot"):
        return f"w_{name[4]}"
    return name


def _product(factors: tuple[ex.Scalar, ...]) -> str:
    number, rest = ex.split_coefficient(ex.Product(factors))
    parts = [_number(number), *(_factor(item) for item in rest)]
    return " ".join(filter(None, parts))


def _number(number: Fraction) -> str:
    if number == 1:
        return ""
    return "-" if number == -1 else str(number)


def _sum(terms: list[str]) -> str:
    return " + ".join(terms).replace("+ - ", "- ").replace("+ -", "- ")


def _factor(expression: ex.Expression) -> str:
    text = described(expression)
    return f"({text})" if " + " in text or " - " in text[1:] else text

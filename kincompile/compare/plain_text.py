"""Vector expressions as plain text, in the notation of the textbook: A_i s_i, B_j s_j w_j^2."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.calculus.expressions import (
    Angle,
    Basis,
    Circular,
    Cross,
    Dot,
    Expression,
    Norm,
    Number,
    Perpendicular,
    Pi,
    Power,
    Product,
    ProfileFunction,
    Rotated,
    RotationSlope,
    RowOfSlope,
    Scalar,
    Scaled,
    Sum,
    Symbol,
    TimeFunction,
    TimesG,
    Vector,
    VectorSum,
    VectorSymbol,
    split_coefficient,
)
from kincompile.calculus.rotations import PlaneRotation
from kincompile.calculus.space import EulerRotation

if TYPE_CHECKING:
    from fractions import Fraction


def described(expression: Expression) -> str:
    """Return an expression as plain text."""
    if isinstance(expression, Scalar):
        return _scalar(expression)
    return _vector(expression)


def _scalar(expression: Scalar) -> str:
    match expression:
        case Number(value):
            return str(value)
        case Pi():
            return "pi"
        case Symbol(name):
            return _symbol(name)
        case TimeFunction(name, order) | ProfileFunction(name, _, order):
            return name + "'" * order
        case Sum(terms):
            return _sum([_scalar(term) for term in terms])
        case Product(factors):
            return _product(factors)
        case Power(base, exponent):
            return f"{_bracketed(_scalar(base))}^{exponent}"
        case Norm(vector):
            return f"|{_vector(vector)}|"
        case Circular(name, argument):
            return f"{name}({_scalar(argument)})"
        case Angle(sine, cosine):
            return f"atan2({_scalar(sine)}, {_scalar(cosine)})"
        case Dot(left, right):
            return f"({_vector(left)})^T {_bracketed(_vector(right))}"
    raise TypeError(f"not a scalar expression: {expression!r}")


def _vector(expression: Vector) -> str:
    match expression:
        case VectorSymbol(name):
            return f"{name}'" if name.startswith(("omega_", "pi_")) else name
        case Basis(axis, size):
            return f"e_{'xyz'[axis]}" if size < 4 else f"e_{axis}"
        case Rotated(EulerRotation(p), vector, along):
            if not along:
                return f"A_{p.name.removeprefix('p_')} {_bracketed(_vector(vector))}"
            first, last = (p, *along)[-2:]
            return f"B({described(first)}, {_vector(vector)}) {_bracketed(described(last))}"
        case RotationSlope(EulerRotation(p), vector, True):
            return f"A_{p.name.removeprefix('p_')} {_bracketed(_vector(vector))}~"
        case Cross(left, right):
            return f"{_bracketed(_vector(left))}~ {_bracketed(_vector(right))}"
        case TimesG(p, vector, is_transposed):
            mark = "^T" if is_transposed else ""
            return f"G_{_vector(p).removeprefix('p_')}{mark} {_bracketed(_vector(vector))}"
        case RotationSlope(EulerRotation(p), vector):
            return f"B({p.name}, {_vector(vector)})"
        case RowOfSlope(left, slope):
            return f"({_vector(left)})^T {_vector(slope)}"
        case Rotated(PlaneRotation(angle) as rotation, vector):
            letter = rotation.letters[expression.order]
            of_body = isinstance(angle, Symbol) and angle.name.startswith("phi_")
            index = _scalar(angle).removeprefix("phi") if of_body else f"({_scalar(angle)})"
            return f"{letter}{index} {_bracketed(_vector(vector))}"
        case Perpendicular(vector):
            return f"R {_bracketed(_vector(vector))}"
        case VectorSum(terms):
            return _sum([_vector(term) for term in terms]) if terms else "0"
        case Scaled(factor, vector):
            number, rest = split_coefficient(factor)
            parts = [_number(number), *(_bracketed(_scalar(item)) for item in rest)]
            return " ".join([*filter(None, parts), _bracketed(_vector(vector))])
    raise TypeError(f"not a vector expression: {expression!r}")


def _symbol(name: str) -> str:
    """Write the angular velocity of a body as w."""
    if name.startswith("phi_") and name.endswith("_dot"):
        return f"w_{name[4]}"
    return name


def _product(factors: tuple[Scalar, ...]) -> str:
    number, rest = split_coefficient(Product(factors))
    parts = [_number(number), *(_bracketed(_scalar(item)) for item in rest)]
    return " ".join(filter(None, parts))


def _number(number: Fraction) -> str:
    if number == 1:
        return ""
    return "-" if number == -1 else str(number)


def _sum(terms: list[str]) -> str:
    return " + ".join(terms).replace("+ - ", "- ").replace("+ -", "- ")


def _bracketed(text: str) -> str:
    return f"({text})" if " + " in text or " - " in text[1:] else text

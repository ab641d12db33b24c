"""What a page prints besides the vector calculus: symbols, matrices, equations, written-out code.

A formula is a node of `kincompile.calculus`, a SymPy expression, or one of the nodes below. None of
them knows how it is printed; `notation` does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, TypeAlias

import sympy

from kincompile.calculus.expressions import Expression, Scalar, Vector

if TYPE_CHECKING:
    from collections.abc import Container


@dataclass(frozen=True, slots=True)
class Glyph:
    """A symbol of the page itself: Phi_q, nu, A_i."""

    letter: str  # the letter, or the name of a Greek one
    index: str = ""  # subscript; several indices are separated by commas
    dots: int = 0
    bold: bool = True
    exponent: str = ""  # superscript, "" for none


@dataclass(frozen=True, slots=True)
class Joined:
    """Formulas side by side; a string is an operator, a bracket or a word."""

    parts: tuple[Formula | str, ...]


@dataclass(frozen=True, slots=True)
class Sub:
    """A formula with a formula as its index: (Phi_q q_dot)_q."""

    base: Formula
    index: Formula


@dataclass(frozen=True, slots=True)
class DerivativeSymbol(Scalar):
    """The derivative of one formula by another: partial, or total with d."""

    numerator: Formula
    denominator: Formula
    sign: str = "\N{PARTIAL DIFFERENTIAL}"


@dataclass(frozen=True, slots=True)
class Differential(Scalar):
    """The differential of a variable: d phi."""

    variable: Formula


@dataclass(frozen=True, slots=True)
class Transposed:
    """A vector as a row: d^T."""

    vector: Vector


@dataclass(frozen=True, slots=True)
class Equated:
    """Formulas that are equal, in a row: a = b = c."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Matrix:
    """A matrix in brackets; a cell may be a vector or a block."""

    rows: tuple[tuple[Formula, ...], ...]


@dataclass(frozen=True, slots=True)
class Decimal(Scalar):
    """A floating-point number, printed with a number of significant digits."""

    value: float
    digits: int = 6


@dataclass(frozen=True, slots=True)
class Call(Scalar):
    """A function of scalars."""

    function: str
    arguments: tuple[Scalar, ...]


@dataclass(frozen=True, slots=True)
class Quotient(Scalar):
    """A fraction, as the emitted code divides."""

    numerator: Scalar
    denominator: Scalar


@dataclass(frozen=True, slots=True)
class Choice(Scalar):
    """The first value where the condition holds, the second elsewhere."""

    condition: Scalar
    first: Scalar
    second: Scalar


@dataclass(frozen=True, slots=True)
class Relation(Scalar):
    """Two values joined by a relation or a connective: a condition."""

    relation: str
    left: Scalar
    right: Scalar


Formula: TypeAlias = (
    Expression
    | sympy.Basic
    | Glyph
    | Joined
    | Sub
    | DerivativeSymbol
    | Transposed
    | Equated
    | Matrix
)

PHI, PHI_Q, PHI_T = Glyph("Phi"), Glyph("Phi", "q"), Glyph("Phi", "t")
PHI_QT, PHI_TT = Glyph("Phi", "qt"), Glyph("Phi", "tt")
NU, GAMMA = Glyph("nu"), Glyph("gamma")
MASS, LAMBDA = Glyph("M"), Glyph("lambda")
Q, Q_DOT, Q_DDOT = Glyph("q"), Glyph("q", dots=1), Glyph("q", dots=2)
DELTA_Q = Joined((Glyph("Delta", bold=False), Q))
IDENTITY, ZERO_BLOCK = Glyph("I"), Glyph("0")
VELOCITY_TERM = Joined((PHI_Q, Q_DOT))
GAMMA_TERMS = (
    Joined(("-", Sub(Joined(("(", PHI_Q, Q_DOT, ")")), Q), Q_DOT)),
    Joined(("-", "2", PHI_QT, Q_DOT)),
    Joined(("-", PHI_TT)),
)
"""The three terms of gamma as the textbook writes them."""


def column(values: tuple[Formula, ...]) -> Matrix:
    """Return a column matrix."""
    return Matrix(tuple((value,) for value in values))


def size(formula: object, most: float = math.inf, atoms: Container[object] = ()) -> int:
    """Return the number of nodes of a formula, of which atoms are one each.

    The count ends when there are more than `most`.
    """
    waiting, count = [formula], 0
    while waiting and count <= most:
        item = waiting.pop()
        if isinstance(item, tuple):
            waiting.extend(item)
        elif is_dataclass(item):
            count += 1
            if item in atoms:
                continue
            waiting.extend(getattr(item, part.name) for part in fields(item))
    return count


def decimals(values: object, digits: int = 6) -> Matrix:
    """Return an array of numbers, shape (m,) or (m, n), as a matrix; a vector is a column."""
    rows = [row if isinstance(row, list) else [row] for row in _nested(values)]
    return Matrix(tuple(tuple(Decimal(value, digits) for value in row) for row in rows))


def _nested(values: object) -> list[list[float] | float]:
    found: list[list[float] | float] = values.tolist()  # type: ignore[attr-defined]
    return found

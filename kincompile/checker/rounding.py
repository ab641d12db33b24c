"""How exact numbers are as they are written: half of their last digit.

Course programs print four decimals. A number with few digits (0.25) is taken as it stands, one with
at least three decimals or four digits as rounded. What a function returns may be the quotient of
differences, or of single precision.
"""

from __future__ import annotations

from decimal import Decimal
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.ir.interpret import apply

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.checker.states import Array
    from kincompile.ir.graph import Node
    from kincompile.model.spline import SplineTable

MOST_DECIMALS, MOST_DIGITS = 8, 12
"""With more than these, a number has all the digits of a double."""
FEWEST_DECIMALS, FEWEST_DIGITS = 3, 4
MOST_LITERALS = 20
"""Different numbers in one formula that are looked at."""
STEP = 1e-30
"""Of complex steps; their error is of its square."""
OF_FUNCTION = 1e-6
"""What a function returns, and single precision: of the scale of an entry."""


def of_array(array: Array) -> Array:
    """Return the part of each number that is lost where an array was printed and typed in."""
    values = np.abs(array[np.isfinite(array)]).ravel()
    numbers = [Decimal(repr(float(value))).normalize() for value in values]
    decimals = max((-int(number.as_tuple().exponent) for number in numbers), default=0)
    digits = max((len(number.as_tuple().digits) for number in numbers), default=0)
    if decimals > FEWEST_DIGITS and FEWEST_DIGITS <= digits <= FEWEST_DIGITS + 2:
        size = np.floor(np.log10(np.where(array == 0, np.inf, np.abs(array))))
        return np.asarray(0.5 * 10.0 ** (size - digits + 1))
    lost = 0.5 * 10.0**-decimals if FEWEST_DECIMALS <= decimals <= MOST_DECIMALS else 0.0
    return np.full(array.shape, lost)


def of_literals(expression: sympy.Expr) -> list[sympy.Expr]:
    """Return by how much an expression may be off, a term for each rounded number in it."""
    found = []
    for number in sorted(expression.atoms(sympy.Float), key=float)[:MOST_LITERALS]:
        exact = Decimal(repr(float(number))).normalize().as_tuple()
        if FEWEST_DIGITS <= len(exact.digits) <= MOST_DIGITS:
            symbol = sympy.Dummy()
            slope = expression.xreplace({number: symbol}).diff(symbol).xreplace({symbol: number})
            found.append(slope * sympy.Float(0.5 * 10.0 ** int(exact.exponent)))
    return found


def cancelled(
    nodes: Sequence[Node],
    values: Sequence[Any],
    inputs: Mapping[str, Array],
    tables: Mapping[str, SplineTable],
) -> list[Array | float]:
    """Return of each node how much of its terms cancels, in it and in the nodes that it is made of.

    A value and this together are the size of its terms, as if all of it were multiplied out. What
    cancels in an operand counts with the derivative by the operand.
    """
    lost: list[Array | float] = []
    moved = list(values)
    for operation, *operands in nodes:
        own: Array | float = 0.0
        if operation in ("add", "sub"):
            a, b = operands
            own = np.abs(values[a]) + np.abs(values[b]) - np.abs(values[len(lost)])
            own = own + lost[a] + lost[b]
        elif operation in ("neg", "square", "mul", "div", "call"):
            for k in {item for item in operands if isinstance(item, int)}:
                if np.any(lost[k]):
                    moved[k] = values[k] + STEP * 1j
                    slope = np.imag(apply(operation, operands, moved, inputs, tables)) / STEP
                    moved[k] = values[k]
                    own = own + np.where(np.asarray(lost[k]) > 0, np.abs(slope) * lost[k], 0.0)
        elif operation == "select":
            condition, a, b = operands
            own = np.where(values[condition], lost[a], lost[b])
        lost.append(own)
    return lost

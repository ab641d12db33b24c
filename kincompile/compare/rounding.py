"""How exact numbers are as they are written: half of their last digit.

Course programs print four decimals. A number with few digits (0.25) is taken as it stands, one with
at least three decimals or four digits as rounded. What a function returns may be the quotient of
differences, or of single precision.
"""

from __future__ import annotations

from decimal import Decimal
from typing import TYPE_CHECKING

import numpy as np
import sympy

if TYPE_CHECKING:
    from kincompile.compare.states import Array

MOST_DECIMALS, MOST_DIGITS = 8, 12
"""With more than these, a number has all the digits of a double."""
FEWEST_DECIMALS, FEWEST_DIGITS = 3, 4
MOST_LITERALS = 20
"""Different numbers in one formula that are looked at."""
OF_FUNCTION = 1e-6
"""Relative, of the largest number."""


def of_array(array: Array) -> Array:
    """Return the part of each number that is lost where an array was printed and typed in."""
    values = np.abs(array[np.isfinite(array)]).ravel()
    if array.dtype == np.float32:
        return np.asarray(OF_FUNCTION * np.max(values, initial=0.0) * np.ones(array.shape))
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


def of_function(values: Array) -> Array:
    """Return what is rounding in the values of a function, (N, rows, columns)."""
    size = np.max(np.abs(np.where(np.isfinite(values), values, 0)), axis=(-2, -1), keepdims=True)
    return np.asarray(OF_FUNCTION * np.broadcast_to(size, values.shape))

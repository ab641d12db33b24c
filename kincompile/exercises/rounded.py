"""Numbers of an answer that were rounded: what they stand for, and when that is near enough.

An answer is right but for rounding if other numbers in the place of its own make it right, each
near its own. They are found by least squares from the values of the answer at a dozen states.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.checker.notation import explicit, plain
from kincompile.checker.written import vocabulary
from kincompile.errors import InputError, KincompileError
from kincompile.model.expressions import NotAnExpressionError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.checker.reference import Reference
    from kincompile.checker.states import Array, States
    from kincompile.exercises.blanks import Blank

_LITERAL = re.compile(r"(?<![\w.^])(?<!\*\*)(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?!\w)")
"""A number that is no exponent."""

MOST_TOLERANCE, MOST_DIGITS = 0.1, 6
"""Largest relative error of a rounded number that may be asked for, and most digits."""

MOST_NUMBERS = 5
"""Numbers that may be rounded together: less than half of the states that they are fitted to."""

STEPS, FITTED = 4, 1e-9
"""Of Newton's method; most products have one number, and take one step. Relative error left."""

SLACK = 1 + 1e-9
"""For a number that lies half a unit away, up to rounding."""


@dataclass(frozen=True, slots=True)
class Leeway:
    """How far a number of an answer may be off.

    Attributes
    ----------
    tolerance
        Relative error, from 0 to 0.1.
    digits
        Significant digits to which a number must agree, from 1 to 6; None where none are asked for.
    """

    tolerance: float = 0.0
    digits: int | None = None

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        if not 0 <= self.tolerance <= MOST_TOLERANCE:
            raise InputError(f"tolerance is {self.tolerance}; give one from 0 to {MOST_TOLERANCE}")
        if self.digits is None:
            return
        if isinstance(self.digits, bool) or self.digits not in range(1, MOST_DIGITS + 1):
            raise InputError(f"digits is {self.digits}; give a number from 1 to {MOST_DIGITS}")
        if self.tolerance:
            raise InputError("a tolerance and digits are both given; give one of them")

    def allows(self, number: float, right: float) -> bool:
        """Return whether a number may stand for the right one."""
        off = abs(number - right)
        return off <= self.tolerance * abs(right) or (
            self.digits is not None and off <= half_unit(right, self.digits) * SLACK
        )

    @property
    def words(self) -> str:
        """What is allowed."""
        return f"to {self.digits} digits" if self.digits else f"within {self.tolerance:g}"


def half_unit(value: float, digits: int) -> float:
    """Return half a unit of a significant digit of a value, 0 of 0."""
    return 0.5 * 10.0 ** (math.floor(math.log10(abs(value))) - digits + 1) if value else 0.0


def meant(
    reference: Reference, blank: Blank, answer: str, leeway: Leeway
) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield answers with numbers in the place of rounded ones, and these numbers by their text.

    One number after the other is tried, those with the most digits first, then all together.
    """
    try:
        words = vocabulary(reference, {})
        text = explicit(plain(answer), None, words.names)
        literals = sorted(dict.fromkeys(_LITERAL.findall(text)), key=len, reverse=True)
        names = {item: f"number_{k}_of_the_answer" for k, item in enumerate(literals)}
        shown = _LITERAL.sub(lambda found: names[found[0]], text)
        symbols = {name: sympy.Symbol(name) for name in names.values()}
        written = replace(words, names={**words.names, **symbols}).read(shown)
    except (KincompileError, NotAnExpressionError):
        return
    choices = [[item] for item in literals]
    for chosen in [*choices, literals] if 1 < len(literals) <= MOST_NUMBERS else choices:
        others = {symbols[names[x]]: sympy.Rational(x) for x in literals if x not in chosen}
        expression = written.xreplace(others)
        unknowns = [symbols[names[item]] for item in chosen]
        found = _fitted(reference, blank, expression, unknowns, [float(item) for item in chosen])
        if found is None:
            continue
        changed = {
            item: x
            for item, x in zip(chosen, found, strict=True)
            if abs(x - float(item)) > FITTED * abs(x)
        }
        if changed and all(_is_near(item, x, leeway) for item, x in changed.items()):
            yield _replaced(text, changed), changed


def _replaced(text: str, numbers: Mapping[str, float]) -> str:
    """Return a text with other numbers in the place of some."""
    return _LITERAL.sub(lambda at: repr(numbers[at[0]]) if at[0] in numbers else at[0], text)


def _is_near(text: str, x: float, leeway: Leeway) -> bool:
    """Return whether a number as written is another one rounded, or near enough."""
    last = 0.5 * 10.0 ** int(Decimal(text).as_tuple().exponent) * SLACK
    return abs(float(text) - x) <= last or leeway.allows(float(text), x)


def _fitted(
    reference: Reference,
    blank: Blank,
    expression: sympy.Expr,
    unknowns: Sequence[sympy.Symbol],
    start: Sequence[float],
) -> list[float] | None:
    """Return values of unknowns with which an expression is the derived entry, None without."""
    states = _states(reference, blank)
    right = reference.expression(blank.quantity, blank.row, blank.column or 0)
    slopes = [expression.diff(item) for item in unknowns]
    values = np.array(start)

    def at(values: Array) -> Array:
        numbers = dict(zip(unknowns, map(sympy.Float, values.tolist()), strict=True))
        formulas = [item.xreplace(numbers) for item in (right, expression, *slopes)]
        if any(item.has(sympy.zoo, sympy.nan) for item in formulas):  # a divisor became 0
            return np.full((len(states), len(formulas)), np.nan)
        found, _ = reference.evaluate(formulas, states)
        return found

    if len(states) < 2 * len(unknowns):
        return None
    for _ in range(STEPS):
        found = at(values)
        wanted, matrix = found[:, 0] - found[:, 1], found[:, 2:] * values
        if not np.all(np.isfinite(found)):
            return None
        if np.max(np.abs(wanted)) <= FITTED * np.max(np.abs(found[:, 0])):
            return [float(item) for item in values]
        values = values * (1 + np.linalg.lstsq(matrix, wanted, rcond=1e-10)[0])
    return None


def _states(reference: Reference, blank: Blank) -> States:
    """Return where an entry must be right: gamma where the constraints hold."""
    if blank.column is None:
        key = ("states of gamma",)
        if key not in reference.kept:
            rows = range(len(reference.equations))
            reference.kept[key] = reference.near(rows, reference.random) or reference.random
        found: States = reference.kept[key]
        return found
    return reference.random

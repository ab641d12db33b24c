"""A fault in a formula: its kind, and the formula or the numbers that result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import pi
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from kincompile.checker.agreement import are_close

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from kincompile.checker.states import Array


class Kind:
    """The kinds of faults, in a few words."""

    SIGN = "sign"
    WHOLE_SIGN = "whole sign"
    REVERSED = "driver's rate reversed"
    LEFT_ZERO = "left zero"
    FACTOR = "factor 2 or 1/2"
    MISSING_TERM = "missing term"
    SINE_COSINE = "sine and cosine swapped"
    TRANSPOSED = "rotation transposed"
    A_FOR_B = "A where B belongs, or B where A"
    MIXED_ANGLES = "phi_i and phi_j mixed"
    MIXED_POINTS = "s_i and s_j mixed"
    XI_ETA = "xi and eta swapped"
    MISSING_FACTOR = "chain-rule factor missing"
    MISSING_SQUARE = "velocity square missing"
    MISSING_RATE = "velocity factor missing"
    MIXED_RATES = "position and velocity mixed"
    MIXED_ORDERS = "derivatives of a function mixed"
    DRIVER_DEGREES = "driver in degrees"
    SECOND_DERIVATIVE = "driver's second derivative forgotten"
    DRIVER_RATE = "driver's rate forgotten"
    BLOCKS = "body blocks swapped"
    ROWS = "rows swapped"
    OFFSET = "rows offset by one"
    WHOLE_TRANSPOSED = "matrix transposed"
    X_AND_Y = "x and y columns swapped"
    E0_LAST = "e0 misplaced"
    TILDE = "sign of the tilde"
    GLOBAL_OMEGA = "global for local omega"
    CROSS_TERM = "cross term 2 Phi_qt q_dot missing"
    QUADRATIC_TERM = "(Phi_q q_dot)_q q_dot missing"
    PHI_TT = "Phi_tt missing"
    WITH_RATES = "rates where none belong"
    SAME_SPACE = "row spaces agree"
    OTHER_FORM = "follows from another Phi"
    WITHOUT = "counted as zero"
    COUPLING = "coupling 2 w (r_j_dot - r_i_dot) missing"
    SQUARES = "w_j^2 - w_i^2 for (w_j - w_i)^2"
    MULTIPLE = "constant factor"
    DEGREES = "degrees for radians"
    OTHER_VARIABLE = "another variable in a factor"
    EXTRA_FACTOR = "factor too much"
    EXTRA_TERM = "term too much"
    INVERSE = "inverse for the matrix"
    FRAME = "wrong frame"
    CHAIN_RULE = "a term of the chain rule missing"
    BRANCH = "another assembly"
    COLUMNS = "columns exchanged"
    ARM = "moment arm from another point"
    OTHER_VECTOR = "another vector in the body"
    TWO_SLIPS = "two slips"


A_TERM = "a term"
"""A term of an entry as it is typed; in vectors a term has its name."""
TERM_SIGN = f"{A_TERM} has the wrong sign"

OMISSIONS = frozenset({
    Kind.CROSS_TERM, Kind.QUADRATIC_TERM, Kind.PHI_TT, Kind.COUPLING, Kind.SECOND_DERIVATIVE,
    Kind.DRIVER_RATE,
})  # fmt: skip
"""What a missing term may be called by its place in the derivation."""

NEAR = 1e-6
"""Between a factor found from numbers and the one that is meant."""

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Fault(Generic[Result]):
    """A fault and its result."""

    kind: str
    text: str
    result: Result  # the faulty formula, formulas by part, or numbers by entry
    detail: str = ""  # the right formula of the faulty term or entry, for those who may see it


Index = tuple[int, int]
"""Row and column of an entry; the column of a vector is 0."""

Shown = tuple["Array", "Array"]
"""Values of an entry and what rounding may have taken from them, (N,) each."""

NumericFault = Fault[Mapping[Index, "Array"]]
"""A fault with the numbers that stand in the entries where it shows, shape (N,) each."""


def showing(
    kind: str, text: str, other: Array, right: Array, places: Iterable[Index] | None = None
) -> Iterator[NumericFault]:
    """Yield a fault with the entries that it changes, of all or of some, if it changes any.

    Parameters
    ----------
    other, right
        The values with the fault and the right ones, (N, rows, columns).
    """
    changed = ~are_close(other, right)
    chosen = np.argwhere(changed).tolist() if places is None else places
    if result := {(i, j): other[:, i, j] for i, j in chosen if changed[i, j]}:
        yield Fault(kind, text, result)


def whole_faults(
    quantity: str, name: str, multiple: Callable[[Fraction], Result], detail: str = ""
) -> Iterator[Fault[Result]]:
    """Yield the faults of a formula as a whole; `multiple` gives it times a factor."""
    sign = {"nu": Kind.REVERSED, "gamma": Kind.WHOLE_SIGN}.get(quantity, Kind.SIGN)
    yield Fault(sign, f"{name} has the wrong sign", multiple(Fraction(-1)), detail)
    yield Fault(Kind.LEFT_ZERO, f"{name} is left zero", multiple(Fraction(0)), detail)
    for word, factor in (("twice", Fraction(2)), ("half", Fraction(1, 2))):
        yield Fault(Kind.FACTOR, f"{name} is {word} what it should be", multiple(factor), detail)


def term_faults(
    name: str, multiple: Callable[[Fraction], Result], detail: str = ""
) -> Iterator[Fault[Result]]:
    """Yield the faults of a term; `multiple` gives the formula with the term times a factor."""
    yield Fault(Kind.MISSING_TERM, f"{name} is missing", multiple(Fraction(0)), detail)
    yield Fault(Kind.SIGN, f"{name} has the wrong sign", multiple(Fraction(-1)), detail)
    for word, factor in (("twice", Fraction(2)), ("half", Fraction(1, 2))):
        yield Fault(Kind.FACTOR, f"{name} is counted {word}", multiple(factor), detail)


def multiple_fault(name: str, factor: float) -> tuple[str, str]:
    """Return kind and text of a formula or term, by its name, that is a multiple of the right."""
    for fault in term_faults(name, float):
        if abs(factor - fault.result) <= NEAR:
            return fault.kind, fault.text
    for text, degrees in (("too much in", pi / 180), ("missing in", 180 / pi)):
        if abs(abs(factor) / degrees - 1) <= NEAR:
            return Kind.DEGREES, f"a factor pi/180 is {text} {name}: degrees stand for radians"
    exact = Fraction(factor).limit_denominator(1000)
    shown = str(exact) if abs(factor - exact) <= NEAR else f"{factor:.6g}"
    return Kind.MULTIPLE, f"{name} is {shown} times what it should be"

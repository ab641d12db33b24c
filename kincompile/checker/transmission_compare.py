"""Comparison of the maps of a transmission, as `compare` and `compare_file` are asked for it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile.checker.comparer import NUMBERS
from kincompile.checker.transmission_comparer import TransmissionComparer
from kincompile.checker.transmission_reference import Transmission
from kincompile.checker.written import (
    REPORTED,
    argument_names,
    from_function,
    read_written,
    vocabulary,
)
from kincompile.errors import InputError
from kincompile.model.inputs import input_name
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from kincompile.checker.conventions import Stated
    from kincompile.checker.report import Report
    from kincompile.checker.states import Array
    from kincompile.checker.transmission_reference import TransmissionReference
    from kincompile.checker.written import Written

Readings = dict[str, list["Written"]]
OF_INVERSE = {"u": "x", "u_dot": "x_dot", "tau_x": "tau_u"}
"""What the arguments of the inverse's methods are of the transmission."""


def read_maps(
    reference: TransmissionReference,
    given: Mapping[str, object],
    aliases: Mapping[str, object],
    *,
    at_states: bool = False,
) -> Readings:
    """Read all quantities, each in the ways in which it may be meant; or raise all problems.

    A function of one argument may be of the inputs or of the outputs.
    """
    words = vocabulary(reference, aliases)
    readings: Readings = {}
    problems: list[str] = []
    for name, value in given.items():

        def check(rows: int, columns: int, name: str = name) -> list[str]:
            return _shape_problems(reference, name, rows, columns)

        try:
            if callable(value) and not hasattr(value, "free_symbols"):
                readings[name] = _functions(reference, name, value)
            else:
                readings[name] = [read_written(name, value, words, reference, at_states, check)]
            problems += check(*readings[name][0].shape)
        except InputError as error:
            problems += [item for item in error.problems if item != REPORTED]
    if problems:
        raise InputError(problems)
    return readings


def _functions(reference: TransmissionReference, quantity: str, value: Any) -> list[Written]:
    """Return a function in the ways in which its arguments may be meant.

    A method of a transmission takes all states at once, and parameters by name. That of the inverse
    has outputs in the place of inputs.
    """
    names, f = argument_names(value), reference.f
    own = getattr(value, "__self__", value)
    if not isinstance(own, Transmission) or names is None:
        choices = reference.arguments(quantity, names)
        return [from_function(quantity, value, reference, item) for item in choices]
    if own.inputs != f.inputs and not _are_same(own.inputs, f.outputs):
        raise InputError(
            f"{quantity} is a function of {listed(own.inputs)}; give one of {listed(f.inputs)}, or "
            f"of {listed(f.outputs)}, in this order."
        )
    given = names if own.inputs == f.inputs else [OF_INVERSE.get(name, name) for name in names]

    def by_name(*arguments: Array) -> object:
        pairs = zip(given, arguments, strict=True)
        named = [dict(zip(reference.own, x.T, strict=True)) if k == "p" else x for k, x in pairs]
        return value(*named)

    (arguments,) = reference.arguments(quantity, given)
    return [from_function(quantity, by_name, reference, arguments, is_of_many=True)]


def _are_same(one: Sequence[str], other: Sequence[str]) -> bool:
    """Return whether names are the same, of drivers those that an inverse gives them."""
    pairs = list(zip(one, other, strict=False))
    return len(one) == len(other) and all(a == b or b in (input_name(a), a) for a, b in pairs)


def _shape_problems(
    reference: TransmissionReference, name: str, rows: int, columns: int
) -> list[str]:
    """Return what is wrong with the shape of a quantity."""
    f = reference.f
    m, n = len(f.inputs), len(f.outputs)
    if name in ("J", "J_dot"):
        if (rows, columns) in ((n, m), (m, n)):
            return []
        return [
            f"{name} is {rows} x {columns}; expected {n} x {m}, a row for each of "
            f"{listed(f.outputs)} and a column for each of {listed(f.inputs)}, or its transpose"
        ]
    if name == "x" and f.twists:
        return [
            f"x of {f.name} has velocities in it, {listed(f.twists)}, and no position gives them: "
            "compare J, or leave them out of the outputs"
        ]
    count, names = (n, f.outputs) if name == "x" else (m, f.inputs)
    if (rows, columns) == (count, 1):
        return []
    return [
        f"{name} is {rows} x {columns}; it is a vector: expected {count} rows, one for each of "
        f"{listed(names)}"
    ]


def compare_maps(
    reference: TransmissionReference,
    readings: Readings,
    given: Mapping[str, ArrayLike] | None,
    stated: Stated,
    *,
    strict: bool,
) -> Report:
    """Compare at random poses; where numbers may stand for parameters, at their defaults too."""
    if given is not None:
        states = reference.given_states(given)
        return TransmissionComparer(reference, readings, states, stated, strict).report()
    takes = all(item.takes_parameters for own in readings.values() for item in own)
    states = reference.random if takes else reference.fixed
    best = TransmissionComparer(reference, readings, states, stated, strict)
    if best.wrong_count and reference.own and states is not reference.fixed:
        other = TransmissionComparer(reference, readings, reference.fixed, stated, strict)
        if other.wrong_count < best.wrong_count:
            return other.report(NUMBERS)
    return best.report()

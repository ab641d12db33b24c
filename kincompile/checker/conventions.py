"""The conventions of a matching in words: the differences between two right answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.checker.comparison import Convention
from kincompile.checker.transmission_maps import KINDS
from kincompile.errors import InputError
from kincompile.model.small_rotations import BY_OMEGA, BY_P
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.checker.matching import Matching
    from kincompile.checker.reference import Reference

OPPOSITE = {"nu": "Phi_t", "gamma": "left side"}
"""Conventions that an author may state for nu and gamma; they then have the opposite sign."""

USUAL = {"nu": "-Phi_t", "gamma": "right side"}

FORM = "form"
"""The convention that says by what Phi_q has derivatives, and gamma the second rates."""
GLOBAL = f"global {BY_OMEGA}"

LOAD = "load"
"""The convention by which effort is what outputs are loaded with, of the opposite sign."""

_CHOICES: Mapping[str, tuple[str, ...]] = {
    **{name: (OPPOSITE[name], USUAL[name]) for name in OPPOSITE},
    FORM: (BY_P, BY_OMEGA, GLOBAL),
    "J": tuple(KINDS),
    "effort": (LOAD, "delivered"),
}


@dataclass(frozen=True, slots=True)
class Stated:
    """What an author says of a hand-in."""

    signs: Mapping[str, float]  # -1 for nu or gamma with the opposite sign
    form: str = ""  # the form of a mechanism in space, "" where it has to be found
    kind: str = ""  # which matrix J of a transmission is, "" where it has to be found
    is_load: bool = False  # whether effort is of what outputs are loaded with


def stated_conventions(stated: Mapping[str, str]) -> Stated:
    """Return the signs of nu and gamma, and the form, as their author states them.

    Raises
    ------
    InputError
        If a quantity or its convention is unknown.
    """
    problems = [
        f"the convention {name} = {value!r} is not known; write {_choices()}"
        for name, value in stated.items()
        if value not in _CHOICES.get(name, ())
    ]
    if problems:
        raise InputError(problems)
    signs = {name: -1.0 for name, value in stated.items() if value == OPPOSITE.get(name)}
    return Stated(signs, stated.get(FORM, ""), stated.get("J", ""), stated.get("effort") == LOAD)


def _choices() -> str:
    return "; ".join(
        " or ".join((f'{name} = "{items[0]}"', *(f'"{item}"' for item in items[1:])))
        for name, items in _CHOICES.items()
    )


def conventions_found(matching: Matching, reference: Reference) -> Iterator[Convention]:
    """Yield the conventions of a matching."""
    yield from [reference.convention] if reference.convention else []
    equations = reference.equations
    if text := matching.layout.convention:
        kind = "ground columns" if "ground" in text else "order of columns"
        order = ["(ground)" if k is None else reference.coordinates[k]
                 for k in matching.layout.columns]  # fmt: skip
        yield Convention(kind, f"Phi_q: {text}, the same in all rows: {listed(order, 30)}.")
    parts = ["angles are taken in degrees"] if matching.units.takes_degrees else []
    parts += ["derivatives are per degree"] if matching.units.per_degree else []
    if parts:
        yield Convention("degrees", f"{'; '.join(parts)}.")
    names = [equations[row] for row in matching.rows]
    if moved := matching.moved:
        pairs = listed([f"row {k + 1} is {names[k]}" for k in moved], 30)
        rows = tuple(names[k] for k in moved)
        yield Convention("order of rows", f"the rows have another order: {pairs}.", rows)
    for form in matching.forms:
        own = tuple(equations[row] for row in form.rows)
        yield Convention(form.kind, f"{listed(own)}: {form.text}.", own)
    yield from _row_factors(matching, names)
    for name, sign in matching.signs.items():
        if sign < 0:
            text = f"{name} is the {OPPOSITE[name]}, as stated: it has the opposite sign."
            yield Convention(f"sign of {name}", text)


def _row_factors(matching: Matching, names: Sequence[str]) -> Iterator[Convention]:
    """Yield the signs and scales of rows."""
    factors = list(zip(names, matching.factors, strict=True))
    opposite = tuple(name for name, factor in factors if np.all(factor == -1))
    if opposite:
        text = f"{listed(opposite)}: written with the opposite sign."
        yield Convention("row sign", text, opposite)
    for name, factor in factors:
        if name not in opposite and np.any(factor != 1):
            is_number = np.ptp(factor) <= 1e-9 * abs(factor[0])
            size = f"{factor[0]:.6g}" if is_number else "a factor that depends on parameters"
            text = f"{name}: written as {size} times the generated equation."
            yield Convention("row scale", text, (name,))

"""The conventions that an author may state: differences between two right answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.checker.transmission_maps import KINDS
from kincompile.errors import InputError
from kincompile.model.small_rotations import BY_OMEGA, BY_P

if TYPE_CHECKING:
    from collections.abc import Mapping


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

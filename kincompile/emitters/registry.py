"""The table of targets; the modules of one are loaded when a program is first emitted in it."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from kincompile.emitters.target import Emitted, OneTarget, Start, Target
    from kincompile.emitters.transmission import OneTransmission, TransmissionTarget
    from kincompile.ir.grouping import GroupedProgram


@dataclass(frozen=True, slots=True)
class Listed:
    """A line of the table."""

    # Package whose module `target` is the `Target`, and whose module `grouped` has `emit_grouped`
    # where there is a grouped form.
    folder: str
    endings: tuple[str, ...]  # endings of its files, that of the main one first
    is_loadable: bool = False  # whether this process can call its code
    has_grouped_form: bool = False  # whether it has a form for large mechanisms
    has_transmission: bool = False  # whether its folder has a module `transmission`
    has_one: bool = False  # whether its folder has a module `one`, for one point at a time


TARGETS = {
    "numpy": Listed(
        "kincompile.emitters.numpy", (".py",),
        is_loadable=True, has_grouped_form=True, has_transmission=True,
    ),
    "c": Listed(
        "kincompile.emitters.c", (".c", ".h"),
        is_loadable=True, has_transmission=True, has_one=True,
    ),
    "octave": Listed("kincompile.emitters.octave", (".m",), has_transmission=True),
    "javascript": Listed("kincompile.emitters.javascript", (".js", ".mjs"), has_transmission=True),
    "rust": Listed("kincompile.emitters.rust", (".rs",), has_transmission=True),
}  # fmt: skip
"""Languages to emit."""


@dataclass(frozen=True, slots=True)
class Package:
    """A target that is the files of a language with something round them, in one archive."""

    language: str
    ending: str


PACKAGES = {"fmi": Package("c", ".fmu")}
"""Archives to emit."""


def load_target(name: str) -> Target:
    """Return a target, whose modules are loaded now."""
    target: Target = import_module(f"{TARGETS[name].folder}.target")
    return target


def load_ends(name: str, main: str) -> Mapping[str, str]:
    """Return what a main file has at its end, by the ending of its name, where a target says so."""
    target = load_target(name)
    found: Mapping[str, str] = target.ends(main) if hasattr(target, "ends") else {}
    return found


def load_one(name: str, start: Start) -> OneTarget:
    """Return a target for one point at a time, which begins at a position."""
    target: OneTarget = import_module(f"{TARGETS[name].folder}.one").Target(start)
    return target


def load_transmission(name: str) -> TransmissionTarget:
    """Return what writes the transmission of a target."""
    language: TransmissionTarget = import_module(f"{TARGETS[name].folder}.transmission")
    return language


def load_one_transmission(name: str, start: Start) -> OneTransmission:
    """Return what writes the transmission of a target for one point at a time."""
    language = import_module(f"{TARGETS[name].folder}.transmission")
    found: OneTransmission = language.One(start)
    return found


def load_grouped_form(name: str) -> Callable[[GroupedProgram], Emitted]:
    """Return the function that writes the grouped form of a target."""
    emit: Callable[[GroupedProgram], Emitted]
    emit = import_module(f"{TARGETS[name].folder}.grouped").emit_grouped
    return emit

"""A transmission as the files of a target."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.emitters.evaluators import schedule
from kincompile.emitters.naming import NameTable
from kincompile.emitters.printer import Printer
from kincompile.emitters.registry import (
    TARGETS,
    load_ends,
    load_one,
    load_one_transmission,
    load_target,
    load_transmission,
)
from kincompile.emitters.target import Emitted
from kincompile.emitters.transmission import NUMBERS, Transmission
from kincompile.errors import UnsupportedError
from kincompile.names import listed
from kincompile.solver.vocabulary import STATUSES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.emitters.target import Start
    from kincompile.ir.transmission import TransmissionCode

OWN = ("N", "K", "U", "X", "BLOCKS", "ONE", "ANGULAR", "IS_ANGLE", "NOTHING", *NUMBERS, *STATUSES)
"""Constants of the text, which no variable may be called."""


def require_transmission(target: str) -> None:
    """Refuse a target that has none."""
    if not TARGETS[target].has_transmission:
        known = [name for name, item in TARGETS.items() if item.has_transmission]
        raise UnsupportedError(
            f"the target {target!r} has no transmission; targets that do: {listed(known)}"
        )


def emit_transmission(
    target: str,
    code: TransmissionCode,
    q: Sequence[float],
    u: Sequence[float],
    start: Start | None = None,
) -> Emitted:
    """Return the files of a transmission, which begins at a position and its inputs.

    A start says which numbers it has for one point at a time.
    """
    one = None if start is None else load_one_transmission(target, start)
    language = one or load_transmission(target)
    owner = load_target(target) if start is None else load_one(target, start)
    program = code.code.program
    reserved = (*owner.RESERVED, *language.RESERVED, *OWN, program.name)
    table = NameTable((*reserved, *program.tables))
    names = {"t": "t", **{name: table.take(name) for name in code.read}}
    listing = schedule(code.code, ("outputs",), names, table)
    printer = Printer(owner.DIALECT, code.code.nodes, listing.names, program.name)
    own = Transmission(code, listing, printer, tuple(q), tuple(u))
    files, needs = language.files(own), one.needs(own) if one else ""
    return Emitted(program.name, files, needs=needs, ends=load_ends(target, next(iter(files))))

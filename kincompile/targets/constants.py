"""The constants of an emitted file, as text that several languages share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.quantities import FORMAT
from kincompile.targets.lines import indented, quoted, wrapped

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kincompile.ir.inline import InlineProgram


def constants(code: InlineProgram, level: int, pair: str) -> dict[str, object]:
    """Return names, numbers and the pattern of Phi_q, by the slot of a template.

    Parameters
    ----------
    code
        The program.
    level
        Indentation of the lines of an array.
    pair
        Text of a row and a column, with ``{}`` for each.
    """
    program = code.program

    def lines(items: Iterable[str]) -> str:
        return indented(items, level)

    return {
        "name": program.name,
        "format": FORMAT,
        "fingerprint": program.fingerprint,
        "n": len(program.coordinates),
        "m": len(program.equations),
        "k": len(program.parameters),
        "coordinates": lines(quoted(item.name for item in program.coordinates)),
        "equations": lines(quoted(program.equations)),
        "parameters": lines(quoted(item.name for item in program.parameters)),
        "defaults": lines(wrapped(repr(item.default) for item in program.parameters)),
        "guess": lines(wrapped(repr(item.guess) for item in program.coordinates)),
        "pattern": lines(wrapped(pair.format(*place) for place in code.pattern())),
    }

"""Constants of a module as text: names, numbers, truths, tables of splines."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.emitters.lines import wrapped

if TYPE_CHECKING:
    from collections.abc import Iterable

    from kincompile.ir.program import Program


def items(values: Iterable[float], truths: tuple[str, str] = ("false", "true")) -> list[str]:
    """Return numbers or truths as text."""
    return [truths[x] if isinstance(x, bool) else repr(x) for x in values]


def named_lists(program: Program) -> dict[str, list[str]]:
    """Return the items of the lists that every module has, by name: names in quotes, numbers."""
    names = {
        "COORDINATES": program.names_of("coordinates"),
        "EQUATIONS": program.equations,
        "PARAMETERS": [x.name for x in program.parameters],
        "OUTPUTS": [x.name for x in program.outputs],
    }
    return {
        **{name: [f'"{x}"' for x in own] for name, own in names.items()},
        "DEFAULTS": [repr(x.default) for x in program.parameters],
        "GUESS": items(x.guess for x in program.coordinates),
    }


def splines(program: Program, head: str, opened: str) -> list[str]:
    """Return the tables of splines in a language that writes a struct as names and values.

    `head` is the first line with ``{}`` for the name, `opened` how an array begins.
    """
    lines = []
    for name, spline in program.tables.items():
        lines += [head.format(name), f"    breaks: {opened}"]
        lines += [f"        {line}" for line in wrapped(items(spline.breaks))]
        lines += ["    ],", f"    pieces: {opened}"]
        lines += [f"        {opened}{', '.join(items(row))}]," for row in spline.coefficients]
        lines += ["    ],", "};"]
    return lines

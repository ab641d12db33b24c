"""A program as the files of a target."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from kincompile.ir.inline import InlineProgram
from kincompile.names import listed
from kincompile.targets.evaluators import input_names, schedule
from kincompile.targets.naming import NameTable
from kincompile.targets.printer import Printer
from kincompile.targets.registry import TARGETS, load_grouped_form, load_target
from kincompile.targets.target import Emitted

if TYPE_CHECKING:
    from kincompile.ir.grouping import GroupedProgram
    from kincompile.ir.program import Program
    from kincompile.targets.target import Target


def emit_program(name: str, code: InlineProgram | GroupedProgram) -> Emitted:
    """Return the files of a program.

    Raises
    ------
    UnsupportedError
        If the target cannot print the program.
    """
    if not isinstance(code, InlineProgram):
        return load_grouped_form(name)(code)
    target, program = load_target(name), code.program
    if program.redundant and not TARGETS[name].has_least_squares:
        program = replace(program, unsolvable=_without_least_squares(program, target))
        code = replace(code, program=program)
    own = (program.name, *program.tables, *(f"{program.name}_{item}" for item in program.tables))
    table = NameTable((*target.RESERVED, *own))
    names = input_names(program, table)
    functions: dict[str, list[str]] = {}
    called: set[str] = set()
    for function, quantities in target.evaluators(program.quantities).items():
        listing = schedule(code, quantities, names, table)
        printer = Printer(target.DIALECT, code.nodes, listing.names, program.name)
        functions[function] = target.function(function, code, listing, printer)
        called.update(listing.functions)
    files = target.files(code, functions, called)
    return Emitted(program.name, files, unsolvable=program.unsolvable)


def _without_least_squares(program: Program, target: Target) -> str:
    """Return why code without a solve by least squares has none for redundant equations."""
    return (
        f"{program.name!r} has equations that repeat others, {listed(program.redundant)}, and the "
        f"{target.DIALECT.language} target has no solve by least squares: use the target 'numpy', "
        "or replace their constraint by one with fewer equations"
    )

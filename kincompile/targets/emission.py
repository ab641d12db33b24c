"""A program as the files of a target."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.ir.inline import InlineProgram
from kincompile.targets.evaluators import input_names, schedule
from kincompile.targets.naming import NameTable
from kincompile.targets.printer import Printer
from kincompile.targets.registry import load_grouped_form, load_target
from kincompile.targets.target import Emitted

if TYPE_CHECKING:
    from kincompile.ir.grouping import GroupedProgram


def emit_program(name: str, code: InlineProgram | GroupedProgram) -> Emitted:
    """Return the files of a program."""
    if not isinstance(code, InlineProgram):
        return load_grouped_form(name)(code)
    target, program = load_target(name), code.program
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

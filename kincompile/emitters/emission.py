"""A program as the files of a target."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.emitters.evaluators import input_names, schedule
from kincompile.emitters.naming import NameTable
from kincompile.emitters.printer import Printer
from kincompile.emitters.registry import load_ends, load_grouped_form, load_one, load_target
from kincompile.emitters.target import Emitted
from kincompile.ir.inline import InlineProgram

if TYPE_CHECKING:
    from kincompile.emitters.target import Start
    from kincompile.ir.grouping import GroupedProgram


def emit_program(
    name: str, code: InlineProgram | GroupedProgram, start: Start | None = None
) -> Emitted:
    """Return the files of a program; for one point at a time where a start is given."""
    if not isinstance(code, InlineProgram):
        return load_grouped_form(name)(code)
    one = None if start is None else load_one(name, start)
    target, program = one or load_target(name), code.program
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
    needs, ends = one.needs(code) if one else "", load_ends(name, next(iter(files)))
    return Emitted(program.name, files, unsolvable=program.unsolvable, needs=needs, ends=ends)

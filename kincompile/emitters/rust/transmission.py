"""A transmission in Rust: one file, a module without a dependency."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.emitters.constants import items
from kincompile.emitters.lines import indented
from kincompile.emitters.rust.functions import WRITE
from kincompile.emitters.rust.march import BASES, SIZES, RustSolver
from kincompile.emitters.rust.target import splines_of
from kincompile.emitters.transmission import NUMBERS, statuses
from kincompile.report.templates import fill
from kincompile.solver.reader import transmission
from kincompile.solver.vocabulary import CONSTANTS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.emitters.transmission import Transmission
    from kincompile.solver.nodes import Struct

RESERVED = ("s", "b", "P", "Q", "START_U", "SIZE", "INPUTS", "OUTPUTS", "COORDINATES", "PARAMETERS")
"""Names that the functions use besides those of the target."""


class _Solver(RustSolver):
    """Prints the text; both structs are public."""

    def struct(self, item: Struct) -> list[str]:
        """Return a struct, and what makes one."""
        lines = super().struct(item)
        head, end = lines.index(f"struct {item.name} {{"), lines.index("}")
        fields = [
            x if x.lstrip().startswith("//") else f"    pub {x.lstrip()}"
            for x in lines[head + 1 : end]
        ]
        public = ["#[derive(Clone)]", f"pub {lines[head]}"]
        return [*lines[:head], *public, *fields, *lines[end:]]


def files(of: Transmission) -> Mapping[str, str]:
    """Return the .rs file."""
    name = f"{of.name}_transmission"
    body = of.evaluation(WRITE.of_pose("{}[{}]", "{}[{}][{}]"))
    numbers = [
        f"const {x}: {BASES[CONSTANTS[x].base]} = {value!r};" for x, value in NUMBERS.items()
    ]
    numbers += [f"pub const {x}: usize = {number};" for x, number in statuses().items()]
    flags = [
        f"const {x}: [bool; {len(own)}] = [{', '.join(items(map(bool, own)))}];"
        for x, own in of.tables.items()
    ]
    data = {
        "header": "\n".join(f"//! {line}".rstrip() for line in of.about()),
        "module": name,
        "sizes": "\n".join(
            f"pub const {SIZES.get(x, x)}: usize = {n};" for x, n in of.sizes.items()
        ),
        "names": "\n".join(
            f"pub const {x}: [&str; {len(own)}] = [{', '.join(own)}];"
            for x, own in of.names.items()
        ),
        **{x: ", ".join(repr(float(y)) for y in getattr(of, x)) for x in ("p", "u", "q")},
        "size": repr(of.of.size),
        "numbers": "\n".join([*numbers, *flags]),
        "splines": splines_of(of.of.code.program),
        "has_square": any("square(" in x for x in body),
        "body": indented(body),
        "solver": _Solver(transmission()).text(),
    }
    return {f"{name}.rs": fill("rust/transmission.rs.jinja", data)}

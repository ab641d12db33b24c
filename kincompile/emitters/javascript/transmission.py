"""A transmission in JavaScript: one classic script, which node loads too."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from kincompile.emitters.constants import items, splines
from kincompile.emitters.javascript.functions import WRITE
from kincompile.emitters.javascript.march import JavaScriptSolver
from kincompile.emitters.javascript.target import spline_function, variable_of
from kincompile.emitters.lines import indented, wrapped
from kincompile.emitters.transmission import NUMBERS, statuses
from kincompile.report.templates import fill
from kincompile.solver.reader import transmission

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.emitters.transmission import Transmission

RESERVED = ("s", "b", "u", "x", "J", "P", "U", "Q", "SIZE")
"""Names that the functions use besides those of the target."""


def files(of: Transmission) -> Mapping[str, str]:
    """Return the script."""
    name = f"{of.name}_transmission"
    solver = JavaScriptSolver(transmission())
    lists = of.names | {x: [repr(float(y)) for y in getattr(of, x.lower())] for x in "PUQ"}
    lists["U_START"] = lists.pop("U")
    numbers = {**of.sizes, **statuses(), **NUMBERS}
    data = {
        "header": "\n".join(f"// {line}".rstrip() for line in of.about()),
        "variable": variable_of(name),
        "lists": indented(
            line
            for x, own in lists.items()
            for line in (f"const {x} = [", *(f"    {y}" for y in wrapped(own)), "];")
        ),
        "size": repr(of.of.size),
        "numbers": indented(
            wrapped(f"{x} = {json.dumps(value)}" for x, value in numbers.items()), 2
        )
        .strip()
        .removesuffix(","),
        "flags": indented(
            f"const {x} = [{', '.join(items(map(bool, own)))}];" for x, own in of.tables.items()
        ),
        "tables": indented(splines(of.of.code.program, "const {} = {{", "[")),
        "spline": spline_function(),
        "statuses": ", ".join(statuses()),
        "body": indented(of.evaluation(WRITE.of_pose("{}[{}]", "{}[{}][{}]")), 2),
        "has_square": any("square(" in x for x in of.evaluation(WRITE)),
        "solver": indented(solver.text().rstrip().split("\n")),
    }
    return {f"{name}.js": fill("javascript/transmission.js.jinja", data)}

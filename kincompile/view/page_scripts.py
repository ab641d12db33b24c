"""Scripts for what a page computes itself: the functions of the mechanism, and its solver."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import kincompile.compiler as compiler
from kincompile.criteria import SOLVED
from kincompile.emitters.emission import emit_program
from kincompile.emitters.javascript.functions import JAVASCRIPT
from kincompile.emitters.javascript.target import RESERVED
from kincompile.emitters.lines import indented, wrapped
from kincompile.emitters.naming import NameTable
from kincompile.emitters.printer import Printer
from kincompile.emitters.schedule import Scheduler
from kincompile.errors import ModelError, StructuralError, UnsupportedError
from kincompile.ir.graph import Graph
from kincompile.ir.inline import inline
from kincompile.report.templates import read
from kincompile.view.live_numbers import ANGLE, live_places

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.view.live_numbers import LiveNumber

MOST_COORDINATES = 150
"""Coordinates up to which a page solves the mechanism itself."""

DEPENDENT = "its equations depend on each other at every position."
"""Why a mechanism that could be emitted has no solver."""


def solver_script(model: Mechanism | ConstraintSystem) -> str:
    """Return the script that declares `emitted`: the module, or `reason`, why there is none."""
    count = len(model.system().coordinates)
    if count > MOST_COORDINATES:
        return _without("emitted", f"{count} coordinates are too many for a page.")
    try:
        emitted = compiler.emit(model, "javascript")
    except UnsupportedError as error:
        return _without("emitted", str(error))
    if emitted.unsolvable:
        return _without("emitted", emitted.unsolvable)
    # In a function of its own, so that no name of a mechanism meets one of the page.
    return (
        f"const emitted = (() => {{\nconst module = {{ exports: {{}} }};\n{emitted.source}"
        f"return module.exports.solver ? module.exports : {json.dumps({'reason': DEPENDENT})};\n"
        "})();\n"
    )


def transmission_script(
    model: Mechanism | ConstraintSystem, ends: tuple[Sequence[str], Sequence[str]] | None
) -> tuple[str, dict[str, list[dict[str, str]]] | None]:
    """Return the script that declares `transmitted`, and names and units of inputs and outputs.

    It is null without a transmission, and has a `reason` where the mechanism has none as code. The
    outputs of its function are followed by all coordinates, which the drawing needs.

    Raises
    ------
    InputError
        As `kc.emit` with a transmission.
    """
    if ends is None:
        return "const transmitted = null;\n", None
    try:
        emitted, code = compiler.transmission_files(
            model.system(), "javascript", *ends, is_drawn=True
        )
    except (StructuralError, UnsupportedError) as error:
        return _without("transmitted", str(error)), {"inputs": [], "outputs": []}
    count = len(code.outputs) - len(model.system().coordinates)
    names = {"inputs": code.titles, "outputs": code.outputs[:count]}
    script = (
        f"const transmitted = (() => {{\nconst module = {{ exports: {{}} }};\n"
        f"const norm = vector => Math.hypot(...vector), largest = vector => norm(vector);\n"
        f"{read('javascript/linear.js')}\n{emitted.source}"
        "return { ...module.exports, factor, singularValues };\n})();\n"
    )
    return script, {
        key: [{"name": name, "unit": code.units[name]} for name in own]
        for key, own in names.items()
    }


def forces_script(model: Mechanism | ConstraintSystem) -> str:
    """Return the script that declares `forces`: a module whose outputs are forces, or null.

    None exists without loads, where redundant joints share them, and in large mechanisms.
    """
    system = model.system()
    program = None
    if system.loads and len(system.coordinates) <= MOST_COORDINATES:
        try:
            program = compiler.forces_program(system)
        except (ModelError, UnsupportedError):  # a name is taken, or a type has no reactions
            program = None
    if program is None:
        return "const forces = null;\n"
    source = emit_program("javascript", inline(program)).source
    return (
        f"const forces = (() => {{\nconst module = {{ exports: {{}} }};\n{source}"
        f"return {{ ...module.exports, SOLVED: {SOLVED!r} }};\n}})();\n"
    )


def geometry_script(system: ConstraintSystem, drawing: Mapping[str, Any]) -> str:
    """Return the script that declares `geometry`: what of a drawing depends on parameters.

    `places` are the ways to numbers in the drawing, and `numbers(0, p)` gives these. `profiles` has
    the way to each curve, and the function of an angle and p that gives its radius. Corners of
    hulls have no way: they are found again from the points attached.
    """
    names = [item.name for item in system.parameters]
    hulls = {k for k, mark in enumerate(drawing["marks"]) if mark["kind"] == "hull"}
    found = [
        (place, item)
        for place, item in live_places(drawing)
        if not (place[0] == "marks" and place[1] in hulls and place[2] == "points")
    ]
    nodes = (node for _, item in found for node in item.graph.nodes)
    tables = sorted({str(node[1]) for node in nodes if node[0] == "table"})
    curves = [(place[:-1], item) for place, item in found if place[-1] == "rho"]
    numbers = [(place, item) for place, item in found if place[-1] != "rho"]
    functions = function_text("numbers", [item for _, item in numbers], names, tables)
    profiles = []
    for k, (place, item) in enumerate(curves):
        functions += function_text(f"profile_{k}", [item], names, tables)
        profiles.append(f"{{ place: {json.dumps(place)}, radius: profile_{k} }}")
    return (
        "const geometry = (() => {\nconst square = x => x * x;\n"
        + (f"const {{ spline, {', '.join(tables)} }} = emitted.tables ?? {{}};\n" if tables else "")
        + f"{functions}return {{ places: {json.dumps([place for place, _ in numbers])}, numbers, "
        f"profiles: [{', '.join(profiles)}] }};\n}})();\n"
    )


def function_text(
    name: str, numbers: Sequence[LiveNumber], parameters: Sequence[str], tables: Sequence[str]
) -> str:
    """Return a JavaScript function of an angle and of parameters that gives numbers as an array."""
    table = NameTable((*RESERVED, *tables))
    graph = numbers[0].graph if numbers else Graph()
    outputs = [item.node for item in numbers]
    scheduler = Scheduler(graph.nodes, outputs, {}, table, {})
    lines = []
    for node in scheduler.uses:
        if graph.nodes[node][0] == "input":
            wanted = str(graph.nodes[node][1])
            scheduler.names[node] = ANGLE if wanted == ANGLE else table.take(wanted)
            if wanted != ANGLE:
                place = f"p[{parameters.index(wanted)}]"
                lines.append(f"const {scheduler.names[node]} = {place};")
    steps = scheduler.assign("g", scheduler.operands_first(outputs))
    printer = Printer(JAVASCRIPT, graph.nodes, scheduler.names)
    lines += [f"const {item.name} = {printer.definition(item.node)};" for item in steps]
    lines += ["return [", *(f"    {line}" for line in wrapped(map(printer.text, outputs))), "];"]
    return f"function {name}({ANGLE}, p) {{\n{indented(lines)}\n}}\n"


def _without(name: str, reason: str) -> str:
    return f"const {name} = {json.dumps({'reason': reason})};\n".replace("<", "\\u003c")

"""The kernels of all types in the plane as one script, each once, for what is drawn in a browser.

An emitted module has the code of one mechanism. This script has that of every type of constraint in
its own inputs, from the same derivation, so that another script binds instances of them to bodies
and numbers; and the solver for any number of coordinates.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from kincompile.criteria import probe_of
from kincompile.emitters.constants import items
from kincompile.emitters.javascript.functions import JAVASCRIPT
from kincompile.emitters.javascript.target import RESERVED, solver_text
from kincompile.emitters.lines import braced, indented, wrapped
from kincompile.emitters.naming import NameTable
from kincompile.emitters.printer import Printer
from kincompile.emitters.schedule import Scheduler
from kincompile.ir.differentiate import derivative
from kincompile.ir.from_sympy import FUNCTIONS, Converter
from kincompile.ir.graph import Graph
from kincompile.ir.kernels import constraint_kernel, frame_kernel
from kincompile.ir.program import Attribute, FrameEntry, Function, StateEntry
from kincompile.model.bodies import PLANAR
from kincompile.model.catalogue import CONSTRAINTS
from kincompile.model.laws import RISES
from kincompile.report.templates import fill

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.ir.graph import Node
    from kincompile.ir.program import Input, Kernel
    from kincompile.model.constraint import Constraint

MOST_EQUATIONS = 300
"""Equations and coordinates for which there are numbers without a pattern."""

HIGHEST = 3
"""Derivatives of a law or profile that a kernel may ask for: those of a cam's radius."""

FUNCTIONS_OF = {"position": ("Phi", "Phi_q"), "nu": ("nu",), "gamma": ("gamma",)}
"""The functions of a type, and the quantities that each fills in."""

WORDS = (*RESERVED, "v", "from", "row", "places", "u", "ramp", "exponent")
"""Names that the functions use."""


def kernels_script() -> str:
    """Return the script that declares `kernels`: types, laws, functions and the solver."""
    return fill(
        "javascript/kernels.js.jinja",
        {
            "frame": indented(_frame(), 1),
            "types": indented(_types(), 2),
            "laws": indented(_laws(), 2),
            "probe": indented(wrapped(items(probe_of(MOST_EQUATIONS).tolist())), 2),
            "titles": json.dumps({title: law.__name__ for title, law in RISES.items()}),
            "functions": indented(_elementary(), 2),
            "solver": solver_text([]),
            "tables": ", ".join(TABLES),
        },
    )


TABLES = ("ANGULAR", "IS_REDUNDANT", "PROBE", "MAY_TURN", "COVER")
"""The tables of a mechanism by which the solver judges."""


def _types() -> list[str]:
    lines: list[str] = []
    for name, kind in CONSTRAINTS.items():
        kernel = constraint_kernel(kind.template())
        lines += [f"{name}: {{", *indented(_type(kind, kernel)).split("\n"), "},"]
    return lines


def _type(kind: type[Constraint], kernel: Kernel) -> list[str]:
    """Return the arguments of a type, what its kernel reads and gives, and its functions."""
    given = [
        [name, item.kind.name.lower(), item.symbol, item.on]
        for name, item in kind.arguments().items()
    ]
    template = kind.template()
    places = [[row, column] for row, column, _ in kernel.outputs["Phi_q"]]
    facts = {
        "arguments": given,
        "rows": list(kind.row_names),
        "contacts": [item.index for item in kind.contacts],
        "frames": len(template.frames),
        "inputs": [_input(item) for item in kernel.inputs if not isinstance(item, str)],
        "pattern": places,
        "setsMotion": kind.sets_motion,
    }
    lines = [f"{key}: {json.dumps(value)}," for key, value in facts.items()]
    for name, quantities in FUNCTIONS_OF.items():
        lines += _function(name, kernel, quantities)
    return lines


def _input(item: Input) -> list[str | int | None]:
    """Return where an input comes from: its kind, and what says which one it is."""
    match item:
        case StateEntry(owner, component, order):
            return ["state", owner, component, order]
        case FrameEntry(owner, entry):
            return ["frame", owner, entry]
        case Attribute(symbol, component):
            return ["attribute", symbol, component]
        case Function(symbol, order, owner):
            return ["function", symbol, order, owner]


def _function(name: str, kernel: Kernel, quantities: Sequence[str]) -> list[str]:
    """Return a function of a kernel: values `v`, places of inputs in it, and where results go."""
    table, named = NameTable(WORDS), {hint.node: hint.name for hint in kernel.hints}
    outputs = [entry[2] for quantity in quantities for entry in kernel.outputs[quantity]]
    scheduler = Scheduler(kernel.nodes, outputs, {}, table, named)
    lines = []
    for node in sorted(scheduler.uses):
        if kernel.nodes[node][0] == "input":
            item = kernel.nodes[node][1]
            scheduler.names[node] = table.take(item.name)
            lines.append(f"const {scheduler.names[node]} = v[from[{kernel.inputs.index(item)}]];")
    lines += _steps(scheduler, kernel.nodes, outputs)
    printer = Printer(JAVASCRIPT, kernel.nodes, scheduler.names)
    for quantity in quantities:
        for k, (row, _, node) in enumerate(kernel.outputs[quantity]):
            place = f"places[{k}]" if quantity == "Phi_q" else f"row + {row}" if row else "row"
            lines.append(f"{quantity}[{place}] = {printer.text(node)};")
    taken = "".join(f", {quantity}" for quantity in quantities)
    more = ", places" if "Phi_q" in quantities else ""
    head, *body = braced([f"{name}(v, from, row{more}{taken}) {{"], lines)
    return [head, *body[:-1], "},"]


def _steps(scheduler: Scheduler, nodes: Sequence[Node], outputs: Sequence[int]) -> list[str]:
    steps = scheduler.assign("part", scheduler.operands_first(outputs))
    printer = Printer(JAVASCRIPT, nodes, scheduler.names)
    return [f"const {item.name} = {printer.definition(item.node)};" for item in steps]


def _frame() -> list[str]:
    """Return the function that puts what the frame of a body gives into values."""
    kernel = frame_kernel(PLANAR.frame("i"))
    names = {
        k: f"v[first + {node[1]}]" for k, node in enumerate(kernel.nodes) if node[0] == "input"
    }
    printer = Printer(JAVASCRIPT, kernel.nodes, names)
    lines = [f"v[place + {k}] = {printer.text(node)};" for k, node in enumerate(kernel.entries)]
    return braced(["function frame(v, first, place) {"], lines)


def _laws() -> list[str]:
    """Return each motion law by its name: its value and derivatives by u as an array."""
    lines = []
    for law in RISES.values():
        graph = Graph()
        node = Converter(graph, graph.input).convert(law.written_out())
        lines += _derivatives(law.__name__, ("u", "ramp"), graph, node)
    return lines


def _elementary() -> list[str]:
    """Return each elementary function of one argument, and powers, in the same way."""
    lines = []
    for name in (*FUNCTIONS.values(), "sqrt"):
        if name != "atan2":
            graph = Graph()
            lines += _derivatives(name, ("u",), graph, graph.call(name, graph.input("u")))
    graph = Graph()
    node = graph.call("pow", graph.input("u"), graph.input("exponent"))
    return [*lines, *_derivatives("pow", ("u", "exponent"), graph, node)]


def _derivatives(name: str, given: Sequence[str], graph: Graph, node: int) -> list[str]:
    """Return a function that gives a value and its derivatives by the first argument."""
    outputs = [derivative(graph, node, given[0], order) for order in range(HIGHEST + 1)]
    inputs: Mapping[int, str] = {graph.input(word): word for word in given}
    scheduler = Scheduler(graph.nodes, outputs, dict(inputs), NameTable(WORDS), {})
    lines = _steps(scheduler, graph.nodes, outputs)
    printer = Printer(JAVASCRIPT, graph.nodes, scheduler.names)
    lines.append(f"return [{', '.join(map(printer.text, outputs))}];")
    head, *body = braced([f"{name}({', '.join(given)}) {{"], lines)
    return [head, *body[:-1], "},"]

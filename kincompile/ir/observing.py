"""Programs without equations: what is known of a mechanism along its motion, as outputs alone."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING

from kincompile.ir.graph import Graph
from kincompile.ir.kernels import pruned_kernel
from kincompile.ir.program import Instance, OutputDerivatives

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.ir.graph import Node
    from kincompile.ir.program import Program
    from kincompile.model.bodies import Parameter
    from kincompile.model.points import OutputColumn


def observing_program(
    program: Program,
    name: str,
    graph: Graph,
    outputs: Mapping[str, Sequence[int]],
    titles: Sequence[OutputColumn],
    *,
    key: object = (),
    added: Sequence[Parameter] = (),
) -> Program:
    """Return a program without equations and loads, with these outputs, by quantity, of a graph.

    The name says what the outputs are, titles have the name and unit of each, the key is what else
    tells one such program from another; further parameters are added.
    """
    instance, values = bound(program, name, graph, outputs, titles)
    return replace(
        program,
        equations=(),
        instances=(),
        loads=(),
        redundant=(),
        parameters=(*program.parameters, *added),
        values=values,
        fingerprint=marked(program, name, key),
        unsolvable="it has no equations",
        observers=(instance,),
    )


def bound(
    program: Program,
    name: str,
    graph: Graph,
    outputs: Mapping[str, Sequence[int]],
    titles: Sequence[OutputColumn] = (),
) -> tuple[Instance, tuple[Node, ...]]:
    """Return an instance that gives vectors of a mechanism, and the values that feed it.

    The outputs are nodes of the graph by quantity, of all rows.
    """
    entries = {
        quantity: [(row, 0, node) for row, node in enumerate(nodes)]
        for quantity, nodes in outputs.items()
    }
    kernel = pruned_kernel(name.capitalize(), graph, entries)
    values = Graph(program.values)
    bindings = tuple(values.input(item) for item in kernel.inputs)
    about = OutputDerivatives(name, (), tuple(titles))
    columns = tuple(range(len(program.coordinates)))
    return Instance(kernel, about, 0, columns, bindings), tuple(values.nodes)


def marked(program: Program, name: str, key: object) -> str:
    """Return the fingerprint of a program that is made of another."""
    content = repr((program.fingerprint, name, key))
    return hashlib.sha256(content.encode()).hexdigest()[:32]

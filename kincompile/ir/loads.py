"""Kernels of loads, and what their inputs stand for in a mechanism."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import Norm, Scalar, Symbol
from kincompile.derive.loads import derive_load, slope_of
from kincompile.ir.differentiate import tangents
from kincompile.ir.kernels import KernelEnvironment, attributes, kernel_of
from kincompile.ir.program import Attribute, Hint
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from kincompile.derive.loads import Leaf, LoadTemplate
    from kincompile.ir.graph import Graph
    from kincompile.ir.program import Input, Kernel
    from kincompile.model.expressions import Scalar as Value
    from kincompile.model.resolve_loads import AppliedLoad

    Entries = list[tuple[int, int, int]]


@cache
def load_kernel(template: LoadTemplate, others: int, *, varies: bool) -> Kernel:
    """Return the kernel of a type of load whose values depend on a number of other coordinates."""
    environment = KernelEnvironment(template)
    expansion = Expansion(environment)
    found = derive_load(template, others, varies=varies)
    outputs: dict[str, Entries] = {
        "M": _matrix(expansion, found.M),
        "Q": [(row, 0, expansion.scalar(force).node) for row, force in enumerate(found.Q)],
        "Q_q": _matrix(expansion, found.Q_q),
        "Q_q_dot": _matrix(expansion, found.Q_q_dot),
    }
    kernel = kernel_of(template, environment, expansion, outputs)
    return replace(kernel, hints=(*_hints(template, expansion), *kernel.hints))


def _hints(template: LoadTemplate, expansion: Expansion) -> tuple[Hint, ...]:
    """Name the length of a spring, and what it pulls or turns back with."""
    named = [(force, "load") for force, _ in template.work]
    named += [(moved, "length") for _, moved in template.work if isinstance(moved, Norm)]
    found = []
    for expression, name in named:
        if isinstance(expression, Scalar) and expression in expansion.scalars:
            node = expansion.scalars[expression].node
            content = expansion.scalars[expression].graph.nodes[node]
            found.append(Hint(content[1] if content[0] == "neg" else node, None, name, name))
    return tuple(found)


def _matrix(expansion: Expansion, rows: tuple[tuple[Scalar, ...], ...]) -> Entries:
    """Return row, column and node of the entries that are not identically zero."""
    return [
        (row, column, item.node)
        for row, entries in enumerate(rows)
        for column, item in enumerate(map(expansion.scalar, entries))
        if item.graph.value_of(item.node) != 0
    ]


def slopes(
    load: AppliedLoad, graph: Graph, convert: Callable[[Value], int]
) -> dict[Input | str, int]:
    """Return the nodes of the derivatives of a load's values, by the inputs of its kernel."""
    if not load.varies:
        return {}
    found: dict[Input | str, int] = {}
    one = graph.const(1)
    for leaf, values in _values(load):
        nodes = [convert(value) for value in values]
        for column, name in enumerate(load.columns):
            for by_rate in (False, True):
                derivatives = [graph.const(0)] * len(nodes)
                if name is not None:
                    by = graph.input(rate(name) if by_rate else name)
                    derivatives = tangents(graph, nodes, {by: one})
                symbol = slope_of(leaf, column, by_rate=by_rate)
                own = attributes(symbol.name, symbol.size)
                if isinstance(symbol, Symbol):
                    own = (Attribute(symbol.name, 0, symbol.name),)
                found |= zip(own, derivatives, strict=True)
    return found


def _values(load: AppliedLoad) -> Iterator[tuple[Leaf, tuple[Value, ...]]]:
    """Yield the symbols of a load's values, and what they are."""
    for leaf in load.template.values:
        if isinstance(leaf, Symbol):
            yield leaf, (load.scalars[leaf.name],)
        else:
            yield leaf, load.points[leaf.name]

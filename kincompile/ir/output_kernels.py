"""Kernels of outputs: of points, and of expressions with points, angles and rates in them."""

from __future__ import annotations

from functools import cache, lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, cast

import sympy

from kincompile.calculus.expand import Expansion
from kincompile.derive.derivation import units
from kincompile.derive.rules import along
from kincompile.ir.differentiate import tangents
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph, pruned, reachable
from kincompile.ir.kernels import (
    KernelEnvironment,
    frame_kernel,
    kernel_of,
    nonzeros,
    pruned_kernel,
)
from kincompile.ir.program import Attribute, FrameEntry, Input, Kernel, StateEntry
from kincompile.model.directions import VectorFunction, turning
from kincompile.model.points import PointCoordinate, point_template
from kincompile.model.points import rate as rate_of
from kincompile.names import rate
from kincompile.quantities import TOGETHER

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from kincompile.calculus.expressions import Expression
    from kincompile.calculus.symbols import Frame
    from kincompile.ir.graph import Node
    from kincompile.model.expressions import Scalar
    from kincompile.model.outputs import ResolvedOutput


@cache
def point_kernel(frame: Frame) -> Kernel:
    r"""Return the kernel of a point: r + A s, its derivatives along the motion, and by q.

    In the plane they are :math:`\dot r + B s \dot\phi` and
    :math:`\ddot r + B s \ddot\phi - A s \dot\phi^2`.
    """
    template = point_template(frame)
    environment = KernelEnvironment(template)
    expansion = Expansion(environment, template.dimension)
    (found,) = template.Phi
    motion: dict[Expression, Expression] = dict(zip(frame.coordinates, frame.rates, strict=True))
    motion |= zip(frame.rates, frame.second_rates, strict=True)
    found_dot = along(found, motion)
    orders = found, found_dot, along(found_dot, motion)
    by_column = [along(found, {item: x}) for item in frame.coordinates for x in units(item)]
    outputs = {
        name: [(row, 0, item.node) for row, item in enumerate(expansion.components(order))]
        for name, order in zip(TOGETHER["observe"], orders, strict=True)
    }
    outputs["outputs_q"] = nonzeros(expansion, by_column)
    return kernel_of(template, environment, expansion, outputs)


@cache
def _point_row(frame: Frame, row: int) -> Kernel:
    """Return the part of a point's kernel that gives one of its coordinates."""
    kernel, graph = point_kernel(frame), Graph(point_kernel(frame).nodes)
    outputs = {
        name: [(0, column, node) for own, column, node in found if own == row]
        for name, found in kernel.outputs.items()
    }
    return pruned_kernel("Point", graph, outputs)


class _OutputConverter(Converter):
    """Writes an output into a graph: points by their kernel, rates by differentiation.

    Coordinates, parameters and the places of points are numbered in the order in which they occur,
    so that outputs of equal structure are the same code.
    """

    def __init__(self, graph: Graph, columns: Sequence[str]) -> None:
        super().__init__(graph, self._named)
        # What each input stands for: a name, or the value of an attribute.
        self.given: dict[Input | str, Scalar | str] = {"t": "t"}
        # The rate of each node that moves, as far as it is known without the rules.
        self.motion = {graph.input("t"): graph.const(1)}
        # The derivatives of such nodes by each coordinate.
        self.by_column: dict[str, dict[int, int]] = {}
        self.turns: list[Turn] = []  # the angles between vectors
        self._frames: dict[tuple[Any, ...], list[int]] = {}
        for k, name in enumerate(columns):
            entries = [StateEntry(0, k, order, rate(f"q_{k}", order)) for order in range(3)]
            self.given |= {item: rate(name, item.order) for item in entries}
            orders = [graph.input(item) for item in entries]
            self.motion |= dict(pairwise(orders))
            self.by_column[name] = {orders[0]: graph.const(1)}
        self._inputs: dict[Scalar | str, Input | str] = {
            name: item for item, name in self.given.items()
        }

    def _named(self, value: Scalar | str) -> int:
        """Return the node of the name of what moves, or of an attribute."""
        if value not in self._inputs:
            k = len(self.given)
            item = self._inputs[value] = Attribute("c", k, f"c_{k}")
            self.given[item] = value
        return self._graph.input(self._inputs[value])

    def _ordered(self, value: sympy.Add | sympy.Mul) -> list[sympy.Expr]:
        """Return terms in SymPy's own order, which costs nothing, a positive one first."""
        if value.is_Mul:
            return list(value.args)
        return sorted(value.args, key=lambda item: bool(item.could_extract_minus_sign()))

    def _function(self, value: sympy.Basic) -> int:
        if isinstance(value, PointCoordinate):
            return self._point(value)
        if isinstance(value, VectorFunction):
            return self._vector_function(value)
        if isinstance(value, rate_of):
            return tangents(self._graph, [self.convert(value.args[0])], self.motion)[0]
        return super()._function(value)

    def _point(self, value: PointCoordinate) -> int:
        """Return the node of a point's coordinate; its derivatives are those of the kernel."""
        graph, kernel = self._graph, _point_row(value.frame, value.row)
        names = {column: item.name for column, item in value.moving.items()}
        if not self.by_column.keys() >= set(names.values()):
            return self.convert(value.written_out())
        inputs: dict[Input | str, int] = {}
        entries = self._frame(value.frame, names)
        for item in kernel.inputs:
            match item:
                case StateEntry(_, component, order):
                    own = names.get(component)
                    inputs[item] = self._named(rate(own, order)) if own else graph.const(0)
                case FrameEntry(_, entry):
                    inputs[item] = entries[entry]
                case Attribute(_, place):
                    inputs[item] = self._named(cast("sympy.Expr", value.local[place]))
        new = graph.instantiate(kernel.nodes, inputs)
        orders = [new[kernel.outputs[name][0][2]] for name in TOGETHER["observe"]]
        self.motion |= dict(pairwise(orders))
        for _, column, node in kernel.outputs["outputs_q"]:
            self.by_column[names[column]][orders[0]] = new[node]
        return orders[0]

    def _vector_function(self, value: VectorFunction) -> int:
        """Return the node of a length or an angle."""
        graph, (nodes, last) = self._graph, _vector_code(type(value), len(value.args))
        parts = [self.convert(item) for item in value.args]
        node = graph.instantiate(nodes, dict(enumerate(parts)))[last]
        if isinstance(value, turning):
            start, end = map(self._heading, value.vectors)
            a, b, c, d = parts
            sine = None if value.is_signed else graph.sub(graph.mul(a, d), graph.mul(b, c))
            self.turns.append((node, start, end, sine))
        return node

    def _heading(self, vector: tuple[sympy.Expr, ...]) -> int:
        """Return the angle of a vector's direction; of a body's axis the body's."""
        x, y = vector
        if isinstance(x, sympy.cos) and isinstance(y, sympy.sin) and x.args == y.args:
            return self.convert(x.args[0])
        return self._graph.call("atan2", self.convert(y), self.convert(x))

    def _frame(self, frame: Frame, names: Mapping[int, str]) -> list[int]:
        """Return the entries of a body's frame."""
        kernel = frame_kernel(frame)
        used = {item[1] for item in kernel.nodes if item[0] == "input"}
        inputs = {column: self._named(name) for column, name in names.items() if column in used}
        key = frame, *inputs.values()
        if key not in self._frames:
            new = self._graph.instantiate(kernel.nodes, inputs)
            self._frames[key] = [new[node] for node in kernel.entries]
        return self._frames[key]


@cache
def _vector_code(kind: type[VectorFunction], count: int) -> tuple[list[Node], int]:
    """Return the code of a function of vectors in its components, and the node of its value."""
    graph = Graph()
    components = sympy.symbols(f"u:{count}")
    numbers = {item.name: k for k, item in enumerate(components)}
    converter = Converter(graph, lambda name: graph.input(numbers[name]))
    node = converter.convert(kind(*components).formula)
    nodes, new = pruned(graph.nodes, [node])
    return nodes, new[node]


def output_kernel(output: ResolvedOutput) -> tuple[Kernel, Mapping[Input | str, Scalar | str]]:
    """Return the kernel of an output, and the name or value that each of its inputs stands for."""
    return _kernel_of_value(output.value, output.columns)


@lru_cache(maxsize=1024)
def _kernel_of_value(
    value: sympy.Expr, columns: tuple[str, ...]
) -> tuple[Kernel, Mapping[Input | str, Scalar | str]]:
    graph = Graph()
    converter = _OutputConverter(graph, columns)
    y = converter.convert(value)
    by_column = (tuple(own.items()) for own in converter.by_column.values())
    motion = tuple(converter.motion.items())
    # 0.5 and 1/2 are equal, and printed differently.
    kinds = tuple(type(node[1]) for node in graph.nodes if node[0] == "const")
    turns = tuple(converter.turns)
    kernel = _observing(tuple(graph.nodes), y, motion, tuple(by_column), turns, kinds)
    return kernel, converter.given


Direction = tuple[tuple[int, int], ...]
Turn = tuple[int, int, int, int | None]
"""An angle, the directions between which it is, and what its sign is lost of, if it is."""


@lru_cache(maxsize=1024)
def _observing(
    nodes: tuple[Node, ...],
    y: int,
    motion: Direction,
    by_column: tuple[Direction, ...],
    turns: tuple[Turn, ...],
    kinds: tuple[type, ...],
) -> Kernel:
    r"""Return the kernel of an output y, with :math:`\dot y`, :math:`\ddot y` and :math:`y_q`.

    A derivative that would need a third derivative of q is not a number. What is kept depends on
    the kinds of the numbers too.
    """
    del kinds
    graph = Graph(nodes)
    last = {
        graph.input(node[1])
        for node in nodes
        if node[0] == "input" and isinstance(node[1], StateEntry) and node[1].order == 2
    }
    along_motion, *along_columns = (
        _with_turns(graph, direction, turns) for direction in (motion, *by_column)
    )
    found = [y]
    for _ in range(2):
        is_known = last.union([graph.nan()]).isdisjoint(reachable(graph.nodes, found[-1:]))
        found += tangents(graph, found[-1:], along_motion) if is_known else [graph.nan()]
    outputs = {name: [(0, 0, node)] for name, node in zip(TOGETHER["observe"], found, strict=True)}
    slopes = [tangents(graph, [y], direction)[0] for direction in along_columns]
    outputs["outputs_q"] = [
        (0, column, node) for column, node in enumerate(slopes) if graph.value_of(node) != 0
    ]
    return pruned_kernel("Output", graph, outputs)


def _with_turns(graph: Graph, direction: Direction, turns: Iterable[Turn]) -> dict[int, int]:
    """Return a direction with the derivatives of angles: those of one heading less the other's.

    From the sine and cosine of the angle they would be twice as long.
    """
    found = dict(direction)
    for node, start, end, sine in turns:
        if sine is not None and graph.value_of(sine) is not None:
            continue  # one of the two vectors does not move across the other
        before, after = tangents(graph, [start, end], found)
        turned = graph.sub(after, before)
        if sine is not None:  # the rate changes sign with the sine, and does not exist at 0
            sign = graph.div(sine, graph.call("sqrt", graph.square(sine)))
            found[sign] = graph.const(0)
            turned = graph.mul(sign, turned)
        found[node] = turned
    return found

"""Kernels: the derivation of a constraint type as straight-line code, made once and kept."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from kincompile.calculus.expand import Expansion, Pair, Value
from kincompile.calculus.expressions import (
    Basis,
    Power,
    Scalar,
    Scaled,
    Symbol,
    Turned,
    Vector,
    VectorSum,
    VectorSymbol,
)
from kincompile.derive.derivation import derive
from kincompile.ir.differentiate import negated_tangents, tangents
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph, pruned
from kincompile.ir.program import Kernel
from kincompile.model.matrices import entry_columns
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from kincompile.calculus.template import Template
    from kincompile.model.resolve import FreeEquation


@dataclass(frozen=True, slots=True)
class Code:
    """A node that adds and multiplies like a number."""

    graph: Graph
    node: int

    def __add__(self, other: Code) -> Code:
        return Code(self.graph, self.graph.add(self.node, other.node))

    def __sub__(self, other: Code) -> Code:
        return Code(self.graph, self.graph.sub(self.node, other.node))

    def __mul__(self, other: Code) -> Code:
        return Code(self.graph, self.graph.mul(self.node, other.node))

    def __neg__(self) -> Code:
        return Code(self.graph, self.graph.neg(self.node))

    def __pow__(self, exponent: int) -> Code:
        return Code(self.graph, self.graph.pow(self.node, exponent))


class KernelEnvironment:
    """The leaves of a template as inputs of its kernel, each named as in the textbook."""

    def __init__(self, template: Template) -> None:
        self.graph = Graph()
        self.inputs: dict[str, int] = {}
        self._frame_angles = {frame.phi for frame in template.frames}

    def _input(self, name: str) -> Code:
        node = self.inputs[name] = self.graph.input(name)
        return Code(self.graph, node)

    def number(self, value: Fraction) -> Value:
        """Return an exact number."""
        return Code(self.graph, self.graph.const(value))

    def pi(self) -> Value:
        """Return pi."""
        return Code(self.graph, self.graph.pi())

    def symbol(self, name: str) -> Value:
        """Return a coordinate, a rate or a scalar attribute."""
        return self._input(name)

    def vector(self, name: str) -> Pair:
        """Return the components of a vector as two inputs."""
        return self._input(f"{name}.x"), self._input(f"{name}.y")

    def time_function(self, name: str, order: int) -> Value:
        """Return C(t) or one of its derivatives."""
        return self._input(derivative_name(name, order))

    def profile(self, name: str, order: int) -> Value:
        """Return rho(alpha) or one of its derivatives."""
        return self._input(derivative_name(name, order))

    def cos_sin(self, angle: Scalar, expand: Expansion) -> Pair:
        """Return cosine and sine: inputs for a body's angle, whose frame is shared, else code."""
        if angle in self._frame_angles:
            assert isinstance(angle, Symbol)
            return self._input(f"cos {angle.name}"), self._input(f"sin {angle.name}")
        node = expand.scalar(angle).node
        return Code(self.graph, self.graph.call("cos", node)), Code(
            self.graph, self.graph.call("sin", node)
        )

    def sqrt(self, value: Value) -> Value:
        """Return a square root."""
        return Code(self.graph, self.graph.call("sqrt", value.node))


def derivative_name(name: str, order: int) -> str:
    """Return the name of a derivative as a kernel's input: C, C', C''."""
    return name + "'" * order


@cache
def constraint_kernel(template: Template) -> Kernel:
    """Return the kernel of a constraint type."""
    environment = KernelEnvironment(template)
    expansion = Expansion(environment)
    Phi: list[int] = []
    nu: list[int] = []
    gamma: list[int] = []
    entries: list[tuple[int, int, int]] = []
    for block in derive(template):
        columns: list[tuple[Code, ...]] = []
        is_vector = isinstance(block.Phi, Vector)
        for coordinate, entry in zip(template.coordinates, block.Phi_q, strict=True):
            columns += entry_columns(entry, is_vector, isinstance(coordinate, Vector), expansion)
        entries += [
            (len(Phi) + row, column, item.node)
            for column, items in enumerate(columns)
            for row, item in enumerate(items)
            if environment.graph.value_of(item.node) != 0
        ]
        Phi += [item.node for item in expansion.components(block.Phi)]
        nu += [item.node for item in expansion.components(block.nu)]
        gamma += [item.node for item in expansion.components(block.gamma)]
    return Kernel(
        template.type_name,
        tuple(environment.inputs),
        tuple(environment.graph.nodes),
        tuple(Phi),
        tuple(sorted(entries)),
        tuple(nu),
        tuple(gamma),
        _hints(expansion),
    )


def _hints(expansion: Expansion) -> tuple[tuple[int, str], ...]:
    """Name the components of vectors that a reader knows from the textbook.

    They are A_i s_i, the centripetal A_i s_i w_i^2, d and its rate, and A_i u(alpha_i) of a cam.
    """
    found = []
    for vector, pair in expansion.vectors.items():
        stem = _stem(vector)
        if stem is not None:
            found += [(item.node, f"{stem}.{axis}") for axis, item in zip("xy", pair, strict=True)]
    return tuple(found)


def _stem(vector: Vector) -> str | None:
    match vector:
        case Turned(Symbol(), VectorSymbol(name), 0):
            return name
        case Scaled(Power(Symbol(), 2), Turned(Symbol(), VectorSymbol(name), 0)):
            return f"{name} w2"
        case Turned(Symbol(), Turned(Symbol(name), Basis(), 0), 0):
            return name.replace("alpha", "u")
        case VectorSum(terms):
            names = {term.name for term in terms if isinstance(term, VectorSymbol)}
            if "r_j" in names or names == {"r_i", "c"}:
                return "d"
            return "d_dot" if "r_j_dot" in names or names == {"r_i_dot"} else None
    return None


def equation_kernel(equation: FreeEquation) -> Kernel:
    """Return the kernel of a free equation; its inputs are the names that occur in it."""
    graph = Graph()
    convert = Converter(graph, graph.input).convert
    return differentiated(graph, [convert(item) for item in equation.expressions], equation.columns)


def differentiated(graph: Graph, Phi: Sequence[int], columns: Sequence[str]) -> Kernel:
    r"""Return the kernel of equations given as nodes, in the coordinates that are named.

    With :math:`\dot q` constant and :math:`\dot t = 1`, the second derivative of Phi along the
    motion is :math:`-\gamma`.
    """
    one, t = graph.const(1), graph.input("t")
    motion = {graph.input(name): graph.input(rate(name)) for name in columns} | {t: one}
    by_column = [tangents(graph, Phi, {graph.input(name): one}) for name in columns]
    nu = negated_tangents(graph, Phi, {t: one})
    gamma = negated_tangents(graph, tangents(graph, Phi, motion), motion)
    entries = [
        (row, column, node)
        for row in range(len(Phi))
        for column, node in enumerate(found[row] for found in by_column)
        if graph.value_of(node) != 0
    ]
    nodes, new = pruned(graph.nodes, [*Phi, *nu, *gamma, *(node for _, _, node in entries)])
    return Kernel(
        "Equation",
        tuple(node[1] for node in nodes if node[0] == "input"),
        tuple(nodes),
        tuple(new[node] for node in Phi),
        tuple((row, column, new[node]) for row, column, node in entries),
        tuple(new[node] for node in nu),
        tuple(new[node] for node in gamma),
        (),
    )

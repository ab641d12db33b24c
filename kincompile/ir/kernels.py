"""Kernels: the derivation of a constraint type as straight-line code, made once and kept."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import (
    Basis,
    Power,
    Rotated,
    Scaled,
    Symbol,
    Vector,
    VectorSum,
    VectorSymbol,
)
from kincompile.derive.derivation import derive
from kincompile.ir.differentiate import negated_tangents, tangents
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph, pruned
from kincompile.ir.program import Kernel
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction

    from kincompile.calculus.expressions import Components, Profile, Rotation, TimeFunction, Value
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
        self._frames = {frame.rotation: frame for frame in template.frames}

    def _input(self, name: str) -> Code:
        node = self.inputs[name] = self.graph.input(name)
        return Code(self.graph, node)

    def number(self, value: Fraction) -> Value:
        """Return an exact number."""
        return Code(self.graph, self.graph.const(value))

    def pi(self) -> Value:
        """Return pi."""
        return Code(self.graph, self.graph.pi())

    def symbol(self, symbol: Symbol) -> Value:
        """Return a coordinate, a rate or a scalar attribute."""
        return self._input(symbol.name)

    def vector(self, symbol: VectorSymbol) -> Components:
        """Return the components of a vector as inputs."""
        return tuple(self._input(f"{symbol.name}.{axis}") for axis in "xy"[: symbol.size])

    def time_function(self, function: TimeFunction) -> Value:
        """Return C(t) or one of its derivatives."""
        return self._input(derivative_name(function.name, function.order))

    def profile(self, profile: Profile) -> Value:
        """Return rho(alpha) or one of its derivatives."""
        return self._input(derivative_name(profile.name, profile.order))

    def entries(self, rotation: Rotation, expand: Expansion) -> Components:
        """Return cosine and sine: inputs for a body's angle, whose frame is shared, else code."""
        frame = self._frames.get(rotation)
        if frame is None:
            return expand.entries(rotation)
        return tuple(self._input(f"{name} {frame.phi.name}") for name in ("cos", "sin"))

    def call(self, function: str, value: Value) -> Value:
        """Return an elementary function."""
        return Code(self.graph, self.graph.call(function, value.node))


def derivative_name(name: str, order: int) -> str:
    """Return the name of a derivative as a kernel's input: C, C', C''."""
    return name + "'" * order


@cache
def constraint_kernel(template: Template) -> Kernel:
    """Return the kernel of a constraint type."""
    environment = KernelEnvironment(template)
    expansion = Expansion(environment)
    outputs: dict[str, list[tuple[int, int, int]]] = {}
    first = 0
    for block in derive(template):
        columns = [expansion.components(column) for column in block.Phi_q]
        outputs.setdefault("Phi_q", []).extend(
            (first + row, column, item.node)
            for column, items in enumerate(columns)
            for row, item in enumerate(items)
            if environment.graph.value_of(item.node) != 0
        )
        vectors = {"Phi": block.Phi, "nu": block.nu, "gamma": block.gamma}
        for name, vector in vectors.items():
            outputs.setdefault(name, []).extend(
                (first + row, 0, item.node) for row, item in enumerate(expansion.components(vector))
            )
        first = len(outputs["Phi"])
    return Kernel(
        template.type_name,
        tuple(environment.inputs),
        tuple(environment.graph.nodes),
        {name: tuple(sorted(entries)) for name, entries in outputs.items()},
        _hints(template, expansion),
    )


def _hints(template: Template, expansion: Expansion) -> tuple[tuple[int, str], ...]:
    """Name the components of vectors that a reader knows from the textbook.

    They are A_i s_i, the centripetal A_i s_i w_i^2, d and its rate, and A_i u(alpha_i) of a cam.
    """
    found = []
    for vector, pair in expansion.vectors.items():
        stem = _stem(template, vector)
        if stem is not None:
            found += [(item.node, f"{stem}.{axis}") for axis, item in zip("xy", pair, strict=True)]
    return tuple(found)


def _stem(template: Template, vector: Vector) -> str | None:
    match vector:
        case Rotated(_, VectorSymbol(name), ()):
            return name
        case Scaled(Power(Symbol(), 2), Rotated(_, VectorSymbol(name), ())):
            return f"{name} w2"
        case Rotated(_, Rotated(inner, Basis(), ()), ()):
            indices = [item.index for item in template.contacts if inner == item.rotation]
            return f"u_{indices[0]}" if indices else None
        case VectorSum():
            return _separation(template, vector)
    return None


def _separation(template: Template, vector: VectorSum) -> str | None:
    """Return whether a sum is a distance vector d, which leads to body j, or the rate of one."""
    *others, last = template.frames
    if last.r_dot in vector.terms:
        return "d_dot"
    return "d" if others and last.r in vector.terms else None


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
    vectors = {"Phi": Phi, "nu": nu, "gamma": gamma}
    outputs = {
        name: [(row, 0, node) for row, node in enumerate(found)] for name, found in vectors.items()
    }
    outputs["Phi_q"] = entries
    nodes, new = pruned(graph.nodes, [node for found in outputs.values() for _, _, node in found])
    return Kernel(
        "Equation",
        tuple(node[1] for node in nodes if node[0] == "input"),
        tuple(nodes),
        {
            name: tuple((row, column, new[node]) for row, column, node in found)
            for name, found in outputs.items()
        },
        (),
    )

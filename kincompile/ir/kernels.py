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
from kincompile.derive.equations import derive_equation
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph
from kincompile.ir.program import Kernel
from kincompile.model.matrices import entry_columns

if TYPE_CHECKING:
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
    outputs: dict[str, list[tuple[int, int, int]]] = {}
    first = 0
    for block in derive(template):
        columns: list[tuple[Code, ...]] = []
        is_vector = isinstance(block.Phi, Vector)
        for coordinate, entry in zip(template.coordinates, block.Phi_q, strict=True):
            columns += entry_columns(entry, is_vector, isinstance(coordinate, Vector), expansion)
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
    inputs: dict[str, int] = {}

    def leaf(name: str) -> int:
        inputs[name] = graph.input(name)
        return inputs[name]

    convert = Converter(graph, leaf).convert
    found = [derive_equation(item, equation.columns) for item in equation.expressions]
    entries = [
        (row, column, convert(entry))
        for row, item in enumerate(found)
        for column, entry in enumerate(item.Phi_q)
    ]
    outputs = {"Phi_q": tuple(entry for entry in entries if graph.value_of(entry[2]) != 0)}
    for name in ("Phi", "nu", "gamma"):
        outputs[name] = tuple(
            (row, 0, convert(getattr(item, name))) for row, item in enumerate(found)
        )
    return Kernel("Equation", tuple(inputs), tuple(graph.nodes), outputs, ())

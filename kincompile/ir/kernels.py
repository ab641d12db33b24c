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
from kincompile.calculus.template import Template
from kincompile.derive.derivation import derive
from kincompile.ir.differentiate import negated_tangents, tangents
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph, pruned
from kincompile.ir.program import (
    Attribute,
    FrameEntry,
    FrameKernel,
    Function,
    Hint,
    Input,
    Kernel,
    StateEntry,
)
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from fractions import Fraction

    from kincompile.calculus.expressions import (
        Components,
        Expression,
        ProfileFunction,
        Rotation,
        TimeFunction,
        Value,
    )
    from kincompile.calculus.symbols import CoordinateSymbol, Frame
    from kincompile.model.resolve import FreeEquation


@dataclass(frozen=True, slots=True)
class Operand:
    """A node that adds and multiplies like a number."""

    graph: Graph
    node: int

    def __add__(self, other: Operand) -> Operand:
        return Operand(self.graph, self.graph.add(self.node, other.node))

    def __sub__(self, other: Operand) -> Operand:
        return Operand(self.graph, self.graph.sub(self.node, other.node))

    def __mul__(self, other: Operand) -> Operand:
        return Operand(self.graph, self.graph.mul(self.node, other.node))

    def __neg__(self) -> Operand:
        return Operand(self.graph, self.graph.neg(self.node))

    def __pow__(self, exponent: int) -> Operand:
        return Operand(self.graph, self.graph.pow(self.node, exponent))


class KernelEnvironment:
    """The leaves of a template as inputs of its kernel."""

    def __init__(self, template: Template) -> None:
        self.graph = Graph()
        self.inputs: dict[Input, int] = {}
        self._motion = _motion(template)
        self._frames = {frame.rotation: frame for frame in template.frames}
        self._template = template

    def _input(self, item: Input) -> Operand:
        node = self.inputs[item] = self.graph.input(item)
        return Operand(self.graph, node)

    def number(self, value: Fraction) -> Value:
        """Return an exact number."""
        return Operand(self.graph, self.graph.const(value))

    def pi(self) -> Value:
        """Return pi."""
        return Operand(self.graph, self.graph.pi())

    def symbol(self, symbol: Symbol) -> Value:
        """Return a coordinate, a rate or a scalar attribute."""
        (own,) = self._motion.get(symbol, (Attribute(symbol.name, 0, symbol.name),))
        return self._input(own)

    def vector(self, symbol: VectorSymbol) -> Components:
        """Return the components of a vector as inputs."""
        own = self._motion.get(symbol) or attributes(symbol.name, symbol.size)
        return tuple(map(self._input, own))

    def time_function(self, function: TimeFunction) -> Value:
        """Return C(t) or one of its derivatives."""
        return self._input(Function(function.name, function.order))

    def profile(self, profile: ProfileFunction) -> Value:
        """Return rho(alpha) or one of its derivatives."""
        (contact,) = self._motion[profile.argument]
        indices = [owner.index for owner in self._template.owners]
        body = indices.index(indices[contact.owner])
        return self._input(Function(profile.name, profile.order, contact.owner, body))

    def entries(self, rotation: Rotation, expand: Expansion) -> Components:
        """Return inputs for a body's frame, which is shared, else code."""
        frame = self._frames.get(rotation)
        if frame is None:
            return expand.entries(rotation)
        return tuple(map(self._input, frame_entries(self._template, frame)))

    def call(self, function: str, *values: Value) -> Value:
        """Return an elementary function."""
        return Operand(self.graph, self.graph.call(function, *(value.node for value in values)))


AXES = "xyz"


def attributes(symbol: str, size: int) -> tuple[Attribute, ...]:
    """Return the components of a point or direction as inputs."""
    return tuple(Attribute(symbol, k, f"{symbol}_{AXES[k]}") for k in range(size))


def frame_entries(template: Template, frame: Frame) -> tuple[FrameEntry, ...]:
    """Return what a body's frame gives as inputs."""
    owner = template.owners.index(frame)
    names = frame.rotation.names
    return tuple(FrameEntry(owner, k, f"{name}_{frame.index}") for k, name in enumerate(names))


def motion_of(template: Template, owner: int, order: int) -> tuple[StateEntry, ...]:
    """Return the coordinates of an owner, or their rates, as inputs."""
    item = template.owners[owner]
    return tuple(
        StateEntry(owner, k, order, rate(f"{letter}_{item.index}", order))
        for k, letter in enumerate(item.letters)
    )


def _motion(template: Template) -> dict[CoordinateSymbol, tuple[StateEntry, ...]]:
    """Return the inputs of each coordinate and rate of a template."""
    found = {}
    for owner, item in enumerate(template.owners):
        second_rates = item.second_rates if item in template.frames else ()
        for order, symbols in enumerate((item.coordinates, item.rates, second_rates)):
            own = iter(motion_of(template, owner, order))
            for symbol in symbols:
                found[symbol] = tuple(next(own) for _ in range(symbol.size))
    return found


@cache
def frame_kernel(own: Frame) -> FrameKernel:
    """Return the kernel of the frame of a body i."""
    environment = KernelEnvironment(Template("Frame", (own,), (), ()))
    found = Expansion(environment).entries(own.rotation)
    graph = Graph()
    numbers = {
        item: graph.input(item.component)
        for item in environment.inputs
        if isinstance(item, StateEntry)
    }
    new = graph.instantiate(environment.graph.nodes, numbers)
    entries = tuple(new[item.node] for item in found)
    return FrameKernel(
        tuple(graph.nodes), entries, own.letters, own.rotation.symbols, own.rotation.formula
    )


@cache
def constraint_kernel(template: Template) -> Kernel:
    """Return the kernel of a constraint type."""
    environment = KernelEnvironment(template)
    expansion = Expansion(environment, template.dimension)
    outputs: dict[str, list[tuple[int, int, int]]] = {}
    first = 0
    for block in derive(template):
        found = nonzeros(expansion, block.Phi_q, first)
        outputs.setdefault("Phi_q", []).extend(found)
        vectors = {"Phi": block.Phi, "nu": block.nu, "gamma": block.gamma}
        for name, vector in vectors.items():
            outputs.setdefault(name, []).extend(
                (first + row, 0, item.node) for row, item in enumerate(expansion.components(vector))
            )
        first = len(outputs["Phi"])
    return kernel_of(template, environment, expansion, outputs)


def nonzeros(
    expansion: Expansion, columns: Iterable[Expression], first: int = 0
) -> list[tuple[int, int, int]]:
    """Return row, column and node of the entries of a matrix that are not identically zero."""
    return [
        (first + row, column, item.node)
        for column, vector in enumerate(columns)
        for row, item in enumerate(expansion.components(vector))
        if item.graph.value_of(item.node) != 0
    ]


def kernel_of(
    template: Template,
    environment: KernelEnvironment,
    expansion: Expansion,
    outputs: Mapping[str, Sequence[tuple[int, int, int]]],
) -> Kernel:
    """Return the kernel of what was expanded in an environment."""
    return Kernel(
        template.type_name,
        tuple(environment.inputs),
        tuple(environment.graph.nodes),
        {name: tuple(sorted(entries)) for name, entries in outputs.items()},
        _hints(template, expansion),
    )


def _hints(template: Template, expansion: Expansion) -> tuple[Hint, ...]:
    """Name the components of vectors that a reader knows from the textbook.

    They are A_i s_i, the centripetal A_i s_i w_i^2, d and its rate, and A_i u(alpha_i) of a cam.
    """
    found = []
    for vector, components in expansion.vectors.items():
        spoken = _spoken(template, vector)
        if spoken is not None:
            owner, stem, name = spoken
            found += [
                Hint(item.node, owner, f"{stem}_{axis}", f"{name}_{axis}")
                for axis, item in zip(AXES, components, strict=False)
            ]
    return tuple(found)


STEMS = {"s_i": "{}", "s_j": "{}", "v_i": "axis_{}", "v_j": "axis_{}", "s_C": "C"}
"""Names of turned points and directions, with that of the body; others have their symbol."""


def _spoken(template: Template, vector: Vector) -> tuple[int | None, str, str] | None:
    """Return the body in the name of a vector, its name, and that in the type's own symbols."""
    rotations = [item.rotation for item in template.owners]
    match vector:
        case Rotated(rotation, VectorSymbol(name), ()) if rotation in rotations:
            return rotations.index(rotation), STEMS.get(name, name), name
        case Scaled(Power(Symbol(), 2), Rotated() as inner):
            found = _spoken(template, inner)
            return found and (found[0], f"{found[1]}_w2", f"{found[2]}_w2")
        case Rotated(rotation, Rotated(inner_rotation, Basis(), ()), ()):
            if inner_rotation in rotations and rotation in rotations:
                owner = rotations.index(rotation)
                return owner, "u_{}", f"u_{template.owners[owner].index}"
        case VectorSum():
            return _separation(template, vector)
    return None


def _separation(template: Template, vector: VectorSum) -> tuple[None, str, str] | None:
    """Return the names of a distance vector d, which leads to body j, or of its rate."""
    *others, last = template.frames
    if last.rates[0] in vector.terms:
        return None, "d_dot", "d_dot"
    return (None, "d", "d") if others and last.r in vector.terms else None


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
    return pruned_kernel("Equation", graph, outputs)


def pruned_kernel(
    name: str, graph: Graph, outputs: Mapping[str, Sequence[tuple[int, int, int]]]
) -> Kernel:
    """Return the kernel of what outputs need of a graph; its inputs are names."""
    nodes, new = pruned(graph.nodes, [node for found in outputs.values() for _, _, node in found])
    return Kernel(
        name,
        tuple(node[1] for node in nodes if node[0] == "input"),
        tuple(nodes),
        {
            quantity: tuple((row, column, new[node]) for row, column, node in found)
            for quantity, found in outputs.items()
        },
        (),
    )

"""From a constraint system to a program: each constraint is an instance of its type's kernel."""

from __future__ import annotations

import hashlib
from functools import cache
from typing import TYPE_CHECKING

import sympy

from kincompile.ir.equation_shapes import EquationShapes
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph
from kincompile.ir.kernels import constraint_kernel, derivative_name, equation_kernel
from kincompile.ir.program import Instance, Kernel, Program
from kincompile.model.expressions import alpha, as_sympy, t
from kincompile.model.resolve import FreeEquation, Joint
from kincompile.model.spline import PeriodicSpline, SplineTable
from kincompile.names import body_coordinates, rate

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.calculus.template import Template
    from kincompile.ir.equation_shapes import SharedEquation
    from kincompile.model.bodies import Body
    from kincompile.model.system import ConstraintSystem


def lower(system: ConstraintSystem, *, share_equations: bool = False) -> Program:
    """Return the program of a system: kernels x instances.

    With `share_equations` free equations of equal structure are instances of one kernel, as joints
    of one type are; without it each is a kernel of its own, in the order in which it is written.
    """
    columns = {item.name: column for column, item in enumerate(system.coordinates)}
    graph = Graph()
    binder, shapes = _Binder(graph), EquationShapes(columns)
    instances = []
    tables: dict[str, SplineTable] = {}
    for first_row, constraint in zip(system.row_offsets, system.constraints, strict=True):
        names: tuple[str | None, ...] = constraint.columns
        if isinstance(constraint, FreeEquation):
            shared = shapes.shared(constraint) if share_equations else None
            if shared is None:
                kernel = equation_kernel(constraint)
                bindings = tuple(graph.input(name) for name in kernel.inputs)
            else:
                kernel, names = shared.kernel, shared.columns
                bindings = binder.bind_equation(shared)
        else:
            kernel = constraint_kernel(constraint.template)
            bindings = binder.bind(constraint, kernel)
            tables.update(_tables(constraint))
        own = tuple(None if name is None else columns[name] for name in names)
        instances.append(Instance(kernel, constraint, first_row, own, bindings))
    frames = tuple((body.name, columns[body_coordinates(body.name)[2]]) for body in system.bodies)
    return Program(
        system.name,
        system.coordinates,
        system.parameters,
        system.equations,
        frames,
        tuple(graph.nodes),
        tuple(instances),
        tables,
        _fingerprint(system, graph, instances, tables),
        system.end,
        system.points,
    )


def _fingerprint(
    system: ConstraintSystem,
    graph: Graph,
    instances: list[Instance],
    tables: dict[str, SplineTable],
) -> str:
    kernels = {instance.kernel.name: instance.kernel for instance in instances if instance.bodies}
    first = {id(instance.kernel): instance.name for instance in reversed(instances)}
    content = (
        system.name,
        system.coordinates,
        system.parameters,
        system.equations,
        graph.nodes,
        sorted(kernels.items()),
        [
            (
                instance.name,
                _kernel_mark(instance, first[id(instance.kernel)]),
                instance.bindings,
                instance.columns,
            )
            for instance in instances
        ],
        sorted(tables.items()),
    )
    return hashlib.sha256(repr(content).encode()).hexdigest()[:32]


def _kernel_mark(instance: Instance, first: str) -> Kernel | str:
    """Return what tells kernels apart: of a free equation the code, or who was first to have it."""
    if instance.bodies:
        return instance.kernel.name
    return instance.kernel if first == instance.name else first


def _tables(joint: Joint) -> dict[str, SplineTable]:
    splines = (
        item for profile in joint.profiles.values() for item in profile.atoms(PeriodicSpline)
    )
    return {item.table_name: item.table for item in splines}


class _Binder:
    """Gives the nodes of kernels' inputs; those of a body are made once for all its joints."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._convert = Converter(graph, graph.input).convert
        self._bodies: dict[str, tuple[int, ...]] = {}

    def bind(self, joint: Joint, kernel: Kernel) -> tuple[int, ...]:
        """Return the node of each of the kernel's inputs."""
        known = self._coordinates(joint)
        for symbol, value in joint.scalars.items():
            if symbol != "C":
                known[symbol] = self._convert(value)
        for symbol, (x, y) in joint.points.items():
            known[f"{symbol}.x"], known[f"{symbol}.y"] = self._convert(x), self._convert(y)
        functions = _function_nodes(joint, self._convert)
        return tuple(known[name] if name in known else functions(name) for name in kernel.inputs)

    def bind_equation(self, equation: SharedEquation) -> tuple[int, ...]:
        """Return the node of each of the inputs of a shared kernel."""
        values = (equation.values[name] for name in equation.kernel.inputs)
        return tuple(
            self._graph.input(value) if isinstance(value, str) else self._convert(value)
            for value in values
        )

    def _coordinates(self, joint: Joint) -> dict[str, int]:
        """Return the template's coordinates, rates and frames as nodes of the system's own."""
        known: dict[str, int] = {}
        for frame, body in zip(joint.template.frames, joint.bodies, strict=True):
            known.update(zip(_frame_inputs(frame.index), self._body(body), strict=True))
        names = joint.columns[3 * len(joint.bodies) :]
        for contact, name in zip(joint.template.contacts, names, strict=True):
            assert name is not None
            known[contact.alpha.name] = self._graph.input(name)
            known[contact.alpha_dot.name] = self._graph.input(rate(name))
        return known

    def _body(self, body: Body) -> tuple[int, ...]:
        """Return a body's coordinates, rates, cosine and sine; of the ground they are numbers."""
        if body.name not in self._bodies:
            graph, coordinates = self._graph, body_coordinates(body.name)
            if body.is_ground:
                nodes = [graph.const(0)] * 6
            else:
                rates = [rate(name) for name in coordinates]
                nodes = [graph.input(name) for name in (*coordinates, *rates)]
            angle = nodes[2]
            self._bodies[body.name] = (*nodes, graph.call("cos", angle), graph.call("sin", angle))
        return self._bodies[body.name]


@cache
def _frame_inputs(index: str) -> tuple[str, ...]:
    """Return the names of a body's coordinates, rates, cosine and sine as a kernel's inputs."""
    coordinates = f"r_{index}.x", f"r_{index}.y", f"phi_{index}"
    rates = f"r_{index}_dot.x", f"r_{index}_dot.y", f"phi_{index}_dot"
    return *coordinates, *rates, f"cos phi_{index}", f"sin phi_{index}"


def _function_nodes(joint: Joint, convert: Callable[..., int]) -> Callable[[str], int]:
    """Return what gives the node of C, C', C'', or of rho and its derivatives at the contact."""

    def node(name: str) -> int:
        symbol, order = name.rstrip("'"), name.count("'")
        assert derivative_name(symbol, order) == name
        if symbol in joint.profiles:
            rho = joint.profiles[symbol].diff(alpha, order)
            contact = _contact_symbols(joint.template, joint.columns)[symbol]
            return convert(rho.subs(alpha, contact))
        value = joint.scalars[symbol]
        return convert(value if order == 0 else as_sympy(value).diff(t, order))

    return node


def _contact_symbols(
    template: Template, columns: tuple[str | None, ...]
) -> dict[str, sympy.Symbol]:
    names = columns[3 * len(template.frames) :]
    return {
        contact.rho().name: sympy.Symbol(name)
        for contact, name in zip(template.contacts, names, strict=True)
    }

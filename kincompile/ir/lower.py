"""From a constraint system to a program: each constraint is an instance of its type's kernel."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import sympy

from kincompile.errors import ModelError
from kincompile.ir.differentiate import derivative_code
from kincompile.ir.equation_shapes import EquationShapes
from kincompile.ir.from_sympy import Converter
from kincompile.ir.graph import Graph
from kincompile.ir.kernels import (
    attributes,
    constraint_kernel,
    equation_kernel,
    frame_entries,
    frame_kernel,
    motion_of,
)
from kincompile.ir.output_kernels import output_kernel, point_kernel
from kincompile.ir.program import Attribute, BodyFrame, Function, Input, Instance, Kernel, Program
from kincompile.model.expressions import alpha, t
from kincompile.model.laws import TableLaw
from kincompile.model.outputs import ResolvedOutput
from kincompile.model.resolve import FreeEquation, Joint
from kincompile.model.spline import PeriodicSpline, SplineTable
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from kincompile.ir.equation_shapes import SharedEquation
    from kincompile.model.bodies import Body
    from kincompile.model.expressions import Scalar
    from kincompile.model.points import PlacedPoint
    from kincompile.model.resolve_loads import AppliedLoad
    from kincompile.model.system import ConstraintSystem


def lower(system: ConstraintSystem, *, share_equations: bool = False) -> Program:
    """Return the program of a system: kernels x instances.

    With `share_equations` free equations of equal structure are instances of one kernel, as joints
    of one type are; without it each is a kernel of its own, in the order in which it is written.
    """
    columns = {item.name: column for column, item in enumerate(system.coordinates)}
    graph = Graph()
    binder = Binder(graph, EquationShapes(columns) if share_equations else None)
    instances = []
    for first_row, constraint in zip(system.row_offsets, system.constraints, strict=True):
        try:
            kernel, names, bindings = binder.bound(constraint)
        except RecursionError:
            raise ModelError(_too_deep(constraint)) from None
        own = tuple(None if name is None else columns[name] for name in names)
        instances.append(Instance(kernel, constraint, first_row, own, bindings))
    tables = _tables((*system.constraints, *system.observers))
    tables |= _tables_in(value for item in system.loads for value in item.values())
    bodies = tuple(
        binder.frame_of(body, own)
        for body, own in zip(system.bodies, system.body_columns, strict=True)
    )
    observers: list[Instance] = []
    row = 0
    for item in system.observers:
        kernel, bindings = binder.observed(item)
        own = tuple(None if name is None else columns[name] for name in item.columns)
        observers.append(Instance(kernel, item, len(system.equations), own, bindings, row))
        row += len(item.rows)
    loads = tuple(binder.loaded(item, columns, len(system.equations)) for item in system.loads)
    return Program(
        system.name,
        system.coordinates,
        system.parameters,
        system.equations,
        bodies,
        tuple(graph.nodes),
        tuple(instances),
        tables,
        _fingerprint(system, graph, [*instances, *observers, *loads], tables),
        system.end,
        system.points,
        observers=tuple(observers),
        loads=loads,
    )


def _fingerprint(
    system: ConstraintSystem,
    graph: Graph,
    instances: list[Instance],
    tables: dict[str, SplineTable],
) -> str:
    kernels: dict[str, Kernel] = {}
    for instance in instances:
        if instance.bodies:
            kernels.setdefault(instance.kernel.name, instance.kernel)
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
                _kernel_mark(instance, kernels, first[id(instance.kernel)]),
                instance.bindings,
                instance.columns,
            )
            for instance in instances
        ],
        sorted(tables.items()),
    )
    return hashlib.sha256(repr(content).encode()).hexdigest()[:32]


def _kernel_mark(instance: Instance, kernels: dict[str, Kernel], first: str) -> Kernel | str:
    """Return the name of a type, where that says the code; else the code, or who has it first.

    Free equations have code of their own, and so has an angle beside the driver of it.
    """
    if instance.bodies and kernels[instance.kernel.name] is instance.kernel:
        return instance.kernel.name
    return instance.kernel if first == instance.name else first


def _too_deep(constraint: Joint | FreeEquation) -> str:
    """Return the remedy for an expression too deep for Python's recursion."""
    return (
        f"{constraint.name!r}: its expressions are nested too deeply, functions of functions of "
        "functions; give an inner part u a coordinate of its own, with the equation u - (inner "
        "part) = 0, and write u in its place"
    )


def _tables(
    items: Iterable[Joint | FreeEquation | ResolvedOutput | PlacedPoint],
) -> dict[str, SplineTable]:
    """Return the splines of profiles, and of motions over time, by name in order of occurrence."""
    values: list[Scalar] = []
    for item in items:
        match item:
            case Joint():
                values += (*item.profiles.values(), *item.scalars.values())
            case FreeEquation():
                values += item.expressions
            case ResolvedOutput():
                values.append(item.value)
    return _tables_in(values)


def _tables_in(values: Iterable[Scalar]) -> dict[str, SplineTable]:
    """Return the splines in expressions by name."""
    found: dict[str, SplineTable] = {}
    for value in values:
        if isinstance(value, sympy.Expr):
            tables = sorted(value.atoms(PeriodicSpline, TableLaw), key=str)
            found |= {table.table_name: table.table for table in tables}
    return found


class Binder:
    """Gives the nodes of kernels' inputs; those of a body are made once for all its joints."""

    def __init__(self, graph: Graph, shapes: EquationShapes | None) -> None:
        self._graph, self._shapes = graph, shapes
        self._convert = Converter(graph, graph.input).convert
        self._bodies: dict[str, tuple[int, ...]] = {}
        self._numbers: dict[float, int] = {}
        self._orders: dict[int, tuple[Kernel, tuple[tuple[int, ...], list[Function]]]] = {}

    def bound(
        self, constraint: Joint | FreeEquation
    ) -> tuple[Kernel, tuple[str | None, ...], tuple[int, ...]]:
        """Return a constraint's kernel, the names of its columns, and the nodes of its inputs."""
        if isinstance(constraint, Joint):
            kernel = constraint_kernel(constraint.template)
            return kernel, constraint.columns, self.bind(constraint, kernel)
        if self._shapes:
            shared = self._shapes.shared(constraint)
            return shared.kernel, shared.columns, self.bind_equation(shared)
        kernel = equation_kernel(constraint)
        return kernel, constraint.columns, tuple(self._graph.input(name) for name in kernel.inputs)

    def observed(self, item: PlacedPoint | ResolvedOutput) -> tuple[Kernel, tuple[int, ...]]:
        """Return the kernel of a point or an output, and the nodes of its inputs."""
        if isinstance(item, ResolvedOutput):
            kernel, given = output_kernel(item)
            return kernel, tuple(self._named(given[entry]) for entry in kernel.inputs)
        kernel, template, (body,) = point_kernel(item.frame), item.template, item.bodies
        first: list[Input] = [*motion_of(template, 0, 0), *motion_of(template, 0, 1)]
        first += frame_entries(template, template.frames[0])
        known: dict[Input | str, int] = dict(zip(first, self._body(body), strict=True))
        for entry in motion_of(template, 0, 2):
            name = item.columns[entry.component]
            known[entry] = self._graph.input(rate(name, 2)) if name else self._graph.const(0)
        for symbol, point in item.points.items():
            own = map(self._value, point)
            known |= dict(zip(attributes(symbol, len(point)), own, strict=True))
        return kernel, tuple(known[entry] for entry in kernel.inputs)

    def loaded(self, load: AppliedLoad, columns: Mapping[str, int], row: int) -> Instance:
        """Return a load as an instance of the kernel of its type."""
        from kincompile.ir.loads import load_kernel, slopes

        kernel = load_kernel(load.template, load.others, varies=load.varies)
        known: dict[Input | str, int] = {}
        known |= zip(self.inputs_of(load), self.known(load), strict=True)
        known |= slopes(load, self._graph, self._value)
        own = tuple(None if name is None else columns[name] for name in load.columns)
        bindings = tuple(known[entry] for entry in kernel.inputs)
        return Instance(kernel, load, row, own, bindings)

    def bind(self, joint: Joint, kernel: Kernel) -> tuple[int, ...]:
        """Return the node of each of the kernel's inputs."""
        known = self.known(joint)
        places, functions = self._order(joint, kernel)
        known += [self._function(joint, item) for item in functions]
        return tuple(map(known.__getitem__, places))

    def _function(self, joint: Joint, item: Function) -> int:
        """Return the node of C, C', C'', or of rho and its derivatives at the contact."""
        if item.owner is not None:
            # The columns of contacts are the last, one each, as they are the last owners.
            contact = joint.columns[item.owner - len(joint.template.owners)]
            assert contact is not None
            return self._derivative(joint.profiles[item.symbol], alpha.name, item.order, contact)
        value = joint.scalars[item.symbol]
        if not isinstance(value, sympy.Expr):
            return self._value(0.0 if item.order else value)
        return self._derivative(value, t.name, item.order, t.name)

    def _derivative(self, value: sympy.Expr, variable: str, order: int, at: str) -> int:
        """Return the node of a derivative by a variable that stands for the input `at`."""
        if self._shapes:
            nodes, values = self._shapes.derivative(value, variable, order)
        else:
            graph = Graph()
            node = Converter(graph, graph.input).convert(value)
            nodes = derivative_code(graph, node, variable, order)
            values = {item[1]: item[1] for item in nodes if item[0] == "input"}
        inputs = {
            name: self._named(at if named == variable else named) for name, named in values.items()
        }
        return self._graph.instantiate(nodes, inputs)[-1]

    def _named(self, value: str | Scalar) -> int:
        """Return the node of a symbol by name, or of a number or expression."""
        return self._graph.input(value) if isinstance(value, str) else self._convert(value)

    def known(self, joint: Joint | AppliedLoad) -> list[int]:
        """Return the nodes of coordinates, rates and frames, then of scalars and points."""
        known = [node for body in joint.bodies for node in self._body(body)]
        for name in joint.columns[len(joint.columns) - len(joint.template.contacts) :]:
            assert name is not None
            known += self._graph.input(name), self._graph.input(rate(name))
        known += [self._value(value) for symbol, value in joint.scalars.items() if symbol != "C"]
        known += [self._value(value) for point in joint.points.values() for value in point]
        return known

    def _order(self, joint: Joint, kernel: Kernel) -> tuple[tuple[int, ...], list[Function]]:
        """Return where each of the kernel's inputs stands in `known`, and the functions after it.

        What stands there is the same for all joints of a type.
        """
        if id(kernel) not in self._orders:
            known = self.inputs_of(joint)
            functions = [item for item in kernel.inputs if isinstance(item, Function)]
            places: dict[Input | str, int] = {
                item: place for place, item in enumerate((*known, *functions))
            }
            order = tuple(places[item] for item in kernel.inputs), functions
            self._orders[id(kernel)] = kernel, order
        return self._orders[id(kernel)][1]

    @staticmethod
    def inputs_of(joint: Joint | AppliedLoad) -> list[Input]:
        """Return the inputs whose nodes `known` gives."""
        template = joint.template
        known: list[Input] = []
        for owner, item in enumerate(template.owners):
            known += motion_of(template, owner, 0) + motion_of(template, owner, 1)
            known += frame_entries(template, item) if item in template.frames else ()
        known += [Attribute(symbol, 0, symbol) for symbol in joint.scalars if symbol != "C"]
        for symbol, point in joint.points.items():
            known += attributes(symbol, len(point))
        return known

    def _value(self, value: Scalar) -> int:
        """Return the node of an attribute; a number that was there before costs little."""
        if isinstance(value, sympy.Expr):
            return self._convert(value)
        node = self._numbers.get(value)
        if node is None:
            node = self._numbers[value] = self._graph.const(value)
        return node

    def bind_equation(self, equation: SharedEquation) -> tuple[int, ...]:
        """Return the node of each of the inputs of a shared kernel."""
        return tuple(self._named(equation.values[str(name)]) for name in equation.kernel.inputs)

    def _body(self, body: Body) -> tuple[int, ...]:
        """Return a body's coordinates, rates and frame entries; the ground's are numbers."""
        if body.name not in self._bodies:
            graph, kind = self._graph, body.kind
            if body.is_ground:
                nodes = [graph.const(value) for value in kind.ground]
                rates = [graph.const(0)] * len(nodes)
            else:
                names = body.coordinates
                nodes = [graph.input(name) for name in names]
                rates = [graph.input(rate(name)) for name in names]
            frame = frame_kernel(kind.frame("i"))
            new = graph.instantiate(frame.nodes, dict(enumerate(nodes)))
            self._bodies[body.name] = *nodes, *rates, *(new[node] for node in frame.entries)
        return self._bodies[body.name]

    def frame_of(self, body: Body, columns: range) -> BodyFrame:
        """Return a body with the nodes that its frame gives."""
        entries = self._body(body)[2 * len(columns) :]
        return BodyFrame(body.name, frame_kernel(body.kind.frame("i")), columns, entries)

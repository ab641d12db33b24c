r"""Inverse dynamics as outputs: straight-line code with the transposed solve in it.

.. math:: \Phi_q^T \lambda = Q - M \ddot q

gives the multipliers, and these the reactions of joints and what drivers do. Where redundant
equations forbid the planned elimination, the multipliers are parameters of the same code.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import (
    ZERO,
    ZERO_VECTOR,
    Basis,
    Scalar,
    VectorSymbol,
    split_factor,
)
from kincompile.derive.reactions import derive_reactions, multipliers, placed
from kincompile.derive.rules import along
from kincompile.errors import ModelError
from kincompile.ir.elimination import plan_solve
from kincompile.ir.graph import Graph
from kincompile.ir.implicit import DETERMINANT
from kincompile.ir.kernels import KernelEnvironment, attributes
from kincompile.ir.looks import MISSED
from kincompile.ir.lower import Binder
from kincompile.ir.observing import observing_program
from kincompile.ir.program import Attribute
from kincompile.ir.straight_solve import StraightSolve
from kincompile.model.arguments import Kind
from kincompile.model.bodies import Parameter
from kincompile.model.points import OutputColumn
from kincompile.model.resolve import Joint
from kincompile.model.resolve_loads import AppliedLoad
from kincompile.names import METRES, force_units, multiplier, rate

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from kincompile.calculus.template import Template
    from kincompile.derive.loads import LoadTemplate
    from kincompile.derive.rules import Direction
    from kincompile.ir.inline import ConstraintRows, InlineProgram
    from kincompile.ir.program import Input, Instance, Kernel, Program

AXES = "xyz"
BY_AXIS = {
    2: ("F_along", "F_across"), 3: ("F_along", "F_f", "F_g", "T_along", "T_f", "T_g"),
}  # fmt: skip
"""Names of what a joint bears along its axis and across it; in space f and g are so."""


@dataclass(frozen=True, slots=True)
class _Row:
    """A number of the forces: name, unit and node."""

    name: str
    unit: str
    node: int


def observing_forces(code: InlineProgram, *, is_planned: bool = True) -> Program | None:
    """Return a program without equations whose outputs are forces along a motion.

    Where the multipliers are solved for, `is_planned`, the part by which the solve misses its
    equations, determinants of the blocks of Phi_q and the multipliers are first; else the
    multipliers are further parameters. Then come forces in the order of constraints, the force on
    the ground and what springs pull with. There are no rates. None where there is no planned
    elimination.
    """
    program, graph = code.program, Graph(code.nodes)
    is_square = not program.redundant and not program.unsolvable
    plan = plan_solve(code, is_straight=True) if is_planned and is_square else None
    if is_planned and plan is None:
        return None
    first: list[_Row] = []
    added: tuple[Parameter, ...] = ()
    names = [multiplier(name) for name in program.equations]
    if plan is None:
        factors = [graph.input(name) for name in names]
        added = tuple(Parameter(name, 0.0) for name in names)
    else:
        solve = StraightSolve(graph, code.entries("Phi_q"), plan)
        factors = solve.transposed(_sides(code, graph))
        first = [_Row(MISSED, "", solve.missed())]
        first += [_Row(DETERMINANT.format(k), "", x) for k, x in enumerate(solve.determinants)]
        first += [_Row(name, "", node) for name, node in zip(names, factors, strict=True)]
    rows = [*first, *_Forces(code, graph, factors).rows()]
    _check_names(program, [row.name for row in rows])
    titles = [OutputColumn(row.name, row.unit) for row in rows]
    outputs = {"outputs": [row.node for row in rows]}
    return observing_program(program, "forces", graph, outputs, titles, added=added)


def _check_names(program: Program, made: Iterable[str]) -> None:
    """Refuse a mechanism that has the name of a force already."""
    own = {*program.names_of("coordinates"), *program.names_of("parameters")}
    own.update(program.names_of("outputs"))
    if taken := own.intersection(made):
        raise ModelError(
            f"{program.name!r} has the name {min(taken)!r}, which is that of one of its forces: "
            "rename it"
        )


def _sides(code: InlineProgram, graph: Graph) -> list[int]:
    """Return Q - M q_ddot."""
    names = code.program.names_of("coordinates")
    sides = [entry.node for entry in code.entries("Q")]
    for entry in code.entries("M"):
        q_ddot = graph.input(rate(names[entry.column], 2))
        sides[entry.row] = graph.sub(sides[entry.row], graph.mul(entry.node, q_ddot))
    return sides


@cache
def _reaction_kernel(
    template: Template, points: tuple[str | None, ...], axis: tuple[str, str] | None
) -> _Expanded:
    """Return the code of the reactions of a constraint type, in its multipliers."""
    found = derive_reactions(template, points, axis)
    numbers = [number for body in found.bodies for number in (*body.force, *body.moment)]
    return _Expanded.of(template, [*numbers, found.drive, *found.along_axis])


@cache
def _work_kernel(template: LoadTemplate) -> tuple[_Expanded, bool]:
    """Return the code of what a load between bodies pulls with, and whether that is a torque."""
    force, moved = template.work[0]  # of a couple in space, a force at the end of a unit arm
    size = force if isinstance(force, Scalar) else split_factor(force)[0]
    shifts: Iterator[Direction] = ({frame.r: Basis(0, frame.size)} for frame in template.frames)
    is_torque = all(along(moved, shift) in (ZERO, ZERO_VECTOR) for shift in shifts)
    return _Expanded.of(template, [-size]), is_torque


@dataclass(frozen=True, slots=True)
class _Expanded:
    """Expressions of a type as code: its inputs, nodes, and those of the results."""

    inputs: tuple[Input, ...]
    graph: Graph
    results: tuple[int, ...]

    @classmethod
    def of(cls, template: Template, expressions: Sequence[Scalar]) -> _Expanded:
        """Return the code of expressions in the symbols of a type."""
        environment = KernelEnvironment(template)
        expansion = Expansion(environment)
        results = tuple(expansion.scalar(item).node for item in expressions)
        return cls(tuple(environment.inputs), environment.graph, results)

    def bound(self, graph: Graph, known: Mapping[Input | str, int]) -> list[int]:
        """Return the nodes of the results in a graph."""
        new = graph.instantiate(self.graph.nodes, {item: known[item] for item in self.inputs})
        return [new[node] for node in self.results]


def _point_symbols(joint: Joint) -> tuple[str | None, ...]:
    """Return the symbol of the joint's point on each of its bodies."""
    given = joint.written.arguments().values()
    points = [item for item in given if item.kind is Kind.POINT]
    return tuple(
        next((item.symbol for item in points if item.on == frame.index), None)
        for frame in joint.template.frames
    )


def _axis_of(joint: Joint) -> tuple[str, str] | None:
    """Return the symbol of a joint's axis and the index of its body; of two that on body j."""
    if joint.template.dimension == len(AXES) and _point_symbols(joint)[-1] is None:
        return None  # it turns bodies alone
    given = joint.written.arguments().values()
    axes = [(item.symbol, item.on) for item in given if item.kind is Kind.AXIS]
    axes = [axis for axis in axes if axis[0].startswith("h_")] or axes  # in space, of a triad
    known = {frame.index for frame in joint.template.frames}
    return next((item for item in reversed(axes) if item[1] in known), None)


class _Forces:
    """The forces of a mechanism in its multipliers."""

    def __init__(self, code: InlineProgram, graph: Graph, factors: Sequence[int]) -> None:
        self._code, self._graph, self._factors = code, graph, factors
        self._binder = Binder(graph, None)
        body = code.program.bodies[0] if code.program.bodies else None
        length = code.program.coordinates[body.columns.start].unit if body else ""
        self._force, self._torque, _, self._power = force_units(length)
        self._metres = METRES.get(length, 1.0)  # of a unit of length, in which work is not joules
        self._size = len(AXES) if body and len(body.columns) > len(AXES) else len("xy")
        self._turns = [""] if self._size == len("xy") else [f"_{axis}" for axis in AXES]

    def rows(self) -> Iterator[_Row]:
        """Yield the forces in order."""
        for section in self._code.constraints:
            constraint = section.instance.constraint
            if isinstance(constraint, Joint) and not section.instance.is_own:
                yield from self._joint(section, constraint)
            if constraint.is_driver:
                yield _Row(f"P_{constraint.name}", self._power, self._power_of(section))
        yield from self._on_ground()
        for instance in self._code.program.loads:
            load = instance.constraint
            if isinstance(load, AppliedLoad) and len(load.bodies) > 1:
                kernel, is_torque = _work_kernel(load.template)
                (node,) = kernel.bound(self._graph, _bound(instance))
                unit = self._torque if is_torque else self._force
                yield _Row(f"load_{load.name}", unit, node)

    def _joint(self, section: ConstraintRows, joint: Joint) -> Iterator[_Row]:
        """Yield what is not zero: force and moment on the last body, the moment on the first.

        Of a joint with an axis the force along and across it follow, in space the moment too, of a
        driver, or what holds a value, what it does.
        """
        kernel = _reaction_kernel(joint.template, _point_symbols(joint), _axis_of(joint))
        known = self._inputs(section.instance) | self._multipliers(section, joint)
        found = kernel.bound(self._graph, known)
        size, turns = self._size, self._turns
        each = size + len(turns)
        own = each * len(joint.bodies)
        numbers, drive, by_axis = found[:own], found[own], found[own + 1 :]
        names = [*(f"F_{axis}" for axis in AXES[:size]), *(f"T{turn}" for turn in turns)]
        rows = [*zip(names, numbers[-each:], strict=True)]
        if len(joint.bodies) > 1:
            rows += zip([f"T_i{turn}" for turn in turns], numbers[size:each], strict=True)
        rows += zip(BY_AXIS[size], by_axis, strict=False)
        has_value = joint.has_value
        skipped = {self._graph.const(0), *([drive] if has_value else [])}
        for name, node in rows:
            if node not in skipped:
                unit = self._torque if name[0] == "T" else self._force
                yield _Row(f"{name}_{joint.name}", unit, node)
        if has_value:
            yield _Row(f"drive_{joint.name}", self._drive_unit(joint), drive)

    def _multipliers(self, section: ConstraintRows, joint: Joint) -> dict[Input | str, int]:
        """Return the nodes of a joint's multipliers by the inputs of its kernel."""
        found: dict[Input | str, int] = {}
        row = section.instance.first_row
        for symbol in multipliers(joint.template, joint.template.frames[0].size):
            own = attributes(symbol.name, symbol.size)
            if not isinstance(symbol, VectorSymbol):
                own = (Attribute(symbol.name, 0, symbol.name),)
            found |= zip(own, self._factors[row : row + symbol.size], strict=True)
            row += symbol.size
        return found

    def _drive_unit(self, joint: Joint) -> str:
        (value,) = (x for x in joint.written.arguments().values() if x.symbol == "C")
        return self._torque if value.unit == "rad" else self._force

    def _power_of(self, section: ConstraintRows) -> int:
        """Return the power of a driver, -lambda^T nu."""
        graph, total = self._graph, self._graph.const(0)
        for entry in section.entries["nu"]:
            total = graph.sub(total, graph.mul(self._factors[entry.row], entry.node))
        return graph.mul(total, graph.const(self._metres))

    def _on_ground(self) -> Iterator[_Row]:
        """Yield what shakes the ground: weight and applied forces less the rate of momentum."""
        graph, size = self._graph, self._size
        total = [graph.const(0)] * (size + len(self._turns))
        for instance in self._code.program.loads:
            if len(instance.bodies) > 1:  # what it does to one body it does to the other, reversed
                continue
            found = self._on_body(instance)
            place = [self._named(column) for column in instance.columns[:size]]
            for k in range(len(self._turns)):  # about the origin
                a, b = (0, 1) if size == len("xy") else (k - 2, k - 1)
                force = found[:size]
                lever = graph.sub(graph.mul(place[a], force[b]), graph.mul(place[b], force[a]))
                found[size + k] = graph.add(found[size + k], lever)
            total = [graph.add(item, own) for item, own in zip(total, found, strict=True)]
        for axis, node in zip(AXES, total[:size], strict=False):
            yield _Row(f"F_{axis}_ground", self._force, node)
        for turn, node in zip(self._turns, total[size:], strict=True):
            yield _Row(f"T{turn}_ground", self._torque, node)

    def _on_body(self, instance: Instance) -> list[int]:
        """Return force and moment about its origin that a load and inertia have on a body."""
        load = instance.constraint
        assert isinstance(load, AppliedLoad)
        template = placed(load.template.frames[0])
        kernel = _reaction_kernel(template, (None,), None)
        known = self._inputs(instance)
        for k, node in enumerate(self._effective(instance)):
            known[Attribute(f"lambda_{k}", 0, "")] = node
        return kernel.bound(self._graph, known)[: self._size + len(self._turns)]

    def _inputs(self, instance: Instance) -> dict[Input | str, int]:
        """Return the nodes of all that may occur in a formula of a constraint or a load."""
        about = instance.constraint
        assert isinstance(about, Joint | AppliedLoad)
        known = zip(self._binder.inputs_of(about), self._binder.known(about), strict=True)
        return {**dict(known), **_bound(instance)}

    def _effective(self, instance: Instance) -> list[int]:
        """Return the generalised forces of a load on its body less those of inertia."""
        graph, kernel = self._graph, instance.kernel
        new = graph.instantiate(kernel.nodes, _bound(instance))
        sides = {row: new[node] for row, _, node in kernel.outputs["Q"]}
        for row, column, node in kernel.outputs["M"]:
            q_ddot = self._named(instance.columns[column], 2)
            sides[row] = graph.sub(sides[row], graph.mul(new[node], q_ddot))
        return [sides[row] for row in sorted(sides)]

    def _named(self, column: int | None, order: int = 0) -> int:
        """Return the node of a coordinate or of its second rate."""
        assert column is not None
        return self._graph.input(rate(self._code.program.coordinates[column].name, order))


def _bound(instance: Instance) -> dict[Input | str, int]:
    """Return the nodes of the inputs of an instance's kernel."""
    kernel: Kernel = instance.kernel
    return dict(zip(kernel.inputs, instance.bindings, strict=True))

r"""A mechanism together with its sensitivities: a program of more coordinates and equations.

To the coordinates q come their derivatives s by each of some parameters a, and to the equations
Phi(q, t, p) = 0 their total derivatives

.. math:: \Phi_q s + \Phi_a = 0.

The velocity and acceleration equations of the larger system are then those of :math:`q_{\dot a}`:
all that a mechanism is compiled to, in every target, is there for the sensitivities too. Its
Jacobian is block triangular, with Phi_q itself in every block of the diagonal, and what stands
below, :math:`(\Phi_q s + \Phi_a)_q`, is the coupling that both rates need:

.. math:: \Phi_q \dot s = -(\Phi_q s + \Phi_a)_t - (\Phi_q s + \Phi_a)_q \dot q.

Everything is differentiated on the graph.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from kincompile.errors import InputError, ModelError
from kincompile.ir.differentiate import tangents
from kincompile.ir.graph import Graph
from kincompile.ir.kernels import pruned_kernel
from kincompile.ir.program import Instance, OutputDerivatives
from kincompile.model.bodies import Coordinate
from kincompile.model.points import OutputColumn
from kincompile.model.resolve import FreeEquation
from kincompile.names import parameters_problem, quotient_unit, rate, sensitivity
from kincompile.quantities import TOGETHER

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.ir.program import Kernel, Program
    from kincompile.model.bodies import Parameter
    from kincompile.quantities import Columns, Rows


@dataclass(frozen=True, slots=True)
class _Rows(FreeEquation):
    """The derivative of a constraint by a parameter, for names and comments."""

    @property
    def text(self) -> str:
        """The constraint and the parameter."""
        return self.source


def with_sensitivities(program: Program, names: Sequence[str]) -> Program:
    """Return the program of a mechanism with its sensitivities to k of its parameters.

    It has n (1 + k) coordinates, m (1 + k) equations and r (1 + k) outputs: the mechanism's own,
    then those of each parameter in turn. It has no loads.
    """
    given = {item.name: item for item in program.parameters}
    check_names(program, names)
    graph = Graph(program.values)
    larger = replace(program, loads=())
    for number, name in enumerate(names, start=1):
        part = _Part(program, graph, given[name], number)
        larger = replace(
            larger,
            coordinates=larger.coordinates + part.coordinates(),
            equations=larger.equations + tuple(sensitivity(x, name) for x in program.equations),
            instances=larger.instances + tuple(map(part.constraint, program.instances)),
            observers=larger.observers + tuple(map(part.output, program.observers)),
            redundant=larger.redundant + tuple(sensitivity(x, name) for x in program.redundant),
        )
    count = len(larger.equations)
    observers = tuple(replace(item, first_row=count) for item in larger.observers)
    content = repr((program.fingerprint, tuple(names)))
    fingerprint = hashlib.sha256(content.encode()).hexdigest()[:32]
    values = tuple(graph.nodes)
    return replace(larger, values=values, observers=observers, fingerprint=fingerprint)


NAMED: tuple[Rows | Columns, ...] = ("coordinates", "parameters", "outputs")
"""What shares its names with the derivatives."""


def check_names(program: Program, names: Sequence[str]) -> None:
    """Refuse what is no parameter, and a mechanism that has the name of a derivative already."""
    known = [item.name for item in program.parameters]
    if problem := parameters_problem(names, known, program.name):
        raise InputError(problem)
    own = [name for kind in NAMED for name in program.names_of(kind)]
    made = {sensitivity(name, parameter) for name in own for parameter in names}
    if taken := made.intersection(own):
        raise ModelError(
            f"{program.name!r} has the name {min(taken)!r}, which its sensitivities use for the "
            "derivative of a coordinate or output by a parameter: rename it"
        )


class _Part:
    """What one parameter adds to a program."""

    def __init__(self, program: Program, graph: Graph, parameter: Parameter, number: int) -> None:
        self._program, self._graph, self._parameter = program, graph, parameter
        self._number = number
        one = graph.const(1)
        names = [item.name for item in program.coordinates]
        self._direction = {
            graph.input(rate(name, order)): graph.input(rate(self._named(name), order))
            for name in names
            for order in range(3)
        } | {graph.input(parameter.name): one}

    def _named(self, name: str) -> str:
        return sensitivity(name, self._parameter.name)

    def coordinates(self) -> tuple[Coordinate, ...]:
        """Return the derivatives of the coordinates."""
        per = self._parameter.unit
        return tuple(
            Coordinate(self._named(item.name), 0.0, quotient_unit(item.unit, per))
            for item in self._program.coordinates
        )

    def constraint(self, instance: Instance) -> Instance:
        """Return the derivative of a constraint."""
        Phi = [node for _, node in sorted(self._nodes(instance, "Phi").items())]
        columns = self._columns(instance)
        kernel = self._derivative(Phi, columns)
        own = instance.constraint
        source = f"{own.name} by {self._parameter.name}"
        first = instance.first_row
        equations = self._program.equations[first : first + len(Phi)]
        rows = _Rows(
            self._named(own.name), (), columns, tuple(map(self._named, equations)), source,
            own.corners,
        )  # fmt: skip
        return self._instance(kernel, rows, columns, first)

    def _derivative(self, Phi: Sequence[int], columns: Sequence[str]) -> Kernel:
        r"""Return the kernel of :math:`\Phi_q s + \Phi_a`.

        It is linear in s: its derivatives are those of Phi_q and Phi_a, which are the same for all
        parameters, times s and its rate.
        """
        graph, own = self._graph, columns[: len(columns) // 2]
        one, two, t = graph.const(1), graph.const(2), graph.input("t")
        s = [[graph.input(rate(name, k)) for name in columns[len(own) :]] for k in range(2)]
        by = [{graph.input(name): one} for name in (*own, self._parameter.name)]
        motion = {graph.input(name): graph.input(rate(name)) for name in own} | {t: one}

        def along(nodes: Sequence[list[int]], direction: Mapping[int, int]) -> list[list[int]]:
            return [tangents(graph, column, direction) for column in nodes]

        slopes = [tangents(graph, Phi, direction) for direction in by]
        first = along(slopes, motion)
        at_rest = self._combined(along(first, motion), [*s[0], one])
        moving = self._combined(first[:-1], [graph.mul(two, x) for x in s[1]])
        vectors = {
            "Phi": self._combined(slopes, [*s[0], one]),
            "nu": [graph.neg(x) for x in self._combined(along(slopes, {t: one}), [*s[0], one])],
            "gamma": [graph.neg(graph.add(*x)) for x in zip(at_rest, moving, strict=True)],
        }
        matrix = [self._combined(along(slopes, direction), [*s[0], one]) for direction in by[:-1]]
        outputs = {
            name: [(row, 0, node) for row, node in enumerate(found)]
            for name, found in vectors.items()
        }
        outputs["Phi_q"] = [
            (row, column, found[row])
            for row in range(len(Phi))
            for column, found in enumerate((*matrix, *slopes[:-1]))
            if graph.value_of(found[row]) != 0
        ]
        return pruned_kernel("Sensitivity", graph, outputs)

    def _combined(self, columns: Sequence[Sequence[int]], factors: Sequence[int]) -> list[int]:
        """Return the sum of columns times their factors, row by row."""
        graph, sums = self._graph, []
        for row in zip(*columns, strict=True):
            total = graph.const(0)
            for node, factor in zip(row, factors, strict=True):
                total = graph.add(total, graph.mul(node, factor))
            sums.append(total)
        return sums

    def output(self, instance: Instance) -> Instance:
        """Return the derivatives of an output, or of those of a point."""
        graph, columns = self._graph, self._columns(instance)
        nan, found = graph.nan(), {}
        for name in TOGETHER["observe"]:
            nodes = self._nodes(instance, name)
            slopes = tangents(graph, list(nodes.values()), self._direction)
            found[name] = {
                row: nan if node == nan else slope
                for (row, node), slope in zip(nodes.items(), slopes, strict=True)
            }
        outputs = {
            name: [(row, 0, node) for row, node in sorted(nodes.items())]
            for name, nodes in found.items()
        }
        y = found["outputs"]
        outputs["outputs_q"] = [
            (row, column, slope)
            for column, name in enumerate(columns)
            for row, slope in zip(
                y, tangents(graph, list(y.values()), {graph.input(name): graph.const(1)}),
                strict=True,
            )
            if graph.value_of(slope) != 0
        ]  # fmt: skip
        own = tuple(
            OutputColumn(self._named(x.name), quotient_unit(x.unit, self._parameter.unit))
            for x in instance.rows
        )
        about = OutputDerivatives(self._named(instance.name), columns, own)
        kernel = pruned_kernel("Output", graph, outputs)
        first = self._number * len(self._program.outputs) + instance.first_output
        return replace(self._instance(kernel, about, columns, 0), first_output=first)

    def _nodes(self, instance: Instance, quantity: str) -> Mapping[int, int]:
        """Return the nodes of a vector of an instance by row, in plain names."""
        inputs = dict(zip(instance.kernel.inputs, instance.bindings, strict=True))
        new = self._graph.instantiate(instance.kernel.nodes, inputs)
        return {row: new[node] for row, _, node in instance.kernel.outputs[quantity]}

    def _columns(self, instance: Instance) -> tuple[str, ...]:
        """Return the coordinates of an instance, then their derivatives."""
        every = self._program.coordinates
        own = dict.fromkeys(every[k].name for k in instance.columns if k is not None)
        return (*own, *map(self._named, own))

    def _instance(
        self, kernel: Kernel, about: _Rows | OutputDerivatives, columns: Sequence[str], row: int
    ) -> Instance:
        """Bind a kernel in plain names to their columns."""
        program, count = self._program, len(self._program.coordinates)
        places = {item.name: k for k, item in enumerate(program.coordinates)}
        places |= {self._named(name): self._number * count + k for name, k in places.items()}
        bindings = tuple(self._graph.input(name) for name in kernel.inputs)
        first = self._number * len(program.equations) + row
        return Instance(kernel, about, first, tuple(places[x] for x in columns), bindings)

r"""The derivatives of a motion by parameters, as outputs: straight-line code with the solve in it.

With the residuals :math:`R_0 = \Phi`, :math:`R_1 = \Phi_q \dot q - \nu` and
:math:`R_2 = \Phi_q \ddot q - \gamma`, whose total derivatives by a parameter a vanish,

.. math:: \Phi_q q_a = -R_{0,a}, \qquad \Phi_q \dot q_a = -(R_{1,q} q_a + R_{1,a}), \qquad
          \Phi_q \ddot q_a = -(R_{2,q} q_a + R_{2,\dot q} \dot q_a + R_{2,a}).

The planned elimination is written out for each right side: what Phi_q alone gives is one node for
all of them, and what a parameter does not move costs nothing. A few columns y(q, \dot q, \ddot q)
of many parameters are differentiated the other way round, by solves with the transposed matrix,

.. math:: \Phi_q^T \kappa = y_{\ddot q}, \quad
          \Phi_q^T \eta = y_{\dot q} - R_{2,\dot q}^T \kappa, \quad
          \Phi_q^T \zeta = y_q - R_{2,q}^T \kappa - R_{1,q}^T \eta, \quad
          y_a - \kappa^T R_{2,a} - \eta^T R_{1,a} - \zeta^T R_{0,a},

whose number does not depend on that of the parameters.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from kincompile.ir.differentiate import tangents
from kincompile.ir.elimination import plan_solve
from kincompile.ir.graph import Graph, depending_on
from kincompile.ir.kernels import pruned_kernel
from kincompile.ir.program import Instance, OutputDerivatives
from kincompile.ir.sensitive import check_names
from kincompile.model.points import OutputColumn
from kincompile.names import quotient_unit, rate, sensitivity
from kincompile.quantities import TOGETHER

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from kincompile.ir.elimination import SolvePlan
    from kincompile.ir.graph import Node
    from kincompile.ir.inline import ConstraintRows, InlineProgram
    from kincompile.ir.program import Program

    Entries = dict[int, int]
    """Nodes by column, of what is not zero."""
    Columns = Sequence[Sequence["_Slopes | None"]]
    """Slopes of columns and of their rates; None of what is not a number."""

DETERMINANT = "determinant_of_block_{}"
"""Names of the first outputs, which say where the elimination may be trusted."""


def observing_sensitivities(
    code: InlineProgram, names: Sequence[str], of: Sequence[str]
) -> Program | None:
    """Return a program without equations whose outputs are derivatives of a motion.

    Parameters
    ----------
    code
        The mechanism.
    names
        Its parameters by which columns are differentiated.
    of
        Those columns: names of coordinates and outputs.

    Returns
    -------
    Program or None
        Its outputs are determinants or pivots of the blocks of Phi_q, then by parameter the
        derivatives of the columns; their rates are the derivatives of the rates. None where Phi_q
        is not solved by elimination: of redundant equations.
    """
    check_names(code.program, names)
    plan = plan_solve(code, is_straight=True)
    if plan is None:
        return None
    program, system = code.program, _Linearized(code, plan, names)
    columns = system.columns(of)
    # A column needs at most four transposed solves, a parameter three solves.
    is_transposed = 4 * len(columns) < 3 * len(names)
    found = system.backward(columns) if is_transposed else system.forward(columns)
    nan = system.graph.nan()
    rows = [(node, nan, nan) for node in system.determinants] + found
    outputs = {
        quantity: [(row, 0, nodes[order]) for row, nodes in enumerate(rows)]
        for order, quantity in enumerate(TOGETHER["observe"])
    }
    kernel = pruned_kernel("Sensitivities", system.graph, outputs)
    about = OutputDerivatives("sensitivities", (), _titles(program, plan, names, of))
    graph = Graph(program.values)
    bindings = tuple(graph.input(name) for name in kernel.inputs)
    content = repr((program.fingerprint, "observed", tuple(names), tuple(of)))
    return replace(
        program,
        equations=(),
        instances=(),
        values=tuple(graph.nodes),
        fingerprint=hashlib.sha256(content.encode()).hexdigest()[:32],
        unsolvable="it has no equations",
        observers=(Instance(kernel, about, 0, (), bindings),),
    )


def _titles(
    program: Program, plan: SolvePlan, names: Sequence[str], of: Sequence[str]
) -> tuple[OutputColumn, ...]:
    """Return names and units of the outputs."""
    units = {item.name: item.unit for item in program.coordinates}
    units |= {item.name: item.unit for item in program.outputs}
    per = {item.name: item.unit for item in program.parameters}
    first = [OutputColumn(DETERMINANT.format(k), "") for k in range(len(plan.determinants))]
    return (
        *first,
        *(
            OutputColumn(sensitivity(name, by), quotient_unit(units[name], per[by]))
            for by in names
            for name in of
        ),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Slopes:
    """The partial derivatives of one number.

    Attributes
    ----------
    by
        Those by q, q_dot and q_ddot, by column.
    by_parameter
        Those by each parameter.
    """

    by: tuple[Entries, Entries, Entries]
    by_parameter: tuple[int, ...]


class _Linearized:
    """The equations of a mechanism and their rates, linearized along a motion.

    Attributes
    ----------
    graph
        The mechanism's code, to which derivatives are added.
    determinants
        Nodes of the determinants of the blocks.
    """

    def __init__(self, code: InlineProgram, plan: SolvePlan, names: Sequence[str]) -> None:
        self._code, self._plan, self.graph = code, plan, Graph(code.nodes)
        graph, coordinates = self.graph, code.program.coordinates
        self._q = [[graph.input(rate(x.name, order)) for x in coordinates] for order in range(3)]
        self._parameters = [graph.input(name) for name in names]
        self._rows = [row for section in code.constraints for row in self._residuals(section)]
        self._given = {f"Phi_q[{x.row}, {x.column}]": x.node for x in code.entries("Phi_q")}
        self._solved = self._planned([graph.input(("b", row)) for row in range(len(plan.right))])
        self._moving = depending_on(plan.nodes, plan.right)
        self.determinants = [self._solved[node] for node in plan.determinants]

    def _planned(self, right: Sequence[int]) -> list[int]:
        """Return the nodes of the planned elimination for a right side."""
        given = self._given | {f"b[{row}]": node for row, node in enumerate(right)}
        return self.graph.instantiate(self._plan.nodes, given)

    def _residuals(self, section: ConstraintRows) -> list[list[_Slopes]]:
        """Return the slopes of Phi, Phi_q q_dot - nu and Phi_q q_ddot - gamma, row by row."""
        graph, entries = self.graph, section.entries
        residuals = [[entry.node for entry in entries["Phi"]]]
        for order, right in enumerate(("nu", "gamma"), start=1):
            sums = {entry.row: graph.neg(entry.node) for entry in entries[right]}
            for entry in entries["Phi_q"]:
                term = graph.mul(entry.node, self._q[order][entry.column])
                sums[entry.row] = graph.add(sums[entry.row], term)
            residuals.append([sums[entry.row] for entry in entries["Phi"]])
        columns = sorted({column for column in section.instance.columns if column is not None})
        slopes = [self._slopes(nodes, columns) for nodes in residuals]
        return [list(row) for row in zip(*slopes, strict=True)]

    def _slopes(self, nodes: Sequence[int], columns: Iterable[int]) -> list[_Slopes]:
        """Return the partial derivatives of nodes that read these coordinates and their rates."""

        def by(variable: int) -> list[int]:
            return tangents(self.graph, nodes, {variable: self.graph.const(1)})

        of_states = [{column: by(state[column]) for column in columns} for state in self._q]
        of_parameters = [by(variable) for variable in self._parameters]
        zero = self.graph.const(0)
        found = []
        for k in range(len(nodes)):
            first, second, third = (
                {column: own[k] for column, own in state.items() if own[k] != zero}
                for state in of_states
            )
            parameters = tuple(own[k] for own in of_parameters)
            found.append(_Slopes((first, second, third), parameters))
        return found

    def columns(self, names: Iterable[str]) -> Columns:
        """Return the slopes of coordinates and outputs, and of their rates."""
        program, nan = self._code.program, self.graph.nan()
        known = {
            item.name: ([state[k] for state in self._q], [k])
            for k, item in enumerate(program.coordinates)
        }
        outputs = program.names_of("outputs")
        for section in self._code.sections[len(program.instances) :]:
            columns = [column for column in section.instance.columns if column is not None]
            for own in zip(*(section.entries[name] for name in TOGETHER["observe"]), strict=True):
                known[outputs[own[0].row]] = [entry.node for entry in own], columns
        return [
            [
                None if node == nan else slopes
                for node, slopes in zip(known[name][0], self._slopes(*known[name]), strict=True)
            ]
            for name in names
        ]

    def _each(self, columns: Columns, value: Callable[[_Slopes], int]) -> list[list[int]]:
        """Return a node for each column and its rates."""
        nan = self.graph.nan()
        return [[nan if own is None else value(own) for own in column] for column in columns]

    def forward(self, columns: Columns) -> list[list[int]]:
        """Return the derivatives of columns and their rates by each parameter: a solve for each."""
        found = []
        for k in range(len(self._parameters)):
            motion: list[list[int]] = []
            for order in range(3):
                right = [self.graph.neg(self._along(motion, k, row[order])) for row in self._rows]
                new = self._planned(right)
                motion.append([new[node] for node in self._plan.solution])
            found += self._each(columns, partial(self._along, motion, k))
        return found

    def _along(self, motion: Sequence[Sequence[int]], parameter: int, slopes: _Slopes) -> int:
        """Return a total derivative by a parameter; what is not yet in the motion is held."""
        graph, total = self.graph, slopes.by_parameter[parameter]
        for by, rates in zip(slopes.by, motion, strict=False):
            for column, slope in by.items():
                total = graph.add(total, graph.mul(slope, rates[column]))
        return total

    def backward(self, columns: Columns) -> list[list[int]]:
        """Return the same by solves with the transposed matrix: some for each column."""
        weights = {own: self._weights(own) for x in columns for own in x if own is not None}
        found = []
        for k in range(len(self._parameters)):
            found += self._each(columns, partial(self._weighted, weights, k))
        return found

    def _weights(self, slopes: _Slopes) -> list[list[int]]:
        """Return zeta, eta and kappa, by which Phi and its rates move a number."""
        graph, zero = self.graph, self.graph.const(0)
        found: list[list[int]] = [[], [], []]
        for order in (2, 1, 0):
            sides = [slopes.by[order].get(column, zero) for column in range(len(self._q[0]))]
            for higher in range(order + 1, 3):
                for row, weight in zip(self._rows, found[higher], strict=True):
                    for column, slope in row[higher].by[order].items():
                        sides[column] = graph.sub(sides[column], graph.mul(slope, weight))
            found[order] = self._transposed(sides)
        return found

    def _weighted(
        self, weights: Mapping[_Slopes, list[list[int]]], parameter: int, slopes: _Slopes
    ) -> int:
        """Return a total derivative by a parameter, from what the equations weigh."""
        graph, total = self.graph, slopes.by_parameter[parameter]
        for order, own in enumerate(weights[slopes]):
            for row, weight in zip(self._rows, own, strict=True):
                term = graph.mul(row[order].by_parameter[parameter], weight)
                total = graph.sub(total, term)
        return total

    def _transposed(self, sides: Sequence[int]) -> list[int]:
        """Return x of Phi_q^T x = b: the plan, linear in its right side, from its end to its start.

        Every number of the plan hands on to its operands what the solution owes to it.
        """
        graph, plan, zero = self.graph, self._plan, self.graph.const(0)
        owed = dict.fromkeys(self._moving, zero)
        for node, side in zip(plan.solution, sides, strict=True):
            owed[node] = graph.add(owed[node], side)
        for node in sorted(self._moving, reverse=True):
            for operand, share in self._shares(plan.nodes[node], owed[node]):
                owed[operand] = graph.add(owed[operand], share)
        return [owed[node] for node in plan.right]

    def _shares(self, content: Node, amount: int) -> Iterator[tuple[int, int]]:
        """Yield the operands of a step that depend on the right side, and what each is owed."""
        graph, new = self.graph, self._solved
        shares: tuple[tuple[int, int], ...] = ()
        match content:
            case "add", a, b:
                shares = ((a, amount), (b, amount))
            case "sub", a, b:
                shares = ((a, amount), (b, graph.neg(amount)))
            case "neg", a:
                shares = ((a, graph.neg(amount)),)
            case "mul", a, b:
                shares = ((a, graph.mul(amount, new[b])), (b, graph.mul(new[a], amount)))
            case "div", a, b:
                shares = ((a, graph.div(amount, new[b])),)
        yield from ((node, share) for node, share in shares if node in self._moving)

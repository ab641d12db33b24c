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

from dataclasses import dataclass
from functools import partial
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, TypeVar

from kincompile.ir.differentiate import tangents
from kincompile.ir.elimination import plan_solve
from kincompile.ir.graph import Graph
from kincompile.ir.looks import MISSED
from kincompile.ir.observing import observing_program
from kincompile.ir.sensitive import check_names
from kincompile.ir.straight_solve import StraightSolve
from kincompile.model.points import OutputColumn
from kincompile.names import quotient_unit, rate, sensitivity
from kincompile.quantities import TOGETHER

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from kincompile.ir.elimination import SolvePlan
    from kincompile.ir.inline import ConstraintRows, InlineProgram
    from kincompile.ir.program import Program

    Entries = dict[int, int]
    """Nodes by column, of what is not zero."""
    Columns = Sequence[Sequence["_Slopes | None"]]
    """Slopes of columns and of their rates; None of what is not a number."""

_T = TypeVar("_T")

DETERMINANT = "determinant_of_block_{}"
"""Names of outputs before all others, which with `MISSED` say where elimination may be trusted."""


def observing_sensitivities(
    code: InlineProgram,
    names: Sequence[str],
    of: Sequence[str],
    *,
    second: bool = False,
    near: Sequence[float] | None = None,
) -> Program | None:
    """Return a program without equations whose outputs are derivatives of a motion.

    They are those of the columns `of`, coordinates and outputs, by the parameters `names`, and of
    `second` ones also by each pair of them, after the part by which solves miss their equations and
    the determinants or pivots of the blocks of Phi_q; their rates are the derivatives of the rates.
    None where the equations are structurally singular. Pivots are chosen at a generic state, or
    `near` an assembled position: what vanishes wherever the equations are met is no pivot there.
    None where that makes no difference, since none of them varies.
    """
    check_names(code.program, names)
    plan = plan_solve(code, is_straight=True, near=near)
    if plan is None or (near is not None and not plan.looks):
        return None
    program, system = code.program, _Linearized(code, plan, names)
    columns = system.columns(of)
    # A column needs at most four transposed solves, a parameter three solves.
    is_transposed = 4 * len(columns) < 3 * len(names) and not second
    found = system.backward(columns) if is_transposed else system.forward(columns)
    if second:
        found += system.second(found)
    nan = system.graph.nan()
    rows = [(node, nan, nan) for node in (system.missed(), *system.determinants)] + found
    outputs = {
        quantity: [nodes[order] for nodes in rows]
        for order, quantity in enumerate(TOGETHER["observe"])
    }
    by: list[str | tuple[str, str]] = [*names, *(pairs_of(names) if second else ())]
    titles = _titles(program, len(plan.determinants), by, of)
    key = tuple(by), tuple(of)
    return observing_program(program, "sensitivities", system.graph, outputs, titles, key=key)


def pairs_of(names: Sequence[_T]) -> tuple[tuple[_T, _T], ...]:
    """Return the pairs by which there are second derivatives, in order."""
    return tuple(combinations_with_replacement(names, 2))


def _titles(
    program: Program, blocks: int, by: Iterable[str | tuple[str, str]], of: Sequence[str]
) -> tuple[OutputColumn, ...]:
    """Return names and units of the outputs."""
    units = {item.name: item.unit for item in program.coordinates}
    units |= {item.name: item.unit for item in program.outputs}
    per = {item.name: item.unit for item in program.parameters}
    found = [OutputColumn(name, "") for name in (MISSED, *map(DETERMINANT.format, range(blocks)))]
    for parameters in by:
        for name in of:
            title, unit = name, units[name]
            for parameter in (parameters,) if isinstance(parameters, str) else parameters:
                title, unit = sensitivity(title, parameter), quotient_unit(unit, per[parameter])
            found.append(OutputColumn(title, unit))
    return tuple(found)


@dataclass(frozen=True, slots=True, eq=False)
class _Slopes:
    """The partial derivatives of one number."""

    by: tuple[Entries, Entries, Entries]  # those by q, q_dot and q_ddot, by column
    by_parameter: tuple[int, ...]  # those by each parameter


class _Linearized:
    """The equations of a mechanism and their rates, linearized along a motion."""

    def __init__(self, code: InlineProgram, plan: SolvePlan, names: Sequence[str]) -> None:
        self._code, self.graph = code, Graph(code.nodes)
        graph, coordinates = self.graph, code.program.coordinates
        self._q = [[graph.input(rate(x.name, order)) for x in coordinates] for order in range(3)]
        self._parameters = [graph.input(name) for name in names]
        self._rows = [row for section in code.constraints for row in self._residuals(section)]
        self._solve = StraightSolve(graph, code.entries("Phi_q"), plan)
        self.determinants = self._solve.determinants
        self._directions: list[dict[int, int]] = []
        self._missed: list[int] = []  # squares of the parts that second derivatives miss

    def missed(self) -> int:
        """Return by what part of their terms solutions miss their equations."""
        return self._solve.missed(besides=self._missed)

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
        outputs, first = program.names_of("outputs"), len(program.instances)
        for section in self._code.sections[first : first + len(program.observers)]:
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
        for k, parameter in enumerate(self._parameters):
            motion: list[list[int]] = []
            for order in range(3):
                right = [self.graph.neg(self._along(motion, k, row[order])) for row in self._rows]
                motion.append(self._solve.solve(right))
            found += self._each(columns, partial(self._along, motion, k))
            self._directions.append({parameter: self.graph.const(1)})
            for state, rates in zip(self._q, motion, strict=True):
                self._directions[k] |= zip(state, rates, strict=True)
        return found

    def second(self, found: Sequence[Sequence[int]]) -> list[list[int]]:
        """Return the derivatives of first derivatives, by each pair of parameters.

        A first derivative is code in q, its rates and p: its total derivative is that along the
        motion of another parameter.
        """
        nan, slopes = self.graph.nan(), []
        size = len(found) // len(self._parameters)
        looks = self._solve.looks()
        for along in self._directions:
            self._missed += [look.missed_along(self.graph, along) for look in looks]
        for first, direction in pairs_of(range(len(self._parameters))):
            for nodes in found[size * first : size * (first + 1)]:
                own = tangents(self.graph, nodes, self._directions[direction])
                pairs = zip(nodes, own, strict=True)
                slopes.append([nan if node == nan else slope for node, slope in pairs])
        return slopes

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
            found[order] = self._solve.transposed(sides)
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

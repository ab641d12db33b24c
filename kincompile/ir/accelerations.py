r"""Forward dynamics as outputs: straight-line code with the solve for the accelerations in it.

.. math:: M \ddot q + \Phi_q^T \lambda = Q, \qquad \Phi_q \ddot q = \gamma

is the equation of motion with its constraints differentiated twice (index 1). The same matrix, with
other right sides, leads a state back to its constraints by the smallest movement, measured by M:

.. math:: \Phi_q \Delta q = -\Phi, \qquad \Phi_q \Delta\dot q = \nu - \Phi_q \dot q.

Where M does not resist a movement, as of a contact or of the length of Euler parameters, a multiple
of :math:`\Phi_q^T \Phi_q` is added to it, and to Q accordingly: that changes no acceleration.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from kincompile.criteria import SOLVED
from kincompile.errors import InputError, StructuralError
from kincompile.ir.augmented import plan_augmented
from kincompile.ir.differentiate import tangents
from kincompile.ir.elimination import sizes_of
from kincompile.ir.graph import Graph
from kincompile.ir.inline import Entry
from kincompile.ir.looks import MISSED
from kincompile.ir.observing import bound, marked, observing_program
from kincompile.ir.straight_solve import StraightSolve
from kincompile.model.points import OutputColumn
from kincompile.names import (
    correction,
    listed,
    rate,
    solved,
    without_loads,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program

    Place = tuple[int, int]


def require_masses(code: InlineProgram) -> None:
    """Refuse a mechanism some bodies of which have no mass, or that has no loads at all."""
    if not code.program.loads:
        raise InputError(without_loads(code.program.name))
    heavy = {entry.row for entry in code.entries("M") if entry.row == entry.column}
    light = [body.name for body in code.program.bodies if not heavy.issuperset(body.columns)]
    if light:
        have = "has" if len(light) == 1 else "have"
        raise StructuralError(
            f"{code.program.name}: {listed(light)} {have} no mass, and the motion of a body "
            "without mass is undetermined. Give m.body mass=... and inertia=...; small ones do."
        )


def observing_accelerations(code: InlineProgram, left_out: Collection[int] = ()) -> Program:
    """Return a program whose outputs are the accelerations of a mechanism that moves freely.

    The power of loads and drivers together comes after them. Rows of equations that repeat others
    are left out.
    """
    motion = _Motion(code, left_out)
    found = motion.accelerations()
    titles = [OutputColumn(solved(name), "") for name in motion.names]
    titles.append(OutputColumn(solved("power"), ""))
    return _program(code, "accelerations", motion, found, titles, left_out)


def with_motion(code: InlineProgram, left_out: Collection[int] = ()) -> Program:
    """Return the program of a mechanism whose accelerations and multipliers are quantities too."""
    motion = _Motion(code, left_out)
    found = motion.solution_or_nan()
    outputs = {"accelerations": found[: motion.n], "multipliers": found[motion.n :]}
    instance, values = bound(code.program, "motion", motion.graph, outputs)
    fingerprint = marked(code.program, "motion", tuple(sorted(left_out)))
    return replace(code.program, values=values, motion=(instance,), fingerprint=fingerprint)


def observing_corrections(code: InlineProgram, left_out: Collection[int] = ()) -> Program:
    """Return a program whose outputs lead coordinates and rates back to their constraints.

    Its outputs are the changes of the coordinates, then those of the rates, then by what part of
    their terms the accelerations there miss the equations of motion.
    """
    motion = _Motion(code, left_out)
    found = [*motion.corrections(), motion.missed()]
    titles = [OutputColumn(correction(name, k), "") for k in range(2) for name in motion.names]
    titles.append(OutputColumn(MISSED, ""))
    return _program(code, "corrections", motion, found, titles, left_out)


def observing_slopes(
    code: InlineProgram, left_out: Collection[int] = ()
) -> tuple[Program, tuple[Place, ...], dict[Place, float]]:
    r"""Return a program whose outputs are the system that the derivatives by a state solve.

    The equations of motion, differentiated by a coordinate or rate a, are

    .. math:: M \ddot q_a + \Phi_q^T \lambda_a = Q_a - M_a \ddot q - \Phi_{q,a}^T \lambda,
              \qquad \Phi_q \ddot q_a = \gamma_a - \Phi_{q,a} \ddot q,

    and those of the power P of loads and drivers follow from the multipliers as
    :math:`P_a + \nu^T \lambda_a` of what stands there for given multipliers.

    Returns
    -------
    Program
        Its outputs are the entries that vary.
    tuple
        Their rows and columns: of the matrix, n + m + 1 columns, then of a right side for each
        coordinate and each rate.
    dict
        The entries that are plain numbers, by row and column.
    """
    motion = _Motion(code, left_out)
    found = motion.slopes()
    values = {place: motion.graph.value_of(node) for place, node in found.items()}
    numbers = {place: float(value) for place, value in values.items() if value is not None}
    moving = {place: node for place, node in found.items() if place not in numbers}
    titles = [OutputColumn(f"slope_{row}_{column}", "") for row, column in moving]
    program = _program(code, "slopes", motion, list(moving.values()), titles, left_out)
    return program, tuple(moving), numbers


def _program(
    code: InlineProgram,
    name: str,
    motion: _Motion,
    nodes: Sequence[int],
    titles: Sequence[OutputColumn],
    left_out: Collection[int],
) -> Program:
    outputs = {"outputs": nodes}
    key = tuple(sorted(left_out))
    return observing_program(code.program, name, motion.graph, outputs, titles, key=key)


class _Motion:
    """The equations of motion of a mechanism, with their planned solve."""

    def __init__(self, code: InlineProgram, left_out: Collection[int]) -> None:
        program = code.program
        self._code, self.graph = code, Graph(code.nodes)
        self.names = program.names_of("coordinates")
        self.n, self._m = len(self.names), len(program.equations)
        self._Phi_q = [entry for entry in code.entries("Phi_q") if entry.row not in left_out]
        self._q_dot = [self.graph.input(rate(name)) for name in self.names]
        self._rows = self._rows_of(self._Phi_q)
        self._weights = self._weighted()
        M = self._mass_matrix()
        self._plan = plan_augmented(
            self.n,
            self._m,
            [(x.row, x.column, self.graph.value_of(x.node)) for x in M],
            [(x.row, x.column, code.number(x.node)) for x in self._Phi_q],
            left_out,
            sizes_of(code),
        )
        jacobian = [Entry(self.n + x.row, x.column, x.node) for x in self._Phi_q]
        mirrored = [Entry(x.column, x.row, x.node) for x in jacobian]
        self._solve = StraightSolve(self.graph, [*M, *jacobian, *mirrored], self._plan)

    def _rows_of(self, entries: Sequence[Entry]) -> dict[int, dict[int, int]]:
        """Return the nodes of Phi_q by row and column."""
        rows: dict[int, dict[int, int]] = {}
        for entry in entries:
            rows.setdefault(entry.row, {})[entry.column] = entry.node
        return rows

    def _weighted(self) -> dict[int, int]:
        """Return the rows whose squares are added to M, with their weights.

        They are those of coordinates without mass, and the norms of Euler parameters. The weight
        makes the added terms as large as the masses that the row connects.
        """
        graph, program = self.graph, self._code.program
        mass = {x.row: x.node for x in self._code.entries("M") if x.row == x.column}
        norms = {item.first_row for item in program.instances if item.is_own}
        weights = {}
        for row, entries in self._rows.items():
            if mass.keys() >= entries.keys() and row not in norms:
                continue
            inertia, square = graph.const(0), graph.const(0)
            for column, node in entries.items():
                inertia = graph.add(inertia, mass.get(column, graph.const(0)))
                square = graph.add(square, graph.square(node))
            weights[row] = graph.div(inertia, square)
        return weights

    def _mass_matrix(self) -> list[Entry]:
        """Return the entries of M, with what is added to it."""
        graph = self.graph
        found = {(x.row, x.column): x.node for x in self._code.entries("M")}
        for row, weight in self._weights.items():
            entries = self._rows[row]
            for i, first in entries.items():
                for j, second in entries.items():
                    term = graph.mul(weight, graph.mul(first, second))
                    found[i, j] = graph.add(found.get((i, j), graph.const(0)), term)
        return [Entry(*place, node) for place, node in sorted(found.items())]

    def _pushed(self, force: Sequence[int], right: Sequence[int]) -> list[int]:
        """Return generalised forces with what is added to them, for a right side of Phi_q."""
        graph, found = self.graph, list(force)
        for row, weight in self._weights.items():
            for column, node in self._rows[row].items():
                term = graph.mul(graph.mul(weight, node), right[row])
                found[column] = graph.add(found[column], term)
        return found

    def _right(self) -> list[int]:
        """Return the right side of the equations of motion."""
        gamma = self._column("gamma", self._m)
        return [*self._pushed(self._column("Q", self.n), gamma), *gamma]

    def missed(self) -> int:
        """Return by what part of their terms accelerations and multipliers miss the equations."""
        return self._solve.missed(self._right())

    def solution(self) -> list[int]:
        """Return the accelerations, then the multipliers."""
        return self._solve.solve(self._right())

    def solution_or_nan(self) -> list[int]:
        """Return the same, NaN where they miss the equations."""
        graph = self.graph
        is_good = graph.compare("<=", self.missed(), graph.const(SOLVED))
        return [graph.select(is_good, node, graph.nan()) for node in self.solution()]

    def accelerations(self) -> list[int]:
        """Return the accelerations, and the power of loads and drivers."""
        found = self.solution()
        return [*found[: self.n], self._power(self._column("Q", self.n), found[self.n :])]

    def _power(self, Q: Sequence[int], multipliers: Sequence[int]) -> int:
        r"""Return the power of loads and drivers, of which the kinetic energy is the work.

        Q has the forces of inertia, whose power is :math:`-\dot q^T \dot M \dot q/2`.
        """
        graph, q_dot = self.graph, self._q_dot
        half = graph.div(graph.const(1), graph.const(2))
        total = graph.const(0)
        for force, speed in zip(Q, q_dot, strict=True):
            total = graph.add(total, graph.mul(force, speed))
        M = self._code.entries("M")
        motion = dict(zip(map(graph.input, self.names), q_dot, strict=True))
        for x, slope in zip(M, tangents(graph, [x.node for x in M], motion), strict=True):
            speeds = graph.mul(q_dot[x.row], q_dot[x.column])
            total = graph.add(total, graph.mul(half, graph.mul(slope, speeds)))
        for factor, nu in zip(multipliers, self._column("nu", self._m), strict=True):
            total = graph.sub(total, graph.mul(factor, nu))
        return total

    def slopes(self) -> dict[tuple[int, int], int]:
        """Return the linear system of the derivatives by coordinates and rates, by place."""
        graph, n, last, one = self.graph, self.n, self.n + self._m, self.graph.const(1)
        names = [("unknown", k) for k in range(last)]
        unknown = [graph.input(name) for name in names]
        # What is held in a derivative is an input, in whose place the solution is put afterwards.
        rest = self._unbalanced(unknown)
        sides: dict[Place, int] = {}
        for k, state in enumerate((*map(graph.input, self.names), *self._q_dot), start=last + 1):
            slopes = enumerate(tangents(graph, rest, {state: one}))
            sides |= {(row, k): node for row, node in slopes if graph.value_of(node) != 0}
        solution = dict(zip(names, self.solution(), strict=True))
        known = {node[1]: k for k, node in enumerate(graph.nodes) if node[0] == "input"}
        new = graph.instantiate(tuple(graph.nodes), known | solution)
        matrix = {(x.row, x.column): x.node for x in self._code.entries("M")}
        for x in self._Phi_q:
            matrix[n + x.row, x.column] = matrix[x.column, n + x.row] = x.node
        matrix |= {(n + row, n + row): one for row in range(self._m) if row not in self._rows}
        matrix |= {(last, n + row): node for row, node in enumerate(self._column("nu", self._m))}
        matrix[last, last] = one
        return matrix | {place: new[node] for place, node in sides.items()}

    def _unbalanced(self, unknown: Sequence[int]) -> list[int]:
        """Return Q - M q_ddot - Phi_q^T lambda, gamma - Phi_q q_ddot, and the power."""
        graph, n = self.graph, self.n
        gamma = self._column("gamma", self._m)
        kept = [node if row in self._rows else graph.const(0) for row, node in enumerate(gamma)]
        rest = [*self._column("Q", n), *kept]
        entries = [(x.row, x.column, x.node) for x in self._code.entries("M")]
        for x in self._Phi_q:
            entries += (x.column, n + x.row, x.node), (n + x.row, x.column, x.node)
        for row, column, node in entries:
            rest[row] = graph.sub(rest[row], graph.mul(node, unknown[column]))
        return [*rest, self._power(self._column("Q", n), unknown[n:])]

    def corrections(self) -> list[int]:
        """Return the corrections of coordinates and of rates."""
        graph = self.graph
        position = [graph.neg(node) for node in self._column("Phi", self._m)]
        velocity = self._column("nu", self._m)
        for entry in self._Phi_q:
            term = graph.mul(entry.node, self._q_dot[entry.column])
            velocity[entry.row] = graph.sub(velocity[entry.row], term)
        found = []
        for right in (position, velocity):
            still = self._pushed([graph.const(0)] * self.n, right)
            found += self._solve.solve([*still, *right])[: self.n]
        return found

    def _column(self, quantity: str, size: int) -> list[int]:
        """Return the nodes of a vector."""
        found = [self.graph.const(0)] * size
        for entry in self._code.entries(quantity):
            found[entry.row] = entry.node
        return found

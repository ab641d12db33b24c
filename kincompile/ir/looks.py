"""Linear systems multiplied back, in the code that solves them.

A look takes the sum of all equations with weights that have no pattern: no errors cancel in it. It
may be missed by `criteria.SOLVED` of its terms. Pivots that are plain numbers, blocks in closed
form and those with pivoting need no look here: with these the motion was solved for, and looked at.
Elimination in a fixed order does, since a pivot that varies may be a rounding error at some
parameters: r_1 - r_3 / 3 of radii 0.1 and 0.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.criteria import TINY, probe_of
from kincompile.ir.differentiate import tangents

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from kincompile.ir.graph import Graph

MISSED = "missed_by_solves"
"""Name of an output: by what part of their terms sums of equations are missed."""


@dataclass(frozen=True, slots=True)
class Look:
    """The sum of equations of a linear system with its solution put in; all are nodes."""

    factors: tuple[int, ...]  # coefficients of the sum
    unknown: tuple[int, ...]  # what they are multiplied by
    rest: int  # what the sum misses

    @classmethod
    def at(
        cls,
        graph: Graph,
        matrix: Mapping[int, Mapping[int, int]],
        right: Mapping[int, int],
        solution: Mapping[int, int],
        weights: Mapping[int, float],
    ) -> Look:
        """Return that of equations by row and column; weights make them count alike."""
        found, rest = dict[int, int](), graph.const(0)
        for (row, entries), part in zip(matrix.items(), parts_of(len(matrix)), strict=True):
            weight = graph.const(part * weights.get(row, 1.0))
            rest = graph.sub(rest, graph.mul(weight, right[row]))
            for column, node in entries.items():
                before = found.get(column, graph.const(0))
                found[column] = graph.add(before, graph.mul(weight, node))
        for column, node in found.items():
            rest = graph.add(rest, graph.mul(node, solution[column]))
        return cls(tuple(found.values()), tuple(solution[column] for column in found), rest)

    def within(self, new: Sequence[int]) -> Look:
        """Return the same in a graph where nodes have other numbers."""
        factors, unknown = (tuple(new[node] for node in x) for x in (self.factors, self.unknown))
        return Look(factors, unknown, new[self.rest])

    def missed(self, graph: Graph) -> int:
        """Return the square of the part of its terms by which the sum is missed."""
        return self._part(graph, self.factors, self.rest)

    def missed_along(self, graph: Graph, direction: Mapping[int, int]) -> int:
        """Return that of the sum differentiated: its terms are those that change."""
        *slopes, rest = tangents(graph, (*self.factors, self.rest), direction)
        return self._part(graph, slopes, rest)

    def _part(self, graph: Graph, factors: Iterable[int], rest: int) -> int:
        terms = graph.const(0)
        for factor, unknown in zip(factors, self.unknown, strict=True):
            terms = graph.add(terms, graph.square(graph.mul(factor, unknown)))
        return graph.div(graph.square(rest), graph.add(terms, graph.const(TINY)))


def parts_of(count: int) -> list[float]:
    """Return short numbers of size 1/2 to 1 and either sign without a pattern."""
    return [round(64 * x) / 64 for x in probe_of(count).tolist()]


def root_of(graph: Graph, squares: Iterable[int]) -> int:
    """Return the root of a sum."""
    total = graph.const(0)
    for square in squares:
        total = graph.add(total, square)
    return graph.call("sqrt", total)

r"""The planned solve of the equations of motion: accelerations and multipliers together.

.. math:: \begin{pmatrix} M & \Phi_q^T \\ \Phi_q & 0 \end{pmatrix}
          \begin{pmatrix} \ddot q \\ \lambda \end{pmatrix}
          = \begin{pmatrix} Q \\ \gamma \end{pmatrix}

Plain numbers of :math:`\Phi_q` are pivots first, as in kinematics, each together with its mirror
image: that removes a coordinate and a multiplier. What is left of M is positive definite, whatever
the position, so that its diagonal needs no search for pivots, and then the diagonal of the
multipliers is negative definite as long as the equations are independent.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.ir.elimination import (
    Matrix,
    Pivot,
    Sizes,
    SolvePlan,
    eliminate,
    eliminate_constants,
    matrix_of,
    power_of_two,
    substitute,
)
from kincompile.ir.graph import Graph
from kincompile.ir.looks import Look

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from kincompile.ir.graph import Constant

    Entries = Sequence[tuple[int, int, Constant | None]]


def plan_augmented(
    n: int,
    m: int,
    M: Entries,
    Phi_q: Entries,
    left_out: Collection[int] = (),
    sizes: Sizes | None = None,
) -> SolvePlan:
    """Plan the solve for n accelerations and m multipliers, which has as many right sides.

    Entries of a matrix are row, column and the number, None where it varies; M is positive definite
    for all movements that the equations with plain numbers allow. Multipliers of rows that are left
    out, since they repeat others, are zero. Determinants are the pivots that vary; their signs
    never change. Looks are at the balance of forces, and at Phi_q. `sizes` are those of Phi_q.
    """
    graph = Graph()
    kept = [entry for entry in Phi_q if entry[0] not in left_out]
    mirrored = [(column, n + row, value) for row, column, value in kept]
    whole = [*M, *((n + row, column, value) for row, column, value in kept), *mirrored]
    matrix, varying = matrix_of(graph, n + m, whole)
    right = {row: graph.input(f"b[{row}]") for row in matrix}
    given = tuple(right.values())
    solution = {n + row: graph.const(0) for row in left_out}
    for row in solution:
        del matrix[row]
    untouched, sides = {row: dict(entries) for row, entries in matrix.items()}, dict(right)
    pivots: list[Pivot] = []
    eliminated: Matrix = {}
    plain = Sizes()
    for found in _safe_pivots(m, kept, sizes or Sizes()):
        row, column = n + found.row, found.column
        for pivot in (Pivot(row, column), Pivot(column, row)):
            pivots.append(pivot)
            eliminated[pivot.row] = eliminate(graph, matrix, right, pivot, plain)
    _mirror(matrix)
    first = [index for index in matrix if index < n]
    rest = [index for index in matrix if index >= n]
    diagonal = []
    for pivot in (*_diagonal(graph, matrix, right, eliminated, first),
                  *_diagonal(graph, matrix, right, eliminated, rest)):  # fmt: skip
        pivots.append(pivot)
        diagonal.append(eliminated[pivot.row][pivot.column])
    substitute(graph, pivots, eliminated, right, solution)
    weights = _weights(n, sizes or plain)
    forces = {row: entries for row, entries in untouched.items() if row < n}
    equations = {row: entries for row, entries in untouched.items() if row >= n}
    looks = tuple(Look.at(graph, x, sides, solution, weights) for x in (forces, equations))
    return SolvePlan(
        tuple(graph.nodes),
        tuple(varying),
        given,
        tuple(pivots),
        (),
        tuple(diagonal),
        tuple(solution[index] for index in range(n + m)),
        looks=looks,
    )


def _weights(n: int, sizes: Sizes) -> dict[int, float]:
    """Return weights by which forces, and then equations, count alike."""
    forces = {column: power_of_two(scale) for column, scale in sizes.scales.items()}
    return forces | {n + row: weight for row, weight in sizes.weights().items()}


def _safe_pivots(m: int, entries: Entries, sizes: Sizes) -> Iterable[Pivot]:
    """Return the pivots of Phi_q that are plain numbers."""
    graph = Graph()
    matrix, _ = matrix_of(graph, m, entries)
    right = {row: graph.input(row) for row in matrix}
    return eliminate_constants(graph, matrix, right, sizes)


def _mirror(matrix: Matrix) -> None:
    """Put the nodes above the diagonal below it too: equal values become equal nodes."""
    for row, entries in matrix.items():
        for column in [column for column in entries if column < row]:
            del entries[column]
    for row, entries in matrix.items():
        for column, node in entries.items():
            if column > row:
                matrix[column][row] = node


def _diagonal(
    graph: Graph,
    matrix: Matrix,
    right: dict[int, int],
    eliminated: Matrix,
    indices: Collection[int],
) -> Iterable[Pivot]:
    """Yield the diagonal entries of a symmetric matrix, eliminated with least fill first."""
    left = set(indices)
    while left:
        index = min(left, key=lambda item: (len(matrix[item]), item))
        left.remove(index)
        row = eliminated[index] = matrix.pop(index)
        others = sorted(row.keys() - {index})
        for other in others:
            entries = matrix[other]
            factor = graph.div(entries.pop(index), row[index])
            right[other] = graph.sub(right[other], graph.mul(factor, right[index]))
            for column in others[others.index(other) :]:
                change = graph.mul(factor, row[column])
                old = entries.get(column)
                new = graph.neg(change) if old is None else graph.sub(old, change)
                entries[column] = matrix[column][other] = new
        yield Pivot(index, index)

"""The linear solve of Phi_q x = b, planned at compile time.

Most pivots of Phi_q are plain numbers, +1 or -1 from joints and drivers. Elimination with those is
safe for every q, t and p, costs few operations, and leaves a small system that falls into blocks:
a four-bar of nine equations leaves one of two. Blocks of up to three are solved in closed form,
larger ones by LAPACK. The code is a graph like any other: what depends on Phi_q alone is the
factorization, shared by all right sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING

from kincompile.ir.graph import Constant, Graph, Node
from kincompile.ir.inline import input_name
from kincompile.structure.blocks import Block, block_triangular

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
    from typing import TypeAlias

    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.orientations import SmallRotation

    Turn: TypeAlias = Callable[[Graph, "Matrix", Mapping[int, int]], list[SmallRotation]]

Matrix = dict[int, dict[int, int]]
"""Nodes of the entries by row and column."""


LARGEST_CLOSED_FORM = 3
"""Blocks up to this size are solved by their adjugate, as Cramer's rule does."""
LARGEST_PIVOTED = 6
"""Blocks up to this size are eliminated in straight-line code in space, where six unknowns a body
are the rule; larger ones by LAPACK."""


@dataclass(frozen=True, slots=True)
class Pivot:
    """An elimination step: an equation used to express one coordinate by the others."""

    row: int
    column: int


@dataclass(frozen=True, slots=True)
class SolvePlan:
    """Straight-line code that solves Phi_q x = b."""

    nodes: tuple[Node, ...]
    # ``(row, column, node)`` of the entries of Phi_q that vary, row by row: inputs of the code.
    entries: tuple[tuple[int, int, int], ...]
    right: tuple[int, ...]  # node of each component of b: inputs of the code
    pivots: tuple[Pivot, ...]  # elimination steps in order
    blocks: tuple[Block, ...]  # what is left, in the order of solution
    determinants: tuple[int, ...]  # node of each block's determinant
    solution: tuple[int, ...]  # node of each coordinate
    # Column of e0 of each body whose stretch s and small rotation pi' have four columns after those
    # of Phi_q.
    turned: tuple[int, ...] = ()
    # Size up to which blocks are straight-line code; LAPACK solves larger ones.
    straight: int = LARGEST_CLOSED_FORM

    @property
    def has_choices(self) -> bool:
        """Whether rows change places: there is a block of more than three, not solved by LAPACK."""
        sizes = (len(block.rows) for block in self.blocks)
        return any(LARGEST_CLOSED_FORM < size <= self.straight for size in sizes)

    @property
    def has_large_blocks(self) -> bool:
        """Whether there is a block that LAPACK solves."""
        return any(len(block.rows) > self.straight for block in self.blocks)


def plan_solve(code: InlineProgram, *, is_straight: bool = False) -> SolvePlan | None:
    """Plan the solve of the independent equations; None where they are structurally singular.

    Redundant equations are left out: that they are met is for the solver to check.
    `is_straight` is for code that may not call LAPACK: larger blocks are eliminated too, with
    pivots that vary. The determinants are then these pivots.
    """
    equations, redundant = code.program.equations, code.program.redundant
    size = len(equations), len(code.program.coordinates)
    left_out = frozenset(equations.index(name) for name in redundant)
    turn: Turn | None = None
    if any(instance.is_own for instance in code.program.instances):
        space = import_module("kincompile.ir.orientations")  # a planar model does without
        turn = partial(space.small_rotations, code)
    return plan_entries(
        *size, jacobian_entries(code), left_out=left_out, is_straight=is_straight, turn=turn
    )


def jacobian_entries(code: InlineProgram) -> list[tuple[int, int, Constant | None]]:
    """Return row, column and, where it is one, number of each entry not identically zero."""
    return [(entry.row, entry.column, code.number(entry.node)) for entry in code.entries("Phi_q")]


def plan_entries(
    row_count: int,
    column_count: int,
    entries: Iterable[tuple[int, int, Constant | None]],
    *,
    left_out: Collection[int] = (),
    is_straight: bool = False,
    turn: Turn | None = None,
) -> SolvePlan | None:
    """Plan the solve of a matrix given by its entries, each a number or, where it varies, None.

    Rows that are left out are inputs that nothing reads. `turn` replaces the Euler parameters of
    bodies by small rotations.
    """
    graph = Graph()
    matrix, varying = matrix_of(graph, row_count, entries)
    right = {row: graph.input(f"b[{row}]") for row in matrix}
    given = tuple(right.values())
    for row in left_out:
        del matrix[row]
    pivots, eliminated = _eliminate(graph, matrix, right)
    rotations = [] if turn is None else turn(graph, matrix, right)
    rows = sorted(matrix)
    settled = {pivot.column for pivot in pivots}.union(*(item.columns for item in rotations))
    columns = sorted(set(range(column_count)) - settled)
    columns += [column for item in rotations for column in item.turns]
    solution = {column: node for item in rotations for column, node in item.solution.items()}
    if len(rows) != len(columns):
        return None
    pattern = [(row, k) for row in rows for k in sorted(matrix[row].keys() - solution.keys())]
    blocks = block_triangular(rows, columns, pattern)
    if blocks is None:
        return None
    determinants: list[int] = []
    straight = LARGEST_CLOSED_FORM if turn is None else LARGEST_PIVOTED
    for block in blocks:
        if is_straight and len(block.rows) > straight:
            determinants += _eliminate_block(graph, block, matrix, right, solution)
        else:
            determinants += _solve_block(graph, block, matrix, right, solution, straight)
        for item in rotations:
            if not item.is_finished and solution.keys() >= set(item.turns):
                item.finish(matrix, solution)
    substitute(graph, pivots, eliminated, right, solution)
    if not solution.keys() >= set(range(column_count)):
        return None
    return SolvePlan(
        tuple(graph.nodes),
        tuple(varying),
        given,
        tuple(pivots),
        blocks,
        tuple(determinants),
        tuple(solution[column] for column in range(column_count)),
        tuple(item.columns[0] for item in rotations),
        straight,
    )


def matrix_of(
    graph: Graph, row_count: int, entries: Iterable[tuple[int, int, Constant | None]]
) -> tuple[Matrix, list[tuple[int, int, int]]]:
    """Return nodes of a matrix by row and column, and of the entries that are inputs."""
    matrix: Matrix = {row: {} for row in range(row_count)}
    varying = []
    for row, column, value in entries:
        if value is None:
            matrix[row][column] = graph.input(input_name(row, column))
            varying.append((row, column, matrix[row][column]))
        else:
            matrix[row][column] = graph.const(value)
    return matrix, varying


def _remainder(
    graph: Graph,
    terms: dict[int, int],
    unknown: Collection[int],
    right: int,
    solution: dict[int, int],
) -> int:
    """Return the right side of an equation less its terms in coordinates that are known."""
    for column in sorted(terms.keys() - set(unknown)):
        right = graph.sub(right, graph.mul(terms[column], solution[column]))
    return right


def substitute(
    graph: Graph,
    pivots: Sequence[Pivot],
    eliminated: Matrix,
    right: dict[int, int],
    solution: dict[int, int],
) -> None:
    """Add the coordinates that were eliminated to the solution, the last one first."""
    for pivot in reversed(pivots):
        terms = eliminated[pivot.row]
        rest = _remainder(graph, terms, {pivot.column}, right[pivot.row], solution)
        solution[pivot.column] = graph.div(rest, terms[pivot.column])


def _eliminate(
    graph: Graph, matrix: Matrix, right: dict[int, int], *, any_pivot: bool = False
) -> tuple[list[Pivot], Matrix]:
    """Eliminate with plain numbers, or any pivot, as long as there are such.

    Return the pivots and their rows, which are taken out of the matrix.
    """
    pivots: list[Pivot] = []
    eliminated: Matrix = {}
    while (pivot := _cheapest(graph, matrix, any_pivot)) is not None:
        pivots.append(pivot)
        eliminated[pivot.row] = eliminate(graph, matrix, right, pivot)
    return pivots, eliminated


def eliminate_constants(graph: Graph, matrix: Matrix, right: dict[int, int]) -> list[Pivot]:
    """Eliminate with plain numbers as long as there are such, and return the pivots."""
    return _eliminate(graph, matrix, right)[0]


def eliminate(graph: Graph, matrix: Matrix, right: dict[int, int], pivot: Pivot) -> dict[int, int]:
    """Eliminate a coordinate from all other rows; return the row of the pivot, taken out."""
    row = matrix.pop(pivot.row)
    for other, entries in matrix.items():
        if pivot.column not in entries:
            continue
        factor = graph.div(entries.pop(pivot.column), row[pivot.column])
        for column, node in row.items():
            if column == pivot.column:
                continue
            change = graph.mul(factor, node)
            updated = graph.sub(entries[column], change) if column in entries else graph.neg(change)
            entries[column] = updated
            if graph.value_of(updated) == 0:
                del entries[column]
        right[other] = graph.sub(right[other], graph.mul(factor, right[pivot.row]))
    return row


def _cheapest(graph: Graph, matrix: Matrix, any_pivot: bool) -> Pivot | None:
    """Return the constant entry, or any, with the least fill (Markowitz), the first of equals."""
    in_column: dict[int, int] = {}
    for entries in matrix.values():
        for column in entries:
            in_column[column] = in_column.get(column, 0) + 1
    best: tuple[int, int, int] | None = None
    for row, entries in matrix.items():
        numbers = {column: graph.value_of(node) for column, node in entries.items()}
        sizes = {column: abs(float(x)) for column, x in numbers.items() if x is not None}
        least = SAFE * max(sizes.values(), default=0.0)
        for column in entries:
            # A number such as cos(pi/2) = 6e-17 is no pivot.
            if not any_pivot and not sizes.get(column, -1.0) >= least:
                continue
            rank = ((len(entries) - 1) * (in_column[column] - 1), row, column)
            if best is None or rank < best:
                best = rank
    return None if best is None else Pivot(best[1], best[2])


def _solve_block(
    graph: Graph,
    block: Block,
    matrix: Matrix,
    right: dict[int, int],
    solution: dict[int, int],
    straight: int,
) -> list[int]:
    """Add the solution of a block to what is known; return the node of its determinant."""
    zero = graph.const(0)
    size = len(block.rows)
    a = [[matrix[row].get(column, zero) for column in block.columns] for row in block.rows]
    b = [_remainder(graph, matrix[row], block.columns, right[row], solution) for row in block.rows]
    if LARGEST_CLOSED_FORM < size <= straight:
        x, pivots = _pivoted(graph, a, b)
        solution |= zip(block.columns, x, strict=True)
        return [pivots]
    if size > straight:
        entries = [node for row in a for node in row]
        for k, column in enumerate(block.columns):
            solution[column] = graph.linear("solve", size, k, (*entries, *b))
        return [graph.linear("determinant", size, 0, entries)]
    adjugate, determinant = _adjugate(graph, a)
    inverse = graph.div(graph.const(1), determinant)
    for column, cofactors in zip(block.columns, adjugate, strict=True):
        total = graph.mul(cofactors[0], b[0])
        for cofactor, value in zip(cofactors[1:], b[1:], strict=True):
            total = graph.add(total, graph.mul(cofactor, value))
        solution[column] = graph.mul(total, inverse)
    return [determinant]


def _pivoted(graph: Graph, a: list[list[int]], b: list[int]) -> tuple[list[int], int]:
    """Return x of a x = b by elimination with partial pivoting, and the determinant of a.

    Rows change places by choices, not by branches, so that many points are solved at once.
    """
    size, determinant = len(a), graph.const(1)
    inverses = []
    for k in range(size):
        for i in range(k + 1, size):
            is_larger = graph.compare("<", graph.square(a[k][k]), graph.square(a[i][k]))
            choose = partial(graph.select, is_larger)
            pairs = [(choose(y, x), choose(x, y)) for x, y in zip(a[k][k:], a[i][k:], strict=True)]
            a[k][k:], a[i][k:] = (list(row) for row in zip(*pairs, strict=True))
            b[k], b[i] = choose(b[i], b[k]), choose(b[k], b[i])
            determinant = choose(graph.neg(determinant), determinant)
        determinant = graph.mul(determinant, a[k][k])
        inverses.append(graph.div(graph.const(1), a[k][k]))
        for i in range(k + 1, size):
            factor = graph.mul(a[i][k], inverses[k])
            for j in range(k + 1, size):
                a[i][j] = graph.sub(a[i][j], graph.mul(factor, a[k][j]))
            b[i] = graph.sub(b[i], graph.mul(factor, b[k]))
    x = list(b)
    for k in reversed(range(size)):
        for j in range(k + 1, size):
            x[k] = graph.sub(x[k], graph.mul(a[k][j], x[j]))
        x[k] = graph.mul(x[k], inverses[k])
    return x, determinant


def _eliminate_block(
    graph: Graph, block: Block, matrix: Matrix, right: dict[int, int], solution: dict[int, int]
) -> list[int]:
    """Add the solution of a block to what is known; return its pivots, whatever varies in them."""
    own = set(block.columns)
    part = {row: {k: x for k, x in matrix[row].items() if k in own} for row in block.rows}
    sides = {row: _remainder(graph, matrix[row], own, right[row], solution) for row in block.rows}
    pivots, eliminated = _eliminate(graph, part, sides, any_pivot=True)
    if not part:
        substitute(graph, pivots, eliminated, sides, solution)
    return [eliminated[pivot.row][pivot.column] for pivot in pivots]


SAFE = 1e-3
"""Size of a plain number, relative to the largest of its row, from which on it is a pivot."""


def _adjugate(graph: Graph, a: list[list[int]]) -> tuple[list[list[int]], int]:
    """Return the transposed cofactors of a matrix of one to three rows, and its determinant."""
    size = len(a)
    if size == 1:
        return [[graph.const(1)]], a[0][0]
    if size == 2:
        (p, q), (r, s) = a
        determinant = graph.sub(graph.mul(p, s), graph.mul(q, r))
        return [[s, graph.neg(q)], [graph.neg(r), p]], determinant
    cofactors = [[_cofactor(graph, a, row, column) for row in range(3)] for column in range(3)]
    determinant = graph.const(0)
    for column in range(3):
        determinant = graph.add(determinant, graph.mul(a[0][column], cofactors[column][0]))
    return cofactors, determinant


def _cofactor(graph: Graph, a: list[list[int]], row: int, column: int) -> int:
    """Return a cofactor of a matrix of three rows; cyclic indices carry the sign."""
    below, under = (row + 1) % 3, (row + 2) % 3
    right, beyond = (column + 1) % 3, (column + 2) % 3
    return graph.sub(
        graph.mul(a[below][right], a[under][beyond]), graph.mul(a[below][beyond], a[under][right])
    )

"""The linear solve of Phi_q x = b, planned at compile time.

Most pivots of Phi_q are plain numbers, +1 or -1 from joints and drivers. Elimination with those is
safe for every q, t and p, costs few operations, and leaves a small system that falls into blocks:
a four-bar of nine equations leaves one of two. Blocks of up to three are solved in closed form,
larger ones by LAPACK, or a part at a time where they fall into parts (`bordered`). The code is a
graph like any other: what depends on Phi_q alone is the factorization, shared by all right sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import NOISE, SAFE_PIVOT, SLIGHT, probe_of, rounded, size_of
from kincompile.ir.bordered import LARGEST_PART, bordered, eliminated, solve_parts
from kincompile.ir.graph import Constant, Graph, Node
from kincompile.ir.inline import input_name
from kincompile.ir.interpret import apply, evaluator
from kincompile.ir.looks import Look, parts_of
from kincompile.quantities import turning
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
LARGEST_PIVOTED = LARGEST_PART
"""Blocks up to this size are eliminated in straight-line code in space, where six unknowns a body
are the rule; larger ones in parts, or by LAPACK."""


@dataclass(frozen=True, slots=True)
class Pivot:
    """An elimination step: an equation used to express one coordinate by the others."""

    row: int
    column: int


@dataclass(frozen=True, slots=True)
class Sizes:
    """How large the entries of a matrix are at a generic position, in scales of the coordinates.

    Of what elimination computes it is the sum of the sizes of the terms: what is left of them by
    cancellation is judged by what it was made of.
    """

    # By row and column; of an entry that is missing, its own number, or nothing where it varies.
    entries: dict[tuple[int, int], float] = field(default_factory=dict)
    scales: Mapping[int, float] = field(default_factory=dict)  # by column; 1.0 where it is missing
    # Values at that position of the entries that vary, with signs, as far as known.
    values: dict[tuple[int, int], float] = field(default_factory=dict)

    @property
    def length(self) -> float:
        """The scale of lengths, which is the largest lever arm; 1.0 where there are none."""
        return next((x for x in self.scales.values() if x != 1), 1.0)

    def of(self, graph: Graph, row: int, column: int, node: int) -> float:
        """Return the size of an entry."""
        found = self.entries.get((row, column))
        return self.number(graph, column, node) or 0.0 if found is None else found

    def number(self, graph: Graph, column: int, node: int) -> float | None:
        """Return the size that an entry has as it is; None where it is not a plain number."""
        value = graph.value_of(node)
        return None if value is None else abs(float(value)) * self.scales.get(column, 1.0)

    def value(self, graph: Graph, row: int, column: int, node: int) -> float:
        """Return what an entry is, in scales; NaN where it varies and nothing is known of it."""
        value = graph.value_of(node)
        if value is None:
            return self.values.get((row, column), math.nan)
        return float(value) * self.scales.get(column, 1.0)

    def measure(self, graph: Graph, matrix: Matrix) -> None:
        """Take the values of all entries of a matrix at the position, from those it began with."""
        scales = self.scales
        given = {input_name(*k): x / scales.get(k[1], 1.0) for k, x in self.values.items()}
        found: list[Any] = []
        with np.errstate(all="ignore"):
            for operation, *operands in graph.nodes:
                # A block that was solved depends on the right side, and no entry on it.
                unknown = operation == "linear"
                unknown |= operation == "input" and operands[0] not in given
                found.append(np.nan if unknown else apply(operation, operands, found, given, {}))
        for row, entries in matrix.items():
            for column, node in entries.items():
                value = float(found[node]) * scales.get(column, 1.0)
                self.values[row, column], self.entries[row, column] = value, abs(value)

    def weights(self) -> dict[int, float]:
        """Return weights by which rows count alike: powers of two, the same on every processor."""
        terms: dict[int, float] = {}
        for (row, _), size in self.entries.items():
            terms[row] = terms.get(row, 0.0) + size
        return {row: 1 / power_of_two(size) for row, size in terms.items()}


def power_of_two(size: float) -> float:
    """Return the power of two that is nearest to a size; 1.0 for nothing."""
    return 2.0 ** round(math.log2(size)) if size else 1.0


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
    looks: tuple[Look, ...] = ()  # at what was eliminated in a fixed order
    # What is left of each equation where it is used, for pages that show the elimination: nodes by
    # column, and of its right side.
    rows: Mapping[int, Mapping[int, int]] = field(default_factory=dict, compare=False)
    sides: Mapping[int, int] = field(default_factory=dict, compare=False)
    # Of each Euler parameter that a small rotation replaces, the nodes that it is made of, by
    # column of the stretch and the rotation.
    bases: Mapping[int, Mapping[int, int]] = field(default_factory=dict, compare=False)

    @property
    def has_choices(self) -> bool:
        """Whether rows change places, which LAPACK does by itself."""
        return any(node[0] == "select" for node in self.nodes)

    @property
    def largest_call(self) -> int:
        """How many equations LAPACK solves together at most."""
        return max((int(node[2]) for node in self.nodes if node[0] == "linear"), default=0)


def plan_solve(
    code: InlineProgram, *, is_straight: bool = False, near: Sequence[float] | None = None
) -> SolvePlan | None:
    """Plan the solve of the independent equations; None where they are structurally singular.

    Redundant equations are left out: that they are met is for the solver to check. Pivots are
    judged at a generic position, or near one that is given, where by symmetry some may vanish.
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
        *size,
        jacobian_entries(code),
        left_out=left_out,
        is_straight=is_straight,
        turn=turn,
        sizes=sizes_of(code, near),
        is_near=near is not None,
    )


def sizes_of(code: InlineProgram, near: Sequence[float] | None = None) -> Sizes:
    """Return the sizes of the entries of Phi_q where the runtime measures its equations too.

    Or beside a position that is given.
    """
    program = code.program
    guess = np.array([item.guess for item in program.coordinates])
    units = (item.unit for item in program.coordinates)
    angular = np.array(turning(units, [body.columns for body in program.bodies]), dtype=bool)
    pattern = np.array(code.pattern(), dtype=np.intp).reshape(-1, 2)
    evaluate: Any = evaluator(code)
    with np.errstate(all="ignore"):
        size = float(rounded(size_of(evaluate, pattern, angular, guess))) or 1.0
        scales = np.where(angular, 1.0, size)
        probe = scales * probe_of(guess.size)
        place = guess + probe if near is None else np.array(near) + SLIGHT * probe
        entries = evaluate(place)[1] * scales[pattern[:, 1]]
    values = np.nan_to_num(entries, posinf=0.0, neginf=0.0)
    sizes, known = (
        dict(zip(code.pattern(), found.tolist(), strict=True)) for found in (np.abs(values), values)
    )
    return Sizes(sizes, dict(enumerate(scales.tolist())), known)


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
    sizes: Sizes | None = None,
    is_near: bool = False,
) -> SolvePlan | None:
    """Plan the solve of a matrix given by its entries, each a number or, where it varies, None.

    Rows that are left out are inputs that nothing reads. `turn` replaces the Euler parameters of
    bodies by small rotations. Pivots are judged by the sizes of entries where these are known;
    those of small rotations are where the plan is for the neighbourhood of one position.
    """
    graph, sizes = Graph(), sizes or Sizes()
    matrix, varying = matrix_of(graph, row_count, entries)
    right = {row: graph.input(f"b[{row}]") for row in matrix}
    given = tuple(right.values())
    for row in left_out:
        del matrix[row]
    pivots, eliminated = _eliminate(graph, matrix, right, sizes)
    rotations = [] if turn is None else turn(graph, matrix, right)
    if is_near:
        sizes.measure(graph, matrix)
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
    looks: list[Look] = []
    straight = LARGEST_CLOSED_FORM if turn is None else LARGEST_PIVOTED
    used: dict[int, Mapping[int, int]] = dict(eliminated)
    for block in blocks:
        used |= {row: dict(matrix[row]) for row in block.rows}
        if is_straight and len(block.rows) > straight:
            pivots_there, look = _eliminate_block(graph, block, matrix, right, solution, sizes)
            determinants += pivots_there
            looks.append(look)
        else:
            determinants += _solve_block(graph, block, matrix, right, solution, straight, sizes)
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
        tuple(looks),
        used,
        right,
        {column: terms for item in rotations for column, terms in item.bases.items()},
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
    graph: Graph, matrix: Matrix, right: dict[int, int], sizes: Sizes, *, any_pivot: bool = False
) -> tuple[list[Pivot], Matrix]:
    """Eliminate with plain numbers, or any pivot, as long as there are such.

    Return the pivots and their rows, which are taken out of the matrix.
    """
    pivots: list[Pivot] = []
    eliminated: Matrix = {}
    while (pivot := _cheapest(graph, matrix, sizes, any_pivot)) is not None:
        pivots.append(pivot)
        eliminated[pivot.row] = eliminate(graph, matrix, right, pivot, sizes)
    return pivots, eliminated


def eliminate_constants(
    graph: Graph, matrix: Matrix, right: dict[int, int], sizes: Sizes
) -> list[Pivot]:
    """Eliminate with plain numbers as long as there are such, and return the pivots."""
    return _eliminate(graph, matrix, right, sizes)[0]


def eliminate(
    graph: Graph, matrix: Matrix, right: dict[int, int], pivot: Pivot, sizes: Sizes
) -> dict[int, int]:
    """Eliminate a coordinate from all other rows; return the row of the pivot, taken out."""
    row = matrix.pop(pivot.row)
    own = {column: sizes.of(graph, pivot.row, column, node) for column, node in row.items()}
    values = {column: sizes.value(graph, pivot.row, column, node) for column, node in row.items()}
    divisor = values[pivot.column]
    least = (own[pivot.column] if math.isnan(divisor) else abs(divisor)) or 1.0
    for other, entries in matrix.items():
        if pivot.column not in entries:
            continue
        node = entries.pop(pivot.column)
        part = sizes.of(graph, other, pivot.column, node) / least
        share = sizes.value(graph, other, pivot.column, node) / (divisor or math.nan)
        factor = graph.div(node, row[pivot.column])
        for column, node in row.items():
            if column == pivot.column:
                continue
            size = part * own[column]
            value = -share * values[column]
            updated = graph.mul(factor, node)
            if column in entries:
                size += sizes.of(graph, other, column, entries[column])
                value += sizes.value(graph, other, column, entries[column])
                updated = graph.sub(entries[column], updated)
            else:
                updated = graph.neg(updated)
            left = sizes.number(graph, column, updated)
            if left is not None and left <= NOISE * size:
                entries.pop(column, None)
                continue
            entries[column], sizes.entries[other, column] = updated, size
            sizes.values[other, column] = value
        right[other] = graph.sub(right[other], graph.mul(factor, right[pivot.row]))
    return row


def _cheapest(graph: Graph, matrix: Matrix, sizes: Sizes, any_pivot: bool) -> Pivot | None:
    """Return the constant entry, or any, with the least fill (Markowitz), the first of equals.

    A number that is small beside its row is no pivot, such as the 6e-17 of cos(pi/2). Of entries
    that vary those that are small come last, and so does what cancels, such as r_1 - r_3 / 3 of
    radii 0.1 and 0.3.
    """
    in_column: dict[int, int] = {}
    for entries in matrix.values():
        for column in entries:
            in_column[column] = in_column.get(column, 0) + 1
    best: tuple[bool, int, int, int] | None = None
    for row, entries in matrix.items():
        wanted = [x for x in entries if any_pivot or graph.value_of(entries[x]) is not None]
        if not wanted:
            continue
        own = {column: sizes.of(graph, row, column, node) for column, node in entries.items()}
        least = SAFE_PIVOT * max(own.values())
        for column in wanted:
            value = sizes.value(graph, row, column, entries[column])
            is_safe = (own[column] if math.isnan(value) else abs(value)) >= least
            if not any_pivot and not is_safe:
                continue
            rank = (not is_safe, (len(entries) - 1) * (in_column[column] - 1), row, column)
            if best is None or rank < best:
                best = rank
    return None if best is None else Pivot(*best[2:])


def _solve_block(
    graph: Graph,
    block: Block,
    matrix: Matrix,
    right: dict[int, int],
    solution: dict[int, int],
    straight: int,
    sizes: Sizes,
) -> list[int]:
    """Add the solution of a block to what is known; return the node of its determinant."""
    sides = {
        row: _remainder(graph, matrix[row], block.columns, right[row], solution)
        for row in block.rows
    }
    solve = partial(_solved, graph, straight)
    if len(block.rows) > LARGEST_PIVOTED:
        known = replace(sizes, entries=dict(sizes.entries), values=dict(sizes.values))
        known.measure(graph, {row: matrix[row] for row in block.rows})
        own = {row: {k: matrix[row][k] for k in matrix[row] if k in block.columns} for row in sides}
        form = bordered(block, own, lambda row, column: known.values[row, column])
        if form is not None:
            found, determinant = solve_parts(graph, block, form, own, sides, solve)
            solution |= found
            return [determinant]
    zero = graph.const(0)
    a = [[matrix[row].get(column, zero) for column in block.columns] for row in block.rows]
    x, determinant = solve(a, list(sides.values()))
    solution |= zip(block.columns, x, strict=True)
    return [determinant]


def _solved(graph: Graph, straight: int, a: list[list[int]], b: list[int]) -> tuple[list[int], int]:
    """Return x of a x = b, and the determinant of a, by a call above `straight` equations."""
    size = len(a)
    if size > straight:
        entries = [node for row in a for node in row]
        x = [graph.linear("solve", size, k, (*entries, *b)) for k in range(size)]
        return x, graph.linear("determinant", size, 0, entries)
    if size > LARGEST_CLOSED_FORM:
        done = eliminated(graph, a, b, size)
        return done.solved(graph, ()), done.determinant
    adjugate, determinant = _adjugate(graph, a)
    inverse = graph.div(graph.const(1), determinant)
    x = []
    for cofactors in adjugate:
        total = graph.mul(cofactors[0], b[0])
        for cofactor, value in zip(cofactors[1:], b[1:], strict=True):
            total = graph.add(total, graph.mul(cofactor, value))
        x.append(graph.mul(total, inverse))
    return x, determinant


def _eliminate_block(
    graph: Graph,
    block: Block,
    matrix: Matrix,
    right: dict[int, int],
    solution: dict[int, int],
    sizes: Sizes,
) -> tuple[list[int], Look]:
    """Add the solution of a block to what is known.

    Return its pivots, whatever varies in them, and the look at the solution for a right side
    without a pattern: how far the same elimination may be trusted with others, and transposed.
    """
    own = set(block.columns)
    part = {row: {k: x for k, x in matrix[row].items() if k in own} for row in block.rows}
    sides = {row: _remainder(graph, matrix[row], own, right[row], solution) for row in block.rows}
    known = replace(sizes, entries=dict(sizes.entries), values=dict(sizes.values))
    whole, again = ({row: dict(entries) for row, entries in part.items()} for _ in range(2))
    pivots, eliminated = _eliminate(graph, part, sides, sizes, any_pivot=True)
    weights = known.weights()
    shown = {
        row: graph.const(part / weights.get(row, 1.0))
        for row, part in zip(block.rows, reversed(parts_of(len(block.rows))), strict=True)
    }
    given, probed = dict(shown), dict[int, int]()
    rows = {pivot.row: eliminate(graph, again, given, pivot, known) for pivot in pivots}
    determinants = [eliminated[pivot.row][pivot.column] for pivot in pivots]
    if part:  # structurally singular
        return determinants, Look((), (), graph.const(0))
    substitute(graph, pivots, eliminated, sides, solution)
    substitute(graph, pivots, rows, given, probed)
    return determinants, Look.at(graph, whole, shown, probed, weights)


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

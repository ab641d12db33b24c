"""Euler parameters in the linear solve: a small rotation and a stretch instead of dp.

Of a body with the row p^T p = 1 the unknown dp is written in another basis,

    dp = G(p)^T pi'/2 + p s,        G p = 0,

with the small rotation pi' in body-fixed directions. The body's own row then reads 2 p^T p s = b,
a pivot that is never small, and 6 instead of 7 coordinates a body are left (spatial_constraints of
Haug's chapter 9: decoupling of the norm rows). Newton's iterates stay the same. p itself is read
off the row, which is 2 p^T.

Of the body-fixed directions one is chosen: the axis of a hinge, or the line between two points that
are held. A turn about it moves nothing in some rows, so that larger blocks fall apart. It is found
in Phi_q itself, at states drawn at random: the directions about which rows do not change, and which
are the same in the body at all states. Its digits stand in emitted text, so they are computed by
sums, products and roots one by one, which every processor rounds alike.
"""

from __future__ import annotations

from collections import defaultdict
from functools import reduce
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import ZERO
from kincompile.ir.interpret import apply, evaluator

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.ir.graph import Graph
    from kincompile.ir.inline import InlineProgram

    Array = NDArray[np.float64]
    Matrix = dict[int, dict[int, int]]

STATES = 3
"""A direction that is the same at as many random states is the same at all."""
SEED = 1988
PARALLEL = 1e-3
"""Sine of the angle below which two directions give no third one."""


def sampled(code: InlineProgram) -> dict[str, Array]:
    """Return the entries of Phi_q at random states, parameters near their defaults, (K,) each."""
    program, random = code.program, np.random.default_rng(SEED)
    q = random.uniform(-1, 1, (STATES, len(program.coordinates)))
    defaults = np.array([item.default for item in program.parameters])
    spread = np.where(defaults == 0, 1.0, np.abs(defaults))[:, np.newaxis]
    p = defaults[:, np.newaxis] + random.uniform(0, 0.1, (len(defaults), STATES)) * spread
    with np.errstate(all="ignore"):
        (values,) = evaluator(code, ("Phi_q",))(q, random.uniform(0, 1, STATES), p)
    return {entry.name: x for entry, x in zip(code.entries("Phi_q"), values, strict=True)}


def small_rotations(
    code: InlineProgram, graph: Graph, matrix: Matrix, right: Mapping[int, int]
) -> list[SmallRotation]:
    """Replace the Euler parameters of all bodies of which elimination has not taken one.

    `graph`, `matrix` and `right` are as of `SmallRotation`.
    """
    own: dict[int, list[int]] = {
        instance.first_row: [] for instance in code.program.instances if instance.is_own
    }
    for entry in code.entries("Phi_q"):
        if entry.row in own:
            own[entry.row].append(entry.column)
    samples, first = Samples(graph, sampled(code)), len(code.program.coordinates)
    whole = [row for row, columns in own.items() if matrix.get(row, {}).keys() == set(columns)]
    return [
        SmallRotation(graph, samples, (row, own[row]), first + 4 * k, matrix, right)
        for k, row in enumerate(whole)
    ]


class Samples:
    """Values of a graph's nodes at the states, and the sizes of the terms they are made of.

    The graph has sums, products and quotients of inputs, and may grow. Inputs have values by name,
    (K,) each; others, the right sides, are not numbers.
    """

    def __init__(self, graph: Graph, values: Mapping[str, Array]) -> None:
        self._graph = graph
        unknown = np.full(STATES, np.nan)
        self._given = defaultdict(lambda: unknown, values)
        self._size_of = defaultdict(lambda: unknown, {k: np.abs(x) for k, x in values.items()})
        self._values: list[Array] = []
        self._sizes: list[Array] = []

    def value(self, node: int) -> Array:
        """Return the values of a node, shape (K,)."""
        self._extend(node)
        return np.broadcast_to(self._values[node], (STATES,))

    def is_zero(self, node: int) -> bool:
        """Return whether a number vanishes at all states."""
        self._extend(node)
        return bool(np.all(np.abs(self._values[node]) <= ZERO * self._sizes[node]))

    def _extend(self, node: int) -> None:
        for operation, *operands in self._graph.nodes[len(self._values) : node + 1]:
            self._values.append(apply(operation, operands, self._values, self._given, {}))
            if operation == "neg":
                self._sizes.append(self._sizes[operands[0]])
            else:
                added = "add" if operation == "sub" else operation
                self._sizes.append(apply(added, operands, self._sizes, self._size_of, {}))


class SmallRotation:
    """A body's small rotation in place of its Euler parameters.

    `own` are the body's own row and the columns of its Euler parameters p, `first` is the first of
    the four columns of s and pi', which follow those of Phi_q. Rows are nodes by column: the body's
    own is taken out of the matrix, the others get the columns of s and pi' instead of those of p.
    """

    def __init__(
        self,
        graph: Graph,
        samples: Samples,
        own: tuple[int, Sequence[int]],
        first: int,
        matrix: Matrix,
        right: Mapping[int, int],
    ) -> None:
        self._graph, (row_of_norm, self.columns) = graph, own
        self.is_finished = False  # whether dp is known
        norm = matrix.pop(row_of_norm)
        p = [norm[column] for column in self.columns]
        inverse = graph.div(graph.const(1), self._dot(p, p))
        # The stretch s by its column is known from the start.
        self.solution = {first: graph.mul(right[row_of_norm], inverse)}
        self.turns = range(first + 1, first + 4)  # the columns of pi'
        self._rows = {
            row: {column: entries[column] for column in self.columns if column in entries}
            for row, entries in matrix.items()
            if not entries.keys().isdisjoint(self.columns)
        }
        zero = graph.const(0)
        rows = {row: [own.get(k, zero) for k in self.columns] for row, own in self._rows.items()}
        e0, e1, e2, e3 = p
        minus = [graph.neg(node) for node in p]
        fixed = [  # G of Haug 9.3, times two
            [minus[1], e0, e3, minus[2]],
            [minus[2], minus[3], e0, e1],
            [minus[3], e2, minus[1], e0],
        ]
        is_own = [matrix[row].keys() <= set(self.columns) for row in rows]
        axes = _axes(samples, fixed, list(rows.values()), np.array(is_own))
        directions = [
            [self._dot([graph.const(x) for x in axis], [g[k] for g in fixed]) for k in range(4)]
            for axis in axes.tolist()
        ]
        # the basis has the determinant of its own row's pivot: those of the blocks make det Phi_q
        directions[-1] = [graph.mul(inverse, node) for node in directions[-1]]
        self._basis = dict(zip((first, *self.turns), (p, *directions), strict=True))
        for row, entries in rows.items():
            for column in self._rows[row]:
                del matrix[row][column]
            for column, direction in self._basis.items():
                found = self._dot(entries, direction)
                if graph.value_of(found) != 0 and not samples.is_zero(found):
                    matrix[row][column] = found

    @property
    def bases(self) -> dict[int, dict[int, int]]:
        """Nodes of which each Euler parameter is made, by column of s and pi'."""
        return {
            column: {own: vector[k] for own, vector in self._basis.items()}
            for k, column in enumerate(self.columns)
        }

    def finish(self, matrix: Matrix, solution: dict[int, int]) -> None:
        """Add dp to a solution that has pi'; other rows get the columns of p back."""
        for k, column in enumerate(self.columns):
            terms = [vector[k] for vector in self._basis.values()]
            solution[column] = self._dot(terms, [solution[item] for item in self._basis])
        self.is_finished = True
        for row, entries in self._rows.items():
            for column in self._basis:
                matrix[row].pop(column, None)
            matrix[row] |= entries

    def _dot(self, a: Sequence[int], b: Sequence[int]) -> int:
        graph = self._graph
        total = graph.const(0)
        for x, y in zip(a, b, strict=True):
            total = graph.add(total, graph.mul(x, y))
        return total


def _axes(
    samples: Samples, fixed: list[list[int]], rows: list[list[int]], is_own: NDArray[np.bool_]
) -> Array:
    """Return three body-fixed directions, (3, 3), the last one that of the most useful turn.

    Two rows allow the turn about the cross product of their derivatives by pi'. If that is the same
    at all states, it is fixed in the body. It is the better the more rows allow the turn; rows of
    this body alone count first, since they make a block of their own.
    """
    g = np.array([[samples.value(node) for node in row] for row in fixed])
    entries = np.array([[samples.value(node) for node in row] for row in rows])
    products = entries.reshape(-1, 1, 4, STATES) * g
    derivatives = np.moveaxis(_total(np.moveaxis(products, 2, 0)), 2, 0)  # state, row, direction
    sizes = _lengths(derivatives)
    if not np.isfinite(derivatives).all() or (sizes == 0).any():
        return np.eye(3)
    derivatives = derivatives / sizes
    best, most = None, (0, 1)
    for first, second in combinations(range(len(rows)), 2):
        h = np.cross(derivatives[:, first], derivatives[:, second])
        length = _lengths(h)
        if (length < PARALLEL).any():
            continue
        h = h / length
        h = h * np.sign(h[:, np.argmax(np.abs(h[0]))])[:, np.newaxis]
        if np.ptp(h, axis=0).max() > ZERO:
            continue
        allow = (np.abs(derivatives @ h[0]) < ZERO).all(axis=0)
        count = int((allow & is_own).sum()), int(allow.sum())
        if count > most:
            best, most = h[0], count
    return np.eye(3) if best is None else _beside(best)


def _beside(h: Array) -> Array:
    """Return two directions at right angles to a third, and that."""
    h = np.where(np.abs(h) < ZERO, 0.0, h)
    h = h / _lengths(h)
    near = np.eye(3)[np.argmin(np.abs(h))]
    g = np.cross(h, near)
    g = g / _lengths(g)
    return np.array([np.cross(g, h), g, h])


def _lengths(vectors: Array) -> Array:
    """Return the lengths of vectors, (..., 3), as (..., 1)."""
    return np.sqrt(_total(np.moveaxis(vectors * vectors, -1, 0)))[..., np.newaxis]


def _total(terms: Array) -> Array:
    """Return the sum over the first axis, term by term."""
    return np.asarray(reduce(np.add, terms))

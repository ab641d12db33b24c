"""Which parameter sets a sweep solves, and how they are cut into chunks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.runtime.engine.code import Array

NUMBERS = 4_000_000
"""Numbers of q, q_dot and q_ddot that a chunk has where its size is not given: 32 MB."""

MOST = 2000
"""Variants of a chunk where its size is not given."""

VARIANT = "variant"
"""The dimension of parameter sets that are not a grid."""


@dataclass(frozen=True)
class Grid:
    """The dimensions of a sweep, cut into chunks; it knows no values."""

    sizes: dict[str, int]  # how long each dimension is, by name; without time
    most: int  # largest number of variants in a chunk

    @cached_property
    def block(self) -> tuple[int, ...]:
        """How long a chunk is along each dimension: consecutive variants, the last one fastest."""
        left, found = self.most, list[int]()
        for size in reversed(self.sizes.values()):
            found.append(max(1, min(size, left)))
            left = left // size
        return tuple(reversed(found))

    @cached_property
    def chunks(self) -> tuple[int, ...]:
        """How many chunks there are along each dimension."""
        pairs = zip(self.sizes.values(), self.block, strict=True)
        return tuple(-(-size // length) for size, length in pairs)

    @property
    def variants(self) -> int:
        """How many variants there are."""
        return math.prod(self.sizes.values())

    def __len__(self) -> int:
        """Return the number of chunks."""
        return math.prod(self.chunks)

    def place(self, number: int) -> tuple[int, ...]:
        """Return where a chunk stands among the chunks along each dimension."""
        return tuple(map(int, np.unravel_index(number, self.chunks)))

    def region(self, number: int) -> tuple[slice, ...]:
        """Return which variants a chunk has along each dimension."""
        parts = zip(self.place(number), self.block, self.sizes.values(), strict=True)
        return tuple(slice(k * n, min((k + 1) * n, size)) for k, n, size in parts)

    def first(self, number: int) -> int:
        """Return how many variants come before a chunk."""
        starts = [part.start for part in self.region(number)]
        return int(np.ravel_multi_index(starts, tuple(self.sizes.values())))

    def shape(self, number: int) -> tuple[int, ...]:
        """Return how long a chunk is along each dimension; the last ones are shorter."""
        return tuple(part.stop - part.start for part in self.region(number))

    def count(self, number: int) -> int:
        """Return how many variants a chunk has."""
        return math.prod(self.shape(number))


@dataclass(frozen=True, eq=False)
class Plan:
    """The variants of a sweep, in chunks."""

    parameters: tuple[str, ...]  # names of the k parameters of the module
    common: Array  # (k,): values of those that are not swept
    sweep: Mapping[str, Array]  # arrays of values, by the names of the parameters that are swept
    # Whether every value of one goes with every value of the others; else they go in pairs.
    is_product: bool
    most: int  # largest number of variants in a chunk

    @cached_property
    def grid(self) -> Grid:
        """The dimensions of the results, and its chunks."""
        sizes = {name: values.size for name, values in self.sweep.items()}
        if not self.is_product and len(sizes) > 1:
            sizes = {VARIANT: next(iter(sizes.values()))}
        return Grid(sizes, self.most)

    def axes(self) -> dict[str, tuple[str, Array]]:
        """Return of each swept parameter its dimension and its values along that."""
        sizes = self.grid.sizes
        first = next(iter(sizes))
        return {
            name: (name if name in sizes else first, values) for name, values in self.sweep.items()
        }

    def swept(self, number: int) -> Sequence[Array]:
        """Return the values of the swept parameters in the variants of a chunk, (B,) each."""
        region, dimensions = self.grid.region(number), tuple(self.grid.sizes)
        parts = [values[region[dimensions.index(name)]] for name, values in self.axes().values()]
        grid = np.meshgrid(*parts, indexing="ij") if len(dimensions) > 1 else parts
        return [values.ravel() for values in grid]

    def sets(self, number: int) -> Array:
        """Return the parameters of the variants of a chunk, shape (B, k)."""
        values = self.swept(number)
        found = np.tile(self.common, (values[0].size, 1))
        for name, column in zip(self.sweep, values, strict=True):
            found[:, self.parameters.index(name)] = column
        return found


def chunk_size(coordinates: int, times: int) -> int:
    """Return the default number of variants in a chunk, by which memory is bounded."""
    return max(1, min(MOST, NUMBERS // (3 * max(coordinates, 1) * times)))

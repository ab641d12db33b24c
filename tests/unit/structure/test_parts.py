"""The parts of Dulmage and Mendelsohn, against their definition by ranks."""

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from kincompile.structure.parts import parts_of

Pattern = set[tuple[int, int]]


@st.composite
def patterns(draw: Any, size: int = 6) -> tuple[Pattern, int, int]:
    m, n = draw(st.integers(1, size)), draw(st.integers(1, size))
    places = st.tuples(st.integers(0, m - 1), st.integers(0, n - 1))
    return draw(st.sets(places, max_size=2 * size)), m, n


def generic(pattern: Pattern, m: int, n: int) -> Any:
    """Return a matrix of independent numbers in these places: it has the structural rank."""
    numbers = np.random.default_rng(7).uniform(1, 2, (m, n))
    matrix = np.zeros((m, n))
    for place in pattern:
        matrix[place] = numbers[place]
    return matrix


@given(patterns())
@settings(max_examples=150)
def test_that_a_part_is_what_can_be_left_out_without_a_loss(case: tuple[Pattern, int, int]) -> None:
    """A row of the part with too many equations can be left out: the rank stays what it is."""
    pattern, m, n = case
    matrix = generic(pattern, m, n)
    rank = np.linalg.matrix_rank(matrix)
    parts = parts_of(sorted(pattern), (m, n))
    spare_rows = {
        row for row in range(m) if np.linalg.matrix_rank(np.delete(matrix, row, 0)) == rank
    }
    spare_columns = {
        column for column in range(n) if np.linalg.matrix_rank(np.delete(matrix, column, 1)) == rank
    }
    assert set(parts.too_many_rows) == spare_rows
    assert set(parts.too_few_columns) == spare_columns


@given(patterns())
@settings(max_examples=100)
def test_that_the_parts_are_a_partition(case: tuple[Pattern, int, int]) -> None:
    pattern, m, n = case
    parts = parts_of(sorted(pattern), (m, n))
    rows = [row for block in parts.blocks for row in block.rows]
    columns = [column for block in parts.blocks for column in block.columns]
    assert sorted([*parts.too_many_rows, *rows, *parts.too_few_rows]) == list(range(m))
    assert sorted([*parts.too_many_columns, *columns, *parts.too_few_columns]) == list(range(n))
    assert len(rows) == len(columns)


def test_the_parts_of_a_pattern_drawn_by_hand() -> None:
    """Two equations for one coordinate, one for one, one for two."""
    pattern = [(0, 0), (1, 0), (2, 0), (2, 1), (3, 1), (3, 2), (3, 3)]
    parts = parts_of(pattern, (4, 4))
    assert (parts.too_many_rows, parts.too_many_columns) == ((0, 1), (0,))
    assert [(block.rows, block.columns) for block in parts.blocks] == [((2,), (1,))]
    assert (parts.too_few_rows, parts.too_few_columns) == ((3,), (2, 3))

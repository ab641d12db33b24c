"""Matching and block triangular form, on random patterns."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kincompile.structure.blocks import Block, block_triangular, matching

Pattern = set[tuple[int, int]]


@st.composite
def patterns(draw: Any, size: int = 7) -> tuple[Pattern, int, int]:
    m, n = draw(st.integers(1, size)), draw(st.integers(1, size))
    places = st.tuples(st.integers(0, m - 1), st.integers(0, n - 1))
    return draw(st.sets(places, max_size=3 * size)), m, n


def rank(pattern: Pattern, m: int, n: int) -> int:
    """Return the structural rank: that of a matrix of independent numbers in these places."""
    matrix = np.zeros((m, n))
    numbers = np.random.default_rng(5).uniform(1, 2, (m, n))
    for place in pattern:
        matrix[place] = numbers[place]
    return int(np.linalg.matrix_rank(matrix))


@given(patterns())
@settings(max_examples=100)
def test_that_a_matching_is_one_to_one_within_the_pattern_and_largest(
    given_pattern: tuple[Pattern, int, int],
) -> None:
    pattern, m, n = given_pattern
    matched = matching(sorted(pattern), (m, n)).tolist()
    pairs = [(row, column) for row, column in enumerate(matched) if column >= 0]
    assert len(matched) == m
    assert set(pairs) <= pattern
    assert len({column for _, column in pairs}) == len(pairs)
    assert len(pairs) == rank(pattern, m, n)


@st.composite
def square_patterns(draw: Any) -> tuple[Pattern, int]:
    n = draw(st.integers(1, 7))
    places = st.tuples(st.integers(0, n - 1), st.integers(0, n - 1))
    pattern = draw(st.sets(places, max_size=2 * n))
    return pattern | set(enumerate(draw(st.permutations(range(n))))), n


@given(square_patterns())
@settings(max_examples=100)
def test_that_each_block_needs_earlier_blocks_only(given_pattern: tuple[Pattern, int]) -> None:
    pattern, n = given_pattern
    blocks = block_triangular(range(n), range(n), sorted(pattern))
    assert blocks is not None
    assert sorted(row for block in blocks for row in block.rows) == list(range(n))
    assert sorted(column for block in blocks for column in block.columns) == list(range(n))
    solved: set[int] = set()
    for block in blocks:
        assert len(block.rows) == len(block.columns)
        solved |= set(block.columns)
        assert {column for row, column in pattern if row in block.rows} <= solved


@given(square_patterns())
@settings(max_examples=50)
def test_that_no_block_could_be_split(given_pattern: tuple[Pattern, int]) -> None:
    """Within a block every equation leads to every other, through the coordinates it needs."""
    pattern, n = given_pattern
    owner = {column: row for row, column in enumerate(matching(sorted(pattern), (n, n)).tolist())}
    reach = np.eye(n, dtype=bool)
    for row, column in pattern:
        reach[row, owner[column]] = True
    for _ in range(n):
        reach = reach @ reach
    for block in block_triangular(range(n), range(n), sorted(pattern)) or ():
        assert reach[np.ix_(block.rows, block.rows)].all()


def test_that_a_triangle_falls_into_single_equations() -> None:
    blocks = block_triangular([0, 1, 2], [0, 1, 2], [(0, 0), (1, 0), (1, 1), (2, 1), (2, 2)])
    assert blocks == (Block((0,), (0,)), Block((1,), (1,)), Block((2,), (2,)))


def test_that_rows_and_columns_keep_their_own_numbers() -> None:
    blocks = block_triangular([4, 9], [2, 7], [(4, 2), (4, 7), (9, 2), (9, 7)])
    assert blocks == (Block((4, 9), (2, 7)),)


@pytest.mark.parametrize("pattern", [[], [(0, 0), (1, 0)], [(0, 0), (0, 1)]])
def test_that_a_singular_pattern_has_no_blocks(pattern: list[tuple[int, int]]) -> None:
    assert block_triangular([0, 1], [0, 1], pattern) is None


def test_that_nothing_falls_into_nothing() -> None:
    assert block_triangular([], [], []) == ()

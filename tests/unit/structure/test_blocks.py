"""Matching, the parts of Dulmage and Mendelsohn, block triangular form, on random patterns."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kincompile.structure import blocks
from kincompile.structure.blocks import Block, block_triangular, matching, parts_of

Pattern = set[tuple[int, int]]


@st.composite
def patterns(draw: Any, size: int = 7) -> tuple[Pattern, int, int]:
    m, n = draw(st.integers(1, size)), draw(st.integers(1, size))
    places = st.tuples(st.integers(0, m - 1), st.integers(0, n - 1))
    return draw(st.sets(places, max_size=3 * size)), m, n


@pytest.fixture(params=[300, 0], ids=["plain", "scipy"], autouse=True)
def algorithms(request: pytest.FixtureRequest) -> Any:
    """Run every test with the plain algorithms of small systems, and with SciPy's of large ones."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blocks, "SMALL", request.param)
        yield


def generic(pattern: Pattern, m: int, n: int) -> Any:
    """Return a matrix of independent numbers in these places: it has the structural rank."""
    numbers = np.random.default_rng(7).uniform(1, 2, (m, n))
    matrix = np.zeros((m, n))
    for place in pattern:
        matrix[place] = numbers[place]
    return matrix


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
    assert len(pairs) == np.linalg.matrix_rank(generic(pattern, m, n))


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
    found = block_triangular(range(n), range(n), sorted(pattern))
    assert found is not None
    assert sorted(row for block in found for row in block.rows) == list(range(n))
    assert sorted(column for block in found for column in block.columns) == list(range(n))
    solved: set[int] = set()
    for block in found:
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
    found = block_triangular([0, 1, 2], [0, 1, 2], [(0, 0), (1, 0), (1, 1), (2, 1), (2, 2)])
    assert found == (Block((0,), (0,)), Block((1,), (1,)), Block((2,), (2,)))


def test_that_rows_and_columns_keep_their_own_numbers() -> None:
    found = block_triangular([4, 9], [2, 7], [(4, 2), (4, 7), (9, 2), (9, 7)])
    assert found == (Block((4, 9), (2, 7)),)


@pytest.mark.parametrize("pattern", [[], [(0, 0), (1, 0)], [(0, 0), (0, 1)]])
def test_that_a_singular_pattern_has_no_blocks(pattern: list[tuple[int, int]]) -> None:
    assert block_triangular([0, 1], [0, 1], pattern) is None


def test_that_nothing_falls_into_nothing() -> None:
    assert block_triangular([], [], []) == ()


@given(patterns())
@settings(max_examples=100)
def test_that_a_part_is_what_can_be_left_out_without_a_loss(case: tuple[Pattern, int, int]) -> None:
    """A row of the part with too many equations can be left out: the rank stays what it is."""
    pattern, m, n = case
    matrix = generic(pattern, m, n)
    rank = np.linalg.matrix_rank(matrix)
    parts = parts_of(sorted(pattern), (m, n))
    kept_rows, kept_columns = (~np.eye(size, dtype=bool) for size in (m, n))
    spare_rows = {
        row for row in range(m) if np.linalg.matrix_rank(matrix * kept_rows[row][:, None]) == rank
    }
    spare_columns = {
        column
        for column in range(n)
        if np.linalg.matrix_rank(matrix * kept_columns[column]) == rank
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

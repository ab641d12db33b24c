"""Lines of readable length: nothing lost, nothing too long that could be broken."""

import ast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kincompile.emitters.lines import broken, labelled, quoted, table, wrapped

words = st.lists(st.text("abcxyz", min_size=1, max_size=12), min_size=1, max_size=30)


@given(words, st.integers(15, 40))
def test_that_wrapped_items_are_all_there_and_fit(items: list[str], width: int) -> None:
    lines = wrapped(items, width)
    assert " ".join(lines).split() == [f"{item}," for item in items]
    assert all(len(line) <= width for line in lines)


def test_that_wrapped_lines_are_filled() -> None:
    assert wrapped(["aaa", "bbb", "ccc"], 9) == ["aaa, bbb,", "ccc,"]
    assert wrapped([]) == []


def test_that_names_are_quoted() -> None:
    assert quoted(["x", "y"]) == ['"x", "y",']


def test_that_a_label_stands_before_the_first_line() -> None:
    lines = labelled("q", [f"coordinate_{k}" for k in range(12)])
    assert lines[0].startswith("q     coordinate_0, ")
    assert len(lines) == 2
    assert lines[1].startswith("      coordinate_")
    assert not lines[-1].endswith(",")


def test_that_columns_of_a_table_are_aligned() -> None:
    assert table([("a", "bb", "c"), ("aaa", "b", "")]) == ["a    bb  c", "aaa  b"]


sums = st.recursive(
    st.sampled_from(["x", "y_long_name", "cos(x)", "x**2", "1e-05", "2.5e+30"]),
    lambda inner: st.one_of(
        st.builds("{} + {}".format, inner, inner),
        st.builds("({} - {})".format, inner, inner),
        st.builds("f({}, -y)".format, inner),
        st.builds("({}) * {}".format, inner, st.just("x")),
    ),
    max_leaves=25,
)


@given(sums, st.integers(30, 60))
def test_that_a_broken_expression_is_the_same_expression(text: str, width: int) -> None:
    lines = broken(text, width)
    joined = "(" + "\n".join(lines) + ")"
    assert ast.dump(ast.parse(joined)) == ast.dump(ast.parse(f"({text})"))
    assert all(line.strip() for line in lines)


@pytest.mark.parametrize("width", [40, 60])
def test_that_a_long_sum_fits(width: int) -> None:
    text = " + ".join(f"term_{k}" for k in range(40))
    assert all(len(line) <= width for line in broken(text, width))


def test_that_a_short_expression_stays_whole() -> None:
    assert broken("a + b", 20) == ["a + b"]

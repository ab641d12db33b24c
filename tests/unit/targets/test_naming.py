"""Names in emitted code: none twice, none reserved, each an identifier."""

import keyword

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kincompile.emitters.naming import NameTable
from kincompile.emitters.schedule import content_name

names = st.sampled_from(["x", "x_", "x_2", "x_3", "lambda", "lambda_", "is", "q", "np", "a_b"])


@given(st.lists(names, max_size=20))
def test_that_no_name_is_given_twice(wanted: list[str]) -> None:
    table = NameTable(["q", "np"])
    given_names = [table.take(name) for name in wanted]
    assert len(set(given_names)) == len(given_names)
    assert not {"q", "np"} & set(given_names)
    assert all(name.isidentifier() and not keyword.iskeyword(name) for name in given_names)


def test_that_the_first_gets_the_name_it_wants() -> None:
    table = NameTable(["q"])
    assert [table.take("x"), table.take("x"), table.take("x")] == ["x", "x_", "x_2"]
    assert [table.take("q"), table.take("lambda")] == ["q_", "lambda_"]


def test_that_a_copy_goes_its_own_way() -> None:
    table = NameTable([])
    table.take("x")
    assert table.copy().take("x") == "x_"
    assert table.take("x") == "x_"


NAMED = {1: "a", 2: "c_crank", 4: "a_very_long_name_of_a_value"}
NODES = [("pi",), ("input", "a"), ("input", "c"), ("const", 2), ("input", "long"), ("const", 0.5)]


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        (("div", 1, 3), "a_2"),
        (("square", 1), "a_sq"),
        (("call", "sin", 1), "sin_a"),
        (("mul", 1, 2), "a_c_crank"),
        (("mul", 4, 2), None),  # too long to read
        (("div", 1, 5), None),  # a_0.5 is no identifier
        (("add", 1, 2), None),
        (("square", 9), None),
    ],
)
def test_that_a_small_node_is_named_by_what_it_is(
    node: tuple[object, ...], expected: str | None
) -> None:
    assert content_name([*NODES, node], len(NODES), NAMED) == expected

"""A zero between two places: with slopes and without, from either end, in few looks."""

import math
from collections.abc import Callable
from contextlib import suppress

import pytest

from kincompile.runtime.singular.curve import root, zero

WIDTH = 1e-13

FUNCTIONS: dict[str, Callable[[float], float]] = {
    "line": lambda x: x - 0.3,
    "ninefold": lambda x: (x - 0.3) ** 9,
    "step": lambda x: math.atan(1e6 * (x - 0.3)),
    "jump": lambda x: -1.0 if x < 0.3 else 1.0,
    "steep end": lambda x: math.exp(50 * (x - 0.3)) - 1,
    "upright": lambda x: math.copysign(abs(x - 0.3) ** 0.1, x - 0.3),
    "tiny": lambda x: 1e-300 * (x - 0.3),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_that_a_zero_is_found_from_either_end(name: str) -> None:
    for low, high in ((0.0, 1.0), (1.0, 0.0)):
        found = root(FUNCTIONS[name], low, high, WIDTH)
        assert found == pytest.approx(0.3, abs=1e-9 if name == "ninefold" else 2 * WIDTH)


def test_that_slopes_save_looks() -> None:
    search = zero(0.0, 3.0, WIDTH)
    places = [next(search)]
    with suppress(StopIteration):
        while True:
            places.append(search.send((2 - places[-1] ** 2, -2 * places[-1])))
    assert places[-1] == pytest.approx(math.sqrt(2), abs=WIDTH)
    assert len(places) <= 6


def test_that_a_bracket_closes_around_what_a_secant_has_found() -> None:
    """No secant would: it comes from one side, and knows no second place beside the zero."""
    looks = 0

    def line(x: float) -> float:
        nonlocal looks
        looks += 1
        return 5e4 * (x - 2.0885499895e-05)

    assert root(line, 0.0, 1.0, WIDTH) == pytest.approx(2.0885499895e-05, abs=WIDTH)
    assert looks <= 6


def test_that_a_search_ends_where_there_is_no_value() -> None:
    assert root(lambda x: math.nan if abs(x - 0.3) < 0.01 else x - 0.3, 0.0, 1.0, WIDTH) == (
        pytest.approx(0.3, abs=0.01)
    )
    assert root(lambda x: x, 0.0, 1.0, WIDTH) == 0.0
    assert root(lambda x: x or math.nan, 0.0, 1.0, WIDTH) == 0.0

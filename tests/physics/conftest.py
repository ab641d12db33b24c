"""How the physics tests compare: with the figures of the reference cases, to the digits printed."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

ZEROS_DROPPED = re.compile(r"[-+]?\d+(\.\d+)?")


def assert_printed(text: str, actual: Any) -> None:
    """Compare numbers with printed figures, each to half a unit of its last digit.

    The figures of a list are rounded to the same number of decimals, trailing zeros dropped: 0.25
    beside 5.1895651858 means 0.2500000000. One with an exponent has its own last digit. A point
    alone stands for a figure that is not printed.
    """
    figures = [figure.strip() for figure in text.split(",")]
    decimals = max(_decimals(figure) for figure in figures)
    numbers = np.ravel(actual).tolist()
    assert len(numbers) == len(figures), f"{len(numbers)} numbers for {len(figures)} figures"
    wrong = [
        f"{number!r} is not {figure}"
        for figure, number in zip(figures, numbers, strict=True)
        if figure != "." and not abs(number - float(figure)) <= _tolerance(figure, decimals)
    ]
    assert not wrong, "; ".join(wrong)


def _decimals(figure: str) -> int:
    if not ZEROS_DROPPED.fullmatch(figure):
        return 0
    return len(figure.partition(".")[2])


def _tolerance(figure: str, decimals: int) -> float:
    """Return half a unit of the last digit, and a hair for the figure's own binary rounding."""
    mantissa, _, exponent = figure.partition("e")
    digit = int(exponent) - len(mantissa.partition(".")[2]) if exponent else -decimals
    return 0.5000001 * 10.0**digit


@pytest.fixture
def printed() -> Callable[[str, Any], None]:
    """Return the comparison of printed figures with numbers."""
    return assert_printed

"""Figures without a screen, closed after each test."""

from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True)
def figures() -> Iterator[None]:
    """Draw into memory where matplotlib is installed, and leave no figure behind."""
    try:
        from matplotlib import pyplot as plt
    except ImportError:
        yield
        return
    plt.switch_backend("agg")
    yield
    plt.close("all")

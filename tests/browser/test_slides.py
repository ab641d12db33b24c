"""Slides turned by keys, contents beside a long derivation, and entries with names, in Chromium."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import kincompile as kc

pytestmark = [pytest.mark.browser, pytest.mark.slow]

TOPS = """() => [document.querySelector('header'), ...document.querySelectorAll('main > section')]
  .map(slide => Math.round(slide.getBoundingClientRect().top))"""


@pytest.fixture(scope="module")
def derivation(example_named: Any) -> Any:
    return kc.derivation(example_named("four_bar").model)


def test_that_keys_turn_slides_that_have_numbers(
    open_file: Callable[..., Any], derivation: Any, tmp_path: Path
) -> None:
    page = open_file(derivation.write(tmp_path / "four_bar.slides.html"))
    count = len(page.evaluate(TOPS))
    for key, expected in (
        ("ArrowRight", 1), ("ArrowRight", 2), ("PageUp", 1), (" ", 2), ("ArrowLeft", 1),
        ("Home", 0), ("ArrowLeft", 0), ("End", count - 1), ("ArrowRight", count - 1),
    ):  # fmt: skip
        page.keyboard.press(key)
        page.wait_for_timeout(60)
        tops = page.evaluate(TOPS)
        nearest = min(range(count), key=lambda k: abs(tops[k]))
        assert nearest == expected, key
    numbers = page.evaluate(
        "[...document.querySelectorAll('[data-number]')].map(x => x.dataset.number)"
    )
    assert numbers == [f"{k + 1} / {count}" for k in range(count)]
    assert page.evaluate("document.querySelector('header').offsetHeight >= innerHeight")
    assert page.said == []
    page.close()


def test_that_contents_stay_beside_a_long_derivation(
    open_file: Callable[..., Any], derivation: Any, tmp_path: Path
) -> None:
    page = open_file(derivation.write(tmp_path / "four_bar.html"), 1440)
    page.evaluate("scrollTo(0, 5000)")
    box, main = (page.locator(name).bounding_box() for name in ("nav", "main"))
    assert box["x"] + box["width"] <= main["x"] + 1
    assert 0 <= box["y"] < 900
    names = page.locator("svg.pattern a").evaluate_all("list => list.map(link => link.ariaLabel)")
    assert len(names) > 20
    assert all(" by " in name for name in names)
    scrolled = page.evaluate("[...document.querySelectorAll('.wide')].map(x => x.tabIndex)")
    assert set(scrolled) == {0}
    page.close()

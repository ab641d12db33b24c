"""Derivation pages in headless Chromium: no overflow, no missing glyph, no network, no message."""

import itertools
from collections.abc import Callable
from typing import Any

import pytest

import kincompile as kc

WIDTHS = (1280, 390)
EXAMPLES = ("wrecker_boom", "cam_flat_follower", "problem_3_5_6")
OTHERS = ("wrecker_boom.slides", "inverted_slider_crank.exercise")

pytestmark = [
    pytest.mark.browser,
    pytest.mark.slow,
]

# Whatever can be scrolled by itself may be wider than the page.
TOO_WIDE = """() => {
  const scrolled = element => element.closest('.wide, .src') !== null;
  return [...document.querySelectorAll('body *')]
    .filter(element => !scrolled(element))
    .filter(element => element.getBoundingClientRect().right > innerWidth + 1)
    .map(element => element.outerHTML.slice(0, 120));
}"""

EMPTY_MATH = """() => [...document.querySelectorAll('main math')]
  .filter(math => math.closest('details:not([open])') === null)
  .filter(math => math.getBoundingClientRect().width * math.getBoundingClientRect().height === 0)
  .map(math => math.outerHTML.slice(0, 120))"""

SIDES = """tags => [...document.querySelectorAll(`main :is(${tags})`)]
  .map(element => element.getBoundingClientRect())
  .map(box => [box.left, box.right, box.top, box.bottom])"""

# Is the numerator of every fraction above its denominator? Only where MathML is laid out.
FLAT_FRACTIONS = """() => [...document.querySelectorAll('main mfrac')]
  .filter(fraction => fraction.closest('details:not([open])') === null)
  .filter(fraction => {
    const [above, below] = [...fraction.children].map(x => x.getBoundingClientRect());
    return above.bottom > below.top + 1;
  }).length"""

# A character without a glyph is drawn as the box that stands for one that no font has.
MISSING_GLYPHS = """extra => {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 48;
  const context = canvas.getContext('2d', { willReadFrequently: true });
  const drawn = (character, font) => {
    context.clearRect(0, 0, 48, 48);
    context.font = `24px ${font}`;
    context.fillText(character, 8, 32);
    return context.getImageData(0, 0, 48, 48).data.join();
  };
  const texts = new Map();  // by font, so that each character is drawn once
  for (const element of document.querySelectorAll('body, main mi, main mo, main mn, code')) {
    const font = getComputedStyle(element).fontFamily;
    const text = element === document.body ? element.innerText + extra : element.textContent;
    texts.set(font, (texts.get(font) ?? '') + text);
  }
  const missing = new Set();
  for (const [font, text] of texts) {
    const box = drawn('\\u{10FFFD}', font);
    for (const character of new Set(text)) {
      const isInvisible = /\\s|\\p{Default_Ignorable_Code_Point}/u.test(character);
      if (!isInvisible && drawn(character, font) === box) missing.add(character);
    }
  }
  return [...missing];
}"""


@pytest.fixture(scope="module")
def open_page(
    open_file: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory, example_named: Any
) -> Callable[..., Any]:
    """Return a function that opens the page of an example."""
    folder = tmp_path_factory.mktemp("pages")

    def opened(name: str, width: int = 1280, scheme: str = "light") -> Any:
        path = folder / f"{name}.html"
        model = example_named(name.split(".")[0]).model
        if name.endswith("exercise"):
            path = folder / name / "students" / "01" / "exercise.html"
        if not path.exists() and name.endswith("exercise"):
            kc.exercise(model, 1, 3, signs=True).write(folder / name)
        elif not path.exists():
            kc.derivation(model, 0.5).write(path)
        return open_file(path, width, scheme)

    return opened


@pytest.fixture(params=EXAMPLES)
def name(request: pytest.FixtureRequest) -> str:
    """Each of a few examples."""
    return str(request.param)


@pytest.mark.parametrize("width", WIDTHS)
def test_that_nothing_is_wider_than_the_page(open_page: Any, name: str, width: int) -> None:
    page = open_page(name, width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(TOO_WIDE) == []
    page.close()


@pytest.mark.parametrize("width", [1920, *WIDTHS])
def test_that_figures_are_in_the_margin_where_there_is_room(open_page: Any, width: int) -> None:
    page = open_page("wrecker_boom", width)
    page.evaluate("document.querySelectorAll('details').forEach(item => { item.open = true; })")
    figures, texts = (page.evaluate(SIDES, tags) for tags in ("figure", "p, h2, h3, h4, .eq"))
    assert len(figures) > 5
    end = max(right for _, right, *_ in texts)
    assert {left >= end for left, *_ in figures} == {width == 1920}
    assert max(right for _, right, *_ in figures) <= width
    below = sorted(figures, key=lambda item: item[2])
    assert all(one[3] <= other[2] for one, other in itertools.pairwise(below))
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.close()


def test_that_no_formula_is_wider_than_its_column(open_page: Any, name: str) -> None:
    """The written out gamma of a cam had 13,500 pixels in one line."""
    page = open_page(name)
    page.evaluate("document.querySelectorAll('details').forEach(item => { item.open = true; })")
    formulas = page.locator(".eq.wide")
    assert formulas.count() > 20
    assert (
        formulas.evaluate_all("all => all.filter(e => e.scrollWidth > e.clientWidth + 1).length")
        == 0
    )
    page.close()


def test_that_the_page_says_nothing_and_asks_for_nothing(open_page: Any, name: str) -> None:
    page = open_page(name)
    page.wait_for_load_state("networkidle")
    assert page.said == []
    assert [url for url in page.asked if not url.startswith("data:")] == [page.url]
    page.close()


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("other", OTHERS)
def test_that_slides_and_exercises_are_readable(open_page: Any, other: str, width: int) -> None:
    page = open_page(other, width)
    page.evaluate("document.querySelectorAll('details').forEach(item => { item.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(TOO_WIDE) == []
    assert page.evaluate(EMPTY_MATH) == []
    assert page.evaluate(MISSING_GLYPHS, "") == []
    assert page.said == []
    assert [url for url in page.asked if not url.startswith("data:")] == [page.url]
    page.close()


def test_that_formulas_have_the_font_of_the_page(open_page: Any) -> None:
    page = open_page("wrecker_boom")
    page.evaluate("async () => { await document.fonts.ready; }")
    assert page.evaluate("[...document.fonts].map(font => font.status)") == ["loaded"]
    page.close()


@pytest.mark.parametrize("width", WIDTHS)
def test_that_brackets_are_as_tall_as_their_matrix(open_page: Any, width: int) -> None:
    page = open_page("wrecker_boom", width)
    parts = page.evaluate("""() => [...document.querySelectorAll('main mtable')]
      .filter(table => table.closest('details:not([open])') === null)
      .map(table => [table, table.previousElementSibling, table.nextElementSibling]
        .map(part => part.getBoundingClientRect().height))""")
    assert len(parts) > 50
    for matrix, left, right in parts:
        assert left == right
        assert left > 0.85 * matrix
    page.close()


@pytest.mark.parametrize("width", WIDTHS)
def test_that_mathml_is_laid_out(open_page: Any, name: str, width: int) -> None:
    page = open_page(name, width)
    assert page.evaluate("document.querySelectorAll('main math').length") > 100
    assert page.evaluate("document.querySelectorAll('merror').length") == 0
    assert page.evaluate(EMPTY_MATH) == []
    assert page.evaluate(FLAT_FRACTIONS) == 0
    page.close()


def test_that_every_character_has_a_glyph(open_page: Any, name: str) -> None:
    page = open_page(name)
    assert page.evaluate(MISSING_GLYPHS, "") == []
    assert page.evaluate(MISSING_GLYPHS, "\U0010fffc") == ["\U0010fffc"]  # it would be found
    page.close()


def test_that_a_cell_of_the_jacobian_leads_to_its_line(open_page: Any) -> None:
    page = open_page("wrecker_boom")
    cell = page.locator("#jacobian td a").first
    target = cell.get_attribute("href")
    cell.click()
    line = page.locator(target.replace("#", "[id='") + "']")
    assert line.evaluate("element => element.getBoundingClientRect().top") < 900
    assert "src" in line.evaluate("element => element.nextElementSibling.className")
    page.close()


def test_that_the_page_is_dark_where_that_is_asked_for(open_page: Any) -> None:
    brightness = []
    for scheme in ("light", "dark"):
        page = open_page("problem_3_5_6", scheme=scheme)
        colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
        brightness.append(sum(int(part) for part in colour[4:-1].split(",")))
        page.close()
    assert brightness[0] > 3 * 200
    assert brightness[1] < 3 * 60


def test_that_the_contents_are_left_out_of_print(open_page: Any) -> None:
    page = open_page("problem_3_5_6")
    assert page.locator("nav").is_visible()
    page.emulate_media(media="print", color_scheme="dark")
    assert not page.locator("nav").is_visible()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    page.close()

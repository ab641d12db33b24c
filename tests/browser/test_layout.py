"""Where things stand on a page in Chromium, measured on screens, full screen and on phones."""

import itertools
from collections.abc import Callable
from typing import Any

import pytest

import kincompile as kc
from tests import transmission_models as models

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SCREENS = [(1280, 900), (1366, 768), (1920, 1080)]
PHONES = [(360, 740), (390, 844)]
NAMES = ["four_bar", "wrecker_boom", "jansen", "double_wishbone", "delta_robot"]

SETTLED = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
BOX = """element => {
  const { left, right, top, bottom } = element.getBoundingClientRect();
  return [left, right, top, bottom];
}"""
COVERED = """() => {
  const own = document.activeElement, drawn = document.getElementById('drawn');
  if (own === document.body || drawn.contains(own)) return null;
  const [box, over] = [own, drawn].map(element => element.getBoundingClientRect());
  const isSticky = getComputedStyle(drawn).position === 'sticky';
  const isBeside = box.top >= over.bottom - 1 || box.bottom <= over.top + 1;
  const isUnder = isSticky && !isBeside && box.height < innerHeight - over.bottom;
  const isOut = box.bottom < 1 || box.top > innerHeight - 1;
  return isUnder || isOut ? [own.id || own.tagName, box.top, box.bottom, over.bottom] : null;
}"""
"""What has the focus and is not in sight; null where it is."""


@pytest.fixture(scope="module")
def sized(open_page: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that opens a page in a window of a size, full screen or not."""

    def opened(model: Any, size: tuple[int, int], *, full: bool = False) -> Any:
        page = open_page(model, size[0])
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.evaluate(SETTLED)
        if full:
            page.keyboard.press("f")
            page.wait_for_timeout(300)
        return page

    return opened


@pytest.mark.parametrize("name", NAMES)
def test_that_every_slider_is_beside_the_drawing(sized: Callable[..., Any], name: str) -> None:
    page = sized(name, SCREENS[0])
    for size, full in itertools.product(SCREENS, (False, True)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.evaluate(f"showing.enlarge({str(full).lower()}), {SETTLED}")
        _, edge, top, low = page.locator("#stage").evaluate(BOX)
        assert edge > 0.5 * size[0]
        assert low - top > 0.45 * size[1]
        boxes = page.locator("#live input[type=range]").evaluate_all(f"list => list.map({BOX})")
        assert len(boxes) == page.evaluate("player.data.parameters.length") > 0
        for left, right, over, under in boxes:
            assert edge < left < right <= size[0]
            assert 0 < over < under <= size[1]
        # Play, and a part of a plot that follows, are in the same view.
        assert page.locator("#play").evaluate(BOX)[3] <= size[1]
        assert page.locator(".plot").first.evaluate(BOX)[2] < 0.9 * size[1]
        assert page.evaluate("[document.documentElement.scrollWidth, scrollY]") == [size[0], 0]
    page.close()


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("four_bar", SCREENS[1]),
        ("four_bar", PHONES[0]),
        ("four_bar", PHONES[1]),
        ("delta_robot", PHONES[0]),
    ],
)
def test_that_what_has_the_focus_is_in_sight(
    sized: Callable[..., Any], name: str, size: tuple[int, int]
) -> None:
    page = sized(name, size)
    seen = 0
    for tab in page.locator("[role=tab]:visible").all():
        tab.click()
        page.locator("#theme").focus()
        for _ in range(90):
            page.keyboard.press("Tab")
            assert page.evaluate(COVERED) is None
            seen += 1
            if page.evaluate("document.activeElement === document.body"):
                break
        for _ in range(40):
            page.keyboard.press("Shift+Tab")
            assert page.evaluate(COVERED) is None
    assert seen > 60
    page.close()


@pytest.mark.parametrize("size", [SCREENS[0], *PHONES])
def test_that_a_pull_goes_on_playing(sized: Callable[..., Any], size: tuple[int, int]) -> None:
    page = sized("four_bar", size)
    page.click("#play")
    slider = page.locator("#slider-1")
    slider.scroll_into_view_if_needed()
    left, right, top, low = slider.evaluate(BOX)
    page.mouse.move((left + right) / 2, (top + low) / 2)
    page.mouse.down()
    times = []
    for k in range(15):
        page.mouse.move((left + right) / 2 + 2 * k, (top + low) / 2)
        page.wait_for_timeout(60)
        times.append(page.evaluate("player.state.time"))
    page.mouse.up()
    assert page.evaluate("live.values[1] !== live.given[1] && player.isPlaying")
    assert times == sorted(times)
    assert len(set(times)) > 5  # frames in which the clock went on
    page.close()


@pytest.mark.parametrize("size", [*SCREENS, *PHONES])
def test_that_measures_are_readable(sized: Callable[..., Any], size: tuple[int, int]) -> None:
    page = sized("double_wishbone", size)
    page.get_by_role("tab", name="Measures").click()
    assert page.locator("#panel-measures caption").count() >= 5
    clipped = page.evaluate(
        """[...document.querySelectorAll('#panel-measures :is(td, th, caption, .wide)')]
        .filter(element => element.scrollWidth > element.clientWidth + 1
          || element.getBoundingClientRect().right > innerWidth)
        .map(element => element.textContent)"""
    )
    assert clipped == []
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    page.close()


def test_that_long_lists_are_searched(sized: Callable[..., Any]) -> None:
    page = sized("jansen", SCREENS[0])
    choice = page.get_by_label("What is plotted").nth(1)
    chosen, count = choice.input_value(), choice.locator("option").count()
    page.get_by_label("Find what to plot").fill("rocker")
    offered = choice.locator("option").all_inner_texts()
    assert 0 < len(offered) < count / 3
    assert [text for text in offered if "rocker" not in text] == ["|v| of G"]
    assert choice.input_value() == chosen
    page.get_by_role("tab", name="Numbers").click()
    page.get_by_label("Find in the tables").fill("phi_leg")
    assert page.locator("#panel-numbers tbody tr:visible").count() == 1
    page.get_by_label("Find in the tables").fill("")
    assert page.locator("#panel-numbers tbody tr:visible").count() > 21
    page.get_by_role("tab", name="Points").click()
    page.get_by_label("Find a point").fill("crank")
    rows = page.locator("#panel-points tbody tr:visible").all_inner_texts()
    assert rows
    assert all("crank" in text for text in rows)
    page.close()
    page = sized("four_bar", SCREENS[0])
    assert page.locator("#legend input").is_hidden()  # of three bodies none is searched for
    page.close()


def test_that_names_are_those_of_derivations(sized: Callable[..., Any]) -> None:
    page = sized("four_bar", SCREENS[0])
    titles = page.locator(".plot > svg").evaluate_all("list => list.map(svg => svg.ariaLabel)")
    assert titles == [
        "φ_rocker [rad] over t [s]", "φ̇_rocker [rad/s] over t [s]", "φ̈_rocker [rad/s²] over t [s]",
    ]  # fmt: skip
    assert page.locator("#live label").last.inner_text() == "ω [rad/s]"
    assert page.evaluate("plots.list[1].csv().split('\\n')[0]") == "t [s],phi_rocker_dot [rad/s]"
    page.close()


def test_that_buttons_say_their_state(sized: Callable[..., Any]) -> None:
    page = sized("four_bar", SCREENS[0])
    for name in ("angles", "theme", "names", "grid", "measure"):
        button = page.locator(f"#{name}")
        text, before = (
            button.inner_text(),
            button.evaluate("x => getComputedStyle(x).backgroundColor"),
        )
        assert button.get_attribute("aria-pressed") == "false"
        button.click()
        assert (button.inner_text(), button.get_attribute("aria-pressed")) == (text, "true")
        page.mouse.move(0, 0)
        assert button.evaluate("x => getComputedStyle(x).backgroundColor") != before
        button.click()
    page.close()


@pytest.mark.parametrize("size", [SCREENS[0], PHONES[0]])
def test_that_labels_of_ticks_are_large_enough(
    sized: Callable[..., Any], open_file: Callable[..., Any], tmp_path: Any, size: tuple[int, int]
) -> None:
    sizes = """selector => [...document.querySelectorAll(selector)].map(text =>
      parseFloat(getComputedStyle(text).fontSize) * text.ownerSVGElement.getScreenCTM().a)"""
    page = sized("four_bar", size)
    found = page.evaluate(sizes, ".plot text")
    page.get_by_role("tab", name="Newton").click()
    found += page.evaluate(sizes, ".convergence text")
    page.close()
    path = tmp_path / "five_bar.html"
    five_bar = models.five_bar()
    kc.page(five_bar, transmission=(["motor_1", "motor_2"], ["end"])).write(path)
    page = open_file(path, size[0])
    page.wait_for_function("transmission.map !== null")
    found += page.evaluate(sizes, ".map text")
    assert len(found) > 40
    assert min(found) >= 12 - 1e-6
    page.close()

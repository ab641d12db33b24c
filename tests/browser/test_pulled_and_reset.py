"""Any values of the parameters, then the first ones again, in Chromium: the first drawing again."""

import itertools
import random
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile.errors import BranchSwitchWarning
from tests.conftest import EXAMPLES

pytestmark = [pytest.mark.browser, pytest.mark.slow]

NAMES = [path.stem for path in (*EXAMPLES, *EXAMPLES[0].parent.glob("space/*.py"))]

WALK = """async walks => {
  const frame = () => new Promise(done => requestAnimationFrame(() => setTimeout(done)));
  const drawn = () => stage.canvas.toDataURL();
  const plotted = () => [...document.querySelectorAll('.plot svg')].map(svg => svg.outerHTML);
  player.setIndex(Math.floor(player.count / 3));
  await frame();
  const first = drawn(), curves = plotted(), wrong = [], seen = new Set();
  for (const walk of walks) {
    for (const values of walk) {
      live.set(values);
      await frame();
      seen.add(drawn() + plotted());
    }
    document.getElementById('reset').click();
    await frame();
    if (drawn() !== first || plotted().some((svg, k) => svg !== curves[k])) wrong.push(walk);
  }
  return { wrong, seen: seen.size };
}"""
"""Set values one after the other, press Reset, and compare every pixel and every curve."""

FRAME = "new Promise(done => requestAnimationFrame(() => setTimeout(done)))"
SET = f"values => {{ live.set(values); return {FRAME}; }}"
RESET = f"document.getElementById('reset').click(), {FRAME}"
SEEN = "stage.canvas.toDataURL()"


def walks(parameters: list[dict[str, Any]]) -> list[list[dict[str, float]]]:
    """Return ways through values: the ends of each slider and of all, at random, and typed ones."""
    rng = random.Random(4)
    found: list[list[dict[str, float]]] = [
        [{item["name"]: item[end] for item in chosen}]
        for chosen in (*([item] for item in parameters), parameters)
        for end in ("low", "high")
    ]
    ends = [(item["name"], item["low"], item["high"]) for item in parameters]
    for _ in range(20):
        some = {name: rng.uniform(low, high) for name, low, high in ends if rng.random() < 0.6}
        found.append([*(found.pop() if rng.random() < 0.8 else []), some])
    for item in parameters:
        typed = (0.0, -item["value"], 1e-9, 1e6 * item["value"], 1e200, 1.7e308)
        found += [[{item["name"]: value}] for value in (0.0, -item["value"], 1.7e308)]
        found.append([{item["name"]: value} for value in typed])
    return found


@pytest.mark.filterwarnings("ignore::kincompile.errors.RedundantConstraintWarning")
@pytest.mark.parametrize("name", NAMES)
def test_that_the_first_values_again_are_the_first_drawing(
    open_page: Callable[..., Any], name: str
) -> None:
    page = open_page(name)
    parameters = page.evaluate("player.data.parameters")
    assert page.locator("#live input[type=range]").count() == len(parameters)
    if parameters:
        ways = walks(parameters)
        found = page.evaluate(WALK, ways)
        assert found["wrong"] == []
        assert found["seen"] > len(parameters)  # so that something was pulled at all
    assert page.said == []
    page.close()


@pytest.mark.parametrize("view", ["front", "side", "top", "isometric"])
def test_that_every_view_of_space_is_the_first_again(
    open_page: Callable[..., Any], view: str
) -> None:
    page = open_page("stewart_gough")
    page.click(f"#{view}")
    first = page.evaluate(SEEN)
    page.evaluate(SET, {"base": page.evaluate("player.data.parameters[0].high")})
    page.click(f"#{view}")  # the view is chosen while the mechanism is large
    page.evaluate(RESET)
    assert page.evaluate(SEEN) == first
    page.close()


def test_that_a_window_that_changes_meanwhile_changes_nothing(
    open_page: Callable[..., Any],
) -> None:
    page = open_page("jansen")
    page.evaluate(FRAME)
    first = page.evaluate(SEEN)
    page.evaluate(SET, {"k": 100})
    for width in (900, 1280):
        page.set_viewport_size({"width": width, "height": 900})
        page.wait_for_timeout(200)
    page.evaluate(RESET)
    assert page.evaluate(SEEN) == first
    page.close()


def through_its_dead_point() -> tuple[kc.Mechanism, kc.Solution]:
    """Return the motion of a parallelogram, which goes on smoothly where it may fold."""
    m = kc.Mechanism("parallelogram", end=4.0, points=41)
    crank = m.parameter("crank", 1.0)
    one, rod, two = (m.body(name, guess=at) for name, at in
                     (("one", (0, 0, 1)), ("rod", (0.5, 0.8, 0)), ("two", (2, 0, 1))))  # fmt: skip
    m.add(kc.Revolute("O", m.ground, (0, 0), one, (0, 0)))
    m.add(kc.Revolute("A", one, (crank, 0), rod, (0, 0)))
    m.add(kc.Revolute("B", rod, (2, 0), two, (1, 0)))
    m.add(kc.Revolute("C", two, (0, 0), m.ground, (2, 0)))
    m.add(kc.AbsoluteAngle("motor", one, 1 + kc.t))
    with pytest.warns(BranchSwitchWarning):
        solution = kc.solve(kc.compile(m), np.linspace(0, 4, 41), through="smooth")
    return m, solution


def test_that_a_reset_goes_back_to_the_motion_of_the_page(
    open_file: Callable[..., Any], tmp_path: Any
) -> None:
    model, solution = through_its_dead_point()
    page = open_file(kc.page(model, solution).write(tmp_path / "parallelogram.html"))
    page.evaluate(SET, {"crank": 1.2})
    page.evaluate(RESET)
    shown = page.evaluate("Array.from(player.data.arrays.q)")
    np.testing.assert_array_equal(shown, solution.q.ravel())
    assert page.evaluate("player.data.status") == solution.status.tolist()
    assert page.inner_text("#live output") == solution.message
    page.close()


def test_that_a_link_without_a_length_does_not_end_the_page(open_page: Callable[..., Any]) -> None:
    page = open_page("shaper")
    page.evaluate(FRAME)
    first = page.evaluate(SEEN)
    page.get_by_label("r in m").fill("0")
    page.wait_for_function("live.values[1] === 0 && live.frame === null")
    page.get_by_label("d in m").fill("0.5")
    page.wait_for_function("live.values[0] === 0.5 && live.frame === null")
    page.evaluate(RESET)
    assert page.evaluate(SEEN) == first
    assert page.said == []
    page.close()


def curves(page: Any) -> list[str]:
    pieces: list[str] = page.evaluate(
        "plots.list.map(plot => plot.svg.querySelector('path').getAttribute('d'))"
    )
    return pieces


def test_that_no_old_curve_is_left_where_nothing_can_be_assembled(
    open_page: Callable[..., Any],
) -> None:
    page = open_page("four_bar")
    before = curves(page)
    assert all(before)
    page.evaluate(SET, {"b": 1000})
    assert curves(page) == [""] * len(before)
    texts = page.evaluate("plots.list.map(plot => plot.svg.textContent)")
    assert all("No position was found." in text for text in texts)
    note = page.locator("#stage #note")
    assert note.is_visible()
    assert "the mechanism cannot be assembled" in note.inner_text()
    readings = page.evaluate("plots.list.map(plot => plot.reading.textContent)")
    assert not any(re.search(r"\d", text.replace("t = 0 s", "")) for text in readings)
    saved = page.evaluate("plots.list.map(plot => plot.csv())")
    assert not any(re.search(r",[-\d]", text.split("\n", 1)[1]) for text in saved)
    page.get_by_role("tab", name="Numbers").click()
    page.get_by_role("tab", name="Plots").click()
    page.evaluate(RESET)
    assert curves(page) == before
    assert not note.is_visible()
    assert page.said == []
    page.close()


def test_that_a_page_that_opens_without_a_motion_plots_the_first_that_is_found(
    open_file: Callable[..., Any], example_named: Any, tmp_path: Any
) -> None:
    model = example_named("four_bar").model
    page = open_file(kc.page(model, p={"b": 1000.0}).write(tmp_path / "apart.html"))
    assert page.inner_text("#panel-plots") == "There is no motion to plot."
    page.evaluate(SET, {"b": 26})
    assert all(curves(page))
    assert "There is no motion" not in page.inner_text("#panel-plots")
    page.evaluate(RESET)
    assert not any(curves(page))
    assert page.said == []
    page.close()


def test_that_a_rate_of_zero_is_zero_beside_others(open_page: Callable[..., Any]) -> None:
    page = open_page("four_bar")
    page.evaluate(SET, {"a": 0})
    low, high = page.evaluate("plots.list.find(p => p.choice.value === 'phi_rocker_dot').yRange")
    assert (low, high) == pytest.approx((-1.5, 1.5), rel=1e-6)  # of the crank
    page.close()


def test_that_every_panel_takes_any_values(open_page: Callable[..., Any]) -> None:
    for name in ("shaper", "rssr", "cam_flat_follower"):
        page = open_page(name)
        parameters = page.evaluate("player.data.parameters")
        for tab in page.get_by_role("tab").all():
            if not tab.is_visible():
                continue
            tab.click()
            for value in (0.0, -1.0, 1e6, 1e200, 1.7e308):
                page.evaluate(SET, {parameters[0]["name"]: value})
                page.evaluate("player.setIndex(1)")
            page.evaluate(RESET)
        assert page.said == [], name
        page.close()


def test_that_a_motion_that_locks_has_the_whole_time_on_its_axis(
    open_page: Callable[..., Any],
) -> None:
    page = open_page("four_bar")
    page.evaluate(SET, {"a": 30})
    times = page.evaluate("[player.t[0], player.t[player.count - 1]]")
    assert page.evaluate("plots.list.find(plot => plot.isOverTime).xRange") == times
    lines = """plots.list.filter(plot => plot.isOverTime).flatMap(({ svg, box }) =>
      [...svg.querySelectorAll('line[stroke-dasharray], rect')].map(line => [
        box.left, Number(line.getAttribute('x1') ?? line.getAttribute('x')), box.right]))"""
    found = page.evaluate(lines)
    assert len(found) >= 2
    page.evaluate("plots.zoom([0, 0.3])")
    found += page.evaluate(lines)
    assert all(left <= x <= right for left, x, right in found)
    (event,) = page.evaluate("player.data.events.map(({ t }) => t)")
    page.evaluate("player.setIndex(player.count - 1)")
    assert f"after lock-up at t = {event:.6g}: coupler, rocker" in page.inner_text("#stage #note")
    assert event > 0.3
    assert not page.evaluate("plots.list.some(p => p.svg.querySelector('line[stroke-dasharray]'))")
    page.close()


def test_that_sliders_of_two_parameters_meet_at_the_same_drawing(
    open_page: Callable[..., Any],
) -> None:
    """What is drawn depends on the values alone, and not on the way to them."""
    page = open_page("double_wishbone")
    ends = page.evaluate("player.data.parameters.map(({ name, low, high }) => [name, low, high])")
    wanted = {name: low + 0.4 * (high - low) for name, low, high in ends}
    page.evaluate(SET, wanted)
    first = page.evaluate(SEEN)
    for way in itertools.permutations(wanted):
        for name, low, _ in ends:
            page.evaluate(SET, {name: low})
        for name in way:
            page.evaluate(SET, {name: wanted[name]})
        assert page.evaluate(SEEN) == first
    page.close()

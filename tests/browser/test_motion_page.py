"""The page of a motion in headless Chromium: what moves, what is shown, what it can be told."""

import dataclasses
import re
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc

pytestmark = [pytest.mark.browser, pytest.mark.slow]

WIDTHS = (1280, 390)
EXAMPLES = ("wrecker_boom", "four_bar", "cam_flat_follower", "problem_3_5_6")

SLANT = np.arctan2(0.6, 0.8)

# Whatever can be scrolled by itself may be wider than the page.
TOO_WIDE = """() => [...document.querySelectorAll('body *')]
  .filter(element => element.closest('.wide, #stage') === null)
  .filter(element => element.getBoundingClientRect().right > innerWidth + 1)
  .map(element => element.outerHTML.slice(0, 120))"""

# The middle of the dark pixels, which are those of pins, around a place on the canvas.
MIDDLE_OF_INK = """([x, y]) => {
  const reach = 9, size = 2 * reach + 1;
  const left = Math.round(x) - reach, top = Math.round(y) - reach;
  const { data } = stage.ctx.getImageData(left, top, size, size);
  let [count, sum_x, sum_y] = [0, 0, 0];
  for (let k = 0; k < size * size; k++) {
    if (data[4 * k + 3] < 255 || data.slice(4 * k, 4 * k + 3).some(part => part > 90)) continue;
    count += 1;
    sum_x += left + (k % size) + 0.5;
    sum_y += top + Math.floor(k / size) + 0.5;
  }
  return [sum_x / count, sum_y / count, count];
}"""

PIXELS = "stage.canvas.toDataURL()"


def four_bar(name: str, crank: float, *, driven: bool = True) -> kc.Mechanism:
    """Return a four-bar of crank, coupler 2 (aslant in its frame), rocker 2 and ground 3."""
    m = kc.Mechanism(name, end=2.0, points=81)
    i = m.body("crank", guess=(crank / 2, 0, 0.3))
    j = m.body("rod", guess=(2, 1, 0.2 - SLANT))
    k = m.body("rocker", guess=(3, 1, 1.2))
    m.add(kc.Revolute("O", m.ground, (0, 0), i, (-crank / 2, 0)))
    m.add(kc.Revolute("P", i, (crank / 2, 0), j, (-0.8, -0.6)))
    m.add(kc.Revolute("Q", j, (0.8, 0.6), k, (1, 0)))
    m.add(kc.Revolute("R", k, (-1, 0), m.ground, (3, 0)))
    if driven:
        m.add(kc.AbsoluteAngle("motor", i, 0.5 + kc.t))
    return m


def chain(count: int) -> kc.Mechanism:
    """Return a chain of driven links."""
    m = kc.Mechanism(f"chain_of_{count}", end=5.0, points=301)
    before, at = m.ground, (0.0, 0.0)
    for k in range(count):
        link = m.body(f"link_{k}", guess=(k + 0.5, 0, 0))
        m.add(kc.Revolute(f"joint_{k}", before, at, link, (-0.5, 0)))
        m.add(kc.AbsoluteAngle(f"motor_{k}", link, sympy.sin(2 * kc.t + k / 3) / 1.5))
        before, at = link, (0.5, 0.0)
    return m


def shown_q(page: Any) -> np.ndarray:
    return np.array(page.evaluate("Array.from(player.state.q)"))


def on_screen(page: Any, point: Any) -> np.ndarray:
    return np.array(page.evaluate("point => stage.view.toScreen(point)", [float(x) for x in point]))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", EXAMPLES)
def test_that_nothing_is_wider_than_the_page(open_page: Any, name: str, width: int) -> None:
    page = open_page(name, width)
    tabs = page.get_by_role("tab")
    for k in range(tabs.count()):
        tabs.nth(k).click()
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate(TOO_WIDE) == []
    page.close()


def test_that_the_scripts_take_the_columns_of_a_body_from_the_data(open_page: Any) -> None:
    page = open_page("four_bar")
    frame = "{ index: 0, columns: [4, 2, 1] }"
    q, rates = "[9, Math.PI / 2, 2, 9, 1]", "[0, 2, 5, 0, 7]"
    place = page.evaluate(f"inWorld({q}, {frame}, [3, 4])")
    np.testing.assert_allclose(place, (1 - 4, 2 + 3), atol=1e-12)
    state = f"{{ q: {q}, q_dot: {rates}, q_ddot: {rates} }}"
    found = page.evaluate(f"ratesInWorld({state}, {frame}, [3, 4])")
    # The arm is (-4, 3): omega x arm and alpha x arm - omega^2 arm, with omega = alpha = 2.
    np.testing.assert_allclose(found["velocity"], (7 - 6, 5 - 8), atol=1e-12)
    np.testing.assert_allclose(found["acceleration"], (7 - 6 + 16, 5 - 8 - 12), atol=1e-12)
    page.close()


@pytest.mark.parametrize("name", EXAMPLES)
def test_that_the_page_says_nothing_and_asks_for_nothing(open_page: Any, name: str) -> None:
    page = open_page(name)
    page.keyboard.press("Space")
    page.wait_for_function("player.state.time > 0.2")
    page.wait_for_load_state("networkidle")
    assert page.said == []
    assert [url for url in page.asked if not url.startswith("data:")] == [page.url]
    page.close()


@pytest.mark.parametrize(("name", "has_bodies"), [("four_bar", True), ("problem_3_5_6", False)])
def test_that_what_is_for_bodies_is_shown_where_there_are_some(
    open_page: Any, name: str, has_bodies: bool
) -> None:
    page = open_page(name)
    for place in ("#canvas", "#legend", "#names", "#tab-points"):
        assert page.locator(place).is_visible() is has_bodies
    assert page.locator("#plain").is_visible() is not has_bodies
    page.close()


def test_that_play_moves_the_bodies_and_a_pause_stops_at_a_solved_time(
    open_page: Any, example_named: Any
) -> None:
    page = open_page("wrecker_boom")
    before = page.evaluate(PIXELS)
    page.get_by_role("button", name="Play").click()
    page.wait_for_function("player.state.time > 0.3")
    page.get_by_role("button", name="Pause").click()
    assert page.evaluate(PIXELS) != before
    solution = example_named("wrecker_boom").solution
    index = page.evaluate("player.state.index")
    assert index > 0
    np.testing.assert_array_equal(shown_q(page), solution.q[index])
    page.close()


def test_that_between_solved_times_the_motion_is_smooth(open_page: Any, example_named: Any) -> None:
    page = open_page("four_bar")
    t = 1.2345
    found = page.evaluate("t => Array.from(player.between(t).q)", t)
    exact = kc.solve(example_named("four_bar").module, [0, t]).q[1]
    np.testing.assert_allclose(found, exact, atol=1e-6)
    page.close()


def test_that_the_slider_sets_the_time(open_page: Any, example_named: Any) -> None:
    page = open_page("four_bar")
    page.get_by_label("Time", exact=True).fill("370")
    solution = example_named("four_bar").solution
    assert page.inner_text("#clock") == f"t = {solution.t[370]:.4f} s"
    np.testing.assert_array_equal(shown_q(page), solution.q[370])
    rates = np.array(page.evaluate("Array.from(player.state.q_ddot)"))
    np.testing.assert_array_equal(rates, solution.q_ddot[370])
    page.close()


@pytest.mark.parametrize("width", WIDTHS)
def test_that_pins_are_on_the_screen_where_the_solution_has_them(
    open_page: Any, width: int
) -> None:
    m = four_bar("seen", 1.0)
    solution = kc.solve(kc.compile(m), np.linspace(0, m.end, m.points))
    page = open_page(m, width)
    page.evaluate("stage.traced.clear()")
    for index in (0, 33, 80):
        page.evaluate("k => player.setIndex(k)", index)
        angle, phi = 0.5 + solution.t[index], solution["phi_rod"][index] + SLANT
        crank_pin = np.array((np.cos(angle), np.sin(angle)))
        rod_pin = crank_pin + 2 * np.array((np.cos(phi), np.sin(phi)))
        for pin in ((0, 0), crank_pin, rod_pin, (3, 0)):
            expected = on_screen(page, pin)
            *middle, count = page.evaluate(MIDDLE_OF_INK, expected.tolist())
            assert count > 10
            np.testing.assert_allclose(middle, expected, atol=1)
    page.close()


def test_that_lengths_on_the_screen_are_true(open_page: Any) -> None:
    page = open_page("four_bar")
    origin, along, up = (on_screen(page, point) for point in ((0, 0), (1, 0), (0, 1)))
    scale = along[0] - origin[0]
    np.testing.assert_allclose((along - origin, up - origin), ((scale, 0), (0, -scale)), atol=1e-9)
    page.close()


def test_that_keys_step_through_the_motion(open_page: Any) -> None:
    page = open_page("wrecker_boom")
    last = page.evaluate("player.count") - 1
    keys = [
        ("ArrowRight", 1), ("Shift+ArrowRight", 11), ("ArrowLeft", 10), ("End", last),
        ("ArrowRight", last), ("Shift+ArrowLeft", last - 10), ("Home", 0), ("ArrowLeft", 0),
    ]  # fmt: skip
    for key, index in keys:
        page.keyboard.press(key)
        assert page.evaluate("player.state.index") == index
    speed = page.evaluate("player.speed")
    page.keyboard.press("+")
    assert page.evaluate("player.speed") > speed
    page.keyboard.press("-")
    page.keyboard.press("-")
    assert page.evaluate("player.speed") < speed
    page.keyboard.press("Space")
    assert page.evaluate("player.isPlaying")
    page.close()


def test_that_keys_belong_to_the_field_that_is_filled_in(open_page: Any) -> None:
    page = open_page("wrecker_boom")
    page.get_by_role("tab", name="Points").click()
    page.get_by_label("xi", exact=True).focus()
    page.keyboard.type("0.5")
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("player.state.index") == 0
    page.close()


def test_that_a_joint_tells_its_name_and_its_motion(open_page: Any) -> None:
    page = open_page(four_bar("hovered", 1.0))
    page.evaluate("player.setIndex(40)")
    box = page.locator("#canvas").bounding_box()
    angle = 0.5 + 1.0  # the crank turns at 1 rad/s: its pin is as fast as it is far
    pin = np.array((np.cos(angle), np.sin(angle)))
    x, y = on_screen(page, pin)
    page.mouse.move(box["x"] + x, box["y"] + y)
    tip = page.inner_text("#tip")
    assert tip.startswith("P")
    assert "Revolute" in tip
    x, y, *rates = (float(text) for text in re.findall(r"-?\d+\.\d+", tip))
    np.testing.assert_allclose((x, y), pin, atol=1e-4)
    np.testing.assert_allclose(rates[:3], (-pin[1], pin[0], 1), atol=1e-4)
    np.testing.assert_allclose(rates[3:], (-pin[0], -pin[1], 1), atol=1e-4)
    page.mouse.move(box["x"] + 3, box["y"] + 3)
    assert page.locator("#tip").is_hidden()
    page.close()


def test_that_a_tap_keeps_a_joint_and_traces_its_path(open_page: Any) -> None:
    page = open_page(four_bar("tapped", 1.0), 390)
    page.evaluate("stage.traced.clear()")
    pin = on_screen(page, (np.cos(0.5), np.sin(0.5))).tolist()
    page.locator("#canvas").tap(position={"x": pin[0], "y": pin[1]})
    assert "Revolute" in page.inner_text("#tip")
    assert page.evaluate("[...stage.traced].map(point => point.name)") == ["P"]
    page.locator("#canvas").tap(position={"x": 5, "y": 5})
    assert page.locator("#tip").is_hidden()
    page.close()


def test_that_a_point_of_ones_own_is_traced(open_page: Any) -> None:
    page = open_page(four_bar("traced", 1.0))
    page.get_by_role("tab", name="Points").click()
    page.get_by_label("xi", exact=True).fill("0.5")
    page.get_by_role("button", name="Trace this point").click()
    path = np.array(page.evaluate("pathOf(stage.points.at(-1)).line"))
    # Fixed in the crank, of length 1, at its pin.
    np.testing.assert_allclose(np.hypot(*path.T), 1.0, atol=1e-12)
    page.close()


def test_that_the_numbers_of_points_have_units_and_are_in_sight(open_page: Any) -> None:
    page = open_page(four_bar("points", 1.0))
    page.get_by_role("tab", name="Points").click()
    panel = page.locator("#panel-points")
    titles = panel.locator("thead th")
    units = ["x [m]", "y [m]", "|v| [m/s]", "|a| [m/s²]"]
    assert titles.all_inner_texts() == ["point", "path", *units, "what"]
    edge, last = panel.bounding_box(), titles.nth(5).bounding_box()
    assert last["x"] + last["width"] <= edge["x"] + edge["width"]
    # The crank has length 1 and turns at 1 rad/s.
    pin = panel.locator("tbody tr", has=page.get_by_role("rowheader", name="P", exact=True))
    *rates, kind = pin.locator("td").all_inner_texts()[3:]
    assert [float(rate) for rate in rates] == [1, 1]
    assert kind == "Revolute"
    page.close()


def test_that_plots_hold_the_numbers_of_the_solution(open_page: Any, example_named: Any) -> None:
    page = open_page("wrecker_boom")
    example = example_named("wrecker_boom")
    solution = example.solution
    Phi_q = example.module.Phi_q(solution.q, solution.t)
    expected = {
        "y_hook": solution["y_hook"],
        "phi_boom_dot": solution["phi_boom_dot"],
        "x_rod_ddot": solution["x_rod_ddot"],
        "condition number of Phi_q": solution.condition,
        "determinant of Phi_q": np.linalg.det(Phi_q),
    }
    choice = page.get_by_label("What is plotted").first
    for label, values in expected.items():
        choice.select_option(label)
        t, y = page.evaluate("[plots.list[0].x, plots.list[0].y]")
        np.testing.assert_array_equal(t, solution.t)
        np.testing.assert_allclose(y, values, rtol=1e-9)
    page.close()


def test_that_the_time_line_of_a_plot_moves_and_a_click_sets_the_time(open_page: Any) -> None:
    page = open_page("wrecker_boom")
    plot = page.locator(".plot svg").first
    page.evaluate("player.setTime(4)")
    box, line = plot.bounding_box(), plot.locator(".now").bounding_box()
    left, right = page.evaluate("[plots.list[0].box.left, plots.list[0].box.right]")
    assert line["x"] - box["x"] == pytest.approx((left + right) / 2, abs=1.5)
    plot.click(position={"x": left + (right - left) / 4, "y": 20})
    assert page.evaluate("player.state.time") == pytest.approx(2.0, abs=0.1)
    page.close()


def test_that_the_numbers_under_a_plot_are_those_of_the_time_or_of_the_pointer(
    open_page: Any,
) -> None:
    page = open_page(four_bar("under_plots", 1.0))
    reading = page.locator(".plot output").first

    def at(index: int) -> list[float]:
        return [float(page.evaluate(f"plots.list[0].{axis}[{index}]")) for axis in "xy"]

    def values() -> list[float]:
        return [float(text) for text in re.findall(r"= (\S+)", reading.inner_text())]

    page.evaluate("player.setIndex(30)")
    np.testing.assert_allclose(values(), at(30), atol=1e-4)
    left = page.evaluate("plots.list[0].box.left")
    page.locator(".plot svg").first.hover(position={"x": left + 1, "y": 20})
    np.testing.assert_allclose(values(), at(0), atol=1e-4)
    page.mouse.move(3, 3)
    np.testing.assert_allclose(values(), at(30), atol=1e-4)
    page.close()


def test_that_what_moves_unevenly_is_plotted_first(open_page: Any) -> None:
    m = kc.Mechanism("yoke", points=21)
    crank, yoke = m.body("crank"), m.body("yoke", guess=(1, 0, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Translational("guide", m.ground, (0, 0), (1, 0), yoke, (0, 0), (1, 0)))
    m.add(kc.RevoluteTranslational("slot", yoke, (0, 0), (0, 1), crank, (1, 0), 0))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    page = open_page(m)
    labels = page.get_by_label("What is plotted").evaluate_all("all => all.map(one => one.value)")
    assert labels == ["x_yoke", "x_yoke_dot", "x_yoke_ddot"]
    page.close()


def test_that_the_numbers_can_be_copied(open_page: Any, example_named: Any) -> None:
    page = open_page("four_bar")
    page.evaluate("player.setIndex(100)")
    page.get_by_role("tab", name="Numbers").click()
    first, _, *rows = page.evaluate("numbers.text()").splitlines()
    solution = example_named("four_bar").solution
    assert float(first.split("\t")[1]) == solution.t[100]
    found = np.array([[float(cell) for cell in row.split("\t")[2:]] for row in rows])
    exact = np.stack((solution.q[100], solution.q_dot[100], solution.q_ddot[100]), axis=-1)
    np.testing.assert_array_equal(found, exact)
    page.get_by_role("button", name="Copy", exact=True).click()
    page.get_by_text("Copied").wait_for()
    page.close()


def test_that_the_page_is_dark_where_that_is_asked_for(open_page: Any) -> None:
    def brightness(page: Any) -> int:
        colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
        return sum(int(part) for part in colour[4:-1].split(","))

    light, dark = open_page("four_bar"), open_page("four_bar", scheme="dark")
    assert brightness(light) > 3 * 200
    assert brightness(dark) < 3 * 60
    assert light.evaluate(PIXELS) != dark.evaluate(PIXELS)
    light.get_by_role("button", name="Dark").click()
    assert brightness(light) == brightness(dark)
    light.close()
    dark.close()


def test_that_a_lock_up_is_marked_and_what_follows_is_explained(open_page: Any) -> None:
    page = open_page(four_bar("locks", 2.0))
    # Crank and ground are 2 and 3, the others 2 + 2: straight where 13 - 12 cos(angle) = 16.
    lock = np.arccos(-3 / 12) - 0.5
    mark = page.locator("#marks .event")
    assert float(mark.evaluate("element => parseFloat(element.style.left)")) == pytest.approx(
        100 * lock / 2, abs=1e-3
    )
    assert page.inner_text("#events") == f"lock-up at t = {lock:.6g}: rod, rocker"
    assert "locks failed at t = 1.325" in page.inner_text("#message")
    assert page.locator("#note").is_hidden()
    page.keyboard.press("End")
    assert "NOT_REACHED" in page.inner_text("#note")
    assert "last position that was found" in page.inner_text("#note")
    page.locator("#events button").click()
    assert page.evaluate("player.state.time") == pytest.approx(lock, abs=2 / 80)
    page.close()


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("driven", [True, False])
def test_that_a_mechanism_that_does_not_assemble_shows_its_guess(
    open_page: Any, driven: bool, width: int
) -> None:
    m = four_bar("too_long" if driven else "without_driver", 8.0, driven=driven)
    page = open_page(m, width)
    assert page.said == []
    guess = [value for body in m.bodies for value in body.guess]
    np.testing.assert_array_equal(shown_q(page), guess)
    reason = "cannot be assembled" if driven else "1 more equation is needed"
    assert reason in page.inner_text("#message")
    assert "start guess" in page.inner_text("#note")
    # At the guess no joint is where it belongs; the driver alone may hold.
    assert set(page.evaluate("[...violatedJoints()]")) >= {"O", "P", "Q", "R"}
    assert page.evaluate(TOO_WIDE) == []
    page.get_by_role("tab", name="Plots").click()
    assert page.inner_text("#panel-plots") == "There is no motion to plot."
    page.close()


def test_that_what_a_solver_says_is_text(open_file: Any, example_named: Any, tmp_path: Any) -> None:
    example = example_named("four_bar")
    evil = "<img src=x onerror=alert(1)></script><b id=evil>t < 1</b>"
    solution = dataclasses.replace(example.solution, message=evil, success=False)
    page = open_file(kc.page(example.model, solution).write(tmp_path / "evil.html"))
    assert page.inner_text("#message") == evil
    assert page.locator("#evil, #message img").count() == 0
    assert page.said == []
    page.close()


def test_that_thirty_bodies_are_drawn_and_moved_while_the_page_plays(open_page: Any) -> None:
    page = open_page(chain(30))
    page.keyboard.press("Space")
    page.wait_for_function("player.state.time > 1", timeout=60_000)
    assert page.said == []
    assert "frames" not in page.inner_text("body")
    page.close()


def test_that_the_gallery_shows_and_links_every_page(
    open_file: Any, example_named: Any, tmp_path: Any
) -> None:
    pages = [kc.page(example_named(name).model) for name in EXAMPLES]
    *_, index = kc.gallery(pages).write(tmp_path)
    page = open_file(index)
    assert page.said == []
    links = page.locator("a.card")
    assert [links.nth(k).get_attribute("href") for k in range(links.count())] == [
        f"{name}.html" for name in EXAMPLES
    ]
    drawn = page.evaluate("""[...document.querySelectorAll('canvas')].map(canvas => canvas
        .getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some(x => x))""")
    assert drawn == [True] * len(EXAMPLES)
    links.first.click()
    assert page.url.endswith(f"{EXAMPLES[0]}.html")
    assert [url for url in page.asked if not url.startswith(("data:", "file:"))] == []
    page.close()


def test_that_named_points_are_traced_and_outputs_are_plotted_first(open_page):
    m = four_bar("pointed", 1.0)
    rod = m.bodies[1]
    point = m.point("P", rod, (0, 1))
    m.output("still", 3, "m")
    m.output("height", point.y, "m")
    page = open_page(m)
    page.wait_for_function("plots.list.length === 3")
    assert page.evaluate("[...stage.traced].map(point => point.name)") == ["P"]
    shown = page.evaluate("plots.list.map(plot => plot.choice.value)")
    assert shown == ["height", "height_dot", "height_ddot"]
    solution = kc.solve(kc.compile(m), np.linspace(0, m.end, m.points))
    for k, name in enumerate(shown):
        drawn = page.evaluate(f"plots.list[{k}].y")
        np.testing.assert_allclose(drawn, solution[name], atol=1e-12)
    labels = page.evaluate("[...plots.list[0].choice.options].map(option => option.value)")
    assert {"height", "height_dot", "still", "x_rod", "path of P", "|v| of Q"} <= set(labels)
    assert page.said == []

"""What helps to read the drawing and the plots, in headless Chromium."""

import csv
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import sympy

import kincompile as kc

pytestmark = [pytest.mark.browser, pytest.mark.slow]

WIDTHS = (390, 1280, 1920)
OVERFLOW = "document.documentElement.scrollWidth"

# What can be pressed, and is smaller than a finger needs.
TOO_SMALL = """() => [...document.querySelectorAll('button, select, summary, input')]
  .filter(element => element.offsetParent !== null && !element.matches('[type=checkbox]'))
  .map(element => [element.id || element.textContent, element.getBoundingClientRect()])
  .filter(([, box]) => box.height < 44 || box.width < 44).map(([name]) => name)"""


def slider_crank() -> kc.Mechanism:
    """Return a crank of 1 and a rod of 3 along the x axis, turned at 1 rad/s; lengths in dm."""
    m = kc.Mechanism("crank_and_rod", end=7.0, points=141, length_unit="dm")
    crank, rod, block = m.body("crank"), m.body("rod", guess=(2, 0, 0)), m.body("block")
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (1, 0), rod, (-1, 0)))
    m.add(kc.Revolute("B", rod, (2, 0), block, (0, 0)))
    m.add(kc.Translational("guide", m.ground, (0, 0), (1, 0), block, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 0.3 + kc.t))
    return m


ANGLE = 0.3


def crank_pin() -> np.ndarray:
    return np.array((np.cos(ANGLE), np.sin(ANGLE)))


def block_pin() -> np.ndarray:
    return np.array((np.cos(ANGLE) + np.sqrt(9 - np.sin(ANGLE) ** 2), 0.0))


def on_page(page: Any, point: Any) -> tuple[float, float]:
    """Return where a point of the ground is in the window."""
    box = page.locator("#canvas").bounding_box()
    x, y = page.evaluate("point => stage.view.toScreen(point)", [float(part) for part in point])
    return box["x"] + x, box["y"] + y


def numbers(text: str) -> list[float]:
    return [float(found) for found in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text)]


def test_that_the_wheel_zooms_around_the_pointer_and_a_drag_moves(open_page: Any) -> None:
    page = open_page(slider_crank())
    place = np.array((1.5, 0.5))
    x, y = on_page(page, place)
    scale = page.evaluate("stage.view.scale")
    page.mouse.move(x, y)
    page.mouse.wheel(0, -500)
    page.wait_for_function(f"stage.view.scale > {1.5 * scale}")
    np.testing.assert_allclose(on_page(page, place), (x, y), atol=0.5)
    page.mouse.down()
    page.mouse.move(x + 60, y + 25, steps=4)
    page.mouse.up()
    np.testing.assert_allclose(on_page(page, place), (x + 60, y + 25), atol=0.5)
    assert page.evaluate("stage.selected") is None  # a drag is no click
    page.get_by_role("button", name="Fit").click()
    assert page.evaluate("stage.view.scale") == pytest.approx(scale)
    page.locator("#canvas").focus()
    page.keyboard.press("PageUp")
    assert page.evaluate("stage.view.scale") == pytest.approx(1.25 * scale)
    before = on_page(page, place)
    page.keyboard.press("Alt+ArrowLeft")
    assert on_page(page, place)[0] == pytest.approx(before[0] + 40)
    page.keyboard.press("0")
    assert page.evaluate("stage.camera") is None
    page.close()


def test_that_two_fingers_zoom_and_what_is_between_them_stays(open_page: Any) -> None:
    page = open_page(slider_crank(), 390)
    x, y = on_page(page, (1, 0))
    touch = page.context.new_cdp_session(page)
    scale = page.evaluate("stage.view.scale")

    def fingers(kind: str, apart: float | None) -> None:
        ends = [] if apart is None else [x - apart, x + apart]
        points = [{"x": end, "y": y, "id": k} for k, end in enumerate(ends)]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    fingers("touchStart", 30)
    for apart in (35, 40, 50, 60):
        fingers("touchMove", apart)
    fingers("touchEnd", None)
    assert page.evaluate("stage.view.scale") == pytest.approx(2 * scale, rel=1e-6)
    assert on_page(page, (1, 0))[0] == pytest.approx(x, abs=1)
    page.close()


def test_that_a_body_that_is_pointed_at_tells_how_it_turns(open_page: Any) -> None:
    page = open_page(slider_crank())
    middle = (crank_pin() + block_pin()) / 2
    page.mouse.move(*on_page(page, middle))
    tip = page.inner_text("#tip")
    assert tip.startswith("rod")
    # sin(beta) = -sin(a) / 3 of the angle beta of the rod, differentiated twice with a_dot = 1.
    beta = -np.arcsin(np.sin(ANGLE) / 3)
    omega = -np.cos(ANGLE) / (3 * np.cos(beta))
    alpha = (np.sin(ANGLE) / 3 + np.sin(beta) * omega**2) / np.cos(beta)
    np.testing.assert_allclose(numbers(tip), (beta, omega, alpha), atol=1e-4)
    page.get_by_role("button", name="Degrees").click()
    page.mouse.move(*on_page(page, middle))
    np.testing.assert_allclose(
        numbers(page.inner_text("#tip")), np.degrees((beta, omega, alpha)), atol=1e-2
    )
    page.mouse.move(*on_page(page, (1, -5)))
    page.get_by_role("button", name="crank", exact=True).click()
    assert page.inner_text("#tip").startswith("crank")
    page.close()


def test_that_every_joint_of_a_place_is_listed(open_page: Any) -> None:
    page = open_page(slider_crank())
    page.mouse.move(*on_page(page, block_pin()))
    tip = page.inner_text("#tip")
    assert {"B: Revolute", "guide: Translational"} <= set(tip.splitlines())
    page.close()


def test_that_distances_and_angles_are_measured_and_move_with_the_bodies(open_page: Any) -> None:
    page = open_page(slider_crank())
    page.keyboard.press("m")
    for point in ((0, 0), crank_pin(), block_pin()):
        page.mouse.click(*on_page(page, point))
    angle, *_ = numbers(page.inner_text("#measured"))
    # The triangle O A B with sides 1 and 3, and the angle between them.
    far = block_pin()[0]
    expected = np.arccos((1 + 9 - far**2) / 6)
    assert angle == pytest.approx(expected, abs=1e-4)
    page.evaluate("player.setTime(1.0)")
    far = np.cos(1.3) + np.sqrt(9 - np.sin(1.3) ** 2)
    angle, *_ = numbers(page.inner_text("#measured"))
    assert angle == pytest.approx(np.arccos((10 - far**2) / 6), abs=1e-4)
    page.get_by_role("button", name="Begin again").click()
    for name in ("O", "B"):
        page.locator("#measured-point").select_option(label=name)
    distance, across, up, slope = numbers(page.inner_text("#measured"))
    np.testing.assert_allclose((distance, across, up, slope), (far, far, 0, 0), atol=1e-4)
    assert "dm" in page.inner_text("#measured")
    page.close()


def test_that_poles_are_where_velocities_meet_and_centrodes_go_through_them(open_page: Any) -> None:
    page = open_page(slider_crank())
    # Of the rod: above the block, on the line through the crank.
    expected = (block_pin()[0], block_pin()[0] * np.tan(ANGLE))
    rod, crank = (f"player.data.drawing.frames[{k}]" for k in (1, 0))
    pole = page.evaluate(f"poleOf(player.state, {rod})")
    np.testing.assert_allclose(pole, expected, rtol=1e-9)
    # Of crank and rod: the pin between them. The block does not turn: it has none.
    np.testing.assert_allclose(
        page.evaluate(f"poleOf(player.state, {rod}, {crank})"), crank_pin(), rtol=1e-9
    )
    assert page.evaluate("poleOf(player.state, player.data.drawing.frames[2])") is None
    fixed = page.evaluate(f"centrode({rod}, GROUND)")
    np.testing.assert_allclose(fixed[0], expected, rtol=1e-9)
    moving = page.evaluate(f"centrode(GROUND, {rod})")
    found = page.evaluate(f"place => inWorld(player.state.q, {rod}, place)", moving[0])
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    before = page.evaluate("stage.canvas.toDataURL()")
    page.get_by_label("Velocity poles").select_option("rod against the ground")
    with_pole = page.evaluate("stage.canvas.toDataURL()")
    page.get_by_label("Centrodes").check()
    assert len({before, with_pole, page.evaluate("stage.canvas.toDataURL()")}) == 3
    page.close()


def test_that_dots_of_a_path_are_equal_times_of_its_first_round(open_page: Any) -> None:
    page = open_page(slider_crank())
    # The crank turns steadily, once in 2 pi s of 7: 24 dots are 15 degrees apart.
    dots = np.array(page.evaluate("pathOf(stage.points.find(point => point.name === 'A')).dots"))
    angles = np.unwrap(np.arctan2(dots[:, 1], dots[:, 0]))
    np.testing.assert_allclose(np.diff(angles), np.radians(15), rtol=1e-3)
    colours = page.evaluate(
        "['A', 'B'].map(name => stage.colourOf(stage.points.find(point => point.name === name)))"
    )
    assert len(set(colours)) == 2
    page.close()


@pytest.mark.parametrize("length", [0.0031, 0.12, 4.4, 7600.0])
def test_that_steps_of_the_grid_are_round_and_not_smaller(open_page: Any, length: float) -> None:
    page = open_page(slider_crank())
    step = page.evaluate(f"niceStep({length})")
    mantissa = step / 10 ** np.floor(np.log10(step) + 1e-9)
    assert round(mantissa, 9) in {1, 2, 5}
    assert length <= step * 1.001 <= 2.51 * length
    assert page.evaluate(f"stepText(3 * {step}, {step})") == page.evaluate(
        f"stepText({3 * step!r}, {step})"
    )
    page.close()


def test_that_rounding_beside_the_numbers_of_its_unit_is_zero(open_page: Any) -> None:
    page = open_page("double_pendulum")
    page.get_by_role("tab", name="Numbers").click()
    for index in (0, 20, 77):
        page.evaluate(f"player.setIndex({index})")
        shown = page.locator("#panel-numbers table").first.locator("tbody td").all_inner_texts()
        exponents = [int(text.split("e")[1]) for text in shown if re.match(r"^-?[\d.]+e", text)]
        assert all(exponent > -8 for exponent in exponents)
    text = [page.evaluate(f"units.text({value}, 'm')") for value in ("-8.4e-20", "0", "NaN")]
    assert text == ["0", "0", "\N{EN DASH}"]
    page.close()


def test_that_degrees_are_shown_everywhere(open_page: Any, example_named: Any) -> None:
    page = open_page("four_bar")
    page.keyboard.press("d")
    solution = example_named("four_bar").solution
    np.testing.assert_allclose(
        page.evaluate("plots.list[0].y"), np.degrees(solution["phi_rocker"]), rtol=1e-12
    )
    assert page.evaluate("plots.list.map(plot => plot.labels[1])") == [
        "phi_rocker [deg]", "phi_rocker_dot [deg/s]", "phi_rocker_ddot [deg/s²]",
    ]  # fmt: skip
    page.get_by_role("tab", name="Numbers").click()
    row = page.locator("#panel-numbers tr", has=page.get_by_role("rowheader", name="phi_coupler"))
    unit, value, *_ = row.locator("td").all_inner_texts()
    assert unit == "deg"
    assert float(value) == pytest.approx(np.degrees(solution["phi_coupler"][0]), rel=1e-4)
    page.close()


def test_that_a_page_may_open_in_degrees(
    open_file: Any, example_named: Any, tmp_path: Path
) -> None:
    drawn = kc.page(example_named("four_bar").model, angle_unit="deg")
    page = open_file(drawn.write(tmp_path / "degrees.html"))
    assert page.evaluate("plots.list[0].labels[1]") == "phi_rocker [deg]"
    assert page.get_attribute("#angles", "aria-pressed") == "true"
    page.close()


def test_that_angles_among_parameters_are_typed_and_measured_in_degrees(open_page: Any) -> None:
    m = kc.Mechanism("swing", end=1.0, points=21)
    start, arm = m.parameter("start", 0.5, unit="rad"), m.body("arm", guess=(0, 0, 0.5))
    m.add(kc.Revolute("O", m.ground, (0, 0), arm, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", arm, start + sympy.sin(kc.t)))
    m.output("lean", arm.phi, "rad")
    page = open_page(m)
    assert page.get_by_label("start in rad").input_value() == "0.5"
    page.keyboard.press("d")
    box = page.get_by_label("start in deg")
    assert float(box.input_value()) == pytest.approx(np.degrees(0.5), rel=1e-5)
    box.fill("90")
    page.wait_for_function("Math.abs(player.state.q[2] - Math.PI / 2) < 1e-9")
    page.get_by_role("tab", name="Measures").click()
    shown = page.locator("#panel-measures tr").all_inner_texts()
    assert page.locator("#panel-measures caption").first.inner_text() == "lean [deg]"
    greatest = next(line for line in shown if line.startswith("max"))
    assert float(greatest.split()[1]) == pytest.approx(90 + np.degrees(np.sin(1)), abs=1e-3)
    page.close()


def test_that_plots_go_over_an_angle_are_zoomed_and_show_paths(open_page: Any) -> None:
    m = slider_crank()
    page = open_page(m)
    page.locator("#over").select_option("phi_crank")
    solution = kc.solve(kc.compile(m), np.linspace(0, m.end, m.points))
    np.testing.assert_allclose(page.evaluate("plots.list[0].x"), solution["phi_crank"], atol=1e-12)
    assert page.evaluate("plots.list[0].labels[0]") == "phi_crank [rad]"
    box = page.locator(".plot svg").first.bounding_box()
    left, right = page.evaluate("[plots.list[0].box.left, plots.list[0].box.right]")
    ends = [left + part * (right - left) for part in (0.25, 0.5)]
    page.mouse.move(box["x"] + ends[0], box["y"] + 30)
    page.mouse.down()
    page.mouse.move(box["x"] + ends[1], box["y"] + 40, steps=3)
    page.mouse.up()
    begin, length = solution["phi_crank"][0], np.ptp(solution["phi_crank"])
    found = page.evaluate("plots.list[1].xRange")
    np.testing.assert_allclose(found, begin + length * np.array((0.25, 0.5)), atol=0.05)
    page.get_by_role("button", name="All of the axis").click()
    np.testing.assert_allclose(page.evaluate("plots.list[1].xRange"), (begin, begin + length))
    page.get_by_label("What is plotted").first.select_option("path of B")
    x, y = page.evaluate("[plots.list[0].x, plots.list[0].y]")
    np.testing.assert_allclose(
        x, np.cos(0.3 + solution.t) + np.sqrt(9 - np.sin(0.3 + solution.t) ** 2)
    )
    np.testing.assert_allclose(y, 0, atol=1e-9)
    wide, tall = page.evaluate("""(() => {
      const { xRange: [a, b], yRange: [c, d], box } = plots.list[0];
      return [(box.right - box.left) / (b - a), (box.low - box.top) / (d - c)]; })()""")
    assert wide == pytest.approx(tall)  # lengths are true
    page.close()


def test_that_what_is_shown_is_saved(open_page: Any, tmp_path: Path) -> None:
    m = slider_crank()
    page = open_page(m)
    solution = kc.solve(kc.compile(m), np.linspace(0, m.end, m.points))
    page.get_by_label("What is plotted").first.select_option("x_block")
    page.evaluate("plots.zoom([1, 2])")
    files = {}
    for kind in ("CSV", "SVG", "PNG"):
        page.locator(".plot .menu summary").first.click()
        with page.expect_download() as download:
            page.locator(".plot .menu").first.get_by_role("button", name=kind).click()
        files[kind] = tmp_path / download.value.suggested_filename
        download.value.save_as(files[kind])
    assert {path.name for path in files.values()} == {
        f"crank_and_rod_x_block.{kind}" for kind in ("csv", "svg", "png")
    }
    heads, *rows = csv.reader(files["CSV"].read_text(encoding="utf-8").splitlines())
    assert heads == ["t [s]", "x_block [dm]"]
    seen = (solution.t >= 1) & (solution.t <= 2)
    expected = np.stack((solution.t[seen], solution["x_block"][seen]), axis=-1)
    np.testing.assert_allclose(np.array(rows, dtype=float), expected, rtol=1e-12)
    root = ET.parse(files["SVG"]).getroot()
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert "x_block [dm]" in "".join(root.itertext())
    assert files["PNG"].read_bytes()[:4] == b"\x89PNG"
    assert page.said == []
    page.close()


def test_that_the_page_fills_the_screen_with_large_type(open_page: Any) -> None:
    page = open_page("wrecker_boom")
    size = "parseFloat(getComputedStyle(document.body).fontSize)"
    before = page.evaluate(size)
    page.keyboard.press("f")
    page.wait_for_function(f"{size} > {before}")
    assert page.evaluate("stage.height > 0.7 * innerHeight")
    assert page.locator("#keys").is_hidden()
    assert page.evaluate(OVERFLOW) <= page.evaluate("innerWidth")
    page.keyboard.press("f")
    page.wait_for_function(f"{size} === {before}")
    page.close()


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", ["wrecker_boom", "jansen", "example_3_7_5"])
def test_that_every_width_is_filled_and_not_exceeded(open_page: Any, name: str, width: int) -> None:
    page = open_page(name, width)
    tabs = page.get_by_role("tab")
    for k in range(tabs.count()):
        if tabs.nth(k).is_visible():
            tabs.nth(k).click()
            assert page.evaluate(OVERFLOW) <= width
    main = page.locator("main").bounding_box()
    assert main["width"] > 0.93 * width
    if width == 390:
        assert page.evaluate(TOO_SMALL) == []
    assert page.said == []
    page.close()


def test_that_paper_is_light_and_has_no_buttons(open_page: Any) -> None:
    page = open_page("shaper", scheme="dark")
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.evaluate("stage.palette.isDark") is False
    for place in ("#play", "#tools", "#tabs", "#theme"):
        assert page.locator(place).is_hidden()
    assert page.locator("#canvas").is_visible()
    for k, value in enumerate(page.evaluate("player.data.parameters.map(({ value }) => value)")):
        box = page.locator(".sliders input[type=number]").nth(k)
        assert (box.is_visible(), float(box.input_value())) == (True, value)
    assert page.locator("#panel-measures td").first.is_visible()
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    page.emulate_media(media="screen")
    assert page.evaluate("stage.palette.isDark") is True
    page.close()


def test_that_everything_is_reached_by_the_tab_key(open_page: Any) -> None:
    page = open_page(slider_crank())
    wanted = {"angles", "project", "theme", "canvas", "closer", "wider", "fit", "play", "time"}
    wanted |= {"speed", "names", "grid", "measure", "poles", "tab-plots", "over", "another"}
    found = set()
    for _ in range(60):
        page.keyboard.press("Tab")
        found.add(page.evaluate("document.activeElement.id"))
    assert wanted <= found
    page.close()


def test_that_nothing_that_was_computed_outlives_a_motion(open_page: Any) -> None:
    m = slider_crank()
    page = open_page(m)
    page.get_by_label("What is plotted").first.select_option("path of B")
    # Twice the lengths of everything, as another set of parameters would give.
    page.evaluate("""(() => {
      for (const name of ['q', 'q_dot', 'q_ddot']) {
        const array = player.data.arrays[name];
        for (let k = 0; k < array.length; k++) if (k % 3 !== 2) array[k] *= 2;
      }
      player.kept = null;
      fitDrawing(player.data.drawing, player);
      player.motionChanged();
    })()""")
    far = 2 * block_pin()[0]
    assert page.evaluate("plots.list[0].x[0]") == pytest.approx(far, rel=1e-9)
    line = page.evaluate("""[...stage.paths].find(([point]) => point.name === 'B')[1].line[0]""")
    np.testing.assert_allclose(line, (far, 0), atol=1e-9)
    rail = page.evaluate("player.data.drawing.marks.find(mark => mark.kind === 'rail').reach")
    assert rail[1] == pytest.approx(2 * 4 + 3 * page.evaluate("player.data.drawing.size"), rel=1e-3)
    page.close()


def test_that_a_page_opens_on_the_slider_and_says_that_it_is_assembled_the_other_way(
    open_page: Any,
) -> None:
    """The crank's pin goes in a circle; B, drawn left of A C, comes out right of it."""
    page = open_page(slider_crank())
    assert page.evaluate("[...stage.traced].map(({ name }) => name)") == ["B"]
    assert page.locator("#message").is_hidden()
    page.close()
    s = kc.Sketch("mirrored", length_unit="mm", end=1.0, points=7)
    s.ground(O=(0, 0), C=(100, 0))
    s.joints(A=(44, 42), B=(174, -31))
    s.link("crank", "O A", s.length("r", 50))
    s.link("coupler", "A B", 125)
    s.link("rocker", "C B", 125)
    s.drive("crank", 2 * kc.pi * kc.t)
    page = open_page(s.mechanism())
    said = "(B is drawn left of the line A C, and found right of it)"
    assert said in page.locator("#message").inner_text()
    page.evaluate("live.set({ r: 51 })")
    page.wait_for_function("live.isChanged")
    assert page.locator("#message").is_hidden()
    assert page.locator("#live output").inner_text().count("is on another branch") == 1
    page.close()

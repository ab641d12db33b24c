"""The page of a mechanism in space in headless Chromium: how it is looked at, moved and solved."""

from typing import Any

import numpy as np
import pytest

import kincompile as kc
from tests.spatial_models import slider_crank

pytestmark = [pytest.mark.browser, pytest.mark.slow]

AXES_SEEN = "[stage.view.right, stage.view.up]"
VIEWS: dict[str, tuple[Any, Any]] = {
    "front": ([1, 0, 0], [0, 0, 1]),
    "side": ([0, 1, 0], [0, 0, 1]),
    "top": ([1, 0, 0], [0, 1, 0]),
    "isometric": (np.array([1, 1, 0]) / 2**0.5, np.array([-1, 1, 2]) / 6**0.5),
}
PIXELS = "stage.canvas.toDataURL()"


@pytest.fixture
def page(open_page: Any) -> Any:
    page = open_page(slider_crank())
    yield page
    assert page.said == []
    assert [url for url in page.asked if not url.startswith(("file:", "data:"))] == []
    page.close()


def middle(page: Any) -> tuple[float, float]:
    box = page.locator("#canvas").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


@pytest.mark.parametrize("width", [1280, 390])
def test_that_it_draws_and_fits(open_page: Any, width: int) -> None:
    page = open_page(slider_crank(), width)
    assert page.said == []
    first = page.evaluate(PIXELS)
    page.evaluate("player.setIndex(20)")
    assert page.evaluate(PIXELS) != first
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    # Every corner of what moves is on the canvas.
    places = np.array(
        page.evaluate("""boxOf(player.data.drawing.marks, player.states.map(s => s.q)).length
      && player.data.drawing.marks.flatMap(reachOf).flatMap(([frame, point]) =>
        player.states.map(({ q }) => stage.view.toScreen(inWorld(q, frame, point)).slice(0, 2)))""")
    )
    size = page.evaluate("[stage.width, stage.height]")
    assert (places >= 0).all()
    assert (places <= size).all()
    page.close()


def test_the_standard_views(page: Any) -> None:
    for number, (name, axes) in enumerate(VIEWS.items(), 1):
        page.click(f"#{name}")
        np.testing.assert_allclose(page.evaluate(AXES_SEEN), axes, atol=1e-15)
        page.evaluate("orbit.pan(30, 20)")
        page.keyboard.press(str(number))
        np.testing.assert_allclose(page.evaluate(AXES_SEEN), axes, atol=1e-15)


def test_that_the_plane_is_the_view_from_above(page: Any) -> None:
    page.click("#top")
    left, top, scale = page.evaluate("[stage.view.left, stage.view.top, stage.view.scale]")
    x, y, _ = page.evaluate("stage.view.centre")
    at = page.evaluate("stage.view.toScreen([0.1, 0.05, 0.3])")
    np.testing.assert_allclose(at[:2], (left + scale * (0.1 - x), top - scale * (0.05 - y)))


def test_orbit_pan_and_zoom_by_mouse_keys_and_wheel(page: Any) -> None:
    x, y = middle(page)
    corner = (x + 250, y - 200)  # beside the bodies

    def drag(**keys: Any) -> None:
        page.mouse.move(*corner)
        page.mouse.down(**keys)
        page.mouse.move(corner[0] - 60, corner[1] + 30, steps=3)
        page.mouse.up(**keys)

    before = page.evaluate("[orbit.azimuth, orbit.height]")
    drag()
    turned = page.evaluate("[orbit.azimuth, orbit.height]")
    np.testing.assert_allclose(np.subtract(turned, before), np.pi / 600 * np.array((60, 30)))
    assert page.evaluate("stage.camera") is None
    page.keyboard.down("Shift")
    drag()
    page.keyboard.up("Shift")
    assert page.evaluate("[orbit.azimuth, orbit.height]") == turned
    shift = page.evaluate("stage.view.toScreen(stage.camera.centre).slice(0, 2)")
    whole = page.evaluate("""(extent => stage.view.toScreen([0, 2, 4].map(
      k => (extent[k] + extent[k + 1]) / 2)).slice(0, 2))(player.data.extent)""")
    np.testing.assert_allclose(np.subtract(whole, shift), (-60, 30), atol=1e-9)
    page.click("#fit")
    drag(button="right")
    assert page.evaluate("[orbit.azimuth, orbit.height]") == turned
    assert page.evaluate("stage.camera") is not None
    page.mouse.move(*corner)
    at = page.evaluate("stage.view.toWorld([100, 80])")
    fit = page.evaluate("stage.view.scale")
    page.evaluate("stage.zoom(2, [100, 80])")
    assert page.evaluate("stage.view.scale") == pytest.approx(2 * fit)
    np.testing.assert_allclose(page.evaluate("stage.view.toWorld([100, 80])"), at, atol=1e-12)
    page.focus("#canvas")
    page.keyboard.press("Alt+ArrowLeft")
    assert page.evaluate("orbit.azimuth") < turned[0]


def test_perspective_makes_larger_what_is_nearer(page: Any) -> None:
    apart = """[0.05, 0, -0.05].map(depth => {
      const at = stage.view.centre.map((x, k) => x + depth * stage.view.back[k]);
      const [from, to] = [-0.01, 0.01].map(right =>
        stage.view.toScreen(at.map((x, k) => x + right * stage.view.right[k])));
      return to[0] - from[0]; })"""
    assert np.ptp(page.evaluate(apart)) < 1e-9
    page.keyboard.press("p")
    near, here, far = page.evaluate(apart)
    assert near > here > far
    assert here == pytest.approx(0.02 * page.evaluate("stage.view.scale"))
    for depth in (-0.05, 0, 0.05):
        at = page.evaluate(f"stage.view.toScreen(stage.view.toWorld([40, 90], {depth}))")
        np.testing.assert_allclose(at, (40, 90, depth), atol=1e-9)


def test_that_a_touch_turns_and_two_fingers_zoom(open_page: Any) -> None:
    page = open_page(slider_crank(), 390)
    before = page.evaluate("[orbit.azimuth, orbit.height]")
    send = """moves => { const { left, top } = stage.canvas.getBoundingClientRect();
      for (const [kind, pointerId, x, y, buttons] of moves) {
        stage.canvas.dispatchEvent(new PointerEvent(kind, { pointerId, pointerType: 'touch',
          clientX: x + left, clientY: y + top, buttons, bubbles: true }));
      } }"""
    page.evaluate(
        send,
        [
            ("pointerdown", 1, 330, 20, 1),
            ("pointermove", 1, 300, 40, 1),
            ("pointerup", 1, 300, 40, 0),
        ],
    )
    turned = page.evaluate("[orbit.azimuth, orbit.height]")
    np.testing.assert_allclose(np.subtract(turned, before), np.pi / 600 * np.array((30, 20)))
    scale = page.evaluate("stage.view.scale")
    page.evaluate(send, [
        ("pointerdown", 1, 330, 20, 1), ("pointerdown", 2, 330, 60, 1),
        ("pointermove", 2, 330, 100, 1),
        ("pointerup", 1, 330, 20, 0), ("pointerup", 2, 330, 100, 0),
    ])  # fmt: skip
    assert page.evaluate("stage.view.scale") == pytest.approx(2 * scale)
    assert page.evaluate("[orbit.azimuth, orbit.height]") == turned
    page.close()


def test_that_a_body_that_is_dragged_takes_time_with_it(page: Any) -> None:
    box = page.locator("#canvas").bounding_box()
    at = """q => stage.view.toScreen(
      inWorld(q, player.data.drawing.frames[1], [0, 0, 0])).slice(0, 2)"""
    x, y = page.evaluate(f"({at})(player.state.q)")
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.mouse.down()
    there = page.evaluate(f"({at})(player.solved(5).q)")
    page.mouse.move(box["x"] + there[0], box["y"] + there[1], steps=4)
    page.mouse.up()
    assert page.evaluate("player.state.index") in (4, 5, 6)


def test_that_parameters_are_solved_again_on_the_page(page: Any) -> None:
    page.evaluate("live.set({ r: 0.06 })")
    page.wait_for_function("live.isChanged")
    model = slider_crank()
    known = kc.solve(kc.compile(model), np.linspace(0, 1, 41), {"r": 0.06})
    q = np.array(page.evaluate("player.states.map(state => Array.from(state.q))"))
    np.testing.assert_allclose(q, known.q, atol=1e-9)
    drawn = kc.page(model, known).data["drawing"]
    hull = page.evaluate("player.data.drawing.marks.find(mark => mark.kind === 'hull').points")
    known_hull = next(mark for mark in drawn["marks"] if mark["kind"] == "hull")["points"]
    np.testing.assert_allclose(hull, known_hull, atol=1e-12)
    assert page.evaluate("player.data.drawing.size") == pytest.approx(drawn["size"], rel=1e-9)
    page.click("#keep")
    assert page.evaluate("settings.kept.length") == 1


def test_the_ghosts_of_newtons_iterates_and_a_guess_that_is_turned(page: Any) -> None:
    page.click("#tab-newton")
    first = page.evaluate(PIXELS)
    handle = page.locator(".newton-handles g").first
    handle.focus()
    before = np.array(page.evaluate("Array.from(player.data.guess)"))
    page.keyboard.press("+")
    page.keyboard.press("ArrowRight")
    assert page.evaluate(PIXELS) != first
    shown = page.locator("#panel-newton").inner_text()
    assert "x_crank" in shown
    assert before.shape == (21,)


def test_what_is_said_of_a_point_of_a_body_and_of_keys(page: Any) -> None:
    assert "turns the drawing, with Shift" in page.locator("#pointing").text_content()
    page.evaluate("stage.select(stage.points.find(point => point.name === 'tip'))")
    tip = page.locator("#tip").inner_text()
    assert "z = " in tip
    page.evaluate("stage.select(bodyTarget(player.data.drawing.frames[1]))")
    tip = page.locator("#tip").inner_text()
    assert "ω = (1.92" in tip

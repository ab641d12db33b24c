"""The editor in Chromium: drawn with a mouse, with keys and with fingers, saved, opened, undone."""

import json
from pathlib import Path

import numpy as np
import pytest

import kincompile as kc

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
FOUR_BAR = [[(200, 400), (250, 320)], [(250, 320), (480, 200)], [(480, 200), (500, 400)]]
"""Ends of a crank, a coupler and a rocker, in pixels of the board."""


@pytest.fixture(scope="module")
def open_editor(open_file, tmp_path_factory):
    """Return a function that opens the editor, empty or with a model."""
    folder = tmp_path_factory.mktemp("editor")

    def opened(model=None, width=1280, scheme="light"):
        path = folder / f"{'empty' if model is None else Path(model).stem}.html"
        if not path.exists():
            kc.editor(model).write(path)
        page = open_file(path, width, scheme)
        assert page.said == []
        return page

    return opened


def at(page, place):
    box = page.locator("#canvas").bounding_box()
    return box["x"] + place[0], box["y"] + place[1]


def pull(page, start, end):
    page.mouse.move(*at(page, start))
    page.mouse.down()
    page.mouse.move(*at(page, [(a + b) / 2 for a, b in zip(start, end, strict=True)]))
    page.mouse.move(*at(page, end))
    page.mouse.up()


def press(page, place):
    page.mouse.click(*at(page, place))


def drawn(page):
    return json.loads(page.evaluate("JSON.stringify(editing.file)"))["sketch"]


def saved(page, button, path):
    with page.expect_download() as waiting:
        page.click(button)
    waiting.value.save_as(path)
    return path


def require_name(page, name):
    """Wait for a model of a name; the page lets no text be evaluated, so that its box is asked."""
    sync_api = pytest.importorskip("playwright.sync_api")
    sync_api.expect(page.locator("#name")).to_have_value(name)


def draw_four_bar(page):
    for ends in FOUR_BAR:
        pull(page, *ends)
    page.keyboard.press("g")
    for joint in (FOUR_BAR[0][0], FOUR_BAR[2][1]):
        press(page, joint)
    page.keyboard.press("d")
    press(page, (228, 360))


def require_its_motion(page, model):
    """Compare the motion on the page with kincompile's of the saved model."""
    system = model.system()
    solution = kc.solve(kc.compile(model), np.linspace(0, system.end, system.points))
    assert solution.success
    for key in ("q", "q_dot", "q_ddot"):
        shown = np.array(page.evaluate(f"[...editing.motion.{key}]")).reshape(solution.q.shape)
        wanted = getattr(solution, key)
        scale = np.max(np.abs(wanted), axis=0, initial=1.0)
        np.testing.assert_allclose(shown / scale, wanted / scale, rtol=0, atol=1e-9)


def test_that_a_four_bar_is_drawn_saved_and_solved_with_equal_numbers(open_editor, tmp_path):
    page = open_editor()
    draw_four_bar(page)
    assert "nothing may move by itself" in page.inner_text("#findings")
    path = saved(page, "#toml", tmp_path / "drawn.toml")
    require_its_motion(page, kc.read(path))
    require_its_motion(page, kc.read_model(saved(page, "#python", tmp_path / "drawn.py")))
    # A joint that is pulled, and pulled back by undo.
    before = drawn(page)
    page.keyboard.press("v")
    pull(page, FOUR_BAR[1][1], (440, 240))
    after = drawn(page)
    assert after["joints"] != before["joints"]
    require_its_motion(page, kc.read(saved(page, "#toml", tmp_path / "pulled.toml")))
    page.keyboard.press("Control+z")
    assert drawn(page) == before
    page.keyboard.press("Control+Shift+z")
    assert drawn(page) == after
    for _ in range(20):
        page.keyboard.press("Control+z")
    assert drawn(page)["parts"] == []
    assert page.locator("#undo").is_disabled()
    assert page.said == []


def test_that_a_lever_is_drawn_with_keys_alone(open_editor):
    page = open_editor()
    page.focus("#canvas")
    for key in (*["ArrowLeft"] * 4, "Enter", *["ArrowRight"] * 3, "ArrowUp", "Enter", "g"):
        page.keyboard.press(key)
    for key in (*["ArrowLeft"] * 3, "ArrowDown", "Enter", "d", "Enter"):
        page.keyboard.press(key)
    sketch = drawn(page)
    assert [list(sketch["ground"]), list(sketch["joints"])] == [["A"], ["B"]]
    assert [next(iter(part)) for part in sketch["parts"]] == ["link", "drive"]
    assert page.evaluate("editing.motion.failed") is None
    # Joint B is taken up, moved and let go; Escape would have put it back.
    before = sketch["joints"]["B"]
    page.keyboard.press("v")
    for key in (*["ArrowRight"] * 3, "ArrowUp", "Enter", "ArrowUp", "ArrowUp", "Enter"):
        page.keyboard.press(key)
    moved = drawn(page)["joints"]["B"]
    assert moved[0] == pytest.approx(before[0])
    assert moved[1] > before[1]
    for key in ("Enter", "ArrowUp", "Escape"):
        page.keyboard.press(key)
    assert drawn(page)["joints"]["B"] == pytest.approx(moved)
    page.keyboard.press("Delete")
    assert drawn(page)["joints"] == {}
    page.keyboard.press(" ")
    assert page.said == []


def test_that_fingers_draw_and_zoom(open_editor):
    page = open_editor(width=390)
    page.click("button[data-tool=link]")
    sent = """([kind, touches]) => {
      const canvas = document.getElementById('canvas'), box = canvas.getBoundingClientRect();
      for (const [pointerId, x, y] of touches) canvas.dispatchEvent(new PointerEvent(kind, {
        pointerId, pointerType: 'touch', clientX: box.left + x, clientY: box.top + y, bubbles: true,
      }));
    }"""
    page.evaluate("HTMLCanvasElement.prototype.setPointerCapture = () => {}")
    for kind, place in (("down", (80, 200)), ("move", (160, 160)), ("up", (240, 120))):
        page.evaluate(sent, [f"pointer{kind}", [[1, *place]]])
    assert len(drawn(page)["parts"]) == 1
    assert page.evaluate("board.camera") is None
    page.evaluate(sent, ["pointerdown", [[1, 100, 100], [2, 200, 200]]])
    page.evaluate(sent, ["pointermove", [[2, 300, 300]]])
    page.evaluate(sent, ["pointerup", [[1, 100, 100], [2, 300, 300]]])
    assert page.evaluate("board.camera.zoom") == pytest.approx(2, rel=0.05)
    assert len(drawn(page)["parts"]) == 1
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_that_a_model_is_open_and_another_one_is_opened(open_editor, tmp_path):
    page = open_editor(ROOT / "examples" / "klann.toml")
    require_its_motion(page, kc.read(ROOT / "examples" / "klann.toml"))
    page.set_input_files("#file", ROOT / "examples" / "gear_train.toml")
    require_name(page, "gear_train")
    require_its_motion(page, kc.read(ROOT / "examples" / "gear_train.toml"))
    bad = tmp_path / "bad.toml"
    bad.write_text("kincompile = 1\nname = '<img src=x onerror=alert(1)>", encoding="utf-8")
    page.set_input_files("#file", bad)
    page.wait_for_selector("#message:not([hidden])")
    assert "Line 2" in page.inner_text("#message")
    assert page.evaluate("editing.file.name") == "gear_train"
    bad.write_text(
        'kincompile = 1\nname = "m"\nbodies = [{ name = "<img src=x onerror=alert(1)>" }]\n',
        encoding="utf-8",
    )
    page.set_input_files("#file", bad)
    require_name(page, "m")
    assert page.locator("#right img").count() == 0
    assert page.asked == [page.url]
    assert page.said == []


def test_that_a_lock_up_is_said(open_editor):
    """A rocker that is driven around is stopped where the links are in line."""
    page = open_editor()
    draw_four_bar(page)
    press(page, (228, 360))
    press(page, (490, 300))
    text = page.inner_text("#findings")
    assert "lock-up" in text.lower() or "locks" in text.lower() or "dead" in text.lower(), text
    assert page.evaluate("editing.event.kind") == "lock-up"


def test_that_every_tool_of_two_ends_and_the_law_of_a_driver_work(open_editor, tmp_path):
    page = open_editor()
    draw_four_bar(page)
    page.keyboard.press("l")
    pull(page, FOUR_BAR[1][1], (660, 300))
    page.keyboard.press("s")
    pull(page, (660, 300), (720, 300))
    page.keyboard.press("p")
    press(page, FOUR_BAR[1][1])
    page.select_option("select[aria-label='motion law of drive link1']", "cycloidal")
    sketch = drawn(page)
    assert [next(iter(part)) for part in sketch["parts"]][-2:] == ["slider", "point"]
    assert sketch["parts"][3]["value"]["law"] == "cycloidal"
    require_its_motion(page, kc.read(saved(page, "#toml", tmp_path / "slider.toml")))
    page.click("#assemblies")
    assert "assemblies" in page.inner_text("#assembled")
    require_its_motion(page, kc.read(saved(page, "#toml", tmp_path / "other.toml")))
    assert page.said == []

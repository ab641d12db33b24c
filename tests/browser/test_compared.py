"""Settings compared on a page in Chromium, and readouts that no model writes, against Python."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from tests.browser.test_live_page import SOLVED, crank_rocker

pytestmark = [pytest.mark.browser, pytest.mark.slow]

T = np.linspace(0, 2, 61)
COLUMN = "([label, place]) => columns.values(columns.find(label), settings.curves[place])"


def test_that_settings_are_kept_everywhere(open_page: Callable[..., Any]) -> None:
    model = crank_rocker("compared")
    page, module = open_page(model), kc.compile(model)
    values: list[dict[str, float]] = [{}, {"a": 0.7}, {"a": 1.2, "d": 3.2}]
    middle = """(() => {
      const rod = player.data.drawing.frames[1];
      const at = stage.view.toScreen(inWorld(player.state.q, rod, [1.5, 0.05]));
      const [x, y] = at.map(part => Math.round(devicePixelRatio * part));
      return [...stage.ctx.getImageData(x, y, 1, 1).data]; })()"""
    for setting in values[:2]:
        page.evaluate(SOLVED, setting)
        page.get_by_role("button", name="Keep to compare").click()
    page.evaluate(SOLVED, values[2])
    page.evaluate("player.setIndex(9)")
    # A name and a colour of its own in the list, in each plot, behind in the drawing.
    names = ["as made", "a = 0.7 m"]
    assert page.locator("#kept button[title^=Back]").all_inner_texts() == names
    colours = page.evaluate("[stage.palette.plot, ...settings.kept.map(x => settings.colourOf(x))]")
    assert len(set(colours)) == 3
    for svg in page.locator(".plot > svg").all():
        assert svg.locator("text.name").all_text_contents() == ["now", *names]
        drawn = svg.locator("path").evaluate_all("list => list.map(x => x.getAttribute('stroke'))")
        assert drawn == [*colours[1:], colours[0]]
    with_kept, inside = page.evaluate("stage.canvas.toDataURL()"), page.evaluate(middle)
    # The numbers are those of Python, path and plot too.
    for place, setting in enumerate(values[:2]):
        known = kc.solve(module, T, setting)
        for label in ("phi_rocker", "phi_rocker_ddot", "x_P"):
            np.testing.assert_allclose(
                page.evaluate(COLUMN, [label, place]), known[label], atol=1e-8
            )
        path = page.evaluate(f"settings.pathOf(settings.kept[{place}], [...stage.traced][0])")
        np.testing.assert_allclose(path, known.observed.y, atol=1e-9)
    assert page.evaluate("columns.values(columns.find('phi_rocker'))") == pytest.approx(
        kc.solve(module, T, values[2])["phi_rocker"].tolist(), abs=1e-9
    )
    page.get_by_role("tab", name="Measures").click()
    block = page.locator("#panel-measures table", has_text="y").filter(has_text="stroke").nth(1)
    strokes = block.locator("tr", has_text="stroke").locator("td").all_inner_texts()
    known = [kc.solve(module, T, values[k]).measures()["y_P"].stroke for k in (2, 0, 1)]
    assert [float(text) for text in strokes] == pytest.approx(known, rel=1e-5)
    # What is shown is in front of what is kept.
    for button in page.locator("#kept button[title^=Forget]").all()[::-1]:
        button.click()
    assert page.evaluate("stage.canvas.toDataURL()") != with_kept
    assert page.evaluate(middle) == inside
    assert [text for text in page.said if "Canvas2D" not in text] == []  # pixels are read
    page.close()


def test_that_a_family_of_curves_is_that_of_python(open_page: Callable[..., Any]) -> None:
    model = crank_rocker("family", range=(0.5, 1.1))
    page, module = open_page(model), kc.compile(model)
    page.get_by_label("Family over").select_option("0")
    page.get_by_label("Curves of the family").fill("4")
    page.get_by_label("Curves of the family").press("Tab")
    page.evaluate(SOLVED, {"d": 3.3})
    page.wait_for_function("settings.family.length === 4")
    for place, a in enumerate((0.5, 0.7, 0.9, 1.1)):
        known = kc.solve(module, T, {"a": a, "d": 3.3})
        np.testing.assert_allclose(
            page.evaluate(COLUMN, ["phi_rod_dot", place]), known["phi_rod_dot"], atol=1e-8
        )
    names = page.locator(".plot > svg").first.locator("text.name").all_text_contents()
    assert names == ["now", "a = 0.5 m", "a = 0.7 m", "a = 0.9 m", "a = 1.1 m"]
    assert page.locator(".plot > svg").first.locator("path.other").count() == 4
    assert page.evaluate("live.values") == [1, 3, 2.5, 3.3]
    page.get_by_label("Family over").select_option("")
    assert page.locator("path.other").count() == 0
    assert page.said == []
    page.close()


def test_that_a_slider_moves_by_itself(open_page: Callable[..., Any]) -> None:
    page = open_page(crank_rocker("swaying", range=(0.6, 1.1)))
    page.evaluate("window.seen = []; player.onMotion(() => seen.push(live.values[0]))")
    button = page.get_by_role("button", name="Move a back and forth")
    button.click()
    assert button.get_attribute("aria-pressed") == "true"
    page.wait_for_function(
        "Math.min(...seen) < 0.62 && Math.max(...seen) > 1.08 && seen.length > 10", timeout=20_000
    )
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    page.wait_for_function("live.frame === null")
    count = page.evaluate("seen.length")
    page.wait_for_timeout(300)
    assert page.evaluate("seen.length") == count
    assert page.evaluate("Math.min(...seen) >= 0.6 && Math.max(...seen) <= 1.1")
    assert re.search(r"#a=", page.url)
    page.close()


def test_that_four_bars_have_readouts_without_writing(open_page: Callable[..., Any]) -> None:
    model = crank_rocker("read")
    crank, rod, rocker = model.bodies
    first, second = model.point("E", rod, (0, 0)), model.point("F", rod, (3, 0))
    model.output("mu", kc.outputs.transmission_angle(first, second, (3.5, 0)), "rad")
    model.output("gain", kc.outputs.mechanical_advantage(rocker.phi, crank.phi), "")
    page, known = open_page(model), kc.solve(kc.compile(model), T)
    labels = ["transmission angle at B", "mechanical advantage of rocker"]
    for label, name in zip(labels, ("mu", "gain"), strict=True):
        found = page.evaluate("label => columns.values(columns.find(label))", label)
        np.testing.assert_allclose(found, known[name], rtol=1e-9)
    page.evaluate("player.setIndex(20)")
    page.get_by_role("tab", name="Numbers").click()
    row = page.locator("#panel-numbers tr", has_text=labels[0]).locator("td").all_inner_texts()
    assert row[0] == "rad"
    assert float(row[1]) == pytest.approx(known["mu"][20], rel=1e-5)
    page.close()


def test_that_arrows_stay_while_it_moves(open_page: Callable[..., Any]) -> None:
    page = open_page(crank_rocker("with_arrows"))
    page.evaluate("""window.lengths = () => {
      const found = [], own = arrow;
      arrow = (pen, [a, b], [x, y], colour) => found.push([colour, Math.hypot(x - a, y - b)]);
      stage.draw(player.state); arrow = own; return found; }""")
    assert page.evaluate("lengths()") == []
    for kind in ("velocities", "accelerations"):
        page.click(f"#{kind}")
        assert page.get_attribute(f"#{kind}", "aria-pressed") == "true"
    for index in (5, 40):
        page.evaluate("k => player.setIndex(k)", index)
        found, palette = page.evaluate("[lengths(), stage.palette]")
        # The pin A of the crank goes round with |v| = 3 a, and |a| = 9 a.
        most = {
            kind: page.evaluate(f"Math.max(...stage.points.map(p => greatestRates(p)['{kind}']))")
            for kind in ("velocity", "acceleration")
        }
        scale = page.evaluate("ARROW * Math.min(stage.width, stage.height)")
        for kind, rate in (("velocity", 3.0), ("acceleration", 9.0)):
            own = [length for colour, length in found if colour == palette[kind]]
            assert min(abs(length - scale * rate / most[kind]) for length in own) < 0.5
    page.close()

"""What is saved from a page in Chromium: pictures, numbers, the model, an address of the view."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import kincompile as kc
from tests.browser.test_live_page import SOLVED, crank_rocker

pytestmark = [pytest.mark.browser, pytest.mark.slow]

NUMBER_OF_WEBM = bytes.fromhex("1a45dfa3")


def saved(page: Any, kind: str, folder: Path) -> Path:
    """Press Save and a kind, and return the file."""
    if not page.evaluate("document.getElementById('taken').open"):
        page.locator("#taken summary").click()
    with page.expect_download() as waiting:
        page.locator("#taken").get_by_role("button", name=kind).click()
    path: Path = folder / waiting.value.suggested_filename
    waiting.value.save_as(path)
    return path


def test_that_pictures_numbers_and_the_model_are_saved(
    open_page: Callable[..., Any], tmp_path: Path
) -> None:
    model = crank_rocker("taken")
    page, values = open_page(model), {"a": 1.2, "d": 3.0}
    page.evaluate(SOLVED, values)
    page.evaluate("player.setIndex(7)")
    known = kc.solve(kc.compile(model), np.linspace(0, 2, 61), values)
    png = saved(page, "PNG", tmp_path).read_bytes()
    assert png[1:4] == b"PNG"
    drawn = ET.parse(saved(page, "SVG", tmp_path)).getroot()
    # The pin B is drawn where the page has it: the middle of a closed curve.
    at = page.evaluate("""(() => { const point = stage.points.find(({ name }) => name === 'B');
      return stage.view.toScreen(stage.where(point, player.state)); })()""")
    curves = [path.get("d", "") for path in drawn.iter() if path.get("d", "").endswith("Z")]
    middles = [np.mean(np.array(re.findall(r"[-\d.]+", way), float).reshape(-1, 2), 0)
               for way in curves if "a" not in way]  # fmt: skip
    assert min(np.hypot(*(middle - at)) for middle in middles) < 0.5
    assert len([x for x in drawn.iter() if x.tag.endswith("path")]) > 20
    heads, *rows = saved(page, "CSV", tmp_path).read_text().splitlines()
    table = np.array([[float(x or "nan") for x in row.split(",")] for row in rows])
    columns = dict(zip(heads.split(","), table.T, strict=True))
    for head, name in (("phi_rocker_ddot [rad/s²]", "phi_rocker_ddot"), ("x_P [m]", "x_P")):
        np.testing.assert_allclose(columns[head], known[name], atol=1e-8)
    again = kc.read(saved(page, "TOML", tmp_path))
    found = {item.name: item.default for item in again.system().parameters}
    assert found == {"a": 1.2, "b": 3.0, "c": 2.5, "d": 3.0}
    np.testing.assert_allclose(kc.solve(kc.compile(again), known.t).q, known.q, atol=1e-12)
    page.evaluate("player.setSpeed(1)")
    film = saved(page, "WebM", tmp_path).read_bytes()
    assert film[:4] == NUMBER_OF_WEBM
    assert len(film) > 3000
    assert page.said == []
    page.close()


VIEW = """[live.values, player.state.index, shownPanel, plots.list.map(plot => plot.choice.value),
  plots.range, stage.camera, [...stage.traced].map(({ name }) => name), stage.showsNames,
  units.angle, settings.kept.map(({ name, values }) => [name, values]), settings.over,
  settings.family.length, plots.choice.value, player.speed]"""


def test_that_an_address_carries_the_whole_view(open_page: Callable[..., Any]) -> None:
    page = open_page(crank_rocker("addressed"))
    page.click("#keep")
    page.evaluate(SOLVED, {"a": 1.25})
    page.click("#names")
    page.click("#angles")
    page.evaluate("""plots.remove(plots.list[0]), plots.add('phi_rod'),
      plots.choice.value = 'phi_crank', settings.choose(1, 3),
      stage.traced = new Set(stage.points.filter(({ name }) => name === 'B')),
      stage.zoom(2, [100, 100]), plots.zoom([0.5, 1.5]), player.setSpeed(0.5)""")
    page.get_by_role("tab", name="Measures").click()
    page.evaluate("player.setIndex(17)")
    shown, address = page.evaluate(VIEW), page.evaluate("taken.address()")
    assert shown[1:3] == [17, "measures"]
    page.goto("about:blank")
    page.goto(address)
    page.wait_for_function("shownPanel === 'measures' && player.state.index === 17")
    assert page.evaluate(VIEW) == shown
    # An address with nonsense shows what can be shown.
    page.goto("about:blank")
    page.goto(f"{address.split('#')[0]}#@t=x&@tab=none&@plots=a~b&@kept=1~2 3&@camera=0~1&@on=<b>")
    page.wait_for_timeout(300)
    assert page.evaluate("[shownPanel, plots.list.length, settings.kept.length]") == ["plots", 3, 0]
    assert page.said == []
    page.close()

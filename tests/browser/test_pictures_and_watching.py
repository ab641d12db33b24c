"""In Chromium: an SVG in motion is where the solution is, and a watched page follows its model."""

from pathlib import Path

import numpy as np
import pytest

import kincompile as kc
from kincompile.cli.serve import LivePage, served

pytestmark = [pytest.mark.browser, pytest.mark.slow]

PLACES = """seconds => {
  const svg = document.documentElement;
  svg.pauseAnimations();
  svg.setCurrentTime(seconds);
  return [...document.querySelectorAll('.moving path.s-ink.f-ink')].map(dot => {
    const box = dot.getBBox(), matrix = dot.getCTM();
    const middle = new DOMPoint(box.x + box.width / 2, box.y + box.height / 2);
    const { x, y } = middle.matrixTransform(matrix);
    return [x, y];
  });
}"""

LOOK = """() => {
  const shown = kind => getComputedStyle(document.querySelector(`.${kind}`)).display;
  return [getComputedStyle(document.querySelector('rect')).fill, shown('moving'), shown('still')];
}"""


@pytest.fixture
def arm():
    """An arm of 2 m about the origin, turned by t^2."""
    m = kc.Mechanism("arm")
    bar = m.body("bar", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, kc.t**2))
    m.point("tip", bar, (1, 0))
    m.point("hub", bar, (-1, 0))
    return m


def test_that_an_svg_moves_as_the_solution(arm, open_file, tmp_path):
    solution = kc.solve(kc.compile(arm), np.linspace(0, 2, 41))
    shown = open_file(kc.animate(solution, tmp_path / "arm.svg", seconds=4))
    first = np.array(shown.evaluate(PLACES, 0))
    scale = (first[0, 0] - first[1, 0]) / 2
    for t in solution.t[:-1]:
        tip, hub = np.array(shown.evaluate(PLACES, 2 * float(t)))
        np.testing.assert_allclose(hub, first[1], atol=0.05)
        wanted = 2 * scale * np.array((np.cos(t**2), -np.sin(t**2)))
        np.testing.assert_allclose(tip - hub, wanted, atol=0.1)
    assert shown.said == []
    assert shown.asked == [Path(tmp_path / "arm.svg").as_uri()]


def test_that_an_svg_follows_its_reader(arm, open_file, tmp_path):
    solution = kc.solve(kc.compile(arm), [0.0, 0.5, 1.0])
    path = kc.animate(solution, tmp_path / "arm.svg")
    assert open_file(path).evaluate(LOOK) == ["rgb(255, 255, 255)", "inline", "none"]
    dark = open_file(path, scheme="dark")
    assert dark.evaluate(LOOK) == ["rgb(20, 24, 31)", "inline", "none"]
    dark.emulate_media(reduced_motion="reduce")
    assert dark.evaluate(LOOK)[1:] == ["none", "inline"]


def test_that_a_watched_page_follows_its_model(arm, open_file, tmp_path):
    live = LivePage("arm.py")
    with served(live) as address:
        (tmp_path / "blank.html").write_text("<title>blank</title>", encoding="utf-8")
        shown = open_file(tmp_path / "blank.html")
        shown.goto(address)
        assert "No page of this model" in shown.inner_text("body")
        live.fail("Error: no <b>model</b>\nline 2")
        shown.wait_for_function("!document.getElementById('watched').hidden")
        live.show(kc.page(arm, t=[0.0, 0.5, 1.0]).html)
        shown.wait_for_function("document.title === 'arm' && !window.stays")
        assert shown.locator("#watched").is_hidden()
        shown.evaluate("window.stays = true; player.setTime(0.5)")
        live.fail("Error: no <b>model</b>\nline 2")
        shown.wait_for_function("!document.getElementById('watched').hidden")
        assert shown.inner_text("#watched") == "Error: no <b>model</b>\nline 2"
        assert shown.locator("canvas").first.is_visible()
        assert shown.evaluate("window.stays")  # the last good page is still the same
        live.show(kc.page(arm, t=[0.0, 0.5, 2.0]).html)
        shown.wait_for_function("document.title === 'arm' && !window.stays")
        assert shown.locator("#watched").is_hidden()
        assert shown.evaluate("player.state.time") == 0.5
        assert shown.said == []
        assert {url.removeprefix(address) for url in shown.asked[1:]} <= {"", "events", "data:,"}
    shown.wait_for_function("!document.getElementById('watched').hidden")
    assert "has ended" in shown.inner_text("#watched")

"""Joints that are pulled on a page in Chromium: what follows, against Python."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile import spatial
from tests.browser.test_live_page import crank_rocker, solved_again
from tests.browser.test_pulled_and_reset import FRAME, SEEN

pytestmark = [pytest.mark.browser, pytest.mark.slow]

FOUND = "name => hands.list.find(hand => hand.name === name)"
PLACE = f"name => {{ const hand = ({FOUND})(name); return Array.from(hands.where(hand)); }}"
ON_SCREEN = f"name => Array.from(stage.view.toScreen(hands.where(({FOUND})(name)))).slice(0, 2)"
SCALE = "stage.view.scale"
VALUES = "Object.fromEntries(live.names.map((name, k) => [name, live.values[k]]))"
UNITS = {"length_unit": "cm", "end": 1.0, "points": 41}


def four_bar(**at: tuple[float, float]) -> kc.Mechanism:
    """Return a four-bar as it is drawn at t = 0; some joints may be elsewhere."""
    s = kc.Sketch("drawn", live=True, **UNITS)
    s.ground(O=at.get("O", (0, 0)), C=at.get("C", (4, 0)))
    s.joints(A=at.get("A", (1.1, 0.2)), B=at.get("B", (3, 2.9)), P=at.get("P", (1.5, 3)))
    s.link("crank", "O A")
    s.link("coupler", "A B P")
    s.link("rocker", "C B")
    s.drive("crank", math.atan2(0.2, 1.1) + 2 * kc.pi * kc.t)
    return s.mechanism()


def excavator() -> kc.Mechanism:
    s = kc.Sketch("excavator", live=True, points=41)
    s.ground(O=(0, 1.8), Q=(0.6, 1.2))
    s.joints(R=(1.6, 3.0), S=(1.9, 3.6), T=(4.5, 3.2), U=(4.0, 4.0), Tip=(5.4, 0.1))
    s.link("boom", "O R S T")
    s.link("stick", "U T Tip")
    s.drive("Q R", math.dist((0.6, 1.2), (1.6, 3.0)) + 0.1 * kc.t)
    s.drive("S U", math.dist((1.9, 3.6), (4.0, 4.0)) + 0.1 * kc.t)
    return s.mechanism()


def swing() -> spatial.Mechanism:
    s = spatial.Sketch("swing", live=True, points=41)
    s.ground(A=(0, 0, 1), B=(0, 0.5, 1.1))
    s.joints(C=(1, 0.3, 0.9), E=(1.1, 0.9, 0.4))
    s.link("arm", "A B C")
    s.slider("block", "E", along=(0, 1, 0))
    s.rod("rod", "C E")
    s.drive("arm", 0.3 * kc.t)
    return s.mechanism()


@pytest.fixture(scope="module")
def opened(open_page: Callable[..., Any]) -> Iterator[Callable[..., Any]]:
    """Return a function that opens a page once, and gives it as it was made."""
    pages: dict[tuple[str, int], Any] = {}

    def once(model: kc.Mechanism, width: int = 1280) -> Any:
        page = pages.setdefault((model.name, width), None) or open_page(model, width)
        pages[model.name, width] = page
        page.evaluate(f"() => {{ live.reset(); player.setIndex(0); return {FRAME}; }}")
        return page

    yield once
    for page in pages.values():
        assert page.said == []
        page.close()


def seen(page: Any) -> str:
    """Return what is drawn, without what is pointed at."""
    page.mouse.move(2, 2)
    page.evaluate(FRAME)
    drawn: str = page.evaluate(SEEN)
    return drawn


def held(page: Any, name: str, right: float, up: float, steps: int = 8) -> list[float]:
    """Pull a joint by pixels, and return where it is in the world before it is let go."""
    box = page.locator("#canvas").bounding_box()
    x, y = page.evaluate(ON_SCREEN, name)
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.mouse.down()
    page.mouse.move(box["x"] + x + right, box["y"] + y - up, steps=steps)
    page.evaluate(FRAME)
    where: list[float] = page.evaluate(PLACE, name)
    return where


def let_go(page: Any) -> dict[str, float]:
    page.mouse.up()
    page.evaluate(FRAME)
    found: dict[str, float] = page.evaluate(VALUES)
    return found


def copied(page: Any, kind: str, folder: Path) -> Any:
    text = page.evaluate("kind => taken.setting(kind)", kind)
    if kind != "TOML":
        return text
    path = folder / "copied.toml"
    path.write_text(text)
    return kc.read(path)


PULLED = [(four_bar, "C"), (four_bar, "B"), (excavator, "Q"), (excavator, "T"), (swing, "B")]


@pytest.mark.parametrize(("made", "name"), PULLED)
def test_that_a_joint_follows_the_hand_and_all_numbers_follow_it(
    opened: Callable[..., Any], tmp_path: Path, made: Callable[[], Any], name: str
) -> None:
    model = made()
    page = opened(model)
    first, start, scale = seen(page), page.evaluate(PLACE, name), page.evaluate(SCALE)
    there = held(page, name, 22, 13)
    assert math.dist(there, start) * scale == pytest.approx(math.hypot(22, 13), abs=0.5)
    if len(there) == 2:
        assert (np.array(there) - start) * scale == pytest.approx((22, 13), abs=0.5)
    values = let_go(page)
    own = {key for key in values if key.startswith(f"{name}_")}
    defaults = {item.name: item.default for item in model.parameters}
    assert {key for key in values if values[key] != defaults[key]} <= own
    solution = solved_again(page, copied(page, "TOML", tmp_path), {})
    again = solved_again(page, model, values)
    np.testing.assert_allclose(solution.q, again.q, atol=1e-12)
    text = copied(page, "Python", tmp_path)
    drawn: dict[str, Any] = {}

    class Noted:
        def ground(self, **places: Any) -> None:
            drawn.update(places)

        joints = ground

    said: dict[str, Any] = {"s": Noted()}
    exec(text, said)
    assert said["p"] == {key: values[key] for key in own if values[key] != defaults[key]}
    assert drawn == {name: tuple(values[f"{name}_{x}"] for x in "xyz"[: len(there)])}
    options = copied(page, "--set", tmp_path).split()
    assert options[::2] == ["--set"] * len(said["p"])
    assert dict(item.split("=") for item in options[1::2]) == {
        key: repr(value) if value % 1 else str(int(value)) for key, value in said["p"].items()
    }
    assert seen(page) != first
    page.click("#undo")
    page.evaluate(FRAME)
    assert seen(page) == first
    page.click("#redo")
    page.evaluate(FRAME)
    assert page.evaluate(VALUES) == values
    page.click("#undo")


def test_that_it_is_the_mechanism_that_is_drawn_there(opened: Callable[..., Any]) -> None:
    page = opened(four_bar())
    held(page, "C", 40, -31)
    values = let_go(page)
    drawn = four_bar(C=(values["C_x"], values["C_y"]))
    solved_again(page, drawn, {})


def test_that_lengths_follow_where_they_are_the_parameters(opened: Callable[..., Any]) -> None:
    """The joint B of rod and rocker: both change, the crank and the ground stay."""
    page = opened(crank_rocker("lengths"))
    page.evaluate("player.setIndex(23)")
    start = page.evaluate(PLACE, "B")
    there = held(page, "B", 15, 20)
    assert (np.array(there) - start) * page.evaluate(SCALE) == pytest.approx((15, 20), abs=0.5)
    values = let_go(page)
    assert (values["a"], values["d"]) == (1.0, 3.5)
    solved_again(page, crank_rocker("lengths"), values)
    # The crank's angle is driven: along it the pin follows, across it it cannot.
    page.evaluate("live.reset()")
    x, y = page.evaluate(PLACE, "A")
    far = np.array(held(page, "A", 30 * x, 30 * y)) - (x, y)
    assert far @ (-y, x) == pytest.approx(0, abs=1e-9)
    assert far @ (x, y) * page.evaluate(SCALE) == pytest.approx(30, abs=0.5)
    values = let_go(page)
    assert {
        key for key in values if key in "bcd" and values[key] != {"b": 3, "c": 2.5, "d": 3.5}[key]
    } == set()


def test_that_a_range_has_an_end(opened: Callable[..., Any]) -> None:
    page = opened(four_bar())
    held(page, "P", 3000, 10, steps=20)
    values, (low, high) = (
        let_go(page),
        page.evaluate("[player.data.parameters[8].low, player.data.parameters[8].high]"),
    )
    assert page.evaluate("live.names[8]") == "P_x"
    assert values["P_x"] == high > low
    solved_again(page, four_bar(), values)


def test_that_the_last_good_drawing_stays_where_none_can_be_assembled(
    opened: Callable[..., Any],
) -> None:
    """A crank and a block: the rod does not reach the block when the guide is far away."""
    m = kc.Mechanism("slider_crank", end=1.0, points=21)
    r, h = m.parameter("r", 1.0, "m", (0.5, 4)), m.parameter("h", 0.5, "m", (-6, 6))
    crank, rod = m.body("crank", (0, 0, 0.3)), m.body("rod", (1, 0.3, 0))
    block = m.body("block", (3, 0.5, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (r, 0), rod, (0, 0)))
    m.add(kc.Revolute("B", rod, (2, 0), block, (0, 0)))
    m.add(kc.Translational("guide", m.ground, (0, h), (1, 0), block, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 0.3 + kc.t))
    page = opened(m)
    first = seen(page)
    held(page, "B", 0, 2000, steps=12)
    assert page.evaluate("player.state.isFound")
    said = page.inner_text("#live output")
    assert said.startswith("B cannot be pulled there. slider_crank failed at t = 0")
    assert page.locator("#live output.failed").count() == 1
    values = let_go(page)
    assert 0.8 < values["h"] <= values["r"] * math.sin(0.3) + 2
    solved_again(page, m, values)
    page.keyboard.press("Control+z")
    page.evaluate(FRAME)
    assert seen(page) == first
    assert "failed" not in page.inner_text("#live output")


def test_that_values_snap(opened: Callable[..., Any]) -> None:
    page = opened(four_bar())
    step = page.evaluate("stepOfGrid()")
    page.keyboard.down("Shift")
    held(page, "C", 41, 27)
    page.keyboard.up("Shift")
    values = let_go(page)
    assert (values["C_x"], values["C_y"]) != (4.0, 0.0)
    for name in ("C_x", "C_y"):
        assert values[name] / step == pytest.approx(round(values[name] / step), abs=1e-9)
        assert values[name] == float(f"{values[name]:.3g}")
    page.click("#snap")
    held(page, "O", 13, 29)
    values = let_go(page)
    assert values["O_x"] / step == pytest.approx(round(values["O_x"] / step), abs=1e-9)
    page.locator("#live summary").click()
    page.locator("#slider-4").evaluate(
        "slider => { slider.value = 1.23456; slider.dispatchEvent(new Event('input')); }"
    )
    assert page.evaluate("live.values[4]") == pytest.approx(1.23, abs=0.021)
    page.evaluate(FRAME)
    assert len(repr(page.evaluate("live.values[4]"))) < 6
    page.click("#snap")
    page.locator("#live summary").click()


def test_that_keys_pull_a_joint_and_undo_it(opened: Callable[..., Any]) -> None:
    page = opened(four_bar())
    first = seen(page)
    page.get_by_role("button", name="Pull C with the arrows").focus()
    x = page.evaluate(VALUES)["C_x"]
    for key in ("ArrowRight", "ArrowRight", "ArrowUp", "Shift+ArrowUp"):
        page.keyboard.press(key)
    values = page.evaluate(VALUES)
    step = (values["C_x"] - x) / 2
    assert step > 0
    assert values["C_y"] == pytest.approx(11 * step)
    assert page.evaluate("player.state.index") == 0  # time does not follow these arrows
    assert page.evaluate("document.activeElement.ariaLabel").startswith("C at 4.")
    solved_again(page, four_bar(), values)
    for _ in range(4):
        page.keyboard.press("Control+z")
    page.evaluate(FRAME)
    assert seen(page) == first
    page.keyboard.press("Control+Shift+z")
    assert page.evaluate(VALUES)["C_x"] == pytest.approx(x + step)


def test_that_sliders_and_joints_have_one_history(opened: Callable[..., Any]) -> None:
    page = opened(crank_rocker("lengths"))
    first = seen(page)
    page.locator("#slider-1").press("PageUp")
    one = page.evaluate(VALUES)
    held(page, "C", 12, 0)
    two = let_go(page)
    assert one != two
    page.get_by_label("a in m").fill("1.1")
    page.keyboard.press("Tab")
    page.keyboard.press("Control+z")
    assert page.evaluate(VALUES) == two
    page.keyboard.press("Control+z")
    assert page.evaluate(VALUES) == one
    page.keyboard.press("Control+z")
    page.evaluate(FRAME)
    assert seen(page) == first
    page.keyboard.press("Control+y")
    assert page.evaluate(VALUES) == one
    assert page.locator("#redo").is_enabled()
    page.locator("#slider-1").press("PageDown")
    assert page.locator("#redo").is_disabled()  # another step: what was undone is gone


def test_that_a_click_is_a_click_and_a_body_still_takes_time_along(
    opened: Callable[..., Any],
) -> None:
    page = opened(four_bar())
    held(page, "B", 0, 0)
    let_go(page)
    assert page.evaluate("stage.selected?.name") == "B"
    assert page.evaluate("live.values.every((value, k) => value === live.given[k])")
    page.click("#pulling")
    held(page, "A", 0, 40)
    values = let_go(page)
    assert page.evaluate("player.state.index") > 0
    assert values["A_y"] == 0.2
    assert not page.locator("#hands").is_visible()
    page.click("#pulling")


def test_that_a_finger_pulls_a_joint(open_page: Callable[..., Any]) -> None:
    page = open_page(four_bar(), 390)
    page.locator("#canvas").scroll_into_view_if_needed()
    box = page.locator("#canvas").bounding_box()
    x, y = page.evaluate(ON_SCREEN, "C")
    finger = page.context.new_cdp_session(page)

    def touch(kind: str, *at: float) -> None:
        points = [{"x": box["x"] + at[0], "y": box["y"] + at[1]}] if at else []
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    scrolled = page.evaluate("scrollY")
    touch("touchStart", x + 9, y + 5)  # beside it
    for k in range(1, 6):
        touch("touchMove", x + 9 + 4 * k, y + 5 + 6 * k)
    page.evaluate(FRAME)
    there = page.evaluate(PLACE, "C")
    touch("touchEnd")
    page.evaluate(FRAME)
    values = page.evaluate(VALUES)
    assert (values["C_x"], values["C_y"]) == pytest.approx(there)
    assert values["C_x"] > 4.1
    assert values["C_y"] < -0.2
    assert page.evaluate("scrollY") == scrolled
    assert page.said == []
    page.close()

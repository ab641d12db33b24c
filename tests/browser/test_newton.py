"""Newton's panel of the page in headless Chromium: steps, guesses, numbers, keys, both widths."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.problem import iterate, problem

EXAMPLES = ("four_bar", "slider_crank", "wrecker_boom", "cam_flat_follower", "problem_3_5_6")
TIME = 0.3

pytestmark = [pytest.mark.browser, pytest.mark.slow]


@pytest.fixture(scope="module")
def open_panel(open_page: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that opens the page of a mechanism, or of an example, at Newton's panel."""

    def opened(model: Any, width: int = 1280, scheme: str = "light") -> Any:
        page = open_page(model, width, scheme)
        page.get_by_role("tab", name="Newton").click()
        return page

    return opened


def press(page: Any, name: str, times: int = 1) -> None:
    """Press one of the panel's buttons."""
    for _ in range(times):
        page.locator("#panel-newton").get_by_role("button", name=name, exact=True).click()


def to_the_end(page: Any) -> str:
    """Step until the method ends, and return the statement."""
    step = page.locator("[data-go=step]")
    while step.get_attribute("aria-disabled") == "false":
        step.click()
    return str(page.inner_text(".newton .statement"))


def type_guess(page: Any, names: tuple[str, ...], q: Any) -> None:
    """Type a guess into the fields, from each by the Tab key to the next."""
    page.get_by_label(f"Guess of {names[0]}", exact=True).focus()
    for value in q:
        page.keyboard.press("Control+A")
        page.keyboard.type(repr(float(value)))
        page.keyboard.press("Tab")


def guess_of(page: Any) -> np.ndarray:
    """Return the guess in the fields, nine digits of it."""
    fields = page.locator(".newton .coordinates input")
    return np.array([float(fields.nth(k).input_value()) for k in range(fields.count())])


@pytest.mark.parametrize("name", EXAMPLES)
def test_that_the_page_iterates_as_the_runtime_does(
    open_panel: Any, example_named: Any, name: str
) -> None:
    module = example_named(name).module
    page = open_panel(name)
    rng = np.random.default_rng(2)
    for spread in (0.0, 0.05, 0.2):
        guess = module.GUESS * (1 + spread * rng.uniform(-1, 1, module.GUESS.size))
        text = f"newton.iterate(emitted, {json.dumps(guess.tolist())}, {TIME}).iterates"
        found = page.evaluate(f"{text}.map(iterate => iterate.q)")
        points = iterate(
            problem(code_of(module), module.DEFAULTS, guess, TIME), TIME, guess, 1e-10, 25
        ).points
        np.testing.assert_allclose(found, [point.q for point in points], rtol=1e-9, atol=1e-9)
    page.close()


def test_that_steps_go_forth_and_back(open_panel: Any) -> None:
    page = open_panel("four_bar")
    rows = page.locator(".newton .iterations tbody tr")
    count = page.locator(".newton .count")
    assert (rows.count(), count.inner_text()) == (1, "the guess")
    press(page, "Step", 3)
    assert (rows.count(), count.inner_text()) == (4, "iterate 3")
    assert page.locator(".newton .residuals tbody tr").count() == 5  # a row a constraint
    assert page.inner_text(".newton .statement") == ""
    press(page, "Back")
    assert (rows.count(), count.inner_text()) == (3, "iterate 2")
    assert to_the_end(page) == "Converged in 6 iterations to the position of the motion."
    page.keyboard.press("Space")  # one step too many: neither an iterate nor the motion's play
    assert (rows.count(), page.evaluate("player.isPlaying")) == (7, False)
    press(page, "Reset")
    assert (rows.count(), count.inner_text()) == (1, "the guess")
    assert page.said == []
    page.close()


def test_that_a_run_goes_to_the_end_by_itself(open_panel: Any) -> None:
    page = open_panel("slider_crank")
    type_guess(page, ("phi_crank",), [1.0])
    press(page, "Run")
    assert page.locator("[data-go=run]").inner_text() == "Stop"
    page.get_by_text("Converged in ").wait_for()
    assert page.locator("[data-go=run]").inner_text() == "Run"
    page.close()


def test_that_corrections_and_residuals_are_those_of_the_runtime(
    open_panel: Any, example_named: Any
) -> None:
    module = example_named("four_bar").module
    page = open_panel("four_bar")
    to_the_end(page)
    guess = module.GUESS
    attempt = iterate(problem(code_of(module), module.DEFAULTS, guess, 0.0), 0.0, guess, 1e-10, 25)
    rows = page.locator(".newton .iterations tbody tr")
    for k, point in enumerate(attempt.points[:-1]):
        cells = rows.nth(k).locator("td").all_inner_texts()
        assert float(cells[4]) == pytest.approx(
            float(np.linalg.norm(point.Phi)), rel=0.01, abs=1e-13
        )
        assert float(cells[5]) == pytest.approx(np.linalg.det(point.Phi_q), rel=0.01)
        if 0 < k < 5:
            assert float(cells[1]) == pytest.approx(attempt.corrections[k - 1], rel=0.01)
    assert float(rows.nth(5).locator("td").nth(3).inner_text()) == pytest.approx(2, abs=0.4)
    page.close()


def test_that_a_typed_guess_leads_to_the_other_branch(open_panel: Any, example_named: Any) -> None:
    module = example_named("four_bar").module
    page = open_panel("four_bar")
    here, other = kc.assemblies(module, 0.0)[:2]
    type_guess(page, module.COORDINATES, other + 0.02)
    statement = to_the_end(page)
    assert "to the other branch: det \u03a6_q is " in statement
    shown = page.locator(".newton .coordinates tbody tr td:nth-child(3)").all_inner_texts()
    np.testing.assert_allclose([float(text) for text in shown], other, atol=2e-6)
    press(page, "of the model")
    assert "to the position of the motion" in to_the_end(page)
    assert not np.allclose(here, other)
    page.close()


def test_that_a_guess_that_is_no_number_is_marked(open_panel: Any) -> None:
    page = open_panel("four_bar")
    field = page.get_by_label("Guess of x_crank", exact=True)
    before = guess_of(page)
    field.fill("five")
    page.keyboard.press("Tab")
    assert field.get_attribute("aria-invalid") == "true"
    field.fill("\u22125")  # a minus as it is printed
    page.keyboard.press("Tab")
    assert field.get_attribute("aria-invalid") == "false"
    np.testing.assert_array_equal(guess_of(page), [-5, *before[1:]])
    page.close()


def test_that_a_body_is_dragged_and_turned(open_panel: Any) -> None:
    page = open_panel("four_bar")
    before = guess_of(page)
    press(page, "Step", 2)
    scale = page.evaluate("(stage.draw(player.state), stage.view.scale)")
    handle = page.locator(".newton-handles g").nth(2)  # the rocker
    box = handle.locator(".grip").first.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y - 20, steps=4)
    page.mouse.up()
    moved = guess_of(page) - before
    np.testing.assert_allclose(moved[6:8] * scale, (30, 20), atol=1e-4)
    np.testing.assert_array_equal(np.delete(moved, [6, 7]), 0)
    assert page.locator(".newton .count").inner_text() == "the guess"
    box = handle.locator(".turn").bounding_box()
    centre = handle.locator(".grip").first.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    a, b = centre["x"] + centre["width"] / 2, centre["y"] + centre["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(a - (y - b), b + (x - a), steps=6)  # a quarter turn, clockwise on the screen
    page.mouse.up()
    turned = guess_of(page) - before - moved
    # The browser keeps where the mouse is with 24 bits, at both ends of the turn.
    rounded = 2 * np.spacing(np.float32(max(x, y))) / np.hypot(x - a, y - b)
    np.testing.assert_allclose(turned, -np.eye(9)[8] * np.pi / 2, atol=float(rounded))
    page.close()


def test_that_a_finger_drags_a_body_and_not_the_page(open_panel: Any) -> None:
    page = open_panel("slider_crank", 390)
    before, scale = guess_of(page), page.evaluate("stage.view.scale")
    box = page.locator(".newton-handles g").nth(1).locator(".grip").first.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    fingers = page.context.new_cdp_session(page)
    for kind, dx, dy in (("Start", 0, 0), ("Move", 8, 12), ("Move", 16, 24), ("End", 0, 0)):
        points = [] if kind == "End" else [{"x": x + dx, "y": y + dy}]
        fingers.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": points})
    moved = guess_of(page) - before
    np.testing.assert_allclose(moved[3:5] * scale, (16, -24), atol=1e-4)
    assert page.evaluate("scrollY") == 0
    page.close()


def test_that_keys_move_a_body_and_not_the_time(open_panel: Any) -> None:
    page = open_panel("four_bar")
    before = guess_of(page)
    page.locator(".newton-handles g").first.focus()
    for key in ("ArrowRight", "ArrowUp", "+", "Shift+ArrowLeft"):
        page.keyboard.press(key)
    moved = guess_of(page) - before
    step = page.evaluate("stage.width / 60 / stage.view.scale")
    np.testing.assert_allclose(moved[:3], (0.9 * step, step, np.pi / 36), rtol=1e-6)
    assert page.evaluate("player.state.index") == 0
    page.close()


def test_that_the_grid_tells_every_entry(open_panel: Any, example_named: Any) -> None:
    module = example_named("wrecker_boom").module
    page = open_panel("wrecker_boom")
    expected = module.Phi_q(module.GUESS, 0.0)
    row, column = module.PATTERN[20]
    cell = page.locator(".newton .jacobian tbody tr").nth(row).locator("td").nth(column)
    cell.hover()
    name, value = page.inner_text(".newton .entry").split(" = ")
    assert name == f"\u2202 {module.EQUATIONS[row]} / \u2202 {module.COORDINATES[column]}"
    assert float(value) == pytest.approx(expected[row, column], rel=1e-12)
    colours = page.locator(".newton .jacobian td.negative").count()
    assert colours == np.count_nonzero(expected < 0)
    cell.focus()
    page.keyboard.press("ArrowDown")
    assert page.inner_text(".newton .entry").startswith(f"\u2202 {module.EQUATIONS[row + 1]} / ")
    page.close()


def test_that_the_guess_stays_when_the_time_changes(open_panel: Any, example_named: Any) -> None:
    module, solution = example_named("four_bar").module, example_named("four_bar").solution
    page = open_panel("four_bar")
    page.evaluate("player.setIndex(100)")
    np.testing.assert_allclose(guess_of(page), module.GUESS, rtol=1e-8)
    press(page, "of the motion")
    np.testing.assert_allclose(guess_of(page), solution.q[100], rtol=1e-8, atol=1e-8)
    assert to_the_end(page) == "Converged in 1 iteration to the position of the motion."
    page.close()


def test_that_a_random_guess_is_within_the_picture(open_panel: Any) -> None:
    page = open_panel("slot_follower")
    left, right, low, high = page.evaluate("player.data.extent")
    for _ in range(5):
        press(page, "at random")
        guess = guess_of(page)
        assert np.all((left <= guess[[0, 3]]) & (guess[[0, 3]] <= right))
        assert np.all((low <= guess[[1, 4]]) & (guess[[1, 4]] <= high))
        assert to_the_end(page)
    assert page.said == []
    page.close()


def test_that_ghosts_are_beside_their_panel_only(open_panel: Any) -> None:
    page = open_panel("four_bar")
    layer = page.locator(".newton-handles")
    assert layer.is_visible()
    page.get_by_role("tab", name="Plots").click()
    assert not layer.is_visible()
    page.evaluate("player.setIndex(100)")
    page.get_by_role("tab", name="Newton").click()
    assert layer.is_visible()
    press(page, "of the motion")
    assert to_the_end(page) == "Converged in 1 iteration to the position of the motion."
    press(page, "Reset")
    page.evaluate("player.play()")
    layer.wait_for(state="hidden")
    page.evaluate("player.pause()")
    layer.wait_for()
    page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("name", EXAMPLES)
def test_that_nothing_is_wider_than_the_page(
    open_panel: Any, name: str, width: int, scheme: str
) -> None:
    page = open_panel(name, width, scheme)
    to_the_end(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.said == []
    page.close()


def test_that_equations_without_bodies_have_no_handles(open_panel: Any) -> None:
    page = open_panel("problem_3_5_6")
    assert page.locator(".newton-handles").count() == 0
    assert not page.locator(".newton .hint").is_visible()
    assert to_the_end(page).startswith("Converged in ")
    page.close()


def test_that_a_mechanism_that_does_not_assemble_shows_how_it_fails(open_panel: Any) -> None:
    m = kc.Mechanism("apart")
    crank, rod = m.body("crank", guess=(1, 0, 0)), m.body("rod", guess=(3, 1, 0.3))
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (-1, 0)))
    m.add(kc.Revolute("B", crank, (1, 0), rod, (-1, 0)))
    m.add(kc.AbsoluteY("C", rod, (1, 0), 9))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    page = open_panel(m)
    assert page.locator("[data-guess=motion]").is_disabled()
    assert to_the_end(page).startswith("No convergence in 25 iterations: ")
    assert page.said == []
    page.close()


def test_that_a_mechanism_without_functions_says_why(open_panel: Any) -> None:
    m = kc.Mechanism("loose")
    m.add(kc.AbsoluteAngle("motor", m.body("arm"), kc.t))
    page = open_panel(m)
    assert "Newton's method cannot be shown: " in page.inner_text("#panel-newton")
    page.close()

"""Parameters pulled on a page in Chromium: what is solved, drawn and said, against Python."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile.names import ROLES, TRIPLE
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.results.grashof import CHANGE, four_bar_types
from kincompile.view.drawing import drawing

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SOLVED = """values => new Promise(resolve => {
  player.onMotion(() => setTimeout(resolve));
  live.set(values);
})"""
"""Set values, and wait until they are solved with."""


@pytest.fixture(scope="module")
def open_page(
    open_file: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory, example_named: Any
) -> Callable[..., Any]:
    """Return a function that opens the page of a model, or of an example by name."""
    folder = tmp_path_factory.mktemp("pages")

    def opened(model: Any, width: int = 1280, fragment: str = "", **options: Any) -> Any:
        model = example_named(model).model if isinstance(model, str) else model
        path = folder / f"{model.name}.html"
        kc.page(model, **options).write(path)
        page = open_file(path, width)
        if fragment:
            page.goto(f"{path.as_uri()}{fragment}")
            page.reload()
        return page

    return opened


def crank_rocker(name: str = "crank_rocker", **options: Any) -> kc.Mechanism:
    m = kc.Mechanism(name, end=2.0, points=61)
    a = m.parameter("a", 1.0, unit="m", **options)
    b, c, d = (m.parameter(key, value) for key, value in (("b", 3.0), ("c", 2.5), ("d", 3.5)))
    crank, rod, rocker = (
        m.body(key, guess=guess)
        for key, guess in (("crank", (0, 0, 0)), ("rod", (1, 0, 0.8)), ("rocker", (3.5, 0, 1.7)))
    )
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (a, 0), rod, (0, 0)))
    m.add(kc.Revolute("B", rod, (b, 0), rocker, (c, 0)))
    m.add(kc.Revolute("C", rocker, (0, 0), m.ground, (d, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 3 * kc.t))
    m.point("P", rod, (b / 2, 1))
    return m


def array(page: Any, name: str) -> np.ndarray:
    values = page.evaluate(
        f"Array.from(player.data.arrays.{name}, x => Number.isNaN(x) ? null : x)"
    )
    return np.array(values, dtype=float)


def solved_again(page: Any, model: Any, values: dict[str, float]) -> kc.Solution:
    """Compare a page whose values were set with Python; return the solution."""
    times = np.array(page.evaluate("Array.from(player.t)"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        solution = kc.solve(kc.compile(model), times, values)
    assert page.evaluate("player.data.status") == solution.status.tolist()
    for name in ("q", "q_dot", "q_ddot"):
        known = getattr(solution, name)
        scale = np.max(np.abs(known), where=np.isfinite(known), initial=0.0)
        np.testing.assert_allclose(
            array(page, name).reshape(known.shape), known, rtol=0, atol=1e-9 * scale
        )
    return solution


@pytest.mark.parametrize(
    "name", ["four_bar", "wrecker_boom", "jansen", "swing_and_dwell", "shaper"]
)
def test_that_sliders_solve_as_python_does(
    open_page: Callable[..., Any], example_named: Any, name: str
) -> None:
    model = example_named(name).model
    page = open_page(model)
    parameters = model.system().parameters
    first = parameters[0]
    page.locator("#slider-0").focus()
    for _ in range(7):
        page.keyboard.press("ArrowRight")
    page.wait_for_function("live.motion !== null && live.frame === null")
    value = page.evaluate("live.values[0]")
    assert value > first.default
    solution = solved_again(page, model, {first.name: value})
    if solution.observed.names:
        np.testing.assert_allclose(
            array(page, "y").reshape(solution.observed.y.shape), solution.observed.y, atol=1e-9
        )
    assert page.said == []
    assert [url for url in page.asked if not url.startswith("data:")] == [page.url.split("#")[0]]
    page.close()


def marks_of(data: dict[str, Any]) -> Any:
    """Return the numbers of marks by kind, hulls from their first corner on."""
    found = []
    for mark in data["marks"]:
        own = {k: v for k, v in mark.items() if k not in ("attached", "rho", "shape", "distances")}
        found.append(own)
    return found


def assert_alike(found: Any, known: Any, where: str = "") -> None:
    if isinstance(known, dict):
        assert found.keys() == known.keys(), where
        for key in known:
            assert_alike(found[key], known[key], f"{where}.{key}")
    elif isinstance(known, list | tuple):
        assert len(found) == len(known), where
        for k, (one, other) in enumerate(zip(found, known, strict=True)):
            assert_alike(one, other, f"{where}[{k}]")
    elif isinstance(known, float):
        assert found == pytest.approx(known, abs=1e-9), where
    else:
        assert found == known, where


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("four_bar", 1.2), ("jansen", 1.03), ("cam_flat_follower", 1.3), ("slot_follower", 0.8),
        ("gear_train", 1.2), ("rack_and_pinion", 0.7), ("double_wishbone", 1.02), ("shaper", 1.1),
        ("swing_and_dwell", 1.2), ("wrecker_boom", 1.05), ("cam_by_table", 1.2),
    ],
)  # fmt: skip
def test_that_the_drawing_is_that_of_the_new_lengths(
    open_page: Callable[..., Any], example_named: Any, name: str, factor: float
) -> None:
    model = example_named(name).model
    page = open_page(model)
    values = {item.name: item.default * factor for item in model.system().parameters}
    page.evaluate(SOLVED, values)
    solution = solved_again(page, model, values)
    known = drawing(model, values, solution.q)
    found = page.evaluate("player.data.drawing")
    assert_alike(marks_of(found), marks_of(known.to_json()))
    assert found["size"] == pytest.approx(known.size, rel=1e-9)
    low, high = known.extent(solution.q)[0], known.extent(solution.q)[3]
    extent = page.evaluate("player.data.extent")
    assert extent[0] <= low + 1e-9
    assert extent[3] >= high - 1e-9
    page.close()


def test_that_paths_plots_numbers_and_newton_follow(open_page: Callable[..., Any]) -> None:
    model = crank_rocker()
    page = open_page(model)
    page.evaluate(SOLVED, {"a": 1.2})
    page.evaluate("player.setIndex(20)")
    solution = solved_again(page, model, {"a": 1.2})
    path = page.evaluate("pathOf([...stage.traced][0]).line")
    np.testing.assert_allclose(path, solution.observed.y, atol=1e-9)
    assert page.evaluate("plots.list[0].choice.value") == "path of P"
    plotted = page.evaluate("[plots.list[0].x, plots.list[0].y]")
    np.testing.assert_allclose(np.transpose(plotted), solution.observed.y, atol=1e-9)
    page.get_by_role("tab", name="Numbers").click()
    row = page.locator("#panel-numbers tr", has_text="φrocker").locator("td").nth(1)
    assert float(row.inner_text()) == pytest.approx(solution["phi_rocker"][20], rel=1e-6)
    residual = array(page, "residual").reshape(61, -1)
    assert residual.max() < 1e-12
    np.testing.assert_allclose(array(page, "condition"), solution.condition, rtol=1e-6)
    page.get_by_role("tab", name="Newton").click()
    page.locator("[data-guess=motion]").click()
    page.wait_for_timeout(100)
    assert page.evaluate("emitted.Phi(player.state.q, player.state.time, live.values)") == (
        pytest.approx([0] * 9, abs=1e-12)
    )
    page.close()


def test_that_measures_are_those_of_python(open_page: Callable[..., Any]) -> None:
    model = crank_rocker("measured")
    crank, _, rocker = model.bodies
    model.output("gain", kc.outputs.mechanical_advantage(rocker.phi, crank.phi))  # it has poles
    model.output("ratio", kc.outputs.velocity_ratio(rocker.phi, crank.phi))
    page = open_page(model)
    page.get_by_role("tab", name="Measures").click()
    for values in ({}, {"a": 1.3, "d": 3.2}):
        if values:
            page.evaluate(SOLVED, values)
        known = kc.solve(kc.compile(model), np.linspace(0, 2, 61), values).measures()
        found = page.evaluate("measuresOf(live.motionNow())")
        pairs = {
            "least": "least", "tLeast": "t_least", "greatest": "greatest",
            "tGreatest": "t_greatest", "mean": "mean", "rms": "rms", "period": "period",
            "timeRatio": "time_ratio",
        }  # fmt: skip
        for own, output in zip(found, known.outputs, strict=True):
            for one, other in pairs.items():
                if output.name == "ratio" and one in ("mean", "rms"):
                    continue  # without an emitted second rate the page has none
                expected = getattr(output, other)
                close = (
                    pytest.approx(expected, rel=1e-9, abs=1e-9, nan_ok=True)
                    if expected is not None
                    else None
                )
                assert own[one] == close, one
            assert own["dead"] == pytest.approx(output.dead_points, abs=1e-9)
        shown = page.inner_text("#panel-measures")
        assert f"{known.outputs[0].least:.6g}" in shown
        assert "\u2212\u221e" in shown  # minus infinity
        motion = kc.solve(kc.compile(model), np.linspace(0, 2, 61), values)
        rests = page.evaluate(
            "measuresOf(live.motionNow()).map(({ name, rests }) => [name, ...rests(0.02)])"
        )
        for name, *times in rests:
            if name in ("gain", "ratio"):  # a pole; no emitted second rate
                continue
            stroke = known[name].stroke
            own = [motion.dwell(name, 0.02 * stroke, at).time for at in ("min", "max")]
            assert times == pytest.approx(own, rel=1e-6, abs=1e-9), name
        paths = page.evaluate(
            """(() => { const motion = live.motionNow();
            const names = player.data.outputs.map(x => x.name);
            const of = name => new OutputMotion(motion, names.indexOf(name));
            return names.filter(name => name.startsWith('x_')).map(name => [name.slice(2),
                pathMeasures(of(name), of(`y_${name.slice(2)}`), 0.3, 1.1)]); })()"""
        )
        assert paths
        for point, own in paths:
            line, circle = (f(point, (0.3, 1.1)) for f in (motion.straightness, motion.roundness))
            assert own["straight"] == pytest.approx(line.deviation, rel=1e-6, abs=1e-9)
            assert own["round"] == pytest.approx(circle.deviation, rel=1e-6, abs=1e-9)
            assert own["radius"] == pytest.approx(circle.radius, rel=1e-6)
            assert own["centre"] == pytest.approx(circle.place, rel=1e-6, abs=1e-8)
            assert f"{point} [" in shown
    page.close()


def test_that_grashof_types_follow_the_lengths(open_page: Callable[..., Any]) -> None:
    """As Python has them: all types, equal lengths, and lengths that cannot be assembled."""
    model = crank_rocker("typed")
    module, page, seen = kc.compile(model), open_page(model), set()
    page.get_by_role("tab", name="Measures").click()
    for a, b, c, d in (
        (1, 3, 2.5, 3.5), (3.2, 3, 1, 3.5), (3, 3.5, 3, 1), (3, 1, 3.5, 4), (2, 2.5, 3, 4),
        (2, 3, 3, 4), (2, 2, 2, 2), (1, 1, 1, 30),
    ):  # fmt: skip
        values = {"a": a, "b": b, "c": c, "d": d}
        page.evaluate(SOLVED, values)
        (known,) = four_bar_types(code_of(module), np.array([a, b, c, d], dtype=float))
        (found,) = page.evaluate("fourBarsOf()")
        assert found == {
            "name": " ".join(known.joints), "type": known.type, "shortest": known.shortest,
            "margin": pytest.approx(known.margin, abs=1e-12), "full": list(known.full),
        }  # fmt: skip
        shown = page.locator("#panel-measures table", has_text="Grashof type").inner_text()
        assert known.type in shown
        assert f"{known.margin:.6g}" in shown
        seen.add(known.type)
    assert seen == {*ROLES, TRIPLE, CHANGE}
    page.evaluate(SOLVED, {"a": 0.0})  # a link without length is none
    assert page.evaluate("fourBarsOf()") == []
    page.close()


def test_that_a_lock_up_is_shown_in_the_words_of_the_solver(open_page: Callable[..., Any]) -> None:
    model = crank_rocker("locking")
    page = open_page(model)
    values = {"a": 2.4}  # no crank turns around
    page.evaluate(SOLVED, values)
    solution = solved_again(page, model, values)
    assert solution.events[-1].kind == "lock-up"
    first = int(np.argmax(solution.status != 0))
    assert 0 < first < 61
    event = page.evaluate("player.data.events[0]")
    assert event["t"] == pytest.approx(solution.events[-1].t, rel=1e-9)
    assert event["bodies"] == list(solution.events[-1].bodies)
    cut = event["message"].split(": ", 1)[1]
    assert cut == solution.events[-1].message.split(": ", 1)[1]
    said = page.inner_text("#live output")
    assert said.startswith("locking failed at t = ")
    assert cut in said
    # What there is of the motion is drawn, and what is missing marked.
    page.evaluate("player.setIndex(0)")
    assert page.evaluate("document.getElementById('note').hidden")
    page.evaluate("player.setIndex(60)")
    assert "Shown is the last position that was found." in page.inner_text("#note")
    assert page.locator("#marks .failed").count() == 1
    page.close()


def test_that_a_lock_up_is_one_as_soon_as_it_is_shown(open_page: Callable[..., Any]) -> None:
    page = open_page(crank_rocker("at_once"))
    seen = page.evaluate(
        """values => new Promise(resolve => {
          player.onMotion(() => resolve([player.data.status, player.data.events.length]));
          live.set(values);
        })""",
        {"a": 2.4},
    )
    assert set(seen[0]) == {0, 4, 7}  # converged, not reached, the lock-up
    assert seen[1] == 1
    page.close()


def test_that_lengths_that_fit_nowhere_show_the_guess(open_page: Callable[..., Any]) -> None:
    model = crank_rocker("apart")
    page = open_page(model)
    page.evaluate(SOLVED, {"d": 8.0})
    assert set(page.evaluate("player.data.status")) == {4, 6}
    assert "No position was found: the mechanism cannot be assembled" in page.inner_text("#live")
    assert "Shown is the start guess" in page.inner_text("#note")
    broken = page.evaluate("[...violatedJoints()]")
    assert "B" in broken
    page.get_by_role("button", name="Reset").click()
    page.wait_for_function("player.data.success")
    solved_again(page, model, {})
    assert page.said == []
    page.close()


def rod(name: str = "rod", *, range_: Any = None) -> kc.Mechanism:
    m = kc.Mechanism(name, end=1.0, points=21)
    length = m.parameter("length", 2.0, unit="m", range=range_)
    bob, far = m.body("bob", guess=(1, 0, 0)), m.body("far", guess=(3, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bob, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", bob, kc.t))
    m.add(kc.Distance("tie", bob, (0, 0), far, (0, 0), length))
    m.add(kc.AbsoluteAngle("still", far, 0))
    m.add(kc.AbsoluteY("level", far, (0, 0), 0))
    return m


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_that_a_length_of_zero_or_less_is_named(
    open_page: Callable[..., Any], value: float
) -> None:
    page = open_page(rod())
    box = page.get_by_label("length in m")
    box.fill(str(value))
    page.wait_for_function(f"live.values[0] === {value} && live.frame === null")
    said = page.inner_text("#live output")
    assert said.startswith(f"tie: the distance is {value:g}, but must be positive.")
    box.fill("")
    box.press_sequentially("x1e")
    assert page.evaluate("live.values[0]") in (value, 1)
    assert page.said == []
    page.close()


def test_that_the_ends_of_sliders_are_those_of_the_model(open_page: Callable[..., Any]) -> None:
    page = open_page(rod("with_range", range_=(1.9, 2.5)))
    slider = page.locator("#slider-0")
    assert (slider.get_attribute("min"), slider.get_attribute("max")) == ("1.9", "2.5")
    slider.press("End")
    page.wait_for_function("live.values[0] === 2.5")
    page.close()
    page = open_page(rod("without_range"))
    slider = page.locator("#slider-0")
    assert (slider.get_attribute("min"), slider.get_attribute("max")) == ("1", "4")
    page.close()


def test_that_a_link_carries_the_values(open_page: Callable[..., Any]) -> None:
    page = open_page(crank_rocker("linked"))
    page.get_by_label("a in m").fill("1.25")
    page.get_by_label("a in m").press("Tab")
    page.wait_for_function("live.values[0] === 1.25 && location.hash === '#a=1.25'")
    assert page.evaluate("taken.setting('--set')") == "--set a=1.25"
    url = page.url
    page.get_by_role("button", name="Reset").click()
    page.wait_for_function("live.values[0] === 1 && location.hash === ''")
    page.goto("about:blank")
    page.goto(url)
    page.wait_for_function("live.motion !== null")
    assert page.evaluate("live.values") == [1.25, 3, 2.5, 3.5]
    page.goto("about:blank")
    page.goto(f"{url.split('#')[0]}#nothing=3&a=much&b=&<img src=x>=1")
    page.wait_for_timeout(200)
    assert page.evaluate("live.values") == [1, 3, 2.5, 3.5]
    assert page.said == []
    page.close()


def test_that_a_motion_is_kept_to_compare_with(open_page: Callable[..., Any]) -> None:
    page = open_page(crank_rocker("kept"))
    page.get_by_role("button", name="Keep to compare").click()
    kept = page.evaluate("Array.from(settings.kept[0].arrays.q)")
    page.evaluate(SOLVED, {"a": 0.7})
    assert page.evaluate("Array.from(settings.kept[0].arrays.q)") == kept
    assert page.evaluate("Array.from(player.data.arrays.q)") != kept
    picture = "stage.canvas.toDataURL()"
    together = page.evaluate(picture)
    page.get_by_role("button", name="Forget as made").click()
    assert page.evaluate(picture) != together
    page.close()


def test_that_a_body_is_dragged_through_its_motion(open_page: Callable[..., Any]) -> None:
    page = open_page(crank_rocker("dragged"))
    page.evaluate("player.setIndex(10)")

    def tip(index: int) -> Any:
        """Return where the middle of the crank is on the screen at a time."""
        text = f"""(() => {{
          const q = player.solved({index}).q, box = stage.canvas.getBoundingClientRect();
          const [x, y] = stage.view.toScreen(inWorld(q, player.data.drawing.frames[0], [0.5, 0]));
          return [box.left + x, box.top + y];
        }})()"""
        return page.evaluate(text)

    page.mouse.move(*tip(10))
    page.mouse.down()
    for index in range(11, 36):
        page.mouse.move(*tip(index))
    assert page.evaluate("player.state.time") == pytest.approx(35 * 2 / 60, abs=0.01)
    for index in range(35, 4, -1):
        page.mouse.move(*tip(index))
    page.mouse.up()
    assert page.evaluate("player.state.index") == 5
    assert page.evaluate("stage.selected") is None
    page.mouse.click(*tip(5))
    assert page.evaluate("player.state.index") == 5
    page.close()


def test_that_a_mechanism_that_is_too_large_says_so(open_page: Callable[..., Any]) -> None:
    m = kc.Mechanism("too_large", end=1.0, points=3)
    a, before, at = m.parameter("a", 1.0), m.ground, (0, 0)
    for k in range(51):
        link = m.body(f"link_{k}", guess=(k + 1, 0, 0))
        m.add(kc.Revolute(f"joint_{k}", before, at, link, (-a, 0)))
        m.add(kc.AbsoluteAngle(f"motor_{k}", link, kc.t * (k + 1) / 51))
        before, at = link, (0, 0)
    page = open_page(m)
    said = page.inner_text("#live")
    assert (
        "This page cannot solve for other values: 153 coordinates are too many for a page." in said
    )
    assert "a = 1" in said
    assert page.locator("#live input").count() == 0
    assert page.evaluate("hasMotion()")
    assert page.said == []
    page.close()


@pytest.mark.parametrize("width", [390, 1280, 1920])
@pytest.mark.parametrize("name", ["jansen", "wrecker_boom"])
def test_that_sliders_fit_and_can_be_touched(
    open_page: Callable[..., Any], name: str, width: int
) -> None:
    page = open_page(name, width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    heights = page.evaluate(
        "[...document.querySelectorAll('#live :is(input, button)')]"
        ".map(element => element.getBoundingClientRect().height)"
    )
    assert min(heights) >= (44 if width == 390 else 24)
    names = page.evaluate(
        "[...document.querySelectorAll('#live input')]"
        ".map(element => element.ariaLabel || element.labels[0]?.textContent || '')"
    )
    assert all(names)
    # Nothing moves under the pointer when there is something to say.
    place = "document.getElementById('slider-0').getBoundingClientRect().top"
    before = page.evaluate(place)
    values = page.evaluate(
        "Object.fromEntries(live.names.map((name, k) => [name, 2 * live.values[k]]))"
    )
    values[next(iter(values))] /= 1.7
    page.evaluate(SOLVED, values)
    assert page.evaluate(place) == pytest.approx(before, abs=1)
    page.close()


def test_that_the_page_of_the_wrecker_boom_is_small(example_named: Any) -> None:
    assert len(kc.page(example_named("wrecker_boom").model).html.encode()) < 1_000_000


def test_that_without_a_script_the_start_is_shown(
    tmp_path: Any, open_file: Callable[..., Any]
) -> None:
    path = kc.page(crank_rocker("still")).write(tmp_path / "still.html")
    page = open_file(path)
    context = page.context.browser.new_context(java_script_enabled=False)
    plain = context.new_page()
    plain.goto(path.as_uri())
    picture = plain.locator("noscript svg")
    assert picture.count() == 1
    assert picture.bounding_box()["width"] > 200
    assert "this browser does not run" in plain.inner_text("body")
    context.close()
    page.close()

"""The panel of a transmission in Chromium: poses, J, limits, singularities, against Python."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile.functions.limits import limits
from tests import transmission_models as models

pytestmark = [pytest.mark.browser, pytest.mark.slow]

GOLDEN = json.loads(
    (Path(__file__).resolve().parents[1] / "data" / "transmission_golden.json").read_text()
)


def lever() -> kc.Mechanism:
    """Return T1b, whose input is limited at both ends."""
    lengths = [GOLDEN["T1b"]["parameters"][x] for x in "abcd"]
    return models.crank_rocker(*lengths, psi=0.99, motor=1.0)


def three_motors() -> kc.Mechanism:
    """Return a platform that three arms with rods hold in the plane."""
    m = kc.Mechanism("three_motors")
    platform = m.body("platform", (0, 0, 0))
    for k, turn in enumerate((0, 2 * math.pi / 3, 4 * math.pi / 3), start=1):
        out = np.array([math.cos(turn), math.sin(turn)])
        value = turn + math.pi + 0.695  # at the triangle of arm, rod and the way between their ends
        arm = m.body(f"arm_{k}", (*(0.2 * out), value))
        m.add(kc.Revolute(f"hinge_{k}", m.ground, 0.2 * out, arm, (0, 0)))
        m.add(kc.Distance(f"rod_{k}", arm, (0.1, 0), platform, 0.06 * out, 0.09))
        m.add(kc.AbsoluteAngle(f"motor_{k}", arm, value))
    return m


MOTORS = ["motor_1", "motor_2", "motor_3"]
CASES = {
    "crank_rocker": (models.crank_rocker, ["motor"], ["phi_rocker"]),
    "free_crank": (lambda: models.crank_rocker(motor=None), ["crank.phi"], ["rocker.phi"]),
    "lever": (lever, ["motor"], ["phi_rocker"]),
    "five_bar": (models.five_bar, ["motor_1", "motor_2"], ["end"]),
    "ankle": (models.ankle, ["left", "right"], ["pitch", "roll"]),
    "three": (three_motors, MOTORS, ["platform.x", "platform.y", "platform.phi"]),
}
SEEN = "stage.canvas.toDataURL()"
SET = """u => new Promise(done => { transmission.set(u);
  requestAnimationFrame(() => setTimeout(done)); })"""


@pytest.fixture(scope="module")
def open_case(
    open_file: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory
) -> Callable[..., Any]:
    """Return a function that opens the page of a case, whose map is found."""
    folder = tmp_path_factory.mktemp("pages")

    def opened(case: str, width: int = 1280, scheme: str = "light") -> Any:
        build, *ends = CASES[case]
        path = folder / f"{case}.html"
        if not path.exists():
            kc.page(build(), transmission=tuple(ends)).write(path)
        page = open_file(path, width, scheme)
        page.wait_for_function("transmission.map !== null")
        return page

    return opened


def function_of(case: str) -> kc.Transmission:
    build, *ends = CASES[case]
    return kc.transmission(build(), *ends)


def poses_of(case: str) -> list[list[float]]:
    """Return inputs that are reached, some of them far from the first."""
    return {
        "crank_rocker": [[0.3], [2.9], [4.4], [-1.0]],
        "free_crank": [[1.1], [3.2]],
        "lever": [[0.5], [2.1]],
        "five_bar": [[2.2, 1.0], [1.2, 1.5], [0.4, 2.6]],
        "ankle": [[0.21, 0.235], [0.25, 0.24], [0.2, 0.195]],
        "three": [[4.0, 5.7, 8.1], [3.7, 6.1, 7.9]],
    }[case]


@pytest.mark.parametrize("case", CASES)
def test_that_inputs_show_the_pose_and_the_jacobian_of_python(
    open_case: Callable[..., Any], case: str
) -> None:
    page, f = open_case(case), function_of(case)
    for u in [f.home.u.tolist(), *poses_of(case)]:
        page.evaluate(SET, u)
        found, poses = page.evaluate("transmission.found"), f.at(u)
        assert found["status"] == 0
        np.testing.assert_allclose(found["x"], poses.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found["J"], poses.J, rtol=0, atol=1e-9 * np.abs(poses.J).max())
        # The drawing is that of all coordinates.
        drawn = page.evaluate("Array.from(player.state.q)")
        np.testing.assert_allclose(drawn, poses.q, rtol=0, atol=1e-9)
        shown = page.locator(".jacobian tbody tr").first.locator("td").first.inner_text()
        assert float(shown.split()[0]) == pytest.approx(poses.J[0, 0], rel=1e-6)
    assert page.said == []
    assert [url for url in page.asked if not url.startswith("data:")] == [page.url.split("#")[0]]
    page.close()


@pytest.mark.parametrize("case", CASES)
def test_that_the_first_pose_again_is_the_first_drawing(
    open_case: Callable[..., Any], case: str
) -> None:
    page = open_case(case)
    first = page.evaluate(SEEN)
    page.locator("#input-0").focus()
    for _ in range(3):
        page.keyboard.press("PageUp")
    page.wait_for_function("transmission.frame === null")
    assert page.evaluate(SEEN) != first
    page.get_by_role("button", name="First pose").click()
    page.wait_for_function("transmission.frame === null")
    assert page.evaluate(SEEN) == first
    page.get_by_role("tab", name="Plots").click()
    page.get_by_role("tab", name="Transmission").click()
    assert page.evaluate("player.state.pose.status") == 0
    assert page.evaluate(SEEN) == first
    page.close()


def test_that_an_input_beyond_its_limit_says_so(open_case: Callable[..., Any]) -> None:
    page, f = open_case("ankle"), function_of("ankle")
    left = limits(f, f.home)[0]
    assert left.high.kind == "lock-up"
    assert f"left goes from {left.low.value:.6g} to {left.high.value:.6g} m" in page.inner_text(
        "#panel-transmission output"
    )
    before = page.evaluate("Array.from(player.state.q)")
    page.get_by_label("left in m").fill("0.3")
    page.wait_for_function("transmission.frame === null && transmission.u[0] === 0.3")
    said = page.inner_text("#panel-transmission output")
    assert said.startswith("left = 0.3 m, right = 0.2251 m cannot be reached: the limit of left is")
    assert f"left = {left.high.value:.6g} m" in said
    assert "an output singularity (type 2)" in said
    assert page.inner_text("#note") == said
    assert page.locator("#panel-transmission .failed").count() == 1
    # The drawing stays, dimmed, and no number of another pose is shown.
    assert page.evaluate("Array.from(player.state.q)") == before
    assert page.evaluate("player.state.isFound") is False
    shown = "".join(page.locator(".readouts td").all_inner_texts())
    assert shown
    assert not any(letter.isalnum() for letter in shown)
    page.get_by_role("button", name="First pose").click()
    page.wait_for_function("player.state.isFound")
    assert page.locator("#note").is_hidden()
    page.close()


def curves(page: Any, kind: str) -> list[Any]:
    """Return the poses of all curves of a kind."""
    code = "kind => transmission.map.curves.filter(({ type }) => type === kind).map(c => c.ends)"
    found: list[Any] = page.evaluate(
        f"kind => ({code})(kind).map(ends => ends.map(({{ u, all }}) => [u, Array.from(all)]))",
        kind,
    )
    return found


def test_that_three_inputs_have_a_slice_in_which_the_third_is_held(
    open_case: Callable[..., Any],
) -> None:
    """Its poses are those of Python with this value, and det J is zero along its curves."""
    page, f = open_case("three"), function_of("three")
    slices = []
    for third in (f.home.u[2], f.home.u[2] + 0.3):
        page.evaluate(SET, [*f.home.u[:2], third])
        page.wait_for_function("third => transmission.map.home.u[2] === third", arg=third)
        poses = page.evaluate("transmission.map.poses.map(({ u, x }) => [...u, ...x])")
        assert len(poses) > 200
        some = np.array(poses)[:: len(poses) // 40]
        assert (some[:, 2] == third).all()
        reached = f.at(some[:, :3])
        assert (reached.status == 0).mean() > 0.9  # the rest lies behind a corner
        known = reached.status == 0
        np.testing.assert_allclose(reached.x[known], some[known, 3:], rtol=0, atol=1e-9)
        ends = [end for curve in curves(page, "input") for end in curve]
        zeros = f.at(np.array([u for u, _ in ends]))
        same = np.abs(zeros.q - [q for _, q in ends]).max(axis=1) < 1e-8
        assert same.sum() > 10
        assert same.mean() > 0.9
        slopes = np.abs(zeros.determinant) / np.linalg.norm(zeros.J, axis=(1, 2)) ** 3
        assert slopes[same].max() < 1e-9
        written = page.locator(".map text").all_text_contents()
        assert any(text.startswith(f"motor_3 = {third:.6g}") for text in written), written
        slices.append(some)
    assert slices[0].shape != slices[1].shape or not np.allclose(slices[0], slices[1])
    page.close()


def test_that_dead_points_of_a_crank_rocker_are_where_the_closed_form_has_them(
    open_case: Callable[..., Any],
) -> None:
    a, b, c, d = (GOLDEN["T1a"]["parameters"][x] for x in "abcd")
    straight, folded = (
        math.acos((side**2 + d**2 - c**2) / (2 * side * d)) for side in (b + a, b - a)
    )
    for case in ("crank_rocker", "free_crank"):
        page = open_case(case)
        found = sorted(pose[0][0] for (pose,) in curves(page, "input"))
        assert found == pytest.approx([straight, math.pi + folded], abs=1e-9)
        assert curves(page, "output") == []
        assert page.locator(".singular button").all_inner_texts() == [
            f"input singularity: {'motor' if case == 'crank_rocker' else 'phi_crank'} = {u:.6g} rad"
            for u in found
        ]
        page.close()


def test_that_the_ends_of_a_limited_lever_are_where_the_closed_form_has_them(
    open_case: Callable[..., Any],
) -> None:
    a, b, c, d = (GOLDEN["T1b"]["parameters"][x] for x in "abcd")
    ends = [math.acos((a**2 + d**2 - far**2) / (2 * a * d)) for far in (b - c, b + c)]
    page = open_case("lever")
    found = sorted(pose[0][0] for (pose,) in curves(page, "output"))
    assert found == pytest.approx(ends, abs=1e-6)
    assert curves(page, "input") == []
    button = page.get_by_role("button", name="output singularity").first
    button.click()  # it is reached as nearly as can be
    page.wait_for_function("transmission.frame === null")
    assert page.evaluate("Math.abs(transmission.pose.J[0][0])") > 100
    page.close()


def test_that_singular_curves_of_a_five_bar_are_where_its_links_are_in_line(
    open_case: Callable[..., Any],
) -> None:
    page = open_case("five_bar")
    columns = page.evaluate("player.data.coordinates.map(({ name }) => name)")
    arms, rods = ([columns.index(f"phi_{kind}_{k}") for k in (1, 2)] for kind in ("arm", "rod"))
    poses = np.array([pose[1] for curve in curves(page, "input") for pose in curve])
    assert len(poses) > 100
    across = np.sin(poses[:, arms] - poses[:, rods])
    assert np.abs(across).min(axis=1).max() < 1e-7
    ends = np.array([pose[0] for curve in curves(page, "output") for pose in curve])
    assert len(ends) > 60
    elbows = [(-0.059, 0), (0.059, 0)] + 0.09 * np.stack((np.cos(ends), np.sin(ends)), axis=-1)
    apart = np.linalg.norm(elbows[:, 0] - elbows[:, 1], axis=-1)
    # Rods outstretched, or the elbows together.
    assert np.minimum(np.abs(apart - 0.24), apart).max() < 1e-6
    page.close()


def test_that_the_point_is_dragged_in_the_map(open_case: Callable[..., Any]) -> None:
    page, f = open_case("ankle"), function_of("ankle")
    page.locator(".map").scroll_into_view_if_needed()
    box, dot = page.locator(".map").bounding_box(), page.locator(".map .dot").bounding_box()
    x, y = dot["x"] + dot["width"] / 2, dot["y"] + dot["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 0.1 * box["width"], y - 0.05 * box["height"], steps=4)
    page.mouse.up()
    page.wait_for_function("transmission.frame === null && transmission.u[0] > 0.23")
    u = page.evaluate("transmission.u")
    assert u[1] > f.home.u[1]
    np.testing.assert_allclose(page.evaluate("transmission.found.x"), f(u), atol=1e-9)
    again = page.locator(".map .dot").bounding_box()
    assert again["x"] + again["width"] / 2 == pytest.approx(x + 0.1 * box["width"], abs=1)
    assert float(page.get_by_label("left in m").input_value()) == pytest.approx(u[0], rel=1e-5)
    page.close()


def test_that_a_velocity_has_a_derivative_and_no_value(
    open_file: Callable[..., Any], tmp_path: Path
) -> None:
    m = models.crank_rocker()
    rocker = next(body for body in m.system().bodies if body.name == "rocker")
    m.output("swing", kc.outputs.rate(rocker.phi), "rad/s")
    page = open_file(kc.page(m, transmission=(["motor"], ["swing"])).write(tmp_path / "page.html"))
    page.wait_for_function("transmission.map !== null")
    assert not any(x.isalnum() for x in page.inner_text(".outputs td"))
    slope = kc.transmission(models.crank_rocker(), "motor", "phi_rocker").J([1.5])[0, 0]
    assert page.evaluate("transmission.found.J[0][0]") == pytest.approx(slope, rel=1e-9)
    assert page.locator(".map .title").all_text_contents()[1] == "d swing/d motor"
    assert len(curves(page, "input")) == 2
    assert page.said == []
    page.close()


def test_that_parameters_that_are_pulled_change_the_function(
    open_case: Callable[..., Any],
) -> None:
    page, f = open_case("crank_rocker"), function_of("crank_rocker")
    page.evaluate(SET, [2.0])
    page.evaluate("live.set({ a: 0.035, c: 0.09 })")
    page.wait_for_function("transmission.branch.p[0] === 0.035 && transmission.map !== null")
    p = {"a": 0.035, "c": 0.09}
    np.testing.assert_allclose(page.evaluate("transmission.found.x"), f([2.0], p), atol=1e-9)
    np.testing.assert_allclose(page.evaluate("transmission.found.J"), f.J([2.0], p), atol=1e-9)
    assert page.evaluate("player.state.pose.u") == [2.0]
    b, d = 0.12, 0.13
    straight = math.acos(((b + 0.035) ** 2 + d**2 - 0.09**2) / (2 * (b + 0.035) * d))
    assert min(pose[0][0] for (pose,) in curves(page, "input")) == pytest.approx(straight, abs=1e-9)
    page.evaluate("live.set({ a: 0.2 })")  # no assembly has these lengths
    page.wait_for_function("transmission.branch.p[0] === 0.2")
    assert "no pose was found at the first inputs" in page.inner_text("#panel-transmission output")
    page.get_by_role("button", name="Reset").click()
    page.wait_for_function("transmission.branch.p[0] === 0.04 && player.state.isFound")
    np.testing.assert_allclose(page.evaluate("transmission.found.x"), f([2.0]), atol=1e-9)
    assert page.said == []
    page.close()


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (820, "dark"), (1440, "light")])
def test_that_the_panel_fits_and_is_read_aloud(
    open_case: Callable[..., Any], width: int, scheme: str
) -> None:
    page = open_case("ankle", width, scheme)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.get_by_role("tab", name="Transmission").get_attribute("aria-selected") == "true"
    label = page.get_by_role("img", name="Plane of the inputs: left = 0.2251 m").get_attribute(
        "aria-label"
    )
    assert "output singularities" in label
    assert "no input singularities" in label
    slider = page.get_by_label("left [m]")
    assert slider.get_attribute("aria-valuetext") == "0.2251 m"
    assert page.get_by_role("status").filter(has_text="left goes from").count() == 1
    if width < 961:
        heights = page.locator("#panel-transmission :is(button, input)").evaluate_all(
            "elements => elements.map(x => x.offsetHeight)"
        )
        assert min(heights) >= 44
    page.evaluate("document.getElementById('angles').click()")
    assert "pitch [deg]" in page.inner_text(".outputs")
    page.close()


def test_that_time_shows_the_motion_again(open_case: Callable[..., Any]) -> None:
    page = open_case("lever")
    page.evaluate(SET, [2.0])
    assert page.inner_text("#clock") == "at the inputs"
    page.evaluate("player.setIndex(5)")
    assert page.inner_text("#clock").startswith("t = ")
    assert page.evaluate("player.state.q[2]") == pytest.approx(1.0)
    page.evaluate(SET, [1.5])
    assert page.evaluate("player.state.q[2]") == pytest.approx(1.5)
    page.get_by_role("tab", name="Numbers").click()
    assert page.evaluate("player.state.q[2]") == pytest.approx(1.0)
    page.close()

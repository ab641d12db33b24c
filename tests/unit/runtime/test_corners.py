"""Drivers with corners: position and velocity are solved, and no acceleration is made up."""

import json
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc

STROKE, TIMES = 0.05, (0.2, 0.7, 1.2, 2.2)


def press(**options) -> kc.Mechanism:
    """A ram that extends, holds and retracts at constant speed; `T` is when it has extended."""
    m = kc.Mechanism("press")
    m.parameter("T", TIMES[1])
    begin, hold, end = (sympy.Float(time) for time in (TIMES[0], *TIMES[2:]))
    points = [(begin, 0.1), (sympy.Symbol("T"), 0.15), (hold, 0.15), (end, 0.1)]
    arm, cylinder = m.body("arm", (0.1, 0, 0)), m.body("cylinder", (0.1, 0.05, 1.5))
    m.add(kc.Revolute("pin", m.ground, (0, 0), arm, (-0.1, 0)))
    m.add(kc.Revolute("foot", m.ground, (0.1, -0.1), cylinder, (0, 0)))
    m.add(kc.RevoluteTranslational("rod", cylinder, (0, 0), (1, 0), arm, (0, 0), 0))
    law = kc.motion.sequence(points, law="linear")
    m.add(kc.Distance("stroke", m.ground, (0.1, -0.1), arm, (0, 0), law, **options))
    return m


def length(t: np.ndarray) -> Any:
    return np.interp(t, TIMES, (0.1, 0.15, 0.15, 0.1))


def speed(t: np.ndarray) -> Any:
    """Return the speed of the stroke, after a corner."""
    place = np.searchsorted(np.array(TIMES), t + 1e-12)
    return np.take([0, 0.1, 0, -0.05, 0], place)


@pytest.fixture(scope="module", params=["numpy", "c", "grouped"])
def module(request):
    if request.param == "grouped":
        return kc.compile(press(corners=True), form="grouped")
    return kc.compile(press(corners=True), target=request.param)


@pytest.mark.every(3)
@pytest.mark.parametrize(("points", "method"), [(26, None), (251, None), (251, "march")])
def test_that_a_corner_has_no_acceleration_and_all_else_is_right(module, points, method):
    t = np.linspace(0, 2.5, points)
    with pytest.warns(kc.CornerWarning, match="at t = 0.2, 0.7, 1.2, 2.2: the velocity jumps"):
        solution = kc.solve(module, t, method=method)
    corner = np.isclose(t[:, None], TIMES, rtol=0, atol=1e-9).any(axis=1)
    assert corner.sum() == 4
    assert (solution.status == np.where(corner, kc.Status.CORNER, kc.Status.CONVERGED)).all()
    assert np.isnan(solution.q_ddot[corner]).all()
    assert np.isfinite(solution.q_ddot[~corner]).all()
    assert (solution.success, solution.t.tolist()) == (True, t.tolist())
    assert "At t = 0.2, 0.7, 1.2, 2.2 a driver has a corner" in solution.message
    x, y = solution["x_arm"] - 0.1, solution["y_arm"] + 0.1
    stroke = np.hypot(x, y)
    assert stroke == pytest.approx(length(t), abs=1e-14)
    rate = (x * solution["x_arm_dot"] + y * solution["y_arm_dot"]) / stroke
    assert rate == pytest.approx(speed(t), abs=1e-12)


def test_that_the_warning_is_the_same_for_many_parameter_sets(module):
    t, sets = np.linspace(0, 2.5, 26), np.array([[[0.7]], [[0.8]]])
    with pytest.warns(kc.CornerWarning):
        solution = kc.solve(module, t, sets)
    found = [t[row == kc.Status.CORNER].round(9).tolist() for row in solution.status]
    assert found == [[0.2, 0.7, 1.2, 2.2], [0.2, 0.8, 1.2, 2.2]]
    assert np.isnan(solution.q_ddot[solution.status == kc.Status.CORNER]).all()
    assert solution.success
    assert solution.variant(1).success


def test_that_times_beside_the_corners_have_all(module, recwarn):
    solution = kc.solve(module, np.linspace(0.01, 2.49, 100))
    assert not recwarn.list
    assert np.isfinite(solution.q_ddot).all()


def test_that_a_smooth_driver_with_the_permission_has_no_corners(recwarn):
    m = kc.Mechanism("smooth")
    m.add(kc.AbsoluteX("x", m.body("cart"), (0, 0), sympy.sin(300 * kc.t), corners=True))
    m.add(kc.AbsoluteY("y", "cart", (0, 0), 0))
    m.add(kc.AbsoluteAngle("phi", "cart", 0))
    assert kc.solve(kc.compile(m), np.linspace(0, 10, 2001)).status.max() == 0
    assert not recwarn.list


@pytest.mark.filterwarnings("ignore::kincompile.errors.CornerWarning")
def test_that_files_and_plots_show_corners_as_what_they_are(tmp_path):
    solution = kc.solve(kc.compile(press(corners=True)), np.linspace(0, 2.5, 26))
    written = json.loads(kc.write(solution, tmp_path / "press.json").read_text("utf-8"))
    assert written["statuses"]["5"].startswith("A driver has a corner here")
    assert written["q_ddot"][7][0] is None
    assert written["q_dot"][7][0] is not None
    lines = {
        line.get_label(): line for line in solution.plot("x_arm", "x_arm_ddot").figure.axes[0].lines
    }
    assert np.isfinite(lines["x_arm"].get_ydata()).all()
    assert "of which" not in repr(solution)


def test_that_a_file_gives_the_permission(tmp_path):
    text = press(corners=True).to_toml()
    assert "corners = true" in text
    path = tmp_path / "press.toml"
    path.write_text(text, encoding="utf-8")
    assert kc.compile(kc.read(path)).CORNERS is True
    path.write_text(text.replace("corners = true\n", ""), encoding="utf-8")
    with pytest.raises(kc.ModelError, match=r"corners at t = .*corners=True"):
        kc.read(path)


@pytest.mark.filterwarnings("ignore::kincompile.errors.CornerWarning")
def test_that_outputs_have_at_a_corner_what_needs_no_acceleration():
    m = press(corners=True)
    tip = m.point("tip", "arm", (0.2, 0.05))
    m.output("height", tip.y, "m")
    m.output("pull", kc.outputs.acceleration(tip), "m/s^2")
    t = np.linspace(0, 2.5, 26)
    solution = kc.solve(kc.compile(m), t)
    corner = solution.status == kc.Status.CORNER
    beside = kc.solve(kc.compile(m), t + 1e-9)
    assert corner.sum() == 4
    for name in ("height", "height_dot", "x_tip", "x_tip_dot"):
        assert solution[name] == pytest.approx(beside[name], abs=1e-8)
    for name in ("height_ddot", "x_tip_ddot", "pull"):
        assert (np.isnan(solution[name]) == corner).all()

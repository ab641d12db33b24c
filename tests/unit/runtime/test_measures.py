"""Measures of outputs, and ranges of drivers, against closed forms."""

import html
import math
import pickle

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import outputs
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.results.measures import measures_together
from kincompile.runtime.results.observed import ObservedMotion

A, L, START = 0.06, 0.26, 0.3


def slider_crank(end=1.0, points=101, **parameters):
    """Solve a slider-crank in line: x = A cos(angle) + sqrt(L^2 - A^2 sin(angle)^2)."""
    m = kc.Mechanism("measured")
    m.parameter("start", START, unit="rad")
    crank, rod = m.body("crank", (0, 0, 0.5)), m.body("rod", (0.1, 0, 0))
    end_of_rod = m.point("end", rod, (L / 2, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (-A / 2, 0)))
    m.add(kc.Revolute("A", crank, (A / 2, 0), rod, (-L / 2, 0)))
    m.add(kc.AbsoluteY("guide", end_of_rod, 0))
    m.add(kc.AbsoluteAngle("motor", crank, 2 * kc.pi * kc.t + sympy.Symbol("start")))
    m.output("travel", end_of_rod.x - (L - A), "m")
    m.output("speed", outputs.speed(end_of_rod), "m/s")
    m.output("pull", outputs.acceleration(end_of_rod), "m/s^2")
    m.output("turned", crank.phi, "rad")
    m.output("fixed", L / 2, "m")
    return kc.solve(kc.compile(m), np.linspace(0, end, points), parameters)


def travel(angle):
    """Return the travel of a slider-crank, its first and its second derivative by the angle."""
    s, c = A * np.sin(angle), A * np.cos(angle)
    root = np.sqrt(L**2 - s**2)
    first = -s - s * c / root
    second = -c - (c**2 - s**2) / root - (s * c) ** 2 / root**3
    return c + root - (L - A), first, second


@pytest.fixture(scope="module")
def found():
    return slider_crank().measures()


@pytest.fixture(scope="module")
def over_a_turn():
    """Return the closed form at so many angles that a plain mean is exact for periodic curves."""
    return travel(np.arange(4096) * math.tau / 4096)


def fastest():
    """Return the angle in (0, pi) at which the acceleration of a slider-crank is zero."""
    from scipy.optimize import brentq

    return brentq(lambda angle: float(travel(angle)[2]), 0.5, 2.5, xtol=1e-15)


@pytest.mark.parametrize("points", [9, 41, 101])
def test_that_a_slider_crank_turns_back_at_its_dead_points(points):
    output = slider_crank(points=points).measures()["travel"]
    turns = (np.array([math.pi, math.tau]) - START) / math.tau
    np.testing.assert_allclose(output.dead_points, turns, atol=1e-11)
    np.testing.assert_allclose((output.t_least, output.t_greatest), turns, atol=1e-11)
    assert output.stroke == pytest.approx(2 * A, abs=1e-14)
    assert output.time_ratio == pytest.approx(1, abs=1e-9)
    assert output.period == pytest.approx(1, abs=1e-9)


def test_that_dead_points_on_the_grid_count_once():
    output = slider_crank(start=0.0, end=2.0).measures()["travel"]
    np.testing.assert_allclose(output.dead_points, [0, 0.5, 1, 1.5, 2], atol=1e-11)
    assert output.period == pytest.approx(1, abs=1e-9)
    assert output.t_greatest == 0


def test_means_over_time(found, over_a_turn):
    x, x_dot, x_ddot = over_a_turn
    w = math.tau
    for name, values in (("travel", x), ("speed", w * x_dot), ("pull", w**2 * x_ddot)):
        assert found[name].rms == pytest.approx(np.sqrt(np.mean(values**2)), abs=1e-9)
    assert found["travel"].mean == pytest.approx(x.mean(), abs=1e-12)
    assert found["speed"].mean == pytest.approx(4 * A, abs=1e-9)  # twice the stroke in a second
    # From corner to corner the slope of the travel changes by twice its greatest.
    assert found["pull"].mean == pytest.approx(4 * w * abs(travel(fastest())[1]), abs=1e-9)


def test_extremes_at_corners_and_without_an_emitted_rate(found):
    w, angle = math.tau, fastest()
    speed, pull = found["speed"], found["pull"]
    assert speed.greatest == pytest.approx(w * abs(travel(angle)[1]), abs=1e-13)
    assert speed.t_greatest == pytest.approx((angle - START) / w, abs=1e-10)
    assert speed.least == pytest.approx(0, abs=1e-9)
    assert pull.greatest == pytest.approx(w**2 * abs(travel(0)[2]), abs=1e-11)
    assert pull.t_greatest == pytest.approx(1 - START / w, abs=1e-9)
    assert pull.t_least == pytest.approx((angle - START) / w, abs=1e-9)
    assert pull.least == pytest.approx(0, abs=1e-7)


def test_that_what_goes_on_or_rests_has_no_dead_points(found):
    for name in ("turned", "fixed"):
        assert found[name].dead_points == ()
        assert found[name].period is None
        assert found[name].time_ratio is None
    assert found["turned"].stroke == pytest.approx(math.tau, abs=1e-12)
    assert found["fixed"].mean == pytest.approx(L / 2, abs=1e-15)


def test_that_a_part_of_a_turn_is_not_cyclic():
    output = slider_crank(end=0.9).measures()["travel"]
    assert output.dead_points == pytest.approx([0.5 - START / math.tau], abs=1e-11)
    assert output.period is None


def test_that_falling_times_have_the_same_measures(found):
    solution = slider_crank()
    back = kc.solve(solution.module, solution.t[::-1], guess=solution.q[-1]).measures()["travel"]
    np.testing.assert_allclose(back.dead_points, found["travel"].dead_points, atol=1e-11)
    assert back.mean == pytest.approx(found["travel"].mean, abs=1e-14)


def test_that_one_point_has_measures():
    output = kc.solve(slider_crank().module, 0.2).measures()["travel"]
    value = travel(math.tau * 0.2 + START)[0]
    assert (output.least, output.mean, output.rms) == pytest.approx((value, value, value))
    assert output.stroke == 0


@pytest.mark.parametrize(("r", "d", "digits"), [(0.1, 0.45, 1.332802), (0.15, 0.45, 1.552)])
def test_the_time_ratio_of_a_shaper(r, d, digits):
    m = kc.read_model("examples/shaper.py")
    m.output("ram", sympy.Symbol("x_ram"), "m")
    module = kc.compile(m)
    output = kc.solve(module, np.linspace(0, 1, 101), {"r": r, "d": d}).measures()["ram"]
    lag = 2 * math.asin(r / d)
    assert output.time_ratio == pytest.approx((math.pi + lag) / (math.pi - lag), rel=1e-9)
    assert output.time_ratio == pytest.approx(digits, abs=5e-4)


def four_bar(crank_length, coupler, follower, ground, drive):
    """Return a four-bar with the transmission angle as an output; bars have their origins at O."""
    angle = 1.0
    pin = crank_length * np.exp(1j * angle)
    away = abs(ground - pin)
    top = math.acos((coupler**2 + away**2 - follower**2) / (2 * coupler * away))
    tilt = top + np.angle(ground - pin)
    end = pin + coupler * np.exp(1j * tilt)
    m = kc.Mechanism("four_bar")
    bar = m.body("crank", (0, 0, angle))
    rod = m.body("rod", (pin.real, pin.imag, tilt))
    rocker = m.body("rocker", (ground, 0, float(np.angle(end - ground))))
    a, b = m.point("A", bar, (crank_length, 0)), m.point("B", rod, (coupler, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), bar, (0, 0)))
    m.add(kc.Revolute("pin", a, rod, (0, 0)))
    m.add(kc.Revolute("joint", b, rocker, (follower, 0)))
    m.add(kc.Revolute("C", m.ground, (ground, 0), rocker, (0, 0)))
    m.add(drive(m, bar, a))
    m.output("mu", outputs.transmission_angle(a, b, (ground, 0)), "rad")
    return m


def by_angle(_m, crank, _pin):
    return kc.AbsoluteAngle("motor", crank, 1 + 2 * kc.pi * kc.t)


def test_the_extreme_transmission_angles_of_a_four_bar():
    r, c, e, d = 1.0, 3.0, 2.5, 3.2
    m = four_bar(r, c, e, d, by_angle)
    output = kc.solve(kc.compile(m), np.linspace(0, 1, 61)).measures()["mu"]
    expected = [math.acos((c**2 + e**2 - (d + k * r) ** 2) / (2 * c * e)) for k in (-1, 1)]
    assert (output.least, output.greatest) == pytest.approx(expected, abs=1e-13)
    assert (output.t_greatest, output.t_least) == pytest.approx(
        (0.5 - 1 / math.tau, 1 - 1 / math.tau), abs=1e-10
    )


def test_how_far_the_crank_of_a_double_rocker_can_go():
    """Where the diagonal is as long as coupler and follower together, on either side of 0."""
    r, c, e, d = 2.0, 1.4, 1.5, 2.2
    m = four_bar(r, c, e, d, lambda m, crank, pin: kc.AbsoluteAngle("motor", crank, 1 + kc.t / 9))
    reach = kc.solve(kc.compile(m), np.linspace(0, 0.1, 5)).measures()["motor"]
    limit = math.acos((r**2 + d**2 - (c + e) ** 2) / (2 * r * d))
    assert (reach.low.value, reach.high.value) == pytest.approx((-limit, limit), abs=1e-9)
    assert (reach.low.kind, reach.high.kind, reach.start) == ("lock-up", "lock-up", 1)
    assert set(reach.high.bodies) == {"rod", "rocker"}
    assert reach.high.q[2] == pytest.approx(limit, abs=1e-9)
    assert reach.unit == "rad"


def test_how_far_a_cylinder_can_go():
    """From (0.5, -1) to the end of a bar: in line with its pivot on either side."""
    m = kc.Mechanism("boom")
    bar = m.body("bar", (0, 0, 0.4))
    m.add(kc.Revolute("O", m.ground, (0, 0), bar, (0, 0)))
    foot = (0.5, -1.0)
    away = math.hypot(2 * math.cos(0.4) - foot[0], 2 * math.sin(0.4) - foot[1])
    m.add(kc.AbsoluteDistance("cylinder", bar, (2, 0), foot, away + kc.t / 10))
    reach = kc.solve(kc.compile(m), np.linspace(0, 1, 5)).measures()["cylinder"]
    apart = math.hypot(*foot)
    found = reach.low.value, reach.high.value
    assert found == pytest.approx((2 - apart, 2 + apart), abs=1e-9)
    assert reach.start == pytest.approx(away, abs=1e-14)
    assert reach.unit == "m"


def test_that_a_limit_at_zero_is_zero():
    """Two bars of 500 mm fold up: the slider is at the pivot, where it can go two ways."""
    s = kc.Sketch("folded", length_unit="mm", end=1.0, points=11)
    s.ground(A=(0, 0))
    s.joints(B=(800, 0), M=(400, 300))
    s.link("bar", "A M", 500)
    s.link("rod", "M B", 500)
    s.slider("roller", "B", along=(1, 0))
    s.drive("B.x", 950 - 450 * kc.t)
    reach = kc.solve(kc.compile(s.mechanism()), np.linspace(0, 1, 11)).measures()["drive_B_x"]
    assert (reach.low.kind, reach.low.value) == ("bifurcation", 0.0)
    assert reach.high.value == pytest.approx(1000, rel=1e-9)


def test_that_a_crank_that_goes_round_meets_no_limit(found):
    reach = found["motor"]
    assert (reach.low.value, reach.high.value) == (-math.inf, math.inf)
    assert reach.low.text(1) == "no limit met"


def test_that_a_dwell_is_one_dead_point():
    """A slider at (1 - t)^3 up to t = 1, which rests then."""
    m = kc.Mechanism("dwell")
    block = m.body("block")
    value = sympy.Piecewise(((1 - kc.t) ** 3, kc.t < 1), (0, True))
    m.add(kc.AbsoluteX("drive", block, (0, 0), value))
    m.add(kc.AbsoluteY("guide", block, (0, 0), 0))
    m.add(kc.AbsoluteAngle("level", block, 0))
    m.output("x", block.x, "m")
    output = kc.solve(kc.compile(m), np.linspace(0, 2, 41)).measures()["x"]
    assert output.dead_points == pytest.approx([1.0])
    assert output.mean == pytest.approx(1 / 8, abs=1e-12)


def test_that_tables_have_degrees(found):
    (row,) = (x.split() for x in found.table("deg").splitlines() if x.startswith("turned"))
    assert row[1:6:2] == ["deg", "0", "1"]
    assert row[2:7:2] == ["17.1887", "377.189", "360"]
    (row,) = (x.split() for x in found.table("deg").splitlines() if x.startswith("motor"))
    assert row[1:3] == ["deg", "17.1887"]


def test_the_tables(found):
    text = str(found)
    lines = {line.split()[0]: line.split() for line in text.splitlines() if line}
    assert " ".join(lines["travel"][:8]) == "travel m 0 0.452254 0.12 0.952254 0.12 0.452254,"
    assert lines["turned"][-4:-2] == ["not", "cyclic"]
    assert "no limit met" in text
    assert repr(found) == "<Measures: measured: x_end, y_end, travel, speed, pull, turned, fixed>"
    assert str(found) in html.unescape(found._repr_html_())
    assert found["end.x"] is found["x_end"]


def test_what_cannot_be_measured():
    solution = slider_crank()
    with pytest.raises(kc.InputError, match=r"no output or driver 'travle'; did you mean 'travel'"):
        solution.measures()["travle"]
    several = kc.solve(solution.module, solution.t, np.array([0.1, 0.2]).reshape(-1, 1, 1))
    with pytest.raises(kc.InputError, match="2 variants; solve with one of the parameter sets"):
        several.measures()
    with pytest.raises(kc.InputError, match="read its measures before pickling"):
        pickle.loads(pickle.dumps(solution)).measures()
    m = kc.Mechanism("apart")
    bar = m.body("bar")
    m.add(kc.Revolute("O", m.ground, (0, 0), bar, (1, 0)))
    m.add(kc.AbsoluteX("far", bar, (0, 0), 3 + kc.t))
    with pytest.raises(kc.InputError, match="has no motion to measure"):
        kc.solve(kc.compile(m), [0, 1]).measures()


@pytest.mark.slow
def test_measures_of_variants_together_are_those_of_each_alone(monkeypatch):
    starts = np.linspace(0, 3, 7)
    several = slider_crank(1.3, 53, start=starts)  # pull has no rate, and speed turns in corners
    looks = []
    look = ObservedMotion.look

    def counted(motion, t):
        looks.append(t)
        look(motion, t)

    monkeypatch.setattr(ObservedMotion, "look", counted)
    ones = [several.variant(number) for number in range(7)]
    sets = starts[:, np.newaxis]
    code, names = code_of(several.require_module("")), ("travel", "speed", "pull")
    found = measures_together(ones, code, sets, names)
    count = len(looks)
    for number, start in enumerate(starts.tolist()):
        alone = slider_crank(1.3, 53, start=start).measures().outputs
        wanted = [item for item in alone if item.name in names]
        for got, one in zip(found[number], wanted, strict=True):
            assert (got.name, got.period is None) == (one.name, one.period is None)
            for name in ("least", "greatest", "mean", "rms", "dead_points", "period"):
                if (value := getattr(one, name)) is not None:
                    assert getattr(got, name) == pytest.approx(value, rel=1e-7, abs=1e-8)
    assert count < (len(looks) - count) / 5  # the last ones alone


def test_the_mechanical_advantage_is_the_ratio_of_forces():
    """Of a slider-crank with a load on the slider, against the torque that holds its crank."""
    s = kc.Sketch("press", length_unit="mm", points=9)
    s.ground(O=(0, 0))
    s.joints(A=(60, 0), B=(260, 0))
    s.link("crank", "O A", 60)
    s.link("rod", "A B", 200)
    s.slider("ram", "B", along=(1, 0))
    s.drive("crank", 0.4 + kc.pi / 2 * kc.t)
    m = s.mechanism()
    bodies = {body.name: body for body in m.bodies}
    crank, ram = bodies["crank"].phi, bodies["ram"].x
    m.output("gain", kc.outputs.mechanical_advantage(ram, crank), "1/mm")
    m.add(kc.Force("load", bodies["ram"], (0, 0), (-500, 0)))
    found = kc.solve(kc.compile(m), np.linspace(0, 1, 9))
    phi = found["crank.phi"]
    ratio = -60 * (
        np.sin(phi) + 60 * np.sin(phi) * np.cos(phi) / np.sqrt(200**2 - (60 * np.sin(phi)) ** 2)
    )
    np.testing.assert_allclose(found["gain"], 1 / ratio, rtol=1e-12)
    torque = kc.forces(found)["drive_crank.drive"]  # [N mm]: what the driver puts in
    np.testing.assert_allclose(500 / torque, found["gain"], rtol=1e-12)


@pytest.mark.parametrize("points", [73, 77, 361])
def test_poles_of_a_mechanical_advantage(points):
    """On the grid, 73 and 361, and beside it: infinite extremes, and other outputs keep theirs."""
    model = kc.linkages.hoeken().mechanism()
    crank, _, rocker = model.bodies
    model.output("ratio", kc.outputs.velocity_ratio(rocker.phi, crank.phi))
    alone = kc.solve(kc.compile(model), np.linspace(0, 1, points)).measures()["ratio"]
    model.output("gain", kc.outputs.mechanical_advantage(rocker.phi, crank.phi))
    found = kc.solve(kc.compile(model), np.linspace(0, 1, points)).measures()
    assert (found["gain"].least, found["gain"].greatest) == (-math.inf, math.inf)
    # Dead points of the rocker, where crank and coupler are in one line: 1.5 or 3.5 from O to B.
    angles = [math.acos((4 + r * r - 2.5**2) / (4 * r)) for r in (1.5, 3.5)]
    dead = sorted(
        (angle / (2 * math.pi) + part) % 1 for angle, part in zip(angles, (0.25, 0.75), strict=True)
    )
    assert found["gain"].t_least == pytest.approx(min(dead), abs=1e-9)
    assert found["gain"].dead_points == ()
    assert math.isnan(found["gain"].mean)
    for name in ("least", "greatest", "t_least", "t_greatest", "mean", "rms"):
        assert getattr(found["ratio"], name) == pytest.approx(getattr(alone, name), rel=1e-9)
    t = np.linspace(0, 1, 100001)
    ratio = kc.solve(kc.compile(model), t[::50])["ratio"]
    assert found["ratio"].least == pytest.approx(ratio.min(), rel=1e-5)
    assert found["ratio"].greatest == pytest.approx(ratio.max(), rel=1e-5)


def test_that_a_jump_of_an_angle_is_no_pole():
    model = kc.linkages.hoeken().mechanism()
    crank = model.bodies[0]
    model.output("turn", sympy.atan2(sympy.sin(crank.phi), sympy.cos(crank.phi)))
    found = kc.solve(kc.compile(model), np.linspace(0, 1, 73)).measures()["turn"]
    assert found.greatest <= math.pi + 1e-9

"""What a driver or a distance asks for and what the joints can give, against closed forms."""

import math
import re

import numpy as np
import pytest
import sympy

import kincompile as kc


def limits(message, name):
    """Return what is asked for, the least and the most, as a message says; None where it is not."""
    number = r"(-?[\d.e+-]+)"
    text = rf"{name} is {number}(?: \w+)?; it can be {number}(?: \w+)? at least, {number}"
    found = re.search(text, message)
    return None if found is None else tuple(float(part) for part in found.groups())


def boom(length, unit="mm", lug=194.0, foot=(300.0, -178.0), free=False):
    """Return a boom on a pivot and a cylinder between its lug and a foot on the ground."""
    m = kc.Mechanism("boom", length_unit=unit)
    arm = m.body("arm", guess=(0, 0, 0.5))
    m.add(kc.Revolute("pivot", m.ground, (0, 0), arm, (0, 0)))
    if free:
        cylinder = m.body("cylinder", guess=(*foot, 2.0))
        m.add(kc.Revolute("foot", m.ground, foot, cylinder, (0, 0)))
        m.add(kc.RevoluteTranslational("straight", cylinder, (0, 0), (1, 0), arm, (lug, 0), 0))
        way = (cylinder, (0, 0), (1, 0), arm, (lug, 0))
        m.add(kc.TranslationalDistance("lift", *way, length))
    else:
        m.add(kc.Distance("cylinder", m.ground, foot, arm, (lug, 0), length))
    return kc.compile(m)


REACH = math.hypot(300, 178)


@pytest.mark.parametrize("length", [100.0, 600.0])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_that_a_cylinder_says_how_long_it_can_be(length, scale):
    module = boom(length * scale, lug=194 * scale, foot=(300 * scale, -178 * scale))
    solution = kc.solve(module, 0.0)
    assert not solution.success
    asked, least, most = limits(solution.message, "cylinder")
    assert asked == pytest.approx(length * scale, rel=1e-3)
    assert least == pytest.approx((REACH - 194) * scale, rel=1e-3)
    assert most == pytest.approx((REACH + 194) * scale, rel=1e-3)


def test_that_it_is_said_in_the_users_units():
    message = kc.solve(boom(100.0), 0.0).message
    assert "cannot be assembled at this time: cylinder is 100 mm; it can be 154.8 mm at" in message
    assert "at least, 542.8 mm at most (found by moving the other joints)." in message
    assert re.search(r"nearest position: .*cylinder is 15\d(\.\d)? mm instead of 100 mm", message)


@pytest.mark.parametrize(
    ("length", "text"),
    [
        (100 + kc.t, r"lift asks for (\S+) mm less than the least"),
        (700 + kc.t, r"lift asks for (\S+) mm more than the most"),
    ],
)
def test_that_a_way_along_an_axis_says_how_much_is_missing(length, text):
    message = kc.solve(boom(length, free=True), 0.0).message
    nearest = REACH - 194 if "less" in text else REACH + 194
    missing = abs(nearest - float(length.subs(kc.t, 0)))
    (found,) = re.findall(text, message)
    assert float(found) == pytest.approx(missing, rel=1e-3)


def four_bar(a, b, c, d, angle):
    m = kc.Mechanism("four_bar")
    crank, coupler = m.body("crank", (0, 0, 0.1)), m.body("coupler", (a, 0, 0.3))
    rocker = m.body("rocker", (d, 0, 2.0))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (a, 0), coupler, (0, 0)))
    m.add(kc.Revolute("B", coupler, (b, 0), rocker, (c, 0)))
    m.add(kc.Revolute("C", rocker, (0, 0), m.ground, (d, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, angle))
    return kc.compile(m)


def furthest(a, b, c, d):
    """Return the largest crank angle, at which coupler and rocker are in line."""
    return math.acos((a**2 + d**2 - (b + c) ** 2) / (2 * a * d))


@pytest.mark.parametrize("angle", [3, -2.5, 1.37])
def test_that_a_crank_says_how_far_it_can_turn(angle):
    lengths = (10.0, 26.0, 18.0, 45.0)
    asked, least, most = limits(kc.solve(four_bar(*lengths, angle + kc.t), 0.0).message, "motor")
    assert asked == angle
    assert (least, most) == pytest.approx((-furthest(*lengths), furthest(*lengths)), rel=1e-3)


def test_that_a_driver_that_goes_too_far_says_where_the_end_is():
    lengths = (10.0, 26.0, 18.0, 45.0)
    message = kc.solve(four_bar(*lengths, kc.t), np.linspace(0, 3, 50)).message
    assert "Lock-up at t = 1.359221" in message
    assert limits(message, "motor")[2] == pytest.approx(furthest(*lengths), rel=1e-3)


def test_that_a_driver_that_begins_at_rest_is_one():
    angle = 3 + kc.t**2
    message = kc.solve(four_bar(10.0, 26.0, 18.0, 45.0, angle), 0.0).message
    assert limits(message, "motor") is not None


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_that_a_free_equation_of_a_distance_is_one_too(target, quick_compiler):
    x, y = sympy.symbols("x y")
    system = kc.ConstraintSystem("ladder", [x, y], [x**2 + y**2 - 25, x - 6 - kc.t], guess=(4, 3))
    message = kc.solve(kc.compile(system, target=target), 0.0).message
    assert re.search(r"equation_1 is \S+ instead of 5|equation_2 = ", message)


def test_that_lengths_that_fit_nowhere_blame_no_driver():
    message = kc.solve(four_bar(10.0, 100.0, 18.0, 45.0, kc.t), 0.0).message
    assert "found by moving" not in message
    assert "or the guess is too far away" in message
    assert re.search(r"B\.x = -?[\d.]+ m, ", message)


def test_that_what_can_be_assembled_blames_nobody():
    """The guess is far away, and the search of one iteration fails: nothing is impossible."""
    module = four_bar(10.0, 26.0, 18.0, 20.0, kc.t)
    far = dict(zip(module.COORDINATES, np.linspace(-3, 3, 9), strict=True))
    solution = kc.solve(module, 0.3, guess=far, max_iterations=1)
    assert not solution.success
    assert "found by moving" not in solution.message
    assert kc.solve(module, 0.3, guess=far).success

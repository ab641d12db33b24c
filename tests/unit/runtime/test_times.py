"""Times at which a coordinate has given values: equally spaced in crank angle, not in time."""

import numpy as np
import pytest
import sympy

import kincompile as kc


def crank(angle, **options) -> kc.Mechanism:
    m = kc.Mechanism("crank", **options)
    m.add(kc.Revolute("pin", m.ground, (0, 0), m.body("arm"), (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", "arm", angle))
    return m


def test_that_a_quadratic_driver_is_inverted():
    module = kc.compile(crank(0.3 + kc.t**2))
    wanted = np.linspace(0.3, 4.3, 51)
    found = kc.times_at(module, "arm.phi", wanted, np.linspace(0, 2, 11))
    assert found == pytest.approx(np.sqrt(wanted - 0.3), abs=1e-7)
    assert kc.solve(module, found)["arm.phi"] == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("title", ["modified sine", "polynomial 4-5-6-7"])
def test_that_a_motion_law_is_inverted_from_rest_to_rest(title):
    """At both ends the rate is zero, and Newton's method alone would divide by it."""
    law = kc.motion.sequence([(1, 90 * kc.deg), (3, 0)], title)
    module = kc.compile(crank(law))
    wanted = np.linspace(np.pi / 2, 0, 91)
    found = kc.times_at(module, "arm.phi", wanted, np.linspace(1, 3, 21))
    assert (np.diff(found) > 0).all()
    assert kc.solve(module, found)["arm.phi"] == pytest.approx(wanted, abs=1e-12)
    assert found + found[::-1] == pytest.approx(np.full(91, 4.0), abs=1e-4)


@pytest.mark.parametrize(
    ("values", "times", "message"),
    [
        ([0.5], np.linspace(0, 4, 41), "arm.phi is not monotonic at about t = 1.6"),
        ([3.0], np.linspace(0, 1, 11), "goes from 0 to 0.841471 .* and never is 3"),
        ([0.5], [0.0], "is not monotonic at any time"),
    ],
)
def test_that_a_coordinate_that_does_not_tell_the_time_is_refused(values, times, message):
    module = kc.compile(crank(sympy.sin(kc.t)))
    with pytest.raises(kc.InputError, match=message):
        kc.times_at(module, "arm.phi", values, times)


def test_that_an_unknown_column_is_refused():
    with pytest.raises(kc.InputError, match="did you mean"):
        kc.times_at(kc.compile(crank(kc.t)), "arm.phj", [0.1], [0.0, 1.0])

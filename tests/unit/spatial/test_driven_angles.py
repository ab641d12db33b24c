"""An angle that counts turns starts in the turn that the driver beside it says."""

import numpy as np
import pytest

import kincompile as kc
from kincompile import spatial

X, Z = (1, 0, 0), (0, 0, 1)
PITCH = 0.3


def wheel():
    """Return a wheel and a nut on a screw, with motors of `rate` and twice that."""
    m = spatial.Mechanism("wheel")
    rate = m.parameter("rate", 50.0)
    angle = rate * kc.t
    body = m.body("disc", (0, 0, 0))
    m.add(spatial.Revolute("O", m.ground, (0, 0, 0), Z, body, (0, 0, 0), Z))
    m.add(spatial.JointAngle("turn", m.ground, Z, X, body, Z, X))
    m.add(spatial.RelativeRotation("motor", m.ground, Z, X, body, Z, X, angle))
    nut = m.body("nut", (1, 0, 0))
    m.add(spatial.Screw("S", m.ground, (1, 0, 0), Z, X, nut, (0, 0, 0), Z, X, PITCH))
    m.add(spatial.RelativeRotation("drive", m.ground, Z, X, nut, Z, X, 2 * angle))
    return m


@pytest.mark.parametrize("times", [1.0, [-1.0, 0.5], [3.0, 2.0]])
@pytest.mark.parametrize(
    "options",
    [
        {},
        pytest.param({"form": "grouped"}, marks=pytest.mark.slow),
        pytest.param({"target": "c"}, marks=pytest.mark.slow),
    ],
    ids=str,
)
def test_that_angles_are_those_of_their_drivers_at_any_first_time(options, times):
    found = kc.solve(kc.compile(wheel(), **options), times)
    assert found.success, found.message
    np.testing.assert_allclose(found["theta_turn"], 50 * found.t, rtol=1e-13)
    np.testing.assert_allclose(found["theta_S"], 100 * found.t, rtol=1e-13)
    np.testing.assert_allclose(found["nut.z"], PITCH * 100 * found.t / (2 * np.pi), rtol=1e-12)
    columns = [found.coordinates.index(name) for name in ("theta_turn", "theta_S")]
    np.testing.assert_allclose(found.q_dot[:, columns], [[50, 100]] * found.t.size, rtol=1e-12)
    np.testing.assert_allclose(found.q_ddot[:, columns], 0, atol=1e-8)


def test_that_each_set_of_parameters_starts_in_its_own_turn():
    rates = np.array([[-30.0], [5.0], [77.0]])
    module = kc.compile(wheel())
    for rate in rates:
        found = kc.solve(module, 1.0, rate)
        np.testing.assert_allclose(found["theta_turn"], rate, rtol=1e-13)


def test_that_a_spring_beside_a_motor_is_wound_as_the_motor_says():
    """Its torque holds the wound spring, and the driver's work is the spring's energy."""
    m = wheel()
    disc = m.bodies[0]
    m.add(spatial.TorsionSpring("coil", m.ground, Z, X, disc, Z, X, 10, 0))
    found = kc.solve(kc.compile(m), 1.0)
    np.testing.assert_allclose(found["theta_coil_angle"], 50, rtol=1e-13)
    loads = kc.forces(found)
    np.testing.assert_allclose(np.abs(loads.drivers["motor"].value), 500, rtol=1e-12)
    assert set(loads.drivers) == {"motor", "drive"}


def test_that_other_crosses_and_other_hinges_count_from_their_guess():
    m = wheel()
    disc = m.bodies[0]
    m.add(spatial.JointAngle("aside", m.ground, Z, (0, 1, 0), disc, Z, X, guess=7.0))
    found = kc.solve(kc.compile(m), 1.0)
    np.testing.assert_allclose(found["theta_turn"], 50)
    away = (found["theta_aside"] - (50 - np.pi / 2)) / (2 * np.pi)
    np.testing.assert_allclose(away, np.round(away), atol=1e-12)
    assert np.abs(found["theta_aside"] - 7) < np.pi


def test_that_the_joint_is_shown_and_written_as_given():
    m = wheel()
    text = kc.inspect(m).to_text()
    assert "Driven" not in text
    drivers = [item.name for item in m.system().constraints if item.is_driver]
    assert drivers == ["motor", "drive"]


def test_that_emitted_text_names_the_types_of_the_model():
    m = wheel()
    disc = m.bodies[0]
    m.add(spatial.JointAngle("aside", m.ground, Z, (0, 1, 0), disc, Z, X))
    text = kc.emit(m).source
    assert "Driven" not in text
    assert 'JointAngle "turn"' in text
    assert 'JointAngle "aside"' in text

"""What design asks of forces: flywheels and balancing masses, against closed forms."""

from pathlib import Path

import numpy as np
import pytest
import sympy

import kincompile as kc

BALANCED = Path(__file__).resolve().parents[3] / "examples" / "balanced_four_bar.py"


def press(speed=20.0, load=None, angle=None):
    """Return a shaft that needs the torque 10 + 5 sin(2 phi)."""
    m = kc.Mechanism("press")
    shaft = m.body("shaft", mass=2, inertia=0.1)
    m.add(kc.Revolute("O", m.ground, (0, 0), shaft, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", shaft, speed * kc.t if angle is None else angle))
    m.add(kc.Torque("work", shaft, -10 - 5 * sympy.sin(2 * shaft.phi) if load is None else load))
    return kc.compile(m)


def cycle(module, speed=20.0, points=181):
    """Return the forces over one turn."""
    return kc.forces(kc.solve(module, np.linspace(0, 2 * np.pi / speed, points)))


def test_that_a_flywheel_stores_half_a_wave_of_torque():
    """Between 0 and pi/2 the load takes 5 J more than the motor's mean: the integral of 5 sin."""
    wheel = kc.flywheel(cycle(press()), "motor", 0.02)
    assert wheel.energy == pytest.approx(5, rel=1e-6)
    assert wheel.inertia == pytest.approx(5 / (0.02 * 400), rel=1e-6)
    assert wheel.mean_torque == pytest.approx(10, rel=1e-9)
    assert wheel.speed == pytest.approx(20, rel=1e-12)
    turns = np.array([wheel.t_slowest, wheel.t_fastest]) * 20 / np.pi
    assert turns[0] % 1 == pytest.approx(0.5, abs=1e-6)
    assert min(turns[1] % 1, 1 - turns[1] % 1) == pytest.approx(0, abs=1e-6)
    assert "flywheel for motor: inertia 0.625" in str(wheel)


def test_that_a_machine_with_its_flywheel_keeps_within_the_fluctuation():
    """Free to turn, J w dw/dphi = mean - load: the speeds follow from energy alone."""
    wheel = kc.flywheel(cycle(press()), "motor", 0.02)
    phi = np.linspace(0, 2 * np.pi, 2001)
    stored = 2.5 * np.cos(2 * phi)
    speeds = np.sqrt(400 + 2 * stored / wheel.inertia)
    assert np.ptp(speeds) / speeds.mean() == pytest.approx(0.02, rel=1e-3)


def test_what_a_flywheel_is_refused_for():
    found = cycle(press())
    with pytest.raises(kc.InputError, match=r"no driver 'motr'; did you mean 'motor'"):
        kc.flywheel(found, "motr", 0.02)
    with pytest.raises(kc.InputError, match="the fluctuation is 2: give a part"):
        kc.flywheel(found, "motor", 2)
    with pytest.raises(kc.InputError, match="a cycle has 5 points"):
        kc.flywheel(cycle(press(), points=5), "motor", 0.02)
    with pytest.raises(kc.InputError, match="expected Forces, got Solution"):
        kc.flywheel(found.motion, "motor", 0.02)
    uneven = press(angle=20 * kc.t + sympy.sin(20 * kc.t))
    with pytest.raises(kc.InputError, match="does not run at a constant speed"):
        kc.flywheel(cycle(uneven), "motor", 0.02)
    part = kc.forces(kc.solve(press(), np.linspace(0, 0.05, 20)))
    with pytest.raises(kc.InputError, match="solve over one whole cycle"):
        kc.flywheel(part, "motor", 0.02)
    with pytest.raises(kc.InputError, match="or nothing loads it"):
        kc.flywheel(cycle(press(load=0.0)), "motor", 0.02)


def test_that_counterweights_of_berkof_and_lowen_leave_no_shaking_force():
    model = kc.read_model(BALANCED)
    assert isinstance(model, kc.Mechanism)
    module = kc.compile(model)
    times = np.linspace(0, np.pi / 10, 91)
    shares = [0.0, 0.5, 1.0]
    found = [kc.forces(kc.solve(module, times, {"share": share})) for share in shares]
    weights = [(2.5 + 7 * share) * 9.81 for share in shares]
    for one, weight in zip(found, weights, strict=True):
        # Over whole cycles the momentum returns: the mean is the weight alone.
        mean = one.ground.force[:-1].mean(axis=0)
        np.testing.assert_allclose(mean, (0, -weight), rtol=0, atol=1e-9 * 163)
    swings = [np.ptp(one.ground.force, axis=0) for one in found]
    assert (swings[0] > 100).all()
    np.testing.assert_allclose(swings[1], swings[0] / 2, rtol=1e-9)
    np.testing.assert_allclose(swings[2], 0, atol=1e-10 * swings[0].max())
    # A moment is left, and grows with the inertia of the counterweights.
    assert np.ptp(found[2].ground.moment) > 1


def test_that_counterweights_balance_at_any_lengths_and_speeds():
    model = kc.read_model(BALANCED)
    module = kc.compile(model)
    lengths = {"a": 0.12, "b": 0.33, "c": 0.22, "d": 0.3}
    times = np.linspace(0, 1, 40) ** 2
    found = kc.forces(kc.solve(module, times, {**lengths, "omega": 7.0}))
    assert found.motion.success
    np.testing.assert_allclose(np.ptp(found.ground.force, axis=0), 0, atol=1e-9)

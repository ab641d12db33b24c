"""Torsion springs and friction of joints in space, against closed forms, free bodies and slopes."""

import math
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from tests.unit.dynamics.test_space import g_of, inertia_of, state

AXIS, CROSS, ORIGIN = (1.0, 2.0, 2.0), (2.0, 1.0, -2.0), (0.0, 0.0, 0.0)
UNIT = np.array(AXIS) / 3
ABOUT = (AXIS, CROSS)


def wheel(inertia=None):
    """Return a mechanism with one body on a hinge that no axis of the world is along."""
    m = spatial.Mechanism("wheel")
    own = inertia_of(3) if inertia is None else inertia
    body = m.body("wheel", mass=2, inertia=own.tolist())
    m.add(spatial.Revolute("O", m.ground, (0.3, 0.1, 0.2), AXIS, body, ORIGIN, AXIS))
    return m, body, UNIT @ own @ UNIT


def test_that_a_torsion_pendulum_swings_over_several_turns():
    m, body, moment = wheel()
    m.add(spatial.TorsionSpring("clock", m.ground, *ABOUT, body, *ABOUT, 0.5 * moment, 8.0))
    t = np.linspace(0, 9, 19)
    found = kc.simulate(kc.compile(m), t, rtol=1e-11)
    expected = 8 * (1 - np.cos(math.sqrt(0.5) * t))
    assert expected.max() > 4 * math.pi
    np.testing.assert_allclose(found["theta_clock_angle"], expected, atol=1e-7)
    pull = kc.forces(found)["clock.load"]
    np.testing.assert_allclose(pull, 0.5 * moment * (expected - 8), atol=1e-6 * moment)


def test_that_a_damper_about_a_hinge_brings_it_to_rest():
    m, body, moment = wheel()
    m.add(spatial.TorsionSpring("clock", m.ground, *ABOUT, body, *ABOUT, damping=0.7 * moment))
    start = {f"wheel.omega_{axis}": 5 * u for axis, u in zip("xyz", UNIT, strict=True)}
    t = np.linspace(0, 3, 7)
    found = kc.simulate(kc.compile(m), t, velocity=start, rtol=1e-11)
    expected = 5 / 0.7 * (1 - np.exp(-0.7 * t))
    np.testing.assert_allclose(found["theta_clock_angle"], expected, atol=1e-8)


def slowed(v, a):
    """Return the integrals of sqrt(v^2 + a^2)/v and of sqrt(v^2 + a^2)."""
    w = np.hypot(v, a)
    return w - a * np.log((a + w) / v), (v * w + a**2 * np.arcsinh(v / a)) / 2


def check_slowed(t, way, velocity, deceleration, a):
    """Check a motion that dry friction brakes: time and way follow from the velocity alone."""
    time, length = slowed(velocity, a)
    np.testing.assert_allclose((time[0] - time) / deceleration, t, atol=1e-7)
    np.testing.assert_allclose((length[0] - length) / deceleration, way - way[0], atol=1e-7)


@pytest.mark.slow
def test_that_friction_brakes_a_hinge_by_its_law():
    m, body, moment = wheel()
    friction = spatial.HingeFriction("dry", m.ground, AXIS, body, AXIS, 0.8 * moment, 0.3)
    m.add(friction)
    m.add(spatial.JointAngle("turn", m.ground, *ABOUT, body, *ABOUT))
    start = {f"wheel.omega_{axis}": 2 * u for axis, u in zip("xyz", UNIT, strict=True)}
    found = kc.simulate(kc.compile(m), np.linspace(0, 3, 13), velocity=start, rtol=1e-11)
    angle, rate = found["theta_turn"], found["theta_turn_dot"]
    assert rate[-1] < 0.1
    check_slowed(found.t, angle, rate, 0.8, 0.3)
    forces = kc.forces(found)
    about = forces.reactions["O"].moment @ UNIT
    np.testing.assert_allclose(about, 0, atol=1e-9)  # the hinge bears none of it
    held = 0.8 * moment * rate / np.hypot(rate, 0.3)
    np.testing.assert_allclose(forces["dry.load"], held, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("guide", ["Translational", "Cylindrical"])
def test_that_friction_brakes_a_sliding_block_by_its_law(guide):
    m = spatial.Mechanism("block")
    block = m.body("block", mass=2, inertia=(1, 1, 1))
    if guide == "Translational":
        across = tuple(np.cross(AXIS, CROSS))
        m.add(spatial.Translational("G", m.ground, ORIGIN, *ABOUT, block, ORIGIN, AXIS, across))
    else:
        m.add(spatial.Cylindrical("G", m.ground, ORIGIN, AXIS, block, ORIGIN, AXIS))
    m.add(spatial.SliderFriction("dry", m.ground, ORIGIN, AXIS, block, (0.1, 0.3, 0), 1.5, 0.2))
    start = {f"block.{axis}_dot": 2 * u for axis, u in zip("xyz", UNIT, strict=True)}
    found = kc.simulate(kc.compile(m), np.linspace(0, 3, 13), velocity=start, rtol=1e-11)
    way, velocity = (
        sum(u * found[f"block.{axis}{dot}"] for axis, u in zip("xyz", UNIT, strict=True))
        for dot in ("", "_dot")
    )
    check_slowed(found.t, way, velocity, 0.75, 0.2)


@cache
def compiled_pair():
    return kc.compile(pair())


def pair():
    """Return two bodies on a hinge with springs and friction, whose values vary too."""
    m = spatial.Mechanism("pair")
    one, two = (m.body(name, mass=1, inertia=(1, 1, 1)) for name in ("one", "two"))
    m.add(spatial.Revolute("A", one, (0.1, 0.2, 0), AXIS, two, (0, 0.3, 0.1), AXIS))
    turn = m.add(spatial.JointAngle("turn", one, *ABOUT, two, *ABOUT))
    about = (one, *ABOUT, two, *ABOUT)
    m.add(spatial.TorsionSpring("s", *about, 6, 0.4, 0.2, one.x * two.y_dot, angle=turn.theta))
    m.add(spatial.HingeFriction("f", one, AXIS, two, AXIS, 1.5 + two.z**2, 0.5))
    return m


def hinged(seed):
    """Return a state in which body two turns about the hinge: q, q_dot, its angle and rate."""
    q, q_dot = state(seed, 14)
    angle, rate = 0.9, -1.3
    first = Rotation.from_quat(q[3:7], scalar_first=True)
    second = first * Rotation.from_rotvec(angle * UNIT)
    q[10:] = second.as_quat(scalar_first=True)
    spin = 2 * g_of(q[3:7]) @ q_dot[3:7]
    relative = second.inv().apply(first.apply(spin)) + rate * UNIT
    q_dot[10:] = g_of(q[10:]).T @ relative / 2
    return np.append(q, angle), np.append(q_dot, rate)


@pytest.mark.parametrize("seed", range(3))
def test_that_loads_about_a_hinge_turn_its_bodies_against_each_other(seed):
    """In coordinates p a torque n' along the body's axes is 2 G^T n' (Haug 9.3)."""
    module, (q, q_dot) = compiled_pair(), hinged(seed)
    angle, rate = q[-1], q_dot[-1]
    spring = 6 * (angle - 0.4) + 0.2 * rate + q[0] * q_dot[8]
    friction = (1.5 + q[9] ** 2) * rate / math.hypot(rate, 0.5)
    torque = -(spring + friction) * UNIT  # of body two, along the axes of either
    found = module.Q(q, q_dot, 0.0)
    for columns, sign in ((slice(3, 7), -1), (slice(10, 14), 1)):
        p, p_dot = q[columns], q_dot[columns]
        gyroscopic = 8 * g_of(p_dot).T @ g_of(p_dot) @ p
        expected = gyroscopic + sign * 2 * g_of(p).T @ torque
        np.testing.assert_allclose(found[columns], expected, atol=1e-12)
    assert not found[14]


@pytest.mark.parametrize("seed", range(2))
def test_that_they_have_their_slopes_off_the_hinge_too(seed):
    module, (q, q_dot) = compiled_pair(), state(seed, 15)
    for name, reads in (("Q_q", 0), ("Q_q_dot", 1)):
        jacobian = getattr(module, name)(q, q_dot, 0.0)
        for k in range(15):
            both = [q.astype(complex), q_dot.astype(complex)]
            both[reads][k] += 1e-30j
            slope = module.Q(*both, 0.0).imag / 1e-30
            np.testing.assert_allclose(jacobian[:, k], slope, atol=1e-11)


@pytest.mark.slow
def test_that_what_they_do_changes_the_energy():
    """The energy of a swinging pair changes by the work of what acts on it."""
    m = pair()
    m.add(spatial.SliderFriction("rub", m.ground, ORIGIN, AXIS, "two", (0, 0.2, 0.3), 2, 0.4))
    m.gravity = (0, 0, -9.81)
    m.add(spatial.Spherical("ball", m.ground, ORIGIN, "one", (0.2, 0, 0)))
    found = kc.simulate(
        kc.compile(m), np.linspace(0, 1, 11), velocity={"two.omega_x": 3}, rtol=1e-11
    )
    assert np.abs(found["work"]).max() > 1
    np.testing.assert_allclose(found["energy_drift"], 0, atol=1e-8)


def test_that_a_wound_spring_holds_an_arm_in_its_turn():
    """An arm of weight G at the distance l rests where k (angle - free) = -G l cos(angle)."""
    m = spatial.Mechanism("arm")
    m.gravity = (0, 0, -10)
    arm = m.body("arm", (0, 0, 0), mass=0.5, inertia=(0.1, 0.1, 0.1), centre=(0.2, 0, 0))
    y, x = (0, -1, 0), (1, 0, 0)
    m.add(spatial.Revolute("O", m.ground, ORIGIN, y, arm, ORIGIN, y))
    swing = m.add(spatial.JointAngle("swing", m.ground, y, x, arm, y, x, guess=4 * math.pi))
    about = (m.ground, y, x, arm, y, x)
    m.add(spatial.TorsionSpring("clock", *about, 3, 4 * math.pi, angle=swing.theta))
    rest = kc.equilibrium(kc.compile(m))
    angle = rest["theta_swing"][0]
    assert 3 * (angle - 4 * math.pi) == pytest.approx(-math.cos(angle), abs=1e-9)
    assert rest.stability == ("stable",)
    assert rest.stiffness("theta_swing") == pytest.approx(3 - math.sin(angle), rel=1e-8)


def test_that_files_keep_them_and_give_a_spring_its_angle(tmp_path):
    m = pair()
    path = tmp_path / "pair.toml"
    path.write_text(m.to_toml(), encoding="utf-8")
    assert kc.read_model(path).to_toml() == m.to_toml()
    text = m.to_toml().replace(', angle = "theta_turn"', "")
    path.write_text(text, encoding="utf-8")
    read = kc.read_model(path).system()
    assert read.coordinates[-1].name == "theta_s_angle"
    assert [item.name for item in read.loads if item.name in "sf"] == ["s", "f"]


def test_that_what_is_wrong_with_them_is_said_with_its_names():
    m, body, _ = wheel()
    m.add(spatial.TorsionSpring("clock", m.ground, *ABOUT, body, AXIS, AXIS, 3))
    m.add(spatial.HingeFriction("dry", m.ground, ORIGIN, body, AXIS, 3))
    m.add(spatial.HingeFriction("wet", m.ground, AXIS, body, AXIS, -3))
    m.add(kc.SliderFriction("rub", m.ground, (0, 0), (1, 0), body, (0, 0), 1))
    m.add(kc.TorsionSpring("flat", m.ground, body, 1))
    with pytest.raises(kc.ModelError) as caught:
        m.system()
    for part in (
        "TorsionSpring 'clock': cross_j lies along axis_j",
        "HingeFriction 'dry', axis_i",
        "HingeFriction 'wet': friction of -3 would drive",
        "take spatial.SliderFriction",
        "take spatial.TorsionSpring",
    ):
        assert part in str(caught.value)

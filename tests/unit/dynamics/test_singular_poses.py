"""Chains of equal parallelograms that turn under gravity: the published benchmark of such poses.

Wherever the cranks lie down Phi_q loses as many ranks as there are parallelograms. The cranks stay
parallel all the time, so that the motion is that of one physical pendulum.
"""

import math
import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp  # type: ignore[attr-defined]  # a star there
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from kincompile.runtime.dynamics.equations import Equations, dynamics_of
from kincompile.runtime.dynamics.happenings import SINGULAR, Watch
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.singular.events import LOCK_UP

G = 9.81
TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10)


def chain(count, *, longer=0.0):
    """Return parallelograms in a row, all rods of 1 m and 1 kg; the last rod may be longer."""
    m = kc.Mechanism("chain")
    m.gravity = (0, -G)
    given = {"mass": 1, "inertia": 1 / 12}
    cranks = [m.body(f"crank{k}", (k, 0.5, math.pi / 2), **given) for k in range(count + 1)]
    for k, crank in enumerate(cranks):
        m.add(kc.Revolute(f"O{k}", m.ground, (k, 0), crank, (-0.5, 0)))
    for k in range(count):
        rod = m.body(f"rod{k}", (k + 0.5, 1, 0), **given)
        end = 0.5 + longer * (k == count - 1)
        m.add(kc.Revolute(f"A{k}", cranks[k], (0.5, 0), rod, (-0.5, 0)))
        m.add(kc.Revolute(f"B{k}", rod, (end, 0), cranks[k + 1], (0.5, 0)))
    return m


def pull(count):
    """Return what the angle's acceleration is -cos(angle) of."""
    return ((count + 1) / 2 + count) * G / ((count + 1) / 3 + count)


def pendulum(count, t, speed=-1.0):
    """Return the angle over time from the upright, and the times at which the cranks lie down."""

    def rate(_, y):
        return y[1], -pull(count) * math.cos(y[0])

    def lies(_, y):
        return math.sin(y[0])

    start, span = (math.pi / 2, speed), (t[0], t[-1])
    found = solve_ivp(rate, span, start, "DOP853", t, events=lies, rtol=1e-12, atol=1e-12)
    return found.y[0], found.t_events[0]


def check(count, t, rtol, **options):
    """Compare a motion with the pendulum; without a way through it ends at the first pose."""
    module = kc.compile(chain(count))
    angle, flat = pendulum(count, t)
    start = {"velocity": {"crank0.phi": -1}, "rtol": rtol, **options}
    found = kc.simulate(module, t, through="smooth", **start)
    assert found.success, found.message
    allowed = 4e3 * rtol if options.get("method", "DOP853") == "DOP853" else 0.02
    for k in range(count + 1):
        np.testing.assert_allclose(found[f"crank{k}.phi"], angle, atol=allowed)
    assert [event.kind for event in found.events] == [SINGULAR] * len(flat)
    np.testing.assert_allclose([event.t for event in found.events], flat, atol=allowed)
    for event in found.events:
        assert len(event.bodies) == 2 * count + 1
    ended = kc.simulate(module, t, **start)
    assert not ended.success
    assert [event.kind for event in ended.events] == [SINGULAR]
    assert ended.events[0].t == pytest.approx(flat[0], abs=allowed / 10)
    known = t < ended.events[0].t
    assert np.isfinite(ended.q[known]).all()
    assert np.isnan(ended.q[t > ended.events[0].t + 1e-9]).all()


@pytest.mark.parametrize(("count", "rtol"), [(1, 1e-6), (2, 1e-10)])
def test_that_chains_go_through_every_pose(count, rtol):
    check(count, np.linspace(0, 3, 61), rtol)


@pytest.mark.slow
@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize("count", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("end", [10, 20])
def test_that_chains_go_through_every_pose_at_any_tolerance(count, rtol, end):
    check(count, np.linspace(0, end, 20 * end + 1), rtol)


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10])
def test_that_a_long_chain_goes_through_every_pose(rtol):
    check(40, np.linspace(0, 20, 201), rtol)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["Radau", "BDF", "CVODE"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10])
def test_that_every_method_goes_through_every_pose(method, rtol):
    if method == "CVODE":
        pytest.importorskip("sksundae")
    check(2, np.linspace(0, 5, 101), rtol, method=method)


def test_that_an_implicit_method_goes_through():
    check(2, np.linspace(0, 1.5, 16), 1e-7, method="Radau")


def test_that_a_motion_goes_through_backwards():
    t = np.linspace(3, 0, 31)
    module, start = kc.compile(chain(2)), {"velocity": {"crank0.phi": 1}}
    found = kc.simulate(module, t, through="smooth", **start)
    np.testing.assert_allclose(found["crank2.phi"], pendulum(2, 3 - t)[0], atol=1e-7)


def test_that_rates_beside_a_pose_are_those_of_the_motion():
    flat = pendulum(2, np.array([0.0, 1.0]))[1][0]
    t = np.array([0, *(flat + x for x in (-1e-3, -1e-6, -1e-9, 0, 1e-9, 1e-6, 1e-3)), 1])
    start = {"velocity": {"crank0.phi": -1}, "rtol": 1e-10}
    found = kc.simulate(kc.compile(chain(2)), t, through="smooth", **start)
    angle = found["crank1.phi"]
    np.testing.assert_allclose(angle, pendulum(2, t)[0], atol=1e-9)
    np.testing.assert_allclose(found["crank1.phi_ddot"], -pull(2) * np.cos(angle), atol=1e-4)


@pytest.mark.parametrize("longer", [1e-4, pytest.param(1e-7, marks=pytest.mark.slow)])
def test_that_a_slight_length_makes_it_turn_away(longer):
    """No pose is there: the linkage turns about it within the root of what is missing."""
    module, t = kc.compile(chain(1, longer=longer)), np.linspace(0, 1.2, 13)
    start = {"velocity": {"crank0.phi": -1}, "through": "smooth"}
    rough, fine = (kc.simulate(module, t, rtol=rtol, **start) for rtol in (1e-7, 1e-10))
    assert rough.success
    assert not rough.events
    np.testing.assert_allclose(rough.q, fine.q, atol=1e-5)
    assert np.abs(fine["crank0.phi"] - fine["crank1.phi"])[-1] > 0.5
    assert np.abs(fine["energy_drift"]).max() < 1e-6


@pytest.mark.parametrize("rtol", [1e-6, 1e-10])
def test_that_a_driven_chain_and_a_free_arm_go_through(rtol):
    m = chain(1)
    arm = m.body("arm", (0.5, 0.5, -math.pi / 2), mass=0.5, inertia=0.01)
    m.add(kc.Revolute("H", "rod0", (0, 0), arm, (-0.5, 0)))
    m.add(kc.AbsoluteAngle("motor", "crank0", math.pi / 2 + 2 * kc.t))
    t = np.linspace(0, 3, 31)

    def rate(time, y):
        x, z = (-4 * f(math.pi / 2 + 2 * time) for f in (math.cos, math.sin))
        force = (z + G) * math.cos(y[0]) - x * math.sin(y[0])
        return y[1], -0.25 * force / (0.01 + 0.125)

    angle = solve_ivp(rate, (0, 3), (-math.pi / 2, 0), "DOP853", t, rtol=1e-12, atol=1e-12).y[0]
    module, start = kc.compile(m), {"velocity": {"arm.phi": 0}, "rtol": rtol}
    found = kc.simulate(module, t, through="smooth", **start)
    np.testing.assert_allclose(found["arm.phi"], angle, atol=100 * rtol)
    np.testing.assert_allclose(found["crank1.phi"], math.pi / 2 + 2 * t, atol=1e-12)
    flat = [math.pi / 4, math.pi * 3 / 4]
    np.testing.assert_allclose([event.t for event in found.events], flat, atol=1e-8)
    ended = kc.simulate(module, t, **start)
    assert [event.kind for event in ended.events] == [SINGULAR]
    assert ended.events[0].t == pytest.approx(math.pi / 4, abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("has_balls", [True, False])
def test_that_a_parallelogram_in_space_goes_through(has_balls):
    turn = Rotation.from_euler("xyz", (0.4, -1.1, 0.8)).as_matrix()
    m = spatial.Mechanism("flat")
    m.gravity = tuple(turn @ (0, -G, 0))

    def body(name, place, angle):
        c, s = math.cos(angle), math.sin(angle)
        return m.body(
            name, tuple(turn @ (*place, 0)), x=tuple(turn @ (c, s, 0)), y=tuple(turn @ (-s, c, 0)),
            mass=1, inertia=(0.01, 1 / 12, 1 / 12),
        )  # fmt: skip

    a, b = body("a", (0, 0.5), math.pi / 2), body("b", (1, 0.5), math.pi / 2)
    rod, z, e_z = body("rod", (0.5, 1), 0), tuple(turn[:, 2]), (0, 0, 1)
    left, right = (-0.5, 0, 0), (0.5, 0, 0)
    m.add(spatial.Revolute("O", m.ground, (0, 0, 0), z, a, left, e_z))
    m.add(spatial.Revolute("P", m.ground, tuple(turn[:, 0]), z, b, left, e_z))
    for name, crank, end in (("A", a, left), ("B", b, right)):
        if has_balls:
            m.add(spatial.Spherical(name, crank, right, rod, end))
        else:
            m.add(spatial.Revolute(name, crank, right, e_z, rod, end, e_z))
    t = np.linspace(0, 1.5, 16)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", kc.RedundantConstraintWarning)
        module = kc.compile(m)
    angle, flat = pendulum(1, t)
    for rtol in (1e-6, 1e-10):
        start = {"velocity": {"a.omega_zeta": -1}, "rtol": rtol}
        found = kc.simulate(module, t, through="smooth", **start)
        place = 2 * np.stack([found[f"b.{x}"] for x in "xyz"], axis=1) @ turn
        across = np.cos(angle), np.sin(angle)
        np.testing.assert_allclose(place[:, 0] - 2, across[0], atol=200 * rtol)
        np.testing.assert_allclose(place[:, 1], across[1], atol=200 * rtol)
        assert [event.t for event in found.events] == pytest.approx(flat, abs=200 * rtol)


def test_that_a_step_that_cannot_be_led_back_is_taken_in_parts(monkeypatch):
    module, t = kc.compile(chain(1)), np.linspace(0, 0.5, 6)
    start = {"velocity": {"crank0.phi": -1}}
    as_ever = kc.simulate(module, t, **start)
    held = Equations.corrected
    failures: list[float] = []

    def corrected(self, time, y):
        if time > 0.1 and len(failures) < 4:
            failures.append(time)
            return y, np.nan
        return held(self, time, y)

    monkeypatch.setattr(Equations, "corrected", corrected)
    found = kc.simulate(module, t, **start)
    assert len(failures) == 4
    assert found.success
    np.testing.assert_allclose(found.q, as_ever.q, atol=1e-8)


@pytest.mark.parametrize("motor", [None, 0.01])
def test_that_only_what_is_driven_locks_up(motor):
    """Beside the pose a motion that ends is a lock-up only where a driver demands a velocity."""
    m = chain(2)
    if motor is not None:
        m.add(kc.AbsoluteX("motor", "rod0", (0, 0), 1.5 - motor * kc.t))
    module, angle = kc.compile(m), 1e-4
    inputs = read_inputs(module, [0.0, 1.0], None, None, 1e-10, 50, may_move=True)
    equations = Equations(inputs, dynamics_of(inputs.code))
    q = np.zeros(module.N_COORDINATES)
    for body, first, _ in module.BODIES:
        k, is_crank = int(body[-1]), body.startswith("crank")
        reach = 0.5 if is_crank else 1.0
        q[first] = reach * math.cos(angle) + k + (0 if is_crank else 0.5)
        q[first + 1] = reach * math.sin(angle)
        q[first + 2] = angle if is_crank else 0.0
    event = Watch(equations, inputs, None, None, smooth=True).end_at(0.0, q)
    assert event is not None
    assert event.kind == (SINGULAR if motor is None else LOCK_UP)

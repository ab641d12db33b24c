"""Motions that follow from forces, against closed forms, Taylor series and laws of mechanics."""

import math

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import kincompile as kc
from kincompile.runtime.dynamics.equations import Equations, dynamics_of
from kincompile.runtime.inputs import read_inputs
from tests.unit.dynamics.heavy import heavy_examples

G = 9.81


def point_pendulum():
    """Return the pendulum A01 of the IFToMM benchmarks: a point on a rod of 1 m, 1 kg."""
    m = kc.Mechanism("A01")
    m.gravity = (0, -G)
    bob = m.body("bob", (-1, 0, 0), mass=1, inertia=1)
    m.add(kc.AbsoluteDistance("rod", bob, (0, 0), (0, 0), 1.0))
    m.add(kc.AbsoluteAngle("level", bob, 0))
    return m


A01 = {
    1.0: (0.986291751131875, -0.165010853125541, 0.296905515916316, 1.77464364111266),
    2.0: (-0.793566195343322, -0.608483930443792, -2.10243787443613, 2.74193539301051),
    5.0: (-0.942305435043757, -0.334754338414001, 0.857904256885949, -2.41492865437049),
    10.0: (-0.275087462576117, -0.961419205099125, 4.17559810095173, -1.19474905456048),
}
TENSIONS = (4.85626940748468, 17.9076820729608, 9.85182017952404, 28.2945672060673)
"""F1: x, y and their rates by Jacobi's functions, and the force in the rod."""


def double_pendulum():
    """Return two uniform rods of 1 m, 1 kg; the first begins horizontal, the second hangs."""
    m = kc.Mechanism("double_pendulum")
    m.gravity = (0, -G)
    first = m.body("first", (0.5, 0, 0), mass=1, inertia=1 / 12)
    second = m.body("second", (1, -0.5, -math.pi / 2), mass=1, inertia=1 / 12)
    m.add(kc.Revolute("O", m.ground, (0, 0), first, (-0.5, 0)))
    m.add(kc.Revolute("A", first, (0.5, 0), second, (-0.5, 0)))
    return m


DOUBLE = {
    0.5: (0.0482156433623758, 1.05233953268088, -4.50229192759309, 1.30113172421796),
    1.0: (-0.520277645858893, -1.90439876241116, -0.236777825234758, -6.04316197623801),
    2.0: (0.896870018580379, -6.59309391380594, 2.19444244111614, -7.15585327586223),
}
"""F3: angles from down and their rates, by a Taylor series in angles."""


def four_bar(*, motor=None):
    """Return a four-bar with eccentric masses, driven where a law is given."""
    m = kc.Mechanism("four_bar")
    m.gravity = (0.3, -G)
    crank = m.body("crank", (0.1, 0.1, 1), mass=1, inertia=0.02, centre=(0.1, 0.02))
    coupler = m.body("coupler", (0.3, 0.3, 0.2), mass=2, inertia=0.03, centre=(0.1, 0.02))
    rocker = m.body("rocker", (0.6, 0.2, 1.2), mass=3, inertia=0.05, centre=(-0.1, 0.02))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (-0.1, 0)))
    m.add(kc.Revolute("A", crank, (0.1, 0), coupler, (-0.3, 0)))
    m.add(kc.Revolute("B", coupler, (0.3, 0), rocker, (0.25, 0)))
    m.add(kc.Revolute("C", m.ground, (0.7, 0), rocker, (-0.25, 0)))
    m.point("foot", coupler, (0.1, 0.2))
    if motor is not None:
        m.add(kc.AbsoluteAngle("motor", crank, motor))
    return m


def potential(model, solution):
    """Return the potential energy in gravity, from positions alone."""
    total = np.zeros(solution.t.size)
    for body in model.bodies:
        x, y, phi = (solution[f"{body.name}.{letter}"] for letter in ("x", "y", "phi"))
        (a, b), c, s = body.centre, np.cos(phi), np.sin(phi)
        place = x + c * a - s * b, y + s * a + c * b
        total -= body.mass * sum(g * z for g, z in zip(model.gravity, place, strict=True))
    return total


@pytest.mark.parametrize(("target", "method"), [("numpy", "DOP853"), ("c", "DOP853")])
def test_that_the_pendulum_swings_as_jacobi_says(target, method, quick_compiler):
    module = kc.compile(point_pendulum(), target=target)
    found = kc.simulate(module, [0, *A01], method=method, rtol=1e-10)
    assert found.success
    states = np.column_stack((found.q[1:, :2], found.q_dot[1:, :2]))
    np.testing.assert_allclose(states, list(A01.values()), atol=1.6e-8)
    assert found.residual.max() < 1e-15
    rods = kc.forces(found).multipliers[1:, 0]
    np.testing.assert_allclose(2 * np.abs(rods), TENSIONS, rtol=1e-8)


def test_that_the_pendulum_has_the_period_of_the_elliptic_integral():
    k = math.sqrt(0.5)
    period = 4 * ellipk(k**2) / math.sqrt(G)
    assert period == pytest.approx(2.36784194757624, rel=1e-14)
    t = np.linspace(0, 10, 101)
    sn, cn, dn, _ = ellipj(math.sqrt(G) * t, k**2)
    angle = 2 * np.arcsin(-k * cn / dn)
    found = kc.simulate(kc.compile(point_pendulum()), t, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found["bob.x"], np.sin(angle), atol=1e-9)
    np.testing.assert_allclose(found["bob.y"], -np.cos(angle), atol=1e-9)
    assert sn.size == t.size


@pytest.mark.parametrize(("method", "error"), [("DOP853", 2e-10), ("Radau", 2e-6), ("CVODE", 2e-6)])
def test_that_the_double_pendulum_moves_as_its_taylor_series(method, error):
    rtol = 1e-11 if method == "DOP853" else 1e-8 if method == "Radau" else 1e-10
    found = kc.simulate(kc.compile(double_pendulum()), [0, *DOUBLE], method=method, rtol=rtol)
    names = "first.phi", "second.phi", "first.phi_dot", "second.phi_dot"
    states = np.column_stack([found[name] for name in names])[1:]
    states[:, :2] += math.pi / 2
    np.testing.assert_allclose(states, list(DOUBLE.values()), atol=error)
    energy = found["kinetic_energy"] + potential(double_pendulum(), found)
    # The rods hang from y = 0: -m g (0 + 0.5) at the start.
    np.testing.assert_allclose(energy, -4.905, atol=10 * error)


@pytest.mark.every(5)
@pytest.mark.parametrize(
    ("name", "target"),
    [
        *((name, "numpy") for name, _ in heavy_examples()),
        ("four_bar", "c"),
        *(pytest.param(name, "c", marks=pytest.mark.slow) for name, _ in heavy_examples()),
    ],
)
def test_that_every_example_accelerates_as_its_equations_say(name, target, quick_compiler):
    """Against LAPACK on the matrix of the equations of motion, at states on no manifold."""
    equations, module = equations_of(dict(heavy_examples())[name], target)
    n, rng = module.N_COORDINATES, np.random.default_rng(len(name))
    q = module.GUESS + 0.2 * rng.normal(size=n)
    q_dot, t = rng.normal(size=n), 0.07
    M, Q, Phi_q = module.M(q, t), module.Q(q, q_dot, t), module.Phi_q(q, t)
    m = len(Phi_q)
    both = np.block([[M, Phi_q.T], [Phi_q, np.zeros((m, m))]])
    found = equations.rate(t, np.concatenate((q, q_dot, [0.0])))
    x = np.linalg.solve(both, np.concatenate((Q, module.gamma(q, q_dot, t))))
    scale = np.linalg.cond(both) * 1e-15 * np.abs(x[:n]).max()
    np.testing.assert_allclose(found[n:-1], x[:n], rtol=1e-9, atol=scale)


def equations_of(model, target="numpy"):
    """Return the equations of motion of a model as they are compiled, and its module."""
    module = kc.compile(model, target=target)
    inputs = read_inputs(module, [0.0], None, None, 1e-10, 50, may_move=True)
    return Equations(inputs, dynamics_of(inputs.code)), module


def test_that_a_state_goes_back_to_its_constraints_by_the_way_the_masses_measure():
    equations, module = equations_of(four_bar())
    rng = np.random.default_rng(3)
    found = kc.simulate(module, [0, 0.1])
    q, v = found.q[1] + 1e-6 * rng.normal(size=9), rng.normal(size=9)
    held, drift = equations.corrected(0.0, np.concatenate((q, v, [0.0])))
    assert 0.1 < drift < 100
    position, speed = held[:9], held[9:-1]
    assert np.abs(module.Phi(position, 0.0)).max() < 1e-14
    Phi_q, M = module.Phi_q(position, 0.0), module.M(position, 0.0)
    assert np.abs(Phi_q @ speed).max() < 1e-12
    # No movement that the constraints allow changes the distance: the kick is a reaction.
    free = np.linalg.svd(Phi_q)[2][8:]
    np.testing.assert_allclose(free @ M @ (speed - v), 0, atol=1e-4 * np.abs(M @ (speed - v)).max())


@pytest.mark.parametrize("model", [double_pendulum(), four_bar()], ids=lambda m: m.name)
def test_that_energy_and_constraints_are_kept(model):
    t = np.linspace(0, 10, 201)
    found = kc.simulate(kc.compile(model), t, rtol=1e-10)
    energy = found["kinetic_energy"] + potential(model, found)
    level = np.abs(found["work"]).max()
    assert np.abs(energy - energy[0]).max() < 2e-8 * level
    assert np.abs(found["energy_drift"]).max() < 2e-8 * level
    assert found.residual.max() < 1e-14
    assert found["constraint_drift"].max() < 1e-8


def test_that_a_driver_and_a_free_arm_move_together():
    """A pendulum on a crank that is driven, against its one equation in the angle."""
    from scipy.integrate import solve_ivp  # type: ignore[attr-defined]  # a star there

    m = kc.Mechanism("whirl")
    m.gravity = (0, -G)
    crank = m.body("crank", (0, 0, 0), mass=1, inertia=0.01)
    arm = m.body("arm", (0.3, -0.25, -1.5), mass=2, inertia=0.05)
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 3 * kc.t + kc.t**2))
    m.add(kc.Revolute("A", crank, (0.3, 0), arm, (-0.25, 0)))
    t = np.linspace(0, 3, 31)
    found = kc.simulate(kc.compile(m), t, position={"arm.phi": -1.5}, rtol=1e-11)
    assert found.success

    def pendulum(time, state):
        angle, rate = 3 * time + time**2, 3 + 2 * time
        support = 0.3 * np.array([
            -rate**2 * math.cos(angle) - 2 * math.sin(angle),
            -rate**2 * math.sin(angle) + 2 * math.cos(angle) + G / 0.3,
        ])  # fmt: skip
        across = -support[0] * math.sin(state[0]) + support[1] * math.cos(state[0])
        return state[1], -2 * 0.25 * across / (0.05 + 2 * 0.25**2)

    start = found["arm.phi"][0], found["arm.phi_dot"][0]
    expected = solve_ivp(pendulum, (0, 3), start, "DOP853", t, rtol=1e-12, atol=1e-12).y
    np.testing.assert_allclose(found["arm.phi"], expected[0], atol=1e-9)
    # The motor's power is in the balance.
    assert np.abs(found["energy_drift"]).max() < 1e-8 * np.abs(found["work"]).max()
    # Left alone it begins with the least kinetic energy, not with the crank's velocity.
    given = kc.simulate(kc.compile(m), [0, 1], velocity={"arm.phi_dot": 0.7})
    assert given["arm.phi_dot"][0] == pytest.approx(0.7, abs=1e-14)
    assert given["kinetic_energy"][0] > found["kinetic_energy"][0]


def test_that_a_driven_mechanism_moves_as_its_kinematics():
    module = kc.compile(four_bar(motor=1 + 4 * kc.t))
    t = np.linspace(0, 2, 41)
    found, exact = kc.simulate(module, t, rtol=1e-11), kc.solve(module, t)
    np.testing.assert_allclose(found.q, exact.q, atol=1e-11)
    np.testing.assert_allclose(found.q_dot, exact.q_dot, atol=1e-10)
    np.testing.assert_allclose(found.q_ddot, exact.q_ddot, atol=1e-9)


def test_that_a_contact_without_mass_is_no_obstacle():
    """A cam's contact angles have no mass: their equations determine them."""
    models = dict(heavy_examples())
    model = models["cam_flat_follower"]
    module = kc.compile(model)
    found = kc.simulate(module, np.linspace(0, 0.2, 11), rtol=1e-11)
    exact = kc.solve(module, found.t)
    np.testing.assert_allclose(found.q, exact.q, atol=1e-9 * np.abs(exact.q).max())


def test_that_redundant_bars_move_as_without_them():
    def parallelogram(bars):
        m = kc.Mechanism("parallel")
        m.gravity = (0, -G)
        coupler = m.body("coupler", (0.35, 0.17, 0), mass=2, inertia=0.03)
        for k in range(bars):
            x = (0, 0.5, 0.25)[k]
            mass = 1 if k < 2 else 1e-9
            bar = m.body(f"bar{k}", (x + 0.05, 0.087, 1), mass=mass, inertia=0.02 * mass)
            m.add(kc.Revolute(f"O{k}", m.ground, (x, 0), bar, (-0.1, 0)))
            m.add(kc.Revolute(f"A{k}", coupler, (x - 0.25, 0), bar, (0.1, 0)))
        return m

    t = np.linspace(0, 0.15, 6)
    two, three = (
        kc.simulate(kc.compile(parallelogram(k)), t, position={"bar0.phi": 1}, rtol=1e-11)
        for k in (2, 3)
    )
    assert three.success
    np.testing.assert_allclose(three["coupler.y"], two["coupler.y"], atol=1e-8)


class TestEvents:
    """What happens between the times that were asked for."""

    def test_that_a_stop_ends_the_motion_at_its_time(self):
        m = kc.Mechanism("fall")
        m.gravity = (0, -G)
        m.body("stone", (0, 2, 0), mass=1, inertia=1)
        m.add(kc.AbsoluteX("wire", "stone", (0, 0), 0))
        m.output("height", m.bodies[0].y * 2)
        module = kc.compile(m)
        found = kc.simulate(
            module, np.linspace(0, 3, 4), guess={"stone.y": 2}, events={"height": 2},
            stops={"stone.y": 0.5},
        )  # fmt: skip
        assert [event.kind for event in found.events] == ["passage", "stop"]
        assert found.events[0].t == pytest.approx(math.sqrt(2 / G), rel=1e-11)
        assert found.t[-1] == found.events[1].t == pytest.approx(math.sqrt(3 / G), rel=1e-11)
        assert found.success
        assert found["stone.y"][-1] == pytest.approx(0.5, abs=1e-11)
        assert "stop" in found.message

    def test_that_the_first_of_two_ends_of_a_slot_stops_the_motion(self):
        m = kc.Mechanism("slot")
        slider = m.body("slider", (0.2, 0, 0), mass=1, inertia=1)
        m.add(kc.AbsoluteY("rail", slider, (0, 0), 0))
        m.add(kc.AbsoluteAngle("level", slider, 0))
        module = kc.compile(m)
        for speed, end in ((0.5, 0.35), (-0.5, 0.1)):
            found = kc.simulate(
                module, [0, 1], velocity={"slider.x_dot": speed}, stops={"slider.x": [0.1, 0.35]}
            )
            assert found["slider.x"][-1] == pytest.approx(end, abs=1e-12)
            assert found.t[-1] == pytest.approx((end - 0.2) / speed, rel=1e-12)

    def test_that_a_singular_configuration_is_located_and_named(self):
        m = kc.Mechanism("flat")
        a, b, c = (
            m.body(name, place, mass=1, inertia=0.02)
            for name, place in (
                ("crank", (0.05, 0.087, 1)), ("coupler", (0.35, 0.17, 0)),
                ("rocker", (0.55, 0.087, 1)),
            )
        )  # fmt: skip
        m.add(kc.Revolute("O", m.ground, (0, 0), a, (-0.1, 0)))
        m.add(kc.Revolute("A", a, (0.1, 0), b, (-0.25, 0)))
        m.add(kc.Revolute("B", b, (0.25, 0), c, (0.1, 0)))
        m.add(kc.Revolute("C", m.ground, (0.5, 0), c, (-0.1, 0)))
        module = kc.compile(m)
        options = {"position": {"crank.phi": 1}, "velocity": {"crank.phi_dot": -2}}
        found = kc.simulate(module, np.linspace(0, 1, 11), **options)
        # A parallelogram without weight turns evenly, and is flat after half a second.
        (event,) = found.events
        assert event.t == pytest.approx(0.5, abs=1e-8)
        assert event.bodies == ("crank", "coupler", "rocker")
        assert found.status[5] in (kc.Status.SINGULAR, kc.Status.CONVERGED)
        assert not found.success
        assert np.isfinite(found.q[:5]).all()
        assert np.isnan(found.q[6:]).all()
        assert "Singular configuration at t = 0.5" in found.message
        across = kc.simulate(module, np.linspace(0, 1, 11), through="smooth", **options)
        assert across.success
        np.testing.assert_allclose(across["crank.phi"], 1 - 2 * across.t, atol=1e-6)
        with pytest.raises(kc.SolveError, match=r"stopped at t = 0\.5") as caught:
            kc.simulate(module, np.linspace(0, 1, 11), throw=True, **options)
        assert np.isfinite(caught.value.solution.q[:5]).all()

    def test_that_a_driver_beyond_its_range_is_named(self):
        model = four_bar()
        model.add(kc.AbsoluteAngle("pull", "rocker", 2.1 - 0.5 * kc.t))
        found = kc.simulate(kc.compile(model), np.linspace(0, 2, 21))
        assert not found.success
        assert found.events[0].kind == "lock-up"
        assert "crank" in found.events[0].bodies
        reach = kc.solve(kc.compile(model), np.linspace(0, 2, 21))
        assert found.events[0].t == pytest.approx(reach.events[0].t, abs=1e-4)


class TestBadInput:
    """Each mistake is said with names and a remedy."""

    def test_that_a_body_without_mass_is_named(self):
        m = double_pendulum()
        m.body("ghost", (1, 1, 0))
        with pytest.raises(kc.StructuralError, match=r"ghost has no mass.*Give m.body mass="):
            kc.simulate(kc.compile(m), [0, 1])

    def test_that_a_mechanism_without_loads_is_refused(self):
        m = kc.Mechanism("bare")
        m.body("rod")
        m.add(kc.AbsoluteX("wire", "rod", (0, 0), 0))
        with pytest.raises(kc.InputError, match="no masses and no forces"):
            kc.simulate(kc.compile(m), [0, 1])

    def test_that_contradicting_joints_are_named(self):
        m = double_pendulum()
        m.add(kc.AbsoluteX("wall", "first", (-0.5, 0), 0.3))
        with pytest.raises(kc.StructuralError, match=r"wall.*contradict"):
            kc.simulate(kc.compile(m), [0, 1])

    @pytest.mark.parametrize(
        ("options", "text"),
        [
            ({"t": 1.0}, "t has no span"),
            ({"rtol": 0}, "rtol is 0: give a positive number"),
            ({"method": "RK45"}, "method is 'RK45': give one of DOP853, Radau, BDF, CVODE"),
            ({"position": {"frst.phi": 0}}, "no coordinate 'frst.phi'; did you mean"),
            ({"position": {"first.phi": math.nan}}, "give a finite number"),
            ({"velocity": {"first.phi_dott": 0}}, "velocity: there is no coordinate"),
            ({"velocity": [1, 2]}, r"velocity has shape \(2,\), expected \(6,\)"),
            ({"events": {"rod.x": 1}}, "events: double_pendulum has no column 'rod.x'"),
            ({"stops": {"first.x": [1, "a"]}}, "the event at 'first.x' is 'a': give a finite"),
        ],
    )
    def test_that_values_are_checked(self, options, text):
        given = {"t": [0, 1], **options}
        with pytest.raises(kc.InputError, match=text):
            kc.simulate(kc.compile(double_pendulum()), **given)

    @pytest.mark.parametrize(
        ("options", "text"),
        [
            ({"position": {"crank.phi": 3, "rocker.phi": 1}}, "phi_crank, phi_rocker as given"),
            ({"velocity": {"crank.phi": 3, "rocker.phi": 1}}, "cannot all be as given.*phi_crank"),
        ],
    )
    def test_that_a_start_that_cannot_be_is_a_result(self, options, text):
        found = kc.simulate(kc.compile(four_bar()), [0, 1], **options)
        assert not found.success
        assert found.status.tolist() == [kc.Status.NOT_CONVERGED, kc.Status.NOT_REACHED]
        with pytest.raises(kc.SolveError, match=text):
            kc.simulate(kc.compile(four_bar()), [0, 1], throw=True, **options)

    def test_that_a_force_without_value_ends_the_motion_and_loses_nothing(self):
        m = kc.Mechanism("blow")
        stone = m.body("stone", (1, 0, 0), mass=1, inertia=1)
        m.add(kc.AbsoluteY("wire", stone, (0, 0), 0))
        m.add(kc.Force("pull", stone, (0, 0), (-1 / stone.x**2, 0)))
        found = kc.simulate(kc.compile(m), np.linspace(0, 2, 21), guess={"stone.x": 1})
        assert not found.success
        # Falling from rest at distance 1 into a centre takes pi/(2 sqrt 2).
        assert "stopped at t = 1.11072" in found.message
        assert np.isfinite(found.q[:12]).all()
        assert np.isnan(found.q[12:]).all()

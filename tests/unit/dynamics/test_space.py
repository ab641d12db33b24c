"""Loads of bodies in space, against formulas in Euler parameters, closed forms and the plane."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from tests.unit.dynamics.test_inverse import TABLE

G = 9.81
F6 = {
    1.0: (
        (0.111745692662793, 0.622505341480146, 1.04602216353649),
        (0.388799829919899, -0.781768013355601, 0.487517656652859),
        (0.909507856773263, 0.410146087879076, -0.0676435145833937),
        (-0.147071923635895, 0.469700926006673, 0.870488879530641),
    ),
    5.0: (
        (0.518641607551131, -0.361954255282043, 1.08612293918678),
        (0.913885549697859, 0.386402982065354, 0.124522839288401),
        (-0.403999237362812, 0.835406178554646, 0.372667590545501),
        (0.0399727189931942, -0.390882657947017, 0.919572144778519),
    ),
}
"""F6: omega' and the rows of A of a free body, by Jacobi's functions and a Taylor series."""


def g_of(p):
    """Return G of Haug 9.3."""
    e0, e1, e2, e3 = p
    return np.array([[-e1, e0, e3, -e2], [-e2, -e3, e0, e1], [-e3, e2, -e1, e0]])


def inertia_of(seed):
    """Return the matrix of inertia of some body: that of random points."""
    points = np.random.default_rng(seed).normal(size=(9, 3))
    points -= points.mean(axis=0)
    return sum(np.eye(3) * (x @ x) - np.outer(x, x) for x in points)


def state(seed, n=7):
    """Return a generic position with unit Euler parameters, and rates that keep them so."""
    rng = np.random.default_rng(seed)
    q, q_dot = rng.normal(size=(2, n))
    for k in range(3, n, 7):
        p = q[k : k + 4] = q[k : k + 4] / np.linalg.norm(q[k : k + 4])
        q_dot[k : k + 4] -= p * (p @ q_dot[k : k + 4])
    return q, q_dot


@pytest.mark.parametrize("seed", range(5))
def test_that_a_free_body_has_the_formulas_in_euler_parameters(seed):
    inertia, n = inertia_of(seed), np.array([0.3, -0.7, 1.1])
    m = spatial.Mechanism("free")
    m.gravity = (0.1, 0, -G)
    body = m.body("body", mass=2.5, inertia=inertia.tolist())
    m.add(spatial.FollowerTorque("turn", body, tuple(n)))
    module, (q, q_dot) = kc.compile(m), state(seed)
    (g, g_dot), p = map(g_of, (q[3:], q_dot[3:])), q[3:]
    M, Q = module.M(q, 0.0), module.Q(q, q_dot, 0.0)
    np.testing.assert_allclose(M[3:, 3:], 4 * g.T @ inertia @ g, atol=1e-13)
    np.testing.assert_allclose(M[:3], 2.5 * np.eye(3, 7), atol=1e-14)
    np.testing.assert_allclose(Q[:3], (0.25, 0, -2.5 * G), atol=1e-14)
    expected = 2 * g.T @ n + 8 * g_dot.T @ inertia @ g_dot @ p
    np.testing.assert_allclose(Q[3:], expected, atol=1e-12)
    for name, reads in (("Q_q", 0), ("Q_q_dot", 1)):
        jacobian = getattr(module, name)(q, q_dot, 0.0)
        for k in range(7):
            both = [q.astype(complex), q_dot.astype(complex)]
            both[reads][k] += 1e-30j
            slope = module.Q(*both, 0.0).imag / 1e-30
            np.testing.assert_allclose(jacobian[:, k], slope, atol=1e-12)


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 5))]
)
def test_that_euler_s_equations_hold_whatever_the_origin_and_the_load(seed):
    """Newton and Euler in the body, with a centre of mass, forces and torques of every type."""
    inertia, c, s = inertia_of(seed), np.array([0.2, -0.1, 0.3]), np.array([0.4, 0.5, -0.6])
    f, torque = np.array([3.0, -2, 1]), np.array([0.5, 0.8, -1.1])
    m = spatial.Mechanism("free")
    body = m.body("body", mass=2.5, inertia=inertia.tolist(), centre=tuple(c))
    m.add(spatial.Force("push", body, tuple(s), tuple(f)))
    m.add(spatial.FollowerForce("jet", body, tuple(-s), tuple(f)))
    m.add(spatial.Torque("turn", body, tuple(torque)))
    m.add(spatial.Spring("pull", m.ground, (1, 2, 3), body, tuple(s), stiffness=7, free_length=0.5))
    q, q_dot = state(seed)
    module = kc.compile(m)
    found = kc.simulate(module, [0, 1e-3], guess=q, velocity=q_dot)
    turned = Rotation.from_quat(q[3:], scalar_first=True).as_matrix()
    omega = 2 * g_of(q[3:]) @ found.q_dot[0, 3:]
    omega_dot = 2 * g_of(q[3:]) @ found.q_ddot[0, 3:]
    way = np.array([1, 2, 3]) - q[:3] - turned @ s
    pull = 7 * (np.linalg.norm(way) - 0.5) * way / np.linalg.norm(way)
    force = f + turned @ f + pull
    about = np.cross(s - c, turned.T @ (f + pull)) + np.cross(-s - c, f) + turned.T @ torque
    np.testing.assert_allclose(
        inertia @ omega_dot + np.cross(omega, inertia @ omega),
        about,
        atol=1e-10 * np.abs(about).max(),
    )
    centre = np.cross(omega_dot, c) + np.cross(omega, np.cross(omega, c))
    acceleration = found.q_ddot[0, :3] + turned @ centre
    np.testing.assert_allclose(2.5 * acceleration, force, atol=1e-10 * np.abs(force).max())


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_that_a_free_body_tumbles_as_jacobi_says(target, quick_compiler):
    m = spatial.Mechanism("top")
    m.body("top", mass=1, inertia=(1, 2, 3))
    omega = {"top.omega_xi": 0.6, "top.omega_eta": 0.2, "top.omega_zeta": 1.1}
    found = kc.simulate(kc.compile(m, target=target), [0, *F6], velocity=omega, rtol=1e-11)
    assert found.success
    for k, rows in enumerate(F6.values(), 1):
        turned = Rotation.from_quat(found.q[k, 3:], scalar_first=True).as_matrix()
        np.testing.assert_allclose(turned, rows[1:], atol=1e-9)
        spin = 2 * g_of(found.q[k, 3:]) @ found.q_dot[k, 3:]
        np.testing.assert_allclose(spin, rows[0], atol=1e-9)
    assert found.residual.max() < 1e-14


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_that_a_double_pendulum_in_space_moves_as_in_the_plane(turn):
    """Its plane is that of x and z, turned about the vertical: that must change nothing."""
    flat = kc.Mechanism("flat")
    flat.gravity = (0, -G)
    a = flat.body("a", (0.5, 0, 0), mass=1, inertia=1 / 12)
    b = flat.body("b", (1, -0.5, -math.pi / 2), mass=1, inertia=1 / 12)
    flat.add(kc.Revolute("O", flat.ground, (0, 0), a, (-0.5, 0)))
    flat.add(kc.Revolute("A", a, (0.5, 0), b, (-0.5, 0)))
    m = spatial.Mechanism("deep")
    m.gravity = (0, 0, -G)
    c, s = math.cos(turn), math.sin(turn)
    x, axis = np.array([c, s, 0]), (-s, c, 0)
    first = m.body("a", tuple(0.5 * x), x=tuple(x), y=axis, mass=1, inertia=(1e-3, 1 / 12, 1 / 12))
    second = m.body(
        "b", (*x[:2], -0.5), x=(0, 0, -1), y=axis, mass=1, inertia=(1e-3, 1 / 12, 1 / 12)
    )
    m.add(spatial.Revolute("O", m.ground, (0, 0, 0), axis, first, (-0.5, 0, 0), (0, 1, 0)))
    m.add(spatial.Revolute("A", first, (0.5, 0, 0), (0, 1, 0), second, (-0.5, 0, 0), (0, 1, 0)))
    t = np.linspace(0, 1, 11)
    plane, space = (kc.simulate(kc.compile(item), t, rtol=1e-11) for item in (flat, m))
    assert space.success
    for name in "ab":
        np.testing.assert_allclose(space[f"{name}.z"], plane[f"{name}.y"], atol=1e-9)
        np.testing.assert_allclose(
            c * space[f"{name}.x"] + s * space[f"{name}.y"], plane[f"{name}.x"], atol=1e-9
        )
    assert np.abs(space["energy_drift"]).max() < 1e-8 * np.abs(space["work"]).max()


def test_that_a_heavy_top_keeps_energy_and_momentum_about_the_vertical():
    m = spatial.Mechanism("heavy_top")
    m.gravity = (0, 0, -G)
    tilt = Rotation.from_euler("x", 0.4)
    top = m.body("top", orientation=tilt, mass=2, inertia=(0.03, 0.03, 0.02), centre=(0, 0, 0.25))
    m.add(spatial.Spherical("tip", m.ground, (0, 0, 0), top, (0, 0, 0)))
    t = np.linspace(0, 3, 61)
    found = kc.simulate(kc.compile(m), t, velocity={"top.omega_zeta": 40}, rtol=1e-11)
    assert found.success
    turned = Rotation.from_quat(found.q[:, 3:], scalar_first=True)
    rates = zip(found.q, found.q_dot, strict=True)
    omega = np.array([2 * g_of(q[3:]) @ q_dot[3:] for q, q_dot in rates])
    inertia = np.diag([0.03 + 2 * 0.25**2, 0.03 + 2 * 0.25**2, 0.02])
    height = turned.apply((0, 0, 0.25))[:, 2]
    energy = np.einsum("ti,ij,tj->t", omega, inertia, omega) / 2 + 2 * G * height
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    vertical = turned.apply(omega @ inertia)[:, 2]
    np.testing.assert_allclose(vertical, vertical[0], rtol=1e-9)
    np.testing.assert_allclose(omega[:, 2], 40, rtol=1e-9)
    assert np.ptp(height) > 1e-3  # it nods


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"mass": 1}, "give a mass and an inertia"),
        ({"centre": (0, 0, 1)}, "give a mass and an inertia"),
        ({"mass": -1, "inertia": (1, 1, 1)}, "the mass is -1, and must be positive"),
        ({"mass": 1, "inertia": 3}, r"is not \(J_xi, J_eta, J_zeta\)"),
        ({"mass": 1, "inertia": (1, 2, 4)}, "no body has one that is more than the sum"),
        ({"mass": 1, "inertia": (1, 2, -1)}, "must be positive"),
        (
            {"mass": 1, "inertia": ((1, 0.1, 0), (0, 1, 0), (0, 0, 1))},
            "the matrix of inertia is not symmetric",
        ),
    ],
)
def test_that_an_inertia_that_no_body_has_is_refused(given, text):
    m = spatial.Mechanism("bad")
    m.body("rock", **given)
    with pytest.raises(kc.ModelError, match=text):
        m.system()


def test_that_a_load_of_the_plane_names_its_twin():
    m = spatial.Mechanism("mixed")
    body = m.body("rock", mass=1, inertia=(1, 1, 1))
    m.add(kc.Force("push", body, (0, 0), (1, 0)))
    with pytest.raises(kc.ModelError, match=r"take spatial\.Force"):
        m.system()


def test_that_a_load_of_space_names_its_twin_in_the_plane():
    m = kc.Mechanism("mixed")
    body = m.body("rock", mass=1, inertia=1)
    hinge = (m.ground, (0, 0, 1), body, (0, 0, 1))
    m.add(spatial.HingeFriction("dry", *hinge, 2))
    m.add(spatial.FollowerTorque("turn", body, (0, 0, 1)))
    with pytest.raises(kc.ModelError) as caught:
        m.system()
    assert "take kincompile.HingeFriction" in str(caught.value)
    assert "take Torque" in str(caught.value)


def test_that_torques_that_depend_on_the_motion_have_their_slopes():
    m = spatial.Mechanism("dragged")
    body = m.body("body", mass=1, inertia=(1, 1, 1))
    drag = tuple(-(k + 1) * rate * rate for k, rate in enumerate(body.omega_fixed))
    m.add(spatial.FollowerTorque("drag", body, drag))
    m.add(spatial.Force("field", body, (0.1, 0.2, 0.3), (body.y, -body.x, body.z**2)))
    module, (q, q_dot) = kc.compile(m), state(4)
    spin = 2 * g_of(q[3:]) @ q_dot[3:]
    torque = -np.array([1, 2, 3]) * spin**2
    expected = 2 * g_of(q[3:]).T @ torque + 8 * g_of(q_dot[3:]).T @ g_of(q_dot[3:]) @ q[3:]
    turned = Rotation.from_quat(q[3:], scalar_first=True)
    force = np.array([q[1], -q[0], q[2] ** 2])
    lever = np.cross((0.1, 0.2, 0.3), turned.inv().apply(force))
    expected += 2 * g_of(q[3:]).T @ lever
    # Along p itself a force has a component that the norm of p takes up.
    found, p = module.Q(q, q_dot, 0.0)[3:], q[3:]
    np.testing.assert_allclose(found - p * (p @ found), expected - p * (p @ expected), atol=1e-12)
    for name, reads in (("Q_q", 0), ("Q_q_dot", 1)):
        jacobian = getattr(module, name)(q, q_dot, 0.0)
        for k in range(7):
            both = [q.astype(complex), q_dot.astype(complex)]
            both[reads][k] += 1e-30j
            slope = module.Q(*both, 0.0).imag / 1e-30
            np.testing.assert_allclose(jacobian[:, k], slope, atol=1e-11)


def test_that_a_rod_on_a_spring_rests_in_space_as_in_the_plane():
    """S1 of the reference cases, swung out of the plane: length and angle are the same."""
    m = spatial.Mechanism("hang")
    m.gravity = (0, 0, -G)
    rod = m.body("rod", (0.3, 0.2, 0.35), x=(0.6, 0.4, 0.7), y=(-0.4, 0.6, 0), mass=2,
                 inertia=(0.01, 0.2, 0.2))  # fmt: skip
    m.add(spatial.Spherical("O", m.ground, (0, 0, 0), rod, (-0.5, 0, 0)))
    m.add(
        spatial.Spring("s", m.ground, (0, 0, 1.2), rod, (0.5, 0, 0), stiffness=60, free_length=0.4)
    )
    rest = kc.equilibrium(kc.compile(m))
    assert rest.stability == ("neutral",)  # it may be swung about the vertical, and roll
    x, y, z = 2 * rest.q[0, :3]
    assert math.atan2(z, math.hypot(x, y)) == pytest.approx(1.18715766125861, abs=1e-8)
    assert math.dist((x, y, z), (0, 0, 1.2)) == pytest.approx(0.463096960926194, abs=1e-9)


def turned_slider_crank(turn):
    """Return the slider-crank D1 in a plane that is turned by a matrix; and nothing redundant."""
    m = spatial.Mechanism("turned")
    m.gravity = tuple(turn @ (0, -G, 0))
    z, x = tuple(turn[:, 2]), tuple(turn[:, 0])

    def body(name, place, angle, mass, inertia, centre):
        c, s = math.cos(angle), math.sin(angle)
        return m.body(
            name, tuple(turn @ (*place, 0)), x=tuple(turn @ (c, s, 0)), y=tuple(turn @ (-s, c, 0)),
            mass=mass, inertia=(0.6 * inertia, 0.7 * inertia, inertia), centre=(*centre, 0),
        )  # fmt: skip

    crank = body("crank", (0, 0), 0.3, 1.2, 0.002, (0.04, 0.01))
    rod = body("rod", (0.245, 0.02), -0.03, 0.8, 0.006, (-0.03, 0.005))
    slider = body("slider", (0.395, 0.02), 0, 1.5, 0.001, (0.02, 0.01))
    o, e_x, e_y, e_z = (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)
    m.add(spatial.Revolute("O", m.ground, o, z, crank, o, e_z))
    m.add(spatial.Spherical("A", crank, (0.1, 0, 0), rod, (-0.15, 0, 0)))
    m.add(spatial.Universal("B", rod, (0.15, 0, 0), e_z, slider, o, e_y))
    place = tuple(turn @ (0, 0.02, 0))
    m.add(spatial.Translational("C", m.ground, place, x, z, slider, o, e_x, e_y))
    angle = 0.3 + 10 * kc.t + 2 * kc.t**2
    m.add(spatial.RelativeRotation("motor", m.ground, z, x, crank, e_z, e_x, angle))
    m.add(spatial.Force("load", slider, (0.03, 0, 0), tuple(turn @ (-200, 15, 0))))
    return m


@pytest.mark.parametrize("angles", [(0, 0, 0), (1.5, 0, 0.6), (0.4, -1.1, 0.8)])
def test_that_a_turned_slider_crank_has_the_reactions_of_the_plane(angles):
    turn = Rotation.from_euler("xyz", angles).as_matrix()
    found = kc.forces(kc.solve(kc.compile(turned_slider_crank(turn)), [0.0, 0.15, 0.4]))
    for name in "OAB":
        force = found.reactions[name].force @ turn
        np.testing.assert_allclose(force[:, :2], TABLE[name], atol=1e-10)
        np.testing.assert_allclose(force[:, 2], 0, atol=1e-10)
    guide, motor = found.reactions["C"], found.reactions["motor"]
    np.testing.assert_allclose((guide.force @ turn)[:, 1], TABLE["guide"], atol=1e-10)
    np.testing.assert_allclose((guide.moment @ turn)[:, 2], TABLE["couple"], atol=1e-11)
    np.testing.assert_allclose(guide.along_axis[:, 0], 0, atol=1e-10)
    np.testing.assert_allclose(found.drivers["motor"].value, TABLE["motor"], atol=1e-10)
    about = (motor.moment @ turn)[:, 2]
    np.testing.assert_allclose(about, TABLE["motor"], atol=1e-10)
    np.testing.assert_allclose(motor.moment_on_i, -motor.moment, atol=1e-11)
    # A pin bears nothing about its axis, nor a cross about either arm.
    np.testing.assert_allclose((found.reactions["O"].moment @ turn)[:, 2], 0, atol=1e-11)
    in_rod = found.in_axes_of("rod", found.reactions["A"].force)
    np.testing.assert_allclose(
        np.linalg.norm(in_rod, axis=1), found.reactions["A"].size, rtol=1e-12
    )
    assert {"F_O", "T_C", "drive_motor", "P_motor"} <= found.columns().keys()


def test_that_a_top_stands_on_the_reaction_of_its_free_body():
    """Force and moment at the tip of a body that moves freely, against Newton and Euler."""
    m = spatial.Mechanism("top")
    m.gravity = (0, 0, -G)
    top = m.body(
        "top", axis=(1, 0, 0), angle=0.4, mass=2, inertia=(0.03, 0.04, 0.02), centre=(0, 0, 0.25)
    )
    m.add(spatial.Universal("tip", m.ground, (0, 0, 0), (0, 1, 0), top, (0, 0, 0), (1, 0, 0)))
    m.point("middle", top, (0, 0, 0.25))
    motion = kc.simulate(kc.compile(m), [0, 0.1, 0.3], velocity={"top.omega_x": 3})
    found = kc.forces(motion)
    place = np.column_stack([motion[f"middle.{axis}"] for axis in "xyz"])
    acceleration = np.column_stack([motion[f"middle.{axis}_ddot"] for axis in "xyz"])
    force = 2 * (acceleration + np.array([0, 0, G]))
    np.testing.assert_allclose(found.reactions["tip"].force, force, atol=1e-9)
    np.testing.assert_allclose(found.ground.force, -force, atol=1e-9)
    inertia = np.diag([0.03, 0.04, 0.02])
    for k, (q, q_dot, q_ddot) in enumerate(zip(motion.q, motion.q_dot, motion.q_ddot, strict=True)):
        spin, change = (2 * g_of(q[3:]) @ rates[3:] for rates in (q_dot, q_ddot))
        turned = Rotation.from_quat(q[3:], scalar_first=True)
        momentum = turned.apply(inertia @ change + np.cross(spin, inertia @ spin))
        weight = np.cross(place[k], (0, 0, -2 * G))
        expected = momentum + np.cross(place[k], 2 * acceleration[k]) - weight
        np.testing.assert_allclose(found.reactions["tip"].moment[k], expected, atol=1e-9)


def test_that_files_keep_masses_and_loads(tmp_path):
    m = spatial.Mechanism("hang")
    m.gravity = (0, 0, -G)
    k = m.parameter("k", 60.0)
    inertia = ((0.1, 0, 0), (0, 0.2, k / 6000), (0, k / 6000, 0.2))
    rod = m.body("rod", (0.4, 0, -0.3), mass=2, inertia=inertia, centre=(0, 0, 0.1))
    m.body("ball", (1, 0, 0), mass=k / 30, inertia=(1, 1, 1))
    m.add(spatial.Spherical("O", m.ground, (0, 0, 0), rod, (-0.5, 0, 0)))
    m.add(spatial.Spring("s", m.ground, (0, 0, 1.2), rod, (0.5, 0, 0), stiffness=k))
    m.add(spatial.FollowerTorque("roll", rod, (-rod.omega_fixed[0] / 10, 0, 0)))
    path = tmp_path / "hang.toml"
    path.write_text(m.to_toml(), encoding="utf-8")
    read = kc.read_model(path)
    assert read.to_toml() == m.to_toml()
    before, after = kc.compile(m), kc.compile(read)
    q, q_dot = state(2, 14)
    np.testing.assert_array_equal(before.M(q, 0.0), after.M(q, 0.0))
    np.testing.assert_array_equal(before.Q(q, q_dot, 0.0), after.Q(q, q_dot, 0.0))
    path.write_text(m.to_toml().replace("mass = 2", "mass = -2"), encoding="utf-8")
    with pytest.raises(kc.ModelError, match="the mass is -2, and must be positive"):
        kc.read_model(path).system()

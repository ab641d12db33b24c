"""Reactions, torques and powers, against free bodies, published figures and laws of mechanics."""

import dataclasses
import itertools
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from tests.unit.dynamics.heavy import heavy_examples

G = 9.81


def slider_crank():
    """Return the slider-crank D1 of the reference cases."""
    m = kc.Mechanism("slider_crank")
    m.gravity = (0, -G)
    crank = m.body("crank", (0, 0, 0.3), mass=1.2, inertia=0.002, centre=(0.04, 0.01))
    rod = m.body("rod", (0.245, 0.02, 0), mass=0.8, inertia=0.006, centre=(-0.03, 0.005))
    slider = m.body("slider", (0.395, 0.02, 0), mass=1.5, inertia=0.001, centre=(0.02, 0.01))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (0.1, 0), rod, (-0.15, 0)))
    m.add(kc.Revolute("B", rod, (0.15, 0), slider, (0, 0)))
    m.add(kc.Translational("C", m.ground, (0, 0.02), (1, 0), slider, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 0.3 + 10 * kc.t + 2 * kc.t**2))
    m.add(kc.Force("load", slider, (0.03, 0), (-200, 15)))
    return m


TABLE: dict[str, Any] = {
    "A in the turned frame": [
        (152.86888394486, -79.56825568221), (191.44274961474, -103.16749942004),
        (212.24741839622, -106.59677376017),
    ],
    "O": [
        (167.99138794198, 7.3500057419194), (213.22660446781, -47.232567128742),
        (213.61160474388, 120.52196665424),
    ],
    "A": [
        (172.32497487295, -2.0263331151478), (210.6400910484, -54.079676032283),
        (214.427947944, 102.13958063583),
    ],
    "B": [
        (181.04530560443, -8.5997288629994), (207.83806375397, -56.718132261924),
        (211.09565649813, 87.801194874557),
    ],
    "guide": [8.3147288629994, 56.433132261924, -88.086194874557],
    "couple": [0.033846943955671, -0.23408063753969, -0.26665656498126],
    "motor": [-4.8549140078676, -19.037376911941, 20.498965392613],
}  # fmt: skip
"""D1: three formulations that share no code agree to 3e-39."""


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_that_the_slider_crank_has_the_published_forces(target, quick_compiler):
    found = kc.forces(kc.solve(kc.compile(slider_crank(), target=target), [0.0, 0.15, 0.4]))
    close: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-11}
    for name in "OAB":
        np.testing.assert_allclose(found.reactions[name].force, TABLE[name], **close)
    guide = found.reactions["C"]
    np.testing.assert_allclose(guide.force[:, 1], TABLE["guide"], **close)
    np.testing.assert_allclose(guide.along_axis[:, 1], TABLE["guide"], **close)
    np.testing.assert_allclose(guide.along_axis[:, 0], 0, atol=1e-11)
    np.testing.assert_allclose(guide.moment, TABLE["couple"], **close)
    np.testing.assert_allclose(found.drivers["motor"].value, TABLE["motor"], **close)
    np.testing.assert_allclose(found.reactions["motor"].moment, TABLE["motor"], **close)
    on_rod = found.in_axes_of("rod", found.reactions["A"].force)
    c, s = np.cos(0.5), np.sin(0.5)
    turned = on_rod @ np.array([[c, -s], [s, c]])
    np.testing.assert_allclose(turned, TABLE["A in the turned frame"], **close)
    assert found.drivers["motor"].unit == "N*m"
    assert found.undetermined == ()


def four_bar(shift=(0.0, 0.0), turn=0.0, *, swapped=False):
    """Return a four-bar with springs, friction and forces.

    `shift` moves the origin of the coupler in it, `turn` turns the ground, and the coupler's joints
    may be written with their bodies swapped.
    """
    m = kc.Mechanism("four_bar")
    c, s = np.cos(turn), np.sin(turn)

    def placed(x, y):
        return c * x - s * y, s * x + c * y

    u, v = shift
    m.gravity = placed(0, -G)
    crank = m.body(
        "crank", (*placed(0, 0), 0.6 + turn), mass=1.1, inertia=0.004, centre=(0.07, 0.02)
    )
    rod = m.body(
        "rod", (*placed(0.1 + u, 0.1 + v), 0.2 + turn), mass=0.9, inertia=0.02,
        centre=(0.1 - u, 0.05 - v),
    )  # fmt: skip
    rocker = m.body(
        "rocker", (*placed(0.5, 0), 1.4 + turn), mass=1.4, inertia=0.03, centre=(0.12, -0.01)
    )
    joints = [
        ("A", crank, (0.15, 0), rod, (-u, -v)), ("B", rod, (0.45 - u, -v), rocker, (0.3, 0)),
    ]  # fmt: skip
    m.add(kc.Revolute("O", m.ground, placed(0, 0), crank, (0, 0)))
    for name, i, point_i, j, point_j in joints:
        pair = (j, point_j, i, point_i) if swapped else (i, point_i, j, point_j)
        m.add(kc.Revolute(name, *pair))
    m.add(kc.Revolute("C", m.ground, placed(0.5, 0), rocker, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 0.6 + turn + 9 * kc.t + 4 * kc.t**2))
    m.add(kc.Spring("s", m.ground, placed(0.2, 0.6), rod, (0.2 - u, 0.1 - v), 300, 0.25, 4))
    m.add(kc.FollowerForce("tool", rod, (0.3 - u, 0.1 - v), (20, -35)))
    m.add(kc.TorsionSpring("t", rod, rocker, 6, 0.4, 0.2))
    m.add(kc.HingeFriction("f", m.ground, rocker, 1.5, 0.5))
    return m


TIMES = np.linspace(0, 0.8, 41)


def motion_of_points(solution, body, *points):
    """Return position, velocity and acceleration of points of a body, written out."""
    x, y, phi = (solution[f"{body}.{letter}"] for letter in ("x", "y", "phi"))
    v = [solution[f"{body}.{letter}_dot"] for letter in ("x", "y", "phi")]
    a = [solution[f"{body}.{letter}_ddot"] for letter in ("x", "y", "phi")]
    for xi, eta in points:
        sx, sy = np.cos(phi) * xi - np.sin(phi) * eta, np.sin(phi) * xi + np.cos(phi) * eta
        yield (
            np.array([x + sx, y + sy]),
            np.array([v[0] - v[2] * sy, v[1] + v[2] * sx]),
            np.array([a[0] - a[2] * sy - v[2] ** 2 * sx, a[1] + a[2] * sx - v[2] ** 2 * sy]),
        )


def cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def newton_euler(solution):
    """Return pin forces on the second body of O, A, B, C and the torque, from free bodies.

    Unknowns at each time: O on the crank, A on the rod, B and C on the rocker, and the torque.
    """
    bodies: dict[str, Any] = {
        "crank": (1.1, 0.004, (0.07, 0.02), {"O": ((0, 0), 1), "A": ((0.15, 0), -1)}),
        "rod": (0.9, 0.02, (0.1, 0.05), {"A": ((0, 0), 1), "B": ((0.45, 0), -1)}),
        "rocker": (1.4, 0.03, (0.12, -0.01), {"B": ((0.3, 0), 1), "C": ((0, 0), 1)}),
    }
    applied: dict[str, list[Any]] = {name: [] for name in bodies}
    couple: dict[str, Any] = dict.fromkeys(bodies, 0.0)
    (hook, hook_v, _), (tip, _, _) = motion_of_points(solution, "rod", (0.2, 0.1), (0.3, 0.1))
    way = hook - np.array([[0.2], [0.6]])
    length = np.hypot(*way)
    pull = 300 * (length - 0.25) + 4 * (way * hook_v).sum(axis=0) / length
    applied["rod"].append((hook, -pull * way / length))
    phi = solution["rod.phi"]
    tool = np.array([20 * np.cos(phi) + 35 * np.sin(phi), 20 * np.sin(phi) - 35 * np.cos(phi)])
    applied["rod"].append((tip, tool))
    angle = solution["rocker.phi"] - solution["rod.phi"]
    rate = solution["rocker.phi_dot"] - solution["rod.phi_dot"]
    clock = 6 * (angle - 0.4) + 0.2 * rate
    w = solution["rocker.phi_dot"]
    couple["rocker"] = couple["rocker"] - clock - 1.5 * w / np.sqrt(w**2 + 0.25)
    couple["rod"] = couple["rod"] + clock
    columns = {"O": 0, "A": 2, "B": 4, "C": 6}
    count = len(solution.t)
    matrix, right = np.zeros((count, 9, 9)), np.zeros((count, 9))
    for number, (name, (mass, inertia, centre, pins)) in enumerate(bodies.items()):
        ((place, _, a),) = motion_of_points(solution, name, centre)
        row = 3 * number
        load = sum((force for _, force in applied[name]), np.zeros((2, count)))
        right[:, row : row + 2] = (mass * a - load - np.array([[0], [-mass * G]])).T
        turning = sum((cross(at - place, force) for at, force in applied[name]), np.zeros(count))
        right[:, row + 2] = inertia * solution[f"{name}.phi_ddot"] - turning - couple[name]
        for pin, (point, sign) in pins.items():
            ((at, _, _),) = motion_of_points(solution, name, point)
            column, arm = columns[pin], at - place
            matrix[:, row, column] = matrix[:, row + 1, column + 1] = sign
            matrix[:, row + 2, column] = -sign * arm[1]
            matrix[:, row + 2, column + 1] = sign * arm[0]
    matrix[:, 2, 8] = 1
    found = np.linalg.solve(matrix, right[..., np.newaxis])[..., 0]
    return {**{pin: found[:, k : k + 2] for pin, k in columns.items()}, "motor": found[:, 8]}


def test_that_a_four_bar_bears_what_its_free_bodies_say():
    solution = kc.solve(kc.compile(four_bar()), TIMES)
    found, known = kc.forces(solution), newton_euler(solution)
    for pin in "OABC":
        np.testing.assert_allclose(found.reactions[pin].force, known[pin], rtol=1e-11, atol=1e-9)
        assert not found.reactions[pin].moment.any()
    np.testing.assert_allclose(found.drivers["motor"].value, known["motor"], rtol=1e-11, atol=1e-9)
    power = known["motor"] * (9 + 8 * TIMES)
    np.testing.assert_allclose(found.drivers["motor"].power, power, rtol=1e-11, atol=1e-9)
    ((hook, velocity, _),) = motion_of_points(solution, "rod", (0.2, 0.1))
    way = hook - np.array([[0.2], [0.6]])
    length = np.hypot(*way)
    pull = 300 * (length - 0.25) + 4 * (way * velocity).sum(axis=0) / length
    np.testing.assert_allclose(found["s.load"], pull, rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize(
    ("given", "sign"),
    [({"shift": (0.13, -0.2)}, 1), ({"turn": 0.7}, 1), ({"swapped": True}, -1)],
)
def test_that_forces_depend_on_no_origin_no_axes_and_no_order(given, sign):
    known = kc.forces(kc.solve(kc.compile(four_bar()), TIMES))
    found = kc.forces(kc.solve(kc.compile(four_bar(**given)), TIMES))
    c, s = np.cos(given.get("turn", 0.0)), np.sin(given.get("turn", 0.0))
    for name, reaction in known.reactions.items():
        own = sign if name in "AB" else 1
        expected = own * reaction.force @ np.array([[c, s], [-s, c]])
        np.testing.assert_allclose(found.reactions[name].force, expected, rtol=1e-10, atol=1e-9)
    motor = found.drivers["motor"].value
    np.testing.assert_allclose(motor, known.drivers["motor"].value, rtol=1e-10, atol=1e-9)


def test_that_the_torque_at_rest_is_the_slope_of_the_potential():
    """A lever with weights and springs, held at an angle a: the motor bears dV/da."""
    a = sympy.Symbol("a")
    m = kc.Mechanism("lever")
    m.gravity = (0, -G)
    angle = m.parameter("a", 0.4)
    arm = m.body("arm", (0.5, 0.2, angle), mass=3, inertia=0.5, centre=(0.1, 0.05))
    m.add(kc.Revolute("O", m.ground, (0, 0), arm, (-0.5, 0)))
    m.add(kc.AbsoluteAngle("hold", arm, angle))
    m.add(kc.Spring("s", m.ground, (0, 1.5), arm, (0.3, 0), stiffness=200, free_length=0.7))
    y = 0.6 * sympy.sin(a) + 0.05 * sympy.cos(a)
    length = sympy.sqrt((0.8 * sympy.cos(a)) ** 2 + (0.8 * sympy.sin(a) - 1.5) ** 2)
    potential = 3 * G * y + 100 * (length - 0.7) ** 2
    slope = sympy.lambdify(a, potential.diff(a))
    angles = np.linspace(-1, 2, 7)
    found = kc.forces(kc.solve(kc.compile(m), [0.0], {"a": angles}))
    torque = found.drivers["hold"].value[:, 0]
    np.testing.assert_allclose(torque, slope(angles), rtol=1e-11)


@pytest.mark.parametrize(("name", "model"), heavy_examples())
def test_the_balance_of_power_and_of_momentum_in_every_example(name, model):
    """Drivers and weight raise the kinetic energy; what the ground does not bear is momentum."""
    times = np.linspace(0, model.end, 33)
    solution = kc.solve(kc.compile(model), times)
    found = kc.forces(solution)
    good = np.isfinite(solution.q_ddot).all(axis=1)
    assert good.any()
    g = np.array([[0.4], [-G]])
    metre = {"m": 1.0, "mm": 1e-3}[model.length_unit]
    supplied, gained = np.zeros(len(times)), np.zeros(len(times))
    force, moment = np.zeros((2, len(times))), np.zeros(len(times))
    largest = np.zeros(len(times))
    for body in model.bodies:
        ((place, v, a),) = motion_of_points(solution, body.name, body.centre)
        w, alpha = solution[f"{body.name}.phi_dot"], solution[f"{body.name}.phi_ddot"]
        mass, inertia = metre * body.mass, metre * body.inertia  # in newtons and units of length
        terms = mass * (v * a).sum(axis=0), inertia * w * alpha
        weight = mass * (g * v).sum(axis=0)
        gained += metre * sum(terms)
        supplied += metre * weight
        largest += metre * sum(map(np.abs, (*terms, weight)))
        own = mass * (g - a)
        force += own
        moment += cross(place, own) - inertia * alpha
    for drive in found.motion.observed.names:
        if drive.startswith("P_"):
            supplied += found[drive]
            largest += np.abs(found[drive])
    scale = largest[good].max()
    np.testing.assert_allclose(supplied[good], gained[good], rtol=0, atol=1e-10 * scale)
    ground = found.ground
    size = np.abs(force[:, good]).max()
    np.testing.assert_allclose(ground.force[good], force.T[good], rtol=0, atol=1e-10 * size)
    size = np.abs(moment[good]).max()
    np.testing.assert_allclose(ground.moment[good], moment[good], rtol=0, atol=1e-10 * size)


def test_that_joints_on_the_ground_bear_what_shakes_it():
    """In the slider-crank the ground feels what O, C and the motor do to the bodies, reversed.

    Moments are about the origin; the guide touches the slider's point.
    """
    solution = kc.solve(kc.compile(slider_crank()), TIMES / 2)
    found = kc.forces(solution)
    pin, guide = found.reactions["O"], found.reactions["C"]
    np.testing.assert_allclose(
        found.ground.force, -(pin.force + guide.force), rtol=1e-11, atol=1e-9
    )
    place = np.array([solution["slider.x"], solution["slider.y"]])
    moment = -guide.moment - cross(place, guide.force.T) - found.drivers["motor"].value
    np.testing.assert_allclose(found.ground.moment, moment, rtol=1e-11, atol=1e-9)
    # On the ground itself, about its own point (0, 0.02) of the guide.
    on_i = -guide.moment - cross(place - np.array([[0], [0.02]]), guide.force.T)
    np.testing.assert_allclose(guide.moment_on_i, on_i, rtol=1e-11, atol=1e-9)


def test_that_andrews_squeezer_is_driven_by_its_published_torque():
    """The DAE test set: at t = 0 the accelerations there follow from 0.033 N m on the crank.

    Its multipliers at the slider of K2 and K3 are 98.5668703962410896 and -6.12268834425566266.
    """
    q = {
        "beta": -0.0617138900142764496, "theta": 0.0, "gamma": 0.455279819163070380,
        "phi": 0.222668390165885885, "delta": 0.487364979543842550,
        "omega": -0.222668390165885885, "epsilon": 1.23054744454982119,
    }  # fmt: skip
    xa, ya, xb, yb, xc, yc = -0.06934, -0.00227, -0.03635, 0.03273, 0.014, 0.072
    d, da, e, ea, zf, fa, rr, ra = 0.028, 0.0115, 0.02, 0.01421, 0.02, 0.01421, 0.007, 0.00092
    ss, sa, sb, sc, sd, ta, tb = 0.035, 0.01874, 0.01043, 0.018, 0.02, 0.02308, 0.00916
    u, ua, ub, zt = 0.04, 0.01228, 0.00449, 0.04
    m = kc.Mechanism("squeezer")
    acceleration = 14222.4439199541138706
    b, t = q["beta"], q["beta"] + q["theta"]
    k1 = m.body("k1", (0, 0, b), mass=0.04325, inertia=2.194e-6, centre=(ra, 0))
    end = (rr * np.cos(b), rr * np.sin(b))
    k2 = m.body("k2", (*end, t), mass=0.00365, inertia=4.41e-7, centre=(-da, 0))
    # Axes of K3 along and across BP: its angle is gamma less a right angle.
    k3 = m.body("k3", (xb, yb, q["gamma"] - np.pi / 2), mass=0.02373, inertia=5.255e-6,
                centre=(sa, sb))  # fmt: skip
    k5 = m.body("k5", (xa, ya, q["delta"]), mass=0.0705, inertia=1.169e-5, centre=(ta, tb))
    tip = (xa + zt * np.cos(q["delta"]), ya + zt * np.sin(q["delta"]))
    k4 = m.body("k4", (*tip, q["phi"] + q["delta"] - np.pi / 2), mass=0.00706, inertia=5.667e-7,
                centre=(e - ea, 0))  # fmt: skip
    k7 = m.body("k7", (xa, ya, q["epsilon"] - np.pi / 2), mass=0.05498, inertia=1.912e-5,
                centre=(ua, ub))  # fmt: skip
    tip = (xa + u * np.sin(q["epsilon"]), ya - u * np.cos(q["epsilon"]))
    k6 = m.body("k6", (*tip, q["omega"] + q["epsilon"]), mass=0.00706, inertia=5.667e-7,
                centre=(zf - fa, 0))  # fmt: skip
    m.add(kc.Revolute("O", m.ground, (0, 0), k1, (0, 0)))
    m.add(kc.Revolute("R", k1, (rr, 0), k2, (0, 0)))
    m.add(kc.Revolute("B", m.ground, (xb, yb), k3, (0, 0)))
    m.add(kc.Revolute("P3", k2, (-d, 0), k3, (ss, 0)))
    m.add(kc.Revolute("A5", m.ground, (xa, ya), k5, (0, 0)))
    m.add(kc.Revolute("E", k5, (zt, 0), k4, (0, 0)))
    m.add(kc.Revolute("P4", k2, (-d, 0), k4, (e, 0)))
    m.add(kc.Revolute("A7", m.ground, (xa, ya), k7, (0, 0)))
    m.add(kc.Revolute("F", k7, (u, 0), k6, (0, 0)))
    m.add(kc.Revolute("P6", k2, (-d, 0), k6, (zf, 0)))
    m.add(kc.AbsoluteAngle("motor", k1, b + acceleration * kc.t**2 / 2))
    m.add(kc.Spring("spring", m.ground, (xc, yc), k3, (sc, sd), 4530, 0.07785))
    found = kc.forces(kc.solve(kc.compile(m), [0.0]))
    assert found.drivers["motor"].value[0] == pytest.approx(0.033, rel=1e-9)
    assert found.motion["k2.phi_ddot"][0] == pytest.approx(
        acceleration - 10666.8329399655854, rel=1e-9
    )
    np.testing.assert_allclose(
        found.reactions["P3"].force[0], (98.5668703962410896, -6.12268834425566266), rtol=1e-9
    )


def two_guides():
    """Return a slide on two parallel guides, driven along them and loaded across."""
    m = kc.Mechanism("slide")
    m.gravity = (0, -G)
    slide = m.body("slide", (0.1, 0, 0), mass=2, inertia=0.1, centre=(0.1, 0))
    m.add(kc.Translational("left", m.ground, (0, 0), (1, 0), slide, (0, 0), (1, 0)))
    m.add(kc.Translational("right", m.ground, (0, 0), (1, 0), slide, (1, 0), (1, 0)))
    m.add(kc.AbsoluteX("push", slide, (0, 0), 0.1 + kc.t**2))
    m.add(kc.Force("load", slide, (0.3, 0), (-5, -7)))
    return m


def test_that_redundant_joints_say_what_no_rigid_model_knows():
    with pytest.warns(kc.RedundantConstraintWarning):
        module = kc.compile(two_guides())
    found = kc.forces(kc.solve(module, [0.0, 0.5, 1.0]))
    forces = {name for name in found.undetermined if not name.startswith("lambda_")}
    assert {"F_y_left", "F_y_right", "T_left", "T_right"} <= forces
    assert np.isnan(found.reactions["left"].force[:, 1]).all()
    # What drives it is known, and so is what the ground bears as a whole.
    np.testing.assert_allclose(found.drivers["push"].value, 2 * 2 + 5, rtol=1e-12)
    np.testing.assert_allclose(found.ground.force, [[-9, -2 * G - 7]] * 3, rtol=1e-12)
    assert "not determined" in str(found)


def test_that_one_guide_bears_all_of_it():
    m = two_guides()
    m.constraints.pop(1)
    found = kc.forces(kc.solve(kc.compile(m), [0.0, 0.5]))
    assert found.undetermined == ()
    np.testing.assert_allclose(found.reactions["left"].force[:, 1], 2 * G + 7, rtol=1e-12)
    np.testing.assert_allclose(found.reactions["left"].moment, 0.1 * 2 * G + 0.3 * 7, rtol=1e-12)


def test_that_a_driven_distance_pushes_with_a_force():
    """A hydraulic cylinder lifts a boom: its force from moments about the hinge."""
    m = kc.Mechanism("boom")
    m.gravity = (0, -G)
    boom = m.body("boom", (0, 0, 0.5), mass=40, inertia=30, centre=(1.2, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), boom, (0, 0)))
    m.add(kc.Distance("cylinder", m.ground, (0.5, -0.4), boom, (0.8, 0), 0.9 + 0.05 * kc.t))
    solution = kc.solve(kc.compile(m), np.linspace(0, 1, 5))
    found = kc.forces(solution)
    ((foot, _, _),) = motion_of_points(solution, "boom", (0.8, 0))
    way = foot - np.array([[0.5], [-0.4]])
    arm = cross(foot, way / np.hypot(*way))
    weight = 40 * G * 1.2 * np.cos(solution["boom.phi"])
    inertia = (30 + 40 * 1.2**2) * solution["boom.phi_ddot"]
    np.testing.assert_allclose(
        found.drivers["cylinder"].value, (inertia + weight) / arm, rtol=1e-11
    )
    np.testing.assert_allclose(found["cylinder.P"], 0.05 * found["cylinder.drive"], rtol=1e-11)
    assert found.drivers["cylinder"].unit == "N"


def test_that_variants_and_gaps_are_followed():
    m = slider_crank()
    speed = m.parameter("w", 10.0)
    m.constraints[-1] = kc.AbsoluteAngle("motor", m.bodies[0], 0.3 + speed * kc.t)
    module = kc.compile(m)
    speeds = [5.0, 10.0, 20.0]
    found = kc.forces(kc.solve(module, TIMES, {"w": speeds}))
    for k, w in enumerate(speeds):
        one = kc.forces(kc.solve(module, TIMES, {"w": w}))
        np.testing.assert_allclose(found["motor.drive"][k], one["motor.drive"], rtol=1e-9)
        np.testing.assert_allclose(
            found.reactions["A"].force[k], one.reactions["A"].force, rtol=1e-9, atol=1e-9
        )
    blocked = four_bar()
    start = kc.solve(kc.compile(blocked), [0.0])["rocker.phi"][0]
    blocked.constraints[-1] = kc.AbsoluteAngle("motor", blocked.bodies[2], start + 2 * kc.t)
    solution = kc.solve(kc.compile(blocked), np.linspace(0, 2, 21))
    assert not solution.success
    partial = kc.forces(solution)
    good = np.isfinite(solution.q_ddot).all(axis=1)
    assert good.any()
    np.testing.assert_array_equal(np.isfinite(partial["motor.drive"]), good)


def test_that_the_columns_are_written_and_named(tmp_path):
    found = kc.forces(kc.solve(kc.compile(slider_crank()), TIMES))
    path = kc.write(found.motion, tmp_path / "forces.csv")
    head, first, *_ = path.read_text().splitlines()
    columns = head.split(",")
    assert "F_x_A [N]" in columns
    assert "T_C [N*m]" in columns
    assert "P_motor [W]" in columns
    assert not [name for name in columns if name.startswith(("F_", "T_")) and "_dot" in name]
    numbers = dict(zip(columns, first.split(","), strict=True))
    assert float(numbers["drive_motor [N*m]"]) == found["motor.drive"][0]
    frame = found.motion.to_pandas()
    np.testing.assert_array_equal(frame["F_y_A"], found["A.F_y"])


def test_the_measures_of_a_torque():
    """Of a flywheel whose speed swings the torque is J w^2 sin, with mean 0 and RMS peak/sqrt 2."""
    m = kc.Mechanism("wheel")
    wheel = m.body("wheel", mass=3, inertia=0.25)
    m.add(kc.Revolute("O", m.ground, (0, 0), wheel, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", wheel, sympy.sin(2 * kc.pi * kc.t)))
    found = kc.forces(kc.solve(kc.compile(m), np.linspace(0, 1, 201)))
    torque = found.measures()["motor.drive"]
    peak = 0.25 * (2 * np.pi) ** 2
    assert torque.peak == pytest.approx(peak, rel=1e-12)
    assert torque.rms == pytest.approx(peak / np.sqrt(2), rel=1e-12)
    assert torque.mean == pytest.approx(0, abs=1e-12)
    assert (torque.t_least, torque.t_greatest) == pytest.approx((0.25, 0.75))
    with pytest.raises(kc.InputError, match=r"no force 'moter.drive'.*did you mean"):
        found.measures()["moter.drive"]


def test_what_forces_are_refused(tmp_path):
    free = four_bar()
    free.loads.clear()
    free.bodies[:] = [
        dataclasses.replace(body, mass=None, inertia=None, centre=(0, 0)) for body in free.bodies
    ]
    with pytest.raises(kc.InputError, match="has no masses and no forces"):
        kc.forces(kc.solve(kc.compile(free), [0.0]))
    kc.emit(four_bar()).write(tmp_path)
    loaded = kc.load(tmp_path / "four_bar.py")
    with pytest.raises(kc.InputError, match="was loaded from a file"):
        kc.forces(kc.solve(loaded, [0.0]))
    grouped = kc.compile(four_bar(), form="grouped")
    with pytest.raises(kc.UnsupportedError, match="use form='inline'"):
        kc.forces(kc.solve(grouped, [0.0]))
    with pytest.raises(kc.InputError, match="expected a Solution"):
        kc.forces(3)
    named = four_bar()
    named.output("F_x_A", named.bodies[0].phi)
    with pytest.raises(kc.ModelError, match="has the name 'F_x_A'"):
        kc.forces(kc.solve(kc.compile(named), [0.0]))


def test_that_a_spring_of_length_zero_is_told():
    """It passes through the point at which its ends meet: nothing says which way it pulls."""
    m = kc.Mechanism("arm")
    arm = m.body("arm", mass=1, inertia=1)
    m.add(kc.Revolute("O", m.ground, (0, 0), arm, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", arm, kc.t))
    m.add(kc.Spring("s", m.ground, (1, 0), arm, (1, 0), 10, 0.1))
    module = kc.compile(m)
    with pytest.warns(kc.SingularConfigurationWarning, match="spring of length zero has no"):
        found = kc.forces(kc.solve(module, [0.0, 0.1]))
    assert np.isnan(found["motor.drive"][0])
    assert np.isfinite(found["motor.drive"][1])
    m.constraints.pop()
    found = kc.equilibrium(kc.compile(m))
    assert "the loads on arm have no value at t = 0" in found.message


def wheel_in(length_unit: str, mass_unit: str, metre: float, kilogram: float) -> kc.Mechanism:
    """A wheel that is out of balance, on a spring: a metre and a kilogram are so many units."""
    m = kc.Mechanism("wheel", length_unit=length_unit, mass_unit=mass_unit)
    m.gravity = (0, -G * metre)
    inertia = 0.25 * kilogram * metre**2
    wheel = m.body("wheel", mass=3 * kilogram, inertia=inertia, centre=(0.1 * metre, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), wheel, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", wheel, 3 * kc.t + 5 * kc.t**2))
    ends = (m.ground, (0.5 * metre, 0), wheel, (0, 0.2 * metre))
    m.add(kc.Spring("spring", *ends, stiffness=40 / metre, free_length=0.1 * metre))
    return m


@pytest.mark.parametrize(
    ("units", "metre", "kilogram", "known"),
    [
        (("mm", "kg"), 1e3, 1.0, ("N", "N*mm", "W", "J")),
        (("mm", "t"), 1e3, 1e-3, ("N", "N*mm", "W", "J")),
        (("in", "lb"), 1 / 0.0254, 1 / 0.45359237, ("N", "N*in", "W", "J")),
        (("m", "g"), 1.0, 1e3, ("N", "N*m", "W", "J")),
    ],
)
def test_that_forces_are_newtons_whatever_the_units_of_length_and_mass(
    units, metre, kilogram, known
):
    """Beside the same wheel in metres and kilograms, whose torque is known by hand."""
    force, torque, power, energy = known
    t = np.linspace(0, 0.4, 5)
    here = kc.compile(wheel_in(units[0], units[1], metre, kilogram))
    there = kc.compile(wheel_in("m", "kg", 1.0, 1.0))
    found, wanted = (kc.forces(kc.solve(module, t)) for module in (here, there))
    angle = 3 * t + 5 * t**2
    about, length = 0.25 + 3 * 0.1**2, np.sqrt(0.5**2 + 0.2**2 + 0.2 * np.sin(angle))
    slope = 3 * G * 0.1 * np.cos(angle) + 40 * (length - 0.1) * 0.1 * np.cos(angle) / length
    np.testing.assert_allclose(wanted["drive_motor"], 10 * about + slope, rtol=1e-12)
    for name, unit, factor in (
        ("F_x_O", force, 1), ("load_spring", force, 1), ("drive_motor", torque, metre),
        ("P_motor", power, 1),
    ):  # fmt: skip
        assert found.motion.units[name] == unit
        np.testing.assert_allclose(found[name], factor * wanted[name], rtol=1e-11, atol=1e-11)
    speed = 3 + 10 * t
    np.testing.assert_allclose(wanted["P_motor"], wanted["drive_motor"] * speed, rtol=1e-12)
    free = wheel_in(units[0], units[1], metre, kilogram)
    free.constraints.pop()
    moved = kc.simulate(kc.compile(free), t)
    assert moved.observed.units["kinetic_energy"] == energy
    np.testing.assert_allclose(
        moved["kinetic_energy"], about * moved["wheel.phi_dot"] ** 2 / 2, rtol=1e-9
    )


def test_that_forces_without_a_known_unit_of_length_say_so():
    module = kc.compile(wheel_in("px", "kg", 1.0, 1.0))
    found = kc.forces(kc.solve(module, [0.0, 0.1]))
    assert found.motion.units["F_x_O"] == "kg*px/s^2"
    assert found.motion.units["drive_motor"] == "kg*px^2/s^2"
    for lengths, masses in (("px", "t"), ("mm", "stone")):
        with pytest.raises(kc.ModelError, match="do not give newtons; the unit of"):
            wheel_in(lengths, masses, 1.0, 1.0).system()


def test_that_every_point_of_a_redundant_mechanism_is_balanced():
    """A parallelogram with three cranks: one is too many, and the torque is known all the same."""
    m = kc.Mechanism("parallelogram")
    m.gravity = (0, -G)
    bar = m.body("bar", (0.3, 0.3, 0), mass=2, inertia=0.1)
    m_bar, cranks = 2, []
    for k, x in enumerate((0.0, 0.4, 1.0)):
        crank = m.body(f"crank{k}", (x, 0, 0.8), mass=1, inertia=0.02, centre=(0.15, 0))
        m.add(kc.Revolute(f"O{k}", m.ground, (x, 0), crank, (0, 0)))
        m.add(kc.Revolute(f"B{k}", crank, (0.3, 0), bar, (x, 0)))
        cranks.append(crank)
    m.add(kc.AbsoluteAngle("motor", cranks[0], 0.8 + kc.t))
    with pytest.warns(kc.RedundantConstraintWarning):
        module = kc.compile(m)
    solution = kc.solve(module, np.linspace(0, 0.5, 6))
    found = kc.forces(solution)
    angle = 0.8 + solution.t
    # Uniform motion: kinetic energy is constant, the motor lifts the weights.
    lifted = G * np.cos(angle) * (3 * 0.15 * 1 + m_bar * 0.3)
    np.testing.assert_allclose(found.drivers["motor"].value, lifted, rtol=1e-11)
    assert {f"F_{a}_{b}{k}" for a, b, k in itertools.product("x", "OB", (0, 1, 2))} & set(
        found.undetermined
    )

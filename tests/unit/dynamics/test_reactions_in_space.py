"""Reactions, torques and powers in space, against free bodies by Newton and Euler."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from tests.unit.dynamics.test_space import g_of, inertia_of

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "space"
G = 9.81
ORIGIN, X, Y, Z = (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)
TURNS = [
    pytest.param(np.eye(3), marks=pytest.mark.slow),
    Rotation.from_euler("xyz", (0.4, -1.1, 0.8)).as_matrix(),
]


class Moving:
    """A body along a solution: its turn, rates and centre of mass, from q and its rates alone."""

    def __init__(self, solution, body):
        def columns(letters, dots):
            names = [f"{letter}_{body.name}{dots}" for letter in letters]
            return np.column_stack([solution[name] for name in names])

        p = [columns(("e0", "e1", "e2", "e3"), dots) for dots in ("", "_dot", "_ddot")]
        self.turn = Rotation.from_quat(p[0], scalar_first=True)
        pairs = zip(p[0], p[1], p[2], strict=True)
        spins = [(2 * g_of(at) @ rate, 2 * g_of(at) @ second) for at, rate, second in pairs]
        self.spin, self.change = (np.array(item) for item in zip(*spins, strict=True))
        self.r, self.v, self.a = (columns("xyz", dots) for dots in ("", "_dot", "_ddot"))
        self.mass, self.inertia = body.mass, np.array(body.inertia, dtype=float)
        if self.inertia.ndim == 1:
            self.inertia = np.diag(self.inertia)
        self.centre = self.at(body.centre)

    def at(self, point):
        """Return where a point of it is."""
        return self.r + self.turn.apply(point)

    @property
    def velocity(self):
        """Of the centre of mass."""
        w = self.turn.apply(self.spin)
        return self.v + np.cross(w, self.centre - self.r)

    @property
    def acceleration(self):
        w, alpha = self.turn.apply(self.spin), self.turn.apply(self.change)
        arm = self.centre - self.r
        return self.a + np.cross(alpha, arm) + np.cross(w, np.cross(w, arm))

    @property
    def momentum(self):
        """The rate of the angular momentum about the centre of mass, in global components."""
        own = self.change @ self.inertia + np.cross(self.spin, self.spin @ self.inertia)
        return self.turn.apply(own)


def wrenches(moving, gravity, joints, applied):
    """Return what each unknown is: those of joints in order, from 6 equations a body and time.

    A joint is (body i or None, body j, its place, directions of forces, of moments); what it does
    to body i is the opposite. Applied are (body, place, force, moment).
    """
    bodies = list(moving)
    count = len(next(iter(moving.values())).r)
    sides = np.zeros((count, 6 * len(bodies)))
    for k, body in enumerate(moving.values()):
        sides[:, 6 * k : 6 * k + 3] = body.mass * (body.acceleration - gravity)
        sides[:, 6 * k + 3 : 6 * k + 6] = body.momentum
    for name, place, force, moment in applied:
        k = 6 * bodies.index(name)
        arm = place - moving[name].centre
        sides[:, k : k + 3] -= force
        sides[:, k + 3 : k + 6] -= moment + np.cross(arm, force)
    columns = []
    for first, last, place, forces, moments in joints:
        for direction, is_force in [(f, True) for f in forces] + [(m, False) for m in moments]:
            column = np.zeros((count, 6 * len(bodies)))
            for name, sign in ((last, 1), (first, -1)):
                if name is None:
                    continue
                k = 6 * bodies.index(name)
                way = sign * np.broadcast_to(direction, (count, 3))
                if is_force:
                    column[:, k : k + 3] = way
                    way = np.cross(place - moving[name].centre, way)
                column[:, k + 3 : k + 6] = way
            columns.append(column)
    found = np.linalg.solve(np.stack(columns, axis=-1), sides[..., np.newaxis])[..., 0]
    return iter(found.T)


def taken(unknowns, directions):
    """Return the vector that the next unknowns make along their directions."""
    return sum(next(unknowns)[:, np.newaxis] * np.asarray(way) for way in directions)


def slider_crank(turn):
    """Return Haug's spatial slider-crank with heavy, eccentric links, all turned by a matrix."""
    m = spatial.Mechanism("slider_crank")
    m.gravity = tuple(turn @ (0.3, -1, -G))

    def body(name, place, x, y, seed):
        return m.body(
            name, tuple(turn @ place), x=tuple(turn @ x), y=tuple(turn @ y), mass=0.5 + seed,
            inertia=(0.01 * inertia_of(seed)).tolist(), centre=(0.01 * seed, 0.02, -0.01),
        )  # fmt: skip

    crank = body("crank", (0, 0.1, 0.12), X, Y, 1)
    rod = body("rod", (0.1, 0.05, 0.1), (2, -1, -2), (-1, -2, 0), 2)
    slider = body("slider", (0.2, 0, 0), X, Y, 3)
    axis, across = tuple(turn @ X), tuple(turn @ Y)
    m.add(spatial.Revolute("O", m.ground, tuple(turn @ (0, 0.1, 0.12)), axis, crank, ORIGIN, X))
    m.add(spatial.Spherical("A", crank, (0, 0, 0.08), rod, (-0.15, 0, 0)))
    m.add(spatial.Universal("B", rod, (0.15, 0, 0), Y, slider, ORIGIN, Z))
    m.add(spatial.Translational("C", m.ground, ORIGIN, axis, across, slider, ORIGIN, X, Z))
    angle = 0.2 + 6 * kc.t + 3 * kc.t**2
    m.add(spatial.RelativeRotation("motor", m.ground, axis, across, crank, X, Y, angle))
    m.add(spatial.FollowerForce("tool", rod, (0.05, 0.02, 0.01), (4, -7, 2)))
    m.add(spatial.SliderFriction("rub", m.ground, ORIGIN, axis, slider, (0, 0.1, 0), 3, 0.2))
    return m


@pytest.mark.slow
@pytest.mark.parametrize("turn", TURNS)
def test_that_a_spatial_slider_crank_bears_what_its_free_bodies_say(turn):
    m = slider_crank(turn)
    solution = kc.solve(kc.compile(m), np.linspace(0, 0.6, 9))
    found = kc.forces(solution)
    moving = {body.name: Moving(solution, body) for body in m.bodies}
    crank, rod, slider = moving.values()
    x, y, z = turn.T
    arms = rod.turn.apply(Y), slider.turn.apply(Z)
    normal = np.cross(*arms)
    joints = [
        (None, "crank", crank.r, turn.T, (y, z)),
        ("crank", "rod", crank.at((0, 0, 0.08)), turn.T, ()),
        ("rod", "slider", slider.r, turn.T, (normal,)),
        (None, "slider", slider.r, (y, z), turn.T),
        (None, "crank", crank.r, (), (x,)),
    ]
    way = slider.v @ x
    rub = -3 * way / np.hypot(way, 0.2)
    applied = [
        ("rod", rod.at((0.05, 0.02, 0.01)), rod.turn.apply((4, -7, 2)), 0),
        ("slider", slider.at((0, 0.1, 0)), rub[:, np.newaxis] * x, 0),
    ]
    unknowns = wrenches(moving, turn @ (0.3, -1, -G), joints, applied)
    known: dict[str, Any] = {}
    for name, (_, _, _, forces, moments) in zip("OABC", joints, strict=False):
        known[name] = taken(unknowns, forces), taken(unknowns, moments)
    motor = next(unknowns)
    close: dict[str, Any] = {"rtol": 1e-9, "atol": 1e-9}
    for name, (force, moment) in known.items():
        reaction = found.reactions[name]
        np.testing.assert_allclose(reaction.force, force, **close)
        np.testing.assert_allclose(reaction.moment, np.broadcast_to(moment, force.shape), **close)
    np.testing.assert_allclose(found.drivers["motor"].value, motor, **close)
    rate = 6 + 6 * solution.t
    np.testing.assert_allclose(found.drivers["motor"].power, motor * rate, **close)
    # Along the axes: a hinge bears no moment about its own, a guide no force along it.
    pin, cross, guide = (found.reactions[name] for name in "OBC")
    force, moment = known["O"]
    np.testing.assert_allclose(pin.along_axis[:, 0], force @ x, **close)
    np.testing.assert_allclose(np.hypot(*pin.along_axis[:, 1:].T), np.hypot(force @ y, force @ z))
    np.testing.assert_allclose(
        np.hypot(*pin.moment_along_axis[:, 1:].T), np.hypot(moment @ y, moment @ z)
    )
    assert "T_along_O" not in found.names
    assert not pin.moment_along_axis[:, 0].any()
    np.testing.assert_allclose(cross.moment_along_axis[:, 0], 0, atol=1e-9)
    np.testing.assert_allclose(guide.along_axis[:, 0], 0, atol=1e-9)
    np.testing.assert_allclose(guide.moment_along_axis[:, 0], known["C"][1] @ x, **close)
    # On the first bodies: about the joint's points of them, and the ground about its origin.
    np.testing.assert_allclose(found.reactions["B"].moment_on_i, -known["B"][1], **close)
    own = -known["C"][1] - np.cross(slider.r, known["C"][0])
    np.testing.assert_allclose(guide.moment_on_i, own, **close)
    shaken = -known["O"][0] - known["C"][0] - rub[:, np.newaxis] * x
    np.testing.assert_allclose(found.ground.force, shaken, **close)
    felt = own - np.cross(crank.r, known["O"][0]) - known["O"][1] - motor[:, np.newaxis] * x
    felt -= np.cross(slider.at((0, 0.1, 0)), rub[:, np.newaxis] * x)
    np.testing.assert_allclose(found.ground.moment, felt, **close)


def rssr(turn):
    """Return an RSSR linkage with springs, dampers and friction about its rocker's hinge."""
    m = spatial.Mechanism("rssr")
    m.gravity = tuple(turn @ (0, 0, -G))
    place, y, z, x = (tuple(turn @ item) for item in ((0.3, 0.05, -0.12), Y, Z, X))

    def body(name, origin, seed):
        return m.body(
            name, origin, turn, mass=1 + seed, inertia=(0.02 * inertia_of(seed)).tolist(),
            centre=(0.03, -0.02, 0.05),
        )  # fmt: skip

    crank, rocker = body("crank", ORIGIN, 4), body("rocker", place, 5)
    m.add(spatial.Revolute("O", m.ground, ORIGIN, z, crank, ORIGIN, Z))
    m.add(spatial.Revolute("P", m.ground, place, y, rocker, ORIGIN, Y))
    m.add(spatial.Distance("rod", crank, (0.1, 0, 0), rocker, (0, 0, 0.25), 0.32))
    m.add(spatial.RelativeRotation("motor", m.ground, z, x, crank, Z, X, 5 * kc.t + kc.t**2))
    m.add(spatial.TorsionSpring("clock", m.ground, y, z, rocker, Y, Z, 4, 0.3, 0.2))
    m.add(spatial.HingeFriction("dry", m.ground, y, rocker, Y, 0.7, 0.4))
    m.add(spatial.Torque("drag", crank, tuple(turn @ (0.2, -0.1, 0.4))))
    return m


@pytest.mark.parametrize("turn", TURNS)
def test_that_an_rssr_bears_what_its_free_bodies_say(turn):
    m = rssr(turn)
    solution = kc.solve(kc.compile(m), np.linspace(0, 1, 11))
    found = kc.forces(solution)
    moving = {body.name: Moving(solution, body) for body in m.bodies}
    crank, rocker = moving.values()
    x, y, z = turn.T
    pin, end = crank.at((0.1, 0, 0)), rocker.at((0, 0, 0.25))
    along = (end - pin) / 0.32
    joints = [
        (None, "crank", crank.r, turn.T, (x, y)),
        (None, "rocker", rocker.r, turn.T, (x, z)),
        ("crank", "rocker", end, (along,), ()),
        (None, "crank", crank.r, (), (z,)),
    ]
    relative = turn.T @ rocker.turn.as_matrix()
    angle = np.arctan2(relative[:, 0, 2], relative[:, 2, 2])
    rate = rocker.turn.apply(rocker.spin) @ y
    torque = -(4 * (angle - 0.3) + 0.2 * rate) - 0.7 * rate / np.hypot(rate, 0.4)
    applied = [
        ("rocker", rocker.r, np.zeros(3), torque[:, np.newaxis] * y),
        ("crank", crank.r, np.zeros(3), turn @ (0.2, -0.1, 0.4)),
    ]
    unknowns = wrenches(moving, turn @ (0, 0, -G), joints, applied)
    close: dict[str, Any] = {"rtol": 1e-9, "atol": 1e-9}
    for name, (_, _, _, forces, moments) in zip("OP", joints, strict=False):
        reaction = found.reactions[name]
        np.testing.assert_allclose(reaction.force, taken(unknowns, forces), **close)
        np.testing.assert_allclose(reaction.moment, taken(unknowns, moments), **close)
    tension, motor = unknowns
    np.testing.assert_allclose(found.drivers["rod"].value, tension, **close)
    np.testing.assert_allclose(
        found.reactions["rod"].force, tension[:, np.newaxis] * along, **close
    )
    np.testing.assert_allclose(found.drivers["motor"].value, motor, **close)
    np.testing.assert_allclose(found.drivers["motor"].power, motor * (5 + 2 * solution.t), **close)
    np.testing.assert_allclose(found["theta_clock_angle"], angle, atol=1e-12)


def heavy(model):
    """Return a mechanism in space with seeded masses, centres and gravity."""
    rng = np.random.default_rng(len(model.name))
    model.gravity = (0.4, 0.7, -G)
    model.bodies[:] = [
        dataclasses.replace(
            body,
            mass=float(rng.uniform(0.5, 3)),
            inertia=(0.05 * inertia_of(k)).tolist(),
            centre=tuple(rng.uniform(-0.2, 0.2, 3).tolist()),
        )
        for k, body in enumerate(model.bodies)
    ]
    return model


FAST = ("rssr", "spatial_slider_crank")


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=[] if path.stem in FAST else [pytest.mark.slow])
        for path in sorted(EXAMPLES.glob("*.toml"))
    ],
    ids=lambda path: path.stem,
)
@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
def test_the_balance_of_power_and_of_momentum_in_every_example(path):
    """Drivers and weight raise the kinetic energy; what the ground does not bear is momentum."""
    model = heavy(kc.read_model(path))
    solution = kc.solve(kc.compile(model), np.linspace(0, float(model.end), 9))
    found = kc.forces(solution)
    good = np.isfinite(solution.q_ddot).all(axis=1)
    assert good.any()
    g = np.array([0.4, 0.7, -G])
    supplied, gained, largest = np.zeros((3, len(solution.t)))
    force, moment = np.zeros((2, len(solution.t), 3))
    for body in model.bodies:
        item = Moving(solution, body)
        v, a = item.velocity, item.acceleration
        energy = (
            item.mass * (v * a).sum(axis=1),
            (item.turn.apply(item.spin) * item.momentum).sum(1),
        )
        weight = item.mass * v @ g
        gained += sum(energy)
        supplied += weight
        largest += sum(map(np.abs, (*energy, weight)))
        own = item.mass * (g - a)
        force += own
        moment += np.cross(item.centre, own) - item.momentum
    for name in found.names:
        if name.startswith("P_"):
            supplied += found[name]
            largest += np.abs(found[name])
    close: dict[str, Any] = {"rtol": 0, "atol": 1e-10 * largest[good].max()}
    np.testing.assert_allclose(supplied[good], gained[good], **close)
    for known, given in ((force, found.ground.force), (moment, found.ground.moment)):
        size = np.abs(known[good]).max()
        np.testing.assert_allclose(given[good], known[good], rtol=0, atol=1e-10 * size)


def test_that_hinges_that_share_a_load_are_said_not_to_be_known():
    """A planar four-bar of four hinges: across its plane no rigid model knows, in it every one."""
    flat, deep = kc.Mechanism("flat"), spatial.Mechanism("deep")
    flat.gravity, deep.gravity = (0, -G), (0, 0, -G)
    links = {"crank": (0, 0, 0.6), "rod": (0.1, 0.1, 0.2), "rocker": (0.5, 0, 1.4)}
    for name, (x, z, angle) in links.items():
        c, s = math.cos(angle), math.sin(angle)
        flat.body(name, (x, z, angle), mass=1, inertia=0.02, centre=(0.1, 0.02))
        deep.body(
            name, (x, 0, z), x=(c, 0, s), z=(-s, 0, c), mass=1, inertia=(0.01, 0.02, 0.015),
            centre=(0.1, 0, 0.02),
        )  # fmt: skip
    pins = {
        "O": ("ground", (0, 0), "crank", (0, 0)), "A": ("crank", (0.15, 0), "rod", (0, 0)),
        "B": ("rod", (0.45, 0), "rocker", (0.3, 0)), "C": ("ground", (0.5, 0), "rocker", (0, 0)),
    }  # fmt: skip
    for name, (i, (a, b), j, (c, d)) in pins.items():
        flat.add(kc.Revolute(name, i, (a, b), j, (c, d)))
        deep.add(spatial.Revolute(name, i, (a, 0, b), (0, -1, 0), j, (c, 0, d), (0, -1, 0)))
    angle = 0.6 + 9 * kc.t
    flat.add(kc.AbsoluteAngle("motor", "crank", angle))
    turning = ((0, -1, 0), X)
    deep.add(spatial.RelativeRotation("motor", "ground", *turning, "crank", *turning, angle))
    known = kc.forces(kc.solve(kc.compile(flat), [0, 0.2, 0.5]))
    with pytest.warns(kc.RedundantConstraintWarning):
        module = kc.compile(deep)
    found = kc.forces(kc.solve(module, [0, 0.2, 0.5]))
    np.testing.assert_allclose(found["motor.drive"], known["motor.drive"], rtol=1e-9)
    for name in pins:
        for flat_axis, axis in ("xx", "yz"):
            given = found[f"{name}.F_{axis}"]
            np.testing.assert_allclose(given, known[f"{name}.F_{flat_axis}"], atol=1e-9)
        assert np.isnan(found[f"{name}.F_y"]).all()
        assert {f"F_y_{name}", f"F_along_{name}"} <= set(found.undetermined)
    np.testing.assert_allclose(found.ground.moment[:, 1], -known.ground.moment, atol=1e-9)
    assert "not determined" in str(found)


def test_that_a_body_whose_orientation_is_driven_has_its_forces_too():
    """A formula that the equation itself does not have, as the axes of the body, is made."""
    m = spatial.Mechanism("held")
    m.gravity = (0, 0, -G)
    body = m.body("body", (0.1, 0, 0), mass=2, inertia=(0.03, 0.04, 0.02), centre=(0.2, 0, 0))
    m.add(spatial.Spherical("O", m.ground, ORIGIN, body, (-0.1, 0, 0)))
    m.add(spatial.AbsoluteOrientation("hold", body, Y, 0))
    found = kc.forces(kc.solve(kc.compile(m), [0.0]))
    np.testing.assert_allclose(found.reactions["O"].force, [(0, 0, 2 * G)], atol=1e-12)
    np.testing.assert_allclose(found.reactions["hold"].moment, [(0, -0.6 * G, 0)], atol=1e-12)
    np.testing.assert_allclose(found.ground.moment, [(0, 0.6 * G, 0)], atol=1e-12)

"""Equilibria, their stability and stiffness, against closed forms and roots of a potential."""

from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc

G = 9.81


def rod(stiffness=60.0, free_length=0.4):
    """Return S1: a rod hinged at the origin, held by a spring from its end to (0, 1.2)."""
    m = kc.Mechanism("rod_on_spring")
    m.gravity = (0, -G)
    body = m.body("rod", (0.5, 0, 0.2), mass=2, inertia=2 / 12, centre=(0.5, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), body, (0, 0)))
    k, length = m.parameter("k", stiffness), m.parameter("l0", free_length)
    m.add(kc.Spring("s", m.ground, (0, 1.2), body, (1, 0), k, length))
    m.point("tip", body, (1, 0))
    return m


def toggle(load: Any = 80.0, name="toggle"):
    """Return S2: a point on two inclined springs, pushed down."""
    m = kc.Mechanism(name)
    knee = m.body("knee", (0, 0.4, 0))
    m.add(kc.AbsoluteX("x", knee, (0, 0), 0.0))
    m.add(kc.AbsoluteAngle("phi", knee, 0.0))
    m.add(kc.Spring("left", m.ground, (-0.5, 0), knee, (0, 0), 2000, 0.6))
    m.add(kc.Spring("right", m.ground, (0.5, 0), knee, (0, 0), 2000, 0.6))
    m.add(kc.Force("load", knee, (0, 0), (0, -load)))
    return m


def chain():
    """Return S5: two hanging rods, pulled aside at the end."""
    m = kc.Mechanism("chain")
    m.gravity = (0, -G)
    upper = m.body("upper", (0, 0, -1.5), mass=3, inertia=3 * 0.8**2 / 12, centre=(0.4, 0))
    lower = m.body("lower", (0, -0.8, -1.5), mass=2, inertia=2 * 0.6**2 / 12, centre=(0.3, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), upper, (0, 0)))
    m.add(kc.Revolute("A", upper, (0.8, 0), lower, (0, 0)))
    m.add(kc.Force("pull", lower, (0.6, 0), (12, 0)))
    m.point("end", lower, (0.6, 0))
    return m


def column(load: Any = 8 * kc.t):
    """Return a bar that stands on a torsion spring under a weight: it buckles at k/l."""
    m = kc.Mechanism("column")
    bar = m.body("bar", (0, 0, kc.pi / 2))
    m.add(kc.Revolute("O", m.ground, (0, 0), bar, (0, 0)))
    m.add(kc.TorsionSpring("foot", m.ground, bar, 10, kc.pi / 2))
    m.add(kc.Force("weight", bar, (1, 0), (0, -load)))
    return m


@pytest.mark.parametrize("target", ["numpy", "c"])
def test_that_a_rod_rests_where_its_spring_has_the_known_length(target, quick_compiler):
    found = kc.equilibrium(kc.compile(rod(), target=target))
    assert found.success
    assert found.stability == ("stable",)
    assert found["rod.phi"][0] == pytest.approx(1.18715766125861, abs=1e-13)
    length = np.hypot(found["tip.x"], found["tip.y"] - 1.2)[0]
    assert length == pytest.approx(0.463096960926194, abs=1e-13)
    reaction = found.forces.reactions["O"].force[0]
    np.testing.assert_allclose(reaction, (3.05987884556331, 17.390749728785), rtol=1e-12)
    assert found.forces["s.load"][0] == pytest.approx(60 * (length - 0.4), rel=1e-12)


def test_that_the_stiffness_is_the_second_derivative_of_the_potential():
    a = sympy.Symbol("a")
    length = sympy.sqrt(sympy.cos(a) ** 2 + (sympy.sin(a) - sympy.Rational(6, 5)) ** 2)
    potential = G * sympy.sin(a) + 30 * (length - sympy.Rational(2, 5)) ** 2
    found = kc.equilibrium(kc.compile(rod()))
    angle = found["rod.phi"][0]
    held = float(potential.diff(a, 2).subs(a, angle))
    assert found.stiffness("rod.phi")[0] == pytest.approx(held, rel=1e-12)
    # The tip moves across the rod alone.
    expected = held / np.sin(angle) ** 2
    assert found.stiffness("tip.x")[0] == pytest.approx(expected, rel=1e-12)
    with pytest.raises(kc.InputError, match=r"tip.x, tip.y cannot move independently"):
        found.stiffness("tip.x", "tip.y")
    with pytest.raises(kc.InputError, match=r"has no column 'top.x'; did you mean 'x_tip'"):
        found.stiffness("top.x")
    with pytest.raises(kc.InputError, match="name what is pushed"):
        found.stiffness()


def test_that_a_balanced_rod_is_in_neutral_equilibrium_everywhere():
    module = kc.compile(rod(G * 2 / 2.4, 0.0))
    for angle in (-1.0, 0.2, 2.5):
        found = kc.equilibrium(module, guess={"rod.phi": angle})
        assert found.stability == ("neutral",)
        assert found["rod.phi"][0] == pytest.approx(angle)
        assert found.stiffness("rod.phi")[0] == 0
        assert np.isinf(found.compliance("rod.phi")).all()


@pytest.mark.slow
def test_the_equilibria_of_a_toggle_and_where_it_snaps_through():
    found = kc.equilibria(kc.compile(toggle()))
    heights = [item["knee.y"][0] for item in found]
    # The springs push up above the middle; below it they carry the load only when pressed through.
    y = sympy.Symbol("y")
    force = 4000 * y * (1 - sympy.Rational(3, 5) / sympy.sqrt(y**2 + sympy.Rational(1, 4))) + 80
    below = float(sympy.nsolve(force, -0.4))
    np.testing.assert_allclose(
        sorted(heights), [below, 0.119770293497841, 0.236926952038327], rtol=1e-12
    )
    stability = {round(item["knee.y"][0], 3): item.stability[0] for item in found}
    assert stability == {0.237: "stable", 0.12: "unstable", round(below, 3): "stable"}
    assert found[0].q[0, 1] == pytest.approx(0.236926952038327)
    times = np.linspace(0, 2, 21)
    path = kc.equilibrium(kc.compile(toggle(80 * kc.t)), times)
    assert not path.success
    (fold,) = path.events
    assert fold.kind == "limit point"
    assert fold.bodies == ("knee",)
    assert 80 * fold.t == pytest.approx(92.9269587214115, rel=1e-11)
    assert fold.q[1] == pytest.approx(0.179752075549376, rel=1e-7)
    assert path.stability == ("stable",) * 12 + ("",) * 9
    assert np.isnan(path["knee.y"][12:]).all()
    assert "snaps through" in path.message
    whole = kc.equilibrium(kc.compile(toggle(80 * kc.t)), times, through="snap")
    assert whole.success
    assert whole["knee.y"][11] > 0.2
    assert whole["knee.y"][12] < -0.35


def test_that_a_near_equilibrium_of_any_kind_is_found_on_request():
    module = kc.compile(toggle())
    found = kc.equilibrium(module, guess={"knee.y": 0.13}, settling=False)
    assert found["knee.y"][0] == pytest.approx(0.119770293497841, rel=1e-12)
    assert found.stability == ("unstable",)
    assert found.stiffness("knee.y")[0] < 0
    assert kc.equilibrium(module, guess={"knee.y": 0.13})["knee.y"][0] > 0.2


@pytest.mark.slow
def test_that_a_chain_hangs_as_known_and_bears_its_load():
    found = kc.equilibrium(kc.compile(chain()))
    below = -np.pi / 2
    np.testing.assert_allclose(
        [found["upper.phi"][0] - below, found["lower.phi"][0] - below],
        [0.336227174418574, 0.885475368228674],
        rtol=1e-12,
    )
    np.testing.assert_allclose(found.forces.reactions["O"].force, [[-12, 49.05]], rtol=1e-12)
    np.testing.assert_allclose(found.forces.reactions["A"].force, [[-12, 19.62]], rtol=1e-12)
    # Pulled a little harder at its end it moves by the compliance.
    held = found.stiffness("end.x", "end.y")[0]
    np.testing.assert_allclose(held, held.T, rtol=1e-12)
    np.testing.assert_allclose(held @ found.compliance("end.x", "end.y")[0], np.eye(2), atol=1e-12)
    ends = []
    for step in (-1e-4, 1e-4):
        m = chain()
        m.loads[-1] = kc.Force("pull", m.bodies[1], (0.6, 0), (12 + step, 0))
        other = kc.equilibrium(kc.compile(m))
        ends.append([other["end.x"][0], other["end.y"][0]])
    slope = (np.array(ends[1]) - ends[0]) / 2e-4
    np.testing.assert_allclose(found.compliance("end.x", "end.y")[0][:, 0], slope, rtol=1e-7)
    # Upright, or with one rod upright: three more, none of them stable.
    kinds = [item.stability[0] for item in kc.equilibria(kc.compile(chain()))]
    assert sorted(kinds) == ["stable", "unstable", "unstable", "unstable"]


def four_bar():
    """Return S3: the four-bar of Drake's README, ground 2 and three uniform bars of 4."""
    m = kc.Mechanism("drake")
    m.gravity = (0, -G)
    bars = [
        m.body(name, guess, mass=20, inertia=20 * 16 / 12, centre=(2, 0))
        for name, guess in (("a", (0, 0, -2.2)), ("b", (-1, -4, 0.2)), ("c", (2, 0, -1.0)))
    ]
    a, b, c = bars
    m.add(kc.Revolute("O", m.ground, (0, 0), a, (0, 0)))
    m.add(kc.Revolute("A", a, (4, 0), b, (0, 0)))
    m.add(kc.Revolute("B", b, (4, 0), c, (4, 0)))
    m.add(kc.Revolute("C", m.ground, (2, 0), c, (0, 0)))
    return m


def test_that_the_four_bar_of_drake_hangs_symmetrically():
    found = kc.equilibrium(kc.compile(four_bar()))
    angle = np.rad2deg(found["a.phi"][0])
    assert angle == pytest.approx(-104.47751218593, abs=1e-10)
    assert found["b.phi"][0] == pytest.approx(0, abs=1e-12)
    assert found.stability == ("stable",)
    # The two pins on the ground carry the weight, alike by symmetry.
    pins = found.forces.reactions
    np.testing.assert_allclose(pins["O"].force[0, 1], 30 * G, rtol=1e-11)
    np.testing.assert_allclose(pins["C"].force[0, 1], 30 * G, rtol=1e-11)


def test_that_a_column_buckles_and_leans():
    times = np.linspace(0, 2, 21)
    straight = kc.equilibrium(kc.compile(column()), times)
    (event,) = straight.events
    assert event.kind == "bifurcation"
    assert 8 * event.t == pytest.approx(10, rel=1e-8)
    assert straight.success
    assert straight.stability == tuple("stable" if 8 * t < 10 else "unstable" for t in times)
    np.testing.assert_allclose(straight.eigenvalues[:, 0], 10 - 8 * times, atol=1e-9)
    leaning = kc.equilibrium(kc.compile(column()), times, through="snap")
    assert leaning.stability == ("stable",) * 21
    angle = leaning["bar.phi"] - np.pi / 2
    bent = times > 1.25
    np.testing.assert_allclose(angle[~bent], 0, atol=1e-13)
    np.testing.assert_allclose(10 * angle[bent], 8 * times[bent] * np.sin(angle[bent]), rtol=1e-10)
    assert (np.abs(angle[bent]) > 0.3).all()


def test_that_a_driven_mechanism_is_held_and_its_driver_bears_the_load():
    """With no degree of freedom left the equilibrium is the position, and nothing yields."""
    m = rod()
    m.add(kc.AbsoluteAngle("hold", m.bodies[0], 0.3 + kc.t))
    module = kc.compile(m)
    found = kc.equilibrium(module, [0.0, 0.5])
    np.testing.assert_allclose(found["rod.phi"], [0.3, 0.8], rtol=1e-12)
    assert found.stability == ("stable", "stable")
    assert np.isinf(found.stiffness("tip.x")).all()
    angle = found["rod.phi"]
    length = np.hypot(np.cos(angle), np.sin(angle) - 1.2)
    slope = G * np.cos(angle) - 60 * (length - 0.4) * 1.2 * np.cos(angle) / length
    np.testing.assert_allclose(found.forces.drivers["hold"].value, slope, rtol=1e-12)


def test_that_redundant_joints_balance_and_share():
    m = kc.Mechanism("slide")
    m.gravity = (0, -G)
    slide = m.body("slide", (0.1, 0, 0), mass=2, inertia=0.1, centre=(0.1, 0))
    for name, x in (("left", 0), ("right", 1)):
        m.add(kc.Translational(name, m.ground, (0, 0), (1, 0), slide, (x, 0), (1, 0)))
    m.add(kc.Spring("s", m.ground, (-1, 0), slide, (0, 0), 50, 0.5))
    m.add(kc.Force("push", slide, (0, 0), (10 * kc.t, 0)))
    found = kc.equilibrium(kc.compile(m), [0.0, 1.0, 2.0])
    np.testing.assert_allclose(found["slide.x"], [-0.5, -0.3, -0.1], rtol=1e-11)
    np.testing.assert_allclose(found.stiffness("slide.x"), 50, rtol=1e-11)
    assert "F_y_left" in found.forces.undetermined
    np.testing.assert_allclose(found.forces.ground.force[:, 1], -2 * G, rtol=1e-11)


def test_what_has_no_equilibrium():
    idle = rod()
    idle.body("loose", (0, 0, 0))
    with pytest.raises(kc.StructuralError, match="nothing acts on loose, free to move"):
        kc.equilibrium(kc.compile(idle))
    fall = rod()
    fall.body("stone", (3, 0, 0), mass=1, inertia=1)
    found = kc.equilibrium(kc.compile(fall))
    assert not found.success
    assert "the loads on stone are not balanced there" in found.message
    with pytest.raises(kc.SolveError, match="has no equilibrium at t = 0"):
        kc.equilibrium(kc.compile(fall), throw=True)
    bare = kc.Mechanism("bare")
    bar = bare.body("bar")
    bare.add(kc.Revolute("O", bare.ground, (0, 0), bar, (0, 0)))
    with pytest.raises(kc.InputError, match="has no masses and no forces"):
        kc.equilibrium(kc.compile(bare))
    with pytest.raises(kc.InputError, match="through is 'smooth': give 'snap'"):
        kc.equilibrium(kc.compile(rod()), through="smooth")
    with pytest.raises(kc.InputError, match="equilibria are those of one time, got 2"):
        kc.equilibria(kc.compile(rod()), [0.0, 1.0])
    apart = rod()
    apart.add(kc.AbsoluteX("hold", apart.bodies[0], (1, 0), 3.0))
    found = kc.equilibrium(kc.compile(apart))
    assert "joints cannot be assembled" in found.message


def test_that_an_equilibrium_is_shown_written_and_knows_its_parameters(tmp_path):
    module = kc.compile(rod())
    found = kc.equilibrium(module, p={"k": 120.0, "l0": 0.4})
    expected = 0.4 / (1 - 2 * G / (2 * 120 * 1.2))
    length = np.hypot(found["tip.x"], found["tip.y"] - 1.2)[0]
    assert length == pytest.approx(expected, rel=1e-12)
    assert str(found).splitlines()[0] == "rod_on_spring: equilibrium at 1 time: stable"
    path = kc.write(found.motion, tmp_path / "rest.csv")
    assert path.read_text().splitlines()[0].startswith("t")
    module = kc.load(kc.emit(rod()).write(tmp_path)[0])
    assert kc.equilibrium(module)["rod.phi"][0] == pytest.approx(1.18715766125861, abs=1e-13)


def test_that_a_simulated_motion_swings_about_it_and_comes_to_rest_there():
    """The period of small swings is 2 pi sqrt(J/K); with a damper the motion ends at rest."""
    module = kc.compile(rod())
    found = kc.equilibrium(module)
    rest, held = found["rod.phi"][0], found.stiffness("rod.phi")[0]
    inertia = 2 / 12 + 2 * 0.5**2
    period = 2 * np.pi * np.sqrt(inertia / held)
    times = [0.0, period / 2, period]
    swing = kc.simulate(module, times, position={"rod.phi": rest + 1e-4})["rod.phi"] - rest
    np.testing.assert_allclose(swing, [1e-4, -1e-4, 1e-4], rtol=2e-4)
    m = rod()
    m.add(kc.TorsionSpring("damper", m.ground, m.bodies[0], damping=6))
    damped = kc.simulate(kc.compile(m), [0.0, 10.0])
    assert damped["rod.phi"][-1] == pytest.approx(rest, abs=1e-7)


def ziegler(damper=0.0, masses=True):
    """Return Ziegler's column: two rods with point masses 2 and 1, hinges of unit stiffness.

    The load follows the upper rod. It grows in time.
    """
    m = kc.Mechanism("ziegler")
    given = [{"mass": k, "inertia": 1e-9, "centre": (1, 0)} if masses else {} for k in (2, 1)]
    lower, upper = (m.body(name, (k, 0, 0), **given[k]) for k, name in enumerate(("low", "up")))
    m.add(kc.Revolute("O", m.ground, (0, 0), lower, (0, 0)))
    m.add(kc.Revolute("A", lower, (1, 0), upper, (0, 0)))
    m.add(kc.TorsionSpring("foot", m.ground, lower, 1, 0.0, damper))
    m.add(kc.TorsionSpring("knee", lower, upper, 1, 0.0, damper))
    m.add(kc.FollowerForce("push", upper, (1, 0), (-kc.t, 0)))
    return m


@pytest.mark.parametrize(
    ("damper", "critical"),
    [(0.0, 3.5 - np.sqrt(2)), (0.01, 41 / 28 + 0.01**2 / 2), (0.1, 41 / 28 + 0.1**2 / 2)],
)
def test_that_a_follower_load_makes_a_column_flutter(damper, critical):
    """Ziegler (1952): no stiffness is negative; a little damping makes the critical load less."""
    t = critical * np.array([0.5, 0.998, 1.002, 1.3])
    found = kc.equilibrium(kc.compile(ziegler(damper)), t)
    assert found.success
    assert (found.eigenvalues > 0).all()
    assert found.stability == ("stable", "stable", "flutter", "flutter")


def test_that_without_masses_a_follower_load_leaves_stability_open():
    found = kc.equilibrium(kc.compile(ziegler(masses=False)), [0.0, 1.0])
    assert found.stability == ("stable", "undecided")


def test_that_a_torque_along_with_the_rate_lets_swings_grow():
    m = rod()
    m.add(kc.Torque("wind", m.bodies[0], 0.1 * m.bodies[0].phi_dot))
    assert kc.equilibrium(kc.compile(m)).stability == ("flutter",)
    assert kc.equilibrium(kc.compile(rod())).stability == ("stable",)

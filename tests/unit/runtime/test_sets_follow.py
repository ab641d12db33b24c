"""Sets of parameters stay on the branch of the first one, or say that they left it."""

import numpy as np
import pytest

import kincompile as kc

FORMS = [
    pytest.param({}, id="numpy"),
    pytest.param({"target": "c"}, id="c", marks=pytest.mark.slow),
    pytest.param({"form": "grouped"}, id="grouped", marks=pytest.mark.slow),
]


def four_bar(a=10.0, b=26.0, c=18.0, d=20.0, rocker=1.5):
    """Return a four-bar whose crank angle is a parameter."""
    m = kc.Mechanism("four_bar")
    a, b, c, d = (m.parameter(*x, unit="m") for x in zip("abcd", (a, b, c, d), strict=True))
    theta = m.parameter("theta", 0.5, unit="rad")
    crank = m.body("crank", guess=(5, 2, 0.5))
    coupler = m.body("coupler", guess=(20, 10, kc.pi / 4))
    rocker = m.body("rocker", guess=(20, 9, rocker * kc.pi))
    m.add(kc.Revolute("A", crank, (-a / 2, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("B", crank, (a / 2, 0), coupler, (-b / 2, 0)))
    m.add(kc.Revolute("C", coupler, (b / 2, 0), rocker, (-c / 2, 0)))
    m.add(kc.Revolute("D", rocker, (c / 2, 0), m.ground, (d, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, theta + kc.t))
    return m


def rocker_angle(theta, side, a=10.0, b=26.0, c=18.0, d=20.0):
    """Return the angle of the rocker, from C to D, in closed form; NaN where there is none."""
    way = d - a * np.exp(1j * theta)  # from B to D
    cosine = (abs(way) ** 2 + c**2 - b**2) / (2 * abs(way) * c)
    with np.errstate(invalid="ignore"):
        return np.angle(way) + side * np.arccos(cosine)


def apart(angle, other):
    return np.abs(np.remainder(angle - other + np.pi, 2 * np.pi) - np.pi)


@pytest.mark.parametrize("options", FORMS)
def test_that_a_full_turn_of_sets_stays_on_one_branch(options, quick_compiler):
    module = kc.compile(four_bar(), **options)
    count = 40 if "form" in options else 400
    theta = np.linspace(0.5, 0.5 + 2 * np.pi, count)
    shuffled = np.r_[0, 1 + np.random.default_rng(0).permutation(count - 1)]
    solution = kc.solve(module, [0.0, 0.1], {"theta": theta[shuffled]})
    assert solution.success
    for k in range(2):
        found, angle = solution["phi_rocker"][:, k], theta[shuffled] + 0.1 * k
        assert apart(found, rocker_angle(angle, -1)).max() < 1e-9
    # The motion through these angles is the same, with the same turns.
    motion = kc.solve(kc.compile(four_bar()), theta - 0.5)
    np.testing.assert_allclose(solution.q[:, 0], motion.q[shuffled], rtol=0, atol=1e-9)


@pytest.mark.parametrize("options", FORMS)
def test_that_no_set_beyond_a_lock_up_is_on_the_other_branch(options, quick_compiler):
    lengths = {"a": 22.0, "b": 14.0, "c": 14.0, "d": 20.0}
    module = kc.compile(four_bar(**lengths), **options)
    theta = np.linspace(0.3, 0.3 + 2 * np.pi, 20 if "form" in options else 60)
    solution = kc.solve(module, 0.0, {"theta": theta})
    side = np.sign(np.sin(solution["phi_rocker"][0, 0] - np.angle(20 - 22 * np.exp(0.3j))))
    expected = rocker_angle(theta, side, **lengths)
    good, lock_up = solution.status[:, 0] == 0, np.argmin(np.isfinite(expected))
    assert 3 <= lock_up < 20
    assert good[:lock_up].all()
    assert good[-1]  # the guess, a whole turn on, leads to the first one again
    assert apart(solution["phi_rocker"][good, 0], expected[good]).max() < 1e-9


@pytest.mark.parametrize("options", FORMS)
def test_that_sets_beyond_a_bifurcation_say_so(options, quick_compiler):
    """A parallelogram may cross there: nothing says whether it does."""
    module = kc.compile(four_bar(a=10.0, b=20.0, c=10.0, d=20.0, rocker=-0.84), **options)
    theta = np.linspace(0.5, 6.0, 23)
    solution = kc.solve(module, 0.0, {"theta": theta}, {"phi_coupler": 0.0})
    np.testing.assert_array_equal(solution.status[:, 0] == 0, theta < np.pi)
    assert not solution.success
    assert (
        "variant 11 at t = 0 (NOT_CONVERGED). No position was found on the branch of the first"
        in (solution.message)
    )
    assert "no lock-up ends it" not in solution.message


def test_that_chunks_of_a_sweep_are_on_the_branch_of_the_whole(tmp_path):
    theta = np.linspace(0.5, 0.5 + 2 * np.pi, 24)
    whole = kc.sweep(four_bar(), {"theta": theta}, t=[0.0], columns=["phi_rocker"])
    parts = kc.sweep(four_bar(), {"theta": theta}, t=[0.0], columns=["phi_rocker"], chunk=7)
    for found in (whole, parts):
        assert apart(found["phi_rocker"][:, 0], rocker_angle(theta, -1)).max() < 1e-9
    np.testing.assert_allclose(parts["phi_rocker"], whole["phi_rocker"], rtol=0, atol=1e-12)


@pytest.mark.parametrize("options", FORMS)
def test_that_sets_are_on_one_branch_if_the_first_cannot_be_assembled(options, quick_compiler):
    """Then they are on the branch of the model's own parameters, on either side of the gap."""
    lengths = {"a": 22.0, "b": 14.0, "c": 14.0, "d": 20.0}
    module = kc.compile(four_bar(**lengths), **options)
    theta = np.linspace(np.pi, -np.pi, 20 if "form" in options else 200)
    own = kc.solve(module, 0.0)
    side = np.sign(np.sin(own["phi_rocker"][0] - np.angle(20 - 22 * np.exp(0.5j))))
    solution = kc.solve(module, 0.0, {"theta": theta})
    good = solution.status[:, 0] == 0
    assert not good[0]
    assert good.any()
    expected = rocker_angle(theta, side, **lengths)
    assert apart(solution["phi_rocker"][good, 0], expected[good]).max() < 1e-9


def test_that_a_sweep_converges_where_one_call_does():
    a, b, c, d, first = 0.25, 0.99, 1.07, 0.32, -2.9662436959
    m = kc.Mechanism("rocker")
    theta = m.parameter("theta", first, unit="rad")
    pin, angle = a * np.exp(1j * first), rocker_angle(first, -1, a, b, c, d) + np.pi
    joint = d + c * np.exp(1j * angle)
    crank = m.body("crank", guess=(0, 0, first))
    coupler = m.body("coupler", guess=(pin.real, pin.imag, np.angle(joint - pin)))
    rocker = m.body("rocker", guess=(d, 0, angle))
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("B", crank, (a, 0), coupler, (0, 0)))
    m.add(kc.Revolute("C", coupler, (b, 0), rocker, (c, 0)))
    m.add(kc.Revolute("D", rocker, (0, 0), m.ground, (d, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, theta + 0.3 * kc.t))
    sets = {"theta": np.linspace(-3, 3, 61)}
    solution = kc.solve(kc.compile(m), [0.0, 0.1], sets)
    found = kc.sweep(m, sets, [0.0, 0.1], columns=["phi_rocker"], target="numpy", chunk=7)
    np.testing.assert_allclose(found["phi_rocker"], solution["phi_rocker"], rtol=0, atol=1e-12)
    good = solution.status[:, 0] == kc.Status.CONVERGED
    wanted = rocker_angle(sets["theta"], -1, a, b, c, d) + np.pi
    assert good.sum() > 40
    assert apart(solution["phi_rocker"][good, 0], wanted[good]).max() < 1e-9

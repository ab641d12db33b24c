"""A thousand random linkages from random guesses, against equations that are not kincompile's.

Positions are checked by complex numbers (a body's point s is at z + s exp(i phi), z = x + i y), the
number of ways to assemble by intersecting circles.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import kincompile as kc


@dataclass(frozen=True)
class Linkage:
    """A linkage whose dimensions are parameters.

    Attributes
    ----------
    module : module
        The compiled mechanism.
    sample : callable
        Gives random dimensions, by parameter.
    gaps : callable
        Gives what does not close at positions (N, n), times (N,) and dimensions; complex.
    assemblies : callable
        Gives the number of ways to assemble it at t = 0, by intersecting circles.
    """

    module: ModuleType
    sample: Callable[..., Any]
    gaps: Callable[..., Any]
    assemblies: Callable[..., Any]


def _bodies(q):
    """Return the places of the bodies, complex, and their directions exp(i phi)."""
    x, y, phi = np.moveaxis(q.reshape(*q.shape[:-1], -1, 3), -1, 0)
    return np.moveaxis(x + 1j * y, -1, 0), np.moveaxis(np.exp(1j * phi), -1, 0), phi[..., 0]


def _crossings(centre, radius, other, its_radius):
    """Return where two circles cross."""
    way = other - centre
    distance = abs(way)
    along = (distance**2 + radius**2 - its_radius**2) / (2 * distance)
    if abs(along) >= radius:
        return []
    across = np.sqrt(radius**2 - along**2)
    return [centre + way / distance * (along + side * across * 1j) for side in (1, -1)]


def _rocker_pins(p):
    """Return where the pin between coupler and rocker may be at t = 0."""
    return _crossings(p["a"] * np.exp(1j * p["start"]), p["b"], p["d"] + 0j, p["c"])


def _driven(phi, t, p):
    return phi - p["start"] - p["speed"] * t


def _with_four_bar(m):
    """Add crank, coupler and rocker, a motor, and their parameters."""
    a, b, c, d = (m.parameter(name, 1.0) for name in "abcd")
    start, speed = m.parameter("start", 1.0), m.parameter("speed", 1.0)
    crank, coupler, rocker = (m.body(name) for name in ("crank", "coupler", "rocker"))
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (-a / 2, 0)))
    m.add(kc.Revolute("B", crank, (a / 2, 0), coupler, (-b / 2, 0)))
    m.add(kc.Revolute("C", coupler, (b / 2, 0), rocker, (c / 2, 0)))
    m.add(kc.Revolute("D", m.ground, (d, 0), rocker, (-c / 2, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, start + speed * kc.t))
    return rocker


def _gaps_of_four_bar(z, u, p):
    return [
        z[0] - p["a"] / 2 * u[0],
        z[0] + p["a"] / 2 * u[0] - z[1] + p["b"] / 2 * u[1],
        z[1] + p["b"] / 2 * u[1] - z[2] - p["c"] / 2 * u[2],
        z[2] - p["c"] / 2 * u[2] - p["d"],
    ]


def _lengths(random, names):
    return {name: random.uniform(0.2, 2.0) for name in names}


def _drive(random):
    return {
        "start": random.uniform(-3, 3),
        "speed": random.choice((-1, 1)) * random.uniform(0.5, 2),
    }


def random_four_bar():
    m = kc.Mechanism("four_bar")
    _with_four_bar(m)

    def gaps(q, t, p):
        z, u, phi = _bodies(q)
        return np.array([*_gaps_of_four_bar(z, u, p), _driven(phi, t, p)])

    def sample(random):
        return _lengths(random, "abcd") | _drive(random)

    return Linkage(kc.compile(m), sample, gaps, lambda p: len(_rocker_pins(p)))


def random_slider_crank():
    m = kc.Mechanism("slider_crank")
    r, rod_length, offset = (m.parameter(name, 1.0) for name in ("r", "l", "e"))
    start, speed = m.parameter("start", 1.0), m.parameter("speed", 1.0)
    crank, rod, slider = (m.body(name) for name in ("crank", "rod", "slider"))
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("B", crank, (r, 0), rod, (0, 0)))
    m.add(kc.Revolute("C", rod, (rod_length, 0), slider, (0, 0)))
    m.add(kc.Translational("guide", m.ground, (0, offset), (1, 0), slider, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, start + speed * kc.t))

    def gaps(q, t, p):
        z, u, phi = _bodies(q)
        level, turn = z[2].imag - p["e"], u[2].imag
        rod_end = z[1] + p["l"] * u[1] - z[2]
        return np.array([
            z[0], z[0] + p["r"] * u[0] - z[1], rod_end, level, turn, _driven(phi, t, p),
        ])  # fmt: skip

    def sample(random):
        return _lengths(random, "rl") | {"e": random.uniform(-0.5, 0.5)} | _drive(random)

    def assemblies(p):
        # The translational joint also holds with the slider turned by half a turn.
        return 4 if abs(p["e"] - p["r"] * np.sin(p["start"])) < p["l"] else 0

    return Linkage(kc.compile(m), sample, gaps, assemblies)


def random_six_bar():
    """Return a four-bar whose rocker drives another rocker by a rod (Watt)."""
    m = kc.Mechanism("six_bar")
    rocker = _with_four_bar(m)
    f, g, h = (m.parameter(name, 1.0) for name in "fgh")
    arm, height = m.parameter("arm", 0.5), m.parameter("height", 0.5)
    rod, output = m.body("rod"), m.body("output")
    m.add(kc.Revolute("E", rocker, (0, arm), rod, (-f / 2, 0)))
    m.add(kc.Revolute("F", rod, (f / 2, 0), output, (g / 2, 0)))
    m.add(kc.Revolute("G", m.ground, (h, height), output, (-g / 2, 0)))

    def gaps(q, t, p):
        z, u, phi = _bodies(q)
        return np.array(
            [
                *_gaps_of_four_bar(z, u, p),
                z[2] + 1j * p["arm"] * u[2] - z[3] + p["f"] / 2 * u[3],
                z[3] + p["f"] / 2 * u[3] - z[4] - p["g"] / 2 * u[4],
                z[4] - p["g"] / 2 * u[4] - p["h"] - 1j * p["height"],
                _driven(phi, t, p),
            ]
        )

    def sample(random):
        more = {"arm": random.uniform(-0.5, 0.5), "height": random.uniform(-1, 1)}
        return _lengths(random, "abcdfgh") | more | _drive(random)

    def assemblies(p):
        ends = [
            (pin + p["d"]) / 2 + 1j * p["arm"] * (pin - p["d"]) / p["c"] for pin in _rocker_pins(p)
        ]
        pivot = p["h"] + 1j * p["height"]
        return sum(len(_crossings(end, p["f"], pivot, p["g"])) for end in ends)

    return Linkage(kc.compile(m), sample, gaps, assemblies)


MAKERS = {"four_bar": random_four_bar, "slider_crank": random_slider_crank,
          "six_bar": random_six_bar}  # fmt: skip


@pytest.fixture(scope="module", params=MAKERS)
def linkage(request):
    return MAKERS[request.param]()


def check_one(linkage, random):
    """Solve one random linkage from a random guess; return whether it was assembled."""
    p = linkage.sample(random)
    solution = kc.solve(linkage.module, 0.0, p=p, guess=random.uniform(-3, 3, _size(linkage)))
    if not solution.success:
        assert solution.status[0] in (kc.Status.NOT_ASSEMBLED, kc.Status.SINGULAR)
        assert np.isnan(solution.q_dot).all()
        assert f"failed at t = 0, point 1 of 1 ({kc.Status(solution.status[0]).name})" in (
            solution.message
        )
        assert "largest residuals" in solution.message or solution.events
        return False
    q, q_dot = solution.q, solution.q_dot
    assert np.max(np.abs(linkage.gaps(q, solution.t, p))) < 1e-9
    step = 1e-6  # by central differences along the line, nothing opens at these velocities
    after, before = (linkage.gaps(q + h * q_dot, solution.t + h, p) for h in (step, -step))
    assert np.max(np.abs(after - before)) / (2 * step) < 1e-6 * (1 + np.max(q_dot**2))
    return True


def _size(linkage):
    return linkage.module.N_COORDINATES


def check_many(linkage, count, seed):
    """Check so many linkages; most that can be assembled are, from guesses as wild as these."""
    random = np.random.default_rng(seed)
    assembled = sum(check_one(linkage, random) for _ in range(count))
    # The same dimensions again, for the number of those that circles say can be assembled.
    random, possible = np.random.default_rng(seed), 0
    for _ in range(count):
        possible += linkage.assemblies(linkage.sample(random)) > 0
        random.uniform(size=_size(linkage))
    assert 0.8 * possible < assembled <= possible


@pytest.mark.slow
def test_random_linkages_from_random_guesses(linkage):
    check_many(linkage, 60, seed=1)


@pytest.mark.slow
def test_a_thousand_random_linkages(linkage):
    check_many(linkage, 334, seed=2)


def motions(linkage, count, seed):
    """Yield dimensions, a time grid and an assembled start of random motions."""
    random = np.random.default_rng(seed)
    while count:
        p = linkage.sample(random)
        guess = random.uniform(-3, 3, _size(linkage))
        t = np.linspace(0, random.uniform(0.5, 8), int(random.integers(40, 300)))
        first = kc.solve(linkage.module, 0.0, p=p, guess=guess)
        if first.success:
            count -= 1
            yield p, t, first.q[0]


def check_motion(linkage, p, t, guess):
    """Solve a motion by march and by grid: the same verdict, event and positions."""
    march, grid = (
        kc.solve(linkage.module, t, p=p, guess=guess, method=method) for method in ("march", "grid")
    )
    np.testing.assert_array_equal(grid.status, march.status)
    assert march.success != bool(march.events)
    for ours, theirs in zip(grid.events, march.events, strict=True):
        assert (ours.kind, ours.bodies) == (theirs.kind, theirs.bodies)
        assert abs(ours.t - theirs.t) < 1e-6
        assert t[march.status == kc.Status.CONVERGED][-1] <= ours.t + 1e-9
    good = march.status == kc.Status.CONVERGED
    np.testing.assert_allclose(grid.q[good], march.q[good], atol=1e-7)
    assert np.max(np.abs(linkage.gaps(grid.q[good], t[good], p))) < 1e-9
    assert np.all(march.branch[good] == march.branch[0])


@pytest.mark.parametrize("count", [8, 30])
@pytest.mark.slow
def test_that_random_motions_end_alike_by_both_methods(linkage, count):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", kc.SingularConfigurationWarning)
        for p, t, guess in motions(linkage, count, seed=count):
            check_motion(linkage, p, t, guess)


def same_modulo_turns(q, other):
    difference = q - other
    difference[..., 2::3] = np.remainder(difference[..., 2::3] + np.pi, 2 * np.pi) - np.pi
    return np.max(np.abs(difference), axis=-1) < 1e-6


@pytest.mark.parametrize("count", [6, 12])
@pytest.mark.slow
def test_the_number_of_assemblies_by_intersecting_circles(linkage, count):
    random = np.random.default_rng(count)
    for _ in range(count):
        p = linkage.sample(random)
        found = kc.assemblies(linkage.module, 0.0, p)
        assert found.shape == (linkage.assemblies(p), _size(linkage))
        np.testing.assert_array_equal(found, kc.assemblies(linkage.module, 0.0, p))
        for k, q in enumerate(found):
            assert np.max(np.abs(linkage.gaps(q[np.newaxis], np.zeros(1), p))) < 1e-9
            assert not same_modulo_turns(q, found[:k]).any()
            solution = kc.solve(linkage.module, 0.0, p=p, guess=q)
            np.testing.assert_allclose(solution.q[0], q, atol=1e-9)

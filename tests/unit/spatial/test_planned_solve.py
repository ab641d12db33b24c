"""The planned solve with small rotations: the same x as LAPACK's, from blocks of three at most."""

import mpmath
import numpy as np
import pytest
import sympy

import kincompile as kc
from benchmarks.space import LINKAGES
from kincompile import spatial
from kincompile.compiler import emit

RANDOM = np.random.default_rng(11)


def six_struts() -> spatial.Mechanism:
    """Return a platform on six struts of given lengths."""
    m = spatial.Mechanism("six_struts")
    length = m.parameter("length", 1.2, "m")
    plate = m.body("plate", (0.1, 0.05, 1.0), axis=(1, 2, 3), angle=0.2)
    for k in range(6):
        base, top = np.deg2rad(60 * k + (8 if k % 2 else -8)), np.deg2rad(60 * k)
        m.add(
            spatial.Distance(
                f"strut_{k}",
                m.ground,
                (np.cos(base), np.sin(base), 0.02 * k),
                plate,
                (0.5 * np.cos(top + 0.3), 0.5 * np.sin(top + 0.3), 0.01 * k**2),
                length + 0.05 * sympy.sin(kc.t + k),
            )
        )
    return m


def hinge(slope: float | None = None) -> spatial.Mechanism:
    """Return a hinged bar whose length is a parameter, and its axis too where none is given."""
    m = spatial.Mechanism("hinge")
    a = m.parameter("a", 0.4, "m")
    axis = (0, m.parameter("slope", 0.3) if slope is None else slope, 1)
    bar = m.body("bar", (0.4, 0, 0))
    m.add(spatial.Revolute("A", m.ground, (0, 0, 0), axis, bar, (-a, 0, 0), axis))
    m.add(spatial.RelativeRotation("motor", m.ground, axis, (1, 0, 0), bar, axis, (1, 0, 0), kc.t))
    return m


MECHANISMS = [*(linkage.mechanism for linkage in LINKAGES), six_struts, hinge]
NAMES = [*(linkage.name for linkage in LINKAGES), "six_struts", "hinge"]


@pytest.mark.parametrize("target", ["numpy", pytest.param("c", marks=pytest.mark.slow)])
@pytest.mark.parametrize("make", MECHANISMS, ids=NAMES)
def test_that_x_is_that_of_lapack(make, target: str) -> None:
    module = kc.compile(make(), target=target)
    n = len(module.COORDINATES)
    q = RANDOM.uniform(-1, 1, (50, n))  # not normalised, not assembled
    Phi_q, b = module.Phi_q(q, 0.3), RANDOM.uniform(-1, 1, (50, n))
    found = module.solve(module.Phi_q_nonzeros(q, 0.3), b)
    wanted = np.linalg.solve(Phi_q, b[..., np.newaxis])[..., 0]
    size = np.linalg.cond(Phi_q)[:, np.newaxis] * np.abs(wanted).max(axis=1, keepdims=True)
    assert np.max(np.abs(found - wanted) / size) < 1e-13


def before_dead_centre(module, seed: int, away: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Return q before Phi_q becomes singular along a random line, if it does, and b."""
    random = np.random.default_rng(seed)
    n = len(module.COORDINATES)
    start, line = module.GUESS + random.uniform(-0.3, 0.3, n), random.uniform(-1, 1, n)

    def sign(s: float) -> float:
        return float(np.linalg.slogdet(module.Phi_q(start + s * line, 0.3))[0])

    grid = np.linspace(0, 2, 41).tolist()
    before = sign(0.0)
    after = next((k for k, s in enumerate(grid) if sign(s) != before), None)
    if after is None:
        return None
    low, high = grid[after - 1], grid[after]
    for _ in range(45):
        middle = (low + high) / 2
        low, high = (middle, high) if sign(middle) == before else (low, middle)
    return start + (low - away) * line, random.uniform(-1, 1, n)


@pytest.mark.parametrize("away", [1e-2, 1e-5, 1e-8])
@pytest.mark.parametrize("make", MECHANISMS[:2], ids=NAMES[:2])
def test_that_before_a_dead_centre_the_plan_is_backward_stable(make, away: float) -> None:
    """A plan without pivots loses nothing there: its x is that of a matrix one rounding away.

    Measured is what Phi_q x misses of b, by their sizes. Near a dead centre x itself differs by
    chance, with LAPACK too: a hundred times from one rounding to another.
    """
    module, missed = kc.compile(make()), []
    places = (before_dead_centre(module, seed, away) for seed in range(8))
    for q, b in filter(None, places):
        Phi_q = module.Phi_q(q, 0.3)
        x = module.solve(module.Phi_q_nonzeros(q, 0.3), b)
        with mpmath.workdps(40):
            rest = mpmath.matrix(b.tolist()) - mpmath.matrix(Phi_q.tolist()) * mpmath.matrix(x)
        size = np.abs(Phi_q).sum(axis=1).max() * np.abs(x).max()
        missed.append(max(abs(float(y)) for y in rest) / size)
    assert len(missed) > 4
    assert max(missed) < 10 * np.finfo(float).eps


@pytest.mark.parametrize("linkage", LINKAGES, ids=lambda item: item.name)
def test_that_hinges_and_lines_between_points_make_small_blocks(linkage) -> None:
    source = emit(linkage.mechanism()).source
    assert "block_solve" not in source


def test_that_a_hinge_is_a_block_of_two_and_its_turn_one_of_its_own() -> None:
    source = emit(hinge(0.3)).source
    assert "# block: pi_f_bar, pi_g_bar by A.f, A.g\n" in source
    assert "# block: pi_h_bar by motor\n" in source


def test_that_an_axis_that_parameters_turn_is_no_fixed_direction() -> None:
    assert "# block: pi_f_bar, pi_g_bar, pi_h_bar by A.f, A.g, motor\n" in emit(hinge()).source


@pytest.mark.parametrize("make", MECHANISMS, ids=NAMES)
def test_that_verify_finds_it_right_with_its_determinants(make) -> None:
    verification = kc.verify(kc.compile(make()))
    assert verification.passed, str(verification)


def test_that_a_mechanism_in_the_plane_has_no_small_rotations() -> None:
    m = kc.Mechanism("pendulum")
    bar = m.body("bar", (0, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), bar, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, kc.t))
    assert "pi_" not in emit(m).source.split("def _factor")[1].split("def _solve")[0]


def test_that_sensitivities_and_gradients_of_a_pivoted_block_agree() -> None:
    m = six_struts()
    m.output("height", m.bodies[0].z, "m")
    module = kc.compile(m)
    solution = kc.solve(module, np.linspace(0, 1, 5))
    names = list(solution.parameters)
    forward = kc.sensitivities(solution, names)
    gradient = kc.sensitivities(solution, names, of=["height"])
    np.testing.assert_allclose(
        gradient["height", "length"], forward["height", "length"], rtol=1e-12
    )
    h = 1e-5
    ends = [kc.solve(module, solution.t, {"length": 1.2 + end})["height"] for end in (h, -h)]
    np.testing.assert_allclose(
        (ends[0] - ends[1]) / (2 * h), forward["height", "length"], rtol=1e-7
    )

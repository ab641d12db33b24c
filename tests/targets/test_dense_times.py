"""Compiled motions at dense times, whose points lie on curves between those of a coarse march."""

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.emitters.c.target import LANES
from kincompile.runtime.memory import SMALLEST, free
from kincompile.runtime.status import Status

pytestmark = pytest.mark.usefixtures("quick_compiler")
S = kc.t - sympy.Rational(50003, 100_000)
RATES = ("q", "q_dot", "q_ddot")


def compiled(equation, name, guess):
    """Return the modules of one equation for x, in C and NumPy."""
    model = kc.ConstraintSystem(name, ["x"], [equation], guess={"x": guess})
    return kc.compile(model, target="c"), kc.compile(model)


def require_same(one, other):
    """Require the statuses and events of two solutions to be the same."""
    np.testing.assert_array_equal(one.status, other.status)
    assert [type(x) for x in one.events] == [type(x) for x in other.events]
    np.testing.assert_allclose([x.t for x in one.events], [x.t for x in other.events], rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "end", "corrections"),
    [("four_bar", 1.5, 1), ("jansen", 1.5, 2), ("slot_follower", 1.5, 2), ("rssr", 1.5, 1)],
)
def test_that_dense_points_are_those_of_the_careful_march(example_named, name, end, corrections):
    example, t = example_named(name), np.linspace(0, end, 6001)
    found = kc.solve(example.native, t)
    assert found.statistics["compiled"] == t.size
    assert np.mean(found.iterations == corrections) > 0.8
    known = kc.solve(example.module, t[::60], method="march")
    for rate in RATES:
        expected = getattr(known, rate)
        allowed = 1e-12 * np.max(np.abs(expected))
        np.testing.assert_allclose(getattr(found, rate)[::60], expected, rtol=0, atol=allowed)


@pytest.mark.parametrize(("sign", "height"), [(1, "1e-2"), (-1, "1e-4"), (1, "1e-10")])
def test_that_what_happens_between_two_points_of_the_coarse_march_is_not_missed(sign, height):
    """A pulse over a few times, where x = sin t + pulse is known; backwards too."""
    t, width = sign * np.linspace(0, 1, 20_001), 6e-5
    assert LANES * abs(t[1]) > 20 * width
    s = sympy.Symbol("t")
    pulse = sympy.exp(-(((s - sign * 0.50037) / width) ** 2))
    law = sympy.sin(s) + sympy.Rational(height) * pulse
    x = sympy.Symbol("x")
    driven = law.subs(s, kc.t)
    equation = x + sympy.sin(x) / 3 - driven - sympy.sin(driven) / 3
    native, _ = compiled(equation, f"pulse_{height[-1]}{sign < 0:d}", 0.0)
    found = kc.solve(native, t)
    assert found.success
    for order, rate in enumerate(RATES):
        expected = sympy.lambdify(s, law.diff(s, order))(t)
        # So narrow a pulse magnifies what rounding leaves of the time.
        allowed = 1e-10 * np.max(np.abs(expected))
        np.testing.assert_allclose(getattr(found, rate)[:, 0], expected, rtol=0, atol=allowed)


def test_that_a_lock_up_is_where_it_was(example_named):
    example, t = example_named("four_bar"), np.linspace(0, 3, 9001)
    p = example.module.DEFAULTS * [1, 0.4, 1, 1, 1]
    found, known = (kc.solve(module, t, p) for module in (example.native, example.module))
    assert 1000 < np.sum(found.status == Status.CONVERGED) < t.size
    require_same(found, known)


@pytest.mark.parametrize("law", [S, 100 * S**2 - 1e-4], ids=["once", "twice"])
def test_that_no_curve_leads_over_a_singular_configuration(law):
    """Branches x = law and x = -law meet, or meet twice between two points of the coarse march."""
    native, module = compiled(sympy.Symbol("x") ** 2 - law**2, f"meet_{law != S:d}", 0.25)
    t = np.linspace(0.45, 0.55, 401)
    found, known = kc.solve(native, t), kc.solve(module, t)
    assert found.events[0].t == pytest.approx(0.5, abs=2e-3)
    require_same(found, known)


def test_that_the_memory_of_a_large_solution_is_kept_for_the_next(example_named):
    native, t = example_named("four_bar").native, np.linspace(0, 1, SMALLEST // (9 * 3 * 8) + 1)
    first = kc.solve(native, t)
    known, place = first.q[-1].copy(), first.q.ctypes.data
    assert place not in [x.ctypes.data for x in free]
    del first
    assert place in [x.ctypes.data for x in free]
    np.testing.assert_array_equal(kc.solve(native, t).q[-1], known)

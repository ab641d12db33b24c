"""Times far apart, and grids of all kinds: efforts end, nothing false is said, events stay."""

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import criteria

from . import linkages

FORMS: tuple[dict[str, str], ...] = ({}, {"form": "grouped"}, {"target": "c"})
LOCKS = 10 * np.arccos(0.9)


@pytest.fixture(scope="module")
def pendulum():
    m = kc.Mechanism("pendulum")
    bob = m.body("bob", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", bob, (-1, 0), m.ground, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", bob, kc.t))
    return kc.compile(m)


@pytest.mark.parametrize("form", FORMS, ids=str)
@pytest.mark.slow
def test_a_gap_is_no_lock_up(form, quick_compiler):
    x = sympy.Symbol("x")
    wave = kc.ConstraintSystem("wave", [x], [x - sympy.sin(kc.t)], guess=(0,))
    solution = kc.solve(kc.compile(wave, **form), [0, 1e6])
    assert solution.status.tolist() == [0, 1]
    assert solution.events == []
    assert "steps were not enough: ask for more times" in solution.message


@pytest.mark.slow
def test_a_time_beyond_all_angles_is_a_status(pendulum):
    solution = kc.solve(pendulum, [0, 1e200])
    assert not solution.success
    assert solution.events == []


@pytest.mark.parametrize("form", FORMS, ids=str)
@pytest.mark.slow
def test_a_gap_of_many_turns_is_followed_and_counted(form, quick_compiler):
    module = kc.compile(linkages.four_bar().mechanism, **form)
    solution = kc.solve(module, [0, 100.0])
    near = kc.solve(module, np.linspace(0, 100, 2001))
    np.testing.assert_allclose(solution.q[1], near.q[-1], rtol=0, atol=1e-7)
    turned = abs(near["crank.phi"][-1] - near["crank.phi"][0])
    assert 2 * turned < solution.iterations[1] < 10_000


def test_a_gap_of_too_many_turns_ends_with_what_to_do_and_shows_progress(monkeypatch):
    assert criteria.MAX_SUBSTEPS == 10_000
    monkeypatch.setattr(criteria, "MAX_SUBSTEPS", 600)
    seen = []
    module = kc.compile(linkages.four_bar().mechanism)
    solution = kc.solve(module, [0, 1e6], progress=lambda *count: seen.append(count))
    assert solution.status.tolist() == [0, 1]
    assert solution.events == []
    assert "steps were not enough: ask for more times" in solution.message
    assert len(seen) >= 4


@pytest.mark.every(3)
@pytest.mark.parametrize("method", ["grid", "march"])
@pytest.mark.parametrize(("points", "end"), [(121, 6), (13, 6), (1000, 4.6), (300, 4.52), (7, 30)])
def test_a_lock_up_is_an_event_on_every_grid(method, points, end):
    module = kc.compile(linkages.peaucellier().mechanism)
    solution = kc.solve(module, np.linspace(0, end, points), method=method)
    (event,) = solution.events
    assert event.kind == "lock-up"
    assert event.t == pytest.approx(LOCKS, abs=1e-7)


def test_that_no_smaller_steps_are_taken_than_the_motion_asks_for(pendulum):
    # 26,000 of them once; a step of a radian takes two or three.
    solution = kc.solve(pendulum, [0, 2777.0], method="march")
    assert solution.success
    assert solution.iterations[1] < 3 * 2777


@pytest.mark.parametrize("form", FORMS, ids=str)
@pytest.mark.parametrize("end", [40.0, 400.0])
def test_an_equation_that_becomes_small_is_not_singular(form, end, quick_compiler):
    x = sympy.Symbol("x")
    decay = kc.ConstraintSystem("decay", [x], [sympy.exp(-x) - sympy.exp(-kc.t)], guess=(0,))
    t = np.linspace(0, end, 41)
    solution = kc.solve(kc.compile(decay, **form), t)
    assert solution.success, solution.message
    np.testing.assert_allclose(solution.q[:, 0], t, rtol=0, atol=1e-7 * end)
    np.testing.assert_allclose(solution.q_dot, 1, rtol=0, atol=1e-7)


@pytest.mark.parametrize("form", FORMS, ids=str)
@pytest.mark.parametrize("length", [1e-12, 1e-9, 1e9])
def test_that_tiny_and_huge_free_lengths_are_solved_alike(form, length, quick_compiler):
    x = sympy.Symbol("x")
    root = kc.ConstraintSystem("root", [x], [x**2 - length**2 * (1 + kc.t)], guess=(length,))
    t = np.linspace(0, 3, 40)
    solution = kc.solve(kc.compile(root, **form), t)
    assert solution.success, solution.message
    assert solution.events == []
    np.testing.assert_allclose(solution.q[:, 0], length * np.sqrt(1 + t), rtol=1e-12)


@pytest.mark.parametrize("end", [LOCKS + 1e-6, LOCKS + 0.1, 6.0])
@pytest.mark.parametrize("points", [2, 13, 60])
@pytest.mark.slow
def test_that_what_lies_beyond_a_lock_up_has_one_status(end, points, quick_compiler):
    t = np.linspace(0, end, points)
    modules = [kc.compile(linkages.peaucellier().mechanism, **form) for form in FORMS]
    found = [kc.solve(module, t).status for module in modules]
    p = np.broadcast_to(modules[0].DEFAULTS, (2, 1, modules[0].DEFAULTS.size))
    found += [kc.solve(module, t, p=p).status[1] for module in modules]
    beyond = int(np.argmax(t > LOCKS))
    for status in found:
        assert status[:beyond].tolist() == [kc.Status.CONVERGED] * beyond
        assert status[beyond] == kc.Status.LOCK_UP

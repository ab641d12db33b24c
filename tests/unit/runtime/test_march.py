"""What a step accepts: each of its tests alone stands against a branch that the others miss."""

import math

import numpy as np
import pytest

from kincompile.runtime.engine.code import code_of
from kincompile.runtime.engine.linear import Planned
from kincompile.runtime.march import March, State
from kincompile.runtime.problem import problem

BIFURCATION, RATE = 6.0, math.pi / 12
P = np.array([1.0])


@pytest.fixture
def march(example_3_7_5):
    q = position(0.0, 1)
    equations = problem(code_of(example_3_7_5), P, q, 0.0)
    return March(equations, equations.engine, 1e-10)


def position(t, side):
    """Return the position of case R4 with rod 1: the rod's angle on one side or the other."""
    angle = RATE * t
    rod = side * (math.pi / 2 - angle)
    return np.array([math.cos(angle) + math.sin(rod), angle, rod])


def checks(march, before, after, side):
    """Return the checks of a step to a side of the bifurcation."""
    states = []
    for t, q in ((before, position(before, 1)), (after, position(after, side))):
        point = march.equations.at(q, t)
        assert np.max(np.abs(point.Phi)) < 1e-14
        state = march.state(point)
        assert isinstance(state, State)
        states.append(state)
    predicted = march.predict(states[0], after)
    error, near = march.error(states[0], states[1].point.q, predicted)
    assert near
    return [bool(good) for good, _ in march.follows(*states, error)]


def test_a_step_along_the_motion_is_accepted(march):
    assert checks(march, 5.0, 5.1, 1) == [True, True]


def test_past_a_bifurcation_the_smooth_branch_changes_a_sign(march):
    assert checks(march, BIFURCATION - 0.1, BIFURCATION + 0.001, 1) == [False, True]


def test_past_a_bifurcation_the_other_branch_has_a_kink(march):
    assert checks(march, BIFURCATION - 0.1, BIFURCATION + 0.001, -1) == [True, False]


def test_a_batch_is_corrected_each_as_if_alone(example_named):
    module = example_named("four_bar").module
    equations = problem(code_of(module), module.DEFAULTS, module.GUESS, 0.0)
    march = March(equations, Planned(equations.code, module.DEFAULTS), 1e-10)
    guesses = np.add.outer(module.GUESS, [0.0, 1e-3, 0.05])
    together = march.correct_together(guesses.copy(), 0.0, 25)
    assert together.good.all()
    for k in range(3):
        alone = march.correct_together(guesses[:, [k]], 0.0, 25)
        np.testing.assert_array_equal(alone.point.q[:, 0], together.point.q[:, k])
        assert alone.iterations[0] == together.iterations[k]

"""The text of the start on NumPy: from rough guesses it ends where the runtime does."""

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.criteria import MAX_ITERATIONS, TOLERANCE
from kincompile.emitters.c.target import KEYWORDS
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.status import Status
from kincompile.solver.nodes import variables_in
from kincompile.solver.reader import start
from kincompile.solver.words import on_numpy
from tests.unit.runtime.conftest import nearly_dead_slider

from .conftest import mechanism_of, rough_guesses, size_around

pytestmark = pytest.mark.filterwarnings("ignore::kincompile.errors.AssemblyWarning")


def started(module, p, guess, size):
    """Return how the text ends from a guess at t = 0: an attempt."""
    text = on_numpy(mechanism_of(module, 1))
    b, own, best = text.Point(), text.Start(t=0.0, tolerance=TOLERANCE), text.Attempt()
    b.p[:] = p[:, np.newaxis]
    text.constants(b, lanes=1)
    with np.errstate(all="ignore"):
        text.position_from(guess, size, MAX_ITERATIONS, b, own, best)
    return best


@pytest.mark.parametrize(
    "name", ["four_bar", "slider_crank", "cam_flat_follower", "rssr", "spatial_slider_crank"]
)
def test_that_rough_guesses_lead_where_the_runtime_goes(example_named, name):
    module, ways = example_named(name).module, set()
    for guess in rough_guesses(module, 8):
        known = kc.solve(module, [0.0], guess=guess)
        best = started(module, module.DEFAULTS, guess, size_around(module, guess))
        assert (best.status == Status.CONVERGED) == known.success
        np.testing.assert_allclose(best.q, known.q[0], rtol=0, atol=1e-8)
        ways.add(tuple(np.round(known.q[0], 3)))
    assert len(ways) > 1


def test_that_turns_and_signs_of_euler_parameters_are_no_way(example_named):
    module = example_named("spatial_slider_crank").module
    text, q = on_numpy(mechanism_of(module, 1)), kc.solve(module, [0.0]).q[0]
    own, covers, turned = text.Start(near=np.ones_like(q)), code_of(module).covers, q.copy()
    turned[covers[1]] *= -1
    assert text.away_from(turned, q, own) == 0
    turned[covers[1, 0]] += 0.5
    assert text.away_from(turned, q, own) == pytest.approx(0.5)


def test_that_the_other_side_of_a_singular_position_is_looked_at():
    model, sides, guesses = nearly_dead_slider(1.0)
    module = kc.compile(model)
    for guess in guesses:
        best = started(module, module.DEFAULTS, guess, size_around(module, guess))
        np.testing.assert_allclose(best.q, sides[0], rtol=0, atol=1e-9)


def test_that_a_guess_without_values_and_a_gap_have_their_status(example_named):
    module = example_named("four_bar").module
    nowhere = np.full(module.N_COORDINATES, np.nan)
    assert started(module, module.DEFAULTS, nowhere, 1.0).status == Status.NOT_FINITE
    too_short = module.DEFAULTS * [1, 0.1, 1, 1, 1]
    assert started(module, too_short, module.GUESS, 1.0).status == Status.NOT_CONVERGED


@pytest.mark.parametrize("near", [0.01, 0.1, 0.3, 1.0, 10.0])
def test_that_attempts_in_vain_end_as_in_the_runtime(near):
    """As the one that misses least; one equation has fewer numbers than restarts are shifted by."""
    x, guess = sympy.Symbol("x"), np.array([near])
    module = kc.compile(kc.ConstraintSystem("no_root", "x", [sympy.sqrt(x) + 1]))
    known = kc.solve(module, [0.0], guess=guess)
    with np.errstate(all="ignore"):  # beside the guess the root has no value
        size = size_around(module, guess)
    best = started(module, module.DEFAULTS, guess, size)
    status = int(known.status[0])
    assert best.status == (Status.NOT_CONVERGED if status == Status.NOT_ASSEMBLED else status)
    assert best.iterations == known.iterations[0]


def test_that_no_name_of_the_text_is_a_word_of_c():
    text = start()
    functions = text.functions.values()
    names = {x.name for f in functions for x in (*f.parameters, *variables_in(f.body))}
    names |= {x for item in text.structs.values() for x in (item.name, *item.fields)}
    assert (names | text.functions.keys()) & {*KEYWORDS, "lane", "lanes"} == set()

"""The text of the solver as it stands, on NumPy, beside kc.solve and beside the C printed of it."""

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import criteria
from kincompile.criteria import TOLERANCE
from kincompile.emitters.c.target import KEYWORDS
from kincompile.runtime.inputs import read_inputs
from kincompile.runtime.status import Status
from kincompile.solver import vocabulary, words
from kincompile.solver.nodes import variables_in
from kincompile.solver.reader import solver

from .conftest import mechanism_of, start_of

WIDTHS = (1, 7, 32)
T = np.linspace(0, 1, 25)


@pytest.fixture(scope="module", params=["four_bar", "slot_follower"])
def mechanism(request, example_named):
    """A mechanism whose cranks turn once in a few seconds."""
    return example_named(request.param)


@pytest.mark.parametrize("lanes", WIDTHS)
def test_that_a_motion_is_that_of_the_runtime(mechanism, march, lanes):
    module = mechanism.module
    expected = kc.solve(module, T)
    reached, found = march(module, lanes, T, [module.DEFAULTS])
    assert reached == T.size
    assert set(found.status) == {Status.CONVERGED}
    for name in ("q", "q_dot", "q_ddot"):
        known = getattr(expected, name).T
        np.testing.assert_allclose(
            getattr(found, name), known, rtol=0, atol=1e-11 * np.max(abs(known))
        )


@pytest.mark.parametrize("lanes", WIDTHS)
def test_that_parameter_sets_are_those_of_the_runtime(mechanism, march, lanes):
    module = mechanism.module
    sets = np.repeat([module.DEFAULTS], 9, axis=0)
    sets[:, 0] *= np.linspace(0.9, 1.1, 9)
    reached, found = march(module, lanes, T[:9], sets, together=True)
    expected = kc.solve(module, T[:9], {module.PARAMETERS[0]: sets[:, 0]})
    assert reached == len(sets)
    for name in ("q", "q_dot", "q_ddot"):
        known = np.transpose(getattr(expected, name))
        np.testing.assert_allclose(
            getattr(found, name), known, rtol=0, atol=1e-11 * np.max(abs(known))
        )


def test_that_a_set_that_fails_rests_and_disturbs_no_other(example_named, march):
    module = example_named("four_bar").module
    sets = np.array([module.DEFAULTS, module.DEFAULTS * [1, 0.4, 1, 1, 1], module.DEFAULTS])
    t = np.linspace(0, 3, 31)
    alone, motion = march(module, 32, t, sets[:1])
    reached, found = march(module, 32, t, sets, together=True)
    status = found.status.reshape(t.size, 3)
    assert (alone, reached) == (t.size, 2)
    assert list(dict.fromkeys(status[:, 1])) == [
        Status.CONVERGED, Status.LOCK_UP, Status.NOT_REACHED
    ]  # fmt: skip
    assert np.isnan(found.q[:, status[:, 1] == Status.NOT_REACHED, 1]).all()
    np.testing.assert_allclose(found.q[:, :, 2], motion.q, rtol=0, atol=1e-10)


def test_that_the_careful_march_takes_the_steps_of_the_runtime():
    """Across a gap: after a step that was too long the next ones are no longer."""
    model = kc.ConstraintSystem("wave", ["x"], [sympy.Symbol("x") - sympy.sin(kc.t)])
    module = kc.compile(model)
    text = words.on_numpy(mechanism_of(module, 1), is_careful=True)
    b, s, o, at = text.Point(), text.Scales(), text.Outcome(), text.State()
    at.q_dot[:] = 1.0
    text.constants(b, lanes=1)
    text.measure(b, 1.0, s)
    s.tolerance = TOLERANCE
    assert text.advance_carefully(b, s, at, 0.0, 300.0, o)
    assert (o.status[0], o.is_there[0]) == (Status.CONVERGED, True)
    assert b.q[0, 0] == pytest.approx(np.sin(300.0), abs=1e-12)
    expected = kc.solve(module, [0, 300.0], guess=[0]).iterations[1]
    assert o.iterations[0] == pytest.approx(expected, rel=0.03)


def native_march(native, t, p):
    """Follow a motion by compiled C, from the start that the text has too."""
    inputs = read_inputs(native, t, p, None, TOLERANCE, 25)
    guess, size = start_of(native, float(t[0]))
    states = np.full((3, native.N_COORDINATES, t.size), np.nan)
    residual, (status, iterations) = np.zeros(t.size), np.zeros((2, t.size), np.intc)
    found = states, residual, status, iterations
    reached = native.compiled_march(inputs, guess, size, TOLERANCE, None, *found)
    return reached, states, status, iterations


@pytest.mark.usefixtures("quick_compiler")
@pytest.mark.parametrize("factor", [1.0, 0.9, 0.4])
def test_that_printed_c_does_what_the_text_does(example_named, march, factor):
    example, t = example_named("four_bar"), np.linspace(0, 3, 40)
    p = example.module.DEFAULTS * [1, factor, 1, 1, 1]
    reached, states, status, iterations = native_march(example.native, t, p)
    for lanes in WIDTHS:
        here, found = march(example.module, lanes, t, [p])
        assert here == reached
        np.testing.assert_array_equal(found.status, status)
        np.testing.assert_allclose(found.q[:, :here], states[0][:, :here], rtol=0, atol=1e-8)
        if lanes == 32:
            np.testing.assert_array_equal(found.iterations, iterations)
    assert (factor < 0.5) == (Status.LOCK_UP in status)


# ---------------------------------------------------------------- the words


def test_that_every_name_of_the_language_has_a_meaning_on_numpy():
    known = {*vocabulary.CONSTANTS, *vocabulary.WORDS}
    words_of_python = {"abs", "max", "min"}
    here = {*vars(words), *vars(criteria), *words_of_python}
    assert known - here == set()


def test_that_the_statuses_are_those_of_the_runtime():
    assert {name: Status[name] for name in vocabulary.STATUSES} == vocabulary.STATUSES


def test_that_no_name_of_the_text_is_a_word_of_c():
    text = solver()
    functions = text.functions.values()
    names = {x.name for f in functions for x in (*f.parameters, *variables_in(f.body))}
    names |= {x for item in text.structs.values() for x in (item.name, *item.fields)}
    names |= text.functions.keys()
    assert names & {*KEYWORDS, "lane", "lanes"} == set()

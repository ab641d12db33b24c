"""Entries of a position, sampled while a solve is planned, and some quantities of many."""

import numpy as np
import pytest

import kincompile as kc
from kincompile.ir.interpret import interpret, interpreter, run
from kincompile.ir.lower import lower
from kincompile.model.mechanism import system_of


def test_that_a_division_by_zero_in_a_driver_or_a_parameter_is_no_error_of_the_compiler():
    m = kc.Mechanism("pendulum")
    a, arm = m.parameter("a", 0.0), m.body("arm")
    m.add(kc.Revolute("A", m.ground, (0, 0), arm, (1, 0)))
    m.add(kc.AbsoluteAngle("motor", arm, 1 / kc.t + kc.t / (2 * a)))
    module = kc.compile(m)
    solution = kc.solve(module, [1.0], {"a": 0.5})
    assert solution.success
    assert solution["arm.phi"][0] == 2.0


@pytest.mark.parametrize("name", ["wrecker_boom", "balanced_four_bar", "spatial_slider_crank"])
def test_that_some_quantities_are_to_the_bit_what_they_are_among_all(example_named, name):
    program = lower(system_of(example_named(name).model))
    q, q_dot, q_ddot = np.random.default_rng(2).normal(size=(3, 4, len(program.coordinates)))
    states = q, q_dot, np.linspace(0, 1, 4), None, q_ddot
    names = [item.name for item in program.quantities]
    with np.errstate(all="ignore"):  # states of another mechanism, perhaps outside of a domain
        everything = dict(zip(names, interpret(program, *states), strict=True))
    for some in (["Phi"], ["Phi_q", "Phi"], names[3:], names):
        with np.errstate(all="ignore"):
            found = interpreter(program, some)(*states)
        order = [item for item in names if item in some]
        for quantity, values in zip(order, found, strict=True):
            np.testing.assert_array_equal(values, everything[quantity])


def test_that_what_is_not_asked_for_is_not_computed(example_named, monkeypatch):
    """The generic rank evaluates Phi and Phi_q hundreds of times; gamma and loads are most code."""
    program, lengths = lower(system_of(example_named("rssr").model)), list[int]()

    def counted(code, inputs, tables):
        lengths.append(len(code))
        return run(code, inputs, tables)

    monkeypatch.setattr("kincompile.ir.interpret.run", counted)
    q = np.zeros((1, len(program.coordinates)))
    for wanted in (None, ("Phi", "Phi_q")):
        with np.errstate(all="ignore"):
            interpreter(program, wanted)(q, q, 0.0)
    everything, some = np.reshape(lengths, (2, -1)).sum(axis=1)
    assert 0 < some < everything / 2

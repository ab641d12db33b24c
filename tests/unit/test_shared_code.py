"""Compiled modules show their own text, as a file would."""

import inspect

import pytest

import kincompile as kc


def pendulum(name, constraints=1):
    m = kc.Mechanism(name)
    bodies = [m.body(f"b{k}", guess=(1, 0, 0)) for k in range(constraints)]
    for k, body in enumerate(bodies):
        m.add(kc.Revolute(f"A{k}", m.ground, (0, 0), body, (-1, 0)))
        m.add(kc.AbsoluteAngle(f"motor{k}", body, kc.t))
    return m


@pytest.mark.parametrize("constraints", [1, 2, 3])
def test_source_and_lines_are_those_of_the_module_itself(constraints):
    module = kc.compile(pendulum("lines", constraints))
    lines = kc.emit(pendulum("lines", constraints)).source.splitlines()
    for name in ("Phi", "_evaluate", "_checked"):
        function = vars(module)[name]
        text = inspect.getsource(function)
        assert text.startswith(f"def {name}(")
        assert lines[function.__code__.co_firstlineno - 1] == text.splitlines()[0]
    with pytest.raises(kc.InputError) as caught:
        module.Phi([1.0], 0.0)
    entry = caught.traceback[-1]
    assert "raise InputError(" in str(entry.statement)

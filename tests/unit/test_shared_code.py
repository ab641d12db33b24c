"""The part that emitted modules have in common is compiled once, and nobody can tell."""

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


def test_two_modules_share_the_code_of_what_they_have_in_common():
    one, two = kc.compile(pendulum("one")), kc.compile(pendulum("two", 2))
    first, second = vars(one)["_evaluate"], vars(two)["_evaluate"]
    assert first.__code__.co_code == second.__code__.co_code
    assert first.__code__.co_consts[0] is second.__code__.co_consts[0]  # the docstring
    assert first.__globals__ is vars(one)
    assert second.__globals__ is vars(two)


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

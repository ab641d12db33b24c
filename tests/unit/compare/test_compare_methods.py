"""The methods of a transmission compared with itself: parameters by name, those of the inverse."""

from functools import cache
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from tests import transmission_models as models

ENDS: dict[str, Any] = {
    "four_bar": (models.crank_rocker, ["motor"], ["rocker.phi"]),
    "five_bar": (models.five_bar, ["motor_1", "motor_2"], ["end"]),
}  # with parameters, and without


@cache
def function(name: str) -> Any:
    model, inputs, outputs = ENDS[name]
    return kc.transmission(model(), inputs, outputs)


@pytest.mark.parametrize("name", ENDS)
def test_that_methods_of_a_transmission_are_those_of_itself(name: str) -> None:
    f = function(name)
    report = kc.compare(f, J=f.J, J_dot=f.J_dot, effort=f.effort, x=f)
    assert report.verdict == "equal", report.to_text()
    g = f.inverse
    report = kc.compare(f, J=g.J, J_dot=g.J_dot, effort=g.effort)
    assert report.equal, report.to_text()
    assert [item.kind for item in report.conventions] == ["du/dx", "du/dx"]


@pytest.mark.slow
def test_that_a_method_of_another_mechanism_is_judged_at_the_same_parameters() -> None:
    f = function("four_bar")
    longer = kc.transmission(models.crank_rocker(c=0.09), ["motor"], ["rocker.phi"])
    assert kc.compare(f, J=longer.J).equal  # its lengths are given to it
    report = kc.compare(f, J=lambda u: longer.J(u))  # here they are its own
    assert [entry.label for entry in report.different] == ["J[phi_rocker, motor]"]
    assert kc.compare(f, J=lambda u: f.J(u)).equal


def test_that_a_wrong_method_is_found() -> None:
    f = function("five_bar")
    report = kc.compare(f, effort=f.inverse.effort, J=f.J_dot)
    assert {entry.quantity for entry in report.different} == {"J"}
    with pytest.raises(kc.InputError, match="J: the function returns an array of 3 axes"):
        kc.compare(f, J=f.second)


def test_that_a_function_may_return_one_number() -> None:
    f = function("four_bar")
    assert kc.compare(f, J=lambda u: f.J(u)[0, 0], x=lambda u: f(u)[0]).equal


def test_that_inputs_in_another_order_are_refused() -> None:
    f = function("five_bar")
    other = kc.transmission(models.five_bar(), ["motor_2", "motor_1"], ["end"])
    with pytest.raises(kc.InputError, match="of motor_2, motor_1; give one of motor_1, motor_2"):
        kc.compare(f, J=other.J)
    assert kc.compare(f, J=lambda u: other.J(u[::-1])[:, ::-1]).equal
    assert np.allclose(other.J(f.home.u[::-1]), f.J(f.home.u)[:, ::-1])

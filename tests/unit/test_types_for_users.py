"""What a type checker says to a user: the arguments of joints have types."""

import inspect
import typing
from collections.abc import Sequence

import numpy as np
import pytest
import sympy
from numpy.typing import NDArray

from kincompile.model.bodies import Body
from kincompile.model.catalogue import CONSTRAINTS


@pytest.mark.parametrize("kind", CONSTRAINTS.values(), ids=CONSTRAINTS)
def test_that_every_argument_of_a_joint_has_a_type_and_a_line_in_its_docstring(kind):
    hints = typing.get_type_hints(kind)
    documented = str(inspect.getdoc(kind)).partition("Parameters\n----------\n")[2].splitlines()
    for name in inspect.signature(kind).parameters:
        assert hints[name] is not typing.Any
        assert documented[documented.index(name) + 1].startswith("    ")


def test_that_the_types_are_those_that_are_meant():
    hints = typing.get_type_hints(CONSTRAINTS["Translational"])
    number = int | float | sympy.Expr
    assert hints["i"] == Body | str
    assert hints["axis_j"] == Sequence[number] | NDArray[np.float64]
    assert typing.get_type_hints(CONSTRAINTS["Distance"])["distance"] == number

"""A frame in space is another object: Euler parameters, derived by the same rules.

Numbers: a golden state worked out with 60 digits, apart from this package (Haug, chapter 9).
"""

from typing import Any

import numpy as np
import pytest

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import (
    Expression,
    ProfileFunction,
    Symbol,
    TimeFunction,
    VectorSymbol,
    dot,
)
from kincompile.calculus.space import SpatialFrame
from kincompile.calculus.template import Template
from kincompile.derive.derivation import RowBlock, derive

STATE = {
    "r_i": (0.3, -0.7, 0.5), "p_i": (0.46, -0.22, 0.50, 0.70), "r_j": (1.1, 0.4, -0.6),
    "p_j": (0.78, 0.26, -0.54, 0.18), "r_i_dot": (0.2, -0.5, 0.9), "r_j_dot": (-0.8, 0.6, 0.1),
    "p_i_dot": (-0.011, 0.497, 0.289, -0.043), "p_j_dot": (0.254, -0.348, 0.228, 0.086),
    "s_i": (0.25, -0.15, 0.35), "s_j": (-0.35, 0.45, 0.2), "a_i": (0.6, 0.9, -0.3),
    "a_j": (-0.4, 0.7, 0.5),
}  # fmt: skip


class Numbers:
    """The leaves at the state; complex where a coordinate is moved."""

    def __init__(self, moved: dict[str, Any]) -> None:
        self.values = {**STATE, **moved}

    def number(self, value: Any) -> Any:
        return float(value)

    def vector(self, symbol: VectorSymbol) -> Any:
        return tuple(self.values[symbol.name])

    def entries(self, rotation: Any, expand: Expansion) -> Any:
        return expand.entries(rotation)

    def pi(self) -> Any:
        raise AssertionError

    def symbol(self, symbol: Symbol) -> Any:
        raise AssertionError(symbol)

    def time_function(self, function: TimeFunction) -> Any:
        raise AssertionError(function)

    def profile(self, profile: ProfileFunction) -> Any:
        raise AssertionError(profile)

    def call(self, function: str, value: Any) -> Any:
        raise AssertionError(function, value)


def at(expression: Expression, **moved: Any) -> Any:
    return np.array(Expansion(Numbers(moved), 3).components(expression))


C_DDOT = -1.2 * np.sin(0.8)  # the golden rows with a value have C = 2 + 0.3 sin 2t, at t = 0.4

frame_i, frame_j = SpatialFrame("i"), SpatialFrame("j")
s_i, s_j, a_i, a_j = (VectorSymbol(name, 3) for name in ("s_i", "s_j", "a_i", "a_j"))
d = frame_j.point(s_j) - frame_i.point(s_i)
CASES: dict[str, tuple[Expression, Any, Any]] = {
    "spherical": (d, (0.21152, 0.90664, -1.15072), (0.2087332, 0.0278268, -0.196142)),
    "dot1": (dot(frame_i.A(a_i), frame_j.A(a_j)), None, -1.14430360898 - C_DDOT),
    "dot2": (dot(frame_i.A(a_i), d), None, -1.70876099215 - C_DDOT),
    "norm": (frame_i.rotation.constraints[0], 0, -0.665),
}


def block_of(name: str) -> RowBlock:
    frames: Any = (frame_i, frame_j)
    (block,) = derive(Template(name, frames, (), (CASES[name][0],)))
    return block


@pytest.mark.parametrize("name", CASES)
def test_that_gamma_is_the_golden_one(name: str) -> None:
    _, Phi, gamma = CASES[name]
    block = block_of(name)
    np.testing.assert_allclose(at(block.gamma).ravel(), np.ravel(gamma), atol=1e-10)
    if Phi is not None:
        np.testing.assert_allclose(at(block.Phi).ravel(), np.ravel(Phi), atol=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_that_unit_rates_give_the_jacobian(name: str) -> None:
    block = block_of(name)
    columns = iter(block.Phi_q)
    for coordinate in (*frame_i.coordinates, *frame_j.coordinates):
        for axis in range(coordinate.size):
            here = np.array(STATE[coordinate.name])
            moved = here + 1e-30j * np.eye(coordinate.size)[axis]
            expected = at(block.Phi, **{coordinate.name: moved}).imag / 1e-30
            np.testing.assert_allclose(at(next(columns)), expected, atol=1e-13)
    assert next(columns, None) is None

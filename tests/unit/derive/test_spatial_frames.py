"""A frame in space is another object: Euler parameters, derived by the same rules.

Numbers: a golden state worked out with 60 digits, apart from this package (Haug, chapter 9).
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import (
    Expression,
    ProfileFunction,
    Rotated,
    Scalar,
    Symbol,
    TimeFunction,
    Vector,
    VectorSymbol,
    dot,
    rotated,
)
from kincompile.calculus.template import Template
from kincompile.derive.derivation import RowBlock, derive

STATE = {
    "r_i": (0.3, -0.7, 0.5), "p_i": (0.46, -0.22, 0.50, 0.70), "r_j": (1.1, 0.4, -0.6),
    "p_j": (0.78, 0.26, -0.54, 0.18), "r_i_dot": (0.2, -0.5, 0.9), "r_j_dot": (-0.8, 0.6, 0.1),
    "p_i_dot": (-0.011, 0.497, 0.289, -0.043), "p_j_dot": (0.254, -0.348, 0.228, 0.086),
    "s_i": (0.25, -0.15, 0.35), "s_j": (-0.35, 0.45, 0.2), "a_i": (0.6, 0.9, -0.3),
    "a_j": (-0.4, 0.7, 0.5),
}  # fmt: skip


@dataclass(frozen=True)
class EulerRotation:
    """A(p) v = (e0^2 - e^T e) v + 2 e e^T v + 2 e0 e x v, quadratic in p."""

    p: VectorSymbol

    letters: ClassVar[str] = "ABB"
    names: ClassVar[tuple[str, ...]] = ("e0", "e1", "e2", "e3")
    symbols: ClassVar[tuple[str, ...]] = names

    @property
    def coordinates(self) -> tuple[Expression, ...]:
        return (self.p,)

    @property
    def constraints(self) -> tuple[Scalar, ...]:
        return (dot(self.p, self.p) - 1,)

    def tidy(self, vector: Vector, along: tuple[Expression, ...]) -> Vector:
        return Rotated(self, vector, along)

    def entries(self, coordinates: Any, call: Any) -> Any:
        del call
        return coordinates[0]

    def components(self, entries: Any, vector: Any, along: tuple[Any, ...]) -> Any:
        """Return the bilinear form whose diagonal is A(p) v, by how often p is replaced."""
        p, w = {0: (entries, entries), 1: (entries, along[0] if along else 0), 2: along}[len(along)]
        (e0, *e), (f0, *f), v = p, w, np.array(vector)
        same = (e0 * f0 - np.dot(e, f)) * v + np.multiply(e, np.dot(f, v))
        form = same + np.multiply(f, np.dot(e, v)) + e0 * np.cross(f, v) + f0 * np.cross(e, v)
        return tuple(form * (2 if along else 1))


@dataclass(frozen=True)
class SpatialFrame:
    """Position r and Euler parameters p."""

    index: str

    @property
    def coordinates(self) -> tuple[VectorSymbol, ...]:
        return VectorSymbol(f"r_{self.index}", 3), VectorSymbol(f"p_{self.index}", 4)

    @property
    def rates(self) -> tuple[VectorSymbol, ...]:
        return VectorSymbol(f"r_{self.index}_dot", 3), VectorSymbol(f"p_{self.index}_dot", 4)

    def A(self, name: str) -> Vector:  # noqa: N802 - the textbook's
        return rotated(EulerRotation(self.coordinates[1]), VectorSymbol(name, 3))

    def point(self, name: str) -> Vector:
        return self.coordinates[0] + self.A(name)


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
d = frame_j.point("s_j") - frame_i.point("s_i")
CASES: dict[str, tuple[Expression, Any, Any]] = {
    "spherical": (d, (0.21152, 0.90664, -1.15072), (0.2087332, 0.0278268, -0.196142)),
    "dot1": (dot(frame_i.A("a_i"), frame_j.A("a_j")), None, -1.14430360898 - C_DDOT),
    "dot2": (dot(frame_i.A("a_i"), d), None, -1.70876099215 - C_DDOT),
    "norm": (EulerRotation(frame_i.coordinates[1]).constraints[0], 0, -0.665),
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

"""The rules of differentiation against the complex step, on random expressions.

d/ds f(x + s v) at s = 0 is Im f(x + i h v) / h: exact to rounding, and it knows no rule.
"""

import cmath
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import (
    ONE,
    ZERO,
    ZERO_VECTOR,
    Basis,
    Expression,
    Number,
    ProfileFunction,
    Rotation,
    Scalar,
    Symbol,
    TimeFunction,
    Vector,
    VectorSymbol,
    dot,
    perpendicular,
    scaled,
)
from kincompile.calculus.rotations import turned
from kincompile.derive.partials import coefficient
from kincompile.derive.rules import TIME, Direction, along

STEP = 1e-30
VALUES = {"phi_i": 0.7, "phi_j": -1.1, "alpha": 0.4, "k": 1.3}
PAIRS = {"r": (0.3, -0.8), "s": (0.9, 0.5)}
SPEEDS = {"phi_i": 1.7, "phi_j": -0.6, "alpha": 0.8}
VELOCITIES = {"r": (-0.4, 1.2)}
T, GROWTH, BEND = 0.3, 0.7, 0.4  # C = exp(0.7 t), rho = exp(0.4 alpha)

DIRECTION: Direction = {
    **{Symbol(name): Symbol(f"{name}_dot") for name in SPEEDS},
    **{VectorSymbol(name): VectorSymbol(f"{name}_dot") for name in VELOCITIES},
    TIME: ONE,
}


class Line:
    """The leaves on the line x + s v, t + s, at a complex s."""

    def __init__(self, s: complex) -> None:
        self.s = s

    def number(self, value: Fraction) -> complex:
        return complex(value)

    def pi(self) -> complex:
        return complex(cmath.pi)

    def symbol(self, symbol: Symbol) -> complex:
        name = symbol.name
        if name.endswith("_dot"):
            return complex(SPEEDS[name.removesuffix("_dot")])
        return VALUES[name] + self.s * SPEEDS.get(name, 0.0)

    def vector(self, symbol: VectorSymbol) -> tuple[complex, complex]:
        name = symbol.name
        if name.endswith("_dot"):
            return VELOCITIES[name.removesuffix("_dot")]
        (x, y), (x_dot, y_dot) = PAIRS[name], VELOCITIES.get(name, (0.0, 0.0))
        return x + self.s * x_dot, y + self.s * y_dot

    def time_function(self, function: TimeFunction) -> complex:
        return GROWTH**function.order * cmath.exp(GROWTH * (T + self.s))

    def profile(self, profile: ProfileFunction) -> complex:
        return BEND**profile.order * cmath.exp(BEND * self.symbol(profile.argument))

    def entries(self, rotation: Rotation, expand: Expansion) -> Any:
        return expand.entries(rotation)

    def call(self, function: str, value: complex) -> Any:
        return getattr(cmath, function)(value)


def at(expression: Expression, s: complex = 0) -> Any:
    """Return the components of an expression on the line."""
    return np.array(Expansion(Line(s)).components(expression))


angles = st.sampled_from([Symbol("phi_i"), Symbol("phi_j"), Symbol("phi_j") - 2 * Symbol("phi_i")])
scalar_leaves = st.one_of(
    st.fractions(-2, 2, max_denominator=3).map(Number),
    st.sampled_from(
        [
            Symbol("phi_i"), Symbol("k"), TimeFunction("C"), TimeFunction("C", 1),
            ProfileFunction("rho", Symbol("alpha")), ProfileFunction("rho", Symbol("alpha"), 1),
        ]
    ),
)  # fmt: skip
vector_leaves = st.sampled_from([VectorSymbol("r"), VectorSymbol("s"), Basis()])
vectors: Any = st.recursive(
    vector_leaves,
    lambda inner: st.one_of(
        st.builds(lambda u, v: u + v, inner, inner),
        st.builds(turned, angles, inner, st.integers(0, 3)),
        st.builds(perpendicular, inner),
        st.builds(scaled, scalar_leaves, inner),
    ),
    max_leaves=4,
)
scalars: Any = st.recursive(
    st.one_of(scalar_leaves, st.builds(dot, vectors, vectors)),
    lambda inner: st.one_of(
        st.builds(lambda a, b: a + b, inner, inner),
        st.builds(lambda a, b: a * b, inner, inner),
        st.builds(lambda a, n: a**n, inner, st.integers(0, 3)),
    ),
    max_leaves=4,
)


@pytest.mark.slow
@given(scalars)
@settings(max_examples=200)
def test_that_a_scalar_is_differentiated_along_a_direction(expression: Scalar) -> None:
    expected = at(expression, 1j * STEP).imag / STEP
    np.testing.assert_allclose(at(along(expression, DIRECTION)), expected, 1e-9, 1e-9)


@given(vectors)
@settings(max_examples=200)
def test_that_a_vector_is_differentiated_along_a_direction(expression: Vector) -> None:
    expected = at(expression, 1j * STEP).imag / STEP
    np.testing.assert_allclose(at(along(expression, DIRECTION)), expected, 1e-9, 1e-9)


class Moved(Line):
    """The leaves with the position r moved by a complex step along one axis."""

    def __init__(self, axis: int) -> None:
        super().__init__(0)
        self.axis = axis

    def vector(self, symbol: VectorSymbol) -> tuple[complex, complex]:
        x, y = PAIRS[symbol.name]
        if symbol != r:
            return x, y
        return (x + 1j * STEP, y) if self.axis == 0 else (x, y + 1j * STEP)


r, r_dot = VectorSymbol("r"), VectorSymbol("r_dot")


@given(st.one_of(scalars, vectors))
@settings(max_examples=150)
def test_that_a_unit_rate_gives_a_partial_derivative(expression: Expression) -> None:
    for axis in (0, 1):
        moved = np.array(Expansion(Moved(axis)).components(expression))
        found = at(along(expression, {r: Basis(axis)}))
        np.testing.assert_allclose(found, moved.imag / STEP, 1e-9, 1e-9)


# A position enters a constraint as it is or times a scalar, never turned: d/dr is k I.
fixed_points = st.sampled_from([VectorSymbol("s"), turned(Symbol("phi_i"), VectorSymbol("s"), 1)])
positions = st.builds(lambda a, b, u: a * r + b * u, scalar_leaves, scalar_leaves, fixed_points)
scalars_of_r: Any = st.recursive(
    st.one_of(
        scalar_leaves, st.builds(dot, positions, positions), st.builds(dot, fixed_points, positions)
    ),
    lambda inner: st.one_of(
        st.builds(lambda a, b: a + b, inner, inner),
        st.builds(lambda a, b: a * b, inner, inner),
        st.builds(lambda a, n: a**n, inner, st.integers(0, 3)),
    ),
    max_leaves=4,
)


@given(scalars_of_r)
@settings(max_examples=150)
def test_that_a_scalar_is_differentiated_by_a_position(expression: Scalar) -> None:
    found = at(coefficient(along(expression, {r: r_dot}), r_dot))
    for axis in (0, 1):
        moved = Expansion(Moved(axis)).components(expression)[0]
        np.testing.assert_allclose(found[axis], complex(moved).imag / STEP, 1e-9, 1e-9)


@given(positions)
def test_that_a_vector_is_differentiated_by_a_position(expression: Vector) -> None:
    k = at(coefficient(along(expression, {r: r_dot}), r_dot))[0]
    for axis in (0, 1):
        moved = np.array(Expansion(Moved(axis)).components(expression))
        np.testing.assert_allclose(moved.imag / STEP, k * np.eye(2)[axis], 1e-9, 1e-9)


phi, s = Symbol("phi"), VectorSymbol("s")


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (turned(phi, s), turned(phi, s, 1)),  # dA/dphi = B = R A
        (turned(phi, s, 1), -turned(phi, s)),  # dB/dphi = -A
        (turned(2 * phi, s), 2 * turned(2 * phi, s, 1)),
        (perpendicular(turned(phi, s)), -turned(phi, s)),
        (s, ZERO_VECTOR),
    ],
)
def test_that_a_rotation_follows_the_textbook(expression: Vector, expected: Vector) -> None:
    assert along(expression, {phi: ONE}) == expected


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        (phi**3, 3 * phi**2),
        (dot(r, r), ZERO),
        (dot(s, s), ZERO),
        (TimeFunction("C"), ZERO),
        (Symbol("k") * phi, Symbol("k")),
    ],
)
def test_that_what_does_not_depend_on_an_angle_is_constant(
    expression: Scalar, expected: Scalar
) -> None:
    assert along(expression, {phi: ONE}) == expected


def test_that_time_differentiates_drivers_alone() -> None:
    driver, rho = TimeFunction("C"), ProfileFunction("rho", phi)
    assert along(driver**2 + rho, {TIME: ONE}) == 2 * driver * TimeFunction("C", 1)
    assert along(TimeFunction("C", 1), {TIME: ONE}) == TimeFunction("C", 2)


def test_that_a_product_of_a_vector_with_itself_is_written_short() -> None:
    assert along(dot(r, r), {r: r_dot}) == 2 * dot(r, r_dot)
    assert coefficient(2 * dot(r, r_dot), r_dot) == 2 * r

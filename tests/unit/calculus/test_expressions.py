"""The constructors tidy up and never change a value."""

from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kincompile.calculus.expressions import (
    ONE,
    ZERO,
    ZERO_VECTOR,
    Basis,
    Dot,
    Number,
    Perpendicular,
    Power,
    Product,
    Rotated,
    Scaled,
    Sum,
    Symbol,
    Vector,
    VectorSum,
    VectorSymbol,
    as_scalar,
    dot,
    perpendicular,
    power_of,
    rotated,
    scaled,
)
from kincompile.calculus.rotations import PlaneRotation, turned

a, b = Symbol("a"), Symbol("b")
phi = Symbol("phi")
u, v = VectorSymbol("u"), VectorSymbol("v")
A_u, B_u = Rotated(PlaneRotation(phi), u), Rotated(PlaneRotation(phi), u, (ONE,))


@given(data=st.data())
@settings(max_examples=150)
def test_that_a_scalar_keeps_its_value(recipes: Any, data: Any) -> None:
    recipe = data.draw(recipes.scalars)
    assert recipes.value(recipes.build(recipe)) == recipes.plain(recipe)


@given(data=st.data())
@settings(max_examples=150)
def test_that_a_vector_keeps_its_value(recipes: Any, data: Any) -> None:
    recipe = data.draw(recipes.vectors)
    assert recipes.value(recipes.build(recipe)) == recipes.plain(recipe)


@given(data=st.data())
@settings(max_examples=100)
def test_that_no_untidy_expression_is_left(recipes: Any, data: Any) -> None:
    assert_tidy(recipes.build(data.draw(st.one_of(recipes.scalars, recipes.vectors))))


def assert_tidy(expression: Any) -> None:
    children: tuple[Any, ...] = ()
    match expression:
        case Sum(terms) | VectorSum(terms):
            assert len(terms) != 1
            assert not any(type(term) is type(expression) for term in terms)
            assert ZERO not in terms
            assert ZERO_VECTOR not in terms
            children = terms
        case Product(factors):
            assert len(factors) > 1
            assert ZERO not in factors
            assert ONE not in factors
            assert not any(isinstance(factor, Product) for factor in factors)
            assert not any(isinstance(factor, Number) for factor in factors[1:])
            children = factors
        case Scaled(factor, vector):
            assert factor not in (ZERO, ONE)
            assert not isinstance(vector, Scaled)
            children = (factor, vector)
        case Rotated(_, vector, along):
            assert along in ((), (ONE,))
            assert not isinstance(vector, Scaled | Perpendicular | VectorSum)
            children = (vector,)
        case Perpendicular(vector):
            assert not isinstance(vector, Scaled | Perpendicular | VectorSum | Rotated)
            children = (vector,)
        case Dot(left, right):
            assert not isinstance(left, Scaled)
            assert not isinstance(right, Scaled)
            children = (left, right)
        case Power(base, exponent):
            assert exponent not in (0, 1)
            children = (base,)
    for child in children:
        assert_tidy(child)


@pytest.mark.parametrize(
    ("made", "expected"),
    [
        (a - a, ZERO),
        (a + 0, a),
        (1 * a, a),
        (a * 0, ZERO),
        (a * a, Power(a, 2)),
        (a / a, ONE),
        (2 * a + a * 3, Product((Number(Fraction(5)), a))),
        (1 - a, Sum((ONE, Product((Number(Fraction(-1)), a))))),
        (3 - Number(Fraction(1)), Number(Fraction(2))),
        (a / 2, Product((Number(Fraction(1, 2)), a))),
        (2 * (a + b), Sum((2 * a, 2 * b))),
        ((a**2) ** 3, Power(a, 6)),
        (a**0, ONE),
        (power_of(Number(Fraction(2)), -2), Number(Fraction(1, 4))),
        (u - u, ZERO_VECTOR),
        (0 * u, ZERO_VECTOR),
        (1 * u, u),
        (a * (b * u), Scaled(a * b, u)),
        (a * ZERO_VECTOR, ZERO_VECTOR),
        (dot(u, ZERO_VECTOR), ZERO),
        (dot(2 * u, a * v), 2 * a * Dot(u, v)),
        (perpendicular(perpendicular(u)), -u),
        (perpendicular(turned(phi, u)), B_u),
        (perpendicular(u + v), Perpendicular(u) + Perpendicular(v)),
        (turned(phi, u, 2), -A_u),
        (turned(phi, u, 3), -B_u),
        (turned(phi, perpendicular(u)), B_u),
        (turned(phi, u + v), A_u + turned(phi, v)),
        (rotated(PlaneRotation(phi), 2 * u, (a,)), 2 * a * B_u),
        (rotated(PlaneRotation(phi), u, (ZERO,)), ZERO_VECTOR),
        (scaled(Number(Fraction(2)), u + v), 2 * u + 2 * v),
    ],
)
def test_that_laws_are_applied(made: object, expected: object) -> None:
    assert made == expected


def test_that_a_number_becomes_an_expression_and_an_expression_stays() -> None:
    assert as_scalar(3) == Number(Fraction(3))
    assert as_scalar(a) is a


def test_that_the_type_of_a_product_follows_its_operands() -> None:
    assert isinstance(a * u, Vector)
    assert isinstance(a * b, Product)
    assert a * Basis() == Scaled(a, Basis())

"""Anything may be given anywhere: the answer is a message of ours, or it is accepted."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import kincompile as kc
from kincompile.model.arguments import Kind
from kincompile.model.catalogue import CONSTRAINTS

t, x = kc.t, sympy.Symbol("x")
f = sympy.Function("f")
TYPES = list(CONSTRAINTS.values())
GOOD: dict[Kind, Any] = {
    Kind.POINT: (0.1, 0.2),
    Kind.AXIS: (1, 0),
    Kind.SCALAR: 0.3,
    Kind.RADIUS: 0.5,
    Kind.VALUE: 1.0,
    Kind.DISTANCE: 1.0,
    Kind.PROFILE: 1 + 0.1 * sympy.cos(kc.alpha),
}

# Made anew for each use: some can be read once only.
MAKERS: list[Callable[[], Any]] = [
    lambda: None, lambda: "", lambda: "crank", lambda: "not a name", lambda: b"rod", lambda: True,
    lambda: np.True_, lambda: 1j, lambda: np.complex128(1j), lambda: float("nan"), lambda: -np.inf,
    lambda: 10**400, lambda: Fraction(10**400, 3), lambda: Decimal("1.5"), lambda: np.float32(1),
    lambda: (), lambda: (1,), lambda: (1, 2, 3), lambda: [1, [2, 3]], lambda: (None, None),
    lambda: ("a", 0), lambda: (float("nan"), 0), lambda: ((1, 2), (3, 4)), lambda: ([1], [2]),
    dict, lambda: {"a": 1}, lambda: {1, 2}, object, lambda: iter([1, 2]), lambda: range(2),
    lambda: map(float, "12"), lambda: np.array(3.0), lambda: np.array([1.0, 2.0]),
    lambda: np.eye(2), lambda: np.array(["a", "b"]),
    lambda: np.array([None, 1], dtype=object), lambda: sympy.oo,
    lambda: sympy.nan, lambda: sympy.zoo, lambda: sympy.I, lambda: sympy.asin(2), lambda: sympy.E,
    lambda: sympy.Float("1e500"), lambda: sympy.Rational(1, 3), lambda: sympy.true,
    lambda: sympy.Matrix([1, 2]), lambda: sympy.ImmutableMatrix([[1, 2], [3, 4]]),
    lambda: sympy.MatrixSymbol("M", 2, 2), lambda: sympy.Tuple(1, 2), lambda: sympy.Eq(t, 1),
    lambda: sympy.Eq(t, t), lambda: t < 1, lambda: sympy.Interval(0, 1), lambda: sympy.S.EmptySet,
    lambda: f, lambda: f(t), lambda: f(sympy.Symbol("u")), lambda: sympy.Derivative(f(t), t),
    lambda: sympy.Integral(t, t), lambda: sympy.Sum(t, (x, 1, 3)), lambda: sympy.Abs(t),
    lambda: sympy.Piecewise((1, t < 1)), lambda: sympy.Piecewise((1, sympy.Symbol("b")), (2, True)),
    lambda: sympy.Piecewise((t, sympy.Xor(t < 1, t < 2)), (t, True)),
    lambda: sympy.Piecewise((1, sympy.Contains(t, sympy.Interval(0, 1))), (2, True)),
    lambda: sympy.Symbol("A", commutative=False), lambda: sympy.IndexedBase("a")[1],
    lambda: sympy.Lambda(t, t), lambda: sympy.Poly(t), lambda: sympy.O(t), lambda: sympy.Dummy("t"),
    lambda: sympy.Quaternion(1, 2, 3, 4), lambda: sympy.Symbol("x", real=True) ** 2, lambda: len,
    lambda: lambda a: 1 / 0, lambda: lambda: 1, lambda: float, lambda: kc.Mechanism,
    lambda: kc.Mechanism("other"), lambda: kc.Mechanism("other").body("crank"),
    lambda: kc.Mechanism("other").body([]), lambda: kc.Equation("e", t),
]  # fmt: skip
junk = st.sampled_from(MAKERS)


def attempt(model: Callable[[], Any]) -> None:
    """Build and compile a model: an error that is not ours, or is our bug, comes through."""
    with suppress(kc.ModelError):
        kc.emit(model())


def with_joint(kind: Any, name: str, value: Any) -> kc.Mechanism:
    """Return a mechanism with one joint, one of whose arguments is a value."""
    m = kc.Mechanism("m")
    bodies = iter([m.body("crank"), m.body("rod")])
    arguments = {
        key: next(bodies) if item.kind is Kind.BODY else GOOD[item.kind]
        for key, item in kind.arguments().items()
    }
    m.add(kind(**{"name": "k", **arguments, name: value}))
    return m


@pytest.mark.parametrize("kind", TYPES, ids=lambda kind: kind.__name__)
@settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_that_no_argument_of_a_joint_brings_a_traceback(kind: Any, data: Any) -> None:
    name = data.draw(st.sampled_from([item.name for item in fields(kind)]))
    value = data.draw(junk)()
    attempt(lambda: with_joint(kind, name, value))


def arm(**options: Any) -> kc.Mechanism:
    m = kc.Mechanism(options.pop("name", "m"), **options)
    m.add(kc.Revolute("A", m.ground, (0, 0), m.body("arm"), (0.1, 0)))
    m.add(kc.AbsoluteAngle("motor", "arm", t))
    return m


def with_body(*arguments: Any) -> kc.Mechanism:
    m = arm()
    m.body(*arguments)
    return m


def with_parameter(*arguments: Any) -> kc.Mechanism:
    m = arm()
    m.parameter(*arguments)
    return m


def with_item(item: Any) -> kc.Mechanism:
    m = arm()
    m.add(item)
    return m


PLACES: dict[str, Callable[[Any], Any]] = {
    "mechanism": lambda value: arm(name=value),
    "length unit": lambda value: arm(length_unit=value),
    "body": with_body,
    "guess": lambda value: with_body("rod", value),
    "a number of the guess": lambda value: with_body("rod", (0, value, 0)),
    "parameter": lambda value: with_parameter(value, 1.0),
    "default": lambda value: with_parameter("L", value),
    "unit": lambda value: with_parameter("L", 1.0, value),
    "constraint": with_item,
    "equation's name": lambda value: with_item(kc.Equation(value, x)),
    "equation": lambda value: with_item(kc.Equation("e", value)),
    "system": lambda value: kc.ConstraintSystem(value, "x", [x]),
    "coordinates": lambda value: kc.ConstraintSystem("s", value, [x]),
    "a coordinate": lambda value: kc.ConstraintSystem("s", ["x", value], [x]),
    "equations": lambda value: kc.ConstraintSystem("s", "x", value),
    "parameters": lambda value: kc.ConstraintSystem("s", "x", [x], parameters=value),
    "a parameter": lambda value: kc.ConstraintSystem("s", "x", [x], parameters=[value]),
    "a default": lambda value: kc.ConstraintSystem("s", "x", [x], parameters={"L": value}),
    "guesses": lambda value: kc.ConstraintSystem("s", "x", [x], guess=value),
    "a guess": lambda value: kc.ConstraintSystem("s", "x", [x], guess=[value]),
    "a guess by name": lambda value: kc.ConstraintSystem("s", "x", [x], guess={"x": value}),
    "bodies": lambda value: kc.ConstraintSystem("s", "x", [x], bodies=value),
    "a body": lambda value: kc.ConstraintSystem("s", "x", [x], bodies=[value]),
}


@pytest.mark.parametrize("place", PLACES)
def test_that_nothing_given_elsewhere_brings_a_traceback(place: str) -> None:
    for make in MAKERS:
        attempt(lambda make=make: PLACES[place](make()))  # type: ignore[misc]

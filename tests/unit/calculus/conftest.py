"""Random expressions as recipes: built with the calculus, and worked out with plain numbers.

A recipe is a nested tuple. The plain numbers are exact: body angles have rational cosines and
sines (3/5, 4/5, ...), so that two ways to the same value give equal fractions.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import strategies as st

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import (
    Basis,
    Expression,
    Number,
    ProfileFunction,
    Rotation,
    Symbol,
    TimeFunction,
    Vector,
    VectorSymbol,
    dot,
    perpendicular,
    scaled,
)
from kincompile.calculus.rotations import turned

SCALARS = {"a": Fraction(2, 3), "b": Fraction(-5, 4), "c": Fraction(7)}
VECTORS = {
    "u": (Fraction(1, 2), Fraction(-3)),
    "v": (Fraction(2), Fraction(5, 3)),
    "w": (Fraction(-1, 7), Fraction(4)),
}
ROTATIONS = {
    "phi": (Fraction(3, 5), Fraction(4, 5)),
    "psi": (Fraction(-5, 13), Fraction(12, 13)),
}

numbers = st.fractions(-3, 3, max_denominator=4).map(lambda value: ("number", value))


def vectors(scalars: Any) -> Any:
    leaves = st.sampled_from([("vector", name) for name in VECTORS] + [("basis",)])
    return st.recursive(
        leaves,
        lambda inner: st.one_of(
            st.tuples(st.sampled_from(["vector add", "vector sub"]), inner, inner),
            st.tuples(st.sampled_from(["vector neg", "perpendicular"]), inner),
            st.tuples(st.just("turned"), st.sampled_from(list(ROTATIONS)), inner),
            st.tuples(st.just("scaled"), scalars, inner),
        ),
        max_leaves=5,
    )


simple = st.one_of(numbers, st.sampled_from([("symbol", name) for name in SCALARS]))
vector_recipes = vectors(simple)
scalar_recipes = st.recursive(
    st.one_of(simple, st.tuples(st.just("dot"), vector_recipes, vector_recipes)),
    lambda inner: st.one_of(
        st.tuples(st.sampled_from(["add", "sub", "mul"]), inner, inner),
        st.tuples(st.just("neg"), inner),
        st.tuples(st.just("pow"), inner, st.integers(0, 3)),
    ),
    max_leaves=6,
)

BUILD: dict[str, Callable[..., Any]] = {
    "number": Number,
    "symbol": Symbol,
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "neg": lambda a: -a,
    "pow": lambda a, exponent: a**exponent,
    "dot": dot,
    "vector": VectorSymbol,
    "basis": Basis,
    "vector add": lambda u, v: u + v,
    "vector sub": lambda u, v: u - v,
    "vector neg": lambda u: -u,
    "perpendicular": perpendicular,
    "turned": lambda angle, u: turned(Symbol(angle), u),
    "scaled": scaled,
}


def turn(angle: str, u: Any) -> Any:
    cosine, sine = ROTATIONS[angle]
    return u[0] * cosine - u[1] * sine, u[0] * sine + u[1] * cosine


PLAIN: dict[str, Callable[..., Any]] = {
    **{name: BUILD[name] for name in ("add", "sub", "mul", "neg", "pow")},
    "number": lambda value: value,
    "symbol": SCALARS.__getitem__,
    "dot": lambda u, v: u[0] * v[0] + u[1] * v[1],
    "vector": VECTORS.__getitem__,
    "basis": lambda: (Fraction(1), Fraction(0)),
    "vector add": lambda u, v: (u[0] + v[0], u[1] + v[1]),
    "vector sub": lambda u, v: (u[0] - v[0], u[1] - v[1]),
    "vector neg": lambda u: (-u[0], -u[1]),
    "perpendicular": lambda u: (-u[1], u[0]),
    "turned": turn,
    "scaled": lambda a, u: (a * u[0], a * u[1]),
}


def follow(recipe: Any, steps: dict[str, Callable[..., Any]]) -> Any:
    """Carry out a recipe with one set of operations."""
    operation, *operands = recipe
    return steps[operation](
        *(follow(item, steps) if isinstance(item, tuple) else item for item in operands)
    )


class ExactEnvironment:
    """Leaves as fractions."""

    def number(self, value: Fraction) -> Fraction:
        return value

    def pi(self) -> Fraction:
        return Fraction(22, 7)

    def symbol(self, symbol: Symbol) -> Fraction:
        return SCALARS[symbol.name]

    def vector(self, symbol: VectorSymbol) -> tuple[Fraction, Fraction]:
        return VECTORS[symbol.name]

    def time_function(self, function: TimeFunction) -> Fraction:
        raise AssertionError(f"{function} is not in these recipes")

    def profile(self, profile: ProfileFunction) -> Fraction:
        raise AssertionError(f"{profile} is not in these recipes")

    def entries(self, rotation: Rotation, expand: Expansion) -> tuple[Fraction, Fraction]:
        del expand
        (angle,) = rotation.coordinates
        assert isinstance(angle, Symbol)
        return ROTATIONS[angle.name]

    def call(self, function: str, value: Fraction) -> Fraction:
        raise AssertionError(f"{function} of {value} is not in these recipes")


@dataclass(frozen=True)
class Recipes:
    """Strategies, and both ways to carry out what they give."""

    scalars: Any = scalar_recipes
    vectors: Any = vector_recipes

    def build(self, recipe: Any) -> Any:
        """Return the expression that the constructors make."""
        return follow(recipe, BUILD)

    def plain(self, recipe: Any) -> Any:
        """Return the value, worked out without the calculus."""
        return follow(recipe, PLAIN)

    def value(self, expression: Expression) -> Any:
        """Return the exact value of an expression."""
        components = Expansion(ExactEnvironment()).components(expression)
        return components if isinstance(expression, Vector) else components[0]


@pytest.fixture(scope="session")
def recipes() -> Recipes:
    """Random expressions of the calculus."""
    return Recipes()

"""Scalars, vectors and rotated vectors: the nodes of a constraint as the textbook writes it.

An expression is a small immutable tree. The functions below build one and keep it tidy (flat sums,
numeric coefficients in front, zeros dropped), so that a derivative reads like one written by hand.
How many components a vector has is the business of its leaves; how a frame turns a vector is that
of its rotation.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, overload

if TYPE_CHECKING:
    from collections.abc import Callable

Value = Any
"""A number, a SymPy expression, a node of code: what adds and multiplies."""
Components = tuple[Value, ...]


class Scalar:
    """A scalar expression."""

    __slots__ = ()

    def __add__(self, other: ScalarLike) -> Scalar:
        return sum_of((self, as_scalar(other)))

    def __radd__(self, other: ScalarLike) -> Scalar:
        return sum_of((as_scalar(other), self))

    def __sub__(self, other: ScalarLike) -> Scalar:
        return sum_of((self, -as_scalar(other)))

    def __rsub__(self, other: ScalarLike) -> Scalar:
        return sum_of((as_scalar(other), -self))

    def __neg__(self) -> Scalar:
        return product_of((Number(Fraction(-1)), self))

    @overload
    def __mul__(self, other: ScalarLike) -> Scalar: ...
    @overload
    def __mul__(self, other: Vector) -> Vector: ...
    def __mul__(self, other: ScalarLike | Vector) -> Expression:
        if isinstance(other, Vector):
            return scaled(self, other)
        return product_of((self, as_scalar(other)))

    def __rmul__(self, other: ScalarLike) -> Scalar:
        return product_of((as_scalar(other), self))

    def __truediv__(self, other: ScalarLike) -> Scalar:
        return product_of((self, as_scalar(other) ** -1))

    def __pow__(self, exponent: int) -> Scalar:
        return power_of(self, exponent)


class Vector:
    """An expression whose value is a vector."""

    __slots__ = ()

    def __add__(self, other: Vector) -> Vector:
        return vector_sum((self, other))

    def __sub__(self, other: Vector) -> Vector:
        return vector_sum((self, -other))

    def __neg__(self) -> Vector:
        return scaled(Number(Fraction(-1)), self)

    def __rmul__(self, factor: ScalarLike) -> Vector:
        return scaled(as_scalar(factor), self)


Expression = Scalar | Vector
ScalarLike = Scalar | int | Fraction


@dataclass(frozen=True, slots=True)
class Number(Scalar):
    """An exact number."""

    value: Fraction


@dataclass(frozen=True, slots=True)
class Symbol(Scalar):
    """A named scalar: an angle, a contact parameter, a rate or a scalar attribute."""

    name: str
    size: ClassVar[int] = 1


@dataclass(frozen=True, slots=True)
class TimeFunction(Scalar):
    """The value C(t) of a constraint, or its time derivative of the given order."""

    name: str
    order: int = 0


@dataclass(frozen=True, slots=True)
class ProfileFunction(Scalar):
    """The polar radius rho(alpha) of a cam, or its derivative of the given order."""

    name: str
    argument: Symbol
    order: int = 0


@dataclass(frozen=True, slots=True)
class Pi(Scalar):
    """The number pi."""


@dataclass(frozen=True, slots=True)
class Sum(Scalar):
    """A sum of scalars; the empty sum is zero."""

    terms: tuple[Scalar, ...]


@dataclass(frozen=True, slots=True)
class Product(Scalar):
    """A product of scalars, its number first."""

    factors: tuple[Scalar, ...]


@dataclass(frozen=True, slots=True)
class Power(Scalar):
    """An integer power."""

    base: Scalar
    exponent: int


@dataclass(frozen=True, slots=True)
class Norm(Scalar):
    """The length of a vector."""

    vector: Vector


@dataclass(frozen=True, slots=True)
class Root(Scalar):
    """The square root of a scalar."""

    square: Scalar


@dataclass(frozen=True, slots=True)
class Circular(Scalar):
    """Cosine (``"cos"``) or sine of an angle that is no coordinate."""

    name: str
    argument: Scalar


@dataclass(frozen=True, slots=True)
class Angle(Scalar):
    """The angle of the point (cosine, sine) of the plane, in (-pi, pi]."""

    sine: Scalar
    cosine: Scalar


@dataclass(frozen=True, slots=True)
class Dot(Scalar):
    """The scalar product u^T v."""

    left: Vector
    right: Vector


@dataclass(frozen=True, slots=True)
class VectorSymbol(Vector):
    """A named vector: a position r_i, its rate, a body-fixed point s_i or direction v_i."""

    name: str
    size: int = 2


@dataclass(frozen=True, slots=True)
class Basis(Vector):
    """The unit vector along an axis, e_x by default."""

    axis: int = 0
    size: int = 2


class Rotation(Protocol):
    """How a frame turns vectors: its rotation matrix A as a function of orientation coordinates.

    The calculus asks it for nothing else, so another description of an orientation (Euler
    parameters, with a row ``p^T p - 1`` of their own) is another class beside
    `kincompile.calculus.rotations.PlaneRotation`.
    """

    letters: ClassVar[str]
    """How A and its derivatives are printed, by order."""
    names: ClassVar[tuple[str, ...]]
    symbols: ClassVar[tuple[str, ...]]
    """Names and symbols of the entries."""
    formula: ClassVar[str]
    """A in them or in the coordinates, for a comment."""

    @property
    def coordinates(self) -> tuple[Expression, ...]:
        """What A depends on."""

    @property
    def constraints(self) -> tuple[Scalar, ...]:
        """Equations among the coordinates themselves."""

    def tidy(self, vector: Vector, along: tuple[Expression, ...]) -> Vector:
        """Return the derivative of A v in some directions in its shortest form.

        It is linear in every direction, and the vector is neither a sum nor a multiple.
        """

    def entries(
        self, coordinates: tuple[Components, ...], call: Callable[[str, Value], Value]
    ) -> Components:
        """Return the numbers that all vectors turned by A share.

        `call` gives an elementary function, ``"cos"`` for instance, of a number.
        """

    def components(
        self,
        entries: Components,
        vector: Components,
        along: tuple[Components, ...],
        expand: Callable[[Expression], Components],
    ) -> Components:
        """Return the components of a turned vector, all of them given as components.

        `expand` gives those of a coordinate, where the entries are not enough.
        """


@dataclass(frozen=True, slots=True)
class Rotated(Vector):
    """A vector turned by a rotation matrix A, or by a directional derivative of A."""

    rotation: Rotation
    vector: Vector
    # The directions in which A is differentiated: none for ``A v``.
    along: tuple[Expression, ...] = ()

    @property
    def order(self) -> int:
        """How many times A is differentiated."""
        return len(self.along)


@dataclass(frozen=True, slots=True)
class RotationSlope(Vector):
    """B(p, v), the derivative of A v by Euler parameters p: a matrix, where it is shown.

    With `is_small` it is A v~, minus the derivative by a small rotation about the body's axes.
    """

    rotation: Rotation
    vector: Vector
    is_small: bool = False


@dataclass(frozen=True, slots=True)
class RowOfSlope(Vector):
    """left^T B(p, v): a row, where it is shown."""

    left: Vector
    slope: RotationSlope


@dataclass(frozen=True, slots=True)
class Perpendicular(Vector):
    """R vector: a vector of the plane turned by a right angle, counterclockwise."""

    vector: Vector


@dataclass(frozen=True, slots=True)
class Cross(Vector):
    """The vector product left~ right."""

    left: Vector
    right: Vector


@dataclass(frozen=True, slots=True)
class TimesG(Vector):
    """G(p) v of a v with four components, or G(p)^T v of one with three; G = [-e, -e~ + e0 I]."""

    p: Vector
    vector: Vector
    is_transposed: bool = False


@dataclass(frozen=True, slots=True)
class VectorSum(Vector):
    """A sum of vectors; the empty sum is the zero vector."""

    terms: tuple[Vector, ...]


@dataclass(frozen=True, slots=True)
class Scaled(Vector):
    """A scalar times a vector."""

    factor: Scalar
    vector: Vector


ZERO = Number(Fraction(0))
ONE = Number(Fraction(1))
ZERO_VECTOR = VectorSum(())


def as_scalar(value: ScalarLike) -> Scalar:
    """Return a number as an expression, an expression as it is."""
    return value if isinstance(value, Scalar) else Number(Fraction(value))


def split_coefficient(scalar: Scalar) -> tuple[Fraction, tuple[Scalar, ...]]:
    """Return the number in front of a term and its other factors."""
    if isinstance(scalar, Number):
        return scalar.value, ()
    if isinstance(scalar, Product):
        first = scalar.factors[0]
        if isinstance(first, Number):
            return first.value, scalar.factors[1:]
        return Fraction(1), scalar.factors
    return Fraction(1), (scalar,)


def sum_of(terms: tuple[Scalar, ...]) -> Scalar:
    """Add scalars: flat, like terms together, in the order of their first appearance."""
    collected: dict[tuple[Scalar, ...], Fraction] = {}
    for term in terms:
        for part in term.terms if isinstance(term, Sum) else (term,):
            coefficient, factors = split_coefficient(part)
            collected[factors] = collected.get(factors, Fraction(0)) + coefficient
    kept = tuple(
        product_of((Number(number), *factors)) for factors, number in collected.items() if number
    )
    if not kept:
        return ZERO
    return kept[0] if len(kept) == 1 else Sum(kept)


def product_of(factors: tuple[Scalar, ...]) -> Scalar:
    """Multiply scalars: flat, one number in front, equal bases as one power."""
    number = Fraction(1)
    exponents: dict[Scalar, int] = {}
    for factor in factors:
        coefficient, rest = split_coefficient(factor)
        number *= coefficient
        for part in rest:
            base, exponent = (part.base, part.exponent) if isinstance(part, Power) else (part, 1)
            exponents[base] = exponents.get(base, 0) + exponent
    if not number:
        return ZERO
    rest = tuple(power_of(base, exponent) for base, exponent in exponents.items() if exponent)
    if not rest:
        return Number(number)
    if number == 1:
        return rest[0] if len(rest) == 1 else Product(rest)
    if len(rest) == 1 and isinstance(rest[0], Sum):
        return sum_of(tuple(product_of((Number(number), term)) for term in rest[0].terms))
    return Product((Number(number), *rest))


def power_of(base: Scalar, exponent: int) -> Scalar:
    """Raise a scalar to an integer power."""
    if exponent == 0:
        return ONE
    if exponent == 1:
        return base
    if isinstance(base, Number):
        return Number(base.value**exponent)
    if isinstance(base, Power):
        return power_of(base.base, base.exponent * exponent)
    return Power(base, exponent)


def split_factor(vector: Vector) -> tuple[Scalar, Vector]:
    """Return the scalar in front of a vector and the vector without it."""
    return (vector.factor, vector.vector) if isinstance(vector, Scaled) else (ONE, vector)


def vector_sum(terms: tuple[Vector, ...]) -> Vector:
    """Add vectors: flat, like vectors together, in the order of their first appearance."""
    collected: dict[Vector, Scalar] = {}
    for term in terms:
        for part in term.terms if isinstance(term, VectorSum) else (term,):
            factor, vector = split_factor(part)
            collected[vector] = collected.get(vector, ZERO) + factor
    kept = tuple(scaled(factor, vector) for vector, factor in collected.items() if factor != ZERO)
    return kept[0] if len(kept) == 1 else VectorSum(kept)


def scaled(factor: Scalar, vector: Vector) -> Vector:
    """Multiply a vector by a scalar; a number goes into the terms of a sum."""
    inner, vector = split_factor(vector)
    factor = factor * inner
    if factor == ZERO:
        return ZERO_VECTOR
    if factor == ONE:
        return vector
    if isinstance(vector, VectorSum) and isinstance(factor, Number):
        return vector_sum(tuple(scaled(factor, term) for term in vector.terms))
    return Scaled(factor, vector) if vector != ZERO_VECTOR else ZERO_VECTOR


def rotated(rotation: Rotation, vector: Vector, along: tuple[Expression, ...] = ()) -> Vector:
    """Return a vector turned by A, or by its derivative in some directions: linear in all."""
    factor, vector = split_factor(vector)
    if isinstance(vector, VectorSum):
        parts = tuple(rotated(rotation, term, along) for term in vector.terms)
        return scaled(factor, vector_sum(parts))
    if any(item in (ZERO, ZERO_VECTOR) for item in along):
        return ZERO_VECTOR
    return scaled(factor, rotation.tidy(vector, along))


def perpendicular(vector: Vector) -> Vector:
    """Return R vector."""
    factor, vector = split_factor(vector)
    if isinstance(vector, VectorSum):
        return scaled(factor, vector_sum(tuple(perpendicular(term) for term in vector.terms)))
    if isinstance(vector, Perpendicular):
        return scaled(-factor, vector.vector)
    if isinstance(vector, Rotated):
        # In the plane R A is the derivative of A by its angle.
        return scaled(factor, rotated(vector.rotation, vector.vector, (*vector.along, ONE)))
    return scaled(factor, Perpendicular(vector))


def cross(left: Vector, right: Vector) -> Vector:
    """Return left~ right, scalar factors in front."""
    first, left = split_factor(left)
    second, right = split_factor(right)
    if left == right or ZERO_VECTOR in (left, right):
        return ZERO_VECTOR
    return scaled(first * second, Cross(left, right))


def dot(left: Vector, right: Vector) -> Scalar:
    """Return left^T right, scalar factors in front."""
    first, left = split_factor(left)
    second, right = split_factor(right)
    if ZERO_VECTOR in (left, right):
        return ZERO
    return first * second * Dot(left, right)

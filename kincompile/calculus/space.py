"""Frames in space: a position r and Euler parameters p = (e0, e1, e2, e3)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, ClassVar

from kincompile.calculus.expressions import (
    Basis,
    Number,
    Rotated,
    Scalar,
    TimesG,
    VectorSymbol,
    cross,
    dot,
    rotated,
    scaled,
    split_factor,
    sum_of,
)
from kincompile.calculus.symbols import Frame
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from kincompile.calculus.expressions import (
        Components,
        Expression,
        Rotation,
        Value,
        Vector,
    )
    from kincompile.calculus.symbols import Change, CoordinateSymbol


@dataclass(frozen=True, slots=True)
class EulerRotation:
    """The rotation by Euler parameters, A = (e0^2 - e^T e) I + 2 e e^T + 2 e0 e~.

    This is A = E G^T of Haug, chapter 9: homogeneous of degree 2 in p. So A v is a symmetric
    bilinear form of p and p, its derivative along w is twice that form of p and w, and its second
    derivative along w and u twice that of w and u; a third is zero. `is_back` is the rotation
    back, A^T, of the conjugate parameters.
    """

    p: VectorSymbol
    is_back: bool = False

    letters: ClassVar[str] = "ABB"
    formula: ClassVar[str] = "(e0^2 - e^T e) I + 2 e e^T + 2 e0 e~"
    names: ClassVar[tuple[str, ...]] = tuple(f"A{row}{column}" for row in "123" for column in "123")
    symbols: ClassVar[tuple[str, ...]] = names

    @property
    def coordinates(self) -> tuple[Expression, ...]:
        """The Euler parameters."""
        return (self.p,)

    @property
    def constraints(self) -> tuple[Scalar, ...]:
        """The norm: p^T p - 1."""
        return (dot(self.p, self.p) - 1,)

    def tidy(self, vector: Vector, along: tuple[Expression, ...]) -> Vector:
        """Return the derivative of A v with its directions, which may change places, in order.

        Along p_dot = G^T omega'/2 it is A omega'~ v.
        """
        if len(along) == 1 and not isinstance(along[0], Scalar):
            factor, change = split_factor(along[0])
            if isinstance(change, TimesG) and change.p == self.p and change.is_transposed:
                return scaled(2 * factor, rotated(self, cross(change.vector, vector)))
        return Rotated(self, vector, tuple(sorted(along, key=repr)))

    def entries(
        self, coordinates: tuple[Components, ...], call: Callable[[str, Value], Value]
    ) -> Components:
        """Return the nine entries of A, row by row."""
        del call
        (p,) = coordinates
        twice = _twice(p)
        pairs = (p[i] * twice[k] for i, k in _PAIRS)
        return _matrix([item**2 for item in p], pairs, self.is_back)

    def components(
        self,
        entries: Components,
        vector: Components,
        along: tuple[Components, ...],
        expand: Callable[[Expression], Components],
    ) -> Components:
        """Return A v, or its derivative: twice the form of p and a direction, or of two."""
        if along:
            p, w = along if len(along) == 2 else (expand(self.p), *along)
            entries = _slopes(p, w, self.is_back)
        rows = entries[:3], entries[3:6], entries[6:]
        return tuple(_dot(row, vector) for row in rows)


_PAIRS = tuple(itertools.combinations(range(4), 2))


def _slopes(p: Components, w: Components, is_back: bool) -> Components:
    """Return the derivative of A along w, twice the form of p and w, row by row."""
    twice = _twice(w)
    if p is w:
        doubled = _twice(twice)
        pairs = (p[i] * doubled[k] for i, k in _PAIRS)
    else:
        pairs = (p[i] * twice[k] + twice[i] * p[k] for i, k in _PAIRS)
    return _matrix([a * b for a, b in zip(p, twice, strict=True)], pairs, is_back)


def _matrix(squares: Sequence[Value], pairs: Iterable[Value], is_back: bool) -> Components:
    """Return the matrix of the form: squares e_i e_i, and pairs 2 e_i e_k in the order of i, k."""
    p00, p11, p22, p33 = squares
    p01, p02, p03, p12, p13, p23 = pairs
    if is_back:
        p01, p02, p03 = -p01, -p02, -p03
    same, other = p00 - p33, p11 - p22
    return (
        same + other, p12 - p03, p13 + p02,
        p12 + p03, same - other, p23 - p01,
        p13 - p02, p23 + p01, p00 + p33 - (p11 + p22),
    )  # fmt: skip


def _twice(vector: Components) -> Components:
    return tuple(item + item for item in vector)


def _dot(left: Components, right: Components) -> Value:
    first, *others = (a * b for a, b in zip(left, right, strict=True))
    for item in others:
        first = first + item
    return first


@dataclass(frozen=True, slots=True)
class SpatialFrame(Frame):
    """The frame of a body in space: position r, Euler parameters p, and its rotation."""

    letters: ClassVar[tuple[str, ...]] = ("x", "y", "z", "e0", "e1", "e2", "e3")
    ground: ClassVar[tuple[int, ...]] = (0, 0, 0, 1, 0, 0, 0)
    size: ClassVar[int] = 3

    @property
    def p(self) -> VectorSymbol:
        """The Euler parameters of the body."""
        return VectorSymbol(f"p_{self.index}", 4)

    def motion(self, order: int) -> tuple[CoordinateSymbol, ...]:
        """Return r and p, or their time derivatives of the given order."""
        r, p = (rate(f"{letter}_{self.index}", order) for letter in "rp")
        return VectorSymbol(r, self.size), VectorSymbol(p, 4)

    @property
    def rotation(self) -> Rotation:
        """The rotation by p."""
        return EulerRotation(self.p)

    def turned_about(self, axis: Vector) -> Change:
        """Return p, and what it changes by in a turn at unit rate about a body-fixed axis."""
        return self.p, scaled(HALF, TimesG(self.p, axis, is_transposed=True))

    @property
    def turns(self) -> tuple[dict[Expression, Expression], ...]:
        """A turn about each of its axes."""
        return tuple(dict([self.turned_about(axis)]) for axis in AXES)

    def along_fixed_axes(self, components: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the components along the fixed axes of a vector given along its own."""
        turned = [self.A(axis) for axis in AXES]
        return tuple(
            sum_of(tuple(dot(axis, a) * x for a, x in zip(turned, components, strict=True)))
            for axis in AXES
        )


@dataclass(frozen=True, slots=True)
class TurnedFrame(SpatialFrame):
    """The frame of a body in space whose changes are small rotations: Haug's r-omega form.

    Its columns are those of r and of a small rotation pi' about the body's own axes, its rates
    r_dot and the angular velocity omega'. Formulas have p in them, which changes by
    p_dot = G^T omega'/2.
    """

    letters: ClassVar[tuple[str, ...]] = ("x", "y", "z", "pi_xi", "pi_eta", "pi_zeta")
    ground: ClassVar[tuple[int, ...]] = (0,) * 6

    def motion(self, order: int) -> tuple[CoordinateSymbol, ...]:
        """Return r and pi', or r_dot and omega', or their derivatives."""
        letter = f"omega_{self.index}" if order else f"pi_{self.index}"
        turn = rate(letter, order - 1) if order > 1 else letter
        return VectorSymbol(rate(f"r_{self.index}", order), self.size), VectorSymbol(turn, 3)

    def changed(self, coordinate: CoordinateSymbol, change: Expression) -> Change:
        """Return p with its change along a small rotation, r with its own."""
        if coordinate != self.coordinates[1]:
            return coordinate, change
        assert not isinstance(change, Scalar)
        return self.turned_about(change)


HALF = Number(Fraction(1, 2))


# Bodies i and j of a constraint, points s, vectors a, and triads f, g, h.
i, j = SpatialFrame("i"), SpatialFrame("j")
s_i, s_j, a_i, a_j, c, u = (
    VectorSymbol(name, 3) for name in ("s_i", "s_j", "a_i", "a_j", "c", "u")
)
f_i, g_i, h_i, f_j, g_j, h_j = (
    VectorSymbol(name, 3) for name in ("f_i", "g_i", "h_i", "f_j", "g_j", "h_j")
)
AXES = tuple(Basis(k, 3) for k in range(3))


def separation() -> Vector:
    """Return d = r_j + A_j s_j - r_i - A_i s_i, from the point on body i to that on body j."""
    return j.point(s_j) - i.point(s_i)

"""Rotations of the plane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from kincompile.calculus.expressions import (
    ONE,
    Perpendicular,
    Rotated,
    Scalar,
    product_of,
    rotated,
    scaled,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.calculus.expressions import Components, Expression, Value, Vector


@dataclass(frozen=True, slots=True)
class PlaneRotation:
    """The rotation by an angle in the plane, A = [[cos, -sin], [sin, cos]].

    With R = [[0, -1], [1, 0]] its derivative is B = R A, and that of B is -A, since R R = -I. So
    every turned vector is A v or B v with a scalar in front: B v has ``along == (ONE,)``.
    """

    angle: Scalar

    letters: ClassVar[str] = "AB"
    names: ClassVar[tuple[str, ...]] = ("cos", "sin")
    symbols: ClassVar[tuple[str, ...]] = ("c", "s")
    formula: ClassVar[str] = "[[c, -s], [s, c]]"
    constraints: ClassVar[tuple[Scalar, ...]] = ()

    @property
    def coordinates(self) -> tuple[Expression, ...]:
        """The angle."""
        return (self.angle,)

    def tidy(self, vector: Vector, along: tuple[Expression, ...]) -> Vector:
        """Return A v or B v with its scalars in front."""
        rates = tuple(item for item in along if isinstance(item, Scalar))
        quarters = len(along)
        if isinstance(vector, Perpendicular):
            vector, quarters = vector.vector, quarters + 1
        sign = -1 if quarters % 4 in (2, 3) else 1
        return scaled(sign * product_of(rates), Rotated(self, vector, (ONE,) * (quarters % 2)))

    def entries(
        self, coordinates: tuple[Components, ...], call: Callable[[str, Value], Value]
    ) -> Components:
        """Return cosine and sine of the angle."""
        ((angle,),) = coordinates
        return call("cos", angle), call("sin", angle)

    def components(
        self,
        entries: Components,
        vector: Components,
        along: tuple[Components, ...],
        expand: Callable[[Expression], Components],
    ) -> Components:
        """Return A v, or B v where `along` has its one."""
        del expand
        cosine, sine = entries
        x, y = vector
        x, y = x * cosine - y * sine, x * sine + y * cosine
        return (-y, x) if along else (x, y)


def turned(angle: Scalar, vector: Vector, quarters: int = 0) -> Vector:
    """Return R^quarters A(angle) vector."""
    return rotated(PlaneRotation(angle), vector, (ONE,) * quarters)

"""Relative coordinates and distances between two bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from kincompile.calculus.expressions import Basis, Expression, Perpendicular, Vector, dot
from kincompile.calculus.symbols import C, i, j, s_i, s_j
from kincompile.model.constraint import Constraint, Kind, argument


def separation() -> Vector:
    """Return d = r_j + A_j s_j - r_i - A_i s_i, from the point on body i to that on body j."""
    return j.point(s_j) - i.point(s_i)


@dataclass(frozen=True)
class RelativeX(Constraint):
    """The global x component from a point on body i to a point on body j is C.

    Parameters
    ----------
    name
        Name of the constraint; so are its equations called.
    i, j
        Bodies, or their names; one may be the ground.
    point_i, point_j
        Points (xi, eta) in the frames of i and j [length].
    value
        C [length], a number or an expression of parameters; with `t` in it, a driver.
    """

    source = "Haug 3.3"
    i: Any = argument(Kind.BODY, "i")
    point_i: Any = argument(Kind.POINT, "s_i")
    j: Any = argument(Kind.BODY, "j")
    point_j: Any = argument(Kind.POINT, "s_j")
    value: Any = argument(Kind.VALUE, "C")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_x^T d - C."""
        return (dot(Basis(), separation()) - C,)


@dataclass(frozen=True)
class RelativeY(Constraint):
    """The global y component from a point on body i to a point on body j is C.

    Parameters
    ----------
    name
        Name of the constraint; so are its equations called.
    i, j
        Bodies, or their names; one may be the ground.
    point_i, point_j
        Points (xi, eta) in the frames of i and j [length].
    value
        C [length], a number or an expression of parameters; with `t` in it, a driver.
    """

    source = "Haug 3.3"
    i: Any = argument(Kind.BODY, "i")
    point_i: Any = argument(Kind.POINT, "s_i")
    j: Any = argument(Kind.BODY, "j")
    point_j: Any = argument(Kind.POINT, "s_j")
    value: Any = argument(Kind.VALUE, "C")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_y^T d - C."""
        return (dot(Perpendicular(Basis()), separation()) - C,)


@dataclass(frozen=True)
class RelativeAngle(Constraint):
    """The angle of body j relative to body i is C.

    Parameters
    ----------
    name
        Name of the constraint; so are its equations called.
    i, j
        Bodies, or their names; one may be the ground.
    angle
        C [rad], a number or an expression of parameters; with `t` in it, a driver.
    """

    source = "Haug 3.3"
    i: Any = argument(Kind.BODY, "i")
    j: Any = argument(Kind.BODY, "j")
    angle: Any = argument(Kind.VALUE, "C")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return phi_j - phi_i - C."""
        return (j.phi - i.phi - C,)


@dataclass(frozen=True)
class Distance(Constraint):
    """The distance between a point on body i and a point on body j is C > 0: a massless coupler.

    Parameters
    ----------
    name
        Name of the constraint; so are its equations called.
    i, j
        Bodies, or their names; one may be the ground.
    point_i, point_j
        Points (xi, eta) in the frames of i and j [length].
    distance
        C [length], a number or an expression of parameters; with `t` in it, a driver.
    """

    source = "Haug 3.3.7"
    i: Any = argument(Kind.BODY, "i")
    point_i: Any = argument(Kind.POINT, "s_i")
    j: Any = argument(Kind.BODY, "j")
    point_j: Any = argument(Kind.POINT, "s_j")
    distance: Any = argument(Kind.DISTANCE, "C")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d^T d - C^2."""
        d = separation()
        return (dot(d, d) - C**2,)

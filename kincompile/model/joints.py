"""Revolute and translational joints, and the composite joints made of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from kincompile.calculus.expressions import Expression, Norm, dot, perpendicular
from kincompile.calculus.symbols import C, i, j, s_i, s_j, v_i, v_j
from kincompile.model.constraint import Constraint, Kind, argument
from kincompile.model.relative import separation


@dataclass(frozen=True)
class Revolute(Constraint):
    """A point on body i and a point on body j coincide.

    Parameters
    ----------
    name
        Name of the joint; its equations are ``name.x`` and ``name.y``.
    i, j
        Bodies, or their names; one may be the ground.
    point_i, point_j
        Points (xi, eta) in the frames of i and j [length].
    """

    source = "Haug 3.3.10"
    row_names = ("x", "y")
    i: Any = argument(Kind.BODY, "i")
    point_i: Any = argument(Kind.POINT, "s_i")
    j: Any = argument(Kind.BODY, "j")
    point_j: Any = argument(Kind.POINT, "s_j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return r_i + A_i s_i - r_j - A_j s_j."""
        return (i.point(s_i) - j.point(s_j),)


@dataclass(frozen=True)
class Translational(Constraint):
    """Body j slides along an axis of body i without turning: the two axes stay on one line.

    Parameters
    ----------
    name
        Name of the joint; its equations are ``name.normal`` and ``name.parallel``.
    i, j
        Bodies, or their names; one may be the ground.
    point_i, point_j
        Points (xi, eta) on the two axes, in the frames of i and j [length].
    axis_i, axis_j
        Directions (xi, eta) in the frames of i and j, of any length but zero.
    """

    source = "Haug 3.3.13"
    row_names = ("normal", "parallel")
    i: Any = argument(Kind.BODY, "i")
    point_i: Any = argument(Kind.POINT, "s_i")
    axis_i: Any = argument(Kind.AXIS, "v_i")
    j: Any = argument(Kind.BODY, "j")
    point_j: Any = argument(Kind.POINT, "s_j")
    axis_j: Any = argument(Kind.AXIS, "v_j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (R A_i v_i)^T d and (R A_i v_i)^T A_j v_j."""
        normal = perpendicular(i.A(v_i))
        return dot(normal, separation()), dot(normal, j.A(v_j))


@dataclass(frozen=True)
class RevoluteTranslational(Constraint):
    """A point on body j keeps the distance C from an axis of body i, counted to its left.

    Parameters
    ----------
    name
        Name of the constraint; so are its equations called.
    i, j
        Bodies, or their names; one may be the ground.
    point_i
        Point (xi, eta) on the axis, in the frame of i [length].
    axis_i
        Direction (xi, eta) in the frame of i, of any length but zero.
    point_j
        Point (xi, eta) in the frame of j [length].
    distance
        C [length], a number or an expression of parameters; with `t` in it, a driver.
    """

    source = "Haug 3.3"
    i: Any = argument(Kind.BODY, "i")
    point_i: Any = argument(Kind.POINT, "s_i")
    axis_i: Any = argument(Kind.AXIS, "v_i")
    j: Any = argument(Kind.BODY, "j")
    point_j: Any = argument(Kind.POINT, "s_j")
    distance: Any = argument(Kind.VALUE, "C")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (R A_i v_i)^T d / |v_i| - C."""
        return (dot(perpendicular(i.A(v_i)), separation()) / Norm(v_i) - C,)


@dataclass(frozen=True)
class TranslationalDistance(Constraint):
    """A point on body j is at C along an axis of body i, counted from a point on the axis.

    Parameters
    ----------
    name
        Name of the constraint; so are its equations called.
    i, j
        Bodies, or their names; one may be the ground.
    point_i
        Point (xi, eta) on the axis, in the frame of i [length].
    axis_i
        Direction (xi, eta) in the frame of i, of any length but zero.
    point_j
        Point (xi, eta) in the frame of j [length].
    distance
        C [length], a number or an expression of parameters; with `t` in it, a driver.
    """

    source = "Haug 3.5"
    i: Any = argument(Kind.BODY, "i")
    point_i: Any = argument(Kind.POINT, "s_i")
    axis_i: Any = argument(Kind.AXIS, "v_i")
    j: Any = argument(Kind.BODY, "j")
    point_j: Any = argument(Kind.POINT, "s_j")
    distance: Any = argument(Kind.VALUE, "C")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (A_i v_i)^T d / |v_i| - C."""
        return (dot(i.A(v_i), separation()) / Norm(v_i) - C,)

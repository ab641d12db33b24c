"""Constraints between one body and the ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from kincompile.calculus.expressions import Basis, Expression, Perpendicular, dot
from kincompile.calculus.symbols import C, c, i, s_i
from kincompile.model.constraint import Constraint, Kind, argument


@dataclass(frozen=True)
class AbsoluteX(Constraint):
    """The global x coordinate of a point on a body is C.

    Parameters
    ----------
    name
        Name of the constraint; so are its equations called.
    body
        The body, or its name.
    point
        Point (xi, eta) in the body's frame [length].
    value
        C [length], a number or an expression of parameters; with `t` in it, a driver.
    """

    source = "Haug 3.2.3"
    body: Any = argument(Kind.BODY, "i")
    point: Any = argument(Kind.POINT, "s_i")
    value: Any = argument(Kind.VALUE, "C")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_x^T (r_i + A_i s_i) - C."""
        return (dot(Basis(), i.point(s_i)) - C,)


@dataclass(frozen=True)
class AbsoluteY(Constraint):
    """The global y coordinate of a point on a body is C.

    Parameters
    ----------
    name
        Name of the constraint; so are its equations called.
    body
        The body, or its name.
    point
        Point (xi, eta) in the body's frame [length].
    value
        C [length], a number or an expression of parameters; with `t` in it, a driver.
    """

    source = "Haug 3.2.4"
    body: Any = argument(Kind.BODY, "i")
    point: Any = argument(Kind.POINT, "s_i")
    value: Any = argument(Kind.VALUE, "C")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return e_y^T (r_i + A_i s_i) - C."""
        return (dot(Perpendicular(Basis()), i.point(s_i)) - C,)


@dataclass(frozen=True)
class AbsoluteAngle(Constraint):
    """The angle of a body is C.

    Parameters
    ----------
    name
        Name of the constraint; so are its equations called.
    body
        The body, or its name.
    angle
        C [rad], a number or an expression of parameters; with `t` in it, a driver.
    """

    source = "Haug 3.2.6"
    body: Any = argument(Kind.BODY, "i")
    angle: Any = argument(Kind.VALUE, "C")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return phi_i - C."""
        return (i.phi - C,)


@dataclass(frozen=True)
class AbsoluteDistance(Constraint):
    """The distance from a ground point to a point on a body is C > 0.

    Parameters
    ----------
    name
        Name of the constraint; so are its equations called.
    body
        The body, or its name.
    point
        Point (xi, eta) in the body's frame [length].
    ground_point
        Point (x, y) of the ground [length].
    distance
        C [length], a number or an expression of parameters; with `t` in it, a driver.
    """

    source = "Haug 3.2.1"
    body: Any = argument(Kind.BODY, "i")
    point: Any = argument(Kind.POINT, "s_i")
    ground_point: Any = argument(Kind.POINT, "c")
    distance: Any = argument(Kind.DISTANCE, "C")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d^T d - C^2 with d = r_i + A_i s_i - c."""
        d = i.point(s_i) - c
        return (dot(d, d) - C**2,)

"""Cams and followers.

A profile is given in polar form about its centre; the contact parameters are coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from kincompile.calculus.expressions import Expression, dot, perpendicular
from kincompile.calculus.symbols import contact_i, contact_j, i, j, s_i, s_j, v_j
from kincompile.model.constraint import CamConstraint, Kind, argument


@dataclass(frozen=True)
class CamFollower(CamConstraint):
    """Two profiles touch: a common point and a common tangent.

    Parameters
    ----------
    name
        Name of the constraint; its equations are ``name.x``, ``name.y`` and ``name.tangent``, its
        contact parameters ``alpha_i_name`` and ``alpha_j_name``.
    i, j
        Bodies, or their names; one may be the ground.
    centre_i, centre_j
        Centres (xi, eta) of the profiles in the frames of i and j [length].
    profile_i, profile_j
        Polar radius [length] about the centre: an expression of `alpha`, a function of alpha, or a
        table (angles [rad], radii) over one revolution.
    guess
        Start values of the contact parameters for Newton's method [rad], 0 if not given.
    """

    source = "Haug 3.4"
    row_names = ("x", "y", "tangent")
    contacts = (contact_i, contact_j)
    i: Any = argument(Kind.BODY, "i")
    centre_i: Any = argument(Kind.POINT, "s_i")
    profile_i: Any = argument(Kind.PROFILE, "rho_i")
    j: Any = argument(Kind.BODY, "j")
    centre_j: Any = argument(Kind.POINT, "s_j")
    profile_j: Any = argument(Kind.PROFILE, "rho_j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return r_i + A_i (s_i + a_i) - r_j - A_j (s_j + a_j) and (A_i R g_i)^T A_j g_j."""
        gap = i.point(s_i + contact_i.a) - j.point(s_j + contact_j.a)
        return gap, dot(perpendicular(i.A(contact_i.g)), j.A(contact_j.g))


@dataclass(frozen=True)
class CamFlatFollower(CamConstraint):
    """A cam (body i) touches a flat face of the follower (body j).

    Parameters
    ----------
    name
        Name of the constraint; its equations are ``name.contact`` and ``name.tangent``, its contact
        parameter ``alpha_name``.
    cam, follower
        Bodies, or their names; one may be the ground.
    centre
        Centre (xi, eta) of the profile in the cam's frame [length].
    profile
        Polar radius [length] about the centre: an expression of `alpha`, a function of alpha, or a
        table (angles [rad], radii) over one revolution.
    point
        Point (xi, eta) on the face, in the follower's frame [length].
    axis
        Direction (xi, eta) of the face in the follower's frame, of any length but zero.
    guess
        Start value of the contact parameter for Newton's method [rad], 0 if not given.
    """

    source = "Haug 3.4"
    row_names = ("contact", "tangent")
    contacts = (contact_i,)
    cam: Any = argument(Kind.BODY, "i")
    centre: Any = argument(Kind.POINT, "s_i")
    profile: Any = argument(Kind.PROFILE, "rho_i")
    follower: Any = argument(Kind.BODY, "j")
    point: Any = argument(Kind.POINT, "s_j")
    axis: Any = argument(Kind.AXIS, "v_j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (A_j R v_j)^T d and (A_j R v_j)^T A_i g_i, d from the contact to the face."""
        normal = perpendicular(j.A(v_j))
        d = j.point(s_j) - i.point(s_i + contact_i.a)
        return dot(normal, d), dot(normal, i.A(contact_i.g))


@dataclass(frozen=True)
class PointFollower(CamConstraint):
    """A point of body i runs on a profile of body j: a pin in a curved slot.

    Parameters
    ----------
    name
        Name of the constraint; its equations are ``name.x`` and ``name.y``, its contact parameter
        ``alpha_name``.
    i, j
        Bodies, or their names; one may be the ground.
    point_i
        Point (xi, eta) in the frame of i [length].
    centre_j
        Centre (xi, eta) of the profile in the frame of j [length].
    profile_j
        Polar radius [length] about the centre: an expression of `alpha`, a function of alpha, or a
        table (angles [rad], radii) over one revolution.
    guess
        Start value of the contact parameter for Newton's method [rad], 0 if not given.
    """

    source = "Haug 3.4.32"
    row_names = ("x", "y")
    contacts = (contact_j,)
    i: Any = argument(Kind.BODY, "i")
    point_i: Any = argument(Kind.POINT, "s_i")
    j: Any = argument(Kind.BODY, "j")
    centre_j: Any = argument(Kind.POINT, "s_j")
    profile_j: Any = argument(Kind.PROFILE, "rho_j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return r_i + A_i s_i - r_j - A_j (s_j + a_j)."""
        return (i.point(s_i) - j.point(s_j + contact_j.a),)

"""Cams and followers.

A profile is given in polar form about its centre; the contact parameters are coordinates.
"""

from __future__ import annotations

from kincompile.calculus.expressions import Expression, dot, perpendicular
from kincompile.calculus.symbols import contact_i, contact_j, i, j, s_i, s_j, v_j
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PointLike, ProfileLike
from kincompile.model.constraint import CamConstraint, constraint_type


@constraint_type
class CamFollower(CamConstraint):
    """Two profiles touch: a common point and a common tangent."""

    source = "Haug 3.4"
    row_names = ("x", "y", "tangent")
    contacts = (contact_i, contact_j)
    i: BodyLike = argument.body("i")
    centre_i: PointLike = argument.point("s_i", on="i", what="Centre of the profile")
    profile_i: ProfileLike = argument.profile("rho_i")
    j: BodyLike = argument.body("j")
    centre_j: PointLike = argument.point("s_j", on="j", what="Centre of the profile")
    profile_j: ProfileLike = argument.profile("rho_j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return r_i + A_i (s_i + a_i) - r_j - A_j (s_j + a_j) and (A_i R g_i)^T A_j g_j."""
        gap = i.point(s_i + contact_i.a) - j.point(s_j + contact_j.a)
        return gap, dot(perpendicular(i.A(contact_i.g)), j.A(contact_j.g))


@constraint_type
class CamFlatFollower(CamConstraint):
    """A cam (body i) touches a flat face of the follower (body j)."""

    source = "Haug 3.4"
    row_names = ("contact", "tangent")
    contacts = (contact_i,)
    cam: BodyLike = argument.body("i")
    centre: PointLike = argument.point("s_i", on="i", what="Centre of the profile")
    profile: ProfileLike = argument.profile("rho_i")
    follower: BodyLike = argument.body("j")
    point: PointLike = argument.point("s_j", on="j", what="Point of the face")
    axis: PointLike = argument.axis("v_j", on="j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return (A_j R v_j)^T d and (A_j R v_j)^T A_i g_i, d from the contact to the face."""
        normal = perpendicular(j.A(v_j))
        d = j.point(s_j) - i.point(s_i + contact_i.a)
        return dot(normal, d), dot(normal, i.A(contact_i.g))


@constraint_type
class PointFollower(CamConstraint):
    """A point of body i runs on a profile of body j: a pin in a curved slot."""

    source = "Haug 3.4.32"
    row_names = ("x", "y")
    contacts = (contact_j,)
    i: BodyLike = argument.body("i")
    point_i: PointLike = argument.point("s_i", on="i")
    j: BodyLike = argument.body("j")
    centre_j: PointLike = argument.point("s_j", on="j", what="Centre of the profile")
    profile_j: ProfileLike = argument.profile("rho_j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return r_i + A_i s_i - r_j - A_j (s_j + a_j)."""
        return (i.point(s_i) - j.point(s_j + contact_j.a),)

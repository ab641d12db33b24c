"""Cams and followers.

A profile is given in polar form about its centre; the contact parameters are coordinates.
"""

from __future__ import annotations

from kincompile.calculus.expressions import Expression, dot, perpendicular
from kincompile.calculus.symbols import contact_i, contact_j, i, j, s_i, s_j, v_j
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PlaceLike, PointLike, ProfileLike
from kincompile.model.constraint import CamConstraint, constraint_type


@constraint_type
class CamFollower(CamConstraint):
    """Two profiles touch: a common point and a common tangent."""

    source = "Haug 3.4"
    known_as = "cam with a roller, roller follower, disc cam, cam pair"
    positive = (
        "A contact angle is counted counterclockwise in the frame of its body; its guess "
        "decides which sides touch."
    )
    use = (
        'cam, roller = m.body("cam", guess=(1, 1, 0.3)), m.body("roller", guess=(2.2, 1.2, 0.5))',
        'm.add(kc.CamFollower("touch", cam, (0.2, 0), 0.8, roller, (0, 0), 0.3, guess=(0, kc.pi)))',
    )
    row_names = ("x", "y", "tangent")
    contacts = (contact_i, contact_j)
    i: BodyLike = argument.body("i")
    centre_i: PlaceLike = argument.point("s_i", on="i", what="Centre of the profile")
    profile_i: ProfileLike = argument.profile("rho_i")
    j: BodyLike = argument.body("j")
    centre_j: PlaceLike = argument.point("s_j", on="j", what="Centre of the profile")
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
    known_as = "cam with a flat follower, flat-faced follower, mushroom follower, tappet"
    positive = (
        "axis lies along the face. The contact angle is counted counterclockwise in the frame "
        "of the cam; its guess decides which side touches."
    )
    use = (
        'cam, tappet = m.body("cam", guess=(1.4, 1, 0.3)), '
        'm.body("tappet", guess=(1.6, 2.1, 0.05))',
        'm.add(kc.CamFlatFollower("touch", cam, (0.2, 0), 0.8, tappet, (0, 0), (1, 0), guess=1.2))',
    )
    row_names = ("contact", "tangent")
    contacts = (contact_i,)
    cam: BodyLike = argument.body("i")
    centre: PlaceLike = argument.point("s_i", on="i", what="Centre of the profile")
    profile: ProfileLike = argument.profile("rho_i")
    follower: BodyLike = argument.body("j")
    point: PlaceLike = argument.point("s_j", on="j", what="Point of the face")
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
    known_as = "pin in a curved slot, cam groove, cam track, knife-edge follower"
    positive = "The contact angle is counted counterclockwise in the frame of body j."
    use = (
        'lever, disc = m.body("lever", guess=(2.6, 1.5, 0.4)), m.body("disc", guess=(1, 1, 0.3))',
        'm.add(kc.PointFollower("groove", lever, (-0.7, 0), disc, (0, 0), '
        "0.9 + sympy.cos(2 * kc.alpha) / 7))",
    )
    row_names = ("x", "y")
    contacts = (contact_j,)
    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")
    j: BodyLike = argument.body("j")
    centre_j: PlaceLike = argument.point("s_j", on="j", what="Centre of the profile")
    profile_j: ProfileLike = argument.profile("rho_j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return r_i + A_i s_i - r_j - A_j (s_j + a_j)."""
        return (i.point(s_i) - j.point(s_j + contact_j.a),)

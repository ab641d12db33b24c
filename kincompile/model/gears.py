"""Gears, and rack and pinion."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.calculus.expressions import Expression, Norm, Pi, dot, perpendicular
from kincompile.calculus.symbols import R_i, R_j, i, j, s_j, s_P, s_Q, theta_i, theta_j, unit
from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PlaceLike, ValueLike
from kincompile.model.constraint import Constraint, constraint_type
from kincompile.model.relative import separation

if TYPE_CHECKING:
    from kincompile.model.constraint import Numbers


@constraint_type
class Gear(Constraint):
    """Two gears roll on each other; a negative radius is an internal gear.

    The distance of the centres is a constraint of its own. Phi is also zero with the gears on
    opposite sides of each other: the guess decides.
    """

    source = "Haug 3.4.1"
    known_as = "gear pair, spur gears, gear wheels, planetary gear, ring gear, friction wheels"
    positive = (
        "Two positive radii are external gears, which turn opposite ways; a negative radius "
        "is an internal gear."
    )
    use = (
        'small, large = m.body("small", guess=(0.8, 1, 0.4)), m.body("large", guess=(2.3, 1, 0.2))',
        'm.add(kc.Gear("mesh", small, (0, 0), 0.5, 0, large, (0, 0), 1, kc.pi))',
    )
    i: BodyLike = argument.body("i")
    centre_i: PlaceLike = argument.point("s_i", on="i", what="Centre")
    radius_i: ValueLike = argument.radius("R_i")
    theta_i: ValueLike = argument.angle("theta_i", on="i", what="that points at the other gear")
    j: BodyLike = argument.body("j")
    centre_j: PlaceLike = argument.point("s_j", on="j", what="Centre")
    radius_j: ValueLike = argument.radius("R_j")
    theta_j: ValueLike = argument.angle("theta_j", on="j", what="that points back at the same time")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d^T R u(theta), theta the direction of the centre line that rolling asks for."""
        rolled = R_i * (i.phi + theta_i) + R_j * (j.phi + theta_j) - R_j * Pi()
        return (dot(separation(), perpendicular(unit(rolled / (R_i + R_j)))),)

    @staticmethod
    def problem(numbers: Numbers) -> str | None:
        """Return the problem of two radii that add to zero."""
        (first,), (second,) = numbers("R_i"), numbers("R_j")
        if first is None or second is None or first + second != 0:
            return None
        return (
            f"the radii {first:g} and {second:g} add to zero; an internal gear needs two different "
            "radii"
        )


@constraint_type
class RackAndPinion(Constraint):
    """A pinion (body j) rolls on the pitch line of a rack (body i).

    The pinion is to the left of the line from P to Q.
    """

    source = "Haug 3.4"
    known_as = "rack, pinion, rolling wheel, wheel that rolls without slipping"
    positive = (
        "The pinion is to the left of the line from P to Q; rolling from P to Q it turns "
        "clockwise against the rack."
    )
    use = (
        'rack, pinion = m.body("rack", guess=(1.6, 0.5, 0.1)), '
        'm.body("pinion", guess=(1.9, 1.1, 0.6))',
        'm.add(kc.RackAndPinion("mesh", rack, (-1.2, 0), (1.2, 0), 0, pinion, (0, 0), 0.6, '
        "-kc.pi / 2))",
    )
    row_names = ("roll", "pitch")
    rack: BodyLike = argument.body("i")
    point_p: PlaceLike = argument.point("s_P", on="i", what="Point P of the pitch line")
    point_q: PlaceLike = argument.point("s_Q", on="i", what="Point Q of the pitch line")
    theta_rack: ValueLike = argument.angle("theta_i", on="i", what="of the line from P to Q")
    pinion: BodyLike = argument.body("j")
    centre: PlaceLike = argument.point("s_j", on="j", what="Centre")
    radius: ValueLike = argument.radius("R_j")
    theta_pinion: ValueLike = argument.angle(
        "theta_j", on="j", what="of the radius that meets the line where the pinion is at Q"
    )

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d_Q^T A_i v - L R_j angle and d_P^T R A_i v - L R_j, v from P to Q, L = |v|."""
        v = s_Q - s_P
        pitch_line = i.A(v)
        reach = Norm(v) * R_j
        angle = i.phi + theta_i - j.phi - theta_j + 3 * Pi() / 2
        from_q = j.point(s_j) - i.point(s_Q)
        from_p = j.point(s_j) - i.point(s_P)
        return (
            dot(from_q, pitch_line) - reach * angle,
            dot(from_p, perpendicular(pitch_line)) - reach,
        )

    @staticmethod
    def problem(numbers: Numbers) -> str | None:
        """Return what is wrong with a pitch line through one point."""
        p = numbers("s_P")
        if p != numbers("s_Q") or None in p:
            return None
        return "point_p and point_q are equal; two different points fix the pitch line"

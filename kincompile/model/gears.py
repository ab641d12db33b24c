"""Gears, and rack and pinion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from kincompile.calculus.expressions import Expression, Norm, Pi, dot, perpendicular
from kincompile.calculus.symbols import R_i, R_j, i, j, s_j, s_P, s_Q, theta_i, theta_j, unit
from kincompile.model.constraint import Constraint, Kind, argument
from kincompile.model.relative import separation


@dataclass(frozen=True)
class Gear(Constraint):
    """Two gears roll on each other; a negative radius is an internal gear.

    The distance of the centres is a constraint of its own. Phi is also zero with the gears on
    opposite sides of each other: the guess decides.

    Parameters
    ----------
    name
        Name of the constraint; so are its equations called.
    i, j
        Bodies, or their names; one may be the ground.
    centre_i, centre_j
        Centres (xi, eta) in the frames of i and j [length].
    radius_i, radius_j
        Pitch radii [length], numbers or expressions of parameters, not zero.
    theta_i, theta_j
        Directions [rad] in the frames of i and j that point at the other gear together.
    """

    source = "Haug 3.4.1"
    i: Any = argument(Kind.BODY, "i")
    centre_i: Any = argument(Kind.POINT, "s_i")
    radius_i: Any = argument(Kind.RADIUS, "R_i")
    theta_i: Any = argument(Kind.SCALAR, "theta_i")
    j: Any = argument(Kind.BODY, "j")
    centre_j: Any = argument(Kind.POINT, "s_j")
    radius_j: Any = argument(Kind.RADIUS, "R_j")
    theta_j: Any = argument(Kind.SCALAR, "theta_j")

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return d^T R u(theta), theta the direction of the centre line that rolling asks for."""
        rolled = R_i * (i.phi + theta_i) + R_j * (j.phi + theta_j) - R_j * Pi()
        return (dot(separation(), perpendicular(unit(rolled / (R_i + R_j)))),)


@dataclass(frozen=True)
class RackAndPinion(Constraint):
    """A pinion (body j) rolls on the pitch line of a rack (body i).

    Parameters
    ----------
    name
        Name of the constraint; its equations are ``name.roll`` and ``name.pitch``.
    rack, pinion
        Bodies, or their names; one may be the ground.
    point_p, point_q
        Two points (xi, eta) on the pitch line, in the rack's frame [length]. The pinion is to the
        left of the line from P to Q.
    theta_rack, theta_pinion
        Directions [rad] in the two frames: of the line from P to Q, and of the pinion's radius that
        meets the line where the pinion is at Q.
    centre
        Centre of the pinion (xi, eta) in its frame [length].
    radius
        Pitch radius of the pinion [length], not zero.
    """

    source = "Haug 3.4"
    row_names = ("roll", "pitch")
    rack: Any = argument(Kind.BODY, "i")
    point_p: Any = argument(Kind.POINT, "s_P")
    point_q: Any = argument(Kind.POINT, "s_Q")
    theta_rack: Any = argument(Kind.SCALAR, "theta_i")
    pinion: Any = argument(Kind.BODY, "j")
    centre: Any = argument(Kind.POINT, "s_j")
    radius: Any = argument(Kind.RADIUS, "R_j")
    theta_pinion: Any = argument(Kind.SCALAR, "theta_j")

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

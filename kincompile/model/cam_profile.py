r"""The profile of a cam from the law of its follower.

Seen from the cam, the follower runs around it clockwise while the cam turns counterclockwise. Its
roller, or its flat face, sweeps a family of circles or lines, and the cam is their envelope: with
the path z of the roller's centre as a complex number, the touching point is z - i r z'/|z'|, and
with the distance h of the face from the cam's centre it is i h + h', both in the follower's frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.errors import ModelError
from kincompile.model.expressions import (
    NotAnExpressionError,
    as_expression,
    as_sympy,
    in_radians,
    smoothness_problem,
    t,
    unknown_problem,
)
from kincompile.model.laws import MotionLaw
from kincompile.model.spline import PeriodicSpline

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.model.expressions import Scalar

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

POINTS = 720
"""Angles of the cam at which a profile is computed: every half degree."""

FEWEST = 12
"""Of these at least."""

MOST = 100_000
"""And at most."""

CLOSED = 1e-9
"""How far a law may be from closing after one revolution, relative to its largest value."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CamProfile:
    """A cam computed from the law of its follower.

    Attributes
    ----------
    angle : ndarray, shape (N,)
        Angle of the cam [rad], over one revolution.
    points : ndarray, shape (N, 2)
        Where the cam touches the follower then, in the frame of the cam.
    pressure_angle : ndarray, shape (N,)
        From the follower's motion to the normal of the contact [rad]; zero for a flat face.
    radius_of_curvature : ndarray, shape (N,)
        Of the profile: positive where it is convex, negative where it is hollow.
    undercut : tuple of (float, float)
        Angles of the cam between which the envelope turns back and cuts away what it has shaped.
    """

    angle: Array
    points: Array
    pressure_angle: Array
    radius_of_curvature: Array
    undercut: tuple[tuple[float, float], ...]

    @property
    def table(self) -> tuple[list[float], list[float]]:
        """The profile in polar form, (angles, radii), as `CamFollower` and its like take it.

        Raises
        ------
        ModelError
            If the cam is undercut, or a ray from its centre meets it more than once.
        """
        if self.undercut:
            raise ModelError(f"{self._undercut()}; take a larger base circle, or a smaller roller")
        z = self.points[::-1] @ np.array([1, 1j])
        polar = np.unwrap(np.angle(z))
        if not (np.diff(polar) > 0).all():
            k = int(np.argmin(np.diff(polar)))
            raise ModelError(
                f"near the cam angle {self.angle[::-1][k]:.4g} rad a ray from the centre meets the "
                "profile more than once, and it has no polar form; take a larger base circle"
            )
        return polar.tolist(), np.abs(z).tolist()

    def _undercut(self) -> str:
        places = ", ".join(f"{np.degrees(a):.4g} to {np.degrees(b):.4g}" for a, b in self.undercut)
        return f"the cam is undercut at cam angles of {places} degrees"

    def __repr__(self) -> str:
        """Return the pressure angle, the radii of curvature, and whether it is undercut."""
        steep = int(np.abs(self.pressure_angle).argmax())
        lines = [
            f"largest pressure angle: {np.degrees(self.pressure_angle[steep]):.4g} degrees "
            f"at a cam angle of {np.degrees(self.angle[steep]):.4g} degrees"
        ]
        for kind, sign in (("convex", 1), ("hollow", -1)):
            radii = np.where(
                sign * self.radius_of_curvature > 0, abs(self.radius_of_curvature), np.inf
            )
            if np.isfinite(least := radii.min()):
                place = np.degrees(self.angle[radii.argmin()])
                lines.append(
                    f"least radius of curvature, {kind}: {least:.6g} at {place:.4g} degrees"
                )
        return "\n".join([*lines, self._undercut() if self.undercut else "no undercut"])


def roller_cam(
    lift: Scalar, base: float, roller: float, *, offset: float = 0.0, points: int = POINTS
) -> CamProfile:
    """Return the cam that lifts a roller along a straight line.

    Parameters
    ----------
    lift
        A motion with the cam's angle [rad] in the place of `t`, for instance a
        `kc.motion.sequence` of angles from 0 to 2 pi: how far the roller is above its lowest place.
    base, roller
        Radii of the base circle and of the roller.
    offset
        The roller moves along x = offset, upwards, in a frame with the cam's centre for its origin.
    points
        Number of angles, equally spaced over one revolution.

    Raises
    ------
    ModelError
        With everything that is wrong; a law that does not close, for one.
    """
    numbers = {"base": base, "roller": roller}
    angle, (s, s1, s2) = _law(lift, points, numbers, {"offset": offset})
    if base + roller <= abs(offset):
        raise ModelError(f"cam: the offset {offset:g} lies beyond the roller on the base circle")
    height = s + np.sqrt((base + roller) ** 2 - offset**2)
    return _around_roller(angle, (offset + 1j * height, 1j * s1, 1j * s2), roller, 1j)


def oscillating_cam(
    swing: Scalar,
    pivot: Sequence[float],
    arm: float,
    roller: float,
    *,
    points: int = POINTS,
) -> CamProfile:
    """Return the cam that swings an arm with a roller at its end.

    Parameters
    ----------
    swing
        The angle of the arm [rad] against the x axis, with the cam's angle in the place of `t`.
    pivot
        Point (x, y) about which the arm turns; the cam's centre is the origin.
    arm, roller
        Length of the arm and radius of the roller.
    points
        Number of angles, equally spaced over one revolution.

    Raises
    ------
    ModelError
        With everything that is wrong.
    """
    if not isinstance(pivot, tuple | list) or len(pivot) != 2:
        raise ModelError(f"cam: pivot is {pivot!r}: give a point (x, y)")
    x, y = pivot
    angle, (psi, psi1, psi2) = _law(swing, points, {"arm": arm, "roller": roller}, {"x": x, "y": y})
    turned = np.exp(1j * psi)
    w = x + 1j * y + arm * turned
    rates = arm * 1j * psi1 * turned, arm * (1j * psi2 - psi1**2) * turned
    return _around_roller(angle, (w, *rates), roller, 1j * turned)


def flat_cam(lift: Scalar, base: float, *, points: int = POINTS) -> CamProfile:
    """Return the cam that lifts a flat face, which is square to its straight motion.

    Parameters
    ----------
    lift
        A motion with the cam's angle [rad] in the place of `t`: how far the face is above the base
        circle.
    base
        Radius of the base circle.
    points
        Number of angles, equally spaced over one revolution.

    Raises
    ------
    ModelError
        With everything that is wrong.
    """
    angle, (s, s1, s2) = _law(lift, points, {"base": base}, {})
    touching = (s1 + 1j * (base + s)) * np.exp(-1j * angle)
    return _profile(angle, touching, np.zeros(angle.size), base + s + s2)


def _around_roller(
    angle: Array, centre: Sequence[NDArray[Any]], roller: float, direction: Any
) -> CamProfile:
    """Return the envelope of the circles about a centre, given with two derivatives by the angle.

    The direction is that of the follower's motion, a complex number of size 1.
    """
    w, w1, w2 = centre
    back = np.exp(-1j * angle)
    z1 = back * (w1 - 1j * w)
    z2 = back * (w2 - 2j * w1 - w)
    outward = 1j * z1 / np.abs(z1)
    curvature = -np.imag(np.conj(z1) * z2) / np.abs(z1) ** 3
    with np.errstate(divide="ignore"):
        radius = 1 / curvature - roller
    pressure = np.angle(outward / back / direction)
    # 1 - r k < 0: the circle is larger than the curve it would have to roll in.
    turned_back = 1 - roller * curvature <= 0
    return _profile(angle, back * w - roller * outward, pressure, radius, turned_back)


def _profile(
    angle: Array,
    touching: Complex,
    pressure: Array,
    radius: Array,
    turned_back: NDArray[np.bool_] | None = None,
) -> CamProfile:
    cut = radius <= 0 if turned_back is None else turned_back
    runs = [list(run) for is_cut, run in groupby(range(angle.size), cut.__getitem__) if is_cut]
    return CamProfile(
        angle,
        np.column_stack((touching.real, touching.imag)),
        pressure,
        radius,
        tuple((float(angle[run[0]]), float(angle[run[-1]])) for run in runs),
    )


def _law(
    law: Scalar, points: int, lengths: dict[str, float], others: dict[str, float]
) -> tuple[Array, list[Array]]:
    """Return the angles of the cam, and the law with two derivatives there."""
    problems = [
        f"{name} is {number!r}: give a {'positive ' if name in lengths else ''}number"
        for name, number in (lengths | others).items()
        if not _is_number(number) or (name in lengths and number <= 0)
    ]
    if type(points) is not int or not FEWEST <= points <= MOST:
        problems.append(f"points is {points!r}: give a whole number from {FEWEST} to {MOST:,}")
    try:
        value = in_radians(as_sympy(as_expression(law)))
    except NotAnExpressionError as error:
        problems.append(f"the law: {error}")
    else:
        problem = smoothness_problem(value) or unknown_problem(value, ["t"], "the law")
        problems += [problem] if problem else []
    if problems:
        raise ModelError([f"cam: {problem}" for problem in problems])
    angle = np.linspace(0, 2 * np.pi, points + 1)
    motion = [_evaluated(value.diff(t, order), angle) for order in range(3)]
    for what, values in zip(("value", "slope"), motion, strict=False):
        if not abs(values[-1] - values[0]) <= CLOSED * np.abs(motion[:2]).max():
            raise ModelError(
                f"cam: the law does not close after one revolution: its {what} is {values[0]:g} at "
                f"0 and {values[-1]:g} at 2 pi (are its angles in degrees? write 90*kc.deg)"
            )
    return angle[:-1], [values[:-1] for values in motion]


def _is_number(value: object) -> bool:
    return isinstance(value, float | int) and value is not True and bool(np.isfinite(value))


def _evaluated(value: sympy.Expr, at: Array) -> Array:
    written = value.replace(lambda e: isinstance(e, MotionLaw), lambda e: e.in_pieces())
    known: dict[str, Any] = {}
    for k, item in enumerate(sorted(written.atoms(PeriodicSpline), key=str)):
        known[f"table_{k}"] = np.vectorize(partial(item.table, order=item.order), otypes=[float])
        written = written.xreplace({item: sympy.Function(f"table_{k}")(*item.args)})
    function = sympy.lambdify(t, written, [known, "numpy"])
    with np.errstate(all="ignore"):  # pieces are evaluated where they do not count
        return np.asarray(np.broadcast_to(function(at), at.shape), dtype=np.float64)

"""Limits of joints, of a robot's file: which a motion leaves, and when."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

NEAR = 1e-9
"""How far beyond a limit a joint may be by rounding errors [rad or length]."""


@dataclass(frozen=True, slots=True, eq=False)
class JointLimit:
    """The least and the greatest value of a hinge or a slide.

    Attributes
    ----------
    name, unit
        Of the joint.
    bodies
        Names of both; the ground's is ``"ground"``.
    frames
        Placements (4, 4) of its frames on them.
    axis, cross
        Unit vectors (3,) at a right angle in these frames; it turns about the first, or slides
        along it.
    least, greatest
        Between which its value is; that is `reference` where the frames coincide.
    start
        A value near that at the guess, by which turns are counted.
    parameter
        Name of the parameter that is its value, of a motor; "" without one.
    """

    name: str
    unit: str
    bodies: tuple[str, str]
    frames: tuple[Array, Array]
    axis: Array
    cross: Array
    least: float
    greatest: float
    reference: float
    start: float
    parameter: str = ""

    def values(self, places: Mapping[str, Array], start: float) -> Array:
        """Return its values (N,) at placements (N, 4, 4) of bodies, beginning near one."""
        here, there = (
            places[body] @ frame for body, frame in zip(self.bodies, self.frames, strict=True)
        )
        turn = here[:, :3, :3].swapaxes(1, 2)
        if self.unit != "rad":
            way = turn @ (there[:, :3, 3:] - here[:, :3, 3:])
            return np.asarray(way[:, :, 0] @ self.axis + self.reference)
        turned = (turn @ there[:, :3, :3]) @ self.cross
        angle = np.arctan2(turned @ np.cross(self.axis, self.cross), turned @ self.cross)
        counted = np.concatenate(([start - self.reference], angle))
        return np.asarray(np.unwrap(counted)[1:] + self.reference)


def limits_left(
    limits: Sequence[JointLimit],
    columns: Mapping[str, Sequence[int]],
    q: Array,
    t: Array,
    parameters: Mapping[str, float],
) -> Iterator[str]:
    """Yield a sentence for each limit that positions q (N, n) at times t (N,) leave.

    `columns` are those of the coordinates of each body, by its name.
    """
    found = np.isfinite(q).all(axis=1)
    q, t = q[found], t[found]
    if not len(q):
        return
    places = {name: placements(q[:, list(own)]) for name, own in columns.items()}
    places["ground"] = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    for limit in limits:
        values = limit.values(places, parameters.get(limit.parameter, limit.start))
        for sign, most in ((-1.0, limit.least), (1.0, limit.greatest)):
            beyond = sign * (values - most)
            if beyond.max() > NEAR:
                first, last = int(np.argmax(beyond > NEAR)), int(np.argmax(beyond))
                yield (
                    f"Joint {limit.name} leaves its limit of {most:.6g} {limit.unit} at "
                    f"t = {t[first]:.10g}; it is {values[last]:.6g} at t = {t[last]:.10g}"
                )


def placements(coordinates: Array) -> Array:
    """Return placements (N, 4, 4) of a body by its coordinates (N, 7)."""
    made = np.broadcast_to(np.eye(4), (len(coordinates), 4, 4)).copy()
    made[:, :3, :3] = Rotation.from_quat(np.roll(coordinates[:, 3:], -1, axis=1)).as_matrix()
    made[:, :3, 3] = coordinates[:, :3]
    return made

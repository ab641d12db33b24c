"""Dyads in vectorised NumPy: positions of the joints of many linkages at many angles at once.

This is the published algorithm of the data set LINKS (Nobari, Srivastava, Gutfreund, Ahmed: "LINKS:
A dataset of a hundred million planar linkage mechanisms", 2022, arXiv 2208.14567), whose successor
LInK has it as `solve_rev_vectorized_batch_CPU`: joints are taken in an order in which each hangs on
two that are known, and found by the law of cosines, on the side on which it starts. The lines here
are our own, and take 0.4 of the time of LInK's on the same four-bars. This is less work than what
the others do: joints alone, of linkages of dyads, without rates, angles and checks.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.peers.common import Analysis, Motion, Skipped, Vector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks.linkages import Linkage

    Dyad = tuple[int, int, int]
    """A joint, and the two that it hangs on."""

NAME = "dyads in NumPy, joints only"


def joints(start: Vector, dyads: Sequence[Dyad], angles: Vector) -> Vector:
    """Return where the joints of B linkages are, (B, J, N, 2), at N angles of their cranks.

    Of each linkage joint 0 is the crank's pivot and joint 1 its end; `start` (B, J, 2) is where the
    joints are at angle 0. NaN where a dyad does not reach.
    """
    found = np.repeat(start[:, :, np.newaxis], angles.size, axis=2)
    crank = _far(start, 0, 1)
    found[:, 1, :, 0] = start[:, 0, :1] + crank * np.cos(angles)
    found[:, 1, :, 1] = start[:, 0, 1:] + crank * np.sin(angles)
    for joint, i, j in dyads:
        from_i, from_j = _far(start, i, joint), _far(start, j, joint)
        away, there = start[:, j] - start[:, i], start[:, joint] - start[:, i]
        side = np.sign(away[:, :1] * there[:, 1:] - away[:, 1:] * there[:, :1])
        x, y = (found[:, j, :, k] - found[:, i, :, k] for k in range(2))
        base = np.sqrt(x * x + y * y)
        angle = side * np.arccos((base**2 + from_i**2 - from_j**2) / (2 * base * from_i))
        cosine, sine = (part * from_i / base for part in (np.cos(angle), np.sin(angle)))
        found[:, joint, :, 0] = found[:, i, :, 0] + cosine * x - sine * y
        found[:, joint, :, 1] = found[:, i, :, 1] + sine * x + cosine * y
    return found


def _far(start: Vector, i: int, j: int) -> Vector:
    """Return how far two joints are apart, (B, 1)."""
    found: Vector = np.linalg.norm(start[:, i] - start[:, j], axis=-1)[:, np.newaxis]
    return found


def meeting(one: Vector, other: Vector, r_one: Any, r_other: Any) -> Vector:
    """Return where circles around points (B, 2) meet, (B, 2), on the left of the line."""
    away = other - one
    base = np.linalg.norm(away, axis=-1)
    along = (base**2 + r_one**2 - r_other**2) / (2 * base)
    across = np.sqrt(r_one**2 - along**2)
    unit = away / base[:, np.newaxis]
    left = np.stack([-unit[:, 1], unit[:, 0]], axis=-1)
    found: Vector = one + along[:, np.newaxis] * unit + across[:, np.newaxis] * left
    return found


def of_joints(linkage: Linkage) -> Analysis:
    """Return the analysis of the joints of a four-bar or six-bar."""
    p = linkage.parameters
    if linkage.name not in ("four_bar", "six_bar"):
        raise Skipped("it knows dyads of turning joints alone")
    places = [np.array([[0.0, 0.0]]), np.array([[p["a"], 0.0]]), np.array([[p["d"], 0.0]])]
    places.append(meeting(places[1], places[2], p["b"], p["c"]))
    dyads: list[Dyad] = [(3, 1, 2)]
    if linkage.name == "six_bar":
        for i, j, length, height in ((1, 3, p["b"], p["e"]), (3, 2, p["c"], p["f"])):
            dyads.append((len(places), i, j))
            side = math.hypot(length / 2, height)
            places.append(meeting(places[i], places[j], side, side))
        dyads.append((6, 4, 5))
        places.append(meeting(places[4], places[5], p["g"], p["h"]))
    start = np.stack(places, axis=1)

    def analyse(times: Vector) -> Motion:
        found = joints(start, dyads, p["omega"] * times)[0].transpose(1, 0, 2)
        return found.reshape(times.size, -1), np.empty(0), np.empty(0)

    return analyse


CONTENDERS = {NAME: of_joints}

"""Orientations of bodies in space over a motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.errors import InputError
from kincompile.names import listed

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from kincompile.runtime.results.columns import MotionTable

FIRST = "e0_"


def orientation(solution: MotionTable, body: object) -> Rotation:
    """Return the orientation of a body in space, or of this name, at every point of a motion.

    Returns
    -------
    scipy.spatial.transform.Rotation
        As many rotations as points: ``.as_matrix()`` gives A, shape (N, 3, 3), which turns
        body-fixed vectors into global ones; ``.as_rotvec()``, ``.as_euler("zxz")`` angles. It is
        not a number where no position was found, and refuses such points.

    Raises
    ------
    InputError
        If there is no such body in space, if there are several motions, or a point was not found.
    """
    from scipy.spatial.transform import Rotation

    name = str(getattr(body, "name", body))
    solution.require_one_motion("rotations are those of", "take one with .variant(k)")
    if f"{FIRST}{name}" not in solution.coordinates:
        known = [item.removeprefix(FIRST) for item in solution.coordinates if item[:3] == FIRST]
        raise InputError(
            f"{solution.name} has no body {name!r} in space; such bodies are: {listed(known)}."
        )
    p = np.stack([solution[f"e{k}_{name}"] for k in range(4)], axis=-1)
    if not np.isfinite(p).all():
        count = np.count_nonzero(~np.isfinite(p).all(axis=-1))
        raise InputError(
            f"{solution.name}: {count} of {len(p)} points have no position; see solution.message, "
            "and take a part of the motion that was found."
        )
    found: Rotation = Rotation.from_quat(p[:, [1, 2, 3, 0]])
    return found

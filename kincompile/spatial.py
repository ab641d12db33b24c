"""Mechanisms in space: bodies with Euler parameters, and their joints.

    from kincompile import spatial

    m = spatial.Mechanism("pendulum")
    rod = m.body("rod", (0.1, 0, 0))
    m.add(spatial.Revolute("A", m.ground, (0, 0, 0), (0, 1, 0), rod, (-0.1, 0, 0), (0, 1, 0)))

Everything that is not a body or a joint is called as in the plane.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import kincompile.files.write_model  # noqa: F401 - the text of a file, which models do not import
from kincompile.errors import InputError
from kincompile.model.system import model_of
from kincompile.names import shown, suggestion
from kincompile.runtime.results.solution import orientation as orientation
from kincompile.space import outputs as outputs
from kincompile.space.catalogue import *  # noqa: F403
from kincompile.space.loads import FollowerForce as FollowerForce
from kincompile.space.loads import FollowerTorque as FollowerTorque
from kincompile.space.loads import Force as Force
from kincompile.space.loads import HingeFriction as HingeFriction
from kincompile.space.loads import SliderFriction as SliderFriction
from kincompile.space.loads import Spring as Spring
from kincompile.space.loads import Torque as Torque
from kincompile.space.loads import TorsionSpring as TorsionSpring
from kincompile.space.mechanism import Mechanism as Mechanism
from kincompile.space.sketch import Sketch as Sketch

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.spatial.transform import Rotation

    from kincompile.runtime.results.solution import Solution


def frame(solution: Solution, link: str) -> tuple[NDArray[np.float64], Rotation]:
    """Return where a link of a robot's file is over a motion, and how it is turned.

    Parameters
    ----------
    link
        Its name in the file; a link that a fixed joint makes part of another one's body, and the
        root, have frames too.

    Returns
    -------
    tuple
        The origin in the root's frame, shape (N, 3), and a `scipy.spatial.transform.Rotation`.

    Raises
    ------
    InputError
        If the solution is not of a robot's file, or has no such link.
    """
    from scipy.spatial.transform import Rotation

    system = model_of(solution.module)
    links = {} if system is None else system.links
    if link not in links:
        near = suggestion(link, links) or "; links are those of a file that kc.read has read"
        raise InputError(f"{solution.name} has no link {shown(link)}{near}")
    body, place = links[link]
    if body == "ground":
        turn, origin = Rotation.identity(len(solution.t)), np.zeros((len(solution.t), 3))
    else:
        turn = orientation(solution, body)
        origin = np.stack([solution[f"{axis}_{body}"] for axis in "xyz"], axis=-1)
    return origin + turn.apply(place[:3, 3]), turn * Rotation.from_matrix(place[:3, :3])

"""Mechanisms in space: bodies with Euler parameters, and their joints.

    from kincompile import spatial

Everything that is not a body or a joint is called as in the plane.
"""

from kincompile.spatial.catalogue import *  # noqa: F403
from kincompile.spatial.mechanism import Mechanism as Mechanism

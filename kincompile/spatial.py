"""Mechanisms in space: bodies with Euler parameters, and their joints.

    from kincompile import spatial

    m = spatial.Mechanism("pendulum")
    rod = m.body("rod", (0.1, 0, 0))
    m.add(spatial.Revolute("A", m.ground, (0, 0, 0), (0, 1, 0), rod, (-0.1, 0, 0), (0, 1, 0)))

Everything that is not a body or a joint is called as in the plane.
"""

import kincompile.files.write_model  # noqa: F401 - the text of a file, which models do not import
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

"""pylinkage: joints found by circle intersections, compiled by Numba.

This is less work than what the others do: motion of the joints alone, no bodies and no angles; so
its results are not compared with theirs.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.peers.common import Analysis, Motion, Skipped, Vector, optional, require

if TYPE_CHECKING:
    from benchmarks.linkages import Linkage

pl = optional("pylinkage")


def dyads(linkage: Linkage) -> Analysis:
    """Return the analysis of the joints."""
    require(pl, "pylinkage")
    require(optional("numba"), "numba, without which pylinkage is not compiled,")
    p = linkage.parameters
    crank = pl.Crank(pl.Ground(0.0, 0.0), radius=p["a"], angular_velocity=0.0)
    components = [crank.anchor, crank, *_others(linkage.name, p, crank.output)]
    start = [component.position for component in components]

    def analyse(times: Vector) -> Motion:
        crank.angular_velocity = p["omega"] * (times[1] - times[0])
        model = pl.simulation.Linkage(components)
        model.set_coords(start)
        model.set_input_velocity(crank, p["omega"])
        q, q_dot, q_ddot = model.step_fast_with_kinematics(iterations=times.size)
        if np.isnan(q).any():
            raise Skipped("it loses the assembly")
        return q, q_dot, q_ddot

    return analyse


def _others(name: str, p: dict[str, float], pin: Any) -> list[Any]:
    """Return what hangs on the crank."""
    if name == "slider_crank":
        line = pl.Ground(0.0, 0.0), pl.Ground(1.0, 0.0)
        return [*line, pl.RRPDyad(pin, *line, distance=p["b"], x=p["a"] + p["b"], y=0.0)]
    pivot = pl.Ground(p["d"], 0.0)
    joint = pl.RRRDyad(pin, pivot, p["b"], p["c"], x=32.6, y=12.9)
    if name == "four_bar":
        return [pivot, joint]
    first = _midpoint(pin, joint, p["b"], p["e"])
    second = _midpoint(joint, pivot, p["c"], p["f"])
    return [pivot, joint, first, second, pl.RRRDyad(first, second, p["g"], p["h"], x=32.7, y=18.7)]


def _midpoint(start: Any, end: Any, length: float, height: float) -> Any:
    """Return the point above the middle of a link."""
    distance, angle = math.hypot(length / 2, height), math.atan2(height, length / 2)
    return pl.FixedDyad(start, end, distance, angle)


CONTENDERS = {"pylinkage dyads, Numba (joints only)": dyads}

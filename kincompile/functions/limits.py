"""How far each input of a transmission can go while the others are held."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.model.arguments import Kind
from kincompile.model.resolve import Joint
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.problem import problem
from kincompile.runtime.results.driver_range import LARGEST_FREED, DriverRange, limit
from kincompile.runtime.singular.reach import Measure

if TYPE_CHECKING:
    from kincompile.functions.poses import Pose
    from kincompile.functions.transmission import Transmission


def limits(f: Transmission, pose: Pose) -> tuple[DriverRange, ...]:
    """Return the range of each input from a pose, to the first singular position either way.

    An angle is tried for a turn, a length for four times the size of the mechanism. None where
    equations are redundant, or the mechanism has more than 100 coordinates.
    """
    code, system = code_of(f.module), f.system
    if len(code.equations) != pose.q.size or pose.q.size > LARGEST_FREED:
        return ()
    found, q = [], np.ascontiguousarray(pose.q)
    with np.errstate(all="ignore"):
        equations = problem(code, pose.p, q, 0.0)
        for name, value in zip(f.inputs, pose.u.tolist(), strict=True):
            item = next((x for x in system.constraints if x.name == name), None)
            is_square = isinstance(item, Joint) and any(
                given.kind is Kind.DISTANCE for given in item.written.arguments().values()
            )
            # Of several rows the last is that of the value.
            last = f"input_{name}" if item is None else item.equation_names[-1]
            form = Measure(f.units[name], value**2 if is_square else value, is_square)
            ends = [
                limit(equations, form, system.equations.index(last), q, 0.0, sign)
                for sign in (-1.0, 1.0)
            ]
            found.append(DriverRange(name, f.units[name], value, *ends))
    return tuple(found)

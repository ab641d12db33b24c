"""Which limits of joints a motion leaves, and when."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import ZERO
from kincompile.ir.interpret import interpreter
from kincompile.ir.lower import lower
from kincompile.model.expressions import as_sympy
from kincompile.model.limits import value_of
from kincompile.model.resolve import FreeEquation, Joint

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kincompile.model.system import ConstraintSystem

    Array = NDArray[np.float64]


def limits_left(system: ConstraintSystem) -> Callable[[Array, Array, Array], list[str]]:
    """Return a function of positions (N, n), times (N,) and parameters: sentences on limits left.

    The value of a driver is its C. That of another joint is Phi of a driver with C = 0, which of a
    hinge is an angle but for whole turns, and in space an angle within one.
    """
    joints = {item.name: item for item in system.constraints if isinstance(item, Joint)}
    limits = [item for item in system.limits if item.joint in joints]
    limits.sort(key=lambda item: not joints[item.joint].has_value)
    measuring: list[Any] = [item.measuring(joints[item.joint]) for item in limits]
    driven = [joints[item.joint] for item in limits if joints[item.joint].has_value]
    own = [FreeEquation(x.name, (as_sympy(x.scalars["C"]),), (), (x.name,)) for x in driven]
    program = lower(system.rewritten(own, measuring[len(own) :]))
    Phi = interpreter(program, ("Phi",))
    within_a_turn = system.ground.kind.turning[1]
    lengths = [item.unit == system.length_unit for item in system.coordinates]
    names = [item.name for item in system.parameters]
    units = ["rad" if value_of(x).unit == "rad" else system.length_unit for x in measuring]

    def left(q: Array, t: Array, p: Array) -> list[str]:
        found = np.isfinite(q).all(axis=1)
        if not found.any():
            return []
        q, t = q[found], t[found]
        far = float(np.abs(q[:, lengths]).max(initial=0.0)) or 1.0
        (values,) = Phi(q, np.zeros_like(q), t, p)
        given, sentences = dict(zip(names, p.tolist(), strict=True)), []
        for k, (limit, unit) in enumerate(zip(limits, units, strict=True)):
            problems: list[str] = []
            ends = limit.ends(given, problems, unit)
            if problems:
                sentences.append(f"The limit of {limit.joint} is no number with these parameters")
                continue
            counted = values[:, k]
            if unit == "rad" and k >= len(own):
                is_within = type(measuring[k]).__name__ == within_a_turn
                counted = _over_turns(np.unwrap(counted) if is_within else counted, ends)
            whole = max(float(np.abs(counted).max()), far) if unit != "rad" else 1.0
            for sign, most in zip((-1.0, 1.0), ends, strict=True):
                beyond = sign * (counted - most) / whole
                if beyond.max() > ZERO:  # less may be rounding errors
                    first, last = int(np.argmax(beyond > ZERO)), int(np.argmax(beyond))
                    end, reached = (f"{x:.6g} {unit}".rstrip() for x in (most, counted[last]))
                    sentences.append(
                        f"Joint {limit.joint} leaves its limit of {end} at t = {t[first]:.10g}; "
                        f"it is {reached} at t = {t[last]:.10g}"
                    )
        return sentences

    return left


def _over_turns(angles: Array, ends: Sequence[float]) -> Array:
    """Return angles, less whole turns: the first is within the limits, or nearest to their middle.

    Guesses of two bodies may be whole turns apart where the hinge is not.
    """
    if ends[0] <= angles[0] <= ends[1]:
        return angles
    middle = np.mean([end for end in ends if np.isfinite(end)] or [0.0])
    return np.asarray(angles - 2 * np.pi * np.round((angles[0] - middle) / (2 * np.pi)))

r"""Singular configurations of a simulation: foreseen, stepped across, and located.

Where :math:`\Phi_q` loses rank, the motion goes on smoothly as a rule, but beside it the equations
of motion hold only for states that satisfy the constraints. So no step may end there, and no stage
of one: the configuration is foreseen, and the step across it has it where it evaluates nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import FORESEEN, IMAGINARY, NEARLY, SHORT, SLIGHT
from kincompile.runtime.singular.events import quintic

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.runtime.dynamics.equations import Equations
    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.singular.events import Motion

    States = Callable[[float], Array]

MIDDLE = 0.4667
"""Part of a step of DOP853 that is farthest from its stages, which are at 0.333 and at 0.6."""

BESIDE = 0.1
"""Part of a step across a singular configuration, on either side of it, within which positions and
rates are interpolated."""

LOOKS = 8
"""How often the time of a singular configuration is looked at, each look squaring its error."""


def times_to(equations: Equations, t: float, y: Array) -> Array:
    r"""Return the times, negative in the past, after which Phi_q loses rank, to first order.

    :math:`\Phi_q + \tau \dot\Phi_q` loses rank where :math:`-1/\tau` is an eigenvalue of
    :math:`\dot\Phi_q \Phi_q^+`, of whatever multiplicity.
    """
    n, none = equations.n, np.zeros(0)
    q, q_dot = y[:n], y[n : 2 * n]
    speed = float((np.abs(q_dot) / equations.scale).max(initial=0.0))
    step = SLIGHT / speed if speed > 0 else 0.0
    here, there = equations.point(q, t), equations.point(q + step * q_dot, t + step)
    if not step or here is None or there is None or not here.Phi.size:
        return none
    matrix = equations.scaled(here)
    change = (equations.scaled(there) - matrix) / step
    basis, triangle = np.linalg.qr(matrix.T)
    try:
        found = np.linalg.eigvals(np.linalg.solve(triangle, (change @ basis).T))
    except np.linalg.LinAlgError:  # it is singular here
        return np.zeros(1)
    times = -1 / found[found != 0]
    return np.asarray(times.real[np.abs(times.imag) <= IMAGINARY * np.abs(times.real)])


def ahead(times: Array, forward: float) -> float:
    """Return the least time to a singular configuration that is still to come, infinity if none."""
    coming = times * forward
    return float(coming.min(where=coming >= 0, initial=np.inf))


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """A motion across a singular configuration at a time t, between two states beside it."""

    t: float
    first: tuple[float, Motion]
    last: tuple[float, Motion]

    def covers(self, t: float) -> bool:
        """Say whether a time is so near that only the states beside it tell how things are."""
        return (t - self.first[0]) * (t - self.last[0]) < 0

    def at(self, t: float) -> Motion:
        """Return position, velocity and acceleration there."""
        return quintic(*self.first, *self.last, t)


def foreseen(equations: Equations, t: float, y: Array, span: float) -> float:
    """Return in what time a motion comes to a singular configuration, about `span`; else NaN.

    Times are signed, as the motion goes.
    """
    n, part = equations.n, FORESEEN * span
    rate = equations.rate(t, y)
    there = y + part * rate
    there[:n] += part**2 / 2 * rate[n : 2 * n]
    held, drift = equations.corrected(t + part, there)
    if not np.isfinite(drift):
        return np.nan
    left = ahead(times_to(equations, t + part, held), np.sign(span))
    return part + np.sign(span) * left if left < abs(span) else np.nan


def passage(equations: Equations, t0: float, t1: float, state: States) -> Passage | None:
    """Return the singular configuration in the middle of a step, if there is one."""
    t = t0 + MIDDLE * (t1 - t0)
    for _ in range(LOOKS):
        times = times_to(equations, t, state(t))
        if not times.size:
            return None
        away = float(times[np.argmin(np.abs(times))])
        if not abs(t + away - (t0 + t1) / 2) < abs(t1 - t0) / 2:
            return None
        if abs(away) <= NEARLY * abs(t1 - t0):
            t += away
            break
        t += SHORT * away
    else:
        return None
    sides = []
    for time in (t - BESIDE * (t1 - t0), t + BESIDE * (t1 - t0)):
        y, n = state(time), equations.n
        rate = equations.rate(time, y)
        sides.append((time, (y[:n], y[n : 2 * n], rate[n : 2 * n])))
    return Passage(t, *sides)

"""The flywheel that keeps a machine's speed even: what its driver needs over a cycle, stored."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline

from kincompile.criteria import NEAR_MISS, SLIGHT
from kincompile.errors import InputError
from kincompile.html import Shown
from kincompile.names import METRES, unknown
from kincompile.runtime.results.forces import Forces

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array

FEWEST = 8
"""Points of which a cycle has at least."""


@dataclass(frozen=True, slots=True, repr=False)
class Flywheel(Shown):
    """A flywheel for a driver.

    Attributes
    ----------
    driver : str
        Its name.
    inertia : float
        Moment of inertia that it needs [kg*m^2].
    energy : float
        Energy that it takes up and gives back in a cycle [J].
    mean_torque : float
        Torque of the motor, which is constant then [N*m].
    speed, fluctuation : float
        Mean angular velocity, and the largest less the smallest one as a part of it.
    t_fastest, t_slowest : float
        When the machine runs fastest and slowest.
    """

    driver: str
    inertia: float
    energy: float
    mean_torque: float
    speed: float
    fluctuation: float
    t_fastest: float
    t_slowest: float

    def to_text(self) -> str:
        """Return a sentence."""
        return (
            f"flywheel for {self.driver}: inertia {self.inertia:.6g} for a fluctuation of "
            f"{self.fluctuation:.4g}; it stores {self.energy:.6g}, the motor turns with "
            f"{self.mean_torque:.6g}; fastest at t = {self.t_fastest:.6g}, slowest at "
            f"t = {self.t_slowest:.6g}."
        )


def flywheel(found: Forces, driver: str, fluctuation: float) -> Flywheel:
    r"""Return the flywheel that keeps the speed of a driver within a fluctuation.

    With the mean torque as motor torque the wheel takes up :math:`E(t) = \int (\bar P - P) dt`, of
    which it holds :math:`\max E - \min E = J \delta \omega^2`. For small fluctuations, with the
    flywheel on the driven shaft.

    Parameters
    ----------
    found
        Forces over one cycle, or several whole ones, at a constant speed of the driver.
    driver
        Its name.
    fluctuation
        Largest less smallest speed, as a part of the mean: 0.02 for two per cent.

    Returns
    -------
    Flywheel
        `.inertia` and what goes with it; of the shaft, so for another one it is multiplied by the
        square of the ratio of speeds.

    Raises
    ------
    InputError
        If there is no such driver, it does not run at a constant speed, the motion is not one of
        whole cycles, or the fluctuation is not between 0 and 1.
    """
    drive, t = _checked(found, driver, fluctuation), found.motion.t
    torque, power = drive
    speed = float(power @ torque / (torque @ torque))
    if not np.abs(power - speed * torque).max() <= SLIGHT * np.abs(power).max():
        raise InputError(
            f"the driver {driver!r} does not run at a constant speed, for which a flywheel is "
            "sized: give it a driver such as w*kc.t."
        )
    if abs(power[-1] - power[0]) > NEAR_MISS * np.abs(power).max():
        raise InputError(
            f"the power of {driver!r} is {power[0]:.6g} at the start and {power[-1]:.6g} at the "
            "end: solve over one whole cycle, so that the motion ends where it began."
        )
    spline = CubicSpline(t, power)
    mean = float(spline.integrate(t[0], t[-1])) / (t[-1] - t[0])
    work = spline.antiderivative()
    times = np.concatenate((t[[0, -1]], spline.solve(mean, extrapolate=False)))
    times = times[np.isfinite(times)]
    stored = mean * (times - t[0]) - work(times)
    high, low = int(np.argmax(stored)), int(np.argmin(stored))
    energy = float(stored[high] - stored[low])
    return Flywheel(
        driver, energy / (fluctuation * speed**2), energy, mean / speed, speed,
        float(fluctuation), float(times[high]), float(times[low]),
    )  # fmt: skip


def _checked(found: Forces, driver: str, fluctuation: Any) -> tuple[Array, Array]:
    """Return torque and power of a driver, after all that was given was looked at."""
    if not isinstance(found, Forces):
        raise InputError(
            f"expected Forces, got {type(found).__name__}: kc.flywheel(kc.forces(solution), ...)."
        )
    found.motion.require_one_motion("a flywheel is for", "take a variant: .variant(0)")
    problems = []
    drivers = found.drivers
    if driver not in drivers:
        problems.append(unknown(f"there is no driver {driver!r}", str(driver), drivers))
    if not (isinstance(fluctuation, int | float | np.number) and 0 < fluctuation < 1):
        problems.append(f"the fluctuation is {fluctuation!r}: give a part of the speed, as 0.02.")
    if found.motion.t.size < FEWEST:
        problems.append(f"a cycle has {found.motion.t.size} points: solve at {FEWEST} or more.")
    if problems:
        raise InputError(problems)
    torque, power = drivers[driver].value, drivers[driver].power
    if not np.isfinite(torque.sum()) or not torque.any():
        raise InputError(
            f"the torque of {driver!r} is not known at every time, or nothing loads it: see "
            ".motion.message and .undetermined."
        )
    _, _, length = found.motion.units[f"drive_{driver}"].partition("*")
    return torque * METRES.get(length, 1.0), power

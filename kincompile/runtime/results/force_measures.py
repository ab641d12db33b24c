"""What drivers, springs and joints bear over a motion: peak, root mean square, mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.errors import InputError
from kincompile.html import Tabled
from kincompile.names import column_name, unknown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.runtime.engine.code import Array


@dataclass(frozen=True, slots=True)
class ForceMeasure:
    """What a force, a torque or a power does in the time that was solved.

    Attributes
    ----------
    name, unit
        Of the column; ``F_A`` is the magnitude of the reaction of joint A.
    least, greatest, t_least, t_greatest : float
        The extremes among the points of the grid, and when.
    mean, rms : float
        Over time, by the trapezoidal rule between the points.
    """

    name: str
    unit: str
    least: float
    t_least: float
    greatest: float
    t_greatest: float
    mean: float
    rms: float

    @property
    def peak(self) -> float:
        """The largest magnitude."""
        return max(abs(self.least), abs(self.greatest))


@dataclass(frozen=True, slots=True, repr=False)
class ForceMeasures(Tabled):
    """Measures of forces: ``measures["motor.drive"]`` gives one; str is a table."""

    header = ("force", "peak", "at t", "rms", "mean", "unit")
    numbers = header[1:5]

    name: str
    items: tuple[ForceMeasure, ...]

    def __getitem__(self, name: str) -> ForceMeasure:
        """Return the measures of a force."""
        known = {item.name: item for item in self.items}
        wanted = name if name in known else column_name(name)
        if wanted not in known:
            text = f"{self.name} has no force {name!r} that is measured"
            raise InputError(unknown(text, wanted, known))
        return known[wanted]

    def rows(self) -> list[tuple[str, ...]]:
        """Return the peak of each force, when it is reached, and means."""
        rows: list[tuple[str, ...]] = []
        for item in self.items:
            at = item.t_greatest if item.peak == abs(item.greatest) else item.t_least
            numbers = (f"{x:.6g}" for x in (item.peak, at, item.rms, item.mean))
            rows.append((item.name, *numbers, item.unit))
        return rows

    def headline(self) -> str:
        """Return the name."""
        return f"{self.name}: forces"


def force_measures(name: str, t: Array, columns: Mapping[str, tuple[Array, str]]) -> ForceMeasures:
    """Measure columns of forces, each given by values (N,) and unit; refuse what has no forces."""
    good = np.isfinite([values for values, _ in columns.values()]).any(axis=0)
    if not good.any():
        raise InputError(f"{name} has no point at which forces were found: see .motion.message.")
    return ForceMeasures(
        name,
        tuple(
            force_measure(key, unit, t, values)
            for key, (values, unit) in columns.items()
            if np.isfinite(values).any()
        ),
    )


def force_measure(name: str, unit: str, t: Array, values: Array) -> ForceMeasure:
    """Measure one column of forces (N,), NaN where it has no value; somewhere it has one."""
    good = np.isfinite(values)
    times, own = t[good], values[good]
    order = np.argsort(times, kind="stable")
    times, own = times[order], own[order]
    low, high = int(own.argmin()), int(own.argmax())
    span = times[-1] - times[0]
    mean, square = float(own.mean()), float(np.square(own).mean())
    if span > 0:
        mean = float(np.trapezoid(own, times) / span)
        square = float(np.trapezoid(own**2, times) / span)
    extremes = float(own[low]), float(times[low]), float(own[high]), float(times[high])
    return ForceMeasure(name, unit, *extremes, mean, float(np.sqrt(square)))

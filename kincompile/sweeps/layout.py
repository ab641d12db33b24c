"""What a sweep keeps of each variant: columns over time, measures, statuses."""

from __future__ import annotations

import math
import re
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError
from kincompile.names import listed, rate_of, suggestion
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.inputs import names_of
from kincompile.runtime.results.columns import TIME_UNIT
from kincompile.runtime.results.forces import force_measure, forces
from kincompile.runtime.results.grashof import four_bar_types, four_bar_with
from kincompile.runtime.results.measures import measures_together
from kincompile.runtime.results.shapes import path_columns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.results.columns import Column
    from kincompile.runtime.results.solution import Solution

TIME, STATUS = "t", "status"

PENDING = -1
"""The status of what has not been solved yet."""

MEASURES = (
    "least", "t_least", "greatest", "t_greatest", "stroke", "period", "time_ratio", "mean", "rms",
)  # fmt: skip
"""What can be kept of an output, as `sol.measures()` calls it."""

OF_MOTION = ("straightness", "roundness", "dwell", "grashof")
"""What can be kept of the path of a point, of a column, and of the four-bar that has a link."""

OF_FORCES = ("peak", "least", "t_least", "greatest", "t_greatest", "mean", "rms")
"""What can be kept of a force, at the times alone, as `kc.forces(sol).measures()` calls it."""

OF_TIME = ("t_least", "t_greatest", "period")


@dataclass(frozen=True, slots=True)
class Kept:
    """A number that is kept: a column, or a measure of an output."""

    # name, unit: what it is called in the results, for instance ``x_foot_stroke``, and its unit
    name: str
    unit: str
    column: str  # the column, or the output that is measured
    measure: str = ""  # one of `MEASURES` or `OF_FORCES`; "" of a column over time
    is_force: bool = False  # whether it is one of those that `kc.forces` gives
    part: tuple[Any, ...] = ()  # of the motion, or how near, what is between brackets


@dataclass(frozen=True, slots=True)
class Layout:
    """All that is kept, and whether statuses are those of points or of whole motions."""

    kept: tuple[Kept, ...]

    @property
    def over_time(self) -> bool:
        """Whether there are columns over time."""
        return any(not item.measure for item in self.kept)

    def values(self, solution: Solution) -> dict[str, NDArray[np.generic]]:
        """Return what is kept of the variants of a solution: (B, N) over time, else (B,)."""
        bearing = bearing_of(solution) if any(item.is_force for item in self.kept) else solution
        found: dict[str, NDArray[np.generic]] = {
            item.name: (bearing if item.is_force else solution)[item.column]
            for item in self.kept
            if not item.measure
        }
        for item in self.kept:
            if item.measure and item.is_force:
                found[item.name] = _measured_forces(bearing, item)
        measured = [
            item
            for item in self.kept
            if item.measure and not item.is_force and item.measure not in OF_MOTION
        ]
        for item in self.kept:
            if item.measure in OF_MOTION:
                found[item.name] = _measured_motions(solution, item)
        for item in measured:
            found[item.name] = np.full(len(solution.q), np.nan)
        names = {item.column for item in measured}
        whole = np.flatnonzero(solution.good.all(axis=1)).tolist() if measured else []
        motions = [solution.variant(number) for number in whole]
        sets = solution.p[whole]
        code = code_of(solution.require_module("its measures"))
        measures = measures_together(motions, code, sets, names)
        for number, several in zip(whole, measures, strict=True):
            for own in several:
                for item in measured:
                    value = getattr(own, item.measure) if item.column == own.name else None
                    if value is not None:
                        found[item.name][number] = value
        status = solution.status
        if not self.over_time:  # the first that is not good says what happened
            first = np.argmax(~solution.good, axis=1)
            status = status[np.arange(len(status)), first]
        found[STATUS] = status.astype(np.int8)
        return found


def bearing_of(solution: Solution) -> Solution:
    """Return a motion whose outputs are also its forces, and the sizes of reactions."""
    found = forces(solution)
    sizes = {name: x for name, x in found.columns().items() if name not in found.names}
    values = np.stack([values for values, _ in sizes.values()], axis=-1)
    units = {name: unit for name, (_, unit) in sizes.items()}
    return found.motion.observing(found.motion.observed.joined(tuple(sizes), units, values))


def _measured_motions(solution: Solution, item: Kept) -> NDArray[np.generic]:
    """Return a measure of whole motions in each variant, (B,), NaN where there is none."""
    found = np.full(len(solution.q), np.nan)
    for number in np.flatnonzero(solution.good.all(axis=1)).tolist():
        with suppress(InputError):  # no such part of this motion
            found[number] = _of_motion(solution.variant(number), item)
    return found


def _of_motion(motion: Solution, item: Kept) -> float:
    """Return the largest distance, the time of the longest dwell, or p + q - s - l."""
    if item.measure == "dwell":
        return motion.dwell(item.column, *item.part).time
    if item.measure == "grashof":
        code = code_of(motion.require_module("its four-bars"))
        return four_bar_with(four_bar_types(code, motion.p), item.column).margin
    measure = motion.straightness if item.measure == "straightness" else motion.roundness
    return measure(item.column, item.part or None).deviation


def _measured_forces(bearing: Solution, item: Kept) -> NDArray[np.generic]:
    """Return a measure of a force in each variant, (B,), NaN where it was not found throughout."""
    values = bearing[item.column]
    found = np.full(len(values), np.nan)
    for number in np.flatnonzero(np.isfinite(values).all(axis=1)).tolist():
        own = force_measure(item.column, item.unit, bearing.t, values[number])
        found[number] = getattr(own, item.measure)
    return found


def read_layout(
    solution: Solution,
    columns: Sequence[str] | None,
    measures: Sequence[str],
    bearing: Solution | None = None,
) -> Layout:
    """Read what is to be kept of a solution, which has one position and knows its columns.

    Without names of columns they are all outputs, of a model without any all coordinates, unless
    there are measures of outputs, as ``"foot.x.stroke"``. All unknown names are
    reported together.
    Forces are known where the solution is given with them too.
    """
    problems: list[str] = []
    if columns is None:
        columns = () if measures else solution.observed.names or solution.coordinates
    kept: dict[str, Kept] = {}
    for name in names_of(columns, "columns"):
        try:
            column, is_force = _column(solution, name, bearing)
        except InputError as error:
            problems += error.problems
        else:
            is_known = is_force or rate_of(column.name, solution.names)
            asked = column.name if is_known else str(name)  # the point of a joint
            kept[column.name] = Kept(column.name, column.unit, asked, is_force=is_force)
    for name in names_of(measures, "measures"):
        try:
            item = _measure(solution, name, bearing)
        except InputError as error:
            problems += error.problems
        else:
            kept[item.name] = item
    if not kept and not problems:
        problems.append("nothing is kept: name columns, or measures such as 'foot.x.stroke'.")
    if problems:
        raise InputError(problems)
    return Layout(tuple(kept.values()))


def _column(solution: Solution, name: str, bearing: Solution | None) -> tuple[Column, bool]:
    """Return a column of a motion, and whether it is a force."""
    try:
        return solution.column(name), False
    except InputError:
        if bearing is None:
            raise
        return bearing.column(name), True


def _motion_measure(solution: Solution, given: str) -> Kept | None:
    """Read a measure of the motion, as ``P.straightness(0.2, 0.7)``; None of any other."""
    form = re.fullmatch(r"(.+)\.(\w+)(?:\((.*)\))?", str(given))
    if form is None or form[2] not in OF_MOTION:
        return None
    of, measure = form[1], form[2]
    words = re.findall(r"[^\s,]+", form[3] or "")
    try:
        part = [x if x in ("max", "min") and measure == "dwell" else float(x) for x in words]
    except ValueError:
        part = [math.nan]
    if not _fits(measure, part):
        raise InputError(
            f"{given!r}: write it as 'P.straightness', 'P.roundness(0.2, 0.7)' from a time to a "
            "later one, 'ram.x.dwell(0.5)' or 'ram.x.dwell(0.5, min)', with a positive number, of "
            "how near it keeps to its greatest or least value, or 'crank.grashof' of the four-bar "
            "with that link."
        )
    if measure == "dwell":
        of, unit = solution.column(of).name, TIME_UNIT
    elif measure == "grashof":
        code = code_of(solution.require_module("its four-bars"))
        unit = four_bar_with(four_bar_types(code, solution.p), of).unit
    else:
        unit = solution.column(path_columns(solution, of)[0]).unit
    name = "_".join((of, measure, *words))
    return Kept(name, unit, of, measure, part=tuple(part))


def _fits(measure: str, part: Sequence[Any]) -> bool:
    """Return whether what is between brackets is of a measure of the motion."""
    numbers = [x for x in part if not isinstance(x, str)]
    if not all(map(math.isfinite, numbers)):
        return False
    if measure == "dwell":
        return 1 <= len(part) <= 2 and numbers[:1] == part[:1] and numbers[0] > 0
    return not part or (measure != "grashof" and len(part) == 2 and part[0] < part[1])


def _measure(solution: Solution, given: str, bearing: Solution | None) -> Kept:
    """Read a measure, such as ``foot.x.stroke``."""
    if (of_motion := _motion_measure(solution, given)) is not None:
        return of_motion
    output, _, measure = str(given).rpartition(".")
    if measure not in (*MEASURES, *OF_FORCES) or not output:
        near = suggestion(measure, (*MEASURES, *OF_MOTION)) or "."
        raise InputError(
            f"there is no measure {given!r}{near} Write the output and what is measured of it, "
            f"such as 'foot.x.stroke'; there are {listed((*MEASURES, *OF_MOTION), 20)}."
        )
    column, is_force = _column(solution, output, bearing)
    if measure not in (OF_FORCES if is_force else MEASURES):
        known = listed(OF_FORCES if is_force else MEASURES)
        raise InputError(
            f"{given!r}: there is no such measure of {column.name}; there are {known}."
        )
    if not is_force and column.name not in solution.observed.names:
        raise InputError(
            f"{given!r}: {column.name} is a coordinate; measures are defined for outputs. There "
            f"are {listed(solution.observed.names)}: name a point or an output in the model."
        )
    unit = TIME_UNIT if measure in OF_TIME else "" if measure == "time_ratio" else column.unit
    return Kept(f"{column.name}_{measure}", unit, column.name, measure, is_force)

"""A solution in a few lines of text: extremes, measures of outputs, and how the solving went."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import NOISE
from kincompile.runtime.results.columns import largest, shown_unit
from kincompile.runtime.status import Status
from kincompile.tables import counted, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.runtime.results.solution import Solution

_NUMBERS = ("min", "at t", "max", "max |speed|", "max |acceleration|")


def summary(solution: Solution, angle_unit: str = "rad") -> str:
    """Return the extremes of every coordinate, the measures, and a line on how the solving went.

    Of variants there is a part for each, under the values of its parameters. Per coordinate it has
    the unit, the least and largest value with their times, and the largest absolute values of first
    and second derivative [unit/s, unit/s^2]; then come the tables of `Solution.measures`, the
    points by status, the Newton iterations and the largest residual. Points that were not found do
    not count; `angle_unit` is ``"rad"`` or ``"deg"``.
    """
    if solution.q.ndim > 2:
        return "\n\n".join(_variant(solution, k, angle_unit) for k in range(len(solution.q)))
    parts = ["\n".join(_table(solution, angle_unit))]
    if np.isfinite(solution.q_dot).any():
        parts.append(solution.measures().table(angle_unit))
    return "\n\n".join(part for part in (*parts, _verdict(solution)) if part)


def _variant(solution: Solution, number: int, angle_unit: str) -> str:
    """Return the summary of a variant, under the values of its parameters."""
    values = ((name, axis[number]) for name, axis in solution.variants.items())
    named = (
        f"{name} = {value:g} {solution.units.get(name, '')}".rstrip() for name, value in values
    )
    return f"{', '.join(named)}\n{summary(solution.variant(number), angle_unit)}"


def _table(solution: Solution, angle_unit: str) -> list[str]:
    """Return the lines of the table of coordinates."""
    motion = solution.q, solution.q_dot, solution.q_ddot
    shown = [without_noise(values).T for values in motion]
    rows = []
    for name, q, q_dot, q_ddot in zip(solution.coordinates, *shown, strict=True):
        unit, factor = shown_unit(solution.units[name], angle_unit)
        rates = (_text(largest(factor * part)) for part in (q_dot, q_ddot))
        rows.append([name, unit, *_extremes(solution.t, factor * q), *rates])
    header = ("coordinate", "unit", "min", "at t", "max", "at t", *_NUMBERS[3:])
    return table(header, rows, right=_NUMBERS)


def without_noise(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values, with zero for those that are rounding errors of the largest."""
    return np.where(np.abs(values) < NOISE * largest(values), 0.0, values)


def _extremes(t: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[str, str, str, str]:
    """Return the least value and its time, the largest value and its time."""
    found = np.isfinite(values)
    if not found.any():
        return ("-",) * 4
    t, values = t[found], values[found]
    return (*_first(t, values, values.min()), *_first(t, values, values.max()))


def _first(
    t: NDArray[np.float64], values: NDArray[np.float64], extreme: np.float64
) -> tuple[str, str]:
    """Return an extreme and the first time at which it is reached, up to rounding."""
    there = np.abs(values - extreme) <= NOISE * np.abs(values).max()
    return _text(extreme), _text(t[there.argmax()])


def _text(number: float) -> str:
    return "-" if np.isnan(number) else f"{number:.6g}"


def _verdict(solution: Solution) -> str:
    """Return the points by status, the iterations and the largest residual."""
    counts = [(np.count_nonzero(solution.status == status), status) for status in Status]
    by_status = ", ".join(f"{count} {status.name}" for count, status in counts if count)
    residual = solution.residual[solution.good]  # of failures it is in `.message`
    kind = "step" if "steps" in solution.statistics else "Newton iteration"
    return (
        f"{counted(solution.t.size, 'point')} from t = {solution.t[0]:g} to {solution.t[-1]:g}: "
        f"{by_status}; {counted(int(solution.iterations.sum()), kind)}, "
        f"largest residual {f'{residual.max():.1e}' if residual.size else '-'}"
    )

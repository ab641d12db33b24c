"""A solution as a file, CSV, NPZ or JSON, and in a few lines of text."""

from __future__ import annotations

import io
import json
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import NOISE
from kincompile.errors import InputError
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.results.columns import TIME_UNIT, largest, shown_unit, titled
from kincompile.runtime.results.grashof import four_bar_types
from kincompile.runtime.results.solution import require_solution
from kincompile.runtime.status import Status
from kincompile.tables import counted, table, without_noise
from kincompile.writing import write_atomically

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from numpy.typing import NDArray

    from kincompile.runtime.results.solution import Solution

MOTION, OUTPUTS = ("q", "q_dot", "q_ddot"), ("y", "y_dot", "y_ddot")
"""Arrays whose columns have units."""
ENDS = ("status", "residual", "iterations")
"""Arrays of a solution with one number a point."""

WIDTH = 100
"""Characters of a line of text."""

_NUMBERS = ("min", "at t", "max", "max |speed|", "max |acceleration|")


def write(solution: Solution, path: str | os.PathLike[str], *, angle_unit: str = "rad") -> Path:
    """Write a solution; an existing file is replaced in one step or left as it is.

    Parameters
    ----------
    solution : Solution
        The solution, complete or partial.
    path : path-like
        ``.csv``: one row per point, with the columns t, the coordinates and outputs, their first
        and second derivatives, status, residual; the header has names and units: ``x_rod [m]``.
        Of variants the parameters in which they differ come first.
        ``.npz``: the arrays and names of the solution for `numpy.load`. ``.json``: the same as
        text, null where a number was not found.
    angle_unit : {"rad", "deg"}
        What angles and their rates are written in; parameters stay as they are.

    Returns
    -------
    pathlib.Path
        The path written.

    Raises
    ------
    InputError
        When the suffix is another, or the file cannot be written.
    """
    require_solution(solution)
    require_known_suffix(path)
    return write_atomically(path, _WRITERS[Path(path).suffix.lower()](solution, angle_unit))


def require_known_suffix(path: str | os.PathLike[str]) -> None:
    """Check that the suffix names a format that `write` knows; to be called before long work."""
    if Path(path).suffix.lower() not in _WRITERS:
        raise InputError(f"cannot write {path}: end its name in {', '.join(_WRITERS)}.")


def _csv(solution: Solution, angle_unit: str) -> str:
    """Return the table; every number has as many digits as it takes to read it back exactly.

    A zero has no sign.
    """
    axes = solution.variants if solution.q.ndim > 2 else {}
    columns = [item.shown(angle_unit) for item in solution.columns()]
    titles = [titled(name, solution.units.get(name, "")) for name in axes]
    titles += [titled("t", TIME_UNIT), *(item.title for item in columns), "status", "residual"]
    count, points = solution.status.size, solution.t.size
    before = [*(np.repeat(axis, points) for axis in axes.values()), np.resize(solution.t, count)]
    cells = np.column_stack([*before, *(item.values.ravel() for item in columns)])
    numbers = (cells + 0.0).tolist()
    ends = zip(solution.status.ravel().tolist(), solution.residual.ravel().tolist(), strict=True)
    lines = [",".join(titles)]
    for row, (status, residual) in zip(numbers, ends, strict=True):
        lines.append(f"{','.join(map(repr, row))},{status},{residual!r}")
    return "\n".join(lines) + "\n"


def _npz(solution: Solution, angle_unit: str) -> bytes:
    """Return the arrays, with names as arrays of text, so that nothing needs to be unpickled."""
    text = {
        "coordinates": solution.coordinates,
        **({"outputs": solution.observed.names} if solution.observed.names else {}),
        "equations": solution.equations,
        "units": [_units(solution, angle_unit)[name] for name in solution.coordinates],
        "parameters": list(solution.parameters),
    }
    arrays = _arrays(solution, angle_unit)
    arrays |= {name: np.array(getattr(solution, name)) for name in ("success", "message", "name")}
    arrays |= {name: np.array(names, dtype=np.str_) for name, names in text.items()}
    arrays["parameter_values"] = solution.p.T
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _units(solution: Solution, angle_unit: str) -> dict[str, str]:
    """Return the units of coordinates and outputs as they are written, and those of parameters."""
    written = {name: shown_unit(solution.units[name], angle_unit)[0] for name in solution.names}
    return solution.units | written


def _arrays(solution: Solution, angle_unit: str) -> dict[str, Any]:
    """Return the arrays of a solution, those of outputs where there are any."""
    own = solution.observed
    arrays = {name: getattr(solution, name) for name in ("t", *MOTION, *ENDS)}
    for source, names, columns in (
        (solution, MOTION, solution.coordinates),
        (own, OUTPUTS, own.names),
    ):
        factors = [shown_unit(solution.units[name], angle_unit)[1] for name in columns]
        if columns:
            arrays |= {name: getattr(source, name) * np.array(factors) for name in names}
    return arrays


def _json(solution: Solution, angle_unit: str) -> str:
    """Return the document."""
    names = ("name", "success", "message", "coordinates", "equations")
    document = {name: getattr(solution, name) for name in names}
    document["units"] = _units(solution, angle_unit)
    if solution.observed.names:
        document["outputs"] = solution.observed.names
    if solution.q.ndim == 2 and solution.module is not None:
        four_bars = four_bar_types(code_of(solution.module), solution.p)
        document |= {"four_bars": [item.as_dict() for item in four_bars]} if four_bars else {}
    document |= {
        "parameters": {k: np.asarray(v).tolist() for k, v in solution.parameters.items()},
        "statuses": {str(int(status)): status.sentence for status in Status},
    }
    arrays = _arrays(solution, angle_unit)
    document |= {name: _nullable(values) for name, values in arrays.items()}
    return json.dumps(document, allow_nan=False, ensure_ascii=False) + "\n"


def _nullable(values: NDArray[Any]) -> Any:
    """Return nested lists with None for NaN, which JSON does not know."""
    return np.where(np.isfinite(values), values, np.array(None)).tolist()


_WRITERS: dict[str, Callable[[Solution, str], str | bytes]] = {
    ".csv": _csv,
    ".npz": _npz,
    ".json": _json,
}


def summary(solution: Solution, angle_unit: str = "rad") -> str:
    """Return the measures, the extremes of every coordinate, and a line on how the solving went.

    Of variants there is a table with a line for each. The outputs of
    `Solution.measures` come first, its drivers and four-bars after the coordinates. Per coordinate
    that moves there are the unit, the least and largest value with their times, and the largest
    absolute values of first and second derivative [unit/s, unit/s^2]; a line names those at rest.
    At the end stand the points by status, the Newton iterations and the largest residual. Points
    that were not found do not count; `angle_unit` is ``"rad"`` or ``"deg"``.
    """
    if solution.q.ndim > 2:
        return "\n".join(_variants(solution, angle_unit))
    outputs = drivers = four_bars = ""
    if np.isfinite(solution.q_dot).any():
        outputs, drivers, four_bars = solution.measures().tables(angle_unit)
    coordinates = "\n".join(_table(solution, angle_unit))
    return "\n\n".join(filter(None, (outputs, coordinates, drivers, four_bars, _verdict(solution))))


def _variants(solution: Solution, angle_unit: str) -> list[str]:
    """Return a table with a line for each variant: how far it was found, extremes of outputs."""
    units, given = solution.units, solution.variants
    header, columns = [], []
    for name, axis in given.items():
        unit, factor = shown_unit(units.get(name, ""), angle_unit)
        header.append(titled(name, unit))
        columns.append([f"{factor * value:g}" for value in axis])
    counts = [f"{found.sum()} of {found.size}" for found in solution.good]
    header, columns = [*header, "points found"], [*columns, counts]
    for name in solution.observed.names or solution.coordinates:
        column = solution.column(name).shown(angle_unit)
        for word, extreme in (("min", np.fmin), ("max", np.fmax)):
            header.append(titled(f"{column.name} {word}", column.unit))
            columns.append([_text(value) for value in extreme.reduce(column.values, axis=-1)])
    return table(header, [*zip(*columns, strict=True)], right=header)


def variant_named(solution: Solution, number: int) -> str:
    """Return the values of a variant's parameters, as ``c = 270 mm``."""
    values = ((name, axis[number]) for name, axis in solution.variants.items())
    return ", ".join(
        f"{name} = {x:g} {solution.units.get(name, '')}".rstrip() for name, x in values
    )


def _table(solution: Solution, angle_unit: str) -> list[str]:
    """Return the lines of the table of coordinates, and a line on those that never move."""
    motion = solution.q, solution.q_dot, solution.q_ddot
    shown = [without_noise(values, largest(values)).T for values in motion]
    rows, rest = [], []
    for name, q, q_dot, q_ddot in zip(solution.coordinates, *shown, strict=True):
        unit, factor = shown_unit(solution.units[name], angle_unit)
        if solution.t.size > 1 and not (np.ptp(q) or q_dot.any() or q_ddot.any()):
            rest.append(f"{name} = {_text(factor * q[0])} {unit}".rstrip())
            continue
        rates = (_text(largest(factor * part)) for part in (q_dot, q_ddot))
        rows.append([name, unit, *_extremes(solution.t, factor * q), *rates])
    header = ("coordinate", "unit", "min", "at t", "max", "at t", *_NUMBERS[3:])
    lines = table(header, rows, right=_NUMBERS) if rows or not rest else []
    return [*lines, *textwrap.wrap(f"at rest: {', '.join(rest)}", WIDTH)] if rest else lines


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

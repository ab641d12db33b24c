"""Writing a solution to a file: CSV, NPZ or JSON, chosen by the suffix."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError
from kincompile.runtime.results.columns import TIME_UNIT, shown_unit, titled
from kincompile.runtime.results.solution import (
    Solution,
    require_solution,
)
from kincompile.runtime.status import Status
from kincompile.writing import write_atomically

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from numpy.typing import NDArray

MOTION, OUTPUTS = ("q", "q_dot", "q_ddot"), ("y", "y_dot", "y_ddot")
"""Arrays whose columns have units."""
ENDS = ("status", "residual", "iterations")
"""Arrays of a solution with one number a point."""


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
    """Return the table; every number has as many digits as it takes to read it back exactly."""
    axes = solution.variants if solution.q.ndim > 2 else {}
    columns = [item.shown(angle_unit) for item in solution.columns()]
    titles = [titled(name, solution.units.get(name, "")) for name in axes]
    titles += [titled("t", TIME_UNIT), *(item.title for item in columns), "status", "residual"]
    count, points = solution.status.size, solution.t.size
    before = [*(np.repeat(axis, points) for axis in axes.values()), np.resize(solution.t, count)]
    numbers = np.column_stack([*before, *(item.values.ravel() for item in columns)]).tolist()
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

"""Writing a solution to a file: CSV, NPZ or JSON, chosen by the suffix."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError
from kincompile.runtime.results.columns import TIME_UNIT, titled
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

ARRAYS = ("t", "q", "q_dot", "q_ddot", "status", "residual", "iterations")
"""Arrays of a solution that are written as such."""


def write(solution: Solution, path: str | os.PathLike[str]) -> Path:
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
    return write_atomically(path, _WRITERS[Path(path).suffix.lower()](solution))


def require_known_suffix(path: str | os.PathLike[str]) -> None:
    """Check that the suffix names a format; to be called before long work.

    Raises
    ------
    InputError
        When the suffix is not one that `write` knows.
    """
    if Path(path).suffix.lower() not in _WRITERS:
        raise InputError(f"cannot write {path}: end its name in {', '.join(_WRITERS)}.")


def _csv(solution: Solution) -> str:
    """Return the table; every number has as many digits as it takes to read it back exactly."""
    axes = solution.variants if solution.q.ndim > 2 else {}
    columns = solution.columns()
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


def _npz(solution: Solution) -> bytes:
    """Return the arrays, with names as arrays of text, so that nothing needs to be unpickled."""
    text = {
        "coordinates": solution.coordinates,
        **({"outputs": solution.observed.names} if solution.observed.names else {}),
        "equations": solution.equations,
        "units": [solution.units[name] for name in solution.coordinates],
        "parameters": list(solution.parameters),
    }
    arrays = {name: getattr(solution, name) for name in ARRAYS} | _outputs(solution)
    arrays |= {name: np.array(getattr(solution, name)) for name in ("success", "message", "name")}
    arrays |= {name: np.array(names, dtype=np.str_) for name, names in text.items()}
    arrays["parameter_values"] = np.array(list(solution.parameters.values()), dtype=np.float64)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _outputs(solution: Solution) -> dict[str, NDArray[np.float64]]:
    """Return the arrays of outputs, where there are any."""
    own = solution.observed
    return {name: getattr(own, name) for name in ("y", "y_dot", "y_ddot")} if own.names else {}


def _json(solution: Solution) -> str:
    """Return the document."""
    names = ("name", "success", "message", "coordinates", "equations", "units")
    document = {name: getattr(solution, name) for name in names}
    if solution.observed.names:
        document["outputs"] = solution.observed.names
    document |= {
        "parameters": {k: np.asarray(v).tolist() for k, v in solution.parameters.items()},
        "statuses": {str(int(status)): status.sentence for status in Status},
    }
    arrays = {name: getattr(solution, name) for name in ARRAYS} | _outputs(solution)
    document |= {name: _nullable(values) for name, values in arrays.items()}
    return json.dumps(document, allow_nan=False, ensure_ascii=False) + "\n"


def _nullable(values: NDArray[Any]) -> Any:
    """Return nested lists with None for NaN, which JSON does not know."""
    return np.where(np.isfinite(values), values, np.array(None)).tolist()


_WRITERS: dict[str, Callable[[Solution], str | bytes]] = {
    ".csv": _csv,
    ".npz": _npz,
    ".json": _json,
}

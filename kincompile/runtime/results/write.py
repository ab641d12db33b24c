"""Writing a solution to a file: CSV, NPZ or JSON, chosen by the suffix."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError
from kincompile.runtime.results.labelled import TIME_UNIT
from kincompile.runtime.results.solution import Solution, require_solution
from kincompile.runtime.status import Status
from kincompile.writing import write_atomically

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from numpy.typing import NDArray


def write(solution: Solution, path: str | os.PathLike[str]) -> Path:
    """Write a solution; an existing file is replaced in one step or left as it is.

    Parameters
    ----------
    solution : Solution
        The solution, complete or partial.
    path : path-like
        ``.csv``: one row per point, with the columns t, the coordinates, their first and second
        derivatives, status, residual; the header has names and units, such as ``x_rod [m]``.
        ``.npz``: the arrays and names of the solution for `numpy.load`. ``.json``: the same as
        text, null where a number was not found.

    Returns
    -------
    pathlib.Path
        The path written.

    Raises
    ------
    InputError
        When the suffix is another, the file cannot be written, or a table is asked for of variants.
    """
    require_solution(solution)
    require_known_suffix(path)
    return write_atomically(path, _WRITERS[Path(path).suffix.lower()](solution))


def require_known_suffix(path: str | os.PathLike[str]) -> None:
    """Refuse a name whose suffix says no format: to be called before work that takes long.

    Raises
    ------
    InputError
        When the suffix is not one that `write` knows.
    """
    if Path(path).suffix.lower() not in _WRITERS:
        raise InputError(f"cannot write {path}: end its name in {', '.join(_WRITERS)}.")


def _csv(solution: Solution) -> str:
    """Give the table; every number with as many digits as it takes to read it back exactly."""
    if solution.q.ndim > 2:
        raise InputError(
            f"{solution.name}: a .csv holds one motion, and these are {len(solution.q)} variants; "
            "write .npz or .json"
        )
    titles = [f"t [{TIME_UNIT}]"]
    for name, (unit, _) in solution.labelled_columns().items():
        titles.append(f"{name} [{unit}]" if unit else name)
    lines = [",".join((*titles, "status", "residual"))]
    numbers = np.column_stack((solution.t, solution.q, solution.q_dot, solution.q_ddot)).tolist()
    ends = zip(solution.status.tolist(), solution.residual.tolist(), strict=True)
    for row, (status, residual) in zip(numbers, ends, strict=True):
        lines.append(f"{','.join(map(repr, row))},{status},{residual!r}")
    return "\n".join(lines) + "\n"


def _npz(solution: Solution) -> bytes:
    """Give the arrays, with names as arrays of text, so that nothing needs to be unpickled."""
    buffer = io.BytesIO()
    np.savez(
        buffer,
        t=solution.t,
        q=solution.q,
        q_dot=solution.q_dot,
        q_ddot=solution.q_ddot,
        status=solution.status,
        residual=solution.residual,
        iterations=solution.iterations,
        success=np.array(solution.success),
        message=np.array(solution.message),
        name=np.array(solution.name),
        coordinates=np.array(solution.coordinates, dtype=np.str_),
        equations=np.array(solution.equations, dtype=np.str_),
        units=np.array([solution.units[name] for name in solution.coordinates], dtype=np.str_),
        parameters=np.array(list(solution.parameters), dtype=np.str_),
        parameter_values=np.array(list(solution.parameters.values()), dtype=np.float64),
    )
    return buffer.getvalue()


def _json(solution: Solution) -> str:
    """Give the document."""
    document = {
        "name": solution.name,
        "success": solution.success,
        "message": solution.message,
        "coordinates": solution.coordinates,
        "equations": solution.equations,
        "units": solution.units,
        "parameters": {k: np.asarray(v).tolist() for k, v in solution.parameters.items()},
        "statuses": {str(int(status)): status.sentence for status in Status},
        "t": solution.t.tolist(),
        "q": _nullable(solution.q),
        "q_dot": _nullable(solution.q_dot),
        "q_ddot": _nullable(solution.q_ddot),
        "status": solution.status.tolist(),
        "residual": _nullable(solution.residual),
        "iterations": solution.iterations.tolist(),
    }
    return json.dumps(document, allow_nan=False, ensure_ascii=False) + "\n"


def _nullable(values: NDArray[np.float64]) -> Any:
    """Give nested lists with None for NaN, which JSON does not know."""
    return np.where(np.isfinite(values), values, np.array(None)).tolist()


_WRITERS: dict[str, Callable[[Solution], str | bytes]] = {
    ".csv": _csv,
    ".npz": _npz,
    ".json": _json,
}

"""What the page of a motion shows, as plain data: the script of the page reads nothing else."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.runtime.status import Status
from kincompile.view.shapes import drawing

if TYPE_CHECKING:
    from collections.abc import Iterable
    from types import ModuleType
    from typing import TypeAlias

    from numpy.typing import ArrayLike, NDArray

    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.solution import Solution
    from kincompile.view.shapes import Drawing

    Array: TypeAlias = NDArray[np.float64]

VIOLATED = 1e-6
"""Residual of a constraint, relative to the largest coordinate, from which on it does not hold."""

LARGEST_DENSE = 300
"""Coordinates up to which condition number and determinant of Phi_q are computed."""


@dataclass(frozen=True, slots=True)
class Motion:
    """What is known of a motion, for the page.

    Attributes
    ----------
    solution
        The motion, None where the equations cannot determine one.
    module
        The emitted module, None where there is none.
    message
        What the solver, or the compiler, says.
    """

    solution: Solution | None
    module: ModuleType | None
    message: str


def page_json(system: ConstraintSystem, motion: Motion) -> str:
    """Return all that the page shows as JSON, safe inside a script element.

    Parameters
    ----------
    system
        The mechanism.
    motion
        Its motion, as far as there is one.
    """
    text = json.dumps(page_data(system, motion), allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def page_data(system: ConstraintSystem, motion: Motion) -> dict[str, Any]:
    """Return what the page shows; arrays are little-endian float64 in base64, row by row."""
    guess = np.array([item.guess for item in system.coordinates])
    values = {item.name: item.default or 0.0 for item in system.parameters}
    if motion.solution is not None:
        values |= motion.solution.parameters
    arrays, status, events = _motion_arrays(guess, motion.solution)
    t, q = arrays["t"], arrays["q"]
    shapes = drawing(system, values, q)
    p = np.array(list(values.values()))
    # The guess is the last row: it is shown where no position was found.
    checked_t, checked_q = np.append(t, t[0]), np.vstack((q, guess))
    residual = residuals(motion.module, shapes, checked_q, checked_t, p)
    arrays |= {"residual": residual[:-1], **_singularity(motion, q, t, p)}
    return {
        "name": system.name,
        "message": motion.message,
        "success": bool(motion.solution is not None and motion.solution.success),
        "lengthUnit": system.length_unit,
        "coordinates": [{"name": item.name, "unit": item.unit} for item in system.coordinates],
        "equations": list(system.equations),
        "parameters": [
            {"name": item.name, "value": values[item.name], "unit": item.unit}
            for item in system.parameters
        ],
        "guess": guess.tolist(),
        "guessResidual": _numbers(residual[-1]),
        "violated": VIOLATED * (1 + float(np.max(np.abs(guess), initial=0.0))),
        "status": status,
        "sentences": {item.value: f"{item.name}: {item.sentence}" for item in Status},
        "events": events,
        "drawing": shapes.to_json(),
        "extent": shapes.extent(np.vstack((q, guess)) if np.isnan(q).all() else q),
        "arrays": {name: encoded(array) for name, array in arrays.items()},
    }


def encoded(array: ArrayLike) -> str:
    """Return an array as base64 of its little-endian float64, row by row."""
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode("ascii")


def _motion_arrays(
    guess: Array, solution: Solution | None
) -> tuple[dict[str, Array], list[int], list[dict[str, Any]]]:
    """Return arrays, statuses and events of a motion; without one, a single time that failed."""
    if solution is None:
        nothing = np.full((1, guess.size), np.nan)
        arrays = {"t": np.zeros(1), "q": nothing, "q_dot": nothing, "q_ddot": nothing}
        return arrays, [int(Status.NOT_REACHED)], []
    arrays = {name: getattr(solution, name) for name in ("t", "q", "q_dot", "q_ddot")}
    events = [
        {"kind": item.kind, "t": item.t, "bodies": list(item.bodies), "message": item.message}
        for item in solution.events
    ]
    return arrays, solution.status.tolist(), events


def residuals(module: ModuleType | None, shapes: Drawing, q: Array, t: Array, p: Array) -> Array:
    """Return the norm of each constraint's rows of Phi, shape (N, constraints).

    NaN where there is no module, or Phi is not finite.
    """
    result = np.full((len(q), len(shapes.joints)), np.nan)
    found = np.isfinite(q).all(axis=1)
    if module is None or not found.any():
        return result
    with np.errstate(all="ignore"):
        Phi = module.Phi(np.ascontiguousarray(q[found]), t[found], p)
    for column, joint in enumerate(shapes.joints):
        first, count = joint.rows
        result[found, column] = np.linalg.norm(Phi[:, first : first + count], axis=1)
    return result


def _singularity(motion: Motion, q: Array, t: Array, p: Array) -> dict[str, Array]:
    """Return condition number and determinant of Phi_q over time, where they can be had."""
    module, solution = motion.module, motion.solution
    if module is None or solution is None or q.shape[1] > LARGEST_DENSE:
        return {}
    found = np.isfinite(q).all(axis=1)
    if not found.any():
        return {}
    arrays = {"condition": solution.condition}
    if module.N_EQUATIONS == module.N_COORDINATES:
        determinant = np.full(len(t), np.nan)
        with np.errstate(all="ignore"):
            Phi_q = module.Phi_q(np.ascontiguousarray(q[found]), t[found], p)
            determinant[found] = np.linalg.det(Phi_q)
        arrays["determinant"] = determinant
    return arrays


def _numbers(values: Iterable[float]) -> list[float | None]:
    """Return numbers for JSON, which has no NaN."""
    return [float(value) if np.isfinite(value) else None for value in values]

"""The data of a page: its scripts read nothing else."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import SAME
from kincompile.errors import ModelError
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower
from kincompile.names import ROLES, TRIPLE
from kincompile.report.picture import svg_element
from kincompile.runtime.results.grashof import CHANGE
from kincompile.runtime.singular.events import DOUBTS, SENTENCES
from kincompile.runtime.solve import WORDS
from kincompile.runtime.status import Status
from kincompile.view.drawing import drawing
from kincompile.view.picture import picture

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import ModuleType
    from typing import TypeAlias

    from numpy.typing import NDArray

    from kincompile.model.bodies import Parameter
    from kincompile.model.scope import Point
    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.results.solution import Solution
    from kincompile.view.drawing import Drawing

    Array: TypeAlias = NDArray[np.float64]

VIOLATED = 1e-6
"""Smallest residual of a violated constraint, relative to the largest coordinate."""

LARGEST_DENSE = 300
"""Coordinates up to which the condition number and determinant of Phi_q are computed."""


def page_data(
    system: ConstraintSystem,
    solution: Solution | None,
    message: str,
    *,
    starts_there: bool = False,
    drawn: Mapping[str, Mapping[str, Point]] | None = None,
) -> dict[str, Any]:
    """Return the data that a page shows, as plain values and arrays, and a still picture.

    Parameters
    ----------
    starts_there
        Whether the page itself starts from the first position of the motion, not from the guess.
    drawn
        Joints of a drawing, as `Mechanism.drawn`.
    """
    guess = np.array([item.guess for item in system.coordinates])
    values = {item.name: item.default or 0.0 for item in system.parameters}
    if solution is not None:
        values |= solution.parameters
    p = np.array(list(values.values()))
    arrays, status, events = _motion(guess, solution)
    t, q = arrays["t"], arrays["q"]
    shapes = drawing(system, values, q, drawn or {})
    starts_there = starts_there and bool(np.isfinite(q[0]).all())
    if starts_there:
        shapes = replace(shapes, guess=tuple(q[0]))
    outputs: list[dict[str, str]] = []
    if solution is not None and solution.module is not None:
        arrays |= _checks(solution, solution.module, shapes, p)
        own = solution.observed
        if own.names:
            outputs = [{"name": name, "unit": own.units[name]} for name in own.names]
            arrays |= {"y": own.y, "y_dot": own.y_dot, "y_ddot": own.y_ddot}
    return {
        "name": system.name,
        "message": message,
        "success": solution is not None and solution.success,
        "doubt": "" if solution is None else solution.doubt,
        "reasons": [] if solution is None else list(solution.reasons),
        "lengthUnit": system.length_unit,
        "toml": _toml(system),
        "coordinates": [{"name": item.name, "unit": item.unit} for item in system.coordinates],
        "outputs": outputs,
        "equations": list(system.equations),
        "parameters": [_parameter(item, values[item.name]) for item in system.parameters],
        "start": list(shapes.guess),
        "grashof": {"roles": ROLES, "triple": TRIPLE, "change": CHANGE, "same": SAME},
        "words": {**WORDS, **SENTENCES, **DOUBTS},
        "guess": guess.tolist(),
        "guessResidual": _at_guess(system, shapes, guess, t[0], p),
        "violated": VIOLATED * (1 + float(np.max(np.abs(guess), initial=0.0))),
        "status": status,
        "sentences": {item.value: f"{item.name}: {item.sentence}" for item in Status},
        "events": events,
        "drawing": shapes.to_json(),
        "still": _still(system.name, shapes, np.vstack((q, guess))),
        "extent": shapes.extent(np.vstack((q, guess)) if np.isnan(q).all() else q),
        "arrays": arrays,
    }


def _toml(system: ConstraintSystem) -> str:
    """Return the model as a file has it; nothing where a file cannot hold it."""
    try:
        return system.to_toml()
    except ModelError:
        return ""


def _still(name: str, shapes: Drawing, q: Array) -> str:
    """Return the first position that was found as SVG; nothing where there are no bodies."""
    found = q[np.isfinite(q).all(axis=1)][0]
    return svg_element(picture(shapes, found, f"{name} at the start")) if shapes.bodies else ""


def _parameter(item: Parameter, value: float) -> dict[str, Any]:
    default = item.default or 0.0
    low, high = item.range or sorted((default / 2, 2 * default))
    if low == high:
        low, high = -1.0, 1.0
    return {
        "name": item.name, "value": value, "unit": item.unit, "default": default,
        "low": min(low, value), "high": max(high, value),
    }  # fmt: skip


def as_json(data: Mapping[str, Any]) -> str:
    """Return data of a page as JSON that is safe inside a script element.

    Arrays become base64 of their little-endian float64, row by row.
    """
    arrays = {name: _encoded(array) for name, array in data.get("arrays", {}).items()}
    text = json.dumps({**data, "arrays": arrays}, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _encoded(array: Array) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode("ascii")


def _motion(
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


def _checks(solution: Solution, module: ModuleType, shapes: Drawing, p: Array) -> dict[str, Array]:
    """Return residuals, condition number and determinant over time; NaN without a position."""
    t, q = solution.t, solution.q
    found = np.isfinite(q).all(axis=1)
    arrays: dict[str, Array] = {"residual": np.full((t.size, len(shapes.joints)), np.nan)}
    if not found.any():
        return arrays
    with np.errstate(all="ignore"):
        Phi = module.Phi(np.ascontiguousarray(q[found]), t[found], p)
        arrays["residual"][found] = residuals(Phi, shapes)
        if q.shape[1] <= LARGEST_DENSE:
            arrays["condition"] = solution.condition
            if Phi.shape[-1] == q.shape[-1]:
                Phi_q = module.Phi_q(np.ascontiguousarray(q[found]), t[found], p)
                arrays["determinant"] = np.full(t.size, np.nan)
                arrays["determinant"][found] = np.linalg.det(Phi_q)
    return arrays


def residuals(Phi: Array, shapes: Drawing) -> Array:
    """Return the norm of each constraint's rows of Phi, shape (..., constraints)."""
    norms = [
        np.linalg.norm(Phi[..., first : first + count], axis=-1)
        for first, count in (joint.rows for joint in shapes.joints)
    ]
    return np.stack(norms, axis=-1) if norms else np.zeros((*Phi.shape[:-1], 0))


def _at_guess(
    system: ConstraintSystem, shapes: Drawing, guess: Array, t: float, p: Array
) -> list[float | None]:
    """Return the residual of each constraint at the guess; JSON has no NaN.

    By the interpreter, which also takes systems that cannot be compiled.
    """
    with np.errstate(all="ignore"):
        Phi, *_ = interpret(lower(system), guess, np.zeros_like(guess), t, p)
    return [float(value) if np.isfinite(value) else None for value in residuals(Phi, shapes)]

"""The outputs of a module, compared with differences of them along the motion and by q."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from kincompile.model.system import ConstraintSystem
    from kincompile.verify.samples import Samples

    Array = NDArray[np.float64]

STEP = 1e-3
"""Step of the differences, relative to the scales of coordinates and time."""

WEIGHTS = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))
"""Steps and weights of the central difference of sixth order."""

LIMIT = 1e-7
"""Largest error, relative to the size of the derivative along the scales."""


def errors_of_outputs(
    samples: Samples, model: ConstraintSystem | None
) -> Iterator[tuple[str, str, str, float]]:
    """Yield quantity, output, worst coordinate and error of each derivative of each output.

    Rates and second rates are compared with differences along a motion with constant second rates,
    the Jacobian with differences by each coordinate, the outputs themselves with the model where it
    is known. Where an output has no value, nothing is said of its derivatives.
    """
    module, reference = samples.module, samples.reference
    second = np.roll(samples.q_dot, 1, axis=0)

    def at(s: float, quantity: str) -> Array:
        """Return a quantity a time s later."""
        q = samples.q + s * samples.q_dot + s * s / 2 * second
        rates = samples.q_dot + s * second
        return _of(module, quantity, q, rates, second, samples.t + s, samples.p)

    def aside(s: float, column: int) -> Array:
        """Return the outputs beside the states in one coordinate."""
        q = samples.q + s * reference[column] * np.eye(reference.size)[column]
        return _of(module, "outputs", q, samples.q_dot, second, samples.t, samples.p)

    compared = {"outputs_dot": "outputs", "outputs_ddot": "outputs_dot"}
    errors_of = {
        name: _relative(at(0.0, name), _difference(partial(at, quantity=of)), may_lack=True)
        for name, of in compared.items()
    }
    if model is not None:
        states = samples.q, samples.q_dot, second, samples.t, samples.p
        errors_of["outputs"] = _relative(at(0.0, "outputs"), _of_model(model, *states))
    for quantity, found in errors_of.items():
        for name, error in zip(module.OUTPUTS, found, strict=True):
            yield quantity, name, "", error
    by = [_difference(partial(aside, column=k)) for k in range(reference.size)]
    jacobian = _of(module, "outputs_q", samples.q, samples.q_dot, second, samples.t, samples.p)
    errors = np.array([
        _relative(jacobian[..., k] * reference[k], rough) for k, rough in enumerate(by)
    ])  # fmt: skip
    for name, own in zip(module.OUTPUTS, errors.T, strict=True):
        worst = int(np.argmax(own))
        yield "outputs_q", name, module.COORDINATES[worst], float(own[worst])


def _of(module: Any, quantity: str, *state: Any) -> Array:
    """Return a quantity of the outputs at all states, the rows of points and of batches alike."""
    found: Array = getattr(module, quantity)(*state)
    return found


def _of_model(model: ConstraintSystem, q: Array, q_dot: Array, *rest: Array) -> Array:
    """Return the outputs by the interpreter."""
    program, (q_ddot, t, p) = lower(model), rest
    place = [item.name for item in program.quantities].index("outputs")
    states = zip(q, q_dot, t.tolist(), p, q_ddot, strict=True)
    return np.array([interpret(program, *state)[place] for state in states])


def _difference(at: Callable[[float], Array]) -> Array:
    """Return the derivative at zero, by central differences of sixth order."""
    parts = (weight * (at(k * STEP) - at(-k * STEP)) for k, weight in WEIGHTS)
    found: Array = sum(parts, np.zeros(1)) / STEP
    return found


def _relative(found: Array, rough: Array, *, may_lack: bool = False) -> list[float]:
    """Return the largest error of each output, relative to its largest derivative, 1 at least.

    A rate that is a number nowhere is not there: it would need a third derivative.
    """
    known = np.isfinite(rough)
    if may_lack:
        known &= np.isfinite(found).any(axis=0)
    errors = np.where(known, np.abs(found - rough), 0.0)
    sizes = np.where(known, np.abs(rough), 0.0).max(axis=0)
    errors = np.nan_to_num(errors, nan=np.inf).max(axis=0)
    relative: list[float] = (errors / np.maximum(1.0, sizes)).tolist()
    return relative

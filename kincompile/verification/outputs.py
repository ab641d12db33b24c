"""The outputs of a module, compared with differences of them along the motion and by q."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from kincompile.ir.interpret import interpreter
from kincompile.ir.lower import lower
from kincompile.verification.oracles import DIFFERENCE, slope

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from kincompile.model.system import ConstraintSystem
    from kincompile.verification.samples import Samples

    Array = NDArray[np.float64]

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
    code, reference = samples.code, samples.reference
    second = np.roll(samples.q_dot, 1, axis=0)

    states = samples.q, samples.q_dot, second, samples.t, samples.p

    def at(s: float, quantity: str) -> Array:
        """Return a quantity a time s later."""
        q = samples.q + s * samples.q_dot + s * s / 2 * second
        rates = samples.q_dot + s * second
        return np.asarray(code.functions[quantity](q, rates, second, samples.t + s, samples.p))

    def aside(s: float, column: int) -> Array:
        """Return the outputs beside the states in one coordinate."""
        q = samples.q + s * reference[column] * np.eye(reference.size)[column]
        return np.asarray(code.functions["outputs"](q, *states[1:]))

    compared = {"outputs_dot": "outputs", "outputs_ddot": "outputs_dot"}
    errors_of = {
        name: _relative(at(0.0, name), *_differences(partial(at, quantity=of)), may_lack=True)
        for name, of in compared.items()
    }
    if model is not None:
        values = code.functions["outputs"](*states)
        errors_of["outputs"] = _relative(values, _of_model(model, *states), 0.0)
    for quantity, found in errors_of.items():
        for name, error in zip(code.outputs, found, strict=True):
            yield quantity, name, "", error
    by = [_differences(partial(aside, column=k)) for k in range(reference.size)]
    jacobian = code.outputs_q(*states)
    errors = np.array([
        _relative(jacobian[..., k] * reference[k], *rough) for k, rough in enumerate(by)
    ])  # fmt: skip
    for name, own in zip(code.outputs, errors.T, strict=True):
        worst = int(np.argmax(own))
        yield "outputs_q", name, code.coordinates[worst], float(own[worst])


def _of_model(
    model: ConstraintSystem, q: Array, q_dot: Array, q_ddot: Array, t: Array, p: Array
) -> Array:
    """Return the outputs by the interpreter."""
    return interpreter(lower(model), ("outputs",))(q, q_dot, t, p.T, q_ddot)[0]


def _differences(function: Callable[[float], Array]) -> tuple[Array, Array]:
    """Return a derivative at 0 by differences, and by how much half the step changes it.

    Near a kink or a pole, as where links are nearly folded, that is more than `LIMIT`.
    """
    found, closer = slope(function, DIFFERENCE), slope(function, DIFFERENCE / 2)
    return closer, np.abs(found - closer)


def _relative(
    found: Array, rough: Array, doubt: Array | float, *, may_lack: bool = False
) -> list[float]:
    """Return the largest error of each output, relative to its largest derivative, 1 at least.

    Within its own doubt what it is compared with proves nothing. A rate that is a number nowhere is
    not there: it would need a third derivative.
    """
    known = np.isfinite(rough)
    if may_lack:
        known &= np.isfinite(found).any(axis=0)
    errors = np.where(known, np.maximum(np.abs(found - rough) - doubt, 0.0), 0.0)
    sizes = np.where(known, np.abs(rough), 0.0).max(axis=0)
    errors = np.nan_to_num(errors, nan=np.inf).max(axis=0)
    relative: list[float] = (errors / np.maximum(1.0, sizes)).tolist()
    return relative

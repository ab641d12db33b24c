"""The interpreter: runs kernels and instances as they are, the oracle that needs no emitter."""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.ir.graph import Node
    from kincompile.ir.program import Program
    from kincompile.model.spline import SplineTable

Array = NDArray[Any]

BINARY: Mapping[str, Callable[[Any, Any], Any]] = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "div": operator.truediv,
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
    "==": operator.eq, "!=": operator.ne, "&": np.logical_and, "|": np.logical_or,
}  # fmt: skip
FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2,
    "asinh": np.arcsinh, "acosh": np.arccosh, "atanh": np.arctanh, "pow": np.power,
}  # fmt: skip


def interpret(
    program: Program, q: Array, q_dot: Array, t: Any, p: Array | None = None
) -> tuple[Array, Array, Array, Array]:
    """Evaluate Phi, Phi_q, nu and gamma.

    Parameters
    ----------
    q, q_dot
        Coordinates and rates, shape (..., n), real or complex.
    t
        Time, a scalar.
    p
        Parameters, shape (k,); the defaults where None.

    Returns
    -------
    tuple of arrays
        Phi (..., m), Phi_q (..., m, n), nu (..., m), gamma (..., m).
    """
    q, q_dot = np.asarray(q), np.asarray(q_dot)
    defaults = [item.default for item in program.parameters]
    inputs: dict[str, Any] = {"t": t}
    inputs.update(
        zip((item.name for item in program.parameters), defaults if p is None else p, strict=True)
    )
    for column, item in enumerate(program.coordinates):
        inputs[item.name] = q[..., column]
        inputs[rate(item.name)] = q_dot[..., column]
    values = run(program.values, inputs, program.tables)

    shape, m, n = q.shape[:-1], len(program.equations), len(program.coordinates)
    dtype = np.result_type(q, q_dot, float)
    Phi, nu, gamma = (np.zeros((*shape, m), dtype) for _ in range(3))
    Phi_q = np.zeros((*shape, m, n), dtype)
    for instance in program.instances:
        kernel = instance.kernel
        bound = {
            name: values[node] for name, node in zip(kernel.inputs, instance.bindings, strict=True)
        }
        results = run(kernel.nodes, bound, program.tables)
        for vector, nodes in ((Phi, kernel.Phi), (nu, kernel.nu), (gamma, kernel.gamma)):
            for row, node in enumerate(nodes):
                vector[..., instance.first_row + row] = results[node]
        for row, local, node in kernel.Phi_q:
            column_or_ground = instance.columns[local]
            if column_or_ground is not None:
                Phi_q[..., instance.first_row + row, column_or_ground] = results[node]
    return Phi, Phi_q, nu, gamma


def run(
    nodes: Sequence[Node], inputs: Mapping[str, Any], tables: Mapping[str, SplineTable]
) -> list[Any]:
    """Evaluate straight-line code and return the value of every node."""
    values: list[Any] = []
    for operation, *operands in nodes:
        values.append(_apply(operation, operands, values, inputs, tables))
    return values


def _apply(
    operation: str,
    operands: list[Any],
    values: list[Any],
    inputs: Mapping[str, Any],
    tables: Mapping[str, SplineTable],
) -> Any:
    match operation, operands:
        case "const", [number]:
            return float(number)
        case "pi", _:
            return np.pi
        case "input", [name]:
            return inputs[name]
        case "neg", [a]:
            return -values[a]
        case "square", [a]:
            return values[a] * values[a]
        case "call", [name, *arguments]:
            function = FUNCTIONS.get(name) or getattr(np, name)
            return function(*(values[k] for k in arguments))
        case "compare" | "logic", [name, a, b]:
            return BINARY[name](values[a], values[b])
        case "select", [condition, a, b]:
            return np.where(values[condition], values[a], values[b])
        case "table", [name, order, a]:
            return np.vectorize(tables[name], otypes=[float])(values[a], order)
    a, b = operands
    return BINARY[operation](values[a], values[b])

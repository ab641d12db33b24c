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
    from kincompile.ir.program import Instance, Kernel, Program
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
        Time, a scalar or of shape (...).
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
    dtype = np.result_type(q, q_dot, t, float)
    every = np.empty((*shape, len(values)), dtype)
    for node, value in enumerate(values):
        every[..., node] = value
    Phi, nu, gamma = (np.zeros((*shape, m), dtype) for _ in range(3))
    Phi_q = np.zeros((*shape, m, n), dtype)
    for kernel, instances in _by_kernel(program):
        bindings = np.array([instance.bindings for instance in instances], dtype=np.intp)
        bound = {name: every[..., bindings[:, k]] for k, name in enumerate(kernel.inputs)}
        results = run(kernel.nodes, bound, program.tables)
        rows = np.array([instance.first_row for instance in instances])
        for vector, nodes in ((Phi, kernel.Phi), (nu, kernel.nu), (gamma, kernel.gamma)):
            for row, node in enumerate(nodes):
                vector[..., rows + row] = results[node]
        grounded = [[-1 if c is None else c for c in instance.columns] for instance in instances]
        columns = np.array(grounded, dtype=np.intp).reshape(len(instances), -1)
        for row, local, node in kernel.Phi_q:
            moving = np.flatnonzero(columns[:, local] >= 0)
            entries = np.broadcast_to(results[node], (*shape, len(instances)))
            Phi_q[..., rows[moving] + row, columns[moving, local]] = entries[..., moving]
    return Phi, Phi_q, nu, gamma


def _by_kernel(program: Program) -> list[tuple[Kernel, list[Instance]]]:
    """Return the instances of each kernel, which run together as arrays."""
    found: dict[int, tuple[Kernel, list[Instance]]] = {}
    for instance in program.instances:
        found.setdefault(id(instance.kernel), (instance.kernel, []))[1].append(instance)
    return list(found.values())


def run(
    nodes: Sequence[Node], inputs: Mapping[Any, Any], tables: Mapping[str, SplineTable]
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
    inputs: Mapping[Any, Any],
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

"""The interpreter: runs kernels and instances as they are, the oracle that needs no emitter."""

from __future__ import annotations

import operator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.ir.graph import pruned
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.ir.graph import Node
    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Instance, Kernel, Program
    from kincompile.model.spline import SplineTable
    from kincompile.quantities import Quantity

Array = NDArray[Any]


def angle(y: Any, x: Any) -> Any:
    """Return arctan2 of y and x, continued to complex numbers."""
    if not (np.iscomplexobj(y) or np.iscomplexobj(x)):
        return np.arctan2(y, x)
    b, a = np.real(y), np.real(x)
    return np.arctan2(b, a) + np.arctan((y * a - x * b) / (x * a + y * b))


BINARY: Mapping[str, Callable[[Any, Any], Any]] = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "div": operator.truediv,
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
    "==": operator.eq, "!=": operator.ne, "&": np.logical_and, "|": np.logical_or,
}  # fmt: skip
FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": angle,
    "asinh": np.arcsinh, "acosh": np.arccosh, "atanh": np.arctanh, "pow": np.power,
}  # fmt: skip


def interpret(
    program: Program,
    q: Array,
    q_dot: Array,
    t: Any,
    p: Array | None = None,
    q_ddot: Array | None = None,
) -> tuple[Array, ...]:
    """Evaluate the quantities, in the order of the table, at q, q_dot and q_ddot of shape (..., n).

    They may be complex. t is a scalar or of shape (...), p of shape (k,), or (k, ...) with a set
    for each point; without it the defaults are taken. Without q_ddot, for outputs, it is zero. Phi
    is (..., m), Phi_q (..., m, n), and so on; outputs, or M, Q and its Jacobians, come where there
    are any.
    """
    return interpreter(program)(q, q_dot, t, p, q_ddot)


def interpreter(
    program: Program, wanted: Sequence[str] | None = None
) -> Callable[..., tuple[Array, ...]]:
    """Return what evaluates some quantities as `interpret` does all, and nothing but these.

    What they need of the code, and where their entries stand, is found once.
    """
    quantities = [item for item in program.quantities if wanted is None or item.name in wanted]
    parts = [_Part.of(kernel, instances, quantities) for kernel, instances in by_kernel(program)]
    shared, number = pruned(
        program.values, {k for part in parts for some in part.bound.values() for k in some}
    )
    bindings = [
        {name: np.array([number[k] for k in some]) for name, some in part.bound.items()}
        for part in parts
    ]

    def evaluate(
        q: Array, q_dot: Array, t: Any, p: Array | None = None, q_ddot: Array | None = None
    ) -> tuple[Array, ...]:
        q, q_dot = np.asarray(q), np.asarray(q_dot)
        q_ddot = 0 * q if q_ddot is None else np.asarray(q_ddot)
        values = run(shared, inputs_of(program, (q, q_dot, q_ddot), t, p), program.tables)

        shape = q.shape[:-1]
        dtype = np.result_type(q, q_dot, q_ddot, t, float)
        every = np.empty((*shape, len(values)), dtype)
        for node, value in enumerate(values):
            every[..., node] = value
        found = [np.zeros((*shape, *program.shape_of(item)), dtype) for item in quantities]
        for part, bound in zip(parts, bindings, strict=True):
            inputs = {name: every[..., some] for name, some in bound.items()}
            results = run(part.nodes, inputs, program.tables)
            for place, node, moving, at in part.entries:
                entries = results[node]
                if np.ndim(entries):
                    entries = entries[..., moving]
                if quantities[place].adds:
                    np.add.at(found[place], at, entries)
                else:
                    found[place][at] = entries
        return tuple(found)

    return evaluate


@dataclass(frozen=True, slots=True)
class _Part:
    """What some quantities need of the instances of a kernel, which run together."""

    nodes: Sequence[Node]
    bound: Mapping[Any, Sequence[int]]  # for each input the shared value of each instance
    # Quantity, node, which instances have an entry (not on the ground), and the indices of these.
    entries: Sequence[tuple[int, int, Array, Any]]

    @classmethod
    def of(
        cls, kernel: Kernel, instances: Sequence[Instance], quantities: Sequence[Quantity]
    ) -> _Part:
        """Return what they need, and where their entries stand."""
        outputs = [
            (place, *entry)
            for place, quantity in enumerate(quantities)
            for entry in kernel.outputs.get(quantity.name, ())
        ]
        nodes, number = pruned(kernel.nodes, [node for *_, node in outputs])
        names = {node[1] for node in nodes if node[0] == "input"}
        bound = {
            name: [instance.bindings[k] for instance in instances]
            for k, name in enumerate(kernel.inputs)
            if name in names
        }
        placed, entries = Placed.of(instances), list[tuple[int, int, Array, Any]]()
        for place, row, column, node in outputs:
            quantity = quantities[place]
            rows, columns = placed.entry(quantity, row, column)
            moving = (rows >= 0) & (columns >= 0)
            at = (..., rows[moving], columns[moving])[: 2 + quantity.is_matrix]
            entries.append((place, number[node], moving, at))
        return cls(nodes, bound, entries)


def inputs_of(program: Program, states: Sequence[Array], t: Any, p: Any) -> dict[str, Any]:
    """Return the values of the inputs by name; `states` are q, q_dot and q_ddot."""
    values = [item.default for item in program.parameters] if p is None else p
    names = (item.name for item in program.parameters)
    inputs = {"t": t, **dict(zip(names, values, strict=True))}
    for order, state in enumerate(states):
        for column, item in enumerate(program.coordinates):
            inputs[rate(item.name, order)] = state[..., column]
    return inputs


def evaluator(
    code: InlineProgram, wanted: Sequence[str] = ("Phi", "Phi_q")
) -> Callable[..., tuple[Array, ...]]:
    """Return what gives the entries of quantities of a position alone, shape (entries, ...).

    It is called with q, of shape (..., n), and if need be with t and p, as `interpret` is.
    """
    program, entries = code.program, [code.entries(quantity) for quantity in wanted]
    nodes, number = pruned(code.nodes, [x.node for some in entries for x in some])
    # NumPy's numbers: a division by zero is infinite, where Python's raises.
    start, defaults = np.float64(0), np.array([x.default for x in program.parameters], dtype=float)

    def evaluate(q: Array, t: Any = start, p: Array = defaults) -> tuple[Array, ...]:
        values = run(nodes, inputs_of(program, (q, np.zeros_like(q)), t, p), program.tables)
        shape = q.shape[:-1]
        return tuple(
            np.array([np.broadcast_to(values[number[x.node]], shape) for x in some])
            for some in entries
        )

    return evaluate


@dataclass(frozen=True, slots=True)
class Placed:
    """Where the entries of constraints of one kernel stand."""

    # First row of each constraint, shape (L,), in the equations and in the outputs.
    rows: Mapping[str, Array]
    columns: Array  # column of each of the type's coordinates, shape (L, c), -1 on the ground

    @classmethod
    def of(cls, instances: Sequence[Instance]) -> Placed:
        """Return the places of constraints."""
        rows = {
            "equations": np.array([instance.first_row for instance in instances]),
            "outputs": np.array([instance.first_output for instance in instances]),
        }
        grounded = [[-1 if c is None else c for c in instance.columns] for instance in instances]
        return cls(rows, np.array(grounded, dtype=np.intp).reshape(len(instances), -1))

    def some(self, members: Array) -> Placed:
        """Return the places of some of the constraints."""
        rows = {kind: first[members] for kind, first in self.rows.items()}
        return Placed(rows, self.columns[members])

    def entry(self, quantity: Quantity, row: int, column: int) -> tuple[Array, Array]:
        """Return row and column of an entry of the kernel for each constraint, -1 on the ground."""
        if quantity.rows == "coordinates":
            rows = self.columns[:, row]
        else:
            rows = self.rows[quantity.rows] + row
        is_own = quantity.columns == "coordinates"
        return rows, self.columns[:, column] if is_own else np.full_like(rows, column)


def by_kernel(program: Program) -> list[tuple[Kernel, list[Instance]]]:
    """Return the instances of each kernel, which run together as arrays."""
    found: dict[int, tuple[Kernel, list[Instance]]] = {}
    for instance in program.parts:
        found.setdefault(id(instance.kernel), (instance.kernel, []))[1].append(instance)
    return list(found.values())


def run(
    nodes: Sequence[Node], inputs: Mapping[Any, Any], tables: Mapping[str, SplineTable]
) -> list[Any]:
    """Evaluate straight-line code and return the value of every node."""
    values: list[Any] = []
    for operation, *operands in nodes:
        values.append(apply(operation, operands, values, inputs, tables))
    return values


def apply(
    operation: str,
    operands: list[Any],
    values: list[Any],
    inputs: Mapping[Any, Any],
    tables: Mapping[str, SplineTable],
) -> Any:
    """Evaluate one operation on the values of nodes before it."""
    match operation, operands:
        case "const", [number]:
            return float(number)
        case "pi", _:
            return np.pi
        case "nan", _:
            return np.nan
        case "input", [name]:
            return inputs[name]
        case "neg", [a]:
            return -values[a]
        case "square", [a]:
            return values[a] * values[a]
        case "call", [name, *arguments]:
            function = FUNCTIONS.get(name) or getattr(np, name)
            return function(*(values[k] for k in arguments))
        case "compare", [name, a, b]:  # of complex steps the real parts
            return BINARY[name](np.real(values[a]), np.real(values[b]))
        case "logic", [name, a, b]:
            return BINARY[name](values[a], values[b])
        case "select", [condition, a, b]:
            return np.where(values[condition], values[a], values[b])
        case "table", [name, order, a]:
            return np.vectorize(tables[name], otypes=[float])(values[a], order)
    a, b = operands
    return BINARY[operation](values[a], values[b])

"""The planned elimination of Phi_q dq = -Phi_u du, with every number of it as a formula.

What is shown is the compiler's plan: its pivots, its blocks, and the very nodes that its code has.
Nothing is derived here.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy
from sympy.simplify.fu import TR10i

from kincompile.calculus.expressions import Scalar, Symbol
from kincompile.derivations.evaluation import evaluation, finite_value
from kincompile.derivations.expanded import Writer
from kincompile.errors import AssemblyWarning, InputError, StructuralError
from kincompile.ir.differentiate import tangents
from kincompile.ir.elimination import plan_solve
from kincompile.ir.graph import Graph, operands_of, pruned, reachable
from kincompile.ir.interpret import apply
from kincompile.names import column_name, listed, rate, unknown
from kincompile.report.formulas import DerivativeSymbol, size
from kincompile.runtime.solve import solve_sets

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kincompile.derivations.evaluation import Evaluation
    from kincompile.ir.elimination import SolvePlan
    from kincompile.transmissions.loop import Loop

LONGEST_OPERAND = 18
"""Nodes of a formula up to which it is written within another one; a longer one gets a name."""

MOST_OPERATIONS = 250
"""Operations of a formula up to which SymPy is asked for a shorter one."""


def evaluation_of(loop: Loop, state: Mapping[str, float] | float | None) -> Evaluation:
    """Return a loop at one pose, on the branch of its first one.

    The state has values of inputs and parameters by name.

    Raises
    ------
    InputError
        If a name is unknown, or there is no pose on that branch.
    """
    system = loop.system
    home = evaluation(system, {"t": 0.0})
    if not home.is_assembled:
        raise InputError(
            f"{system.name} cannot be assembled at the first values of its inputs, "
            f"{listed(loop.inputs)}: give a better guess."
        )
    if state is None:
        return replace(home, origin="the first values of the inputs")
    if not isinstance(state, Mapping):
        raise InputError(
            f"the state of a transmission is {state!r}, and a transmission has no time: give the "
            "values of inputs and parameters by name."
        )
    known = [item.name for item in system.parameters]
    named = dict(zip(loop.inputs, loop.parameters, strict=True))
    p = home.p.copy()
    for title, value in state.items():
        name = named.get(title, named.get(column_name(title), title))
        if name not in known:
            text = f"the transmission {system.name} has no input and no parameter {title!r}"
            raise InputError(unknown(text, title, [*loop.inputs, *known]))
        p[known.index(name)] = finite_value(title, value)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AssemblyWarning)
        found = solve_sets(home.module, 0.0, p[np.newaxis], home.q, home.p)
    if not found.success:
        raise InputError(
            f"the branch of the first pose of {system.name} has none at this state: {found.message}"
        )
    values = zip((*home.coordinates, *known), (*found.q[0, 0], *p), strict=True)
    return replace(evaluation(system, dict(values)), origin="the state that was asked for")


class NamedWriter(Writer):
    """Writes nodes as formulas in which long operands are names, ``w_1``, ``w_2`` and so on."""

    def __init__(self, graph: Graph) -> None:
        super().__init__(graph.nodes)
        self._count = 0
        self._new: list[tuple[Scalar, Scalar]] = []

    def formula(self, node: int) -> Scalar:
        """Return a node as a formula; within another one a long formula is a name."""
        waiting = [node]
        while waiting:
            own = waiting[-1]
            operands = operands_of(self._nodes[own])
            if own in self._done:
                waiting.pop()
            elif missing := [k for k in operands if k not in self._done]:
                waiting += missing
            else:
                for operand in operands:
                    self.operand(operand)
                self._done[own] = self._formula(own)
        return self._done[node]

    def operand(self, node: int) -> Scalar:
        """Return a node as it stands within another formula: a long one is a name."""
        if size(found := self.formula(node)) > LONGEST_OPERAND:
            self._count += 1
            self._new.append((self.called(node, f"w_{self._count}"), found))
        return self._done[node]

    def called(self, node: int, name: str | DerivativeSymbol) -> Scalar:
        """Return a name, by which a node is called from now on."""
        self._done[node] = Symbol(name) if isinstance(name, str) else name
        return self._done[node]

    def is_long(self, node: int) -> bool:
        """Return whether a node, which has no name yet, is made of too many others for a line."""
        return node not in self._done and len(reachable(self._nodes, [node])) > LONGEST_OPERAND

    def introduced(self) -> list[tuple[Scalar, Scalar]]:
        """Return the names given since this was last asked, and what they stand for."""
        found, self._new = self._new, []
        return found


class Elimination:
    """A loop at one pose: its equations in differentials, eliminated as the compiler plans it.

    Attributes
    ----------
    graph
        The formulas, as nodes.
    plan
        Pivots, blocks and what is left of the equations.
    rows, by_inputs
        Nodes of Phi, and of Phi_u: by equation, then by input.
    slopes
        Nodes of q_u: by coordinate, then by input.
    outputs, x_q, x_u
        Nodes of the outputs, and of their derivatives by coordinates and by inputs; of velocities
        by the rates of these.
    J
        Nodes of dx/du: by output, then by input.
    """

    def __init__(self, chosen: Evaluation, loop: Loop) -> None:
        code, self._chosen = chosen.code, chosen
        plan = plan_solve(code, is_straight=True, near=chosen.q.tolist())
        if plan is None:
            raise StructuralError(
                f"{loop.system.name!r} is no function of its inputs: "
                f"{code.program.unsolvable or 'Phi_q is singular at every position'}"
            )
        self.plan: SolvePlan = plan
        self.graph = graph = Graph(code.nodes)
        self.rows = [x.node for x in sorted(code.entries("Phi"), key=lambda x: x.row)]
        by_inputs = [self._partials(self.rows, name) for name in loop.parameters]
        self.by_inputs = _turned(by_inputs)
        given = {x.name: x.node for x in code.entries("Phi_q")}
        # What the plan computes, for the right side that belongs to each input.
        self._made = [
            graph.instantiate(
                plan.nodes,
                given | {f"b[{row}]": graph.neg(node) for row, node in enumerate(own)},
            )
            for own in by_inputs
        ]
        self.slopes = [[new[node] for new in self._made] for node in plan.solution]
        names = code.program.names_of("outputs")
        known = {names[x.row]: x.node for x in (code.entries("outputs") if names else ())}
        self.outputs = [known.get(name, graph.input(name)) for name in loop.outputs]
        # Of a velocity the derivatives by rates: q_u maps those of the inputs to them.
        is_rate = [name in loop.twists for name in loop.outputs]
        by_q, by_rates, by_u = (
            _turned([self._partials(self.outputs, name) for name in names])
            for names in (chosen.coordinates, map(rate, chosen.coordinates), loop.parameters)
        )
        self.x_q = _chosen(is_rate, by_rates, by_q)
        self.x_u = _chosen(is_rate, [[graph.const(0)] * len(row) for row in by_u], by_u)
        self.J = [
            [self._chained(row, k, node) for k, node in enumerate(direct)]
            for row, direct in zip(self.x_q, self.x_u, strict=True)
        ]
        self.writer = NamedWriter(graph)

    def _partials(self, nodes: Sequence[int], name: str) -> list[int]:
        return tangents(self.graph, nodes, {self.graph.input(name): self.graph.const(1)})

    def _chained(self, row: Sequence[int], k: int, total: int) -> int:
        """Return the sum of x_q q_u and x_u."""
        for node, slopes in zip(row, self.slopes, strict=True):
            total = self.graph.add(total, self.graph.mul(node, slopes[k]))
        return total

    def is_zero(self, node: int) -> bool:
        """Return whether a node is a plain zero."""
        return self.graph.value_of(node) == 0

    def row(self, row: int) -> dict[int, int]:
        """Return what is left of an equation where it is used: nodes by column, without zeros."""
        found = {column: self._made[0][node] for column, node in self.plan.rows[row].items()}
        return {k: node for k, node in sorted(found.items()) if not self.is_zero(node)}

    def side(self, row: int) -> list[int]:
        """Return the nodes of its right side, by input."""
        return [new[self.plan.sides[row]] for new in self._made]

    def basis(self, column: int) -> dict[int, int]:
        """Return the nodes of which an Euler parameter is made, without the stretch, the first."""
        found = {k: self._made[0][node] for k, node in self.plan.bases[column].items()}
        return {k: node for k, node in list(found.items())[1:] if not self.is_zero(node)}

    @cached_property
    def determinants(self) -> list[list[int]]:
        """Nodes of each block's determinant: one, or the pivots whose product it is."""
        rest = iter(self._made[0][node] for node in self.plan.determinants)
        straight = self.plan.straight
        return [
            [next(rest) for _ in (x.rows if len(x.rows) > straight else x.rows[:1])]
            for x in self.plan.blocks
        ]

    @cached_property
    def _values(self) -> list[Any]:
        """The numbers of all nodes at the pose."""
        given: Mapping[Any, float] = self._chosen.values
        tables, found = self._chosen.code.program.tables, list[Any]()
        with np.errstate(all="ignore"):
            for operation, *operands in self.graph.nodes:
                is_known = operation != "input" or operands[0] in given
                known = apply(operation, operands, found, given, tables) if is_known else math.nan
                found.append(known)
        return found

    def value(self, node: int) -> float:
        """Return the number of a node at the pose."""
        return float(self._values[node])

    def array(self, nodes: Sequence[Sequence[int]]) -> NDArray[np.float64]:
        """Return the numbers of nodes, row by row."""
        return np.array([[self.value(node) for node in row] for row in nodes])

    def shorter(self, node: int) -> sympy.Expr | None:
        """Return a node shortened by the addition theorems; None where that does not help."""
        found = _symbolic(self.graph, node)
        return None if found is None else _in_decimals(_shortened(found))

    @cached_property
    def short_determinant(self) -> sympy.Expr | None:
        """The determinant of J, shortened likewise, of one input or two."""
        if (size := len(self.J)) > 2 or size != len(self.J[0]):
            return None
        short: list[Any] = []
        for found in (_symbolic(self.graph, node) for row in self.J for node in row):
            if found is None:
                return None
            short.append(_shortened(found) or found)
        if size == 1:
            return _in_decimals(short[0])
        a, b, c, d = short
        return _in_decimals(_shortened(a * d - b * c))


def _chosen(
    is_one: Sequence[bool], one: Sequence[list[int]], other: Sequence[list[int]]
) -> list[list[int]]:
    return [a if is_so else b for is_so, a, b in zip(is_one, one, other, strict=True)]


def _shortened(found: sympy.Expr) -> sympy.Expr | None:
    top, bottom = (_collected(part) for part in sympy.fraction(sympy.together(found)))
    short: sympy.Expr = top / bottom
    return short if sympy.count_ops(short) < sympy.count_ops(found) else None


def _collected(part: sympy.Expr) -> Any:
    """Return a sum with the sines of sums of angles that are in it, as a product."""
    factors = sympy.Mul.make_args(sympy.factor(part))
    return sympy.factor(sympy.Mul(*(TR10i(sympy.expand(x)) for x in factors)))


def _in_decimals(found: sympy.Expr | None) -> sympy.Expr | None:
    if found is None:
        return None
    rationals = {x for x in found.atoms(sympy.Rational) if not x.is_Integer}
    decimals: sympy.Expr = found.xreplace({x: sympy.Float(x, 15) for x in rationals})
    return decimals


def _turned(columns: Sequence[Sequence[int]]) -> list[list[int]]:
    return [list(row) for row in zip(*columns, strict=True)]


OPERATIONS: Mapping[str, Callable[..., Any]] = {
    "add": sympy.Add,
    "mul": sympy.Mul,
    "sub": lambda a, b: a - b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "square": lambda a: a**2,
    "call": lambda name, a: getattr(sympy, name)(a),
}


def _symbolic(graph: Graph, node: int) -> sympy.Expr | None:
    """Return a node as an expression of SymPy, numbers as they are written in decimals.

    None where it is longer than `MOST_OPERATIONS`, or has other operations than a closed form.
    """
    code, number = pruned(graph.nodes, [node])
    found: list[Any] = []
    sizes: list[int] = []
    for operation, *operands in code:
        given = operands[1:] if operation == "call" else operands
        is_leaf = operation in ("const", "pi", "input")
        sizes.append(1 if is_leaf else 1 + sum(sizes[k] for k in given))
        if operation == "const":
            found.append(sympy.Rational(str(operands[0])))
        elif operation == "pi":
            found.append(sympy.pi)
        elif operation == "input":
            found.append(sympy.Symbol(str(operands[0])))
        else:
            is_closed = operation != "call" or operands[0] in ("sin", "cos", "sqrt")
            if operation not in OPERATIONS or not is_closed or sizes[-1] > MOST_OPERATIONS:
                return None
            names = operands[:1] if operation == "call" else []
            found.append(OPERATIONS[operation](*names, *(found[k] for k in given)))
    expression: sympy.Expr = found[number[node]]
    return expression

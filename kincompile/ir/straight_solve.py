"""The planned elimination written out in a graph: solves with Phi_q and with its transpose."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from kincompile.ir.graph import depending_on
from kincompile.ir.looks import root_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from kincompile.ir.elimination import SolvePlan
    from kincompile.ir.graph import Graph, Node
    from kincompile.ir.inline import Entry
    from kincompile.ir.looks import Look


class StraightSolve:
    """Code that solves linear systems of one matrix, Phi_q or that of the equations of motion.

    The plan makes no calls of LAPACK; its code is added to the graph in which the entries are
    nodes.
    """

    def __init__(self, graph: Graph, entries: Iterable[Entry], plan: SolvePlan) -> None:
        self._graph, self._plan = graph, plan
        self._given = {x.name: x.node for x in entries}
        self._solved = self._planned([graph.input(("b", row)) for row in range(len(plan.right))])
        self._moving = depending_on(plan.nodes, plan.right)
        self.determinants = [self._solved[node] for node in plan.determinants]

    def _planned(self, right: Sequence[int]) -> list[int]:
        """Return the nodes of the planned elimination for a right side."""
        given = self._given | {f"b[{row}]": node for row, node in enumerate(right)}
        return self._graph.instantiate(self._plan.nodes, given)

    def solve(self, right: Sequence[int]) -> list[int]:
        """Return x of A x = b."""
        new = self._planned(right)
        return [new[node] for node in self._plan.solution]

    def looks(self, right: Sequence[int] | None = None) -> list[Look]:
        """Return the looks at a solve; those of Phi_q have a right side of their own."""
        new = self._solved if right is None else self._planned(right)
        return [look.within(new) for look in self._plan.looks]

    def missed(self, right: Sequence[int] | None = None, besides: Sequence[int] = ()) -> int:
        """Return by what part of their terms equations are missed.

        Squares of what derivatives of them miss may be added.
        """
        own = (look.missed(self._graph) for look in self.looks(right))
        return root_of(self._graph, (*own, *besides))

    def transposed(self, sides: Sequence[int]) -> list[int]:
        """Return x of A^T x = b: the plan, linear in its right side, from its end to its start.

        Every number of the plan hands on to its operands what the solution owes to it.
        """
        graph, plan, zero = self._graph, self._plan, self._graph.const(0)
        owed = dict.fromkeys(self._moving, zero)
        for node, side in zip(plan.solution, sides, strict=True):
            owed[node] = graph.add(owed[node], side)
        for node in sorted(self._moving, reverse=True):
            for operand, share in self._shares(plan.nodes[node], owed[node]):
                owed[operand] = graph.add(owed[operand], share)
        return [owed[node] for node in plan.right]

    def _shares(self, content: Node, amount: int) -> Iterator[tuple[int, int]]:
        """Yield the operands of a step that depend on the right side, and what each is owed."""
        graph, new = self._graph, self._solved
        shares: tuple[tuple[int, int], ...] = ()
        match content:
            case "add", a, b:
                shares = ((a, amount), (b, amount))
            case "sub", a, b:
                shares = ((a, amount), (b, graph.neg(amount)))
            case "neg", a:
                shares = ((a, graph.neg(amount)),)
            case "mul", a, b:
                shares = ((a, graph.mul(amount, new[b])), (b, graph.mul(new[a], amount)))
            case "select", condition, a, b:
                nothing, choose = graph.const(0), partial(graph.select, new[condition])
                shares = ((a, choose(amount, nothing)), (b, choose(nothing, amount)))
            case "div", a, b:
                shares = ((a, graph.div(amount, new[b])),)
        yield from ((node, share) for node, share in shares if node in self._moving)

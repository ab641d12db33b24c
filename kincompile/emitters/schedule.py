"""Straight-line code: which values get a name, and in which order they are computed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.ir.graph import number_of, operands_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from kincompile.emitters.naming import NameTable
    from kincompile.ir.graph import Constant, Node

DEEPEST = 60
"""Operations within each other, a long sum's for instance, after which a value gets a name: neither
the printer nor the languages take any number of them."""

LONGEST_PRODUCT = 24
"""Characters up to which a product is named by its factors."""


@dataclass(frozen=True, slots=True)
class Assignment:
    """A value with a name."""

    node: int
    name: str


class Scheduler:
    """Names the values of a function that are used more than once, operands before their users.

    Names, by node, are first those of the inputs; those of the values are added, there and to the
    table of all that are taken. Labels say what a value is; a node that is kept gets a name however
    often it is used.
    """

    def __init__(
        self,
        nodes: Sequence[Node],
        outputs: Iterable[int],
        names: dict[int, str],
        table: NameTable,
        labels: Mapping[int, str],
        kept: Collection[int] = (),
    ) -> None:
        self._nodes, self._table, self._labels, self._kept = nodes, table, labels, kept
        self._depths: dict[int, int] = {}
        self.names = names
        self.uses = count_uses(nodes, outputs)

    def assign(self, stem: str, order: Iterable[int]) -> tuple[Assignment, ...]:
        """Return the values that get a name, of those in order.

        A value that is called nothing else is called by the stem and a number.
        """
        found: list[Assignment] = []
        for node in order:
            if self._needs_name(node):
                found.append(self.name(node, f"{stem}_{len(found) + 1}"))
        return tuple(found)

    def name(self, node: int, otherwise: str = "") -> Assignment:
        """Give a node its name, the one given where nothing says what it is."""
        wanted = self._labels.get(node) or content_name(self._nodes, node, self.names) or otherwise
        self.names[node] = self._table.take(wanted)
        return Assignment(node, self.names[node])

    def operands_first(self, starts: Iterable[int]) -> list[int]:
        """Return what the starts depend on down to what has a name, operands before users."""
        order: dict[int, None] = {}
        stack = [(node, False) for node in reversed(list(starts))]
        while stack:
            node, done = stack.pop()
            if done:
                order[node] = None
            elif node not in order and node not in self.names:
                stack.append((node, True))
                stack += [(operand, False) for operand in reversed(operands_of(self._nodes[node]))]
        return list(order)

    def _needs_name(self, node: int) -> bool:
        """Return whether a node, whose operands have been seen, is to be named."""
        if node in self.names:
            return False
        operands = operands_of(self._nodes[node])
        inner = (self._depths.get(k, 0) for k in operands if k not in self.names)
        self._depths[node] = 1 + max(inner, default=0)
        if node in self._kept:
            return number_of(self._nodes, node) is None
        is_wanted = self.uses[node] > 1 or self._depths[node] % DEEPEST == 0
        return is_wanted and self._costs(node)

    def _costs(self, node: int) -> bool:
        """Return whether a value costs anything.

        An input, a number, a number times pi and a changed sign do not.
        """
        kind = self._nodes[node][0]
        if kind in ("input", "const", "pi", "nan", "neg"):
            return False
        return any(self._nodes[k][0] not in ("const", "pi") for k in operands_of(self._nodes[node]))


def count_uses(nodes: Sequence[Node], outputs: Iterable[int]) -> Counter[int]:
    """Count how often each value is used, outputs too; a changed sign is no value of its own."""
    starts = list(outputs)
    uses = [0] * (max(starts, default=-1) + 1)
    for node in starts:
        uses[node] += 1
    for node in range(len(uses) - 1, -1, -1):
        if uses[node]:
            weight = uses[node] if nodes[node][0] == "neg" else 1
            for operand in operands_of(nodes[node]):
                uses[operand] += weight
    return Counter({node: count for node, count in enumerate(uses) if count})


def content_name(nodes: Sequence[Node], node: int, names: Mapping[int, str]) -> str | None:
    """Return a name that says what a small node is.

    It is `a_2` for a/2, `sin_theta`, `a_c_crank` for a c_crank; None for a larger node.
    """
    match nodes[node]:
        case ("div", int(a), int(b)) if a in names and isinstance(_constant(nodes[b]), int):
            return f"{names[a]}_{_constant(nodes[b])}"
        case ("square", int(a)) if a in names:
            return f"{names[a]}_sq"
        case ("call", str(function), int(a)) if a in names:
            return f"{function}_{names[a]}"
        case ("mul", int(a), int(b)) if a in names and b in names:
            name = f"{names[a]}_{names[b]}"
            is_clear = not (names[a][-1].isdigit() or names[b][-1].isdigit())
            return name if is_clear and len(name) <= LONGEST_PRODUCT else None
    return None


def _constant(node: Node) -> Constant | None:
    """Return the number that a node is, None where it is not one."""
    value: Constant | None = node[1] if node[0] == "const" else None
    return value

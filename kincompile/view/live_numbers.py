"""Numbers of a drawing that know how they come from parameters: a page computes them again."""

from __future__ import annotations

import math
import operator
from fractions import Fraction
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import TypeAlias

    from kincompile.ir.graph import Graph

    Place: TypeAlias = tuple[str | int, ...]

OPERATIONS = {
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "div": operator.truediv,
}  # fmt: skip
"""Operations of the graph, and of floats."""

ANGLE = "alpha"
"""The input of a profile beside parameters."""


def _operators(name: str) -> tuple[Any, Any]:
    """Return the methods of an operation: with a number behind, and with one in front."""

    def before(self: LiveNumber, other: Any) -> Any:
        return self._combined(name, self, other)

    def after(self: LiveNumber, other: Any) -> Any:
        return self._combined(name, other, self)

    return before, after


class LiveNumber(float):
    """A number and the node that computes it; sums, products and sizes of such know theirs."""

    __slots__ = ("graph", "node")
    graph: Graph
    node: int

    @classmethod
    def of(cls, value: float, graph: Graph, node: int) -> LiveNumber:
        """Return a number with its node."""
        found = cls(value)
        found.graph, found.node = graph, node
        return found

    def _combined(self, operation: str, first: Any, second: Any) -> Any:
        """Return the result of an operation; with an array it is one that knows nothing."""
        known = [float(x) if isinstance(x, LiveNumber) else x for x in (first, second)]
        value = OPERATIONS[operation](*known)
        if not isinstance(value, float):
            return value
        nodes = node_of(self.graph, first), node_of(self.graph, second)
        return LiveNumber.of(value, self.graph, getattr(self.graph, operation)(*nodes))

    __add__, __radd__ = _operators("add")
    __sub__, __rsub__ = _operators("sub")
    __mul__, __rmul__ = _operators("mul")
    __truediv__, _ = _operators("div")

    def __abs__(self) -> Any:
        """Return the size."""
        return length_of(self, 0.0)

    def __neg__(self) -> Any:
        """Change the sign."""
        return self._combined("sub", 0.0, self)

    def __deepcopy__(self, memo: object) -> LiveNumber:
        """Return itself: a copy for plain data shares the graph."""
        return self


def node_of(graph: Graph, value: float) -> int:
    """Return the node of a number."""
    return value.node if isinstance(value, LiveNumber) else graph.const(float(value))


def length_of(x: float, y: float) -> float:
    """Return the length of (x, y), live where one of them is."""
    live = [value for value in (x, y) if isinstance(value, LiveNumber)]
    size = math.hypot(x, y)
    if not live:
        return size
    graph = live[0].graph
    squares = [graph.square(node_of(graph, value)) for value in (x, y)]
    return LiveNumber.of(size, graph, graph.pow(graph.add(*squares), Fraction(1, 2)))


def live_places(data: Any, place: Place = ()) -> Iterator[tuple[Place, LiveNumber]]:
    """Yield where live numbers are in plain data, and these."""
    if isinstance(data, LiveNumber):
        yield place, data
    elif isinstance(data, dict):
        for key, value in data.items():
            yield from live_places(value, (*place, key))
    elif isinstance(data, list | tuple):
        for key, value in enumerate(data):
            yield from live_places(value, (*place, key))

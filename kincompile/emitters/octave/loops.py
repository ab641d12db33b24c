"""Which loops over all entries of rows Octave writes without a loop: what they do to each is alike.

No pass of such a loop reads what another one writes; it may add up, and note what holds for all
entries or for any.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from kincompile.solver.nodes import (
    LANE,
    Assign,
    Binary,
    Call,
    Choice,
    Comment,
    Constant,
    Declare,
    Field,
    For,
    If,
    Index,
    Name,
    Return,
    Unary,
    Variable,
    variables_in,
)  # fmt: skip

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from kincompile.solver.nodes import Expression, Function, Statement

WORDS = ("abs", "finite", "floor", "max", "min", "single", "sqrt")
"""Words that take entries one by one."""


@dataclass(slots=True)
class Entries:
    """All entries that a loop goes over, or that a function of numbers is called for."""

    functions: tuple[str, ...] = ()  # that take entries one by one
    variable: Variable | None = None  # the loop's
    size: str = ""  # how many they are
    columns: set[Variable] = field(default_factory=set)  # what has a value for each

    def is_column(self, node: Expression) -> bool:
        """Whether an expression has a value for each entry."""
        return any(x is self.variable or x in self.columns for x in variables_in(node))

    def reads(self, node: Expression) -> bool:
        """Whether an expression has a meaning for all entries at once."""
        match node:
            case Constant() | Field():
                return not node.type.dims
            case Name(variable):
                return variable is not self.variable and not node.type.dims
            case Index():
                return self.places(node) is not None
            case Unary(_, operand):
                return self.reads(operand)
            case Binary(_, left, right):
                return self.reads(left) and self.reads(right)
            case Choice(condition, then, otherwise):
                parts = (condition, then, otherwise)
                is_alike = self.is_column(condition) or not any(map(self.is_column, parts))
                return is_alike and all(map(self.reads, parts))
            case Call(name, arguments):
                return name in (*WORDS, *self.functions) and all(map(self.reads, arguments))

    def places(self, node: Index) -> list[Variable] | None:
        """Return what differs among the indices of entries, or None where that is not plain."""
        own = [x for x in indices_of(node)[1] if self.is_column(x)]
        found = [x.variable for x in own if isinstance(x, Name)]
        return found if len({*found}) == len(own) else None

    def takes(self, node: Statement) -> bool:
        """Whether a statement has a meaning for all entries at once."""
        match node:
            case Comment():
                return True
            case Declare(variable, value) if not variable.type.dims and self.reads(value):
                self.columns.add(variable)
                return True
            case Assign(Index() as target, operation, value):
                places = [x for x in self.places(target) or () if x in self.columns]
                # added to a place that may come again; or put to a row and column that does not
                is_known = not places or (len(places), bool(operation)) in ((1, True), (2, False))
                return bool(self.places(target)) and is_known and self.reads(value)
            case Assign(Name(variable), _, value) if variable in self.columns:
                return self.reads(value)
            case Assign(Name() | Field() as target, operation, value):
                return not target.type.dims and self.gathered(target, operation, value) is not None
            case If(
                condition, (Return(Constant()) | Assign(Name() | Field(), "", Constant()),), ()
            ):
                return self.reads(condition) and self.is_column(condition)
        return False

    def gathered(
        self, target: Expression, operation: str, value: Expression
    ) -> tuple[str, Expression] | None:
        """Return what a number becomes of all entries: a sum, the most, whether all or any."""
        found: tuple[str, Expression] | None = None
        match operation, value:
            case "+", _:
                found = "sum", value
            case "", Binary("and" | "or" as sign, left, right) if left == target:
                found = {"and": "all", "or": "any"}[sign], right
            case "", Choice(Binary(">", part, most), then, other) if (part, most) == (then, other):
                found = ("max", part) if most == target else None
        if found is None or not (self.reads(found[1]) and self.is_column(found[1])):
            return None
        return None if target in nodes_in(found[1]) else found


def entries_of(node: For, functions: tuple[str, ...]) -> Entries | None:
    """Return the entries of a loop that is written without one; None of another."""
    match node.start, node.stop:
        case Constant(0), Constant(str() as size):
            entries = Entries(functions, node.variable, size)
        case _:
            return None
    if not all(map(entries.takes, node.body)):
        return None
    written = [x for x in nodes_in(node.body) if isinstance(x, Assign)]
    ends = any(isinstance(x, Return) for x in nodes_in(node.body))
    if ends and any(isinstance(x.target, Field | Index) for x in written):
        return None  # what passes after the end do not write
    for item in written:
        if isinstance(item.target, Index):
            array = indices_of(item.target)[0]
            others = [x for x in nodes_in(node.body) if isinstance(x, Index)]
            within = [x.array for x in others]
            others = [x for x in others if x not in within]
            if any(indices_of(x)[0] == array and x != item.target for x in others):
                return None
        elif not (isinstance(item.target, Name) and item.target.variable in entries.columns):
            for other in node.body:
                if item not in nodes_in(other) and item.target in nodes_in(other):
                    return None
    return entries


def takes_entries(item: Function) -> bool:
    """Whether a function takes entries one by one: it is one expression of numbers."""
    if any(x.type.dims or x.type.base != "real" for x in item.parameters):
        return False
    match item.body:
        case (Return(value),):
            return Entries(columns={*item.parameters}).reads(value)
    return False


def indices_of(node: Index) -> tuple[Expression, tuple[Expression, ...]]:
    """Return an array and the indices of an entry, without that of the one lane."""
    array: Expression = node
    indices: tuple[Expression, ...] = ()
    while isinstance(array, Index):
        is_lane = array.array.type.dims[len(array.indices) - 1] == LANE
        indices = array.indices[: -1 if is_lane else None] + indices
        array = array.array
    return array, indices


def nodes_in(node: Any) -> Iterator[Any]:
    """Yield a node and what it is made of."""
    yield node
    parts: Sequence[Any] = node if isinstance(node, tuple) else ()
    if not isinstance(node, Variable):
        parts = parts or [getattr(node, name) for name in getattr(node, "__slots__", ())]
    for part in parts:
        yield from nodes_in(part)

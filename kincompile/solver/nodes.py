"""The statements of a solver as nodes: what the reader hands to the printers of languages."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

LANE = "lane"


@dataclass(frozen=True, slots=True)
class Type:
    """What a value is.

    `base` is real, int, count (of points, times or variants), bool, nothing or the name of a
    struct; `dims` names the sizes of an array, the last one `LANE` where each lane has its own.
    """

    base: str
    dims: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.base}[{', '.join(self.dims)}]" if self.dims else self.base

    @property
    def is_lane(self) -> bool:
        """Whether it is one number a lane."""
        return self.dims == (LANE,)


REAL, INT, COUNT, BOOL = Type("real"), Type("int"), Type("count"), Type("bool")
NO_VALUE = Type("nothing")


@dataclass(eq=False, slots=True)
class Variable:
    """A parameter of a function, or what a function declares."""

    name: str
    type: Type
    is_mutable: bool = False
    is_parameter: bool = False
    below: str | None = None  # of a loop's variable: the size that it counts to, if that has a name


@dataclass(frozen=True, slots=True)
class Constant:
    """A number, a truth, or the name of a size, a criterion, a status or a table."""

    value: Any
    type: Type


@dataclass(frozen=True, slots=True)
class Name:
    """A variable where it is used."""

    variable: Variable

    @property
    def type(self) -> Type:
        """What it is."""
        return self.variable.type


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a struct."""

    struct: Name
    name: str
    type: Type


@dataclass(frozen=True, slots=True)
class Index:
    """An entry or a row of an array."""

    array: Expression
    indices: tuple[Expression, ...]
    type: Type


@dataclass(frozen=True, slots=True)
class Unary:
    """The negative (``neg``) of a number or the opposite (``not``) of a truth."""

    operation: str
    operand: Expression
    type: Type


@dataclass(frozen=True, slots=True)
class Binary:
    """One of + - * / // and or < <= > >= == != of two operands."""

    operation: str
    left: Expression
    right: Expression
    type: Type


@dataclass(frozen=True, slots=True)
class Choice:
    """One value where a condition holds, another elsewhere."""

    condition: Expression
    then: Expression
    otherwise: Expression
    type: Type


@dataclass(frozen=True, slots=True)
class Call:
    """A call of a word or of a function of the text; `lanes` says for how many lanes."""

    name: str
    arguments: tuple[Expression, ...]
    type: Type
    lanes: Expression | None = None


Expression = Constant | Name | Field | Index | Unary | Binary | Choice | Call


@dataclass(frozen=True, slots=True)
class Declare:
    """A new variable with its first value."""

    variable: Variable
    value: Expression


@dataclass(frozen=True, slots=True)
class Assign:
    """An assignment, with the operation of an augmented one."""

    target: Expression
    operation: str
    value: Expression


@dataclass(frozen=True, slots=True)
class For:
    """A loop over whole numbers, or over lanes."""

    variable: Variable
    start: Expression
    stop: Expression
    step: Expression
    body: tuple[Statement, ...]
    over_lanes: bool


@dataclass(frozen=True, slots=True)
class While:
    """A loop."""

    condition: Expression
    body: tuple[Statement, ...]


@dataclass(frozen=True, slots=True)
class If:
    """A branch, which is the same for all lanes."""

    condition: Expression
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...]


@dataclass(frozen=True, slots=True)
class Break:
    """The end of the innermost loop."""


@dataclass(frozen=True, slots=True)
class Return:
    """The end of a function, with its result."""

    value: Expression


@dataclass(frozen=True, slots=True)
class Do:
    """A call for what it changes."""

    call: Call


@dataclass(frozen=True, slots=True)
class Comment:
    """What the text says about the statements below."""

    lines: tuple[str, ...]


Statement = Declare | Assign | For | While | If | Break | Return | Do | Comment


@dataclass(slots=True)
class Function:
    """A function of the text; one that is lanewise works on as many lanes as it is called for."""

    name: str
    about: str
    parameters: tuple[Variable, ...]
    result: Type
    is_lanewise: bool
    body: tuple[Statement, ...] = ()
    changes: set[str] = field(default_factory=set)  # the names of parameters that it changes


@dataclass(frozen=True, slots=True)
class Struct:
    """Numbers that belong together: `notes` say what the fields are."""

    name: str
    about: str
    fields: dict[str, Type]
    notes: dict[str, str]


@dataclass(frozen=True, slots=True)
class Text:
    """A solver."""

    structs: dict[str, Struct]
    functions: dict[str, Function]


def variables_in(node: Any) -> Iterator[Variable]:
    """Yield the variables that nodes use or declare, as often as they do."""
    if isinstance(node, Variable):
        yield node
    elif isinstance(node, tuple):
        for item in node:
            yield from variables_in(item)
    else:
        for name in getattr(node, "__slots__", ()):
            yield from variables_in(getattr(node, name))

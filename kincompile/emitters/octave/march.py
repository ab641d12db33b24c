"""The start in Octave, which is MATLAB too: values without references, rows that count from 1.

A function hands back what it changes, ``[b, s, is_so] = turn(first, b, s)``, and a language without
a conditional expression has a statement in its place. Both stand before what they are a part of.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from kincompile.emitters.lines import wrapped
from kincompile.emitters.octave.loops import Entries, entries_of, indices_of, takes_entries
from kincompile.emitters.solver_printer import ATOM, PRODUCT, RELATION, SUM, OneLane
from kincompile.solver.nodes import (
    BOOL,
    LANE,
    Assign,
    Binary,
    Break,
    Call,
    Choice,
    Constant,
    Declare,
    Do,
    Field,
    For,
    If,
    Index,
    Name,
    Return,
    Unary,
    While,
    variables_in,
)  # fmt: skip
from kincompile.solver.vocabulary import TABLES, WORDS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.emitters.solver_printer import Lines
    from kincompile.solver.nodes import Expression, Function, Statement, Struct, Text, Type

BY_HAND = ("solve_least", "rotate", "make_orthogonal")
"""Functions that are not printed: the language has factorizations of its own."""
ZEROS = {"real": "0", "int": "0", "bool": "false"}
NUMBERS = {"INFINITE": "Inf", "NOTHING": "NaN", "TURN": "2 * pi"}
HOLDERS = ("Start", "Transmission")
"""Structs whose fields the tables of a mechanism are."""
PLACES = ("PATTERN", "COVER")
"""Tables of places, which count from 1 here."""
RESULT = "answer"


class OctaveSolver(OneLane):
    """Prints the start of a mechanism as Octave; `values` are the numbers that have names."""

    remark, negation, continued = "%", "~", " ..."
    signs: Mapping[str, str] = {"and": "&&", "or": "||", "!=": "~="}  # a constant
    calls: Mapping[str, str] = {"finite": "isfinite"}  # a constant

    def __init__(self, text: Text, values: Mapping[str, object]) -> None:
        super().__init__(text)
        self.structs = {name: x for name, x in text.structs.items() if name != "Point"}
        self.functions = {k: x for k, x in text.functions.items() if k not in BY_HAND}
        self.changed = {name: _changed(x) for name, x in text.functions.items()}
        self.changed |= {name: x.changes for name, x in WORDS.items() if x.changes}
        self.values = {**values, **NUMBERS}
        self.one_by_one = tuple(k for k, x in text.functions.items() if takes_entries(x))
        self.begin()

    def begin(self, own: Function | None = None) -> None:
        """Forget what is known of the function before."""
        self.own, self.used = own, dict[str, object]()
        self.before: Lines = []  # lines that must precede the statement
        self.taken = 0  # names that this statement has for parts of it
        self.from_one = set[object]()  # variables that count from 1
        self.entries: Entries | None = None  # that are worked on at once

    def struct(self, item: Struct) -> Lines:
        """Return the function that makes a struct."""
        self.begin()
        rows = []
        for name, kind in item.fields.items():
            note = f"  % {item.notes[name]}" if item.notes[name] else ""
            rows.append(f"made.{name} = {self.zero(kind)};{note}")
        head = f"function made = new_{item.name.lower()}()"
        return [head, *self.about(item.about), *self.numbers(), *rows, "end"]

    def zero(self, kind: Type) -> str:
        """Return the first value of a field or of rows."""
        sizes = [self.named(x) for x in kind.dims if x != LANE]
        return f"zeros({', '.join([*sizes, '1'][:2])})" if sizes else ZEROS[kind.base]

    def function(self, item: Function) -> Lines:
        """Return a function, with the numbers that it names."""
        self.begin(item)
        if item.name in self.one_by_one:
            self.entries = Entries(columns={*item.parameters})
        body = [line[4:] for line in self.body(item)]
        names = [item.parameters[k].name for k in self.changed[item.name]]
        names += [RESULT] if item.result.base != "nothing" else []
        given = ", ".join(x.name for x in item.parameters)
        head = f"function {_listed(names)} = {item.name}({given})"
        return [head, *self.about(item.about), *self.numbers(), *body, "end"]

    def numbers(self) -> Lines:
        """Return the statements that name numbers."""
        given = [f"{name} = {value}" for name, value in self.used.items()]
        return [line.replace(",", ";") for line in wrapped(given)]

    # ------------------------------------------------------------ statements

    def statement(self, node: Statement) -> Lines:
        """Return the lines of a statement, after those of its parts that are statements here."""
        self.taken = 0
        return self.after(lambda: self.plain(node))

    def after(self, lines_of: Callable[[], Lines]) -> Lines:
        """Return lines after what stands before them."""
        outer, self.before = self.before, []
        lines = lines_of()
        lines, self.before = [*self.before, *lines], outer
        return lines

    def plain(self, node: Statement) -> Lines:
        """Return the lines of a statement."""
        if isinstance(node, For) and (found := self.at_once_of(node)):
            self.entries = found
            lines = [line for x in node.body for line in self.at_once(x, found)]
            self.entries = None
            return lines
        match node:
            case Declare(variable, Index() as value) if _is_place(value):
                self.from_one.add(variable)
                return [f"{variable.name} = {self.whole(value, 1)[0]};"]
            case Declare(variable, value):
                return self.set(variable.name, value)
            case Assign(target, "", Constant() as value) if target.type.dims not in ((), (LANE,)):
                return [f"{self.expression(target)}(:) = {self.expression(value)};"]
            case Assign(target, operation, value):
                if operation:
                    value = Binary(operation, target, value, target.type)
                return self.set(self.expression(target), value)
            case Return(value):
                is_last = self.own is not None and node is self.own.body[-1]
                return [*self.set(RESULT, value), *["return"][is_last:]]
            case Do(call):
                return self.set("", call)
            case While(condition, body):
                if not self.is_stated(condition):
                    return self.loop(f"while {self.expression(condition)}", body)
                over = [f"if {self.opposite(condition)}", "    break", "end"]
                inner, self.before = [*self.before, *over], []
                return ["while true", *_indented(inner), *self.inner(body), "end"]
            case Break():
                return ["break"]
        return super().statement(node)

    def at_once_of(self, node: For) -> Entries | None:
        """Return the entries of a loop that is written without one; None of another."""
        return entries_of(node, self.one_by_one)

    def at_once(self, node: Statement, entries: Entries) -> Lines:
        """Return the lines of a statement for all entries."""
        match node:
            case If(condition, then):
                return [f"if any({self.expression(condition)})", *self.inner(then), "end"]
            case Assign(Index() as target, operation, value):
                array, text = indices_of(target)[0], self.expression(value)
                into, rows = self.expression(array), array.type.dims[0]
                match [x.name for x in entries.places(target) or () if x in entries.columns]:
                    case [row, column]:
                        return [f"{into}({row} + {self.named(rows)} * ({column} - 1)) = {text};"]
                    case [row]:
                        added = f"accumarray({row}, {text}, [{self.named(rows)}, 1])"
                        return [f"{into} = {into} {operation} {added};"]
                if self.expression(target) == into and not entries.is_column(value):
                    return [f"{into}(:) = {text};"]
            case Assign(Name() | Field() as target, operation, value) if found := entries.gathered(
                target, operation, value
            ):
                into, what = self.expression(target), self.expression(found[1])
                match found[0]:
                    case "sum":
                        return [f"{into} = {into} + sum({what});"]
                    case "max":
                        return [f"{into} = max([{into}; {what}]);"]
                    case word:
                        sign = {"all": "&&", "any": "||"}[word]
                        return [f"{into} = {into} {sign} {word}({what});"]
        return self.plain(node)

    def set(self, into: str, value: Expression) -> Lines:
        """Return the statements that give a value a name; none, where it is its own."""
        match value:
            case Choice(condition, then, otherwise) if self.entries is None:
                first = self.after(lambda: self.set(into, then))
                second = self.after(lambda: self.set(into, otherwise))
                if not first:
                    return [f"if {self.opposite(condition)}", *_indented(second), "end"]
                lines = [f"if {self.expression(condition)}", *_indented(first)]
                return [*lines, *(["else", *_indented(second)] if second else []), "end"]
            case Binary("and" | "or" as sign, left, right) if self.is_stated(
                right
            ) and into not in {x.name for x in variables_in(right)}:
                lines = self.set(into, left)
                head = f"if {self.negation * (sign == 'or')}{into}"
                return [*lines, head, *_indented(self.after(lambda: self.set(into, right))), "end"]
            case Call(name, arguments) if self.changed.get(name):
                names = [self.expression(arguments[k]) for k in self.changed[name]]
                return [f"{_listed([*names, *[into][: bool(into)]])} = {self.call(value)[0]};"]
        text = self.expression(value)
        return [f"{into} = {text};"] if text != into else []

    def opposite(self, condition: Expression) -> str:
        """Return the opposite of a condition."""
        return self.expression(Unary("not", condition, BOOL))

    def counted(self, node: For) -> str:
        """Return the head of a loop over whole numbers."""
        start, stop = self.whole(node.start, 1)[0], self.whole(node.stop, 0)[0]
        self.from_one.add(node.variable)
        return f"for {node.variable.name} = {start}:{stop}"

    def loop(self, head: str, body: Sequence[Statement]) -> Lines:
        """Return a loop."""
        return [head, *self.inner(body), "end"]

    def conditional(self, node: If, word: str = "if") -> Lines:
        """Return a branch, and those that follow it."""
        lines = [f"{word} {self.expression(node.condition)}", *self.inner(node.then)]
        match node.otherwise:
            case ():
                return [*lines, "end"]
            case (other,):
                rest = self.statement(other)
                if rest[0].startswith("if "):
                    return [*lines, f"else{rest[0]}", *rest[1:]]
                return [*lines, "else", *_indented(rest), "end"]
        return [*lines, "else", *self.inner(node.otherwise), "end"]

    # ------------------------------------------------------------ expressions

    def is_stated(self, node: Expression) -> bool:
        """Whether a part of an expression is a statement here."""
        if self.entries is not None:
            return False
        match node:
            case Choice():
                return True
            case Call(name, arguments):
                return bool(self.changed.get(name)) or any(map(self.is_stated, arguments))
            case Binary(_, left, right):
                return self.is_stated(left) or self.is_stated(right)
            case Unary(_, operand):
                return self.is_stated(operand)
            case Index(_, indices):
                return any(map(self.is_stated, indices))
        return False

    def strong(self, node: Expression) -> tuple[str, int]:
        """Return an expression, and how strongly that binds; of a statement the name it has."""
        match node:
            case Binary("and" | "or", _, right) if self.is_stated(right):
                return self.said_before(node), ATOM
            case Choice() if self.entries is not None:
                parts = (node.condition, node.then, node.otherwise)
                return f"where({', '.join(map(self.expression, parts))})", ATOM
            case Choice():
                return self.said_before(node), ATOM
            case Call(name) if self.changed.get(name):
                return self.said_before(node), ATOM
            case Binary() | Name() | Index() if node.type.base == "int" and not node.type.dims:
                return self.whole(node, 0)
            case Binary(sign, left, right) if left.type.base == right.type.base == "int":
                (first, move), (second, own) = map(self.sum, (left, right))
                text = f"{_joined(first, 0)[0]} {self.signs.get(sign, sign)} "
                return text + _joined(second, own - move)[0], RELATION
        return super().strong(node)

    def said_before(self, node: Expression) -> str:
        """Return the name of what a statement before this one gives."""
        self.taken += 1
        name = ("is_so" if node.type == BOOL else "chosen") + f"_{self.taken}" * (self.taken > 1)
        self.before += self.after(lambda: self.set(name, node))
        return name

    def whole(self, node: Expression, shift: int) -> tuple[str, int]:
        """Return a whole number and a shift of it, and how strongly that binds."""
        terms, constant = self.sum(node)
        return _joined(terms, constant + shift)

    def sum(self, node: Expression) -> tuple[list[tuple[str, str]], int]:
        """Return terms with their signs, and the number that is left."""
        match node:
            case Constant(int() as value):
                return [], value
            case Name(variable):
                return [("+", variable.name)], -(variable in self.from_one)
            case Binary("+" | "-" as sign, left, right):
                (first, a), (second, b) = self.sum(left), self.sum(right)
                if sign == "+":
                    return first + second, a + b
                return first + [("-" if x == "+" else "+", y) for x, y in second], a - b
            case Index():
                return [("+", self.leaf(node)[0])], -_is_place(node)
            case Binary(sign, left, right):
                return [("+", self.binary(sign, left, right)[0])], 0
        return [("+", self.at(node, PRODUCT))], 0

    def constant(self, node: Constant) -> str:
        """Return a number or the name of one, a table as a field of the start."""
        return self.named(node.value) if isinstance(node.value, str) else super().constant(node)

    def named(self, name: str) -> str:
        """Return the name of a number that the function names first, or of a table."""
        if name in TABLES and self.own is not None:
            holders = (x.name for x in self.own.parameters if x.type.base in HOLDERS)
            return f"{next(holders)}.{name}"
        if name in ("INFINITE", "NOTHING"):
            return NUMBERS[name]
        self.used[name] = self.values[name]
        return name

    def leaf(self, node: Name | Field | Index) -> tuple[str, int]:
        """Return a variable, a field or an entry."""
        if not isinstance(node, Index):
            return super().leaf(node)
        array, indices = indices_of(node)
        places = [self.place(x, size) for x, size in zip(indices, array.type.dims, strict=False)]
        is_whole = places in ([], [":"])
        return self.expression(array) + f"({', '.join(places)})" * (not is_whole), ATOM

    def place(self, node: Expression, size: str) -> str:
        """Return an index, or all of them."""
        over = self.entries
        if over is None or not (isinstance(node, Name) and node.variable is over.variable):
            return self.whole(node, 1)[0]
        return ":" if over.size == size else f"1:{self.named(over.size)}"

    def sign(self, sign: str, left: Expression, right: Expression) -> str:
        """Return how an operation is written: of entries, what is meant for each."""
        if self.entries is not None:
            first, second = map(self.entries.is_column, (left, right))
            of_each = {"and": "&", "or": "|"} if first or second else {}
            of_each |= {"/": "./"} if second else {}
            of_each |= {"*": ".*"} if first and second else {}
            if sign in of_each:
                return of_each[sign]
        return super().sign(sign, left, right)

    def call(self, node: Call) -> tuple[str, int]:
        """Return a call."""
        match node.name, node.arguments:
            case "row", ():
                return self.zero(node.type), ATOM
            case "single", (number,):
                return f"double(single({self.expression(number)}))", ATOM
        if node.name in self.structs:
            return super().call(replace(node, name=f"new_{node.name.lower()}"))
        return super().call(node)


def _is_place(node: Expression) -> bool:
    """Whether it is an entry of a table of places."""
    while isinstance(node, Index):
        node = node.array
    return isinstance(node, Constant) and node.value in PLACES


def _changed(function: Function) -> tuple[int, ...]:
    """Return which parameters a function changes."""
    return tuple(k for k, x in enumerate(function.parameters) if x.name in function.changes)


def _listed(names: Sequence[str]) -> str:
    """Return what is assigned to."""
    return f"[{', '.join(names)}]" if len(names) > 1 else names[0]


def _joined(terms: Sequence[tuple[str, str]], constant: int) -> tuple[str, int]:
    """Return a sum, and how strongly it binds."""
    if constant or not terms:
        terms = [*terms, ("-" if constant < 0 else "+", str(abs(constant)))]
    (sign, first), *rest = terms
    text = f"{'-' * (sign == '-')}{first}" + "".join(f" {x} {y}" for x, y in rest)
    return text, SUM if rest or sign == "-" else ATOM


def _indented(lines: Sequence[str]) -> Lines:
    """Return the lines of a block."""
    return [f"    {line}" for line in lines]

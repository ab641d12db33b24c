"""The solver's text as text of a language: what all languages write alike of its nodes."""

from __future__ import annotations

import textwrap
from dataclasses import replace
from typing import TYPE_CHECKING

from kincompile.emitters.lines import broken
from kincompile.solver.nodes import (
    COUNT,
    LANE,
    Assign,
    Binary,
    Break,
    Call,
    Choice,
    Comment,
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
)  # fmt: skip

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.solver.nodes import Expression, Function, Statement, Struct, Text, Variable

CHOICE, OR, AND, RELATION, SUM, PRODUCT, SIGN, ATOM = range(8)
"""Binding strengths, loosest first."""

STRENGTH = (
    {"or": OR, "and": AND, "+": SUM, "-": SUM}
    | dict.fromkeys(("*", "/", "//"), PRODUCT)
    | dict.fromkeys(("<", "<=", ">", ">=", "==", "!="), RELATION)
)

WIDTH = 100
MARKS = r"[+-]|\?|:|&&|\|\|"
"""Before these a long statement is broken."""

Lines = list[str]


class SolverPrinter:
    """Prints a solver; a language overrides what it writes differently."""

    remark, negation, continued = "//", "!", ""
    """What begins a comment, negates a truth, and ends a line that goes on."""
    signs: Mapping[str, str] = {"and": "&&", "or": "||"}
    calls: Mapping[str, str] = {}
    """What functions of numbers are called."""

    def __init__(self, text: Text) -> None:
        self.structs, self.functions = text.structs, text.functions

    def text(self) -> str:
        """Return the solver: what is printed of its structs, then its functions."""
        parts = [self.struct(x) for x in self.structs.values()]
        parts += [self.function(x) for x in self.functions.values()]
        return "\n".join(line for lines in parts if lines for line in [*lines, ""])

    def struct(self, item: Struct) -> Lines:
        """Return a struct, or nothing where it is written by hand."""
        raise NotImplementedError

    def head(self, item: Function) -> Lines:
        """Return the first lines of a function, up to its body."""
        raise NotImplementedError

    def function(self, item: Function) -> Lines:
        """Return a function."""
        return [*self.about(item.about), *self.head(item), *self.body(item), "}"]

    def body(self, item: Function) -> Lines:
        """Return the statements of a function, in lines that are not too long."""
        lines = []
        for line in self.inner(item.body):
            depth = len(line) - len(line.lstrip())
            first, *rest = broken(line.strip(), WIDTH - depth - 4, MARKS)
            parts = [" " * depth + first, *(" " * (depth + 4) + x for x in rest)]
            lines += [*(x + self.continued for x in parts[:-1]), parts[-1]]
        return lines

    def about(self, text: str) -> Lines:
        """Return what is said of a function or struct, as comments."""
        paragraphs = " ".join(text.split())
        return [f"{self.remark} {line}" for line in textwrap.wrap(paragraphs, WIDTH - 4)]

    # ------------------------------------------------------------ statements

    def inner(self, statements: Sequence[Statement]) -> Lines:
        """Return the statements of a block, indented."""
        return [f"    {line}" for part in self.block(statements) for line in part]

    def block(self, statements: Sequence[Statement]) -> list[Lines]:
        """Return the lines of each statement that a language makes of a block."""
        return [self.statement(x) for x in statements]

    def statement(self, node: Statement) -> Lines:
        """Return the lines of a statement."""
        match node:
            case Comment(lines):
                return [f"{self.remark} {line}" for line in lines]
            case Declare():
                return self.declared(node)
            case Assign():
                return self.assigned(node)
            case For():
                return self.loop(self.counted(node), node.body)
            case While(condition, body):
                return self.loop(f"while ({self.expression(condition)})", body)
            case If():
                return self.conditional(node)
            case Break():
                return ["break;"]
            case Return(value):
                return [f"return {self.expression(value)};"]
            case Do(call):
                return [f"{self.expression(call)};"]

    def declared(self, node: Declare) -> Lines:
        """Return the lines of a declaration."""
        raise NotImplementedError

    def assigned(self, node: Assign) -> Lines:
        """Return the lines of an assignment."""
        target = self.expression(node.target)
        return [f"{target} {node.operation}= {self.expression(node.value)};"]

    def counted(self, node: For) -> str:
        """Return the head of a loop over whole numbers."""
        raise NotImplementedError

    def loop(self, head: str, body: Sequence[Statement]) -> Lines:
        """Return a loop."""
        return [f"{head} {{", *self.inner(body), "}"]

    def conditional(self, node: If, word: str = "if") -> Lines:
        """Return a branch, and those that follow it."""
        lines = [f"{word} ({self.expression(node.condition)}) {{", *self.inner(node.then)]
        if len(node.otherwise) == 1 and isinstance(node.otherwise[0], If):
            return lines + self.conditional(node.otherwise[0], "} else if")
        if node.otherwise:
            lines += ["} else {", *self.inner(node.otherwise)]
        return [*lines, "}"]

    # ------------------------------------------------------------ expressions

    def expression(self, node: Expression) -> str:
        """Return an expression."""
        return self.strong(node)[0]

    def at(self, node: Expression, strength: int) -> str:
        """Return an operand, in parentheses where it binds too loosely."""
        text, own = self.strong(node)
        return text if own >= strength else f"({text})"

    def strong(self, node: Expression) -> tuple[str, int]:
        """Return an expression, and how strongly that binds."""
        match node:
            case Constant():
                return self.constant(node), ATOM
            case Name() | Field() | Index():
                return self.leaf(node)
            case Unary("neg", operand):
                return f"-{self.at(operand, SIGN)}", SIGN
            case Unary(_, operand):
                return f"{self.negation}{self.at(operand, SIGN)}", SIGN
            case Binary(sign, left, right):
                return self.binary(sign, left, right)
            case Choice(condition, then, otherwise):
                return self.choice(condition, then, otherwise)
            case Call():
                return self.call(node)

    def constant(self, node: Constant) -> str:
        """Return a number or the name of one."""
        raise NotImplementedError

    def leaf(self, node: Name | Field | Index) -> tuple[str, int]:
        """Return a variable, a field or an entry."""
        raise NotImplementedError

    def binary(self, sign: str, left: Expression, right: Expression) -> tuple[str, int]:
        """Return an operation."""
        own = STRENGTH[sign]
        # gcc warns of && within || without parentheses
        inner = own + 2 if sign == "or" else own
        first = self.at(left, own if isinstance(left, Binary) and left.operation == sign else inner)
        return f"{first} {self.sign(sign, left, right)} {self.at(right, max(inner, own + 1))}", own

    def sign(self, sign: str, left: Expression, right: Expression) -> str:
        """Return how an operation on two operands is written."""
        return self.signs.get(sign, sign)

    def choice(
        self, condition: Expression, then: Expression, otherwise: Expression
    ) -> tuple[str, int]:
        """Return one of two values."""
        first, second = self.at(condition, OR), self.at(then, OR)
        return f"{first} ? {second} : {self.at(otherwise, CHOICE)}", CHOICE

    def call(self, node: Call) -> tuple[str, int]:
        """Return a call."""
        arguments = [self.expression(x) for x in node.arguments]
        return f"{self.calls.get(node.name, node.name)}({', '.join(arguments)})", ATOM


class OneLane(SolverPrinter):
    """Prints a solver in a language that takes one point at a time: a lane is a number."""

    def __init__(self, text: Text) -> None:
        super().__init__(text)
        self.one: set[Variable] = set()  # what counts lanes, of which there is one

    def block(self, statements: Sequence[Statement]) -> list[Lines]:
        """Return the lines of statements: a loop over lanes is its body, of the one lane."""
        parts: list[Lines] = []
        for node in statements:
            if isinstance(node, For) and node.over_lanes:
                self.one.add(node.variable)
                parts += self.block(node.body)
            else:
                parts.append(self.statement(node))
        return parts

    def constant(self, node: Constant) -> str:
        """Return a number or the name of one."""
        return str(node.value).lower() if isinstance(node.value, bool) else str(node.value)

    def leaf(self, node: Name | Field | Index) -> tuple[str, int]:
        """Return a variable, a field or an entry, without the index of the one lane."""
        match node:
            case Name(variable):
                return "0" if variable in self.one else variable.name, ATOM
            case Field(struct, name):
                return f"{struct.variable.name}.{name}", ATOM
            case Index(array, indices):
                if array.type.dims[len(indices) - 1] == LANE:
                    indices = indices[:-1]
                text = self.expression(array)
                return text + "".join(f"[{self.expression(x)}]" for x in indices), ATOM

    @staticmethod
    def row_of(owner: Name, time: Sequence[Expression], variant: Expression) -> Expression:
        """Return the number of a variant at a time, if there is one."""
        if not time:
            return variant
        variants = Field(owner, "variants", COUNT)
        return Binary("+", Binary("*", time[0], variants, COUNT), variant, COUNT)

    def binary(self, sign: str, left: Expression, right: Expression) -> tuple[str, int]:
        """Return an operation; nothing is added for the one lane."""
        if sign == "+" and isinstance(right, Name) and right.variable in self.one:
            return self.strong(left)
        return super().binary(sign, left, right)

    def call(self, node: Call) -> tuple[str, int]:
        """Return a call; what any lane is, the one is, and copying is an assignment's."""
        match node.name, node.arguments:
            case "any_lane" | "copied", (value,):
                return self.strong(value)
            case "take_up" | "put_at", (to, source, *_):
                return super().call(replace(node, arguments=(to, source)))
        return super().call(node)

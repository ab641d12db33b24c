"""The solver in Python: a lane is a float, rows are lists; it ends modules that stand alone."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

from kincompile import criteria
from kincompile.emitters.numpy.text import tuple_text
from kincompile.emitters.solver_printer import ATOM, CHOICE, OR, OneLane
from kincompile.emitters.solver_tables import NUMBERS, solver_tables
from kincompile.report.templates import fill
from kincompile.solver.nodes import (
    LANE,
    Break,
    Call,
    Constant,
    Do,
    Field,
    If,
    Index,
    Name,
    Return,
    While,
)  # fmt: skip
from kincompile.solver.reader import solver
from kincompile.solver.vocabulary import KERNELS, STATUSES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.emitters.solver_printer import Lines
    from kincompile.emitters.target import Emitted
    from kincompile.ir.program import Program
    from kincompile.solver.nodes import (
        Assign,
        Declare,
        Expression,
        For,
        Function,
        Statement,
        Struct,
        Text,
        Type,
    )

ZEROS = {"real": "0.0", "int": "0", "count": "0", "bool": "False"}
NAMES = {
    "N": "N_COORDINATES", "M": "N_EQUATIONS", "K": "len(PARAMETERS)", "INFINITE": "math.inf",
    "NOTHING": "math.nan",
}  # fmt: skip
"""What has another name in a module; all others of the text have an underscore before theirs."""
OF_VARIANTS = ("follow_variants", "march_variants", "put_to_rest")
"""Functions that are left out, since one motion needs none of them."""
TABLES = ("ANGULAR", "IS_REDUNDANT", "PROBE")
"""Tables of a mechanism that the march reads; PATTERN is there already."""


class PythonSolver(OneLane):
    """Prints the march of one motion as Python."""

    remark, negation, continued = "#", "not ", " \\"
    signs: Mapping[str, str] = {}
    calls: Mapping[str, str] = {  # a constant
        "abs": "abs", "finite": "math.isfinite", "max": "max", "min": "min", "sqrt": "math.sqrt",
        "take_up": "_copy", "put_at": "_copy", "solve": "_solve_at",
    } | {name: f"_{name}_at" for name in KERNELS}  # fmt: skip

    def __init__(self, text: Text) -> None:
        super().__init__(text)
        self.functions = {k: x for k, x in self.functions.items() if k not in OF_VARIANTS}

    def text(self) -> str:
        """Return the solver, with the blank lines that Python has."""
        parts = [self.struct(x) for x in self.structs.values()]
        parts += [self.function(x) for x in self.functions.values()]
        return "\n\n\n".join("\n".join(lines) for lines in parts)

    def struct(self, item: Struct) -> Lines:
        """Return a class."""
        fields = []
        for name, kind in item.fields.items():
            fields += [f"        # {item.notes[name]}"] if item.notes[name] else []
            fields.append(f"        self.{name} = {self.zero(kind)}")
        head = [f"class _{item.name}:", *self.about(item.about)]
        return [*head, "", "    def __init__(self):", *fields]

    def zero(self, kind: Type) -> str:
        """Return the first value of a field."""
        if "any" in kind.dims:
            return "()"
        sizes = [self.named(x) for x in kind.dims if x != LANE]
        return f"[{ZEROS[kind.base]}] * {sizes[0]}" if sizes else ZEROS[kind.base]

    @staticmethod
    def named(name: str) -> str:
        """Return the name of a constant."""
        return NAMES.get(name) or f"_{name}"

    def function(self, item: Function) -> Lines:
        """Return a function."""
        given = ", ".join(x.name for x in item.parameters)
        return [f"def _{item.name}({given}):", *self.about(item.about), *self.body(item)]

    def about(self, text: str) -> Lines:
        """Return what is said of a function or struct, as it is said there."""
        lines = f'"""{text}"""' if "\n" not in text else f'"""{text}\n"""'
        return [f"    {line}".rstrip() for line in lines.split("\n")]

    # ------------------------------------------------------------ statements

    def statement(self, node: Statement) -> Lines:
        """Return the lines of a statement."""
        match node:
            case While(condition, body):
                return self.loop(f"while {self.expression(condition)}", body)
            case Break():
                return ["break"]
            case Return(value):
                return [f"return {self.expression(value)}"]
            case Do(Call("missed", (Name(b), weight, first, second))):
                left = f"{self.expression(first)}, {self.expression(second)}"
                return [f"{left} = _missed_at({b.name}, {self.expression(weight)})"]
            case Do(call):
                return [self.expression(call)]
        return super().statement(node)

    def declared(self, node: Declare) -> Lines:
        """Return the lines of a declaration."""
        return [f"{node.variable.name} = {self.expression(node.value)}"]

    def assigned(self, node: Assign) -> Lines:
        """Return the lines of an assignment; rows are new ones."""
        target, value = node.target, self.expression(node.value)
        if target.type.dims not in ((), (LANE,)):
            if isinstance(node.value, Constant):
                value = f"[{value}] * {self.named(target.type.dims[0])}"
            elif isinstance(node.value, Name | Field):
                value = f"list({value})"
        return [f"{self.expression(target)} {node.operation}= {value}"]

    def counted(self, node: For) -> str:
        """Return the head of a loop over whole numbers."""
        limits = [self.expression(x) for x in (node.start, node.stop)]
        return f"for {node.variable.name} in range({', '.join(limits).removeprefix('0, ')})"

    def loop(self, head: str, body: Sequence[Statement]) -> Lines:
        """Return a loop."""
        return [f"{head}:", *self.inner(body)]

    def conditional(self, node: If, word: str = "if") -> Lines:
        """Return a branch, and those that follow it."""
        lines = [f"{word} {self.expression(node.condition)}:", *self.inner(node.then)]
        if len(node.otherwise) == 1 and isinstance(node.otherwise[0], If):
            return lines + self.conditional(node.otherwise[0], "elif")
        return [*lines, "else:", *self.inner(node.otherwise)] if node.otherwise else lines

    # ------------------------------------------------------------ expressions

    def constant(self, node: Constant) -> str:
        """Return a number or the name of one."""
        return self.named(node.value) if isinstance(node.value, str) else repr(node.value)

    def leaf(self, node: Name | Field | Index) -> tuple[str, int]:
        """Return a variable, a field or an entry; what is of variants has rows of them."""
        match node:
            case Index(Field(owner) as array, (row, *time, point)) if "any" in array.type.dims[1:]:
                place = self.expression(self.row_of(owner, time, point))
                return f"{self.expression(array)}[{place}][{self.expression(row)}]", ATOM
        return super().leaf(node)

    def binary(self, sign: str, left: Expression, right: Expression) -> tuple[str, int]:
        """Return an operation; a division by what may be 0 does not raise."""
        if sign == "/" and not isinstance(right, Constant):
            return f"_ratio({self.expression(left)}, {self.expression(right)})", ATOM
        return super().binary(sign, left, right)

    def choice(
        self, condition: Expression, then: Expression, otherwise: Expression
    ) -> tuple[str, int]:
        """Return one of two values."""
        first, second = self.at(then, OR), self.at(condition, OR)
        return f"{first} if {second} else {self.at(otherwise, CHOICE)}", CHOICE

    def call(self, node: Call) -> tuple[str, int]:
        """Return a call."""
        match node.name, node.arguments:
            case "copied", (value,):
                return f"list({self.expression(value)})", ATOM
            case "row" | "rows", ():
                return self.zero(node.type), ATOM
            case "part", (vector, first):
                return f"{self.expression(vector)}[{self.expression(first)}]", ATOM
            case "store", (Field(owner) as block, rows, time, first, _):
                place = self.expression(self.row_of(owner, [time], first))
                return f"{self.expression(block)}[{place}] = {self.expression(rows)}", ATOM
        if node.name in self.functions or node.name in self.structs:
            return super().call(replace(node, name=f"_{node.name}"))
        return super().call(node)


@cache
def _solver() -> tuple[str, str]:
    """Return the march, printed alike in all modules, and the numbers that it judges by."""
    text = PythonSolver(solver()).text()
    used = set(re.findall(r"\b_([A-Z_]+)\b", text))
    numbers = [f"_{name} = {x!r}" for name, x in {**NUMBERS, **STATUSES}.items() if name in used]
    return text, "\n".join(numbers)


def with_march(emitted: Emitted, program: Program) -> Emitted:
    """Return a module that ends with its march, if it has a planned solve.

    This is for files: `kc.compile` leaves it out, since the runtime has a march of its own, and to
    run the text of this one takes a third of the time in which a four-bar is compiled.
    """
    if "\ndef solve(" not in emitted.source:
        return emitted
    return replace(emitted, files={f"{emitted.name}.py": emitted.source + march_of(program)})


def march_of(program: Program) -> str:
    """Return the text of a march, which ends a module."""
    (text, numbers), tables = _solver(), solver_tables(program)
    slots = {name.lower(): tuple_text(map(repr, tables[name])) for name in TABLES} | {
        "n": len(program.coordinates),
        "k": len(program.parameters),
        "numbers": numbers,
        "solver": text,
        "tolerance": criteria.TOLERANCE,
        "most": criteria.MAX_ITERATIONS,
    }
    return fill("numpy/march.py.jinja", slots)

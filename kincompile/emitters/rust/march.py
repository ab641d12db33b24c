"""The solver in Rust: a lane is a number, rows are arrays."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from kincompile.emitters.solver_printer import ATOM, CHOICE, OR, WIDTH, OneLane
from kincompile.solver.nodes import LANE, REAL, Call, Constant, Do, Field, For, Index, Name
from kincompile.solver.vocabulary import KERNELS, ROOM

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.emitters.solver_printer import Lines
    from kincompile.solver.nodes import (
        Assign,
        Declare,
        Expression,
        Function,
        If,
        Statement,
        Struct,
        Text,
        Type,
        Variable,
    )

BASES = {"real": "f64", "int": "usize", "count": "usize", "bool": "bool"}
ZEROS = {"real": "0.0", "int": "0", "count": "0", "bool": "false"}
SIZES = {"N": "N_COORDINATES", "M": "N_EQUATIONS", "K": "N_PARAMETERS"}
"""Sizes that have longer names here: M is a quantity too."""
GIVEN = ("Point", "Variants")
"""Structs that the templates write."""
PUBLIC = ("march", "march_variants")
OF_STEPPER = ("set_out", "go_on")
"""Functions that are left out: a caller who asks for one time after the other is not served yet."""


class RustSolver(OneLane):
    """Prints the solver as Rust."""

    calls: Mapping[str, str] = {  # a constant
        "abs": "abs", "finite": "is_finite", "floor": "floor", "max": "max", "min": "min",
        "sqrt": "sqrt",
    }  # fmt: skip

    def __init__(self, text: Text) -> None:
        super().__init__(text)
        self.functions = {k: x for k, x in self.functions.items() if k not in OF_STEPPER}

    def kind(self, kind: Type) -> str:
        """Return a type; a large matrix is not on the stack."""
        return self.sized(kind, BASES.get(kind.base, kind.base), "Vec<[{0}; {2}]>")

    def zero(self, kind: Type) -> str:
        """Return the first value of a field."""
        return self.sized(kind, ZEROS[kind.base], "vec![[{0}; {2}]; {1}]")

    @staticmethod
    def sized(kind: Type, text: str, large: str) -> str:
        """Return an array of a type, or of values; a large matrix has a form of its own."""
        if kind.dims[:1] and kind.dims[0] in ROOM:
            return large.format(text, *kind.dims)
        for size in reversed([x for x in kind.dims if x != LANE]):
            text = f"[{text}; {SIZES.get(size, size)}]"
        return text

    def struct(self, item: Struct) -> Lines:
        """Return a struct that is not given, and what makes one."""
        if item.name in GIVEN:
            return []
        fields, zeros = [], []
        for name, kind in item.fields.items():
            fields += [f"    // {item.notes[name]}"] if item.notes[name] else []
            fields.append(f"    {name}: {self.kind(kind)},")
            zeros.append(f"            {name}: {self.zero(kind)},")
        made = [f"impl {item.name} {{", "    fn new() -> Self {", "        Self {"]
        made += [*zeros, "        }", "    }", "}"]
        return [*self.about(item.about), f"struct {item.name} {{", *fields, "}", "", *made]

    def head(self, item: Function) -> Lines:
        """Return the first line of a function."""
        given = []
        for x in item.parameters:
            mut = "mut " * self.is_changed(item, x)
            lent = f"&{mut}" if x.type.base in self.structs else ""
            given.append(f"{x.name}: {lent}{self.kind(x.type)}")
        result = f" -> {self.kind(item.result)}" if item.result.base != "nothing" else ""
        start = f"{'pub ' * (item.name in PUBLIC)}fn {item.name}({', '.join(given)}){result} {{"
        return textwrap.wrap(start, WIDTH, subsequent_indent="    ")

    def about(self, text: str) -> Lines:
        """Return what is said of a function or struct, as a comment for its documentation."""
        return [f"/{line}" for line in super().about(text)]

    def statement(self, node: Statement) -> Lines:
        """Return the lines of a statement; a point has its constants from the beginning."""
        match node:
            case Do(Call("constants")):
                return []
            case Do(Call("keep", (Name(to), Name(source)))):
                return [f"{to.name}.clone_from(&{source.name});"]
            case Do(Call("missed", (Name(b), weight, first, second))):
                left = f"({self.expression(first)}, {self.expression(second)})"
                return [f"{left} = missed_at({b.name}, &{self.expression(weight)});"]
        return super().statement(node)

    def declared(self, node: Declare) -> Lines:
        """Return the lines of a declaration."""
        variable, value = node.variable, node.value
        is_filled = bool(variable.type.dims) or variable.type.base in self.structs
        mut = "mut " * (variable.is_mutable or is_filled)
        # A number that changes has no type yet where it is asked for its size.
        is_open = variable.is_mutable and value.type == REAL and isinstance(value, Constant)
        kind = ": f64" * is_open
        return [f"let {mut}{variable.name}{kind} = {self.expression(value)};"]

    def assigned(self, node: Assign) -> Lines:
        """Return the lines of an assignment."""
        target, value = node.target, node.value
        text = self.expression(value)
        if node.operation and value.type.base == "bool":
            text = f"{self.at(value, ATOM)} as usize"
        if target.type.dims not in ((), (LANE,)) and isinstance(value, Constant):
            if target.type.dims[0] in ROOM:
                return [f"{self.expression(target)}.fill([{text}; {target.type.dims[1]}]);"]
            text = f"[{text}; {self.size(target.type)}]"
        return [f"{self.expression(target)} {node.operation}= {text};"]

    def counted(self, node: For) -> str:
        """Return the head of a loop over whole numbers."""
        limits = f"{self.expression(node.start)}..{self.expression(node.stop)}"
        if node.step != Constant(1, node.step.type):
            limits = f"({limits}).step_by({self.expression(node.step)})"
        return f"for {node.variable.name} in {limits}"

    def loop(self, head: str, body: Sequence[Statement]) -> Lines:
        """Return a loop."""
        if head.startswith("while ("):
            head = f"while {head[7:-1]}"
        return super().loop(head, body)

    def conditional(self, node: If, word: str = "if") -> Lines:
        """Return a branch, without parentheses around its condition."""
        first, *rest = super().conditional(node, word)
        return [first.replace(f"{word} (", f"{word} ", 1).removesuffix(") {") + " {", *rest]

    # ------------------------------------------------------------ expressions

    def constant(self, node: Constant) -> str:
        """Return a number or the name of one."""
        return SIZES.get(node.value) or super().constant(node)

    @staticmethod
    def size(kind: Type) -> str:
        """Return the number of rows."""
        return SIZES.get(kind.dims[0], kind.dims[0])

    def leaf(self, node: Name | Field | Index) -> tuple[str, int]:
        """Return a variable, a field or an entry, without the index of the one lane."""
        match node:
            case Index(Field(owner) as array, (row, *time, point)) if "any" in array.type.dims:
                if array.type.dims == ("any",):
                    return f"{self.expression(array)}[{self.expression(point)}]", ATOM
                size = SIZES["K" if array.name == "p" else "N"]
                place = self.at(self.row_of(owner, time, point), ATOM)
                return f"{self.expression(array)}[{place} * {size} + {self.expression(row)}]", ATOM
        return super().leaf(node)

    def binary(self, sign: str, left: Expression, right: Expression) -> tuple[str, int]:
        """Return an operation."""
        return super().binary("/" if sign == "//" else sign, left, right)

    def choice(
        self, condition: Expression, then: Expression, otherwise: Expression
    ) -> tuple[str, int]:
        """Return one of two values."""
        parts = (self.at(condition, OR), self.expression(then), self.expression(otherwise))
        return "if {} {{ {} }} else {{ {} }}".format(*parts), CHOICE

    def call(self, node: Call) -> tuple[str, int]:
        """Return a call."""
        match node.name, node.arguments:
            case "any_lane" | "copied", _:
                return super().call(node)
            case "row" | "rows", ():
                return f"[0.0; {self.size(node.type)}]", ATOM
            case "part", (vector, first):
                return f"{self.expression(vector)}[{self.expression(first)}]", ATOM
            case "solve", (Name(point), right):
                return f"solve_at(&{point.name}.F, &{self.expression(right)})", ATOM
            case "store", (Field(owner) as block, rows, time, first, _):
                place = self.at(self.row_of(owner, [time], first), ATOM)
                source, n = self.expression(rows), SIZES["N"]
                return (
                    f"{self.expression(block)}[{place} * {n}..][..{n}].copy_from_slice(&{source})",
                    ATOM,
                )
            case "take_up", (Name() as at, Name() as b, *_):
                return f"take_up({self.lent(at, True)}, {self.lent(b)})", ATOM
            case "put_at", (Name() as b, Name() as at, *_):
                return f"put_at({self.lent(b, True)}, {self.lent(at)})", ATOM
            case _, (number, *others) if node.name in self.calls:
                given = ", ".join(map(self.expression, others))
                return f"{self.at(number, ATOM)}.{self.calls[node.name]}({given})", ATOM
        if node.name in self.structs:
            return f"{node.name}::new()", ATOM
        parameters: tuple[Variable | None, ...] = (None,) * len(node.arguments)
        if node.name in self.functions:
            function = self.functions[node.name]
            parameters = function.parameters
            parameters = tuple(x if self.is_changed(function, x) else None for x in parameters)
        is_kernel = node.name in KERNELS
        passed = [
            self.lent(x, is_kernel or y is not None)
            if isinstance(x, Name) and x.type.base in self.structs
            else self.expression(x)
            for x, y in zip(node.arguments, parameters, strict=True)
        ]
        return f"{node.name}{'_at' * is_kernel}({', '.join(passed)})", ATOM

    @staticmethod
    def is_changed(function: Function, parameter: Variable) -> bool:
        """Whether a function is lent a parameter for a change."""
        return parameter.name in function.changes

    @staticmethod
    def lent(name: Name, is_changed: bool = False) -> str:
        """Return a struct as it is lent to a function."""
        if name.variable.is_parameter:
            return name.variable.name
        return f"&{'mut ' * is_changed}{name.variable.name}"

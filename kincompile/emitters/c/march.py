"""The solver in C: a lane is an entry of an array, and neighbours share a loop over lanes."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from kincompile.emitters.solver_printer import ATOM, CHOICE, RELATION, WIDTH, SolverPrinter
from kincompile.solver.nodes import (
    LANE,
    Assign,
    Binary,
    Call,
    Comment,
    Constant,
    Declare,
    Field,
    If,
    Index,
    Name,
    Unary,
    variables_in,
)  # fmt: skip
from kincompile.solver.vocabulary import KERNELS, STATUSES, WORDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.emitters.solver_printer import Lines
    from kincompile.solver.nodes import (
        Expression,
        For,
        Function,
        Statement,
        Struct,
        Text,
        Type,
        Variable,
    )  # fmt: skip

BASES = {"real": "double", "int": "int", "count": "size_t", "bool": "int", "nothing": "void"}
GIVEN = {"Point": "strip", "State": "state"}
"""Structs whose layout the templates write, and their names there."""
PUBLIC = (
    "march_variants", "follow_variants", "attempt_variants", "mirror_variants", "lead_variants"
)  # fmt: skip
"""Functions that the header declares."""
APART = (
    "lay", "put_on", "fill", "weigh", "eliminate", "substitute", "direct", "descend", "mirror"
)  # fmt: skip
"""Functions that a compiler need not put in line: they would take it a second."""
OF_SETS = "put_to_rest"
"""The first function of many parameter sets: who needs none leaves it out, and all after it."""
ON_LINES = ("position", "nu", "gamma")
"""Kernels that have others beside them for points on lines of parameters."""
NUMBERS = {"NOTHING": "NAN", "INFINITE": "INFINITY"}
AT_LEAST_ONE = ("BLOCKS", "K")
"""Sizes that may be 0, of which C has no arrays."""
CLEARED = ("Outcome",)
"""Structs that begin with zeros: lanes beyond the last one are computed with it."""
HELD = "\xa0"
"""A blank at which no line ends."""


class CSolver(SolverPrinter):
    """Prints the solver of a mechanism as C.

    A truth of a lane that a function declares is a double, 0 or not: as wide as the numbers beside
    it, so that a register takes as many.
    """

    calls: Mapping[str, str] = {  # a constant
        "abs": "fabs", "finite": "isfinite", "max": "fmax", "min": "fmin",
    }  # fmt: skip
    has_lanes = True
    """Whether a lane is an entry of an array, of as many as a function is given."""

    def __init__(self, text: Text, name: str, sizes: Mapping[str, int] | None = None) -> None:
        SolverPrinter.__init__(self, text)
        self.name = name
        self.sizes = sizes  # as numbers, where arrays have them in place of names
        self.own: Function | None = None
        self.inside = False  # a loop over lanes
        self.here: set[Variable] = set()  # what such a loop declares within itself

    # ------------------------------------------------------------ types

    def kind(self, base: str) -> str:
        """Return the type of a base."""
        if base == "Variants":
            return f"{self.name}_variants"
        return BASES.get(base) or GIVEN.get(base) or base.lower()

    def dims(self, kind: Type) -> str:
        """Return the sizes of an array, of which C has none without entries."""
        if self.sizes is not None:
            return "".join(f"[{max(self.sizes[x], 1)}]" for x in kind.dims if x != LANE)
        sizes = [f"{x} > 0 ? {x} : 1" if x in AT_LEAST_ONE else x for x in kind.dims]
        return "".join(f"[{'LANES' if x == LANE else x}]" for x in sizes)

    def struct(self, item: Struct) -> Lines:
        """Return a struct that is not given."""
        if item.name in (*GIVEN, "Variants"):
            return []
        rows = [f"{self.kind(x.base)} {name}{self.dims(x)};" for name, x in item.fields.items()]
        notes = list(item.notes.values())
        widest = max(len(row) for row, note in zip(rows, notes, strict=True) if note)
        lines = [
            f"    {row:<{widest}}  // {note}" if note else f"    {row}"
            for row, note in zip(rows, notes, strict=True)
        ]
        return [*self.about(item.about), "typedef struct {", *lines, f"}} {self.kind(item.name)};"]

    def parameter(self, item: Function, variable: Variable) -> str:
        """Return a parameter."""
        kind, name = variable.type, variable.name
        if kind.base in self.structs:
            # what variants point to is changed, not where they point; kernels change points
            is_changed = name in item.changes or kind.base == "Point"
            is_const = not is_changed or kind.base == "Variants"
            return f"{'const ' * is_const}{self.kind(kind.base)} *{name}"
        if len(kind.dims) == 2 and kind.dims[0] == "any":
            return f"{self.name}_input {name}"
        return f"{'const ' if kind.dims else ''}{BASES[kind.base]} {'*' * bool(kind.dims)}{name}"

    def linkage(self, name: str) -> str:
        """Return what stands before a function: that it is of the file alone."""
        return "" if name in PUBLIC else "_never_inline " if name in APART else "static "

    def head(self, item: Function) -> Lines:
        """Return the first lines of a function."""
        self.own, self.variables = item, list(variables_in(item.body))
        given = [self.parameter(item, x) for x in item.parameters]
        given += ["size_t lanes"] * (item.is_lanewise and self.has_lanes)
        listed = ", ".join(x.replace(" ", HELD) for x in given)
        kind = self.kind(item.result.base)
        name = f"{self.name}_{item.name}" if item.name in PUBLIC else item.name
        start = f"{self.linkage(item.name)}{kind} {name}({listed})"
        lines = textwrap.wrap(start, WIDTH, subsequent_indent="    ")
        return [*(x.replace(HELD, " ") for x in lines), "{"]

    def function(self, item: Function) -> Lines:
        """Return a function."""
        lines = super().function(item)
        if any("lane < all;" in line for line in lines):
            lines.insert(lines.index("{") + 1, "    const size_t all = _abreast(lanes);")
        return lines

    def text(self) -> str:
        """Return the solver, in which what many parameter sets need can be left out."""
        if OF_SETS not in self.functions:
            return super().text()
        functions = "\n".join(self.function(self.functions[OF_SETS]))
        first, rest = super().text().split(functions)
        return f"{first}// Many parameter sets.\n#ifndef _WITHOUT_SETS\n\n{functions}{rest}\n#endif"

    # ------------------------------------------------------------ loops over lanes

    def block(self, statements: Sequence[Statement]) -> list[Lines]:
        """Put neighbours that work on lanes into one loop."""
        parts: list[Lines] = []
        group: list[Statement] = []
        for node in statements:
            if self.is_zero(node):
                parts.append(self.statement(node))
            elif self.is_lanewise(node) or (group and isinstance(node, Comment)):
                group.append(node)
            else:
                parts += self.over_lanes(group)
                group = []
                parts.append(self.statement(node))
        return parts + self.over_lanes(group)

    @staticmethod
    def is_zero(node: Statement) -> bool:
        """Whether a statement declares a lane that is zero, as an initializer says."""
        return (
            isinstance(node, Declare)
            and node.variable.type.is_lane
            and isinstance(node.value, Constant)
            and not node.value.value
        )

    @staticmethod
    def is_lanewise(node: Statement) -> bool:
        """Whether a statement is one of each lane."""
        if isinstance(node, Declare):
            return node.variable.type.is_lane and not _is_part(node.value)
        return isinstance(node, Assign) and node.target.type.is_lane

    def over_lanes(self, group: Sequence[Statement]) -> list[Lines]:
        """Return a loop, and before it the arrays that are used beyond."""
        if not group:
            return []
        assert self.own is not None
        declared = [x.variable for x in group if isinstance(x, Declare)]
        used = list(variables_in(tuple(group)))
        beyond = [x for x in declared if used.count(x) < self.variables.count(x)]
        self.here = set(declared) - set(beyond)
        self.inside = True
        inner = [line for x in group for line in self.statement(x)]
        self.inside = False
        # What is given may end with the last lane.
        is_given = any(x.is_parameter and x.type.is_lane for x in used)
        rounded = "lanes" if is_given else "all"
        limit = rounded if self.own.is_lanewise else "LANES"
        head = f"for (size_t lane = 0; lane < {limit}; lane++)"
        cleared = " = { 0 }" if is_given else ""
        arrays = [[f"double {x.name}[LANES]{cleared};"] for x in beyond]
        if len(inner) == 1:
            return [*arrays, [head, f"    {inner[0]}"]]
        return [*arrays, [f"{head} {{", *(f"    {x}" for x in inner), "}"]]

    # ------------------------------------------------------------ statements

    def declared(self, node: Declare) -> Lines:
        """Return the lines of a declaration."""
        variable, value = node.variable, node.value
        name, kind = variable.name, variable.type
        if kind.base in self.structs:
            cleared = " = { 0 }" if kind.base in CLEARED else ""
            return [f"{self.kind(kind.base)} {name}{cleared};"]
        if self.is_zero(node):
            return [f"double {name}[LANES] = {{ 0 }};"]
        if kind.dims and not kind.is_lane:
            return [f"double {name}{self.dims(kind)};", *self.filled(Name(variable), value)]
        if kind.is_lane and variable not in self.here:
            return [f"{name}[lane] = {self.truth(value)};"]
        const = "" if variable.is_mutable else "const "
        return [f"{const}{BASES[kind.base]} {name} = {self.expression(value)};"]

    def assigned(self, node: Assign) -> Lines:
        """Return the lines of an assignment."""
        target, value = node.target, node.value
        if target.type.dims and not target.type.is_lane:
            return self.filled(target, value)
        into = self.place(target)
        if self.inside and value.type.base == "bool" and target.type.base == "bool":
            return [f"{into} = {self.truth(value, target)};"]
        if node.operation == "+" and value == Constant(1, value.type):
            return [f"{into}++;"]
        text = self.place(value) if isinstance(value, Name) else self.expression(value)
        if isinstance(target, Field) and isinstance(value, Name) and target.type.base == "int":
            text = f"(int){text}"
        return [f"{into} {node.operation}= {text};"]

    def filled(self, target: Expression, value: Expression) -> Lines:
        """Return what fills rows."""
        into = self.place(target)
        match value:
            case Call("row" | "rows"):
                return []
            case Call("solve", (Name() as point, right)):
                owner = f"{point.variable.name}{self.arrow(point)}"
                given = [f"{owner}Phi_q", f"{owner}F", self.place(right), into]
                given += ["lanes"] * self.has_lanes
                return [f"{self.kernel('solve')}({', '.join(given)});"]
            case Constant():
                return [f"memset({into}, 0, sizeof {into});"]
            case Call("copied", (source,)):
                return [f"memcpy({into}, {self.place(source)}, sizeof {into});"]
        return [f"memcpy({into}, {self.place(value)}, sizeof {into});"]

    def truth(self, value: Expression, target: Expression | None = None) -> str:
        """Return a truth of a lane for an array of them: as a choice, which needs no branch."""
        if value.type.base != "bool":
            return self.expression(value)
        match value:
            case Unary("not", operand):
                return f"{self.at(operand, RELATION)} ? 0 : 1"
            case Binary("or" | "and" as sign, left, right) if left == target:
                is_or, is_not = sign == "or", isinstance(right, Unary)
                condition = right.operand if isinstance(right, Unary) else right
                values = ["1" if is_or else "0", self.place(left)]
                first, second = values if is_or != is_not else reversed(values)
                return f"{self.at(condition, RELATION)} ? {first} : {second}"
        return self.expression(value)

    def counted(self, node: For) -> str:
        """Return the head of a loop over whole numbers."""
        name, stop = node.variable.name, self.at(node.stop, RELATION + 1)
        step = (
            "++"
            if node.step == Constant(1, node.step.type)
            else f" += {self.expression(node.step)}"
        )
        first = f"{BASES[node.variable.type.base]} {name} = {self.expression(node.start)}"
        return f"for ({first}; {name} < {stop}; {name}{step})"

    def loop(self, head: str, body: Sequence[Statement]) -> Lines:
        """Return a loop, without braces around one statement."""
        parts = self.block(body)
        lines = [f"    {line}" for part in parts for line in part]
        return [head, *lines] if len(parts) == 1 else [f"{head} {{", *lines, "}"]

    def conditional(self, node: If, word: str = "if") -> Lines:
        """Return a branch, without braces around one statement that is no branch."""
        lines = super().conditional(node, word)
        if len(lines) == 3 and word == "if":
            return [lines[0].removesuffix(" {"), lines[1]]
        return lines

    # ------------------------------------------------------------ expressions

    def constant(self, node: Constant) -> str:
        """Return a number or the name of one."""
        if isinstance(node.value, bool):
            return str(int(node.value))
        if node.value in STATUSES:
            return f"{self.name.upper()}_{node.value}"
        if node.value == "PATTERN":
            return f"{self.name}_pattern"
        return NUMBERS.get(node.value, str(node.value))

    def leaf(self, node: Name | Field | Index) -> tuple[str, int]:
        """Return a variable, a field or an entry; of an array of truths, that it is not 0."""
        text = self.place(node)
        is_wide = self.inside and isinstance(node, Name) and node.variable not in self.here
        return (f"{text} != 0", RELATION) if is_wide and node.type.base == "bool" else (text, ATOM)

    def place(self, node: Expression) -> str:
        """Return where a value is."""
        lane = "[lane]" if self.inside and node.type.is_lane else ""
        match node:
            case Name(variable):
                return variable.name + ("" if variable in self.here else lane)
            case Field(struct, name):
                return f"{struct.variable.name}{self.arrow(struct)}{name}{lane}"
            case Index(Field() as array, indices) if (
                array.type.dims[0] == "any" and len(indices) > 1
            ):
                return self.entry(array, indices)
            case Index(array, indices):
                inside, self.inside = self.inside, False
                text = self.place(array) + "".join(f"[{self.expression(x)}]" for x in indices)
                self.inside = inside
                return text + lane
        return self.expression(node)

    @staticmethod
    def arrow(struct: Name) -> str:
        """Return what stands between a struct and its field."""
        return "->" if struct.variable.is_parameter else "."

    def entry(self, array: Field, indices: tuple[Expression, ...]) -> str:
        """Return an entry of a table or a block."""
        text, owner = self.place(array), array.struct
        row, *time, point = (self.at(x, ATOM) for x in indices)
        terms = [f"{row} * {text}.entry"]
        terms += [f"(ptrdiff_t){x} * {owner.variable.name}{self.arrow(owner)}time" for x in time]
        return f"{text}.first[{' + '.join([*terms, f'(ptrdiff_t){point} * {text}.point'])}]"

    def binary(self, sign: str, left: Expression, right: Expression) -> tuple[str, int]:
        """Return an operation."""
        return super().binary("/" if sign == "//" else sign, left, right)

    def pointer(self, name: Name) -> str:
        """Return the address of a struct."""
        return f"{'' if name.variable.is_parameter else '&'}{name.variable.name}"

    def call(self, node: Call) -> tuple[str, int]:
        """Return a call."""
        match node.name, node.arguments:
            case "part", (vector, first):
                return f"{self.place(vector)} + {self.expression(first)}", RELATION
            case "min" | "max", (a, b) if node.type.base != "real":
                sign = "<" if node.name == "min" else ">"
                texts = self.at(a, RELATION + 1), self.at(b, RELATION + 1)
                return f"{texts[0]} {sign} {texts[1]} ? {texts[0]} : {texts[1]}", CHOICE
            case "store", (Field(owner) as block, rows, time, *rest):
                stride = f"{owner.variable.name}{self.arrow(owner)}time"
                parts = [f"(ptrdiff_t){self.at(time, ATOM)}", stride, self.place(rows)]
                parts += map(self.expression, rest)
                return f"store({self.place(block)}, {', '.join(parts)})", ATOM
        is_kernel = node.name in (*KERNELS, "missed")
        name = self.calls.get(node.name, node.name)
        if name in PUBLIC:
            name = f"{self.name}_{name}"
        if is_kernel:
            name = self.kernel(name)
        parameters: tuple[Variable | None, ...] = (None,) * len(node.arguments)
        is_lanewise = node.name in WORDS and WORDS[node.name].is_lanewise
        if node.name in self.functions:
            function = self.functions[node.name]
            parameters, is_lanewise = function.parameters, function.is_lanewise
        given = [self.given(x, y) for x, y in zip(node.arguments, parameters, strict=True)]
        if is_lanewise and self.has_lanes:
            given.append("lanes" if node.lanes is None else self.expression(node.lanes))
        return f"{name}({', '.join(given)})", ATOM

    @staticmethod
    def kernel(name: str) -> str:
        """Return what a kernel is called."""
        return f"{name}_on_line" if name in ON_LINES else f"{name}_of_strip"

    def given(self, argument: Expression, parameter: Variable | None) -> str:
        """Return an argument: of a struct its address, of one number for a lane too."""
        if isinstance(argument, Name) and argument.type.base in self.structs:
            return self.pointer(argument)
        if parameter is not None and parameter.type.is_lane and not argument.type.dims:
            return f"&{self.place(argument)}"
        return self.expression(argument)


def _is_part(value: Expression) -> bool:
    return isinstance(value, Call) and value.name == "part"

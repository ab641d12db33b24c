"""The solver in JavaScript: a lane is a number, rows are arrays that are made once."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.emitters.lines import wrapped
from kincompile.emitters.solver_printer import ATOM, RELATION, OneLane
from kincompile.solver.nodes import LANE, Call, Constant, Name

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.emitters.solver_printer import Lines
    from kincompile.solver.nodes import (
        Assign,
        Declare,
        Expression,
        Field,
        For,
        Function,
        Index,
        Struct,
        Text,
        Type,
        Variable,
    )

FUNCTIONS_BY_HAND = (
    "measure", "speed_of", "until_lock_up", "locks_up", "walk", "scales_of", "advance", "record",
    "put_at_guesses", "assemble", "march", "set_out", "go_on", "put_to_rest", "follow_variants",
    "march_variants", "position_from",
)  # fmt: skip
"""Functions that are not printed: what is kept of a motion, and its events, are written by hand."""
STRUCTS_BY_HAND = ("State", "Point", "Scales", "Variants")
"""Structs that are not printed: a point and scales have more in them here."""
ZEROS = {"real": "0", "int": "0", "bool": "false"}
NUMBERS = {"INFINITE": "Infinity"}


class JavaScriptSolver(OneLane):
    """Prints the solver as JavaScript."""

    signs: Mapping[str, str] = {  # a constant
        "and": "&&", "or": "||", "==": "===", "!=": "!==",
    }  # fmt: skip
    calls: Mapping[str, str] = {  # a constant
        "abs": "Math.abs", "finite": "Number.isFinite", "max": "Math.max", "min": "Math.min",
        "sqrt": "Math.sqrt", "position": "position_at", "nu": "nu_at", "gamma": "gamma_at",
        "factor": "prepare", "take_up": "copy_state", "put_at": "copy_state",
        "evaluate": "evaluate_at", "floor": "Math.floor", "single": "rounded",
        # where a page wants to know what was met on the way
        "plain_step": "noted_step", "take": "take_and_note",
    }  # fmt: skip

    def __init__(self, text: Text) -> None:
        super().__init__(text)
        self.structs = {k: x for k, x in text.structs.items() if k not in STRUCTS_BY_HAND}
        self.functions = {k: x for k, x in text.functions.items() if k not in FUNCTIONS_BY_HAND}
        self.arrays: dict[Variable, tuple[str, str]] = {}  # of one function: names and sizes

    def struct(self, item: Struct) -> Lines:
        """Return what makes a struct."""
        fields = []
        for name, kind in item.fields.items():
            note = f"  // {item.notes[name]}" if item.notes[name] else ""
            fields.append(f"    {name}: {self.zero(kind)},{note}")
        head = f"const new_{item.name.lower()} = () => ({{"
        return [*self.about(item.about), head, *fields, "});"]

    @staticmethod
    def zero(kind: Type) -> str:
        """Return the first value of a field."""
        match [x for x in kind.dims if x != LANE]:
            case [size]:
                return f"new Float64Array({size})"
            case [rows, columns]:
                return f"zeros({rows}, {columns})"
        return ZEROS[kind.base]

    def function(self, item: Function) -> Lines:
        """Return a function, and before it the arrays that it works with."""
        self.own, self.arrays = item, {}
        lines = super().function(item)
        # names may come again where their scopes are apart
        own = dict.fromkeys(self.arrays.values())
        made = [f"{name} = new Float64Array({size})" for name, size in own]
        if not made:
            return lines
        text = "\n    ".join(wrapped(made)).removesuffix(",")
        return [*f"const {text};".split("\n"), *lines]

    def head(self, item: Function) -> Lines:
        """Return the first line of a function."""
        return [f"function {item.name}({', '.join(x.name for x in item.parameters)}) {{"]

    def declared(self, node: Declare) -> Lines:
        """Return the lines of a declaration; rows are among the arrays."""
        variable, value = node.variable, node.value
        if variable.type.dims not in ((), (LANE,)):
            self.arrays[variable] = f"{variable.name}_of_{self.own.name}", variable.type.dims[0]
            return self.filled(Name(variable), value)
        word = "let" if variable.is_mutable else "const"
        return [f"{word} {variable.name} = {self.expression(value)};"]

    def assigned(self, node: Assign) -> Lines:
        """Return the lines of an assignment."""
        target, value = node.target, node.value
        if target.type.dims not in ((), (LANE,)):
            return self.filled(target, value)
        if node.operation and value.type.base == "bool":
            return [
                f"{self.expression(target)} {node.operation}= Number({self.expression(value)});"
            ]
        return super().assigned(node)

    def filled(self, target: Expression, value: Expression) -> Lines:
        """Return what fills rows."""
        into = self.expression(target)
        match value:
            case Call("row" | "rows"):
                return []
            case Constant():
                each = f"{into}.forEach(row => row.fill(0));"
                return [each if target.type.dims[1:] not in ((), (LANE,)) else f"{into}.fill(0);"]
            case Call("solve", (point, right)):
                return [f"solve_into({self.expression(point)}, {self.expression(right)}, {into});"]
        return [f"{into}.set({self.expression(value)});"]

    def counted(self, node: For) -> str:
        """Return the head of a loop over whole numbers."""
        name, stop = node.variable.name, self.at(node.stop, RELATION + 1)
        return f"for (let {name} = {self.expression(node.start)}; {name} < {stop}; {name} += 1)"

    # ------------------------------------------------------------ expressions

    def constant(self, node: Constant) -> str:
        """Return a number or the name of one."""
        return NUMBERS.get(node.value) or super().constant(node)

    def leaf(self, node: Name | Field | Index) -> tuple[str, int]:
        """Return a variable, a field or an entry."""
        if isinstance(node, Name) and node.variable in self.arrays:
            return self.arrays[node.variable][0], ATOM
        return super().leaf(node)

    def call(self, node: Call) -> tuple[str, int]:
        """Return a call, of a struct what makes it."""
        if node.name in self.structs:
            return f"new_{node.name.lower()}()", ATOM
        return super().call(node)

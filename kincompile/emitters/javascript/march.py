"""The solver in JavaScript: a lane is a number, rows are arrays that are made once."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.emitters.lines import wrapped
from kincompile.emitters.solver_printer import ATOM, OneLane
from kincompile.solver.nodes import Call, Constant, Name

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
        Variable,
    )

FUNCTIONS = (
    "measure_here", "holds_to_rounding", "meets_rates", "correct", "complete", "step",
    "advance_carefully",
)  # fmt: skip
"""Functions that are printed; the rest of a motion is written by hand, with its events."""
STRUCTS = ("Outcome",)
"""Structs that are printed; a point and scales have more in them here."""
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
    }  # fmt: skip

    def __init__(self, text: Text) -> None:
        super().__init__(text)
        self.structs = {name: text.structs[name] for name in STRUCTS}
        self.functions = {name: text.functions[name] for name in FUNCTIONS}
        self.arrays: dict[Variable, tuple[str, str]] = {}  # of one function: names and sizes

    def struct(self, item: Struct) -> Lines:
        """Return what makes a struct."""
        fields = []
        for name, kind in item.fields.items():
            note = f"  // {item.notes[name]}" if item.notes[name] else ""
            fields.append(f"    {name}: {ZEROS[kind.base]},{note}")
        head = f"const new_{item.name.lower()} = () => ({{"
        return [*self.about(item.about), head, *fields, "});"]

    def function(self, item: Function) -> Lines:
        """Return a function, and before it the arrays that it works with."""
        self.own, self.arrays = item, {}
        lines = super().function(item)
        made = [f"{name} = new Float64Array({size})" for name, size in self.arrays.values()]
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
        if len(variable.type.dims) == 2:
            self.arrays[variable] = f"{variable.name}_of_{self.own.name}", variable.type.dims[0]
            return self.filled(Name(variable), value)
        word = "let" if variable.is_mutable else "const"
        return [f"{word} {variable.name} = {self.expression(value)};"]

    def assigned(self, node: Assign) -> Lines:
        """Return the lines of an assignment."""
        target, value = node.target, node.value
        if len(target.type.dims) == 2:
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
            case Call("rows"):
                return []
            case Call("solve", (point, right)):
                return [f"solve_into({self.expression(point)}, {self.expression(right)}, {into});"]
        return [f"{into}.set({self.expression(value)});"]

    def counted(self, node: For) -> str:
        """Return the head of a loop over whole numbers."""
        name, start, stop = node.variable.name, *map(self.expression, (node.start, node.stop))
        return f"for (let {name} = {start}; {name} < {stop}; {name} += 1)"

    # ------------------------------------------------------------ expressions

    def constant(self, node: Constant) -> str:
        """Return a number or the name of one."""
        return NUMBERS.get(node.value) or super().constant(node)

    def leaf(self, node: Name | Field | Index) -> tuple[str, int]:
        """Return a variable, a field or an entry."""
        if isinstance(node, Name) and node.variable in self.arrays:
            return self.arrays[node.variable][0], ATOM
        return super().leaf(node)

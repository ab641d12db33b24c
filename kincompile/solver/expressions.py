"""Expressions of the solver's text, read into nodes with their types."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

from kincompile.solver.nodes import (
    BOOL,
    COUNT,
    INT,
    LANE,
    NO_VALUE,
    REAL,
    Binary,
    Call,
    Choice,
    Constant,
    Field,
    Index,
    Name,
    Type,
    Unary,
    Variable,
)  # fmt: skip
from kincompile.solver.vocabulary import (
    CONSTANTS,
    LANES_OF_REALS,
    ROOM,
    SIZES,
    TYPES,
    WORDS,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.solver.nodes import Expression, Function, Struct

ARITHMETIC = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//"}
RELATIONS = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip
TRUTHS = {ast.BitAnd: "and", ast.BitOr: "or", ast.And: "and", ast.Or: "or"}


class Refused(SyntaxError):  # noqa: N818  # as a word of the language
    """What the language of the solver does not have, with its line."""


def refused(node: ast.expr | ast.stmt | ast.arg, message: str) -> Refused:
    """Return the refusal of a node."""
    return Refused(f"line {node.lineno}: {message}")


class Expressions:
    """Reads the expressions of one function."""

    def __init__(
        self, structs: dict[str, Struct], functions: dict[str, Function], own: Function
    ) -> None:
        self.structs, self.functions, self.own = structs, functions, own
        self.scopes: list[dict[str, Variable]] = [{x.name: x for x in own.parameters}]

    def lookup(self, name: str) -> Variable | None:
        """Return the variable of a name, or None."""
        return next((scope[name] for scope in reversed(self.scopes) if name in scope), None)

    def change(self, node: Expression) -> None:
        """Note that what a parameter refers to is changed."""
        while isinstance(node, Field | Index):
            node = node.struct if isinstance(node, Field) else node.array
        if isinstance(node, Name) and node.variable.is_parameter:
            self.own.changes.add(node.variable.name)

    def single(self, node: ast.expr, base: str) -> Expression:
        """Return an expression that is one value for all lanes."""
        found = self.read(node)
        if found.type.dims:
            raise refused(node, "a lane, where one value is needed; say any_lane, or where")
        if base == "count" and found.type.base in ("int", "count"):
            return found
        if found.type.base != base:
            raise refused(node, f"a {found.type.base}, where a {base} is needed")
        return found

    def read(self, node: ast.expr) -> Expression:
        """Return an expression."""
        match node:
            case ast.Constant(value=bool() | int() | float() as value):
                return Constant(value, {bool: BOOL, int: INT, float: REAL}[type(value)])
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.Attribute(value=ast.Name(id=owner), attr=name):
                return self._field(node, owner, name)
            case ast.Subscript(value=array, slice=index):
                return self._index(node, self.read(array), index)
            case ast.UnaryOp(op=sign, operand=operand):
                return self._unary(node, sign, self.read(operand))
            case ast.BinOp(left=left, op=sign, right=right):
                return self.binary(node, sign, self.read(left), self.read(right))
            case ast.BoolOp(op=sign, values=values):
                first, *rest = (self.single(x, "bool") for x in values)
                for other in rest:
                    first = self.binary(node, sign, first, other)
                return first
            case ast.Compare(left=left, ops=[sign], comparators=[right]):
                return self.binary(node, sign, self.read(left), self.read(right))
            case ast.IfExp(test=test, body=then, orelse=otherwise):
                return self._choice(node, self.single(test, "bool"), then, otherwise)
            case ast.Call(func=ast.Name(id=name)):
                return self._call(node, name)
        raise refused(node, f"{ast.unparse(node)} is no expression of the language")

    def _name(self, node: ast.expr, name: str) -> Expression:
        variable = self.lookup(name)
        if variable is not None:
            return Name(variable)
        if name not in CONSTANTS:
            raise refused(node, f"{name} is not known here")
        return Constant(name, CONSTANTS[name])

    def _field(self, node: ast.expr, owner: str, name: str) -> Expression:
        variable = self.lookup(owner)
        if variable is None or variable.type.base not in self.structs:
            raise refused(node, f"{owner} is no struct")
        fields = self.structs[variable.type.base].fields
        if name not in fields:
            raise refused(node, f"{variable.type.base} has no {name}")
        return Field(Name(variable), name, fields[name])

    def _index(self, node: ast.expr, array: Expression, index: ast.expr) -> Expression:
        parts = index.elts if isinstance(index, ast.Tuple) else [index]
        if len(parts) > len(array.type.dims):
            raise refused(node, f"{ast.unparse(node)} has too many indices")
        reaches_lane = array.type.dims[len(parts) - 1] == LANE
        if reaches_lane and self.own.is_lanewise:
            raise refused(node, "a function of lanes takes all of them alike; no index of a lane")
        indices = tuple(self.single(x, "count") for x in parts)
        for place, size in zip(indices, array.type.dims, strict=False):
            limit = place.variable.below if isinstance(place, Name) else ""
            if limit and size in SIZES and limit != size:
                raise refused(node, f"{ast.unparse(node)} goes to {limit}, and there are {size}")
        return Index(array, indices, Type(array.type.base, array.type.dims[len(parts) :]))

    def _unary(self, node: ast.expr, sign: ast.unaryop, operand: Expression) -> Expression:
        is_truth = operand.type.base == "bool"
        if isinstance(sign, ast.USub) and not is_truth:
            return Unary("neg", operand, operand.type)
        if is_truth and isinstance(sign, ast.Not if not operand.type.dims else ast.Invert):
            return Unary("not", operand, operand.type)
        raise refused(node, "not is said of one truth, ~ of a lane of them, - of numbers")

    def binary(
        self, node: ast.expr | ast.stmt, sign: ast.AST, left: Expression, right: Expression
    ) -> Expression:
        """Return an operation on two operands."""
        kind = type(sign)
        word = (ARITHMETIC | RELATIONS | TRUTHS).get(kind)
        if word is None:
            raise refused(node, f"{kind.__name__} is no operation of the language")
        a, b = left.type, right.type
        if not {a.dims, b.dims} <= {(), (LANE,)}:
            raise refused(node, "rows are worked on one by one, in a loop")
        dims = a.dims or b.dims
        if kind in TRUTHS:
            if a.base != "bool" or b.base != "bool" or (kind in (ast.And, ast.Or) and dims):
                raise refused(node, "and, or are said of single truths, & and | of lanes of them")
            return Binary(word, left, right, Type("bool", dims))
        base = self._common(node, left, right)
        if kind in (ast.Div, ast.FloorDiv) and (base == "real") == (kind is ast.FloorDiv):
            raise refused(node, "/ divides real numbers, // whole ones")
        return Binary(word, left, right, Type("bool" if kind in RELATIONS else base, dims))

    def _common(self, node: ast.expr | ast.stmt, left: Expression, right: Expression) -> str:
        """Return the base of two operands; a whole constant may be a count."""
        bases = {left.type.base, right.type.base}
        if bases == {"int", "count"}:
            either = left if left.type.base == "int" else right
            if is_constant(either):
                return "count"
        if len(bases) > 1 or not bases <= {"real", "int", "count"}:
            raise refused(node, f"{' and '.join(sorted(bases))} do not go together")
        return bases.pop()

    def _choice(
        self, node: ast.expr, condition: Expression, then: ast.expr, otherwise: ast.expr
    ) -> Expression:
        values = first, second = self.read(then), self.read(otherwise)
        bases = {x.type.base for x in values}
        base = bases.pop() if len(bases) == 1 else self._common(node, *values)
        dims = [x.type.dims for x in (condition, *values) if x.type.dims]
        if any(x != (LANE,) for x in dims):
            raise refused(node, "rows are chosen from one by one, in a loop")
        return Choice(condition, first, second, Type(base, dims[0] if dims else ()))

    def _call(self, node: ast.Call, name: str) -> Expression:
        lanes = None
        for keyword in node.keywords:
            if keyword.arg != "lanes":
                raise refused(node, f"{name} is called with {keyword.arg}; only lanes is named")
            lanes = self.single(keyword.value, "count")
        if name == "where" and len(node.args) == 3:
            condition = self.read(node.args[0])
            if condition.type != TYPES["LaneBool"]:
                raise refused(node, "where is said of a lane of truths")
            return self._choice(node, condition, *node.args[1:])
        if name in ("row", "rows") and [type(x) for x in node.args] == [ast.Name]:
            kind = f"{name.title()}[{ast.unparse(node.args[0])}]"
            return Call(name, (), self.type_of(node, kind))
        if name in self.structs and not node.args:
            return Call(name, (), Type(name))
        given = tuple(map(self.read, node.args))
        if name in WORDS:
            return self._word(node, name, given, lanes)
        if name in self.functions:
            return self._own(node, self.functions[name], given, lanes)
        raise refused(node, f"{name} is no word of the language, and no function above")

    def type_of(self, node: ast.expr | ast.stmt | ast.arg, text: str) -> Type:
        """Return the type that an annotation names."""
        word, _, size = text.rstrip("]").partition("[")
        if not size and (text in TYPES or text in self.structs):
            return TYPES.get(text) or Type(text)
        if word in ("Row", "Rows") and size in SIZES:
            return Type("real", (size,) if word == "Row" else (size, LANE))
        if word == "Matrix" and {*size.split(", ")} <= {*ROOM, *SIZES}:
            return Type("real", tuple(size.split(", ")))
        if text == "Vector[Int]":
            return Type("int", ("any",))
        raise refused(node, f"{text} is no type of the language")

    def _word(
        self, node: ast.Call, name: str, given: tuple[Expression, ...], lanes: Expression | None
    ) -> Call:
        word = WORDS[name]
        if len(given) != len(word.takes):
            raise refused(node, f"{name} takes {len(word.takes)} arguments, {len(given)} are given")
        for argument, wanted in zip(given, word.takes, strict=True):
            if not self._fits(node, argument, wanted, given[0]):
                raise refused(node, f"{name} takes {', '.join(word.takes)}")
        self._check_lanes(node, name, word.is_lanewise, lanes)
        for place in word.changes:
            self.change(given[place])
        return Call(name, given, self._given(node, word.gives, given), lanes)

    def _given(self, node: ast.Call, gives: str, given: Sequence[Expression]) -> Type:
        if gives == "same":
            bases = {x.type.base for x in given}
            return Type("count" if "count" in bases else given[0].type.base, given[0].type.dims)
        if gives == "truth":
            return Type("bool", given[0].type.dims)
        return self.type_of(node, gives) if gives else NO_VALUE

    def _fits(self, node: ast.Call, argument: Expression, wanted: str, first: Expression) -> bool:
        kind = argument.type
        match wanted:
            case "number":
                return kind.base in ("real", "int", "count") and kind.dims in ((), (LANE,))
            case "same":
                return kind.dims == first.type.dims and bool(self._common(node, first, argument))
            case "rows":
                return len(kind.dims) == 2 and kind.dims[1] == LANE
            case "array":
                return bool(kind.dims) and kind.dims[0] in SIZES
        return agrees(argument, self.type_of(node, wanted))

    def _own(
        self,
        node: ast.Call,
        function: Function,
        given: tuple[Expression, ...],
        lanes: Expression | None,
    ) -> Call:
        if len(given) != len(function.parameters):
            wanted = len(function.parameters)
            raise refused(node, f"{function.name} takes {wanted} arguments, {len(given)} are given")
        for argument, parameter in zip(given, function.parameters, strict=True):
            # of one lane, the one value may be a number
            one = Constant(1, INT) == lanes and parameter.type == LANES_OF_REALS
            if not agrees(argument, REAL if one else parameter.type):
                raise refused(node, f"{function.name} takes as {parameter.name} {parameter.type}")
            if parameter.name in function.changes:
                self.change(argument)
        self._check_lanes(node, function.name, function.is_lanewise, lanes)
        return Call(function.name, given, function.result, lanes)

    def _check_lanes(
        self, node: ast.Call, name: str, is_lanewise: bool, lanes: Expression | None
    ) -> None:
        """Refuse a call that does not say how many lanes, or says it where it is known."""
        if (lanes is not None) != (is_lanewise and not self.own.is_lanewise):
            word = "without" if lanes is not None else "with"
            raise refused(node, f"{name} is called {word} lanes here")


def is_constant(node: Expression) -> bool:
    """Whether a whole number has one value, such as a size or an arithmetic of them."""
    if isinstance(node, Binary):
        return is_constant(node.left) and is_constant(node.right)
    if isinstance(node, Choice):
        return is_constant(node.then) and is_constant(node.otherwise)
    return isinstance(node, Constant)


def agrees(value: Expression, wanted: Type) -> bool:
    """Whether a value may be given where a type is wanted; a whole constant may be a count."""
    return value.type == wanted or (wanted == COUNT and value.type == INT and is_constant(value))

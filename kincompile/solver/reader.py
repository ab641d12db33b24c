"""Reads the text of the solver into nodes, and refuses what the language does not have.

The text is Python, read by `ast`: structs are classes of annotated fields, functions have annotated
parameters. A refusal names its line.
"""

from __future__ import annotations

import ast
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from kincompile.solver.expressions import ARITHMETIC, Expressions, agrees, refused
from kincompile.solver.nodes import (
    COUNT,
    INT,
    NO_VALUE,
    Assign,
    Break,
    Call,
    Comment,
    Constant,
    Declare,
    Do,
    Field,
    For,
    Function,
    If,
    Index,
    Name,
    Return,
    Struct,
    Text,
    Type,
    Variable,
    While,
)  # fmt: skip
from kincompile.solver.vocabulary import ABREAST, CHOICES, CONSTANTS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence
    from importlib.resources.abc import Traversable

    from kincompile.solver.nodes import Expression, Statement


MARCH, START, SETS = ("step", "walk", "march"), ("attempt", "start"), "sets"
"""The modules of a text; each builds on the ones before."""


@cache
def solver(*chosen: str) -> Text:
    """Return the march, read once: as choices of `vocabulary.CHOICES` that hold make it."""
    text = Text({}, {})
    for name in MARCH:
        text = read(source_of(name), text, chosen)
    return text


@cache
def start() -> Text:
    """Return the start, read once."""
    text = Text({"Point": read(source_of(MARCH[0])).structs["Point"]}, {})
    for name in START:
        text = read(source_of(name), text)
    return text


@cache
def solver_of_sets() -> Text:
    """Return the plain march with what many parameter sets need, read once."""
    return read(source_of(SETS), solver(ABREAST))


@cache
def one_point() -> Text:
    """Return what of the march takes one point at a time, read once."""
    text = Text({}, {})
    for name in ("step", "walk", "one"):
        text = read(source_of(name), text)
    return text


@cache
def transmission() -> Text:
    """Return the text of a transmission, read once."""
    return read(source_of("transmission"))


def place_of(name: str) -> Traversable:
    """Return where a module of a text is."""
    return files("kincompile.solver") / f"{name}.py"


def source_of(name: str) -> str:
    """Return the source of a module of a text."""
    return place_of(name).read_text(encoding="utf-8")


def read(source: str, known: Text | None = None, chosen: Collection[str] = ()) -> Text:
    """Return the structs and functions of a source; a `Refused` names what is not in it.

    Those of an earlier text may be used.
    """
    text = Text({**known.structs}, {**known.functions}) if known else Text({}, {})
    tree, left_out = branches(source, chosen)
    comments = Comments(source, left_out)
    for item in tree.body:
        match item:
            case ast.ClassDef(name=name):
                text.structs[name] = _struct(item, text, comments)
            case ast.FunctionDef(name=name):
                text.functions[name] = _function(item, text, comments)
            case ast.ImportFrom() | ast.Expr(value=ast.Constant()):
                pass  # what the words mean in Python; the docstring
            case _:
                raise refused(item, "a text has structs and functions, nothing else")
    return text


def branches(source: str, chosen: Collection[str]) -> tuple[ast.Module, set[int]]:
    """Return a text for the choices that hold, and the lines that are left out."""
    choice = _Branches(source, chosen)
    return choice.visit(ast.parse(source)), choice.left_out


class _Branches(ast.NodeTransformer):
    """Puts in place of an `if` of a choice what is meant, and notes the lines of the rest."""

    def __init__(self, source: str, chosen: Collection[str]) -> None:
        self.chosen = chosen
        self.left_out: set[int] = set()
        lines = enumerate(source.splitlines(), 1)
        self.asked = [k for k, line in lines if any(x in line for x in CHOICES)]

    def visit(self, node: ast.AST) -> Any:
        """Return a node; one that asks nothing as it is, which saves half of the reading."""
        first, last = getattr(node, "lineno", 1), getattr(node, "end_lineno", None)
        if last is not None and not any(first <= k <= last for k in self.asked):
            return node
        return super().visit(node)

    def visit_If(self, node: ast.If) -> Any:
        """Return a branch, or its chosen statements."""
        self.generic_visit(node)
        if ast.unparse(node.test) not in CHOICES:
            return node
        end = node.body[-1].end_lineno or node.lineno
        if ast.unparse(node.test) in self.chosen:
            self.left_out |= set(range(end + 1, (node.end_lineno or end) + 1))
            return node.body
        self.left_out |= set(range(node.lineno, end + 1))
        return node.orelse

    def visit_IfExp(self, node: ast.IfExp) -> Any:
        """Return a choice, or the value that is meant."""
        self.generic_visit(node)
        if ast.unparse(node.test) not in CHOICES:
            return node
        return node.body if ast.unparse(node.test) in self.chosen else node.orelse


class Comments:
    """The comments of a source, by their lines, without those that are left out."""

    def __init__(self, source: str, left_out: Collection[int]) -> None:
        # A text has no strings but docstrings: a tokenizer takes longer than all the reading.
        parts = [line.partition("# ") for line in source.splitlines()]
        found = {k: x for k, x in enumerate(parts, start=1) if x[1] and k not in left_out}
        self.notes = {k: note.strip() for k, (_, _, note) in found.items()}
        self.alone = {k for k, (before, _, _) in found.items() if not before.strip()}

    def between(self, first: int, last: int) -> Iterator[Comment]:
        """Yield the comment on lines of its own from a line to before another."""
        lines = tuple(self.notes[k] for k in range(first, last) if k in self.alone)
        if lines:
            yield Comment(lines)


def _struct(item: ast.ClassDef, text: Text, comments: Comments) -> Struct:
    """Return a struct."""
    if [ast.unparse(x) for x in item.bases] != ["Struct"] or item.decorator_list:
        raise refused(item, f"{item.name} is not a Struct")
    about = ast.get_docstring(item)
    if not about:
        raise refused(item, f"{item.name} does not say what it is")
    types = Expressions(text.structs, {}, Function(item.name, "", (), NO_VALUE, is_lanewise=False))
    fields, notes = {}, {}
    for row in item.body[1:]:
        if not (isinstance(row, ast.AnnAssign) and isinstance(row.target, ast.Name)) or row.value:
            raise refused(row, "a struct has annotated fields, nothing else")
        fields[row.target.id] = types.type_of(row, ast.unparse(row.annotation))
        notes[row.target.id] = comments.notes.get(row.lineno, "")
    return Struct(item.name, about, fields, notes)


def _function(item: ast.FunctionDef, text: Text, comments: Comments) -> Function:
    """Return a function."""
    names = [ast.unparse(x) for x in item.decorator_list]
    if names not in ([], ["lanewise"]):
        raise refused(item, f"{item.name} is decorated by something else than lanewise")
    about = ast.get_docstring(item)
    if not about:
        raise refused(item, f"{item.name} does not say what it does")
    given = item.args
    if given.defaults or given.vararg or given.kwarg or given.kwonlyargs or given.posonlyargs:
        raise refused(item, f"{item.name} has parameters that are not plain")
    function = Function(item.name, about, (), NO_VALUE, is_lanewise=bool(names))
    types = Expressions(text.structs, text.functions, function)
    parameters = []
    for argument in given.args:
        if argument.annotation is None:
            raise refused(argument, f"{argument.arg} has no type")
        kind = types.type_of(argument, ast.unparse(argument.annotation))
        parameters.append(Variable(argument.arg, kind, is_parameter=True))
    function.parameters = tuple(parameters)
    if item.returns is not None:
        function.result = types.type_of(item, ast.unparse(item.returns))
    reader = _Statements(Expressions(text.structs, text.functions, function), comments)
    function.body = reader.block(item.body[1:], item.body[0].end_lineno or 0)
    if function.result != NO_VALUE and not isinstance(function.body[-1], Return):
        raise refused(item.body[-1], f"{item.name} ends without a result")
    return function


class _Statements:
    """Reads the statements of one function."""

    def __init__(self, expressions: Expressions, comments: Comments) -> None:
        self.of, self.comments = expressions, comments

    def block(self, statements: Sequence[ast.stmt], line: int) -> tuple[Statement, ...]:
        """Return statements that have a scope; the comments begin after a line."""
        self.of.scopes.append({})
        found: list[Statement] = []
        for item in statements:
            found += self.comments.between(line + 1, item.lineno)
            found.append(self.statement(item))
            line = item.end_lineno or item.lineno
        self.of.scopes.pop()
        return tuple(found)

    def declare(self, node: ast.stmt, name: str, kind: Type) -> Variable:
        """Return a new variable of the innermost scope."""
        if name in CONSTANTS or name in self.of.functions or name in self.of.structs:
            raise refused(node, f"{name} is the name of something else")
        if kind.base in ("int", "bool", "count", "real") and len(kind.dims) > 2:
            raise refused(node, f"{name} would be an array without a size")
        self.of.scopes[-1][name] = variable = Variable(name, kind)
        return variable

    def statement(self, item: ast.stmt) -> Statement:
        """Return a statement."""
        match item:
            case ast.AnnAssign(
                target=ast.Name(id=name), annotation=kind, value=ast.expr() as value
            ):
                return self.declared(item, name, ast.unparse(kind), value)
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                return self.set(item, name, value)
            case ast.Assign(targets=[target], value=value):
                return self.assign(item, self.of.read(target), "", self.of.read(value))
            case ast.AugAssign(target=target, op=sign, value=value) if type(sign) in ARITHMETIC:
                sign_text = ARITHMETIC[type(sign)]
                return self.assign(item, self.of.read(target), sign_text, self.of.read(value))
            case ast.For(target=ast.Name(id=name), orelse=[]):
                return self.loop(item, name)
            case ast.While(test=test, body=body, orelse=[]):
                return While(self.of.single(test, "bool"), self.block(body, item.lineno))
            case ast.If(test=test, body=body, orelse=otherwise):
                end = body[-1].end_lineno or item.lineno
                condition = self.of.single(test, "bool")
                return If(condition, self.block(body, item.lineno), self.block(otherwise, end))
            case ast.Break():
                return Break()
            case ast.Return(value=ast.expr() as value):
                return self.result(item, self.of.read(value))
            case ast.Expr(value=ast.Call() as call):
                found = self.of.read(call)
                if isinstance(found, Call) and found.type == NO_VALUE:
                    return Do(found)
                raise refused(item, f"what {ast.unparse(call.func)} gives is not used")
        raise refused(item, f"{type(item).__name__} is no statement of the language")

    def declared(self, item: ast.stmt, name: str, kind: str, value: ast.expr) -> Statement:
        """Return a declaration with its type; a lane may begin with one value for all."""
        if self.of.lookup(name):
            raise refused(item, f"{name} has a type already")
        wanted, found = self.of.type_of(item, kind), self.of.read(value)
        first = Type(wanted.base) if wanted.is_lane and not found.type.dims else wanted
        if not agrees(found, first):
            raise refused(item, f"{found.type}, where {wanted} is")
        return Declare(self.declare(item, name, wanted), found)

    def set(self, item: ast.stmt, name: str, value: ast.expr) -> Statement:
        """Return an assignment to a name: a declaration, where the name is new."""
        found, variable = self.of.read(value), self.of.lookup(name)
        if variable is not None:
            return self.assign(item, Name(variable), "", found)
        if found.type.dims and isinstance(found, Name | Field | Index):
            raise refused(item, f"{name} would be another name of an array; say copied")
        return Declare(self.declare(item, name, found.type), found)

    def assign(
        self, item: ast.stmt, target: Expression, operation: str, value: Expression
    ) -> Statement:
        """Return an assignment to an existing variable."""
        into, kind = target.type, value.type
        if isinstance(target, Name):
            is_counted = target.variable.below is not None
            if is_counted or target.variable.is_parameter or into.base in self.of.structs:
                raise refused(item, f"{target.variable.name} stays what it is")
            target.variable.is_mutable = True
        elif not isinstance(target, Field | Index):
            raise refused(item, "only variables, fields and entries are assigned to")
        if isinstance(target, Field) and not into.dims and self.of.own.is_lanewise:
            raise refused(item, f"{target.name} is one value for all lanes; set it elsewhere")
        counts = operation == "+" and into.base == "int" and kind.base == "bool"
        if kind.dims and kind.dims != into.dims:
            raise refused(item, f"{kind}, where {into} is")
        if not (counts or agrees(value, Type(into.base, kind.dims))):
            raise refused(item, f"{kind}, where {into} is")
        if len(into.dims) == 2 and not kind.dims and value != Constant(0.0, value.type):
            raise refused(item, "rows are set from rows, or to 0.0")
        self.of.change(target)
        return Assign(target, operation, value)

    def loop(self, item: ast.For, name: str) -> Statement:
        """Return a loop: over ``range(...)``, or over ``lanes(count)``."""
        match item.iter:
            case ast.Call(func=ast.Name(id="range" | "lanes" as kind), args=limits, keywords=[]):
                stops = [self.of.single(x, "count") for x in limits]
            case _:
                raise refused(item, "a loop goes over range or lanes")
        if kind == "lanes" and (self.of.own.is_lanewise or len(stops) > 1):
            raise refused(item, "lanes are looped over by who is not lanewise, from the first on")
        self.of.scopes.append({})
        base = "count" if any(x.type == COUNT for x in stops) or kind == "lanes" else "int"
        variable = self.declare(item, name, Type(base))
        last = stops[min(1, len(stops) - 1)]
        variable.below = str(last.value) if isinstance(last, Constant) else ""
        body = self.block(item.body, item.lineno)
        self.of.scopes.pop()
        start, stop = (stops if len(stops) > 1 else [Constant(0, INT), *stops])[:2]
        step = stops[2] if len(stops) > 2 else Constant(1, INT)
        return For(variable, start, stop, step, body, kind == "lanes")

    def result(self, item: ast.stmt, value: Expression) -> Statement:
        """Return the end of a function."""
        wanted = self.of.own.result
        if not agrees(value, wanted):
            raise refused(item, f"{self.of.own.name} gives {wanted.base}")
        return Return(value)

"""Text as people write formulas, read into SymPy through a whitelist; nothing in it is executed.

Python's own grammar does the reading (`ast.parse`, which builds a tree and runs nothing); every
node of the tree is then rebuilt by hand, and a node that is not on the list is an error with
its position, the alternatives and the names that exist. `eval`, `exec`, `sympify` and
`parse_expr` are not used on a text: each of them runs code in the text.
"""

from __future__ import annotations

import ast
import math
import warnings
from bisect import bisect_right
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.files.text_places import TextPlace, TextPlaces
from kincompile.model.directions import angle_between, length_of, turning
from kincompile.model.expressions import NotAnExpressionError, as_expression, deg, evaluate
from kincompile.model.laws import RISES
from kincompile.model.points import rate
from kincompile.names import listed, suggestion

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

MAX_LENGTH = 20_000
"""Characters in one expression."""
MAX_NODES = 2_000
"""Numbers, names and operations in one expression."""
MAX_DEPTH = 60
"""Levels of nesting; a sum or product of many terms is one level."""
MAX_EXPANDED = 20_000
"""Parts of one expression, each name counted with all that it stands for."""
MAX_EXPANDED_DEPTH = 120
"""Levels of one expression, each name counted with all that it stands for."""
MAX_EXPONENT = 64
"""Largest exponent."""
MAX_BITS = 1024
"""Bits of a whole number or fraction: as large as a double can be."""

FUNCTIONS: Mapping[str, tuple[Callable[..., sympy.Expr], int, int]] = {
    **{
        name: (getattr(sympy, name), 1, 1)
        for name in (
            "sin", "cos", "tan", "cot", "sec", "csc", "asin", "acos", "atan", "sinh", "cosh",
            "tanh", "asinh", "acosh", "atanh", "exp", "log", "sqrt",
        )
    },
    "atan2": (sympy.atan2, 2, 2), "ln": (sympy.log, 1, 1),
    "arcsin": (sympy.asin, 1, 1), "arccos": (sympy.acos, 1, 1), "arctan": (sympy.atan, 1, 1),
    "arctan2": (sympy.atan2, 2, 2), "rate": (rate, 1, 1),
    **{law.__name__: (law, *law.nargs.args[:1] * 2) for law in RISES.values()},
    "length_of": (length_of, 2, 3), "turning": (turning, 4, 4),
    "angle_between": (angle_between, 4, 4),
}  # fmt: skip
"""Functions that may be called, each with the least and the largest number of arguments."""

CONSTANTS: Mapping[str, sympy.Expr] = {"pi": sympy.pi, "deg": deg}

_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)
_RELATIONS: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: sympy.Lt, ast.LtE: sympy.Le, ast.Gt: sympy.Gt, ast.GtE: sympy.Ge,
}  # fmt: skip
_LOOKALIKES = {
    "\u2212": "-", "\u2013": "-", "\u00b7": "*", "\u00d7": "*", "\u00f7": "/", "\u00b2": "^2",
    "\u00b3": "^3", "\u03c0": "pi", "'": "a name such as phi_dot for a rate",
}  # fmt: skip
_PUNCTUATION = frozenset("_.,+-*/^()[]<>= \t\r\n")
_EXPECTED = "numbers, names, + - * / ^ ( ) and functions"


class ExpressionError(NotAnExpressionError):
    """A text that is not an expression.

    Attributes
    ----------
    problem
        What is wrong, what was expected, and the names that exist.
    line, column
        Where, counted from 1.
    """

    def __init__(self, problem: str, line: int, column: int) -> None:
        super().__init__(f"line {line}, column {column}: {problem}")
        self.problem = problem
        self.line = line
        self.column = column


class UnknownNameError(ExpressionError):
    """A name that is not among those that may stand in an expression; `name` is it."""

    def __init__(self, error: ExpressionError, name: str) -> None:
        super().__init__(error.problem, error.line, error.column)
        self.name = name


def parse_expression(
    text: str,
    names: Mapping[str, sympy.Expr],
    place: TextPlace | None = None,
    refused: Mapping[str, str] | None = None,
) -> sympy.Expr:
    """Read one expression.

    Parameters
    ----------
    text
        For instance ``0.25*cos(phi3)^2 - pi/2`` or ``Piecewise((x, x < 1), (1, True))``; ``^`` and
        ``**`` are both powers.
    names
        What each name stands for.
    refused
        Names that exist and are not allowed here, each with the reason.

    Returns
    -------
    sympy.Expr
        Real and finite as far as it is a number; whole numbers and their quotients are exact.

    Raises
    ------
    ExpressionError
        If the text holds anything but numbers, declared names, arithmetic and the functions of
        `FUNCTIONS`, or is longer or deeper than the limits of this module.
    """
    source = _Source(text, place or TextPlace())
    if len(text) > MAX_LENGTH:
        raise source.error(
            f"the expression has {len(text)} characters; at most {MAX_LENGTH} are read", 0
        )
    if not text.strip():
        raise source.error(f"the expression is empty; expected {_EXPECTED}", 0)
    source.check_characters()
    source.check_brackets()
    try:
        value = _Reader(source, names, refused or {}).read(source.tree())
        if not all(_fits(number) for number in value.atoms(sympy.Number)):
            raise source.error("a number in this expression is too large for floating point", 0)
        return sympy.sympify(as_expression(value), strict=True)
    except ExpressionError:
        raise
    except NotAnExpressionError as error:
        raise source.error(str(error), 0) from error
    except RecursionError:
        raise source.error("the expression is nested too deeply", 0) from None


@lru_cache(maxsize=10_000)
def extent(value: sympy.Basic) -> tuple[int, int]:
    """Return the parts of an expression, those that it shares counted each time, and its levels.

    The effort is that of the shared form, in which each part is there once.
    """
    inner = [extent(item) for item in value.args]
    return 1 + sum(parts for parts, _ in inner), 1 + max((deep for _, deep in inner), default=0)


class _Source:
    """The text as written, as Python reads it, and the way from one to the other."""

    def __init__(self, text: str, place: TextPlace) -> None:
        self.text = text
        self._place = place
        # One line between brackets: line breaks mean nothing inside a formula. `^` is Python's
        # exclusive or, which binds weaker than +, so it becomes `**` before the grammar sees it.
        self._python = "(" + "".join(" " if ch.isspace() else ch for ch in text) + ")"
        self._carets = [k + 1 for k, ch in enumerate(text) if ch == "^"]
        self._python = self._python.replace("^", "**")
        self._moved = [k + number for number, k in enumerate(self._carets)]

    def tree(self) -> ast.expr:
        """Return the syntax tree of the text."""
        try:
            with warnings.catch_warnings():
                # Python warns of "1if" and the like; here it is not a formula.
                warnings.simplefilter("error")
                return ast.parse(self._python, mode="eval").body
        except SyntaxError as error:
            raise self._syntax_error(error) from None
        except (RecursionError, MemoryError):
            raise self.error("the expression is nested too deeply", 0) from None
        except (ValueError, Warning) as error:
            raise self.error(f"this is not an expression: {error}", 0) from None

    def offset(self, column: int) -> int:
        """Return the place in the text of a column of what Python read."""
        return min(max(column - 1 - bisect_right(self._moved, column - 1), 0), len(self.text))

    def check_characters(self) -> None:
        """Refuse what no formula needs, before Python gives it a meaning."""
        for k, character in enumerate(self.text):
            if character in _PUNCTUATION or (character.isascii() and character.isalnum()):
                continue
            hint = _LOOKALIKES.get(character)
            remedy = f"write {hint}" if hint else f"expected {_EXPECTED}"
            raise self.error(f"the character {character!r} is not understood; {remedy}", k)

    def check_brackets(self) -> None:
        """Refuse a bracket without a partner."""
        bracket = unbalanced_bracket(self.text)
        if bracket is not None:
            raise self.error(*bracket)

    def error(self, problem: str, offset: int) -> ExpressionError:
        """Return an error at a place in the text."""
        place = TextPlaces(self.text, self._place)[offset]
        return ExpressionError(problem, place.line, place.column)

    def node_error(self, problem: str, node: ast.AST) -> ExpressionError:
        """Return an error at a node."""
        return self.error(problem, self.offset(getattr(node, "col_offset", 0)))

    def _syntax_error(self, error: SyntaxError) -> ExpressionError:
        offset = len(self.text)
        if error.lineno == 1 and error.offset:
            offset = self.offset(error.offset - 1)
        found = self.text[offset : offset + 12].split("\n")[0].strip()
        what = f"found {found!r}" if found else "the expression ends too early"
        return self.error(
            f"{what}, where an operator, a bracket or a value was expected; write a product as 2*x "
            f"and a power as x^2",
            offset,
        )


def unbalanced_bracket(text: str) -> tuple[str, int] | None:
    """Return a message about an unbalanced bracket and its offset, or None."""
    pairs = {")": "(", "]": "[", "}": "{"}
    open_brackets: list[tuple[str, int]] = []
    for k, character in enumerate(text):
        if character in pairs.values():
            open_brackets.append((character, k))
        elif character in pairs:
            if not open_brackets:
                return f"this {character!r} closes a bracket that was never opened", k
            opened, _ = open_brackets.pop()
            if opened != pairs[character]:
                return f"{character!r} closes a bracket that was opened with {opened!r}", k
    if open_brackets:
        opened, k = open_brackets[-1]
        return f"this {opened!r} is never closed", k
    return None


class _Reader:
    """Rebuilds a syntax tree in SymPy, node by node."""

    def __init__(
        self, source: _Source, names: Mapping[str, sympy.Expr], refused: Mapping[str, str]
    ) -> None:
        self._source = source
        self._names = names
        self._refused = refused
        self._nodes = 0
        self._expanded = 0

    def read(self, node: ast.expr, depth: int = 0) -> sympy.Expr:
        """Return the value of a node."""
        self._count(node, depth)
        match node:
            case ast.Constant():
                value = self._number(node)
            case ast.Name():
                return self._name(node, depth)
            case ast.UnaryOp(op=ast.UAdd() | ast.USub()):
                operand = self.read(node.operand, depth + 1)
                return operand if isinstance(node.op, ast.UAdd) else -operand
            case ast.BinOp():
                return self._chain(node, depth)
            case ast.Call():
                value = self._call(node, depth)
            case ast.Compare() | ast.BoolOp():
                raise self._error("a comparison stands in Piecewise((value, condition), ...)", node)
            case _:
                what = _DESCRIPTIONS.get(type(node), "this")
                problem = f"{what} is not allowed here; expected {_EXPECTED}"
                raise self._error(f"{problem}: {listed(FUNCTIONS, 40)}", node)
        return self._checked(value, node)

    def _error(self, problem: str, node: ast.AST) -> ExpressionError:
        return self._source.node_error(problem, node)

    def _count(self, node: ast.AST, depth: int) -> None:
        self._nodes += 1
        if self._nodes > MAX_NODES:
            raise self._error(f"the expression has more than {MAX_NODES} parts", node)
        if depth > MAX_DEPTH:
            raise self._error(f"the expression is nested more than {MAX_DEPTH} levels deep", node)

    def _expand(self, value: sympy.Expr, node: ast.Name, depth: int) -> None:
        """Count what a name stands for, which may hold names itself and double with each."""
        parts, levels = extent(value)
        self._expanded += parts
        if self._expanded > MAX_EXPANDED:
            raise self._error(
                f"with {node.id} written out, the expression has more than {MAX_EXPANDED:,} parts",
                node,
            )
        if depth + levels > MAX_EXPANDED_DEPTH:
            raise self._error(
                f"with {node.id} written out, the expression is nested more than "
                f"{MAX_EXPANDED_DEPTH} levels deep",
                node,
            )

    def _number(self, node: ast.Constant) -> sympy.Expr:
        value = node.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self._error(f"{value!r} is not a real number; expected {_EXPECTED}", node)
        if isinstance(value, float) and not math.isfinite(value):
            raise self._error("this number is too large for floating point", node)
        return sympy.Integer(value) if isinstance(value, int) else sympy.Float(value)

    def _name(self, node: ast.Name, depth: int) -> sympy.Expr:
        name = node.id
        if name in self._names:
            self._expand(self._names[name], node, depth)
            return self._names[name]
        if name in self._refused:
            raise self._error(f"{name!r} cannot stand here: {self._refused[name]}", node)
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name in FUNCTIONS:
            raise self._error(f"{name} is a function; write {name}(...)", node)
        hint = suggestion(name, self._names)
        problem = f"there is no {name!r}{hint}; the names are: {listed(self._names, 60)}"
        raise UnknownNameError(self._error(problem, node), name)

    def _chain(self, node: ast.BinOp, depth: int) -> sympy.Expr:
        """Read a chain such as a + b - c, which Python nests to the left, as one level."""
        links: list[ast.BinOp] = []
        first: ast.expr = node
        while isinstance(first, ast.BinOp):
            if not isinstance(first.op, _OPERATORS):
                raise self._error(f"only + - * / ^ are operators; expected {_EXPECTED}", first)
            links.append(first)
            first = first.left
        # One sum of all the terms, one product of all the factors: SymPy would sort a growing sum
        # again for each term, and multiply a number into a sum that has another factor to come.
        terms: list[sympy.Expr] = []
        factors = self._factors(first, depth)
        for link in reversed(links):
            self._count(link, depth)
            if isinstance(link.op, ast.Add | ast.Sub):
                terms.append(self._checked(sympy.Mul(*factors), link))
                factors = self._factors(link.right, depth)
                if isinstance(link.op, ast.Sub):
                    factors.insert(0, sympy.S.NegativeOne)
                continue
            if terms:  # the sum so far stands in brackets
                total = sympy.Add(*terms, sympy.Mul(*factors))
                terms, factors = [], [self._checked(total, link)]
            factors = self._extended(factors, link, self.read(link.right, depth + 1))
        return self._checked(sympy.Add(*terms, sympy.Mul(*factors)), node)

    def _factors(self, node: ast.expr, depth: int) -> list[sympy.Expr]:
        """Return a value as a list of factors, the sign before it as a factor of its own."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            self._count(node, depth)
            return [sympy.S.NegativeOne, self.read(node.operand, depth + 2)]
        return [self.read(node, depth + 1)]

    def _extended(
        self, factors: list[sympy.Expr], link: ast.BinOp, right: sympy.Expr
    ) -> list[sympy.Expr]:
        """Return factors multiplied or divided by a value, or raised to its power."""
        if isinstance(link.op, ast.Mult):
            return [*factors, right]
        if isinstance(link.op, ast.Div):
            if right.is_zero:
                raise self._error("this divides by zero", link.right)
            return [*factors, sympy.Pow(right, -1)]
        self._check_exponent(right, link.right)
        return [sympy.Pow(sympy.Mul(*factors), right)]

    def _check_exponent(self, exponent: sympy.Expr, node: ast.expr) -> None:
        if not exponent.is_number:
            return
        # Evaluated: of an exact number such as sin(1)^2 + cos(1)^2 SymPy may not know the size.
        size = evaluate(exponent, {})
        if size is None or abs(size) > MAX_EXPONENT:
            raise self._error(f"the exponent is beyond {MAX_EXPONENT}, or not a number", node)

    def _checked(self, value: sympy.Expr, node: ast.AST) -> sympy.Expr:
        """Refuse a number that no double can hold: the next operation on it could be endless."""
        if value in (sympy.zoo, sympy.nan, sympy.oo, -sympy.oo):
            raise self._error(
                "this is not finite: a division by zero, or the logarithm of zero", node
            )
        if isinstance(value, sympy.Number) and not _fits(value):
            raise self._error("this number is too large for floating point", node)
        if value.is_number and value.is_real is False:
            raise self._error("this is not real: the root of a negative number", node)
        return value

    def _call(self, node: ast.Call, depth: int) -> sympy.Expr:
        if not isinstance(node.func, ast.Name):
            raise self._error("a bracket after a value calls nothing; write * for a product", node)
        name = node.func.id
        if name == "Piecewise":
            return self._piecewise(node, depth)
        if name not in FUNCTIONS:
            remedy = "write * for a product" if name in self._names or name in CONSTANTS else ""
            remedy = remedy or f"the functions are: {listed(FUNCTIONS, 40)}, Piecewise"
            raise self._error(
                f"{name!r} is not a function{suggestion(name, FUNCTIONS)}; {remedy}", node
            )
        function, least, most = FUNCTIONS[name]
        if node.keywords or not least <= len(node.args) <= most:
            given = len(node.args) + len(node.keywords)
            counts = f"{least}" if least == most else f"{least} or {most}"
            wanted = f"{counts} argument{'s' if most > 1 else ''}"
            raise self._error(f"{name} takes {wanted}, not {given}", node)
        return function(*(self.read(item, depth + 1) for item in node.args))

    def _piecewise(self, node: ast.Call, depth: int) -> sympy.Expr:
        form = "write Piecewise((value, condition), ..., (value, True))"
        if node.keywords or not node.args:
            raise self._error(form, node)
        pieces = []
        for item in node.args:
            if not isinstance(item, ast.Tuple) or len(item.elts) != 2:
                raise self._error(form, item)
            value, condition = item.elts
            pieces.append((self.read(value, depth + 1), self._condition(condition, depth + 1)))
        if sympy.Or(*(condition for _, condition in pieces)) != sympy.true:
            raise self._error(f"the last piece must hold everywhere else; {form}", node)
        return sympy.Piecewise(*pieces)

    def _condition(self, node: ast.expr, depth: int) -> Any:
        self._count(node, depth)
        match node:
            case ast.Constant(value=True):
                return sympy.true
            case ast.BoolOp():
                connective = sympy.And if isinstance(node.op, ast.And) else sympy.Or
                return connective(*(self._condition(item, depth + 1) for item in node.values))
            case ast.Compare() if all(type(op) in _RELATIONS for op in node.ops):
                values = [self.read(item, depth + 1) for item in (node.left, *node.comparators)]
                pairs = zip(node.ops, values, values[1:], strict=False)
                return sympy.And(*(_RELATIONS[type(op)](a, b) for op, a, b in pairs))
        raise self._error(
            "a condition is a comparison with < <= > >=, joined by and, or; or True", node
        )


def _fits(value: sympy.Number) -> bool:
    if isinstance(value, sympy.Rational):
        return max(abs(int(value.p)), int(value.q)).bit_length() <= MAX_BITS
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


_DESCRIPTIONS: Mapping[type[ast.AST], str] = {
    ast.Attribute: "an attribute (a.b)", ast.Subscript: "an index (a[b])", ast.List: "a list",
    ast.Tuple: "a comma", ast.Lambda: "a function definition", ast.IfExp: "if", ast.Starred: "*",
    ast.ListComp: "a loop", ast.GeneratorExp: "a loop", ast.UnaryOp: "this operator",
}  # fmt: skip

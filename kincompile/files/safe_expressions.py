"""Text as people write formulas, read into SymPy through a whitelist; nothing in it is executed.

Python's own grammar does the reading (`ast.parse`, which builds a tree and runs nothing); every
node of the tree is then rebuilt by hand, and a node that is not on the list is an error with
its position, the alternatives and the names that exist. `eval`, `exec`, `sympify` and
`parse_expr` are not used on a text: each of them runs code in the text.
"""

from __future__ import annotations

import ast
import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.files.formula_text import EXPECTED, ExpressionError, Source
from kincompile.files.text_places import TextPlace
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
"""Largest exponent; powers of powers count with the product of their exponents."""
MAX_BITS = 1024
"""Bits of a whole number or fraction: as large as a double can be."""
MAX_DENOMINATORS = 16 * MAX_BITS
"""Bits of the denominators of all terms: a sum of fractions takes time with the square of them."""
MAX_PIECES_IN_CONDITIONS = 6
"""Pieces of each Piecewise in a condition: a comparison is made for each combination of them."""

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
    source = Source(text, place or TextPlace(), names)
    if len(text) > MAX_LENGTH:
        raise source.error(
            f"the expression has {len(text)} characters; at most {MAX_LENGTH} are read", 0
        )
    if not text.strip():
        raise source.error(f"the expression is empty; expected {EXPECTED}", 0)
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
    except (ArithmeticError, NotImplementedError, TypeError, ValueError) as error:
        # SymPy's own: for one, it takes a large factor for a prime and fails when it is not.
        raise source.error(
            "SymPy cannot evaluate this expression; write large numbers as decimals", 0
        ) from error


@lru_cache(maxsize=10_000)
def extent(value: sympy.Basic) -> tuple[int, int]:
    """Return the parts of an expression, those that it shares counted each time, and its levels.

    The effort is that of the shared form, in which each part is there once.
    """
    inner = [extent(item) for item in value.args]
    return 1 + sum(parts for parts, _ in inner), 1 + max((deep for _, deep in inner), default=0)


@lru_cache(maxsize=10_000)
def _pieces(value: sympy.Basic) -> int:
    """Return how many pieces an expression has, those that it shares counted each time."""
    own = len(value.args) if isinstance(value, sympy.Piecewise) else 0
    return own + sum(map(_pieces, value.args))


class _Reader:
    """Rebuilds a syntax tree in SymPy, node by node."""

    def __init__(
        self, source: Source, names: Mapping[str, sympy.Expr], refused: Mapping[str, str]
    ) -> None:
        self._source = source
        self._names = names
        self._refused = refused
        self._nodes = 0
        self._expanded = 0
        self._denominators = 0.0
        self._pieces_in_conditions = 0

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
                problem = f"{what} is not allowed here; expected {EXPECTED}"
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
        what = f"with {self._source.name(node)} written out, the expression"
        self._expanded += parts
        if self._expanded > MAX_EXPANDED:
            raise self._error(f"{what} has more than {MAX_EXPANDED:,} parts", node)
        if depth + levels > MAX_EXPANDED_DEPTH:
            raise self._error(f"{what} is nested more than {MAX_EXPANDED_DEPTH} levels deep", node)

    def _number(self, node: ast.Constant) -> sympy.Expr:
        value = node.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self._error(f"{value!r} is not a real number; expected {EXPECTED}", node)
        if isinstance(value, float) and not math.isfinite(value):
            raise self._error("this number is too large for floating point", node)
        return sympy.Integer(value) if isinstance(value, int) else sympy.Float(value)

    def _name(self, node: ast.Name, depth: int) -> sympy.Expr:
        name = self._source.name(node)
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
                raise self._error(f"only + - * / ^ are operators; expected {EXPECTED}", first)
            links.append(first)
            first = first.left
        # One sum of all the terms, one product of all the factors: SymPy would sort a growing sum
        # again for each term, and multiply a number into a sum that has another factor to come.
        terms: list[sympy.Expr] = []
        factors = self._factors(first, depth)
        for link in reversed(links):
            self._count(link, depth)
            if isinstance(link.op, ast.Add | ast.Sub):
                terms.append(self._term(factors, link))
                factors = self._factors(link.right, depth)
                if isinstance(link.op, ast.Sub):
                    factors.insert(0, sympy.S.NegativeOne)
                continue
            if terms:  # the sum so far stands in brackets
                total = sympy.Add(*terms, self._term(factors, link))
                terms, factors = [], [self._checked(total, link)]
            factors = self._extended(factors, link, self.read(link.right, depth + 1))
        return self._checked(sympy.Add(*terms, self._term(factors, node)), node)

    def _term(self, factors: list[sympy.Expr], node: ast.BinOp) -> sympy.Expr:
        """Return the product of factors, which is a term of a sum."""
        value = self._checked(sympy.Mul(*factors), node)
        number = value.as_coeff_Mul()[0]
        if isinstance(number, sympy.Rational):
            self._denominators += math.log2(int(number.q))
        if self._denominators > MAX_DENOMINATORS:
            raise self._error("the fractions have too many digits; write decimals", node)
        return value

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
        base = sympy.Mul(*factors)
        self._check_power(base, right, link)
        return [self._checked(sympy.Pow(base, right), link)]

    def _check_exponent(self, exponent: sympy.Expr, node: ast.expr) -> None:
        if not exponent.is_number:
            return
        # Evaluated: of an exact number such as sin(1)^2 + cos(1)^2 SymPy may not know the size.
        size = evaluate(exponent, {})
        if size is None or abs(size) > MAX_EXPONENT:
            raise self._error(f"the exponent is beyond {MAX_EXPONENT}, or not a number", node)

    def _check_power(self, base: sympy.Expr, exponent: sympy.Expr, node: ast.BinOp) -> None:
        """Refuse a power that would have too many digits, or too large an exponent, unseen."""
        for factor in sympy.Mul.make_args(base):
            inner, own = factor.as_base_exp()
            product = own * exponent
            if not product.is_Rational:
                continue
            if isinstance(inner, sympy.Rational):
                if _bits(inner) * abs(product) > MAX_BITS:
                    raise self._error("this number is too large for floating point", node)
            elif abs(product) > MAX_EXPONENT:
                raise self._error(f"the exponent is beyond {MAX_EXPONENT}", node)

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
        name = self._source.name(node.func)
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

    def _count_pieces(self, compared: list[sympy.Expr], node: ast.expr) -> None:
        """Count the pieces that are compared, before SymPy combines each with each."""
        self._pieces_in_conditions += sum(map(_pieces, compared))
        if self._pieces_in_conditions > MAX_PIECES_IN_CONDITIONS:
            raise self._error(
                f"the values in conditions have more than {MAX_PIECES_IN_CONDITIONS} pieces; "
                "compare values without Piecewise",
                node,
            )

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
                self._count_pieces(values, node)
                pairs = zip(node.ops, values, values[1:], strict=False)
                return sympy.And(*(_RELATIONS[type(op)](a, b) for op, a, b in pairs))
        raise self._error(
            "a condition is a comparison with < <= > >=, joined by and, or; or True", node
        )


def _bits(value: sympy.Rational) -> float:
    """Return how many bits a fraction has, in the longer of its two numbers."""
    return math.log2(max(abs(int(value.p)), int(value.q)))


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

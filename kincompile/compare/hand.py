"""The hand side of a comparison: formulas, arrays or functions, all evaluated in the same way."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.compare.matrix_text import Cell, split_matrix
from kincompile.errors import InputError
from kincompile.files.safe_expressions import (
    CONSTANTS,
    FUNCTIONS,
    ExpressionError,
    Place,
    parse_expression,
)
from kincompile.model.expressions import NotAnExpressionError, as_expression, symbol_names, t
from kincompile.names import listed, name_problem, rate, suggestion

if TYPE_CHECKING:
    from kincompile.compare.reference import Reference
    from kincompile.compare.states import Array, States

Expressions = tuple[tuple[sympy.Expr, ...], ...]

_NO_ACCELERATIONS = "accelerations are the unknowns of Phi_q q_ddot = gamma; no formula holds them"


@dataclass(frozen=True, slots=True)
class Hand:
    """One quantity as its author has it.

    Attributes
    ----------
    texts
        What is written in each entry; empty texts for arrays and functions.
    evaluate
        Gives the values and the sizes of their terms at states, both (N, rows, columns).
    expressions
        The entries in SymPy, or None for arrays and functions.
    takes_parameters
        Whether it may be evaluated at other parameters than the default ones.
    takes_states
        Whether it may be evaluated at any states, not only those its author gave.
    """

    texts: tuple[tuple[str, ...], ...]
    evaluate: Callable[[States], tuple[Array, Array]]
    expressions: Expressions | None = None
    takes_parameters: bool = True
    takes_states: bool = True

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns."""
        return len(self.texts), len(self.texts[0])


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """Names that a formula may use, and names that exist but may not stand in one."""

    names: Mapping[str, sympy.Expr]
    refused: Mapping[str, str]


def vocabulary(reference: Reference, aliases: Mapping[str, Any], where: str = "") -> Vocabulary:
    """Return the names of a system and the author's own.

    A coordinate ``phi3`` has the rate ``phi3_dot``, also ``phi3d``.

    Parameters
    ----------
    reference
        The system.
    aliases
        Further names, each with its expression: a text, a `Cell` or SymPy. An alias may use those
        before it.
    where
        What to write in front of a message: the name of the file.

    Raises
    ------
    InputError
        If an alias is not a name, hides a name of the system, or is not an expression.
    """
    symbols = [*reference.coordinates, *(item.name for item in reference.system.parameters)]
    names: dict[str, sympy.Expr] = {name: sympy.Symbol(name) for name in symbols}
    names["t"] = t
    refused = {}
    for name in reference.coordinates:
        speed = sympy.Symbol(rate(name))
        names[rate(name)] = speed
        names.setdefault(f"{name}d", speed)
        refused[rate(name, 2)] = _NO_ACCELERATIONS
        refused.setdefault(f"{name}dd", _NO_ACCELERATIONS)
    problems = []
    for name, value in aliases.items():
        problem = _alias_problem(name, names)
        try:
            if problem is None:
                names[name] = _alias(value, names, refused)
        except NotAnExpressionError as error:
            problem = str(error)
        if problem is not None:
            problems.append(f"{where}alias {name!r}: {problem}")
    if problems:
        raise InputError(problems)
    refused = {name: reason for name, reason in refused.items() if name not in names}
    return Vocabulary(names, refused)


def _alias_problem(name: str, names: Mapping[str, sympy.Expr]) -> str | None:
    if name in names or name in CONSTANTS or name in FUNCTIONS:
        return "this name has a meaning already; choose another"
    return name_problem(name, "it") if name != "alpha" else None


def _alias(value: Any, names: Mapping[str, sympy.Expr], refused: Mapping[str, str]) -> sympy.Expr:
    if isinstance(value, Cell):
        return parse_expression(value.text, names, value.place, refused)
    if isinstance(value, str):
        return parse_expression(value, names, None, refused)
    return _plain(value)


def _plain(value: Any) -> sympy.Expr:
    """Return a number or SymPy expression in plain symbols, rates of `dynamicsymbols` included."""
    if isinstance(value, sympy.Expr) and value.has(sympy.Derivative):
        rates = {
            item: sympy.Symbol(rate(item.expr.func.__name__))
            for item in value.atoms(sympy.Derivative)
            if item.variables == (t,) and isinstance(item.expr, sympy.Function)
        }
        value = value.xreplace(rates)
    expression: sympy.Expr = sympy.sympify(as_expression(value))
    return expression


def read_hand(
    quantity: str,
    given: Any,
    words: Vocabulary,
    reference: Reference,
    *,
    at_states: bool = False,
    where: str = "",
) -> Hand:
    """Take one quantity in any of the forms a user may give it.

    Parameters
    ----------
    quantity
        Phi, Phi_q, nu or gamma.
    given
        Text, rows of `Cell`, nested lists of numbers, texts and SymPy expressions, a SymPy matrix,
        a NumPy array, or a function ``f(q, t)`` (of gamma: ``f(q, q_dot, t)``), which may also take
        the parameters as a last argument.
    words
        The names that formulas may use.
    reference
        The system that the quantity belongs to.
    at_states
        Whether an array holds values at given states.
    where
        What to write in front of a message.

    Raises
    ------
    InputError
        If it is none of these, is ragged, or holds an unknown name; all problems at once.
    """
    if isinstance(given, np.ndarray) and given.dtype != object:
        return _from_array(quantity, given, at_states)
    if callable(given) and not isinstance(given, sympy.Basic):
        return _from_function(quantity, given, reference)
    rows = _rows(quantity, given, where)
    _check_rectangular(quantity, rows, where)
    problems: list[str] = []
    table = [
        [
            _entry(cell, words, f"{where}{quantity}", f"row {r}, column {c}", problems)
            for c, cell in enumerate(row, 1)
        ]
        for r, row in enumerate(rows, 1)
    ]
    if problems:
        raise InputError(problems)
    if quantity != "Phi_q":
        rows, table = _as_column(rows), _as_column(table)
    texts = tuple(tuple(_written(cell) for cell in row) for row in rows)
    return _from_expressions(texts, tuple(map(tuple, table)), reference)


def _rows(quantity: str, given: Any, where: str) -> list[list[Any]]:
    if isinstance(given, str):
        try:
            given = split_matrix(given, Place())
        except ExpressionError as error:
            raise InputError(f"{where}{quantity}: {error}") from error
    if isinstance(given, sympy.MatrixBase | np.ndarray):
        given = np.asarray(given, dtype=object).tolist()
    if isinstance(given, Sequence) and len(given) > 0:
        return [list(row) if isinstance(row, Sequence) and not isinstance(row, str) else [row]
                for row in given]  # fmt: skip
    if isinstance(given, sympy.Expr | int | float):
        return [[given]]
    raise InputError(
        f"{where}{quantity} is {type(given).__name__}; expected text, rows of expressions, a SymPy "
        "matrix, an array or a function."
    )


def _check_rectangular(quantity: str, rows: list[list[Any]], where: str) -> None:
    width = len(rows[0])
    problems = [
        f"{where}{_line(row)}row {k} of {quantity} has {len(row)} entries, row 1 has {width}; "
        "give every row as many, with a comma between two"
        for k, row in enumerate(rows, 1)
        if len(row) != width
    ]
    if problems or not width:
        raise InputError(problems or f"{where}{quantity} has no entries.")


def _line(row: list[Any]) -> str:
    return f"line {row[0].place.line}: " if row and isinstance(row[0], Cell) else ""


def _entry(
    cell: Any, words: Vocabulary, quantity: str, place: str, problems: list[str]
) -> sympy.Expr:
    """Return an entry in SymPy; a `Cell` knows its own place in the file."""
    at = f"{quantity}, " if isinstance(cell, Cell) else f"{quantity}, {place}: "
    try:
        if isinstance(cell, Cell):
            return parse_expression(cell.text, words.names, cell.place, words.refused)
        if isinstance(cell, str):
            return parse_expression(cell, words.names, None, words.refused)
        expression = _plain(cell)
        unknown = sorted(symbol_names(expression) - set(words.names))
        if not unknown:
            meanings = {sympy.Symbol(name): value for name, value in words.names.items()}
            meant: sympy.Expr = expression.xreplace(meanings)
            return meant
        hint = suggestion(unknown[0], words.names)
        problems.append(
            f"{at}{expression} contains {listed(unknown)}{hint}; "
            f"the names are: {listed(words.names, 60)}"
        )
    except NotAnExpressionError as error:
        problems.append(f"{at}{error}")
    nothing: sympy.Expr = sympy.Integer(0)
    return nothing


def _as_column(rows: list[list[Any]]) -> list[list[Any]]:
    """Return a vector written as a row as a column."""
    return [[item] for item in rows[0]] if len(rows) == 1 else rows


def _written(cell: Any) -> str:
    return " ".join(cell.text.split()) if isinstance(cell, Cell) else str(cell)


def _from_expressions(
    texts: tuple[tuple[str, ...], ...], table: Expressions, reference: Reference
) -> Hand:
    code = reference.compiled([entry for row in table for entry in row])
    shape = (len(table), len(table[0]))

    def evaluate(states: States) -> tuple[Array, Array]:
        values, sizes = code.evaluate(states)
        return values.reshape(-1, *shape), sizes.reshape(-1, *shape)

    return Hand(texts, evaluate, table)


def _no_texts(shape: tuple[int, ...]) -> tuple[tuple[str, ...], ...]:
    return (("",) * shape[1],) * shape[0]


def _from_array(quantity: str, given: Array, at_states: bool) -> Hand:
    """Take an array that holds everywhere, or one with the given states along its first axis."""
    array = given.astype(float)
    if quantity != "Phi_q":
        array = array.reshape(*(array.shape if at_states else (-1,)), 1)
    if at_states and array.ndim == 2:
        array = array[None]
    if array.ndim != (3 if at_states else 2) or 0 in array.shape:
        raise InputError(
            f"{quantity} has shape {given.shape}; expected its rows (and columns), with the states "
            "in front where states={'q': ..., ...} is given."
        )
    texts = _no_texts(array.shape[-2:])
    if not at_states:
        texts = tuple(tuple(f"{item:.6g}" for item in row) for row in array)

    def evaluate(states: States) -> tuple[Array, Array]:
        if at_states and len(array) != len(states):
            raise InputError(
                f"{quantity} holds values for {len(array)} states, but states has {len(states)}; "
                "give the states that the array belongs to."
            )
        values = np.broadcast_to(array, (len(states), *array.shape[-2:]))
        return values, np.abs(values)

    return Hand(texts, evaluate, takes_states=not at_states)


def _from_function(quantity: str, function: Callable[..., Any], reference: Reference) -> Hand:
    names = ("q", "q_dot", "t") if quantity == "gamma" else ("q", "t")
    count = _positional_count(function)
    if count is not None and count < len(names):
        raise InputError(f"{quantity}: the function takes {count} arguments; expected {names}.")
    takes_parameters = count is None or count > len(names)

    def at(states: States, k: int) -> Array:
        arguments = [getattr(states, name)[k] for name in names]
        arguments += [states.p[k]] if takes_parameters else []
        value = np.asarray(function(*arguments), dtype=float)
        return value if quantity == "Phi_q" else value.reshape(-1, 1)

    def evaluate(states: States) -> tuple[Array, Array]:
        with np.errstate(all="ignore"):
            values = np.stack([at(states, k) for k in range(len(states))])
        return values, np.abs(values)

    shape = np.atleast_2d(at(reference.random.take(np.array([0])), 0)).shape
    return Hand(_no_texts(shape), evaluate, takes_parameters=takes_parameters)


def _positional_count(function: Callable[..., Any]) -> int | None:
    """Return how many arguments a function takes by position, None where it cannot be told."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return None
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    if any(item.kind is inspect.Parameter.VAR_POSITIONAL for item in parameters):
        return None
    return sum(item.kind in kinds for item in parameters)

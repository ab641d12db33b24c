"""The written side of a comparison: formulas, arrays or functions, all evaluated in one way."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.checker import rounding
from kincompile.checker.agreement import Given
from kincompile.checker.matrix_text import Cell, split_matrix
from kincompile.checker.notation import IMAGINARY, explicit, plain, real
from kincompile.checker.reference import MATRICES
from kincompile.errors import InputError, SingularConfigurationWarning
from kincompile.files.data_text import MAX_PROBLEMS
from kincompile.files.formula_text import ExpressionError
from kincompile.files.safe_expressions import (
    CONSTANTS,
    FUNCTIONS,
    UnknownNameError,
    extent,
    parse_expression,
)
from kincompile.files.text_places import TextPlace
from kincompile.model.expressions import NotAnExpressionError, as_expression, symbol_names, t
from kincompile.names import listed, name_problem, rate, shown, suggestion

if TYPE_CHECKING:
    from kincompile.checker.reference import Reference
    from kincompile.checker.states import Array, States

Texts = tuple[tuple[str, ...], ...]

MAX_ALIASES = 1000
"""Names of the author's own."""
MAX_SIZE = 1_000_000
"""Characters of all formulas and parts with aliases written out; as many take about 10 s."""

REPORTED = ""
"""Placeholder for a quantity whose unknown names have all been reported already."""
_NO_ACCELERATIONS = "accelerations are the unknowns of Phi_q q_ddot = gamma; no formula holds them"


@dataclass(frozen=True, slots=True)
class Written:
    """One quantity as its author has it."""

    texts: Texts  # the text of each entry; empty for functions and for arrays of values at states
    # Gives the values at states, (N, rows, columns), and how exact they are.
    evaluate: Callable[[States], Given]
    # The formulas, row by row; None for functions and arrays.
    expressions: tuple[sympy.Expr, ...] | None = None
    # Its rounding, in words.
    rounding: str = "numbers are rounded; they count to half of their last digit"
    # What a function is called with, by name.
    arguments: tuple[str, ...] = ()
    # Whether it may be evaluated at other parameters than the default ones.
    takes_parameters: bool = True
    # Whether it may be evaluated at any states, not only those its author gave.
    takes_states: bool = True

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns."""
        return len(self.texts), len(self.texts[0])

    def uses(self, name: str) -> bool:
        """Return whether formulas have a name in them; functions may have any."""
        symbol = sympy.Symbol(name)
        return self.expressions is None or any(item.has(symbol) for item in self.expressions)

    @property
    def size(self) -> int:
        """Number of parts of all formulas; of functions and arrays 0."""
        return sum(extent(item)[0] for item in self.expressions or ())

    def formula(self, row: int, column: int) -> sympy.Expr | None:
        """Return an entry as an expression, None of functions and arrays."""
        if self.expressions is None:
            return None
        return self.expressions[row * self.shape[1] + column]


class _Formulas:
    """Formulas that were read, by their text: most entries of a large matrix are alike."""

    def __init__(self) -> None:
        self._read: dict[str, sympy.Expr] = {}
        self._size = 0

    def read(self, text: str, place: TextPlace | None, words: Vocabulary) -> sympy.Expr:
        """Return a text as an expression; the names in it must mean what they meant before."""
        if text not in self._read:
            if self._size > MAX_SIZE:
                raise NotAnExpressionError(
                    f"all formulas together have more than {MAX_SIZE:,} characters and parts, "
                    "aliases written out; write them shorter"
                )
            self._size += len(text)
            typed = explicit(text, place, words.names)
            self._read[text] = real(parse_expression(typed, words.names, place, words.refused))
            self._size += extent(self._read[text])[0]
        return self._read[text]


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """Names that a formula may use, and names that exist but may not stand in one.

    Names may be added while formulas are read, but not change what they mean.
    """

    names: Mapping[str, sympy.Expr]
    refused: Mapping[str, str]
    help: str = ""
    formulas: _Formulas = field(default_factory=_Formulas)
    reported: set[str] = field(default_factory=set)

    def read(self, value: object) -> sympy.Expr:
        """Return a text, a `Cell`, a number or a SymPy expression in plain symbols.

        Raises
        ------
        NotAnExpressionError
            If it has another type, or holds an unknown name.
        """
        if isinstance(value, Cell):
            return self.formulas.read(plain(value.text), value.place, self)
        if isinstance(value, str):
            return self.formulas.read(plain(value), None, self)
        if isinstance(value, sympy.Expr) and value.has(sympy.I):
            value = value.xreplace({sympy.I: IMAGINARY})
        expression: sympy.Expr = sympy.sympify(as_expression(_without_derivatives(value)))
        unknown = sorted(symbol_names(expression) - set(self.names) - {IMAGINARY.name})
        if unknown:
            problem = f"{expression} contains {listed(unknown)}"
            raise UnknownNameError(ExpressionError(problem, 1, 1), unknown[0])
        meanings = {sympy.Symbol(name): item for name, item in self.names.items()}
        return real(expression.xreplace(meanings))

    def problem(self, error: NotAnExpressionError, where: str) -> str | None:
        """Return what to say about a formula; None if its unknown name was reported already."""
        if not isinstance(error, UnknownNameError):
            return f"{where}{error}"
        if error.name in self.reported:
            return None
        hint = suggestion(error.name, self.names)
        rest = "" if self.reported else f"; {self.help}"
        self.reported.add(error.name)
        text, _, _ = str(error).partition(";")
        return f"{where}{text}{hint}{rest}"


def _without_derivatives(value: object) -> object:
    """Return an expression with the rates of `dynamicsymbols` as plain symbols."""
    if not isinstance(value, sympy.Expr):
        return value
    rates = {
        item: sympy.Symbol(rate(item.expr.func.__name__))
        for item in value.atoms(sympy.Derivative)
        if item.variables == (t,) and isinstance(item.expr, sympy.Function)
    }
    return value.xreplace(rates)


def vocabulary(reference: Reference, aliases: Mapping[str, object]) -> Vocabulary:
    """Return the names of a system and the author's own.

    A coordinate ``phi3`` has the rate ``phi3_dot``, also ``phi3d``. The coordinates of bodies may
    be numbered, ``x1``, ``y1``, ``phi_1``, and so may all coordinates, ``q1``, ``q2``. A body in
    space has angular velocities, ``omega_x_rod`` and, about its own axes, ``omega_xi_rod``.

    Parameters
    ----------
    aliases
        Further names, each with its expression: a text, a `Cell` or SymPy. An alias may use those
        before it.

    Raises
    ------
    InputError
        If an alias is not a name, hides a name of the system, or is not an expression.
    """
    if len(aliases) > MAX_ALIASES:
        raise InputError(f"there are {len(aliases)} aliases; at most {MAX_ALIASES} are read")
    reference = reference.base
    names, refused = _names_of(reference)
    words = Vocabulary(names, refused, reference.names_help())
    problems = []
    for name, value in aliases.items():
        problem = _alias_problem(name, names)
        try:
            if problem is None:
                names[name] = words.read(value)
        except NotAnExpressionError as error:
            problem = words.problem(error, "")
        if problem is not None:
            problems.append(f"alias {shown(name)}: {problem}")
        if len(problems) == MAX_PROBLEMS:
            break
    if problems:
        raise InputError(problems)
    still_refused = {name: why for name, why in refused.items() if name not in names}
    return replace(words, refused=still_refused)


def _names_of(reference: Reference) -> tuple[dict[str, sympy.Expr], dict[str, str]]:
    """Return the names of a system with their meanings, and those of accelerations."""
    own = reference.names()
    symbols = dict.fromkeys((*reference.symbols, *(name for _, name in own)))
    names: dict[str, sympy.Expr] = {name: sympy.Symbol(name) for name in symbols}
    names |= {"t": t} | {rate(name): sympy.Symbol(rate(name)) for _, name in own}
    names |= {written: sympy.Symbol(name) for written, name in reference.forces.items()}
    refused = {}
    for written, name in own:
        names.setdefault(written, names[name])
        for end in ("_dot", "d"):
            names.setdefault(f"{written}{end}", names[rate(name)])
        refused[rate(written, 2)] = refused[f"{written}dd"] = _NO_ACCELERATIONS
    for name in reference.spins:
        names.setdefault(name, sympy.Symbol(name))
        refused[rate(name)] = refused[f"{name}d"] = _NO_ACCELERATIONS
    names.setdefault("I", IMAGINARY)
    return names, refused


def _alias_problem(name: str, names: Mapping[str, sympy.Expr]) -> str | None:
    if name in names or name in CONSTANTS or name in FUNCTIONS:
        return "this name has a meaning already; choose another"
    return name_problem(name, "it") if name != "alpha" else None


def read_written(
    quantity: str,
    given: object,
    words: Vocabulary,
    reference: Reference,
    at_states: bool,
    shape_problems: Callable[[int, int], list[str]],
) -> list[Written]:
    """Read one quantity in any of the forms a user may give it, in all ways it may be meant.

    Of a transmission a function of one argument may be of the inputs or of the outputs.

    Parameters
    ----------
    given
        Text, rows of `Cell`, nested lists of numbers, texts and SymPy expressions, a SymPy matrix,
        a NumPy array, or a function ``f(q, t)`` (of gamma and Q: ``f(q, q_dot, t)``), which
        may also take the parameters as a last argument.
    shape_problems
        Says what is wrong with a number of rows and columns. It is asked before any formula is
        read: a file can hold more of them than anyone could wait for.

    Raises
    ------
    InputError
        If it has another type, is ragged, or holds an unknown name. One message has all problems.
    """
    if isinstance(given, list | tuple) and (numbers := _numbers(given)) is not None:
        given = numbers
    if isinstance(given, np.ndarray) and given.dtype != object:
        return [_from_array(quantity, given, at_states)]
    if callable(given) and not isinstance(given, sympy.Basic):
        return _functions(quantity, given, reference)
    rows = _rows(quantity, given)
    _check_rectangular(quantity, rows)
    if quantity not in MATRICES and len(rows) == 1:
        rows = [[cell] for cell in rows[0]]
    if problems := shape_problems(len(rows), len(rows[0])):
        raise InputError(problems)
    return [_from_expressions(rows, _expressions(quantity, rows, words), reference)]


def _expressions(quantity: str, rows: list[list[object]], words: Vocabulary) -> list[sympy.Expr]:
    expressions: list[sympy.Expr] = []
    problems: list[str | None] = []
    for r, row in enumerate(rows, 1):
        for c, cell in enumerate(row, 1):
            try:
                expressions.append(words.read(cell))
            except NotAnExpressionError as error:
                # A cell knows its own place in the file.
                place = "" if isinstance(cell, Cell) else f"row {r}, column {c}: "
                problems.append(words.problem(error, f"{quantity}, {place}"))
        if len(problems) >= MAX_PROBLEMS:
            break
    if problems:
        raise InputError([item for item in problems if item is not None] or REPORTED)
    return expressions


def _numbers(given: object) -> Array | None:
    """Return rows of floats, as a program prints them, as an array; None where they are not."""
    try:
        array = np.asarray(given)
    except ValueError:
        return None
    return array if array.dtype.kind == "f" else None


def _rows(quantity: str, given: object) -> list[list[object]]:
    if isinstance(given, str):
        try:
            given = split_matrix(given, TextPlace())
        except ExpressionError as error:
            raise InputError(f"{quantity}: {error}") from error
    if isinstance(given, sympy.MatrixBase | np.ndarray):
        given = np.asarray(given, dtype=object).tolist()
    if isinstance(given, sympy.Expr | int | float):
        given = [given]
    if isinstance(given, Sequence) and len(given) > 0:
        return [list(row) if isinstance(row, Sequence) and not isinstance(row, str) else [row]
                for row in given]  # fmt: skip
    raise InputError(
        f"{quantity} is {type(given).__name__}; expected text, rows of expressions, a SymPy "
        "matrix, an array or a function."
    )


def _check_rectangular(quantity: str, rows: list[list[object]]) -> None:
    width = len(rows[0])
    problems = [
        f"{_line(row)}row {k} of {quantity} has {len(row)} entries, row 1 has {width}; "
        "give every row as many, with a comma between two"
        for k, row in enumerate(rows, 1)
        if len(row) != width
    ]
    if problems or not width:
        raise InputError(problems or f"{quantity} has no entries.")


def _line(row: list[object]) -> str:
    return f"line {row[0].place.line}: " if row and isinstance(row[0], Cell) else ""


def _from_expressions(
    rows: list[list[object]], expressions: list[sympy.Expr], reference: Reference
) -> Written:
    shape = (-1, len(rows), len(rows[0]))

    texts = tuple(
        tuple(
            " ".join(cell.text.split()) if isinstance(cell, Cell) else reference.printed(cell)
            for cell in row
        )
        for row in rows
    )
    literals = [rounding.of_literals(item) for item in expressions]
    terms = [term for item in literals for term in item]
    owner = np.repeat(np.arange(len(literals)), [len(item) for item in literals])

    def evaluate(states: States) -> Given:
        values, sizes = (item.reshape(shape) for item in reference.evaluate(expressions, states))
        typed = np.zeros((len(literals), len(states)))
        if terms:
            np.add.at(typed, owner, np.abs(reference.evaluate(terms, states)[0].T))
        none = np.zeros_like(values)
        return Given(values, sizes, typed.T.reshape(values.shape), none, none)

    return Written(texts, evaluate, tuple(expressions))


def _no_texts(shape: tuple[int, ...]) -> Texts:
    return (("",) * shape[1],) * shape[0]


def _from_array(quantity: str, given: Array, at_states: bool) -> Written:
    """Return an array that holds everywhere, or one with the given states along its first axis."""
    array = given.astype(float)
    if quantity not in MATRICES:
        array = array.reshape(*(array.shape if at_states else (-1,)), 1)
    if at_states and array.ndim == 2:
        array = array[None]
    if array.ndim != (3 if at_states else 2) or 0 in array.shape:
        raise InputError(
            f"{quantity} has shape {given.shape}; expected its rows (and columns), with the states "
            "in front where states={'q': ..., ...} is given."
        )

    is_single = given.dtype == np.float32
    part = np.zeros_like(array) if is_single else rounding.of_array(array)

    def evaluate(states: States) -> Given:
        if at_states and len(array) != len(states):
            raise InputError(
                f"{quantity} holds values for {len(array)} states, but states has {len(states)}; "
                "give the states that the array belongs to."
            )
        values, printed = (
            np.broadcast_to(item, (len(states), *array.shape[-2:])) for item in (array, part)
        )
        none = np.zeros_like(values)
        accuracy = np.full_like(values, rounding.OF_FUNCTION * is_single)
        return Given(values, np.abs(values), none, printed, accuracy)

    if at_states:
        return Written(_no_texts(array.shape[1:]), evaluate, takes_states=False)
    texts = tuple(tuple(f"{item:.6g}" for item in row) for row in array)
    return Written(texts, evaluate)


def _functions(
    quantity: str, function: Callable[..., object], reference: Reference
) -> list[Written]:
    """Return a function in the ways in which its arguments may be meant."""
    names = _argument_names(function)
    if (method := reference.method(quantity, function, names)) is not None:
        by_name, arguments = method
        return [_from_function(quantity, by_name, reference, arguments, is_of_many=True)]
    choices = reference.arguments(quantity, names)
    return [_from_function(quantity, function, reference, item) for item in choices]


def _from_function(
    quantity: str,
    function: Callable[..., object],
    reference: Reference,
    names: Sequence[str],
    *,
    is_of_many: bool = False,
) -> Written:
    """Return a function that is called with values of these names, one state after the other.

    One that `is_of_many` takes all states at once, along the first axis.
    """

    def at(states: States, k: int | slice) -> Array:
        """Return the values at one state, or at several, (N, rows, columns)."""
        # Copies: what a function does to its arguments must not change the states.
        arguments = [np.copy(reference.argument(name, states)[k])[()] for name in names]
        try:
            value = np.asarray(function(*arguments), dtype=float)
        except Exception as error:
            values = ", ".join(
                f"{name} = {np.array2string(np.asarray(x), precision=6)}"
                for name, x in zip(names, arguments, strict=True)
            )
            raise InputError(
                f"{quantity}: the function raises {type(error).__name__}: {error}, at {values}. "
                "Give one that returns an array of real numbers there."
            ) from error
        return _of_states(quantity, value if isinstance(k, slice) else value[None])

    def evaluate(states: States) -> Given:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            # Where a name is read as another, there may be no such pose.
            warnings.simplefilter("ignore", SingularConfigurationWarning)
            parts = [slice(None)] if is_of_many else range(len(states))
            values = np.concatenate([at(states, k) for k in parts])
        none = np.zeros_like(values)
        return Given(values, np.abs(values), none, none, none + rounding.OF_FUNCTION)

    shape = at(reference.random, slice(None) if is_of_many else 0).shape
    return Written(
        _no_texts(shape[1:]),
        evaluate,
        rounding="its values agree to six digits, as differences and single precision do",
        arguments=tuple(names),
        takes_parameters="p" in names,
    )


def _of_states(quantity: str, values: Array) -> Array:
    """Return what a function gives at states, (N, ...), as rows and columns, (N, rows, columns)."""
    if quantity not in MATRICES:
        values = values.reshape(len(values), -1, 1)
    if values.ndim > 3:
        raise InputError(
            f"{quantity}: the function returns an array of {values.ndim - 1} axes; give one that "
            "returns rows of numbers."
        )
    return values.reshape(len(values), *(1,) * (3 - values.ndim), *values.shape[1:])


def _argument_names(function: Callable[..., object]) -> list[str] | None:
    """Return the names of the arguments by position, None if they are not known."""
    try:
        found = list(inspect.signature(function).parameters.values())
    except (TypeError, ValueError):
        return None
    if any(item.kind is inspect.Parameter.VAR_POSITIONAL for item in found):
        return None
    by_position = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    # A number as default is an option of the author's, a step for instance, and not p.
    return [
        item.name
        for item in found
        if item.kind in by_position and not isinstance(item.default, Real)
    ]

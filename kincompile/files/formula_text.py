"""The text of a formula: its characters, brackets and syntax tree, and where problems stand."""

from __future__ import annotations

import ast
import re
import warnings
from bisect import bisect_right
from keyword import kwlist
from typing import TYPE_CHECKING

from kincompile.files.text_places import TextPlace, TextPlaces
from kincompile.model.expressions import NotAnExpressionError

if TYPE_CHECKING:
    from collections.abc import Collection

_LOOKALIKES = {
    "\u2212": "-", "\u2013": "-", "\u00b7": "*", "\u00d7": "*", "\u00f7": "/", "\u00b2": "^2",
    "\u00b3": "^3", "\u03c0": "pi", "'": "a name such as phi_dot for a rate",
}  # fmt: skip
_PUNCTUATION = frozenset("_.,+-*/^()[]<>= \t\r\n")
EXPECTED = "numbers, names, + - * / ^ ( ) and functions"
"""What may stand in a formula, for messages."""

GRAMMAR = frozenset({"and", "or", "True"})
"""Words that formulas have themselves, in conditions."""

_KEPT = {x: x[:-2] + chr(0x430 + k) for k, x in enumerate(kwlist) if x not in GRAMMAR}
"""Other words that Python keeps, each as a name of as many bytes that no formula has."""

_WORDS = {kept: word for word, kept in _KEPT.items()}


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


class Source:
    """The text as written, as Python reads it, and the way from one to the other."""

    def __init__(self, text: str, place: TextPlace, names: Collection[str] = ()) -> None:
        self.text = text
        self._place = place
        # One line between brackets: line breaks mean nothing inside a formula. `^` is Python's
        # exclusive or, which binds weaker than +, so it becomes `**` before the grammar sees it.
        self._python = "(" + "".join(" " if ch.isspace() else ch for ch in text) + ")"
        self._carets = [k + 1 for k, ch in enumerate(text) if ch == "^"]
        self._python = self._python.replace("^", "**")
        if kept := [word for word in _KEPT if word in names]:
            words = rf"\b({'|'.join(kept)})\b"
            self._python = re.sub(words, lambda found: _KEPT[found[0]], self._python)
        self._moved = [k + number for number, k in enumerate(self._carets)]

    @staticmethod
    def name(node: ast.Name) -> str:
        """Return a name as it is written."""
        return _WORDS.get(node.id, node.id)

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
            remedy = f"write {hint}" if hint else f"expected {EXPECTED}"
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

"""Python text: tuples, assignments, as few lines as fit."""

from __future__ import annotations

import itertools
import json
import re
from collections import deque
from typing import TYPE_CHECKING

from kincompile.emitters.constants import named_lists
from kincompile.emitters.lines import WIDTH, broken, indented, pieces, wrapped
from kincompile.emitters.printer import ATOM, ELEMENTARY, POWER, Dialect

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from kincompile.ir.program import Program

NUMPY = Dialect(
    "NumPy",
    {name: f"{name}({{}})" for name in ELEMENTARY},
    nan="nan",
    square=("{}**2", (ATOM,), POWER),
    select="where({}, {}, {})",
    table="f.spline({}, {}, {})",
)
"""How Python writes expressions; the module gives the names, for a point and for a batch."""


def tuple_text(items: Iterable[str], room: int = WIDTH - 15) -> str:
    """Return a tuple as text: where there is room on one line, else its elements on others."""
    items = list(items)
    text = f"({items[0]},)" if len(items) == 1 else f"({', '.join(items)})"
    return text if len(text) <= room else f"(\n{indented(wrapped(items))}\n)"


def list_texts(program: Program) -> dict[str, str]:
    """Return the lists of names and numbers as tuples, by their names in small letters."""
    numbers = dict.fromkeys(("DEFAULTS", "GUESS"), WIDTH - 34)
    lists = named_lists(program).items()
    return {name.lower(): tuple_text(own, numbers.get(name, WIDTH - 15)) for name, own in lists}


def solvability_text(program: Program) -> str:
    """Return the lines of a module about its solve, empty if Phi_q is square and regular."""
    lines = []
    if program.redundant:
        names = tuple_text(f'"{name}"' for name in program.redundant)
        lines += [
            "# equations that repeat others at every assembled position; a solve leaves them out",
            f"REDUNDANT = {names}",
        ]
    if program.held:
        sentences = (f'    "{name}": "{sentence}",' for name, sentence in program.held.items())
        lines += [
            "# freedoms that move no output, no joint and no other body, by what holds them",
            "HELD = {",
            *sentences,
            "}",
        ]
    if program.unsolvable:
        sentence = (json.dumps(piece, ensure_ascii=False) for piece in pieces(program.unsolvable))
        lines += [
            "# why the equations cannot determine the coordinates: there is no motion to solve for",
            f"UNSOLVABLE = (\n{indented(sentence)}\n)",
        ]
    if program.corners:
        lines += [
            "# drivers may have corners: there nu and gamma are those after the corner",
            "CORNERS = True",
        ]
    return "\n".join(lines)


def packed(texts: Sequence[str]) -> list[str]:
    """Return the elements of a tuple, as many a line as fit."""
    lines: list[str] = []
    for is_long, group in itertools.groupby(texts, lambda text: len(text) > WIDTH - 8):
        if is_long:
            lines += [line for text in group for line in element(text, "")]
        else:
            lines += [f"    {line}" for line in wrapped(group)]
    return lines


def element(text: str, comment: str) -> list[str]:
    """Return an element of the returned tuple, a long one continued with deeper indentation."""
    first, *rest = broken(text)
    lines = [f"    {first}", *(f"        {line}" for line in rest)]
    lines[-1] += f",  # {comment}" if comment else ","
    return lines


def assignments(texts: Sequence[tuple[str, str]], *, is_titled: bool = False) -> list[str]:
    """Return values with their names, two on a line where the second does not need the first.

    In titled code those are the two components of a vector.
    """
    lines: list[str] = []
    rest = deque(texts)
    while rest:
        name, text = rest.popleft()
        if rest and (not is_titled or (name[-1], name[:-1]) == ("x", rest[0][0][:-1])):
            pair = f"{name}, {rest[0][0]} = {text}, {rest[0][1]}"
            if len(pair) <= WIDTH - 4 and name not in re.findall(r"\w+", rest[0][1]):
                lines.append(pair)
                rest.popleft()
                continue
        parts = broken(text)
        own = [f"{name} = (", *(f"    {part}" for part in parts), ")"]
        lines += own if len(parts) > 1 else [f"{name} = {text}"]
    return lines

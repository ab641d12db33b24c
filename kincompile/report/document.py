"""A page as data: sections of blocks, whatever it is printed in.

A renderer prints each kind of block; what a page says is decided before, in the modules that fill
these classes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.calculus.expressions import Expression
    from kincompile.report.formulas import Formula, Glyph
    from kincompile.report.picture import Picture


@dataclass(frozen=True, slots=True)
class Verbatim:
    """A name or a piece of code in a text, printed as it is."""

    text: str


@dataclass(frozen=True, slots=True)
class Math:
    """A formula in a text or a cell."""

    formula: Formula


@dataclass(frozen=True, slots=True)
class Box:
    """A box to be filled by hand, with a formula where it is wide."""

    is_wide: bool = False


@dataclass(frozen=True, slots=True)
class CrossReference:
    """A reference to an anchor of the page."""

    anchor: str
    content: Run


Run: TypeAlias = str | Verbatim | Math | CrossReference | Box
"""A piece of a text; a plain string is prose."""

Runs: TypeAlias = tuple[Run, ...]


@dataclass(frozen=True, slots=True)
class SourceLine:
    """Lines of the emitted module."""

    number: int
    text: str


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph."""

    runs: Runs


@dataclass(frozen=True, slots=True)
class Display:
    """A formula on a line of its own."""

    formula: Formula
    anchor: str = ""  # where links to it lead; "" for none
    source: SourceLine | None = None  # the emitted code of it


@dataclass(frozen=True, slots=True)
class Table:
    """A table."""

    header: tuple[Runs, ...]
    rows: tuple[tuple[Runs, ...], ...]
    # Title under which it is folded away where the medium can fold, "" for an open table.
    folded: str = ""


@dataclass(frozen=True, slots=True)
class Pattern:
    """The picture of a sparse matrix."""

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    entries: dict[tuple[int, int], str]  # anchor of the derivation of each entry, by row and column
    bands: tuple[tuple[int, int], ...]  # first row and number of rows of each constraint


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """A picture on the page."""

    picture: Picture


@dataclass(frozen=True, slots=True)
class NotebookCode:
    """Code that a notebook runs; other media leave it out."""

    text: str


Block: TypeAlias = Text | Display | Table | Pattern | Figure | NotebookCode


@dataclass(frozen=True, slots=True)
class Chapter:
    """A titled part of the page."""

    anchor: str  # where links to it lead
    title: Runs
    blocks: tuple[Block, ...] = ()
    sections: tuple[Chapter, ...] = ()
    level: str = ""  # "vector", "expanded" or "numeric"; "" where that says nothing
    is_folded: bool = False  # whether it is folded away where the medium can fold


@dataclass(frozen=True, slots=True, eq=False)
class Manuscript:
    """A whole page.

    Attributes
    ----------
    summary
        Sizes, and the state of the numbers, in a few words.
    sections
        What the page says; that of a derivation coordinates, constraints (nine steps each), the
        assembled system.
    abbreviations
        Symbols that stand for vectors and angles which occur again and again.
    source
        The emitted module of a derivation.
    state
        Python code that sets t, q, q_dot and p to the state of the numbers.
    """

    name: str
    summary: str
    sections: tuple[Chapter, ...]
    abbreviations: Mapping[Expression, Glyph] = field(default_factory=dict)
    source: str = ""
    state: str = ""


LEVELS = ("vector", "expanded", "numeric")
"""The levels of a derivation: in vectors, in sines and cosines, in numbers."""


def of_levels(chapter: Chapter, levels: tuple[str, ...]) -> Chapter:
    """Return a chapter with the parts of some levels, and those that belong to none."""
    kept = (item for item in chapter.sections if item.level in ("", *levels))
    return replace(chapter, sections=tuple(of_levels(item, levels) for item in kept))


def text(*runs: Run) -> Text:
    """Return a paragraph."""
    return Text(runs)


def cells(*items: Run | Runs) -> tuple[Runs, ...]:
    """Return a row of cells, each a run or several."""
    return tuple(item if isinstance(item, tuple) else (item,) for item in items)


def table(
    header: tuple[Run, ...], rows: Sequence[tuple[Run | Runs, ...]], folded: str = ""
) -> Table:
    """Return a table from runs."""
    return Table(cells(*header), tuple(cells(*row) for row in rows), folded)


def row_range(first: int, count: int) -> str:
    """Return rows from a first one, for instance 3-4 with a dash."""
    return str(first) if count == 1 else f"{first}\N{EN DASH}{first + count - 1}"

"""The report of a comparison, for people and for machines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile.compare.comparison import Comparison
from kincompile.compare.renderings import (
    as_coloured_table,
    as_gradescope,
    as_json,
    as_page,
    as_text,
)
from kincompile.html import Shown, framed_html

if TYPE_CHECKING:
    from rich.console import Group

FORMAT = 1


class Report(Shown, Comparison):
    """The outcome of a comparison, which writes itself.

    Every form takes `reveal`: whether to show the right formulas and values. They are left out, or
    null in data, otherwise.
    """

    __slots__ = ()

    def to_data(self, reveal: bool = False) -> dict[str, Any]:
        """Return the report as plain data."""
        return {
            "format": FORMAT,
            "model": self.model,
            "constraint": self.constraint,
            "verdict": self.verdict.value,
            "equal": self.equal,
            "conventions": [
                {"kind": item.kind, "text": item.text, "rows": list(item.rows)}
                for item in self.conventions
            ],
            "entries": [entry.to_data(reveal) for entry in self.entries],
        }

    def to_json(self, reveal: bool = False) -> str:
        """Return the report as JSON."""
        return as_json(self.to_data(reveal))

    def to_html(self, reveal: bool = False) -> str:
        """Return the report as one HTML page that needs nothing else."""
        return as_page(self, reveal)

    def headline(self) -> str:
        """Return the model and the verdict."""
        return f"{self.title}, {self.verdict.value}"

    def _repr_html_(self) -> str:
        # In a frame, so that the page's style leaves the notebook alone.
        return framed_html(self.to_html(), f"{self.title}: comparison", "32rem")

    def to_text(self, reveal: bool = False) -> str:
        """Return the report as plain text."""
        return as_text(self, reveal)

    def to_rich(self, reveal: bool = False) -> Group:
        """Return the report as a table in colours, for ``rich.print``."""
        return as_coloured_table(self, reveal)

    def to_gradescope(self, reveal: bool = False) -> str:
        """Return a ``results.json`` for Gradescope's autograder: one test for each row."""
        return as_gradescope(self, reveal)

"""The outcome of a comparison, for people and for machines."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from kincompile.compare.entries import SEVERITY, Entry, Verdict, told
from kincompile.compare.pages import page
from kincompile.compare.terminal import coloured, plain

if TYPE_CHECKING:
    from kincompile.compare.conventions import Convention

FORMAT = 1


@dataclass(frozen=True, slots=True)
class Report:
    """The outcome of a comparison.

    Attributes
    ----------
    model
        Name of the mechanism.
    constraint
        The constraint that was checked alone, or None.
    entries
        All entries, quantity by quantity, row by row.
    conventions
        What the author writes differently without being wrong.
    """

    model: str
    constraint: str | None
    entries: tuple[Entry, ...]
    conventions: tuple[Convention, ...]

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of any entry."""
        return max((entry.verdict for entry in self.entries), key=SEVERITY.index)

    @property
    def equal(self) -> bool:
        """Whether no entry is different.

        Equal up to a named convention counts, and so does equal on the constraint manifold, where
        velocity and acceleration are solved: a textbook's formula is not wrong.
        """
        return self.verdict is not Verdict.DIFFERENT

    @property
    def different(self) -> tuple[Entry, ...]:
        """The entries that are different."""
        return tuple(entry for entry in self.entries if entry.verdict is Verdict.DIFFERENT)

    @property
    def quantities(self) -> tuple[str, ...]:
        """The quantities compared, in order."""
        return tuple(dict.fromkeys(entry.quantity for entry in self.entries))

    @property
    def title(self) -> str:
        """The model, and the constraint that was checked alone."""
        return self.model if self.constraint is None else f"{self.model}, {self.constraint}"

    @property
    def summary(self) -> str:
        """One sentence: how many entries have which verdict."""
        counts = [
            f"{number} {verdict.value}"
            for verdict in SEVERITY
            if (number := sum(entry.verdict is verdict for entry in self.entries))
        ]
        return f"{self.title}: {len(self.entries)} entries compared, {', '.join(counts)}."

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
        """Return the report as JSON.

        Parameters
        ----------
        reveal
            Whether to give the right formulas and values; null stands in their place otherwise.
        """
        return json.dumps(self.to_data(reveal), indent=2, ensure_ascii=False) + "\n"

    def to_html(self, reveal: bool = False) -> str:
        """Return the report as one HTML page that needs nothing else.

        Parameters
        ----------
        reveal
            Whether to show the right formulas and values.
        """
        conventions = [item.text for item in self.conventions]
        return page(self.title, self.summary, self.verdict, conventions, self.entries, reveal)

    def _repr_html_(self) -> str:
        return self.to_html()

    def to_text(self, reveal: bool = False) -> str:
        """Return the report as plain text.

        Parameters
        ----------
        reveal
            Whether to show the right formulas.
        """
        conventions = [item.text for item in self.conventions]
        return plain(self.title, conventions, self.entries, reveal=reveal)

    def to_rich(self, reveal: bool = False) -> Any:
        """Return the report as a table in colours, for ``rich.print``.

        Parameters
        ----------
        reveal
            Whether to show the right formulas.
        """
        conventions = [item.text for item in self.conventions]
        return coloured(self.title, conventions, self.entries, reveal=reveal)

    def to_gradescope(self, reveal: bool = False) -> str:
        """Return a ``results.json`` for Gradescope's autograder: one test for each row.

        Parameters
        ----------
        reveal
            Whether the students may see the right formulas.
        """
        tests = [
            self._test(quantity, row, reveal)
            for quantity in self.quantities
            for row in dict.fromkeys(e.row for e in self.entries if e.quantity == quantity)
        ]
        output = "\n".join([self.summary, *(item.text for item in self.conventions)])
        data = {"output": output, "visibility": "visible", "tests": tests}
        return json.dumps(data, indent=2, ensure_ascii=False) + "\n"

    def _test(self, quantity: str, row: str, reveal: bool) -> dict[str, Any]:
        entries = [e for e in self.entries if (e.quantity, e.row) == (quantity, row)]
        wrong = [entry for entry in entries if entry.verdict is Verdict.DIFFERENT]
        lines = [line for entry in entries for line in told(entry, reveal)]
        return {
            "name": f"{quantity}, {row}",
            "score": 0 if wrong else 1,
            "max_score": 1,
            "status": "failed" if wrong else "passed",
            "output": "\n".join(lines) or "right",
            "visibility": "visible",
        }

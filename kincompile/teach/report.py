"""What a comparison found: entries with verdicts, conventions with names, and their JSON."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.teach.conventions import Convention

FORMAT = 1


class Verdict(StrEnum):
    """What can be said of an entry."""

    EQUAL = "equal"
    CONVENTION = "equal up to convention"
    MANIFOLD = "equal on the manifold"
    DIFFERENT = "different"


_SEVERITY = (Verdict.EQUAL, Verdict.CONVENTION, Verdict.MANIFOLD, Verdict.DIFFERENT)


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """An explanation of entries that differ.

    Attributes
    ----------
    kind
        The fault in a few words, for instance ``rotation transposed``.
    text
        A sentence that says what is wrong and where, without giving the right formula away.
    detail
        The term or factor concerned, as the right formula has it; shown only where revealed.
    """

    kind: str
    text: str
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Difference:
    """A state at which an entry differs, and both values there.

    Attributes
    ----------
    state
        Coordinates, rates, time and parameters by name.
    generated, hand
        The values; `generated` by the author's conventions.
    """

    state: Mapping[str, float]
    generated: float
    hand: float


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry of Phi, Phi_q, nu or gamma.

    Attributes
    ----------
    quantity
        Phi, Phi_q, nu or gamma.
    row
        Name of the equation.
    column
        Name of the coordinate; None but for Phi_q.
    generated
        The right formula, in the system's own conventions.
    hand
        The formula as written; empty for arrays and functions.
    verdict
        Equal, equal up to convention, equal on the manifold, or different.
    diagnoses
        What explains the difference. Several are equivalent: they give the same numbers.
    difference
        A state at which it differs, None where it does not.
    """

    quantity: str
    row: str
    column: str | None
    generated: str
    hand: str
    verdict: Verdict
    diagnoses: tuple[Diagnosis, ...] = ()
    difference: Difference | None = None

    @property
    def label(self) -> str:
        """The entry in short: ``Phi_q[A.x, phi_crank]``."""
        place = self.row if self.column is None else f"{self.row}, {self.column}"
        return f"{self.quantity}[{place}]"

    def to_data(self, reveal: bool) -> dict[str, Any]:
        """Return the entry as plain data; the right formula and value only where revealed."""
        return {
            "quantity": self.quantity,
            "row": self.row,
            "column": self.column,
            "generated": self.generated if reveal else None,
            "hand": self.hand,
            "verdict": self.verdict.value,
            "diagnoses": [
                {"kind": item.kind, "text": item.text, "detail": item.detail if reveal else None}
                for item in self.diagnoses
            ],
            "difference": self._difference_data(reveal),
        }

    def _difference_data(self, reveal: bool) -> dict[str, Any] | None:
        if self.difference is None:
            return None
        return {
            "state": dict(self.difference.state),
            "generated": self.difference.generated if reveal else None,
            "hand": self.difference.hand,
        }


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
        return max((entry.verdict for entry in self.entries), key=_SEVERITY.index)

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
            for verdict in _SEVERITY
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


def told(entry: Entry, reveal: bool) -> list[str]:
    """Return what there is to say about an entry, in lines; nothing where it is right."""
    if entry.verdict in (Verdict.EQUAL, Verdict.CONVENTION):
        return []
    lines = [f"{entry.label}: {entry.verdict.value}"]
    for k, item in enumerate(entry.diagnoses):
        lines.append(("  " if k == 0 else "  or ") + item.text)
        if reveal and item.detail:
            lines.append(f"    {item.detail}")
    if reveal:
        lines.append(f"  right: {entry.generated}")
    return lines

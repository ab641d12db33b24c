"""Entries of a comparison: a verdict each, and what explains it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping


class Verdict(StrEnum):
    """What can be said of an entry."""

    EQUAL = "equal"
    CONVENTION = "equal up to convention"
    MANIFOLD = "equal on the manifold"
    DIFFERENT = "different"


SEVERITY = (Verdict.EQUAL, Verdict.CONVENTION, Verdict.MANIFOLD, Verdict.DIFFERENT)


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

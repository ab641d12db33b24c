"""The outcome of a comparison as data: verdicts, diagnoses and conventions."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping


class Verdict(StrEnum):
    """The verdict on an entry; a later one is more severe."""

    EQUAL = "equal"
    CONVENTION = "equal up to convention"
    MANIFOLD = "equal on the manifold"
    UNDECIDED = "undecided"
    DIFFERENT = "different"

    @property
    def is_right(self) -> bool:
        """Whether the entry is right at every state."""
        return self in (Verdict.EQUAL, Verdict.CONVENTION)


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """Return the most severe verdict."""
    return max(verdicts, key=list(Verdict).index)


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


@dataclass(frozen=True)
class ComparedEntry:
    """One entry of Phi, Phi_q, nu or gamma.

    Attributes
    ----------
    quantity
        Phi, Phi_q, nu or gamma.
    row
        Name of the equation.
    column
        Name of the coordinate; None but for Phi_q.
    right
        Gives the right formula, in the system's own conventions.
    hand
        The formula as written; empty for arrays and functions.
    verdict
        Equal, equal up to convention, equal on the manifold, undecided, or different.
    accepted
        Whether it counts as right. On the manifold alone nu and gamma are needed, where velocity
        and acceleration are solved; Newton's method needs Phi_q elsewhere too.
    diagnoses
        Explanations of the difference, of an entry that is not accepted. Several are equivalent:
        they give the same numbers.
    difference
        The state at which it differs most; None for an entry that is accepted.
    """

    quantity: str
    row: str
    column: str | None
    right: Callable[[], str] = field(repr=False, compare=False)
    hand: str
    verdict: Verdict
    accepted: bool
    diagnoses: tuple[Diagnosis, ...] = ()
    difference: Difference | None = None

    @cached_property
    def generated(self) -> str:
        """The right formula, in the system's own conventions."""
        return self.right()

    @property
    def label(self) -> str:
        """The entry in short: ``Phi_q[A.x, phi_crank]``."""
        place = self.row if self.column is None else f"{self.row}, {self.column}"
        return f"{self.quantity}[{place}]"

    @property
    def anchor(self) -> str:
        """The name of the entry's paragraph on a page; without blanks."""
        return f"{self.quantity}-{self.row}-{self.column or ''}"

    def explanation(self, reveal: bool) -> list[str]:
        """Return verdict and diagnoses in lines; none for an entry that is right everywhere."""
        if self.accepted and self.verdict.is_right:
            return []
        lines = [f"{self.label}: {self.verdict.value}"]
        if self.accepted:
            return [*lines, "  right wherever the constraints hold; there it is used"]
        for k, item in enumerate(self.diagnoses):
            lines.append(("  " if k == 0 else "  or ") + item.text)
            if reveal and item.detail:
                lines.append(f"    {item.detail}")
        return [*lines, f"  right: {self.generated}"] if reveal else lines

    def to_data(self, reveal: bool) -> dict[str, Any]:
        """Return the entry as plain data; the right formula and value only where revealed."""
        data = {"generated" if key == "right" else key: x for key, x in asdict(self).items()}
        data["generated"] = self.generated if reveal else None
        data |= {"verdict": self.verdict.value, "diagnoses": list(data["diagnoses"])}
        if not reveal:
            for item in data["diagnoses"]:
                item["detail"] = None
            if self.difference is not None:
                data["difference"]["generated"] = None
        return data


@dataclass(frozen=True, slots=True)
class Convention:
    """A way of writing in which formulas differ from the generated ones and are still right.

    Attributes
    ----------
    kind
        For instance ``row sign``.
    text
        A sentence for people.
    rows
        Names of the equations that it concerns; empty where it concerns all.
    """

    kind: str
    text: str
    rows: tuple[str, ...] = ()

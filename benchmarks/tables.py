"""What the larger benchmarks print: Markdown tables, and what was to be reached."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


@dataclass(frozen=True, slots=True)
class Target:
    """One thing to be reached: a number and its limit, "at most" or "at least"."""

    what: str
    found: float
    kind: str
    limit: float
    unit: str = ""

    def cells(self) -> list[str]:
        """Return the cells of the table."""
        is_reached = (
            self.found <= self.limit if self.kind == "at most" else self.found >= self.limit
        )
        limit = f"{self.kind} {self.limit:g} {self.unit}".strip()
        return [self.what, f"{self.found:.3g}", limit, "yes" if is_reached else "**no**"]


def print_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a Markdown table under a heading."""
    print(f"### {title}\n\n| {' | '.join(heads)} |\n| {' | '.join('---' for _ in heads)} |")
    for row in rows:
        print(f"| {' | '.join(row)} |")
    print(flush=True)


def print_targets(title: str, targets: Iterable[Target]) -> None:
    """Print what was reached of what was to be reached."""
    heads = ("what", "measured", "to be reached", "reached")
    print_table(title, heads, (target.cells() for target in targets))

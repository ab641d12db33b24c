"""The report of a comparison, for people and for machines."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from kincompile.checker.comparison import ComparedEntry, Convention, Verdict, worst
from kincompile.html import Shown, framed_html
from kincompile.report.templates import fill, read
from kincompile.tables import indented, table

if TYPE_CHECKING:
    from rich.console import Group

FORMAT = 1

COLOURS = {
    Verdict.EQUAL: "green",
    Verdict.CONVENTION: "cyan",
    Verdict.MANIFOLD: "yellow",
    Verdict.UNDECIDED: "magenta",
    Verdict.DIFFERENT: "bold red",
}


@dataclass(frozen=True, slots=True, repr=False)
class Report(Shown):
    """All entries of a comparison with their verdicts, which write themselves.

    Every form takes `reveal`: whether to show the right formulas and values. They are left out, or
    null in data, otherwise.

    Attributes
    ----------
    model
        Name of the mechanism.
    constraint
        The constraint that was checked alone, or None.
    entries
        All entries, quantity by quantity, row by row.
    conventions
        Differences in the author's way of writing that are not mistakes.
    """

    model: str
    constraint: str | None
    entries: tuple[ComparedEntry, ...]
    conventions: tuple[Convention, ...]

    @property
    def verdict(self) -> Verdict:
        """The most severe verdict of any entry."""
        return worst(entry.verdict for entry in self.entries)

    @property
    def equal(self) -> bool:
        """Whether every entry is accepted.

        Equal up to a named convention counts, and so does an entry of nu or gamma that is equal on
        the constraint manifold, where velocity and acceleration are solved: a textbook's formula is
        not wrong. Where the comparison is strict, equal alone counts.
        """
        return all(entry.accepted for entry in self.entries)

    @property
    def different(self) -> tuple[ComparedEntry, ...]:
        """The entries that are not accepted."""
        return tuple(entry for entry in self.entries if not entry.accepted)

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
            for verdict in Verdict
            if (number := sum(entry.verdict is verdict for entry in self.entries))
        ]
        return f"{self.title}: {len(self.entries)} entries compared, {', '.join(counts)}."

    @property
    def accepted(self) -> str:
        """How many entries are accepted, as a sentence."""
        count = sum(entry.accepted for entry in self.entries)
        return f"Accepted: {count} of {len(self.entries)} entries."

    def rows(self, quantity: str) -> dict[str, list[ComparedEntry]]:
        """Return the entries of a quantity by equation."""
        rows: dict[str, list[ComparedEntry]] = {}
        for entry in self.entries:
            if entry.quantity == quantity:
                rows.setdefault(entry.row, []).append(entry)
        return rows

    def counts(self) -> list[tuple[str, list[int]]]:
        """Return, for every quantity, the number of entries with each verdict."""
        return [
            (name, [sum(e.quantity == name and e.verdict is v for e in self.entries)
                    for v in Verdict])
            for name in self.quantities
        ]  # fmt: skip

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
        return _json(self.to_data(reveal))

    def to_html(self, reveal: bool = False) -> str:
        """Return the report as one HTML page that needs nothing else."""
        rows = {name: self.rows(name) for name in self.quantities}
        columns = {
            name: dict.fromkeys(e.column for e in self.entries if e.quantity == name and e.column)
            for name in rows
        }
        differ = [(item, _at_a_state(item, reveal)) for item in self.entries if item.difference]
        return fill(
            "report/comparison.html.jinja",
            {
                "found": self, "verdicts": list(Verdict), "rows": rows, "columns": columns,
                "details": differ, "reveal": reveal,
                "style": read("report/comparison.css").rstrip(),
            },
        )  # fmt: skip

    def headline(self) -> str:
        """Return the model and the verdict."""
        return f"{self.title}, {self.verdict.value}"

    def _repr_html_(self) -> str:
        # In a frame, so that the page's style leaves the notebook alone.
        return framed_html(self.to_html(), f"{self.title}: comparison", "32rem")

    def to_text(self, reveal: bool = False) -> str:
        """Return the report as plain text."""
        header = ["", *(verdict.value for verdict in Verdict)]
        rows = [[name, *map(str, numbers)] for name, numbers in self.counts()]
        lines = [self.title, "", *indented(table(header, rows, header[1:]))]
        if self.conventions:
            lines += ["", "Conventions", *indented([item.text for item in self.conventions])]
        for entry in self.entries:
            if explanation := entry.explanation(reveal):
                lines += ["", *explanation]
        return "\n".join([*lines, "", self._closing]) + "\n"

    @property
    def _closing(self) -> str:
        return f"{self.accepted}\nVerdict: {self.verdict.value}."

    def to_rich(self, reveal: bool = False) -> Group:
        """Return the report as a table in colours, for ``rich.print``."""
        # rich takes a tenth of a second to import, and a pipe has no colours.
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        counts = Table(title=self.title, title_justify="left")
        counts.add_column("")
        for verdict in Verdict:
            counts.add_column(verdict.value, justify="right", style=COLOURS[verdict])
        for name, numbers in self.counts():
            counts.add_row(name, *(str(number) if number else "" for number in numbers))
        details = Table("entry", "verdict", "why", show_lines=True)
        for entry in self.entries:
            if explanation := entry.explanation(reveal):
                shown = Text(entry.verdict.value, style=COLOURS[entry.verdict])
                why = Text("\n".join(line.strip() for line in explanation[1:]))
                details.add_row(Text(entry.label), shown, why)
        return Group(
            counts,
            *(Text(item.text, style=COLOURS[Verdict.CONVENTION]) for item in self.conventions),
            *([details] if details.row_count else []),
            Text(self._closing, style=COLOURS[Verdict.EQUAL if self.equal else self.verdict]),
        )

    def to_gradescope(self, reveal: bool = False) -> str:
        """Return a ``results.json`` for Gradescope's autograder: one test for each row."""
        tests = [
            _test(f"{quantity}, {row}", entries, reveal)
            for quantity in self.quantities
            for row, entries in self.rows(quantity).items()
        ]
        output = "\n".join([self.summary, *(item.text for item in self.conventions)])
        return gradescope_json(output, tests)


def _at_a_state(entry: ComparedEntry, reveal: bool) -> str:
    """Return the values of an entry at the state where it differs most."""
    assert entry.difference is not None
    values = f"yours {entry.difference.hand:.6g}"
    if reveal:
        values += f", right {entry.difference.generated:.6g}"
    state = ", ".join(f"{name} = {value:.4g}" for name, value in entry.difference.state.items())
    return f"For instance {values}, at {state}"


def _test(name: str, entries: list[ComparedEntry], reveal: bool) -> dict[str, Any]:
    """Return the test of one row: a point where all entries are accepted."""
    is_wrong = not all(entry.accepted for entry in entries)
    lines = [line for entry in entries for line in entry.explanation(reveal)]
    return gradescope_test(name, not is_wrong, "\n".join(lines) or "right")


def gradescope_test(name: str, is_right: bool, output: str) -> dict[str, Any]:
    """Return a test of Gradescope that is worth a point."""
    return {
        "name": name,
        "score": 1 if is_right else 0,
        "max_score": 1,
        "status": "passed" if is_right else "failed",
        "output": output,
        "visibility": "visible",
    }


def gradescope_json(output: str, tests: list[dict[str, Any]]) -> str:
    """Return the ``results.json`` of an autograder of Gradescope."""
    return _json({"output": output, "visibility": "visible", "tests": tests})


def _json(data: dict[str, Any]) -> str:
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"

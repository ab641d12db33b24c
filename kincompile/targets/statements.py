"""Statements of the languages that write one below the other, with what differs as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.quantities import quantity_named
from kincompile.targets.evaluators import inputs_read
from kincompile.targets.headings import entry_title, header, title
from kincompile.targets.lines import broken

if TYPE_CHECKING:
    from kincompile.ir.inline import InlineProgram
    from kincompile.ir.program import Program
    from kincompile.targets.evaluators import Listing
    from kincompile.targets.printer import Printer


@dataclass(frozen=True, slots=True)
class Layout:
    """How a language writes statements.

    Attributes
    ----------
    comment
        How a comment begins.
    value
        Left side of the statement that computes a value, with ``{}`` for its name.
    element, entry
        A vector's element and a matrix's entry: name, and an index each.
    rotation
        The matrix A of a body frame, for a comment.
    first
        Number of the first row.
    continued, ending
        What ends a line of a statement that goes on, and its last line.
    """

    comment: str
    value: str
    element: str
    entry: str
    rotation: str = "[[c, -s], [s, c]]"
    first: int = 0
    continued: str = ""
    ending: str = ";"

    def header(self, code: InlineProgram) -> str:
        """Return the comment at the top of a file: coordinates, parameters, rows."""
        lines = header(code, self.first)
        return "\n".join(f"{self.comment} {line}".rstrip() for line in lines)

    def assigned(self, left: str, text: str, about: str = "") -> list[str]:
        """Return an assignment and a comment, a long one continued with indentation."""
        first, *rest = broken(text)
        *lines, last = f"{left} = {first}", *(f"    {line}" for line in rest)
        comment = f"  {self.comment} {about}" if about else ""
        return [*(f"{line}{self.continued}" for line in lines), f"{last}{self.ending}{comment}"]

    def inputs(self, program: Program, listing: Listing) -> list[str]:
        """Return the statements that name the inputs that are read."""
        lines = []
        for vector, k, name in inputs_read(program, listing):
            lines += self._value(name, self.element.format(vector, k + self.first))
        return lines

    def frames(self, listing: Listing, printer: Printer) -> list[str]:
        """Return the statements that compute cosine and sine of each body's angle."""
        lines = [f"{self.comment} body frames: A = {self.rotation}"] if listing.frames else []
        for frame in listing.frames:
            for item in frame.values:
                lines += self._value(item.name, printer.definition(item.node))
        return lines

    def steps(self, listing: Listing, printer: Printer) -> list[str]:
        """Return the statements that compute shared values, by the constraint that needs them."""
        lines = []
        for section, assignments in listing.steps:
            lines.append(f"{self.comment} {title(section, self.first)}")
            for item in assignments:
                lines += self._value(item.name, printer.definition(item.node))
        return lines

    def _value(self, name: str, text: str) -> list[str]:
        """Return the statement that computes a value."""
        return self.assigned(self.value.format(name), text)

    def results(self, quantity: str, code: InlineProgram, printer: Printer) -> list[str]:
        """Return the statements that put a quantity's entries into an array of zeros."""
        lines = []
        for section in code.sections:
            entries = [item for item in section.entries[quantity] if code.number(item.node) != 0]
            lines += [f"{self.comment} {title(section, self.first)}"] if entries else []
            for item in entries:
                row, column = item.row + self.first, item.column + self.first
                form = self.entry if quantity_named(quantity).is_matrix else self.element
                left = form.format(quantity, row, column)
                lines += self.assigned(
                    left, printer.text(item.node), entry_title(quantity, item, code)
                )
        return lines

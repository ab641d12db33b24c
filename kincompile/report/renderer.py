"""What the media of a derivation share: sections, blocks and runs, printed in turn."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from kincompile.report import document as doc

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from kincompile.report.formulas import Formula
    from kincompile.report.picture import Picture


class Renderer(ABC):
    """Prints sections line by line; a medium gives the methods below `run`."""

    def section(self, section: doc.Chapter, depth: int) -> Iterator[str]:
        """Yield the lines of a section and its parts; `depth` counts from 0."""
        yield from self.heading(section, depth)
        for block in section.blocks:
            yield from self.block(block)
        for inner in section.sections:
            yield from self.section(inner, depth + 1)

    def block(self, block: doc.Block) -> Iterable[str]:
        """Return the lines of a block; only notebooks have code."""
        match block:
            case doc.Text(runs):
                return self._paragraph(self.runs(runs))
            case doc.Display():
                return self._display(block)
            case doc.Table():
                return self._table(block)
            case doc.Pattern():
                return self._pattern(block)
            case doc.Figure(picture):
                return self._figure(picture)
            case doc.NotebookCode():
                return ()
        raise TypeError(f"cannot print {block!r}")

    def runs(self, runs: doc.Runs) -> str:
        """Return a text."""
        return "".join(map(self.run, runs))

    def run(self, run: doc.Run) -> str:
        """Return a piece of a text."""
        match run:
            case doc.Verbatim(text):
                return self._verbatim(text)
            case doc.Math(formula):
                return self._math(formula)
            case doc.CrossReference():
                return self._link(run)
            case doc.Box(is_wide):
                return self._box(is_wide)
        return self._prose(run)

    def _box(self, is_wide: bool) -> str:
        """Return a box to be filled by hand: a line, where a medium has no other."""
        return "_" * (22 if is_wide else 11)

    @abstractmethod
    def heading(self, section: doc.Chapter, depth: int) -> Iterator[str]:
        """Yield the title of a section."""

    @abstractmethod
    def _paragraph(self, text: str) -> Iterable[str]: ...

    @abstractmethod
    def _display(self, block: doc.Display) -> Iterator[str]: ...

    @abstractmethod
    def _table(self, table: doc.Table) -> Iterator[str]: ...

    @abstractmethod
    def _pattern(self, pattern: doc.Pattern) -> Iterator[str]: ...

    @abstractmethod
    def _figure(self, picture: Picture) -> Iterable[str]: ...

    @abstractmethod
    def _verbatim(self, text: str) -> str: ...

    @abstractmethod
    def _math(self, formula: Formula) -> str: ...

    @abstractmethod
    def _link(self, link: doc.CrossReference) -> str: ...

    @abstractmethod
    def _prose(self, text: str) -> str: ...

"""HTML for notebooks: tables, pages in a frame, plots, and pictures, which `view` draws."""

from __future__ import annotations

from base64 import b64encode
from functools import singledispatch
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, ClassVar

from kincompile.tables import indented, table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.figure import Figure

RESOLUTION = 100
"""Of plots [dots per inch]."""


@singledispatch
def picture_html(shown: object) -> str:
    """Return a picture of a value as HTML; "" where `view` is not loaded or has none."""
    del shown
    return ""


class Shown:
    """A value with a report: one line among others, the whole of it where it is printed or shown.

    A subclass has `to_text`, and `headline` where the first line of that is no title.
    """

    __slots__ = ()

    def to_text(self) -> str:
        """Return the report."""
        raise NotImplementedError

    def headline(self) -> str:
        """Return what a list of such values shows of this one."""
        return self.to_text().strip().partition("\n")[0].rstrip(".")

    def __repr__(self) -> str:
        """Return one line."""
        return f"<{type(self).__name__}: {self.headline()}>"

    def __str__(self) -> str:
        """Return the report."""
        return self.to_text()

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.to_text())}</pre>"


class Tabled(Shown):
    """A value whose report is a table, under its headline and with remarks below.

    A subclass says its rows and `name`, with which the headline begins.

    `header` has the titles of the columns, `numbers` those of numbers, aligned to the right.
    """

    __slots__ = ()

    header: ClassVar[tuple[str, ...]]
    numbers: ClassVar[tuple[str, ...]]

    def rows(self) -> list[tuple[str, ...]]:
        """Return the cells of the table as text."""
        raise NotImplementedError

    def remarks(self) -> list[str]:
        """Return the lines below the table."""
        return []

    def to_text(self) -> str:
        """Return the headline, the table and the remarks."""
        lines = table(self.header, self.rows(), self.numbers)
        return "\n".join([self.headline(), *indented(lines), *self.remarks()])

    def _repr_html_(self) -> str:
        name, _, title = self.headline().partition(": ")
        remarks = "".join(f"<p>{escape(line)}</p>" for line in self.remarks())
        return table_html(name, title, self.header, self.rows()) + remarks


def table_html(name: str, title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a name, a title and a table as HTML; all text is escaped."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows
    )
    return (
        f"<p><b>{escape(name)}</b>: {escape(title)}</p>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    )


def framed_html(page: str, title: str, height: str) -> str:
    """Return a page in a frame, so that its style sheet leaves the notebook alone.

    Parameters
    ----------
    page
        The whole page.
    title
        What the frame shows, for those who cannot see it.
    height
        With its unit, as in a style sheet.
    """
    return (
        f'<iframe srcdoc="{escape(page)}" title="{escape(title)}" '
        f'style="width: 100%; height: {height}; border: 0"></iframe>'
    )


def figure_html(title: str, size: tuple[float, float], draw: Callable[[Figure], object]) -> str:
    """Return a matplotlib figure as an image element that carries its own bytes.

    It is "" where matplotlib is not installed. `title` says what it shows, for those who cannot see
    it; `size` is width and height [inch]; `draw` draws into the empty figure, which pyplot does not
    know.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return ""
    figure = Figure(figsize=size, layout="constrained", dpi=RESOLUTION)
    draw(figure)
    buffer = BytesIO()
    figure.savefig(buffer, format="png")
    data = b64encode(buffer.getvalue()).decode("ascii")
    return f'<p><img alt="{escape(title)}" src="data:image/png;base64,{data}"/></p>'

"""A gallery: the pages of several mechanisms, and one that shows and links them all."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kincompile.errors import InputError
from kincompile.names import listed
from kincompile.targets.templates import fill, read
from kincompile.view.page_data import as_json
from kincompile.writing import write_atomically

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping

    from kincompile.view.page import Page

FRAMES = 120
"""Approximate number of points of a motion in the gallery."""

SCRIPTS = ("player.js", "draw.js", "gallery.js")
"""Scripts of the gallery, in order."""


@dataclass(frozen=True, slots=True)
class Gallery:
    """Pages that are ready to be written together.

    Attributes
    ----------
    pages
        The pages, in order; each is written to a file of its name.
    """

    pages: tuple[Page, ...]

    @property
    def html(self) -> str:
        """The page that shows every mechanism in motion, and links to its own page."""
        cards = [
            {
                "file": f"{item.name}.html",
                "name": escape(item.name),
                "sizes": _sizes(item.data),
                "data": as_json(_thinned(item.data)),
            }
            for item in self.pages
        ]
        slots = {
            "style": read("view/style.css") + read("view/gallery.css"),
            "scripts": [read(f"view/{name}") for name in SCRIPTS],
            "cards": cards,
        }
        return fill("view/gallery.html.jinja", slots)

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the pages and index.html to a folder, which is made, and return their paths.

        Raises
        ------
        InputError
            When a file cannot be written; says which and why.
        """
        path = Path(folder)
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"cannot make the folder {path}: {error.strerror}; name another one"
            ) from error
        written = [item.write(path / f"{item.name}.html") for item in self.pages]
        return [*written, write_atomically(path / "index.html", self.html)]


def gallery(pages: Iterable[Page]) -> Gallery:
    """Return a gallery of pages, to be written with a page that links them.

    Raises
    ------
    InputError
        If two pages have the same name, or a page has that of the gallery.
    """
    found = tuple(pages)
    names = ["index", *(item.name for item in found)]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            f"two pages would be written to {listed(f'{name}.html' for name in twice)}: give each "
            "mechanism a name of its own"
        )
    return Gallery(found)


def _sizes(data: Mapping[str, Any]) -> str:
    """Return the sizes of a mechanism in words."""
    bodies = len(data["drawing"]["bodies"])
    sizes = f"{len(data['coordinates'])} coordinates, {len(data['equations'])} equations"
    return f"{'1 body' if bodies == 1 else f'{bodies} bodies'}, {sizes}" if bodies else sizes


def _thinned(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of a page's data that a small moving picture needs."""
    step = -(-len(data["arrays"]["t"]) // FRAMES)
    arrays = {name: data["arrays"][name][::step] for name in ("t", "q", "q_dot", "q_ddot")}
    kept = ("coordinates", "guess", "drawing", "extent")
    return {**{name: data[name] for name in kept}, "arrays": arrays}

"""A gallery: the pages of several mechanisms, and one that shows and links them all."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.compiler import compile as compile_model
from kincompile.errors import InputError, KincompileWarning
from kincompile.model.mechanism import system_of
from kincompile.names import listed, title_of
from kincompile.report.templates import fill, read
from kincompile.runtime.singular.assemblies import assemblies
from kincompile.runtime.solve import solve
from kincompile.view.drawing import drawing
from kincompile.view.modules import WORLDS, joined, modules_of
from kincompile.view.page_data import as_json
from kincompile.view.worlds import dimension_of
from kincompile.writing import write_atomically

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping, Sequence
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.results.solution import Solution
    from kincompile.view.page import Page

FRAMES = 120
"""Approximate number of points of a motion in the gallery."""

DRAWS = "return { View, drawShapes, paletteNow };"
"""The part of the drawing scripts that the gallery uses."""


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
            _card(item.data, item.name, _sizes(item.data), f"{item.name}.html")
            for item in self.pages
        ]
        return _filled("Mechanisms", cards, {len(item.data["extent"]) // 2 for item in self.pages})

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


@dataclass(frozen=True, slots=True)
class AssemblyGallery:
    """The ways to assemble a mechanism on one page, ready to be written.

    Attributes
    ----------
    positions : ndarray, shape (k, n)
        The assemblies, in the order of `kc.assemblies`.
    html
        The whole page; it loads nothing else.
    """

    module: ModuleType
    positions: NDArray[np.float64]
    html: str

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the page to a file, in one step, and return its path."""
        return write_atomically(path, self.html)


def assembly_gallery(
    model: Mechanism | ConstraintSystem, t: float = 0.0, p: Mapping[str, float] | None = None
) -> AssemblyGallery:
    """Return a page that draws every assembly of a mechanism, and the motion from it.

    Parameters
    ----------
    model
        A mechanism, or a system of free equations.
    t
        The time of the assemblies; the motion from there lasts as long as that of the model.
    p
        Parameters by name; others have their defaults.

    Raises
    ------
    ModelError
        If the model cannot be used as written; every problem is listed.
    InputError
        If the time or parameters cannot be used.
    StructuralError
        If the equations cannot determine the coordinates.
    """
    system = system_of(model)
    module = compile_model(system)
    positions = assemblies(module, t, p)
    times = t + np.linspace(0, system.end, system.points)
    shown = []
    for k, guess in enumerate(positions, 1):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", KincompileWarning)  # each card says how it went
            solution = solve(module, times, p, guess)
        good = max(1, int(np.count_nonzero(solution.good)))
        last = "the end" if solution.success else f"t = {solution.t[good - 1]:g}"
        shown.append(Drawn(f"Assembly {k}", f"moves to {last}", system, solution, guess))
    title = f"Assemblies of {escape(system.name)} at t = {t:g}"
    return AssemblyGallery(module, positions, side_by_side(title, shown))


@dataclass(frozen=True, slots=True)
class Drawn:
    """A motion on a page of several: its name, what is written below it, where it is assembled."""

    name: str
    said: str
    system: ConstraintSystem
    solution: Solution
    assembly: NDArray[np.float64]


def side_by_side(title: str, shown: Sequence[Drawn]) -> str:
    """Return a page that draws motions side by side in one scale, each as far as it was found."""
    every = [_moving(item.system, item.solution, item.assembly) for item in shown]
    _in_one_frame(every)
    cards = [_card(data, x.name, x.said) for data, x in zip(every, shown, strict=True)]
    return _filled(title, cards, {dimension_of(item.system) for item in shown})


def _in_one_frame(shown: Sequence[dict[str, Any]]) -> None:
    """Let drawings side by side have one scale, and every place where it is in the others."""
    # Of each axis the least and the greatest, in turn.
    ends = zip(*(data["extent"] for data in shown), strict=True)
    frame = [(max if k % 2 else min)(values) for k, values in enumerate(ends)]
    for data in shown:
        data["extent"] = frame


def _moving(
    system: ConstraintSystem, solution: Solution, assembly: NDArray[np.float64]
) -> dict[str, Any]:
    """Return what a card shows: the points that were found, or the assembly alone without any."""
    good = max(1, int(np.count_nonzero(solution.good)))
    q = solution.q[:good].copy()
    if np.isnan(q[0]).any():
        q[0] = assembly
    rates = {name: np.nan_to_num(getattr(solution, name)[:good]) for name in ("q_dot", "q_ddot")}
    shapes = drawing(system, solution.parameters, q)
    return {
        "coordinates": [{"name": item.name, "unit": item.unit} for item in system.coordinates],
        "guess": [item.guess for item in system.coordinates],
        "drawing": shapes.to_json(),
        "extent": shapes.extent(q),
        "rest": 0.0,
        "arrays": {"t": solution.t[:good], "q": q, **rates},
    }


def _filled(title: str, cards: Sequence[Mapping[str, str]], dimensions: Iterable[int]) -> str:
    """Return a page of cards: of mechanisms in the plane (dimension 2), in space (3), or both."""
    worlds = ",\n".join(f"{dimension}: {_world(dimension)}" for dimension in sorted(dimensions))
    slots = {
        "title": title,
        "style": read("view/style.css") + read("view/gallery.css"),
        "scripts": [
            f"const worlds = {{\n{worlds} }};",
            joined(modules_of("gallery.js", dimension=2)),
        ],
        "cards": cards,
    }
    return fill("view/gallery.html.jinja", slots)


def _world(dimension: int) -> str:
    """Return the scripts that draw in the plane or in space, as a function of their own."""
    scripts = joined(["draw.js", WORLDS[dimension]])
    return f"(() => {{\n{scripts}\n{DRAWS}\n}})()"


def _card(data: Mapping[str, Any], name: str, sizes: str, file: str = "") -> dict[str, str]:
    """Return a card: its data, what is written on it, and the page it links to, if there is one."""
    return {
        "tag": "a" if file else "div",
        "link": f' href="{escape(file)}"' if file else "",
        "name": escape(title_of(name)),
        "sizes": sizes,
        "data": as_json(_thinned(data)),
    }


def _sizes(data: Mapping[str, Any]) -> str:
    bodies = len(data["drawing"]["bodies"])
    sizes = f"{len(data['coordinates'])} coordinates, {len(data['equations'])} equations"
    return f"{'1 body' if bodies == 1 else f'{bodies} bodies'}, {sizes}" if bodies else sizes


def _thinned(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of a page's data that a small moving picture needs."""
    step = -(-len(data["arrays"]["t"]) // FRAMES)
    arrays = {name: data["arrays"][name][::step] for name in ("t", "q", "q_dot", "q_ddot")}
    kept = ("coordinates", "guess", "drawing", "extent", "rest")
    return {**{name: data[name] for name in kept if name in data}, "arrays": arrays}

"""The page of a mechanism: one self-contained HTML file that moves, without a network."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.compiler import compile as compile_model
from kincompile.errors import InputError, StructuralError
from kincompile.html import framed_html
from kincompile.model.mechanism import system_of
from kincompile.report.templates import fill, read
from kincompile.runtime.results.columns import shown_unit
from kincompile.runtime.results.solution import Solution, require_solution
from kincompile.runtime.solve import solve
from kincompile.view.modules import joined, modules_of
from kincompile.view.page_data import as_json, page_data
from kincompile.view.page_scripts import (
    forces_script,
    geometry_script,
    solver_script,
    transmission_script,
)
from kincompile.view.worlds import dimension_of
from kincompile.writing import write_atomically

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence
    from types import ModuleType

    from numpy.typing import ArrayLike

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

STYLES = ("style.css", "newton.css", "live.css", "transmission.css")
"""Style sheets, in order."""

FRAME_HEIGHT = "720px"
"""Height of a page inside a notebook."""


@dataclass(frozen=True, slots=True)
class Page:
    """A page that is ready to be written.

    Attributes
    ----------
    html
        The whole page: data, style sheets and scripts. It loads nothing else.
    data
        The data it shows, as returned by `page_data`.
    """

    name: str
    html: str
    data: Mapping[str, Any]

    @property
    def success(self) -> bool:
        """Whether a position was found at every time."""
        return bool(self.data["success"])

    @property
    def message(self) -> str:
        """The message of the solver or of the compiler."""
        return str(self.data["message"])

    @property
    def doubt(self) -> str:
        """What the solver says of a start on another branch than is drawn; "" without a doubt."""
        return str(self.data["doubt"])

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the motion failed, as in a solution."""
        return tuple(self.data["reasons"])

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the page to a file, in one step, and return its path.

        Raises
        ------
        InputError
            When the name does not end in .html or .htm, or the file cannot be written.
        """
        return write_html(path, self.html)

    def _repr_html_(self) -> str:
        return framed_html(self.html, self.name, FRAME_HEIGHT)

    def __repr__(self) -> str:
        """Return the name and the size."""
        return f"<Page of {self.name!r}: {len(self.html) / 1e6:.2f} MB>"


def write_html(path: str | os.PathLike[str], html: str) -> Path:
    """Write a page to a file whose name says so, in one step, and return its path."""
    if Path(path).suffix not in (".html", ".htm"):
        raise InputError(f"cannot write {path}: end its name in .html")
    return write_atomically(path, html)


def page(
    model: Mechanism | ConstraintSystem,
    solution: Solution | None = None,
    *,
    t: ArrayLike | None = None,
    p: Mapping[str, float] | None = None,
    through: str | None = None,
    assembly: int | None = None,
    angle_unit: str = "rad",
    transmission: tuple[Sequence[str], Sequence[str]] | None = None,
) -> Page:
    """Return a page that shows a mechanism, its motion and its numbers.

    Parameters
    ----------
    model
        A mechanism, or a system of free equations, which has plots and no drawing.
    solution
        The motion to show, of one set of parameters; without, the model is compiled and solved.
        Where that is impossible the page shows the guess, what it violates, and says why.
    t : array_like, shape (N,), optional
        Times to solve for; without, those of the model.
    p
        Parameters to solve with, by name; others have their defaults.
    through : {"smooth"}, optional
        Go on past a bifurcation, as `kc.solve` does.
    assembly : int, optional
        Start in this one of the ways to assemble the mechanism, as `kc.solve` does.
    angle_unit : {"rad", "deg"}
        What the page shows angles in, until its reader chooses.
    transmission
        Names of inputs and of outputs, as `kc.transmission` takes them: the page has a panel that
        shows the mechanism as this function, and needs no motion.

    Raises
    ------
    ModelError
        If the model cannot be used as written; every problem is listed.
    InputError
        If times, parameters or the unit cannot be used, or the solution is of another model, or
        holds several variants, or inputs and outputs are no transmission.
    """
    shown_unit("rad", angle_unit)
    system = system_of(model)
    module = None
    if solution is None:
        module = compile_model(system)
        times = np.linspace(0, system.end, system.points) if t is None else t
        solution, message = _solved(module, times, p, through, assembly)
    else:
        _require_motion_of(system, solution)
        message = solution.message
    is_given = assembly is not None or module is None
    drawn = getattr(model, "drawn", None)
    shown = page_data(system, solution, message, starts_there=is_given, drawn=drawn)
    shown["angleUnit"] = angle_unit
    script, shown["transmission"] = transmission_script(system, transmission)
    if solution is None and shown["transmission"]:
        # A function needs no driver: that there is no motion is nothing to complain of.
        shown |= {"success": True, "message": ""}
    slots = {
        "title": escape(system.name),
        "style": "\n".join(read(f"view/{name}") for name in STYLES),
        "scripts": [
            solver_script(system),
            script,
            forces_script(system),
            geometry_script(system, shown["drawing"]),
            joined(modules_of("start.js", dimension_of(system))),
        ],
        "still": shown.pop("still"),
        "data": as_json(shown),
    }
    return Page(system.name, fill("view/page.html.jinja", slots), shown)


def _require_motion_of(system: ConstraintSystem, solution: Solution) -> None:
    """Check that a solution is one motion of this system."""
    require_solution(solution)
    if solution.coordinates != tuple(item.name for item in system.coordinates):
        raise InputError(
            f"this Solution is one of {solution.name}, whose coordinates are not those of "
            f"{system.name}: give the model that was solved"
        )
    if solution.q.ndim != 2:
        raise InputError(
            f"this Solution of {solution.name} holds {len(solution.q)} variants, and a page shows "
            "one motion: solve with the parameters of one of them"
        )


def _solved(
    module: ModuleType,
    t: ArrayLike,
    p: Mapping[str, float] | None,
    through: str | None,
    assembly: int | None,
) -> tuple[Solution | None, str]:
    """Solve a compiled system; return the solution, if there is one, and the message."""
    try:
        solution = solve(module, t, p, through=through, assembly=assembly)
    except StructuralError as error:
        return None, str(error)
    return solution, solution.message

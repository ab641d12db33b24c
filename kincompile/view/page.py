"""The page of a mechanism: one self-contained HTML file that moves, without a network."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from kincompile.compiler import compile as compile_model
from kincompile.emit.templates import fill, read
from kincompile.errors import StructuralError
from kincompile.runtime.solve import solve
from kincompile.view.newton import newton_script
from kincompile.view.page_data import page_json

if TYPE_CHECKING:
    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.solution import Solution

STYLES = ("vendor/uplot.css", "style.css", "newton.css")
"""Style sheets, in order."""

SCRIPTS = (
    "vendor/uplot.js", "player.js", "draw.js", "stage.js", "plots.js", "tables.js", "newton.js",
    "newton_tables.js", "newton_stage.js", "newton_panel.js", "start.js",
)  # fmt: skip
"""Scripts, in order: each uses those before it."""


def page(model: Mechanism | ConstraintSystem, solution: Solution | None = None) -> str:
    """Return a mechanism, its motion and its numbers as one HTML page.

    Parameters
    ----------
    model
        A mechanism, or a system of free equations, which has plots and no drawing.
    solution
        The motion to show, of one set of parameters; without, the model is compiled and solved over
        its own times. Where that is impossible the page shows the guess, and says why.

    Returns
    -------
    str
        HTML with everything in it: data, style sheets, scripts. It asks for nothing.

    Raises
    ------
    ModelError
        If the model cannot be used as written; every problem is listed.
    """
    system = model.system()
    message = "" if solution is None else solution.message
    if solution is None:
        solution, message = _solved(system)
    data = {
        "title": escape(system.name),
        "style": "\n".join(read(f"view/{name}") for name in STYLES),
        "licence": read("view/vendor/uplot.LICENSE.txt"),
        "scripts": [newton_script(system), *(read(f"view/{name}") for name in SCRIPTS)],
        "data": page_json(system, solution, message),
    }
    return fill("view/page.html.jinja", data)


def _solved(system: ConstraintSystem) -> tuple[Solution | None, str]:
    """Compile and solve a system over its own times, as far as that goes, and say how far."""
    try:
        module = compile_model(system)
    except StructuralError as error:
        return None, str(error)
    solution = solve(module, np.linspace(0, system.end, system.points))
    return solution, solution.message

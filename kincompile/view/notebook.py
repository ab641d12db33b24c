"""Pictures of a mechanism and of its motion in a notebook; importing this registers them.

A mechanism is drawn at its guess; a motion is played on its page, in a frame and without a server.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.html import figure_html, picture_html
from kincompile.model.system import ConstraintSystem, model_of
from kincompile.runtime.results.solution import Solution
from kincompile.view.drawing import drawing
from kincompile.view.mechanism_plot import axes_of, draw, position_of
from kincompile.view.page import page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_DRAWN = 300
"""Bodies up to which a mechanism is drawn: a second."""

MOST_PLAYED = 20_000
"""Numbers in q up to which a motion is played: a page of about a megabyte."""


@picture_html.register(ConstraintSystem)
def system_picture(system: ConstraintSystem) -> str:
    """Return an image of a mechanism at its guess; "" without bodies, or without matplotlib."""
    if not 0 < len(system.bodies) <= MOST_DRAWN:
        return ""

    def draw_guess(figure: Figure) -> None:
        drawn = drawing(system)
        ax = axes_of(figure, drawn)
        ax.set_title("start guess", fontsize="medium")
        draw(ax, system, drawn, position_of(system, None)[None])

    return figure_html(f"{system.name} at its start guess", (5.0, 3.6), draw_guess)


@picture_html.register(Solution)
def motion_picture(solution: Solution) -> str:
    """Return the player of a motion; "" where the model is not known, or the page too large."""
    system = model_of(solution.module)
    if system is None or solution.q.ndim != 2 or solution.q.size > MOST_PLAYED:
        return ""
    return page(system, solution)._repr_html_()

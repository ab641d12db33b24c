"""What draws in the plane and in space, as a table; a module is loaded when it is first needed."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.system import ConstraintSystem

PLANE, SPACE = 2, 3
"""Dimensions of points."""

DRAWN_BY: Mapping[str, Mapping[int, str]] = {
    "joints": {PLANE: "joint_shapes.DRAWINGS", SPACE: "solid_joints.DRAWINGS"},
    "looks": {PLANE: "shapes.tables", SPACE: "solid_shapes.solid_tables"},
    "picture": {PLANE: "picture.picture_in_plane", SPACE: "solid_picture.picture_in_space"},
    "SVG": {PLANE: "svg.svg_in_plane", SPACE: "solid_svg.svg_in_space"},
    "DXF": {PLANE: "dxf.add_strokes", SPACE: "dxf.add_solids"},
    "plot": {PLANE: "mechanism_plot.draw_in_plane", SPACE: "solid_plot.draw_in_space"},
}
"""By what is drawn: a module of this folder and its name for it, by the dimension."""

PROJECTIONS: Mapping[int, str | None] = {PLANE: None, SPACE: "3d"}
"""The projection of matplotlib's axes."""


def dimension_of(system: ConstraintSystem) -> int:
    """Return how many components a point of a system's bodies has; 2 without bodies."""
    return system.bodies[0].kind.frame.size if system.bodies else PLANE


def drawn_by(what: str, dimension: int) -> Any:
    """Return the function or the table that draws something in the plane or in space."""
    module, name = DRAWN_BY[what][dimension].split(".")
    return getattr(in_view(module), name)


def in_view(name: str) -> Any:
    """Return a module of this folder."""
    return import_module(f"kincompile.view.{name}")

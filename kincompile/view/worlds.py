"""What draws in the plane and in space; that of space is loaded when it is first needed."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from kincompile.view.joint_shapes import DRAWINGS
from kincompile.view.shapes import tables

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.constraint import Constraint
    from kincompile.model.system import ConstraintSystem
    from kincompile.view.joint_shapes import DrawJoint

PLANE, SPACE = 2, 3
"""Dimensions of points."""


def dimension_of(system: ConstraintSystem) -> int:
    """Return how many components a point of a system's bodies has; 2 without bodies."""
    return system.bodies[0].kind.frame.size if system.bodies else PLANE


def drawings_in(dimension: int) -> Mapping[type[Constraint], DrawJoint]:
    """Return the function that draws each type of constraint."""
    if dimension == PLANE:
        return DRAWINGS
    found: Mapping[type[Constraint], DrawJoint] = in_space("solid_joints").DRAWINGS
    return found


def in_space(name: str) -> Any:
    """Return a module that draws in space: solid_picture, solid_svg, solid_plot or gltf."""
    return import_module(f"kincompile.view.{name}")


def tables_in(dimension: int) -> dict[str, Any]:
    """Return what marks look like as plain data, for a page."""
    if dimension == PLANE:
        return tables()
    found: dict[str, Any] = in_space("solid_shapes").solid_tables()
    return found

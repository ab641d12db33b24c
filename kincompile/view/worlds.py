"""What draws in the plane and in space; that of space is loaded when it is first needed."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from kincompile.view.joint_shapes import DRAWINGS
from kincompile.view.shapes import tables

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import ModuleType

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
    found: Mapping[type[Constraint], DrawJoint] = import_module(
        "kincompile.view.solid_joints"
    ).DRAWINGS
    return found


def solid_pictures() -> ModuleType:
    """Return the module that draws still pictures in space."""
    return import_module("kincompile.view.solid_picture")


def solid_svgs() -> ModuleType:
    """Return the module that draws SVG in space."""
    return import_module("kincompile.view.solid_svg")


def solid_plots() -> ModuleType:
    """Return the module that draws in space by matplotlib."""
    return import_module("kincompile.view.solid_plot")


def motion_file() -> ModuleType:
    """Return the module that writes a motion in space as glTF."""
    return import_module("kincompile.view.gltf")


def tables_in(dimension: int) -> dict[str, Any]:
    """Return what marks look like as plain data, for a page."""
    if dimension == PLANE:
        return tables()
    found: dict[str, Any] = import_module("kincompile.view.solid_shapes").solid_tables()
    return found

"""The catalogue of spatial constraint types: the one place that lists them all."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.space.joints import (
    ConstantVelocity,
    Cylindrical,
    Fixed,
    InPlane,
    Parallel,
    Planar,
    PointOnLine,
    RelativeRotation,
    RelativeTranslation,
    Revolute,
    RevoluteCylindrical,
    RevoluteSpherical,
    Screw,
    Spherical,
    Translational,
    Universal,
)
from kincompile.space.primitives import (
    AbsoluteDistance,
    AbsoluteOrientation,
    AbsoluteX,
    AbsoluteY,
    AbsoluteZ,
    Distance,
    Dot1,
    Dot2,
    Normalization,
    RelativeX,
    RelativeY,
    RelativeZ,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.constraint import Constraint

__all__ = (  # noqa: RUF022 - in the order of the tables, simple ones first
    "Normalization", "Dot1", "Dot2", "AbsoluteX", "AbsoluteY", "AbsoluteZ", "AbsoluteDistance",
    "AbsoluteOrientation", "RelativeX", "RelativeY", "RelativeZ", "Distance", "Parallel",
    "PointOnLine", "InPlane", "Planar", "Spherical", "Revolute", "Cylindrical", "Translational",
    "Universal", "ConstantVelocity", "Screw", "Fixed", "RevoluteCylindrical", "RevoluteSpherical",
    "RelativeTranslation", "RelativeRotation",
)  # fmt: skip

CONSTRAINTS: Mapping[str, type[Constraint]] = {name: globals()[name] for name in __all__}
"""The types by name, in the order of the list above."""

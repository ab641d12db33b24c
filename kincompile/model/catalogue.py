"""The catalogue of constraint types: the one place that lists them all.

From this list come the public names, the types in model files and their JSON Schema, the tables in
the documentation, and the lists of the tests: of drawings, and of textbook oracles.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from kincompile.model.absolute import AbsoluteAngle, AbsoluteDistance, AbsoluteX, AbsoluteY
from kincompile.model.cams import CamFlatFollower, CamFollower, PointFollower
from kincompile.model.gears import Gear, RackAndPinion
from kincompile.model.joints import (
    Revolute,
    RevoluteTranslational,
    Translational,
    TranslationalDistance,
)
from kincompile.model.relative import Distance, RelativeAngle, RelativeX, RelativeY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.constraint import Constraint

__all__ = (  # noqa: RUF022 - in the order of the tables, simple ones first
    "AbsoluteX", "AbsoluteY", "AbsoluteAngle", "AbsoluteDistance", "RelativeX", "RelativeY",
    "RelativeAngle", "Distance", "Revolute", "Translational", "RevoluteTranslational",
    "TranslationalDistance", "Gear", "RackAndPinion", "CamFollower", "CamFlatFollower",
    "PointFollower",
)  # fmt: skip

CONSTRAINTS: Mapping[str, type[Constraint]] = {name: globals()[name] for name in __all__}
"""The types by name, in the order of the list above; the free `Equation` is not one of them."""


def meant_by(name: str) -> str:
    """Return "; did you mean 'Revolute', known as pin?" for a name of engineers, else nothing."""
    wanted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
    known = [
        (item, kind) for kind, type_ in CONSTRAINTS.items() for item in type_.known_as.split(", ")
    ]
    for item, kind in sorted(known, key=lambda pair: pair[0] != wanted):
        if re.match(rf"{re.escape(wanted)}\b", item):
            return f"; did you mean {kind!r}, known as {item}?"
    return ""

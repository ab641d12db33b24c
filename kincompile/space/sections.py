"""Tables of a file with ``space = 3`` that are others than in the plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from kincompile.model import declared as kind
from kincompile.model import sections as plane
from kincompile.model.declared import declared, given
from kincompile.space.bodies import INERTIA, Placed
from kincompile.space.limits import SpatialLimit
from kincompile.space.points import SpatialPoint

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_PLACE = kind.components(3, words="[x, y, z]")


@declared
class Drawing(plane.Drawing):
    """A drawing in space: hardpoints, and the links that join them."""

    ground: Mapping[str, Any] | None = given(
        kind.named(_PLACE), "Joints of the ground.", default=None, unit="length"
    )
    joints: Mapping[str, Any] | None = given(
        kind.named(_PLACE), "Joints, exactly.", default=None, unit="length"
    )
    hinges: Mapping[str, Any] | None = given(
        kind.named(_PLACE), "Axes of hinges that are drawn as one joint.", default=None
    )
    parts: Sequence[Any] = given(
        kind.tables("spatial_part"), "Links and others, in their order.", kw_only=True
    )


@declared
class Heavy(plane.Heavy):
    """What has a mass: about its centre, along the axes of the ground as it is drawn."""

    inertia: Any = given(
        INERTIA, "The inertia about the centre, as that of a body.", default=None, kw_only=True
    )
    centre: Any = given(_PLACE, "Its centre of mass.", unit="length", default=None, kw_only=True)


@declared
class Link(plane.Joined, Heavy):
    """A rigid link, as it is drawn."""

    density: Any = given(
        kind.EXPRESSION, "In place of its mass: that by volume.", default=None, kw_only=True
    )
    width: Any = given(
        kind.EXPRESSION, "That of a bar with a square section.", default=None, kw_only=True,
        unit="length",
    )  # fmt: skip


@declared
class Slider(Heavy, plane.Slider):
    """A body that slides along a straight guide without turning."""

    along: Any = given(
        kind.any_of(kind.TEXT, _PLACE)
        | {"description": "two joints in quotes, or a direction [x, y, z]"},
        'Its guide: two joints of one link, `"C D"`, or a direction.',
    )


@declared
class Rod:
    """Two joints at a distance: a rod with a ball at either end."""

    rod: str = given(kind.NAME, "Name of the constraint; a rod is no body.")
    joints: str = given(kind.TEXT, "The two joints, which links have already.")
    length: Any = given(
        kind.VALUE, "Its length; without, it is as drawn.", default=None, unit="length"
    )


TABLES: Mapping[str, type] = {
    "body": Placed, "point": SpatialPoint, "limit": SpatialLimit, "sketch": Drawing,
}  # fmt: skip
"""Tables that are others in the plane."""

PARTS: Mapping[str, type] = {
    "link": Link, "slider": Slider, "rod": Rod, "drive": plane.Driven, "point": plane.Point,
}  # fmt: skip
"""Parts of a drawing: methods of `spatial.Sketch`, and their arguments in order."""

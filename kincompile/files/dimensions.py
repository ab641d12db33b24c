"""What a model file speaks of in the plane and in space: bodies, their points, constraint types."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from kincompile.model.catalogue import CONSTRAINTS
from kincompile.model.mechanism import Mechanism

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.bodies import Body
    from kincompile.model.constraint import Constraint
    from kincompile.model.drawing import Drawing
    from kincompile.model.load import Load

PLANE, SPACE = 2, 3
"""Values of the key `space`."""


@dataclass(frozen=True, slots=True)
class Dimensions:
    """The words of a file in the plane, or in space."""

    mechanism: type[Mechanism]  # the builder, which has the kind of bodies and of points
    # The constraint types by name, but for the equations that bodies bring themselves.
    constraints: Mapping[str, type[Constraint]]

    @property
    def ground(self) -> Body:
        """The fixed frame."""
        return self.mechanism.fixed

    @property
    def place(self) -> str:
        """How a point of a body is written: ``[xi, eta]``."""
        return f"[{', '.join(self.ground.kind.axes)}]"

    @property
    def count(self) -> int:
        """Two in the plane, three in space."""
        return len(self.ground.kind.axes)

    def sketch(self) -> type[Drawing[Any]]:
        """Return what draws a mechanism, which only a model with a drawing needs."""
        if self.count == PLANE:
            from kincompile.model.sketch import Sketch

            return Sketch
        from kincompile.space.sketch import Sketch as InSpace

        return InSpace

    def loads(self) -> Mapping[str, type[Load]]:
        """Return the types of loads by name, which only a model that has any needs."""
        if self.count == PLANE:
            from kincompile.model.loads import LOADS

            return LOADS
        from kincompile.space.loads import LOADS as IN_SPACE

        return IN_SPACE


@cache
def dimensions(count: int) -> Dimensions:
    """Return the words of a file in the plane, or in space; a planar file loads no spatial code."""
    if count == PLANE:
        return Dimensions(Mechanism, CONSTRAINTS)
    from kincompile.space.catalogue import CONSTRAINTS as IN_SPACE
    from kincompile.space.mechanism import Mechanism as SpatialMechanism

    types = {name: item for name, item in IN_SPACE.items() if not item.is_own}
    return Dimensions(SpatialMechanism, types)

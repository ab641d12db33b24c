"""What a model file speaks of in the plane and in space: bodies, their points, constraint types."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.bodies import Body
    from kincompile.model.constraint import Constraint
    from kincompile.model.drawing import Drawing
    from kincompile.model.load import Load
    from kincompile.model.mechanism import Mechanism

PLANE, SPACE = 2, 3
"""Values of the key `space`."""

ROOMS = {PLANE: "model", SPACE: "space"}
"""The folder that has the builder, the types and the sketch of each."""


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
        found: type[Drawing[Any]] = _of("sketch", self.count).Sketch
        return found

    def tables(self) -> Mapping[str, type]:
        """Return the declared classes of tables that are others in the plane and in space."""
        found: Mapping[str, type] = _of("sections", self.count).TABLES
        return found

    def parts(self) -> Mapping[str, type]:
        """Return the parts of a drawing, as declared classes."""
        found: Mapping[str, type] = _of("sections", self.count).PARTS
        return found

    def loads(self) -> Mapping[str, type[Load]]:
        """Return the types of loads by name, which only a model that has any needs."""
        found: Mapping[str, type[Load]] = _of("loads", self.count).LOADS
        return found


@cache
def dimensions(count: int) -> Dimensions:
    """Return the words of a file in the plane, or in space; a planar file loads no spatial code."""
    known: Mapping[str, type[Constraint]] = _of("catalogue", count).CONSTRAINTS
    types = {name: item for name, item in known.items() if not item.is_own}
    return Dimensions(_of("mechanism", count).Mechanism, types)


def _of(module: str, count: int) -> Any:
    return import_module(f"kincompile.{ROOMS[count]}.{module}")

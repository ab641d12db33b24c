"""Bodies and points of a model file, in the plane and in space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy

from kincompile.files.file_format import fields_of
from kincompile.files.sketch_reader import SketchReader
from kincompile.model.bodies import GROUND, Body
from kincompile.names import listed, shown, suggestion

if TYPE_CHECKING:
    from kincompile.files.data_lines import Address
    from kincompile.files.data_text import Document
    from kincompile.model.points import BodyPoint

Row = dict[str, Any]


class BodyReader(SketchReader):
    """Reads bodies and points, by the names that are known so far."""

    def __init__(self, document: Document) -> None:
        super().__init__(document)
        self._taken: dict[tuple[str, str], Address] = {}

    def is_free(self, name: str, address: Address, kind: str = "symbol") -> bool:
        """Return whether a name is new among its kind, and take it."""
        if not name:
            return False
        other = self._taken.setdefault((kind, name), address)
        if other is not address:
            line = self.document.line(other)
            self.problem((*address, "name"), f"{name!r} is the name in line {line} already")
        return other is address

    def body(self, address: Address, row: Row) -> Body | None:
        """Return a body, or None if its name is invalid or already taken."""
        before, fields = len(self.problems), fields_of("body", self.words.count)
        self.has_fields(address, row, fields)
        name = self.name(row, address, "a body")
        given = self.values(row, fields, address, self.names)
        if len(self.problems) > before:  # nothing is said of what stands in its place
            given.clear()
        body = self.words.mechanism("").body(name, **given)
        if not name:
            return None
        if name == GROUND.name or name in self.bodies:
            other = self.bodies.get(name)
            whose = f"of the body in line {self.document.line(other)}" if other else "of the frame"
            self.problem((*address, "name"), f"{name!r} is the name {whose} already")
            return None
        self.bodies[name] = address
        for title in (f"body {name!r}", f"Mass {name!r}"):
            self.remember(title, address)
        turned = next((key for key in ("angle", "orientation") if key in row), "name")
        places = ("guess",) * 3 if "guess" in fields else (*("position",) * 3, *(turned,) * 4)
        for coordinate, place in zip(body.coordinates, places, strict=True):
            self.names[coordinate] = sympy.Symbol(coordinate)
            self.remember(f"guess of {coordinate}", (*address, place))
        self.spins |= {key: spin for key, spin, _ in body.on_request}
        self.remember(f"outline of {name}", (*address, "outline"))
        return body

    def point(self, address: Address, row: Row) -> BodyPoint | None:
        """Return a named point; its coordinates may occur in every formula."""
        fields = fields_of("point", self.words.count)
        complete = self.has_fields(address, row, fields)
        name = self.name(row, address, "a point")
        self.remember(f"point {name!r}", address)
        body = self.body_name(row.get("body", GROUND.name), (*address, "body"))
        given = self.values(row, fields, address, self.names, ("name", "body"))
        if not name or not self.is_free(name, address, "point") or not complete:
            return None
        ground = self.words.ground
        owner = ground if body == ground.name else type(ground)(body)
        local = given.get("local", (0,) * self.words.count)
        point = self.words.mechanism.point_type(name, owner, local)
        self.names |= dict(zip(point.output_names, point.coordinates, strict=True))
        return point

    def body_name(self, given: Any, address: Address) -> str:
        """Return the name of a body that there is."""
        if not isinstance(given, str):
            self.problem(address, f"expected the name of a body, not {shown(given)}")
        elif given not in self.bodies and given != GROUND.name:
            near = suggestion(given, self.bodies)
            known = listed((GROUND.name, *self.bodies))
            self.problem(address, f"there is no body {shown(given)}{near}; bodies are: {known}")
        return str(given)

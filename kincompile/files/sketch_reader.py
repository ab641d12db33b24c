"""The section `sketch` of a model file: a drawing as data, read into a `Sketch`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy

from kincompile.errors import ModelError
from kincompile.files.dimensions import PLANE, Dimensions, dimensions
from kincompile.files.file_fields import FieldReader
from kincompile.files.file_format import FIELDS, MOST_DRAWN, MOST_JOINTS, VALUE, fields_of, parts_of
from kincompile.model import motion
from kincompile.model.expressions import t
from kincompile.model.points import BodyPoint
from kincompile.names import listed, name_problem, shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.files.data_lines import Address
    from kincompile.files.data_text import Document
    from kincompile.model.bodies import Parameter
    from kincompile.model.declared import Field
    from kincompile.model.mechanism import Mechanism

Row = dict[str, Any]

PLACE: Address = ("sketch",)


class SketchReader(FieldReader):
    """Reads a drawing, and motions, by the names that are known so far."""

    def __init__(self, document: Document) -> None:
        super().__init__(document)
        self.names: dict[str, sympy.Expr] = {"t": t}
        self.bodies: dict[str, Address] = {}
        self.words: Dimensions = dimensions(PLANE)
        self.spins: dict[str, sympy.Expr] = {}

    def drawn(
        self, name: str, options: Row, parameters: Sequence[Parameter], given: Any
    ) -> Mechanism:
        """Return what a drawing makes; as far as it is good an empty mechanism."""
        sketch: Any = self.words.sketch()(name, **options)
        for item in parameters:
            sketch.parameter(item.name, item.default, item.unit, item.range)
        if not isinstance(given, dict):
            self.problem(PLACE, f"expected a table, not {shown(given)}")
            return self.words.mechanism(name)
        known = fields_of("sketch", self.words.count)
        self.has_fields(PLACE, given, known)
        for key, address, value in self._named(given, "lengths"):
            sketch.length(key, self.number(value, address))
            self.names[key] = sympy.Symbol(key)
            self.remember(f"parameter {key!r}", address)
        for section in (item for item in ("ground", "joints", "hinges") if item in known):
            for key, address, value in self._named(given, section):
                getattr(sketch, section)(**{key: self._place(value, address)})
                self.remember(f"{'hinge' if section == 'hinges' else 'joint'} {key!r}", address)
        self.remember("no link has the joint", (*PLACE, "joints"))
        for k, row in enumerate(self._within(given, "parts", [])):
            self._part(sketch, (*PLACE, "parts", k), row)
        try:
            mechanism: Mechanism = sketch.mechanism()
        except ModelError as error:
            self.problems += [self.located(problem) for problem in error.problems]
            return self.words.mechanism(name)
        for point in mechanism.outputs:
            if isinstance(point, BodyPoint):
                self.names |= dict(zip(point.output_names, point.coordinates, strict=True))
        return mechanism

    def _within(self, given: Row, section: str, kind: list[Any] | Row) -> Any:
        """Return a list or table of the drawing; empty if of another type or too long."""
        found = given.get(section, kind)
        address, what = (*PLACE, section), "list" if isinstance(kind, list) else "table"
        if not isinstance(found, type(kind)):
            self.problem(address, f"expected a {what}, not {shown(found)}")
        elif len(found) > MOST_DRAWN or len(self.names) > MOST_DRAWN:
            text = f"a drawing has at most {MOST_DRAWN:,} {section}, and as many parameters"
            self.problem(address, text)
        else:
            return found
        return kind

    def _named(self, given: Row, section: str) -> list[tuple[str, Address, Any]]:
        entries = []
        for key, value in self._within(given, section, {}).items():
            address = (*PLACE, section, key)
            problem = name_problem(key, "a parameter" if section == "lengths" else "a joint")
            if problem is None:
                entries.append((key, address, value))
            else:
                self.problem(address, problem)
        return entries

    def _place(self, value: Any, address: Address) -> tuple[Any, ...]:
        what = f"[{', '.join('xyz'[: self.words.count])}]"
        return tuple(self.expressions(value, address, self.names, what, self.words.count))

    def _part(self, sketch: Any, address: Address, row: Any) -> None:
        """Draw a part: a link, a wheel, a slider, a slot, a gear, a rod, a drive."""
        parts = parts_of(self.words.count)
        kind = next((kind for kind in parts if isinstance(row, dict) and kind in row), None)
        if kind is None:
            self.problem(address, f"expected a table with one of {listed(parts, 20)}")
            return
        fields, before = parts[kind], len(self.problems)
        # What else a link of the plane has are lengths and places, by the names of its joints.
        is_open = kind == "link" and "length" in fields
        self.has_fields(
            address, {key: row[key] for key in row if not is_open or key in fields}, fields
        )
        given = {
            key: self._value(value, (*address, key), fields.get(key)) for key, value in row.items()
        }
        if len(str(given.get("joints", "")).replace(",", " ").split()) > MOST_JOINTS:
            self.problem((*address, "joints"), f"a link has at most {MOST_JOINTS} joints")
        if kind not in ("slot", "drive") and (problem := name_problem(row[kind], f"a {kind}")):
            self.problem((*address, kind), problem)
        if len(self.problems) > before:
            return
        name = row[kind]
        self.remember(
            f"{kind} of {name!r}" if kind in ("slot", "drive") else f"{kind} {name!r}", address
        )
        if kind in ("link", "wheel", "slider"):
            self.bodies[name] = address
            self.remember(f"there is a link {name!r} already", address)
            body = type(self.words.ground)(name)
            for coordinate in body.coordinates:
                self.names[coordinate] = sympy.Symbol(coordinate)
                self.remember(f"guess of {coordinate}", address)
            self.spins |= {key: spin for key, spin, _ in body.on_request}
        arguments = [given.pop(key) for key in fields if key in given and key != "on"]
        getattr(sketch, kind)(*arguments, **given)

    def _value(self, value: Any, address: Address, field: Field | None) -> Any:
        """Return a text, a place, a motion or an expression: what the field wants."""
        schema = field.schema if field else {}
        is_line = address[-1] == "along"
        if schema.get("type") == "string" or (is_line and isinstance(value, str)):
            if not isinstance(value, str):
                self.problem(address, f"expected a text, not {shown(value)}")
            return value
        if is_line or (field is None and isinstance(value, list)):
            return self._place(value, address)
        return self.driven(value, address) if schema is VALUE else self._free(value, address)

    def _free(self, value: Any, address: Address) -> Any:
        return self.expression(value, address, self.names)

    def driven(self, given: Any, address: Address) -> Any:
        """Return the value of a driver: a formula, a sequence of motions, or a table over time."""
        if not isinstance(given, dict):
            return self._free(given, address)
        before = len(self.problems)
        kind = "table" if "times" in given or "values" in given else "sequence"
        if not self.has_fields(address, given, FIELDS[kind]):
            return 1.0
        columns: dict[str, Any] = {
            key: self._values(given[key], (*address, key), key)
            for key in ("points", "times", "values", "velocities")
            if key in given
        }
        if "ramp" in given:
            columns["ramp"] = self._free(given["ramp"], (*address, "ramp"))
        if "law" in given:
            columns["law"] = given["law"]
        over = self._free(given["over"], (*address, "over")) if "over" in given else t
        if len(self.problems) > before:
            return 1.0
        try:
            made = (motion.table if kind == "table" else motion.sequence)(**columns)
            return made.subs(t, over)
        except ModelError as error:
            for problem in error.problems:
                self.problem(address, problem)
            return 1.0

    def _values(self, given: Any, address: Address, key: str) -> Any:
        """Return a list of formulas, of points a list of pairs."""
        if not isinstance(given, list):
            self.problem(address, f"expected a list, not {shown(given)}")
            return []
        if key != "points":
            return self.expressions(given, address, self.names, "a list", len(given))
        return [
            self.expressions(point, (*address, k), self.names, "[time, value]", 2)
            for k, point in enumerate(given)
        ]

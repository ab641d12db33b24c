"""The section `sketch` of a model file: a drawing as data, read into a `Sketch`."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.errors import ModelError
from kincompile.files.dimensions import PLANE, Dimensions, dimensions
from kincompile.files.file_fields import FieldReader
from kincompile.files.file_format import (
    LENGTHS_AND_PLACES,
    MOST_DRAWN,
    MOST_JOINTS,
    fields_of,
)
from kincompile.model.declared import declared_fields
from kincompile.model.expressions import t
from kincompile.names import listed, name_problem, shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.files.data_lines import Address
    from kincompile.files.data_text import Document
    from kincompile.model.bodies import Parameter
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
        if not isinstance(given, dict):
            self.problem(PLACE, f"expected a table, not {shown(given)}")
            return self.words.mechanism(name)
        known = fields_of("sketch", self.words.count)
        self.has_fields(PLACE, given, known)
        live = given.get("live")
        if live is not None:
            live = self.value(live, known["live"].schema, (*PLACE, "live"))
        sketch: Any = self.words.sketch()(name, live=live, **options)
        for item in parameters:
            sketch.parameter(item.name, item.default, item.unit, item.range)
        for key, address, value in self._named(given, "lengths"):
            sketch.length(key, self.number(value, address))
            self.names[key] = sympy.Symbol(key)
            self.remember(f"parameter {key!r}", address)
        for section in (item for item in ("ground", "joints", "hinges") if item in known):
            for key, address, value in self._named(given, section):
                place = self.value(
                    value, known[section].schema["additionalProperties"], address, self.names
                )
                getattr(sketch, section)(**{key: place or (0,) * self.words.count})
                self.remember(f"{'hinge' if section == 'hinges' else 'joint'} {key!r}", address)
                for own in sketch.coordinates_of(key) if section != "hinges" else ():
                    self.names[own] = sympy.Symbol(own)
                    self.remember(f"parameter {own!r}", address)
        self.remember("no link has the joint", (*PLACE, "joints"))
        for k, row in enumerate(self._within(given, "parts", [])):
            self._part(sketch, (*PLACE, "parts", k), row)
        try:
            mechanism: Mechanism = sketch.mechanism()
        except ModelError as error:
            self.problems += [self.located(problem) for problem in error.problems]
            return self.words.mechanism(name)
        for point in mechanism.named_points().values():
            for key, coordinate in zip(point.output_names, point.coordinates, strict=True):
                self.names.setdefault(key, coordinate)
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

    def _part(self, sketch: Any, address: Address, row: Any) -> None:
        """Draw a part: a link, a wheel, a slider, a slot, a gear, a rod, a drive."""
        parts = self.words.parts()
        kind = next((kind for kind in parts if isinstance(row, dict) and kind in row), None)
        if kind is None:
            self.problem(address, f"expected a table with one of {listed(parts, 20)}")
            return
        known, before = declared_fields(parts[kind]), len(self.problems)
        # What else a link of the plane has are lengths and places, by the names of its joints.
        is_open = "length" in known and kind == "link"
        further = {key: row[key] for key in row if is_open and key not in known}
        own = {key: row[key] for key in row if key not in further}
        made = self.made(parts[kind], own, address, self.names)
        given = {
            key: self.value(x, LENGTHS_AND_PLACES, (*address, key), self.names)
            for key, x in further.items()
        }
        if len(str(row.get("joints", "")).replace(",", " ").split()) > MOST_JOINTS:
            self.problem((*address, "joints"), f"a link has at most {MOST_JOINTS} joints")
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
        said = [(item, x) for item in fields(made) if (x := getattr(made, item.name)) is not None]
        given |= {item.name: x for item, x in said if item.kw_only}
        getattr(sketch, kind)(*(x for item, x in said if not item.kw_only), **given)

"""The format of a model file, in one place: for the reader, the writer and the JSON Schema."""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import TYPE_CHECKING, Any

from kincompile.files.dimensions import PLANE, SPACE, dimensions
from kincompile.model import declared as kind
from kincompile.model import sections, tasks
from kincompile.model.arguments import Kind
from kincompile.model.bodies import Coordinate, Parameter
from kincompile.model.declared import Field, declared_fields
from kincompile.model.equation import Equation
from kincompile.model.outputs import Output
from kincompile.names import KILOGRAMS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from kincompile.model.constraint import Constraint
    from kincompile.model.load import Load

VERSION = 1
"""Version of the format, the value of the key `kincompile`."""
MOST_DRAWN, MOST_JOINTS = 300, 30
"""Largest number of joints, parts and parameters of a drawing, and of joints of one link."""


PLAIN_NUMBER = r"^\s*[+-]?(\d[\d_]*\.?[\d_]*|\.\d[\d_]*)([eE][+-]?\d+)?\s*$"
"""A number in quotes, which a constant may not be: it needs none."""


def _optional(schema: Mapping[str, Any]) -> Field:
    return Field(schema, is_required=False)


TASKS: Mapping[str, type] = {
    "sweep": tasks.Sweep, "tolerance": tasks.Tolerance, "fit": tasks.Fit,
    "transmission": tasks.Transmission,
}  # fmt: skip
"""Tables that commands of these names read; to a model they belong as data."""

DECLARED: Mapping[str, type] = {
    "analysis": sections.Analysis, "parameter": Parameter, **sections.TABLES,
    "coordinate": Coordinate, "output": Output, "profile": sections.Profile,
    "sequence": sections.MotionSteps, "table": sections.MotionRows, **TASKS,
    "span": tasks.Span, "deviation": tasks.Limits,
}  # fmt: skip
"""Tables that are declared classes, by their names in the schema; those of the plane."""

PREFIXES = {PLANE: "", SPACE: "spatial_"}
"""How the tables of a file begin in the schema, where those of plane and space differ."""


def fields_of(table: str, count: int = PLANE) -> Mapping[str, Field]:
    """Return the fields of a table of a file in the plane, or in space."""
    if table == "model":
        return _model(count)
    return declared_fields({**DECLARED, **dimensions(count).tables()}[table])


def _model(count: int) -> dict[str, Field]:
    """Return the fields of the file itself."""
    prefix = PREFIXES[count]
    own = {
        name: kind.tables(prefix + name)
        for name in ("body", "constraint", "limit", "load", "point")
    }
    return {
        "$schema": _optional(kind.TEXT),
        "kincompile": Field({"const": VERSION}),
        "space": Field({"const": SPACE}) if prefix else _optional({"enum": [PLANE, SPACE]}),
        "name": Field(kind.NAME),
        "length_unit": _optional(kind.UNIT),
        "mass_unit": _optional(kind.one_of(KILOGRAMS)),
        "analysis": _optional(kind.ref("analysis")),
        "parameters": _optional(kind.tables("parameter")),
        "bodies": _optional(own["body"]),
        "coordinates": _optional(kind.tables("coordinate")),
        "sketch": _optional(kind.ref(f"{prefix}sketch")),
        "constraints": _optional(own["constraint"]),
        "limits": _optional(own["limit"]),
        "outline": fields_of("body", count)["outline"],
        "gravity": _optional(kind.components(count, words=f"[{', '.join('xyz'[:count])}]")),
        "loads": _optional(own["load"]),
        "points": _optional(own["point"]),
        "outputs": _optional(kind.tables("output")),
        **{name: _optional(kind.ref(name)) for name in TASKS},
    }


_KINDS: Mapping[Kind, Mapping[str, Any]] = {
    Kind.VALUE: kind.VALUE,
    Kind.LOAD: kind.VALUE,
    Kind.DISTANCE: kind.VALUE,
    Kind.BODY: kind.NAME,
    Kind.PROFILE: kind.any_of(kind.EXPRESSION, kind.ref("profile"))
    | {"description": "a number, a formula in alpha, or a table of angles and radii"},
}


def argument_schema(item: Kind, axes: tuple[str, ...]) -> Mapping[str, Any]:
    """Return the schema of an argument, whose points have components along these axes."""
    if item in (Kind.POINT, Kind.AXIS):
        words = f"[{', '.join(axes)}]"
        place = kind.components(len(axes), words=words)
        named = {"description": f"{words}, or the name of a drawn joint"}
        return place if item is Kind.AXIS else kind.any_of(kind.NAME, place) | named
    if item is Kind.LOADS:
        words = ", ".join(f"F_{axis}" for axis in "xyz"[: len(axes)])
        return kind.components(len(axes), kind.VALUE, words=f"[{words}]")
    return _KINDS.get(item, kind.EXPRESSION)


def constraint_fields(constraint: type[Constraint]) -> dict[str, Field]:
    """Return the fields of a constraint type: its arguments, and what drivers and cams have."""
    found = {"type": Field({"const": constraint.__name__}), "name": Field(kind.NAME)}
    for name, item in constraint.arguments().items():
        found[name] = Field(argument_schema(item.kind, constraint.bodies.axes))
    if any(item.symbol == "C" for item in constraint.arguments().values()):
        found |= declared_fields(constraint)
    if count := len(constraint.contacts):
        words = {"description": f"{count} start values"}
        guesses = kind.array(kind.EXPRESSION, count) | words
        found["guess"] = _optional(kind.any_of(kind.EXPRESSION, guesses) | words)
    return found


def equation_fields() -> dict[str, Field]:
    """Return the fields of a free equation among the constraints."""
    return {"type": Field({"const": Equation.__name__}), **declared_fields(Equation)}


def load_fields(load: type[Load]) -> dict[str, Field]:
    """Return the fields of a type of load: its arguments, those with a default left out or not."""
    given = {item.name: item for item in fields(load)}
    found = {"type": Field({"const": load.__name__}), "name": Field(kind.NAME)}
    for name, item in load.arguments().items():
        schema = argument_schema(item.kind, load.bodies.axes)
        found[name] = Field(schema, is_required=given[name].default is MISSING)
    return found


def model_schema() -> dict[str, Any]:
    """Return the JSON Schema of a model file.

    Whether a formula can be read and a body exists is checked by `kincompile inspect`.
    """
    tables = {name: object_schema(declared_fields(cls)) for name, cls in DECLARED.items()}
    for count, prefix in PREFIXES.items():
        words = dimensions(count)
        tables |= {
            prefix + x: object_schema(declared_fields(cls)) for x, cls in words.tables().items()
        }
        types = [constraint_fields(item) for item in words.constraints.values()]
        tables[f"{prefix}constraint"] = _one_of([*types, equation_fields()])
        tables[f"{prefix}load"] = _one_of(map(load_fields, words.loads().values()))
        tables[f"{prefix}part"] = _one_of(map(declared_fields, words.parts().values()))
    # Lengths and places of a link are called as its joints are.
    tables["part"]["oneOf"][0]["additionalProperties"] = LENGTHS_AND_PLACES
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"Mechanism for kincompile, format {VERSION}",
        "type": "object",
        "if": {"properties": {"space": {"const": SPACE}}, "required": ["space"]},
        "then": kind.ref("in_space"),
        "else": kind.ref("in_the_plane"),
        "$defs": {
            "in_the_plane": object_schema(fields_of("model", PLANE)),
            "in_space": object_schema(fields_of("model", SPACE)),
            "expression": {
                "description": "a number, or a formula such as -a/2 + sin(omega*t)",
                "type": ["number", "string"],
            },
            "constant": {
                "description": "a number without quotes, or a formula such as 30*deg",
                "type": ["number", "string"],
                "not": {"type": "string", "pattern": PLAIN_NUMBER},
            },
            **tables,
            "target": _one_of(map(declared_fields, tasks.TARGETS.values())),
        },
    }


LENGTHS_AND_PLACES = kind.any_of(kind.EXPRESSION, kind.components(2, words="[xi, eta]")) | {
    "description": "a length, or a place [xi, eta]"
}
"""What else a link of the plane has, by the names of its joints."""


def _one_of(tables: Iterable[Mapping[str, Field]]) -> dict[str, Any]:
    return {"oneOf": list(map(object_schema, tables))}


def object_schema(fields: Mapping[str, Field]) -> dict[str, Any]:
    """Return the schema of a table with these fields."""
    return {
        "type": "object",
        "properties": {
            name: {**({"description": item.words} if item.words else {}), **item.schema}
            for name, item in fields.items()
        },
        "required": [name for name, item in fields.items() if item.is_required],
        "additionalProperties": False,
    }

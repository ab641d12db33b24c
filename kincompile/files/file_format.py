"""The format of a model file, in one place: for the reader, the writer and the JSON Schema."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, fields
from typing import TYPE_CHECKING, Any

from kincompile.files.dimensions import PLANE, SPACE, dimensions
from kincompile.model.arguments import Kind
from kincompile.model.laws import RISES
from kincompile.names import MOST_CHARACTERS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.constraint import Constraint
    from kincompile.model.load import Load

VERSION = 1
"""Version of the format, the value of the key `kincompile`."""
MOST_POINTS = 10_000_000
"""Largest time grid that a file may ask for."""
MOST_VARIANTS = 10_000_000
"""Largest number of values of all parameters together that a file may ask for."""
MOST_DRAWN, MOST_JOINTS = 300, 30
"""Largest number of joints, parts and parameters of a drawing, and of joints of one link."""
SMOOTHNESS = 4
"""Continuous derivatives of a profile given by a table: it is a periodic quintic spline."""


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a table."""

    schema: Mapping[str, Any]
    is_required: bool = True


_TEXT: dict[str, Any] = {"type": "string"}
_NAME: dict[str, Any] = {
    "type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]*$", "maxLength": MOST_CHARACTERS,
}  # fmt: skip
_NUMBER: dict[str, Any] = {"type": "number"}
_EXPRESSION: dict[str, Any] = {"$ref": "#/$defs/expression"}


def _components(count: int) -> dict[str, Any]:
    """Return the schema of so many numbers or formulas."""
    return {"type": "array", "items": _EXPRESSION, "minItems": count, "maxItems": count}


_POINT = _components(2)
_TRIPLE = _components(3)
_NUMBERS: dict[str, Any] = {"type": "array", "items": _NUMBER, "minItems": 6}
_VALUES: dict[str, Any] = {"type": "array", "items": _EXPRESSION, "minItems": 3}
_NAMES: dict[str, Any] = {"type": "array", "items": _TEXT}
_VARIANTS: dict[str, Any] = {"type": "integer", "minimum": 1, "maximum": MOST_VARIANTS}
_LAW: dict[str, Any] = {"enum": list(RISES)}
_CORNERS: dict[str, Any] = {"type": "boolean"}


_SEED: dict[str, Any] = {"type": "integer", "minimum": 0}

DISTRIBUTIONS = ("normal", "uniform", "truncated")
SEARCHES = ("sobol", "differential evolution")
MINIMIZERS = ("SLSQP", "trust-constr")
"""What tolerances may be distributed by, and how a fit may search and end."""

TASKS = ("tolerance", "fit", "sweep")
"""Tables that commands of these names read; to a model they belong as data."""


def _list(name: str) -> dict[str, Any]:
    return {"type": "array", "items": {"$ref": f"#/$defs/{name}"}}


FIELDS: Mapping[str, Mapping[str, Field]] = {
    "model": {
        "$schema": Field(_TEXT, is_required=False),
        "kincompile": Field({"const": VERSION}),
        "space": Field({"enum": [PLANE, SPACE]}, is_required=False),
        "name": Field(_NAME),
        "length_unit": Field(_TEXT, is_required=False),
        "analysis": Field({"$ref": "#/$defs/analysis"}, is_required=False),
        "parameters": Field(_list("parameter"), is_required=False),
        "bodies": Field(_list("body"), is_required=False),
        "coordinates": Field(_list("coordinate"), is_required=False),
        "sketch": Field({"$ref": "#/$defs/sketch"}, is_required=False),
        "constraints": Field(_list("constraint"), is_required=False),
        "gravity": Field(_POINT, is_required=False),
        "loads": Field(_list("load"), is_required=False),
        "points": Field(_list("point"), is_required=False),
        "outputs": Field(_list("output"), is_required=False),
        "sweep": Field({"$ref": "#/$defs/sweep"}, is_required=False),
        "tolerance": Field({"$ref": "#/$defs/tolerance"}, is_required=False),
        "fit": Field({"$ref": "#/$defs/fit"}, is_required=False),
    },
    "tolerance": {
        "of": Field(_NAMES, is_required=False),
        "parameters": Field(
            {
                "type": "object",
                "additionalProperties": {
                    "anyOf": [_EXPRESSION, _POINT, {"$ref": "#/$defs/deviation"}]
                },
            },
            is_required=False,
        ),
        "clearances": Field(
            {"type": "object", "additionalProperties": _EXPRESSION}, is_required=False
        ),
        "samples": Field(_VARIANTS, is_required=False),
        "seed": Field(_SEED, is_required=False),
    },
    "deviation": {
        "low": Field(_EXPRESSION),
        "high": Field(_EXPRESSION),
        "distribution": Field({"enum": list(DISTRIBUTIONS)}, is_required=False),
        "sigmas": Field(_EXPRESSION, is_required=False),
    },
    "fit": {
        "parameters": Field({"type": "object", "additionalProperties": _POINT}),
        "targets": Field(_list("target")),
        "samples": Field(_VARIANTS, is_required=False),
        "starts": Field(_VARIANTS, is_required=False),
        "search": Field({"enum": list(SEARCHES)}, is_required=False),
        "minimizer": Field({"enum": list(MINIMIZERS)}, is_required=False),
        "seed": Field(_SEED, is_required=False),
    },
    "sweep": {
        "parameters": Field(
            {
                "type": "object",
                "additionalProperties": {
                    "anyOf": [
                        {"type": "array", "items": _EXPRESSION, "minItems": 1},
                        {"$ref": "#/$defs/span"},
                    ]
                },
            }
        ),
        "samples": Field(_VARIANTS, is_required=False),
        "product": Field({"type": "boolean"}, is_required=False),
        "columns": Field(_NAMES, is_required=False),
        "measures": Field(_NAMES, is_required=False),
    },
    "span": {
        "from": Field(_EXPRESSION),
        "to": Field(_EXPRESSION),
        "count": Field(_VARIANTS, is_required=False),
    },
    "sketch": {
        "lengths": Field({"type": "object", "additionalProperties": _NUMBER}, is_required=False),
        "ground": Field({"type": "object", "additionalProperties": _POINT}, is_required=False),
        "joints": Field({"type": "object", "additionalProperties": _POINT}, is_required=False),
        "parts": Field(_list("part")),
    },
    "analysis": {
        "end": Field(_EXPRESSION, is_required=False),
        "points": Field(
            {"type": "integer", "minimum": 1, "maximum": MOST_POINTS}, is_required=False
        ),
    },
    "parameter": {
        "name": Field(_NAME),
        "default": Field(_EXPRESSION),
        "unit": Field(_TEXT, is_required=False),
        "range": Field(_POINT, is_required=False),
    },
    "body": {
        "name": Field(_NAME),
        "guess": Field(_TRIPLE, is_required=False),
        "outline": Field({"type": "array", "items": _POINT, "minItems": 3}, is_required=False),
        "mass": Field(_EXPRESSION, is_required=False),
        "inertia": Field(_EXPRESSION, is_required=False),
        "centre": Field(_POINT, is_required=False),
        "density": Field(_EXPRESSION, is_required=False),
        "thickness": Field(_EXPRESSION, is_required=False),
    },
    "point": {"name": Field(_NAME), "body": Field(_NAME), "local": Field(_POINT)},
    "output": {
        "name": Field(_NAME),
        "expression": Field(_EXPRESSION),
        "unit": Field(_TEXT, is_required=False),
    },
    "coordinate": {"name": Field(_NAME), "guess": Field(_EXPRESSION, is_required=False)},
    "profile": {
        "angles": Field(_NUMBERS),
        "radii": Field(_NUMBERS),
        "smoothness": Field({"const": SMOOTHNESS}),
    },
    "sequence": {
        "points": Field({"type": "array", "items": _POINT, "minItems": 2}),
        "law": Field({"anyOf": [_LAW, {"type": "array", "items": _LAW}]}, is_required=False),
        "ramp": Field(_EXPRESSION, is_required=False),
    },
    "table": {
        "times": Field(_VALUES),
        "values": Field(_VALUES),
        "velocities": Field({**_POINT}, is_required=False),
        "over": Field(_EXPRESSION, is_required=False),
    },
    "Equation": {
        "type": Field({"const": "Equation"}),
        "name": Field(_NAME),
        "expressions": Field({"type": "array", "items": _EXPRESSION, "minItems": 1}),
        "corners": Field(_CORNERS, is_required=False),
    },
}
"""Fields of the file itself, of its tables, and of a free equation."""

IN_SPACE: Mapping[str, Mapping[str, Field]] = {
    "model": {
        **FIELDS["model"],
        "space": Field({"const": SPACE}),
        "sketch": Field({"$ref": "#/$defs/spatial_sketch"}, is_required=False),
        "bodies": Field(_list("spatial_body"), is_required=False),
        "constraints": Field(_list("spatial_constraint"), is_required=False),
        "points": Field(_list("spatial_point"), is_required=False),
        "gravity": Field(_TRIPLE, is_required=False),
        "loads": Field(_list("spatial_load"), is_required=False),
    },
    "body": {
        "name": Field(_NAME),
        "position": Field(_TRIPLE, is_required=False),
        "orientation": Field(
            {"anyOf": [_components(4), {**_TRIPLE, "items": _TRIPLE}]}, is_required=False
        ),
        **{key: Field(_TRIPLE, is_required=False) for key in ("axis", "x", "y", "z")},
        "angle": Field(_EXPRESSION, is_required=False),
        "mass": Field(_EXPRESSION, is_required=False),
        "inertia": Field({"anyOf": [_TRIPLE, {**_TRIPLE, "items": _TRIPLE}]}, is_required=False),
        "centre": Field(_TRIPLE, is_required=False),
    },
    "point": {**FIELDS["point"], "local": Field(_TRIPLE)},
    "sketch": {
        **FIELDS["sketch"],
        **{
            name: Field({"type": "object", "additionalProperties": _TRIPLE}, is_required=False)
            for name in ("ground", "joints", "hinges")
        },
        "parts": Field(_list("spatial_part")),
    },
}
"""Fields of what is different in a file with ``space = 3``."""


def fields_of(table: str, count: int = PLANE) -> Mapping[str, Field]:
    """Return the fields of a table of a file in the plane, or in space."""
    return IN_SPACE.get(table, FIELDS[table]) if count == SPACE else FIELDS[table]


_MOTIONS = [{"$ref": "#/$defs/sequence"}, {"$ref": "#/$defs/table"}]
VALUE: dict[str, Any] = {"anyOf": [_EXPRESSION, *_MOTIONS]}


def _line(place: Mapping[str, Any]) -> dict[str, Field]:
    """Return the fields of a guide, through two joints or along a direction, and of its link."""
    along = Field({"anyOf": [_TEXT, place]})
    return {"along": along, "on": Field(_NAME, is_required=False)}


_WEIGHT: Mapping[str, Field] = {"weight": Field(_EXPRESSION, is_required=False)}
_PASSING: Mapping[str, Field] = {
    "times": Field({"type": "array", "items": _EXPRESSION}, is_required=False),
    **_WEIGHT,
    "within": Field(_EXPRESSION, is_required=False),
    "between": Field(_POINT, is_required=False),
}
_ROWS: dict[str, Any] = {"type": "array", "items": {"type": "array", "items": _EXPRESSION}}

TARGETS: Mapping[str, Mapping[str, Field]] = {
    "path": {"path": Field(_TEXT), "points": Field(_ROWS), **_PASSING},
    "value": {
        "value": Field(_TEXT), "values": Field({"type": "array", "items": _EXPRESSION}), **_PASSING,
    },
    "pose": {
        "pose": Field(_TEXT), "poses": Field(_ROWS),
        "angle_weight": Field(_EXPRESSION, is_required=False), **_PASSING,
    },
    "time_ratio": {
        "time_ratio": Field(_TEXT), "ratio": Field(_EXPRESSION), **_WEIGHT,
        "within": Field(_EXPRESSION, is_required=False),
    },
    "limit": {
        "limit": Field(_TEXT),
        "least": Field(_EXPRESSION, is_required=False),
        "most": Field(_EXPRESSION, is_required=False),
        "title": Field(_TEXT, is_required=False),
    },
    "moves": {"moves": Field({"const": True})},
}  # fmt: skip
"""Targets of a fit: the functions of `kc.targets`, and their arguments."""

PARTS: Mapping[str, Mapping[str, Field]] = {
    "link": {
        "link": Field(_NAME),
        "joints": Field(_TEXT),
        "length": Field(_EXPRESSION, is_required=False),
    },
    "wheel": {"wheel": Field(_NAME), "joint": Field(_NAME)},
    "slider": {"slider": Field(_NAME), "joints": Field(_TEXT), **_line(_POINT)},
    "slot": {"slot": Field(_NAME), **_line(_POINT)},
    "gear": {
        "gear": Field(_NAME),
        "i": Field(_NAME), "centre_i": Field(_NAME), "radius_i": Field(_EXPRESSION),
        "j": Field(_NAME), "centre_j": Field(_NAME), "radius_j": Field(_EXPRESSION),
    },
    "drive": {
        "drive": Field(_TEXT),
        "value": Field(VALUE),
        "against": Field(_NAME, is_required=False),
    },
}  # fmt: skip
"""Parts of a drawing: the methods of `Sketch`, and their arguments in order."""

SPATIAL_PARTS: Mapping[str, Mapping[str, Field]] = {
    "link": {"link": Field(_NAME), "joints": Field(_TEXT)},
    "slider": {"slider": Field(_NAME), "joints": Field(_TEXT), **_line(_TRIPLE)},
    "rod": {
        "rod": Field(_NAME), "joints": Field(_TEXT), "length": Field(VALUE, is_required=False),
    },
    "drive": {"drive": Field(_TEXT), "value": Field(VALUE)},
}  # fmt: skip
"""Those of `spatial.Sketch`."""


def parts_of(count: int) -> Mapping[str, Mapping[str, Field]]:
    """Return the parts of a drawing in the plane, or in space."""
    return SPATIAL_PARTS if count == SPACE else PARTS


_KINDS: Mapping[Kind, Mapping[str, Any]] = {
    Kind.VALUE: VALUE,
    Kind.LOAD: VALUE,
    Kind.DISTANCE: VALUE,
    Kind.BODY: _NAME,
    Kind.PROFILE: {"anyOf": [_EXPRESSION, {"$ref": "#/$defs/profile"}]},
}


def _kind(kind: Kind, count: int) -> Mapping[str, Any]:
    """Return the schema of an argument, whose points have so many components."""
    if kind in (Kind.POINT, Kind.AXIS):
        return _components(count)
    if kind is Kind.LOADS:
        return {"type": "array", "items": VALUE, "minItems": count, "maxItems": count}
    return _KINDS.get(kind, _EXPRESSION)


def constraint_fields(constraint: type[Constraint]) -> dict[str, Field]:
    """Return the fields of a constraint type: its arguments, and what drivers and cams have."""
    found = {"type": Field({"const": constraint.__name__}), "name": Field(_NAME)}
    for name, item in constraint.arguments().items():
        found[name] = Field(_kind(item.kind, len(constraint.bodies.axes)))
    if any(item.symbol == "C" for item in constraint.arguments().values()):
        found["corners"] = Field(_CORNERS, is_required=False)
    if constraint.contacts:
        guesses = {"type": "array", "items": _EXPRESSION, "minItems": len(constraint.contacts)}
        found["guess"] = Field({"anyOf": [_EXPRESSION, guesses]}, is_required=False)
    return found


def load_fields(load: type[Load]) -> dict[str, Field]:
    """Return the fields of a type of load: its arguments, those with a default left out or not."""
    given = {item.name: item for item in fields(load)}
    found = {"type": Field({"const": load.__name__}), "name": Field(_NAME)}
    for name, item in load.arguments().items():
        schema = _kind(item.kind, len(load.bodies.axes))
        found[name] = Field(schema, is_required=given[name].default is MISSING)
    return found


def model_schema() -> dict[str, Any]:
    """Return the JSON Schema of a model file.

    Whether a formula can be read and a body exists is checked by `kincompile inspect`.
    """
    tables = {name: _object(FIELDS[name]) for name in FIELDS if name not in ("model", "Equation")}
    in_space = {f"spatial_{name}": _object(IN_SPACE[name]) for name in IN_SPACE if name != "model"}
    parts = [_object(item) for item in PARTS.values()]
    # Lengths and places of a link are called as its joints are.
    parts[0]["additionalProperties"] = {"anyOf": [_EXPRESSION, _POINT]}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"Mechanism for kincompile, format {VERSION}",
        "type": "object",
        "if": {"properties": {"space": {"const": SPACE}}, "required": ["space"]},
        "then": {"$ref": "#/$defs/in_space"},
        "else": {"$ref": "#/$defs/in_the_plane"},
        "$defs": {
            "in_the_plane": _object(FIELDS["model"]),
            "in_space": _object(IN_SPACE["model"]),
            "expression": {
                "description": "a number, or a formula such as -a/2 + sin(omega*t)",
                "type": ["number", "string"],
            },
            **tables,
            **in_space,
            "part": {"oneOf": parts},
            "spatial_part": {"oneOf": [_object(item) for item in SPATIAL_PARTS.values()]},
            "target": {"oneOf": [_object(item) for item in TARGETS.values()]},
            "constraint": {"oneOf": _constraints(PLANE)},
            "spatial_constraint": {"oneOf": _constraints(SPACE)},
            "load": {"oneOf": _loads(PLANE)},
            "spatial_load": {"oneOf": _loads(SPACE)},
        },
    }


def _loads(count: int) -> list[dict[str, Any]]:
    return [_object(load_fields(item)) for item in dimensions(count).loads().values()]


def _constraints(count: int) -> list[dict[str, Any]]:
    kinds = dimensions(count).constraints.values()
    return [*(_object(constraint_fields(item)) for item in kinds), _object(FIELDS["Equation"])]


def _object(fields: Mapping[str, Field]) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": {name: item.schema for name, item in fields.items()},
        "required": [name for name, item in fields.items() if item.is_required],
        "additionalProperties": False,
    }

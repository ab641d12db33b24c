"""The format of a model file, in one place: for the reader, the writer and the JSON Schema."""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import TYPE_CHECKING, Any

from kincompile.files.dimensions import PLANE, SPACE, dimensions
from kincompile.model import declared as kind
from kincompile.model import tasks
from kincompile.model.arguments import Kind
from kincompile.model.bodies import Body, Coordinate, Parameter
from kincompile.model.declared import Field, declared_fields
from kincompile.model.laws import RISES
from kincompile.model.outputs import Output
from kincompile.model.points import BodyPoint

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.constraint import Constraint
    from kincompile.model.load import Load

VERSION = 1
"""Version of the format, the value of the key `kincompile`."""
MOST_POINTS = 10_000_000
"""Largest time grid that a file may ask for."""
MOST_DRAWN, MOST_JOINTS = 300, 30
"""Largest number of joints, parts and parameters of a drawing, and of joints of one link."""
SMOOTHNESS = 4
"""Continuous derivatives of a profile given by a table: it is a periodic quintic spline."""


PLAIN_NUMBER = r"^\s*[+-]?(\d[\d_]*\.?[\d_]*|\.\d[\d_]*)([eE][+-]?\d+)?\s*$"
"""A number in quotes, which a constant may not be: it needs none."""


def _optional(schema: Mapping[str, Any]) -> Field:
    return Field(schema, is_required=False)


_POINT, _TRIPLE = kind.components(2), kind.components(3)
_LOCAL = kind.components(3, words="[xi, eta, zeta]")
_PLACE = kind.components(3, words="[x, y, z]")
_MATRIX = kind.components(3, kind.components(3, words="[., ., .]"))
_NUMBERS: dict[str, Any] = kind.array(kind.NUMBER, 6)
_VALUES: dict[str, Any] = kind.array(kind.EXPRESSION, 3)
_LAW: dict[str, Any] = kind.one_of(RISES)

DECLARED: Mapping[str, type] = {
    "parameter": Parameter, "body": Body, "coordinate": Coordinate, "point": BodyPoint,
    "output": Output, "sweep": tasks.Sweep, "span": tasks.Span, "fit": tasks.Fit,
    "tolerance": tasks.Tolerance, "deviation": tasks.Limits,
    "transmission": tasks.Transmission,
}  # fmt: skip
"""Tables that are declared classes, by their names in the schema."""

TASKS = ("tolerance", "fit", "sweep", "transmission")
"""Tables that commands of these names read; to a model they belong as data."""

FIELDS: dict[str, Mapping[str, Field]] = {
    "model": {
        "$schema": _optional(kind.TEXT),
        "kincompile": Field({"const": VERSION}),
        "space": _optional({"enum": [PLANE, SPACE]}),
        "name": Field(kind.NAME),
        "length_unit": _optional(kind.TEXT),
        "analysis": _optional(kind.ref("analysis")),
        "parameters": _optional(kind.tables("parameter")),
        "bodies": _optional(kind.tables("body")),
        "coordinates": _optional(kind.tables("coordinate")),
        "sketch": _optional(kind.ref("sketch")),
        "constraints": _optional(kind.tables("constraint")),
        "gravity": _optional(_POINT),
        "loads": _optional(kind.tables("load")),
        "points": _optional(kind.tables("point")),
        "outputs": _optional(kind.tables("output")),
        "sweep": _optional(kind.ref("sweep")),
        "tolerance": _optional(kind.ref("tolerance")),
        "fit": _optional(kind.ref("fit")),
        "transmission": _optional(kind.ref("transmission")),
    },
    **{name: declared_fields(item) for name, item in DECLARED.items()},
    "sketch": {
        "lengths": _optional(kind.named(kind.NUMBER)),
        "ground": _optional(kind.named(_POINT)),
        "joints": _optional(kind.named(_POINT)),
        "parts": Field(kind.tables("part")),
    },
    "analysis": {
        "end": _optional(kind.CONSTANT),
        "points": _optional(kind.whole(1, MOST_POINTS)),
    },
    "profile": {
        "angles": Field(_NUMBERS),
        "radii": Field(_NUMBERS),
        "smoothness": Field({"const": SMOOTHNESS}),
    },
    "sequence": {
        "points": Field(kind.array(_POINT, 2)),
        "law": _optional(kind.any_of(_LAW, kind.array(_LAW))),
        "ramp": _optional(kind.EXPRESSION),
    },
    "table": {
        "times": Field(_VALUES),
        "values": Field(_VALUES),
        "velocities": _optional({**_POINT}),
        "over": _optional(kind.EXPRESSION),
    },
    "Equation": {
        "type": Field({"const": "Equation"}),
        "name": Field(kind.NAME),
        "expressions": Field(kind.array(kind.EXPRESSION, 1)),
        "corners": _optional(kind.FLAG),
    },
}
"""Fields of the file itself, of its tables, and of a free equation."""

IN_SPACE: dict[str, Mapping[str, Field]] = {
    "model": {
        **FIELDS["model"],
        "space": Field({"const": SPACE}),
        "sketch": _optional(kind.ref("spatial_sketch")),
        "bodies": _optional(kind.tables("spatial_body")),
        "constraints": _optional(kind.tables("spatial_constraint")),
        "points": _optional(kind.tables("spatial_point")),
        "gravity": _optional(_TRIPLE),
        "loads": _optional(kind.tables("spatial_load")),
    },
    "body": {
        "name": Field(kind.NAME),
        "position": _optional(_PLACE),
        "orientation": _optional(
            kind.any_of(kind.components(4, words="[e0, e1, e2, e3]"), _MATRIX)
        ),
        **{key: _optional(_PLACE) for key in ("axis", "x", "y", "z")},
        "angle": _optional(kind.EXPRESSION),
        "mass": FIELDS["body"]["mass"],
        "inertia": _optional(
            kind.any_of(kind.components(3, words="[J_xi, J_eta, J_zeta]"), _MATRIX)
        ),
        "centre": _optional(_LOCAL),
    },
    "point": {**FIELDS["point"], "local": Field(_LOCAL)},
    "sketch": {
        **FIELDS["sketch"],
        **{name: _optional(kind.named(_TRIPLE)) for name in ("ground", "joints", "hinges")},
        "parts": Field(kind.tables("spatial_part")),
    },
}
"""Fields of what is different in a file with ``space = 3``."""


def fields_of(table: str, count: int = PLANE) -> Mapping[str, Field]:
    """Return the fields of a table of a file in the plane, or in space."""
    return {PLANE: FIELDS, SPACE: FIELDS | IN_SPACE}[count][table]


_MOTIONS = [kind.ref("sequence"), kind.ref("table")]
VALUE: dict[str, Any] = kind.any_of(kind.EXPRESSION, *_MOTIONS)


def _line(place: Mapping[str, Any]) -> dict[str, Field]:
    """Return the fields of a guide, through two joints or along a direction, and of its link."""
    along = Field(kind.any_of(kind.TEXT, place))
    return {"along": along, "on": _optional(kind.NAME)}


TARGETS: Mapping[str, Mapping[str, Field]] = {
    name: declared_fields(item) for name, item in tasks.TARGETS.items()
}
"""Targets of a fit: the functions of `kc.targets`, and their arguments."""

PARTS: Mapping[str, Mapping[str, Field]] = {
    "link": {
        "link": Field(kind.NAME),
        "joints": Field(kind.TEXT),
        "length": _optional(kind.EXPRESSION),
    },
    "wheel": {"wheel": Field(kind.NAME), "joint": Field(kind.NAME)},
    "slider": {"slider": Field(kind.NAME), "joints": Field(kind.TEXT), **_line(_POINT)},
    "slot": {"slot": Field(kind.NAME), **_line(_POINT)},
    "gear": {
        "gear": Field(kind.NAME),
        "i": Field(kind.NAME), "centre_i": Field(kind.NAME), "radius_i": Field(kind.EXPRESSION),
        "j": Field(kind.NAME), "centre_j": Field(kind.NAME), "radius_j": Field(kind.EXPRESSION),
    },
    "drive": {
        "drive": Field(kind.TEXT),
        "value": Field(VALUE),
        "against": _optional(kind.NAME),
    },
}  # fmt: skip
"""Parts of a drawing: the methods of `Sketch`, and their arguments in order."""

SPATIAL_PARTS: Mapping[str, Mapping[str, Field]] = {
    "link": {"link": Field(kind.NAME), "joints": Field(kind.TEXT)},
    "slider": {"slider": Field(kind.NAME), "joints": Field(kind.TEXT), **_line(_TRIPLE)},
    "rod": {
        "rod": Field(kind.NAME), "joints": Field(kind.TEXT), "length": _optional(VALUE),
    },
    "drive": {"drive": Field(kind.TEXT), "value": Field(VALUE)},
}  # fmt: skip
"""Those of `spatial.Sketch`."""


def parts_of(count: int) -> Mapping[str, Mapping[str, Field]]:
    """Return the parts of a drawing in the plane, or in space."""
    return {PLANE: PARTS, SPACE: SPATIAL_PARTS}[count]


_KINDS: Mapping[Kind, Mapping[str, Any]] = {
    Kind.VALUE: VALUE,
    Kind.LOAD: VALUE,
    Kind.DISTANCE: VALUE,
    Kind.BODY: kind.NAME,
    Kind.PROFILE: kind.any_of(kind.EXPRESSION, kind.ref("profile")),
}


def _kind(item: Kind, count: int) -> Mapping[str, Any]:
    """Return the schema of an argument, whose points have `count` components."""
    if item in (Kind.POINT, Kind.AXIS):
        return kind.components(count)
    if item is Kind.LOADS:
        return kind.components(count, VALUE)
    return _KINDS.get(item, kind.EXPRESSION)


def constraint_fields(constraint: type[Constraint]) -> dict[str, Field]:
    """Return the fields of a constraint type: its arguments, and what drivers and cams have."""
    found = {"type": Field({"const": constraint.__name__}), "name": Field(kind.NAME)}
    for name, item in constraint.arguments().items():
        found[name] = Field(_kind(item.kind, len(constraint.bodies.axes)))
    if any(item.symbol == "C" for item in constraint.arguments().values()):
        found["corners"] = _optional(kind.FLAG)
    if constraint.contacts:
        guesses = kind.array(kind.EXPRESSION, len(constraint.contacts))
        found["guess"] = _optional(kind.any_of(kind.EXPRESSION, guesses))
    return found


def load_fields(load: type[Load]) -> dict[str, Field]:
    """Return the fields of a type of load: its arguments, those with a default left out or not."""
    given = {item.name: item for item in fields(load)}
    found = {"type": Field({"const": load.__name__}), "name": Field(kind.NAME)}
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
    parts[0]["additionalProperties"] = kind.any_of(kind.EXPRESSION, _POINT)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"Mechanism for kincompile, format {VERSION}",
        "type": "object",
        "if": {"properties": {"space": {"const": SPACE}}, "required": ["space"]},
        "then": kind.ref("in_space"),
        "else": kind.ref("in_the_plane"),
        "$defs": {
            "in_the_plane": _object(FIELDS["model"]),
            "in_space": _object(IN_SPACE["model"]),
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
        "properties": {
            name: {**({"description": item.words} if item.words else {}), **item.schema}
            for name, item in fields.items()
        },
        "required": [name for name, item in fields.items() if item.is_required],
        "additionalProperties": False,
    }

"""The format of a model file, in one place: for the reader, the writer and the JSON Schema."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, fields
from typing import TYPE_CHECKING, Any

from kincompile.files.dimensions import PLANE, SPACE, dimensions
from kincompile.model.arguments import Kind
from kincompile.model.laws import RISES
from kincompile.names import LARGEST_SEED, MOST_CHARACTERS

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
MOST_SAMPLES = 2**24
"""Largest number of samples of a tolerance analysis."""
MOST_SEARCHED, MOST_STARTS = 2**20, 10_000
"""Largest number of sets that a fit may search, and of starts that it may follow."""
MOST_DRAWN, MOST_JOINTS = 300, 30
"""Largest number of joints, parts and parameters of a drawing, and of joints of one link."""
SMOOTHNESS = 4
"""Continuous derivatives of a profile given by a table: it is a periodic quintic spline."""


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a table."""

    schema: Mapping[str, Any]
    is_required: bool = True


def _optional(schema: Mapping[str, Any]) -> Field:
    return Field(schema, is_required=False)


def _ref(name: str) -> dict[str, Any]:
    return {"$ref": f"#/$defs/{name}"}


def _any_of(*schemas: Mapping[str, Any]) -> dict[str, Any]:
    return {"anyOf": list(schemas)}


def _map(values: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "additionalProperties": values}


def _array(items: Mapping[str, Any], least: int = 0) -> dict[str, Any]:
    return {"type": "array", "items": items} | ({"minItems": least} if least else {})


_TEXT: dict[str, Any] = {"type": "string"}
_NAME: dict[str, Any] = {
    "type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]*$", "maxLength": MOST_CHARACTERS,
}  # fmt: skip
_NUMBER: dict[str, Any] = {"type": "number"}
_EXPRESSION: dict[str, Any] = _ref("expression")
_CONSTANT: dict[str, Any] = _ref("constant")
PLAIN_NUMBER = r"^\s*[+-]?(\d[\d_]*\.?[\d_]*|\.\d[\d_]*)([eE][+-]?\d+)?\s*$"
"""A number in quotes, which a constant may not be: it needs none."""


def _components(count: int, of: Mapping[str, Any] = _EXPRESSION) -> dict[str, Any]:
    """Return the schema of a fixed number of numbers or formulas."""
    return {"type": "array", "items": of, "minItems": count, "maxItems": count}


_POINT, _PAIR = _components(2), _components(2, _CONSTANT)
_TRIPLE = _components(3)
_NUMBERS: dict[str, Any] = _array(_NUMBER, 6)
_VALUES: dict[str, Any] = _array(_EXPRESSION, 3)
_NAMES: dict[str, Any] = _array(_TEXT) | {"description": "a list of names in quotes"}
_VARIANTS: dict[str, Any] = {"type": "integer", "minimum": 1, "maximum": MOST_VARIANTS}
_LAW: dict[str, Any] = {"enum": list(RISES)}
_CORNERS: dict[str, Any] = {"type": "boolean"}


_SEED: dict[str, Any] = {"type": "integer", "minimum": 0, "maximum": LARGEST_SEED}

_SWEPT = {"description": "a list of values, or { from = 0.2, to = 0.6, count = 5 }"}
_DEVIATION = {"description": "a number, two limits, or { low = -1e-4, high = 2e-4 }"}

DISTRIBUTIONS = ("normal", "uniform", "truncated")
SEARCHES = ("sobol", "differential evolution")
MINIMIZERS = ("SLSQP", "trust-constr")
"""What tolerances may be distributed by, and how a fit may search and end."""

TASKS = ("tolerance", "fit", "sweep")
"""Tables that commands of these names read; to a model they belong as data."""


def _list(name: str) -> dict[str, Any]:
    return _array(_ref(name)) | {"description": "a list of tables"}


FIELDS: Mapping[str, Mapping[str, Field]] = {
    "model": {
        "$schema": _optional(_TEXT),
        "kincompile": Field({"const": VERSION}),
        "space": _optional({"enum": [PLANE, SPACE]}),
        "name": Field(_NAME),
        "length_unit": _optional(_TEXT),
        "analysis": _optional(_ref("analysis")),
        "parameters": _optional(_list("parameter")),
        "bodies": _optional(_list("body")),
        "coordinates": _optional(_list("coordinate")),
        "sketch": _optional(_ref("sketch")),
        "constraints": _optional(_list("constraint")),
        "gravity": _optional(_POINT),
        "loads": _optional(_list("load")),
        "points": _optional(_list("point")),
        "outputs": _optional(_list("output")),
        "sweep": _optional(_ref("sweep")),
        "tolerance": _optional(_ref("tolerance")),
        "fit": _optional(_ref("fit")),
    },
    "tolerance": {
        "of": _optional(_NAMES),
        "parameters": _optional(_map(_any_of(_CONSTANT, _PAIR, _ref("deviation")) | _DEVIATION)),
        "clearances": _optional(_map(_CONSTANT)),
        "samples": _optional({**_VARIANTS, "minimum": 0, "maximum": MOST_SAMPLES}),
        "seed": _optional(_SEED),
    },
    "deviation": {
        "low": Field(_CONSTANT),
        "high": Field(_CONSTANT),
        "distribution": _optional({"enum": list(DISTRIBUTIONS)}),
        "sigmas": _optional(_CONSTANT),
    },
    "fit": {
        "parameters": Field(_map(_PAIR)),
        "targets": Field(_list("target")),
        "samples": _optional({**_VARIANTS, "maximum": MOST_SEARCHED}),
        "starts": _optional({**_VARIANTS, "maximum": MOST_STARTS}),
        "search": _optional({"enum": list(SEARCHES)}),
        "minimizer": _optional({"enum": list(MINIMIZERS)}),
        "seed": _optional(_SEED),
    },
    "sweep": {
        "parameters": Field(_map(_any_of(_array(_CONSTANT, 1), _ref("span")) | _SWEPT)),
        "samples": _optional(_VARIANTS),
        "product": _optional({"type": "boolean"}),
        "columns": _optional(_NAMES),
        "measures": _optional(_NAMES),
    },
    "span": {
        "from": Field(_CONSTANT),
        "to": Field(_CONSTANT),
        "count": _optional(_VARIANTS),
    },
    "sketch": {
        "lengths": _optional(_map(_NUMBER)),
        "ground": _optional(_map(_POINT)),
        "joints": _optional(_map(_POINT)),
        "parts": Field(_list("part")),
    },
    "analysis": {
        "end": _optional(_CONSTANT),
        "points": _optional({"type": "integer", "minimum": 1, "maximum": MOST_POINTS}),
    },
    "parameter": {
        "name": Field(_NAME),
        "default": Field(_CONSTANT),
        "unit": _optional(_TEXT),
        "range": _optional(_POINT),
    },
    "body": {
        "name": Field(_NAME),
        "guess": _optional(_TRIPLE),
        "outline": _optional(_array(_POINT, 3)),
        "mass": _optional(_EXPRESSION),
        "inertia": _optional(_EXPRESSION),
        "centre": _optional(_POINT),
        "density": _optional(_EXPRESSION),
        "thickness": _optional(_EXPRESSION),
    },
    "point": {"name": Field(_NAME), "body": Field(_NAME), "local": Field(_POINT)},
    "output": {
        "name": Field(_NAME),
        "expression": Field(_EXPRESSION),
        "unit": _optional(_TEXT),
    },
    "coordinate": {"name": Field(_NAME), "guess": _optional(_EXPRESSION)},
    "profile": {
        "angles": Field(_NUMBERS),
        "radii": Field(_NUMBERS),
        "smoothness": Field({"const": SMOOTHNESS}),
    },
    "sequence": {
        "points": Field(_array(_POINT, 2)),
        "law": _optional(_any_of(_LAW, _array(_LAW))),
        "ramp": _optional(_EXPRESSION),
    },
    "table": {
        "times": Field(_VALUES),
        "values": Field(_VALUES),
        "velocities": _optional({**_POINT}),
        "over": _optional(_EXPRESSION),
    },
    "Equation": {
        "type": Field({"const": "Equation"}),
        "name": Field(_NAME),
        "expressions": Field(_array(_EXPRESSION, 1)),
        "corners": _optional(_CORNERS),
    },
}
"""Fields of the file itself, of its tables, and of a free equation."""

IN_SPACE: Mapping[str, Mapping[str, Field]] = {
    "model": {
        **FIELDS["model"],
        "space": Field({"const": SPACE}),
        "sketch": _optional(_ref("spatial_sketch")),
        "bodies": _optional(_list("spatial_body")),
        "constraints": _optional(_list("spatial_constraint")),
        "points": _optional(_list("spatial_point")),
        "gravity": _optional(_TRIPLE),
        "loads": _optional(_list("spatial_load")),
    },
    "body": {
        "name": Field(_NAME),
        "position": _optional(_TRIPLE),
        "orientation": _optional(_any_of(_components(4), {**_TRIPLE, "items": _TRIPLE})),
        **{key: _optional(_TRIPLE) for key in ("axis", "x", "y", "z")},
        "angle": _optional(_EXPRESSION),
        "mass": _optional(_EXPRESSION),
        "inertia": _optional(_any_of(_TRIPLE, {**_TRIPLE, "items": _TRIPLE})),
        "centre": _optional(_TRIPLE),
    },
    "point": {**FIELDS["point"], "local": Field(_TRIPLE)},
    "sketch": {
        **FIELDS["sketch"],
        **{name: _optional(_map(_TRIPLE)) for name in ("ground", "joints", "hinges")},
        "parts": Field(_list("spatial_part")),
    },
}
"""Fields of what is different in a file with ``space = 3``."""


def fields_of(table: str, count: int = PLANE) -> Mapping[str, Field]:
    """Return the fields of a table of a file in the plane, or in space."""
    return IN_SPACE.get(table, FIELDS[table]) if count == SPACE else FIELDS[table]


_MOTIONS = [_ref("sequence"), _ref("table")]
VALUE: dict[str, Any] = _any_of(_EXPRESSION, *_MOTIONS)


def _line(place: Mapping[str, Any]) -> dict[str, Field]:
    """Return the fields of a guide, through two joints or along a direction, and of its link."""
    along = Field(_any_of(_TEXT, place))
    return {"along": along, "on": _optional(_NAME)}


_WEIGHT: Mapping[str, Field] = {"weight": _optional(_CONSTANT)}
_PASSING: Mapping[str, Field] = {
    "times": _optional(_array(_CONSTANT)),
    **_WEIGHT,
    "within": _optional(_CONSTANT),
    "between": _optional(_PAIR),
}
_ROWS: dict[str, Any] = _array(_array(_CONSTANT) | {"description": "a list of numbers"}) | {
    "description": "a list of lists of numbers"
}

TARGETS: Mapping[str, Mapping[str, Field]] = {
    "path": {"path": Field(_TEXT), "points": Field(_ROWS), **_PASSING},
    "value": {
        "value": Field(_TEXT), "values": Field(_array(_CONSTANT)), **_PASSING,
    },
    "pose": {
        "pose": Field(_TEXT), "poses": Field(_ROWS),
        "angle_weight": _optional(_CONSTANT), **_PASSING,
    },
    "time_ratio": {
        "time_ratio": Field(_TEXT), "ratio": Field(_CONSTANT), **_WEIGHT,
        "within": _optional(_CONSTANT),
    },
    "limit": {
        "limit": Field(_TEXT),
        "least": _optional(_CONSTANT),
        "most": _optional(_CONSTANT),
        "title": _optional(_TEXT),
    },
    "moves": {"moves": Field({"const": True})},
}  # fmt: skip
"""Targets of a fit: the functions of `kc.targets`, and their arguments."""

PARTS: Mapping[str, Mapping[str, Field]] = {
    "link": {
        "link": Field(_NAME),
        "joints": Field(_TEXT),
        "length": _optional(_EXPRESSION),
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
        "against": _optional(_NAME),
    },
}  # fmt: skip
"""Parts of a drawing: the methods of `Sketch`, and their arguments in order."""

SPATIAL_PARTS: Mapping[str, Mapping[str, Field]] = {
    "link": {"link": Field(_NAME), "joints": Field(_TEXT)},
    "slider": {"slider": Field(_NAME), "joints": Field(_TEXT), **_line(_TRIPLE)},
    "rod": {
        "rod": Field(_NAME), "joints": Field(_TEXT), "length": _optional(VALUE),
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
    Kind.PROFILE: _any_of(_EXPRESSION, _ref("profile")),
}


def _kind(kind: Kind, count: int) -> Mapping[str, Any]:
    """Return the schema of an argument, whose points have `count` components."""
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
        found["corners"] = _optional(_CORNERS)
    if constraint.contacts:
        guesses = _array(_EXPRESSION, len(constraint.contacts))
        found["guess"] = _optional(_any_of(_EXPRESSION, guesses))
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
    parts[0]["additionalProperties"] = _any_of(_EXPRESSION, _POINT)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"Mechanism for kincompile, format {VERSION}",
        "type": "object",
        "if": {"properties": {"space": {"const": SPACE}}, "required": ["space"]},
        "then": _ref("in_space"),
        "else": _ref("in_the_plane"),
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
        "properties": {name: item.schema for name, item in fields.items()},
        "required": [name for name, item in fields.items() if item.is_required],
        "additionalProperties": False,
    }

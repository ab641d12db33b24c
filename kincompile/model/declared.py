"""What a user writes, declared once: the fields of a table, what each may be, and in words.

    @declared
    class Fit:
        samples: int = given(whole(1, 2**20), "Sets of parameters that are searched.", default=4096)

A kind is a fragment of JSON Schema. The schema of a file, its reader, the checks of arguments,
options of the command line and the tables of docs/model_tables.md follow from the declaration.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cache
from typing import Any, TypeAlias, TypeVar, dataclass_transform, overload

from kincompile.errors import InputError
from kincompile.names import MOST_CHARACTERS, listed, shown

Schema: TypeAlias = Mapping[str, Any]
Type = TypeVar("Type")


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a table: what it may be, and what it means."""

    schema: Schema
    is_required: bool = True
    words: str = ""
    unit: str = ""  # ``"length"``, ``"rad"``, ... of numbers that have one
    is_written: bool = True  # whether a file that is written has it where it is the default
    default: Any = None
    attribute: str = ""  # its name in Python, where that differs from the one in a file


def given(
    schema: Schema,
    words: str,
    *,
    default: Any = MISSING,
    unit: str = "",
    key: str = "",
    kw_only: bool = False,
    is_shown: bool = True,
    always: bool = False,
) -> Any:
    """Declare a field; with a default it may be left out.

    `key` is its name in a file, `is_shown` whether it is in the representation, and `always`
    whether a file has it even where it is the default.
    """
    made = Field(schema, default is MISSING, words, unit, is_written=always or default is MISSING)
    return field(
        default=default, metadata={"declared": made, "key": key}, kw_only=kw_only, repr=is_shown
    )


@overload
def declared(cls: type[Type], /) -> type[Type]: ...
@overload
def declared(
    *, slots: bool = ..., repr: bool = ..., init: bool = ...
) -> Callable[[type[Type]], type[Type]]: ...
@dataclass_transform(frozen_default=True, field_specifiers=(given, field))
def declared(cls: Any = None, /, **options: bool) -> Any:
    """Make a class a declared one: what a user writes, frozen. Options are those of a dataclass."""
    made = dataclass(frozen=True, **options)
    return made if cls is None else made(cls)


def declared_fields(cls: type[Any]) -> dict[str, Field]:
    """Return the declared fields of a class, by their names in a file."""
    of_class: Any = cls  # mypy does not know that classes with an `__eq__` have a hash
    return _fields_of(of_class)


@cache
def _fields_of(cls: Any) -> dict[str, Field]:
    return {
        item.metadata["key"] or item.name: replace(
            item.metadata["declared"], attribute=item.name, default=item.default
        )
        for item in sorted(fields(cls), key=lambda item: item.kw_only is True)
        if "declared" in item.metadata
    }


def ref(name: str) -> dict[str, Any]:
    """Return the kind of a table, by its name in the schema."""
    return {"$ref": f"#/$defs/{name}"}


def any_of(*schemas: Schema) -> dict[str, Any]:
    """Return the kind of what is one of several."""
    return {"anyOf": list(schemas)}


def named(values: Schema) -> dict[str, Any]:
    """Return the kind of values by name."""
    return {"type": "object", "additionalProperties": values}


def array(items: Schema, least: int = 0) -> dict[str, Any]:
    """Return the kind of a list."""
    return {"type": "array", "items": items} | ({"minItems": least} if least else {})


def tables(name: str) -> dict[str, Any]:
    """Return the kind of a list of tables."""
    return array(ref(name)) | {"description": "a list of tables"}


def whole(least: int, most: int) -> dict[str, Any]:
    """Return the kind of a whole number."""
    return {"type": "integer", "minimum": least, "maximum": most}


def one_of(words: Iterable[Any]) -> dict[str, Any]:
    """Return the kind of a choice."""
    return {"enum": list(words)}


TEXT: Schema = {"type": "string"}
NAME: Schema = {
    "type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]*$", "maxLength": MOST_CHARACTERS,
}  # fmt: skip
NUMBER: Schema = {"type": "number"}
UNIT: Schema = {"type": "string", "format": "unit"}
FLAG: Schema = {"type": "boolean"}
NAMES: Schema = array(TEXT) | {"description": "a list of names in quotes"}
EXPRESSION: Schema = ref("expression")
CONSTANT: Schema = ref("constant")
VALUE: Schema = any_of(EXPRESSION, ref("sequence"), ref("table")) | {
    "description": "a number or a formula, or a motion"
}
"""The value of a driver or of a load."""


def components(count: int, of: Schema = EXPRESSION, words: str = "") -> dict[str, Any]:
    """Return the kind of a fixed number of numbers or formulas, which words may name."""
    found = {"type": "array", "items": of, "minItems": count, "maxItems": count}
    return found | ({"description": words} if words else {})


PAIR: Schema = components(2, CONSTANT)

_TYPES: Mapping[str, type | tuple[type, ...]] = {
    "object": dict, "array": list, "string": str, "boolean": bool, "number": (int, float),
}  # fmt: skip


def chosen(
    given: Any, schemas: Sequence[Schema], fields: Callable[[str], Iterable[str]]
) -> Schema | None:
    """Return the kind that fits a value best; `fields` are those of a table; None if none fits."""

    def fit(schema: Schema) -> int:
        if isinstance(given, dict) and "$ref" in schema:
            return len(given.keys() & set(fields(schema["$ref"].rpartition("/")[2])))
        if not isinstance(given, list) or "items" not in schema:
            return 0
        least, most = schema.get("minItems", 0), schema.get("maxItems", len(given))
        return least <= len(given) <= most and all(may_be(x, schema["items"]) for x in given)

    return max((item for item in schemas if may_be(given, item)), key=fit, default=None)


def choices(schema: Schema) -> list[str]:
    """Return the words that a kind takes, if it is a choice or has one."""
    kinds = schema.get("anyOf", (schema,))
    return [word for item in kinds for word in item.get("enum", ()) if isinstance(word, str)]


def may_be(value: Any, schema: Schema) -> bool:
    """Return whether a value of a file is of the type of a kind, and within its limits."""
    if "$ref" in schema:
        is_table = not schema["$ref"].endswith(("/expression", "/constant"))
        return isinstance(value, dict if is_table else int | float | str)
    if "enum" in schema or "const" in schema:
        known = schema.get("enum", (schema.get("const"),))
        return any(isinstance(value, type(item)) and value == item for item in known) and (
            isinstance(value, bool) == isinstance(known[0], bool)
        )
    kind = str(schema["type"])
    if kind == "integer":
        return _is_whole(value) and schema["minimum"] <= value <= schema["maximum"]
    return isinstance(value, bool) == (kind == "boolean") and isinstance(value, _TYPES[kind])


def _is_whole(value: Any) -> bool:
    """Return whether a value is a whole number of Python or of NumPy."""
    try:
        return not isinstance(value, bool) and operator.index(value) == value
    except TypeError:
        return False


def expected(schema: Schema) -> str:
    """Return in words what a kind takes."""
    if "description" in schema:
        return str(schema["description"])
    if "enum" in schema or "const" in schema:
        return listed(shown(item) for item in schema.get("enum", (schema.get("const"),)))
    if schema["type"] == "integer":
        return f"a whole number from {schema['minimum']} to {schema['maximum']:,}"
    words = {
        "object": "names and values", "array": "a list", "string": "a text in quotes",
        "boolean": "true or false", "number": "a number",
    }  # fmt: skip
    return words[schema["type"]]


def require(cls: type, **values: Any) -> None:
    """Check arguments of a function by the declared fields of these names.

    Raises
    ------
    InputError
        If one is not of its kind; one message has all problems.
    """
    known = declared_fields(cls)
    problems = []
    for name, value in values.items():
        schema = known[name].schema
        if may_be(value, schema):
            continue
        if "enum" in schema:
            problems.append(f"there is no {name} {value!r}; there are {listed(schema['enum'])}")
        else:
            problems.append(f"{name} is {shown(value)}: give {expected(schema)}")
    if problems:
        raise InputError(problems)

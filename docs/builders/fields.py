"""The tables of docs/model_files.md that follow from declared classes."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from docs.builders.places import DOCS
from kincompile.files.dimensions import PLANE, SPACE, dimensions
from kincompile.files.file_format import DECLARED
from kincompile.model.declared import CONSTANT, declared_fields, expected
from kincompile.model.tasks import TARGETS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

PAGE, START = "model_files.md", "<!-- declared -->\n"
WORDS = {"constant": "a number", "expression": "a number or a formula"}


def page() -> str:
    """Return docs/model_files.md, with its tables as the declarations have them."""
    text = (DOCS / PAGE).read_text(encoding="utf-8")
    head, _, tail = text.partition(START)
    return head + START + "\n".join(_tables()) + "\n" + tail[tail.index("\n## ") :]


def _tables() -> Iterator[str]:
    yield "| table | field | what it is | without it | meaning |"
    yield "| --- | --- | --- | --- | --- |"
    plane, space = dimensions(PLANE), dimensions(SPACE)
    tables = {
        **{f"`{name}`": cls for name, cls in DECLARED.items()},
        **{f"target `{name}`": cls for name, cls in TARGETS.items()},
        **{f"part `{name}`": cls for name, cls in plane.parts().items()},
        **{f"in space `{name}`": cls for name, cls in space.tables().items()},
        **{f"in space part `{name}`": cls for name, cls in space.parts().items()},
    }
    for title, cls in tables.items():
        for field, item in declared_fields(cls).items():
            default = "needed" if item.is_required else _default(item.default)
            unit = f" [{item.unit}]" if item.unit else ""
            yield f"| {title} | `{field}` | {_kind(item.schema)}{unit} | {default} | {item.words} |"


def _default(value: Any) -> str:
    if value in (None, (), "") or (isinstance(value, float) and math.isinf(value)):
        return "none"
    return f"`{json.dumps(value)}`"


def _kind(schema: Mapping[str, Any]) -> str:
    """Return in words what a field may be."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return WORDS.get(name, f"a table `{name}`")
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if schema.get("type") == "object":
        return f"by name {_kind(schema['additionalProperties'])}"
    if schema.get("minItems") and schema.get("minItems") == schema.get("maxItems"):
        return f"{schema['minItems']} numbers"
    if schema.get("items") == CONSTANT:
        return "a list of numbers"
    return expected(schema)

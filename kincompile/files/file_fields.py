"""Fields of a data file: taken if they are what they should be, else noted with line and field."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

from kincompile.files.data_text import MAX_PROBLEMS, listed_problems
from kincompile.files.file_format import FIELDS, PLAIN_NUMBER, TARGETS
from kincompile.files.formula_text import ExpressionError
from kincompile.files.safe_expressions import parse_expression
from kincompile.model.expressions import evaluate
from kincompile.names import LONGEST, escaped, listed, name_problem, shown, suggestion, unit_problem

if TYPE_CHECKING:
    from collections.abc import Mapping

    import sympy

    from kincompile.files.data_lines import Address
    from kincompile.files.data_text import Document
    from kincompile.files.file_format import Field

_SINGULAR = {"bodies": "body"}


class FieldReader:
    """Takes values from a document and collects what is wrong with them."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.problems: list[str] = []
        self._places: dict[str, Address] = {}
        # A large mechanism has "-a/2" thousands of times. Names are only added, except for alpha,
        # which is for profiles alone, and t, which is not allowed everywhere.
        self._parsed: dict[tuple[str, bool, bool], sympy.Expr] = {}

    def problem(self, address: Address, text: str) -> None:
        """Note a problem with the value at an address; very many end the reading."""
        where = self._field(address)
        message = f"{where}: {text}" if where else text
        self.problems.append(self.document.problem(address, message))
        if len(self.problems) > MAX_PROBLEMS:
            raise listed_problems(self.problems)

    def remember(self, words: str, address: Address) -> None:
        """Remember the address of what the checks of the whole system call by these words."""
        self._places[words] = address

    def located(self, problem: str) -> str:
        """Return a problem that the checks of the whole system found, with file and line."""
        known = [words for words in self._places if problem.startswith(words)]
        address = self._places[max(known, key=len)] if known else ()
        return self.document.problem(address, problem)

    def _field(self, address: Address) -> str:
        """Return an address in words: ``constraint 'A', point_i, entry 2``."""
        words: list[str] = []
        data = self.document.data
        for part in address:
            if isinstance(part, str):
                data = data.get(part) if isinstance(data, dict) else None
                words.append(escaped(part[:LONGEST]))
                continue
            data = data[part] if isinstance(data, list) else None
            name = data.get("name") if isinstance(data, dict) else None
            if len(words) == 1:
                singular = _SINGULAR.get(words[0], words[0].removesuffix("s"))
                words[0] = f"{singular} {shown(name) if isinstance(name, str) else part + 1}"
            else:
                words.append(f"entry {part + 1}")
        return ", ".join(words)

    def has_fields(
        self, address: Address, row: Mapping[str, Any], fields: Mapping[str, Field]
    ) -> bool:
        """Check which fields a table has; return whether none is missing."""
        for key in row:
            if key not in fields:
                hint = suggestion(key, fields)
                text = f"there is no such field{hint}; fields are: {listed(fields, 20)}"
                self.problem((*address, key), text)
        missing = [key for key, item in fields.items() if item.is_required and key not in row]
        if missing:
            self.problem(address, f"no {listed(missing, 20)}; fields are: {listed(fields, 20)}")
        return not missing

    def fits(self, value: Any, schema: Mapping[str, Any], address: Address) -> None:
        """Check a value against its schema; formulas are read later."""
        if "$ref" in schema:
            self._fits_table(value, schema["$ref"].rpartition("/")[2], address)
        elif "anyOf" in schema:
            likely = [item for item in schema["anyOf"] if _may_be(value, item)]
            if likely:
                self.fits(value, likely[0], address)
            else:
                self.problem(address, f"expected {_expected(schema)}, not {shown(value)}")
        elif not _may_be(value, schema):
            self.problem(address, f"expected {_expected(schema)}, not {shown(value)}")
        elif isinstance(value, dict):
            for key, item in value.items():
                self.fits(item, schema["additionalProperties"], (*address, key))
        elif isinstance(value, list):
            least, most = schema.get("minItems", 0), schema.get("maxItems", len(value))
            if not least <= len(value) <= most:
                count = f"{least}" if least == most else f"at least {least}"
                self.problem(address, f"expected a list of {count}, not {shown(value)}")
            for k, item in enumerate(value):
                self.fits(item, schema["items"], (*address, k))

    def _fits_table(self, value: Any, name: str, address: Address) -> None:
        """Check a formula, a target of a fit, or a table of a name of the format."""
        if name in ("expression", "constant"):
            is_formula = isinstance(value, str)
            if not is_formula or (name == "constant" and _is_number(value)):
                self.constant(value, address, {})
            return
        if not isinstance(value, dict):
            self.problem(address, f"expected a table of fields, not {shown(value)}")
            return
        kinds = TARGETS if name == "target" else {name: FIELDS[name]}
        given = [kind for kind in kinds if kind in value or name != "target"]
        if len(given) != 1:
            self.problem(address, f"expected one target: {listed(TARGETS)}, not {shown(value)}")
            return
        fields = kinds[given[0]]
        self.has_fields(address, value, fields)
        for key in fields.keys() & value.keys():
            self.fits(value[key], fields[key].schema, (*address, key))

    def rows(
        self, data: Mapping[str, Any], section: str
    ) -> list[tuple[tuple[str, int], dict[str, Any]]]:
        """Return the tables in a list, each with its address."""
        given = data.get(section, [])
        if not isinstance(given, list):
            self.problem((section,), f"expected a list of tables, not {shown(given)}")
            return []
        found = []
        for k, row in enumerate(given):
            if isinstance(row, dict):
                found.append(((section, k), row))
            else:
                self.problem((section, k), f"expected a table of fields, not {shown(row)}")
        return found

    def name(self, row: Mapping[str, Any], address: Address, what: str) -> str:
        """Return the name of a table, nothing where it has none that can be used."""
        if "name" not in row:
            return ""
        problem = name_problem(row["name"], what)
        if problem is None:
            return str(row["name"])
        self.problem((*address, "name"), problem)
        return ""

    def unit(self, value: Any, address: Address, what: str) -> str:
        """Return a unit."""
        problem = unit_problem(value, what)
        if problem is None:
            return str(value)
        self.problem(address, problem)
        return ""

    def number(self, value: Any, address: Address) -> float:
        """Return a finite number. On a problem, report it and return 1.0 as a placeholder."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            hint = "; write the number itself, without quotes" if isinstance(value, str) else ""
            self.problem(address, f"expected a number, not {shown(value)}{hint}")
            return 1.0
        try:
            if math.isfinite(float(value)):
                return value
        except OverflowError:
            pass
        self.problem(address, f"{shown(value)} is not a finite number that a double can hold")
        return 1.0

    def constant(
        self, value: Any, address: Address, names: Mapping[str, sympy.Expr]
    ) -> float | sympy.Expr:
        """Return a number, or a formula such as ``30*deg``; a number needs no quotes."""
        if isinstance(value, str) and not _is_number(value):
            return self.expression(value, address, names)
        return self.number(value, address)

    def expression(
        self, value: Any, address: Address, names: Mapping[str, sympy.Expr]
    ) -> float | sympy.Expr:
        """Return a number, or a formula in declared names; 1.0 as a placeholder on a problem."""
        if not isinstance(value, str):
            if isinstance(value, bool) or not isinstance(value, int | float):
                self.problem(address, f"expected a number or a formula, not {shown(value)}")
                return 1.0
            return self.number(value, address)
        key = value, "alpha" in names, "t" in names
        try:
            if key not in self._parsed:
                self._parsed[key] = parse_expression(value, names)
            return self._parsed[key]
        except ExpressionError as error:
            line = f"line {error.line}, " if error.line > 1 else ""
            text = f"{line}column {error.column} of {shown(value)}: {error.problem}"
            self.problem(address, text)
            return 1.0

    def finite(self, given: Any, address: Address) -> float:
        """Return a number, or that of a formula without names; 1.0 as a placeholder."""
        known = len(self.problems)
        found = evaluate(self.constant(given, address, {}), {})
        if found is not None and math.isfinite(found):
            return found
        if len(self.problems) == known:
            self.problem(address, f"{shown(given)} is not a finite number")
        return 1.0

    def expressions(
        self, value: Any, address: Address, names: Mapping[str, sympy.Expr], what: str, count: int
    ) -> list[float | sympy.Expr]:
        """Return a list of a fixed number of expressions; `what` says how it is written."""
        if not isinstance(value, list) or len(value) != count:
            self.problem(address, f"expected {what}, not {shown(value)}")
            return [1.0] * count
        return [self.expression(item, (*address, k), names) for k, item in enumerate(value)]


_TYPES: Mapping[str, type | tuple[type, ...]] = {
    "object": dict, "array": list, "string": str, "boolean": bool, "integer": int,
    "number": (int, float),
}  # fmt: skip


def _may_be(value: Any, schema: Mapping[str, Any]) -> bool:
    """Return whether a value is of the type of a schema, and within its limits."""
    if "$ref" in schema:
        is_table = not schema["$ref"].endswith(("/expression", "/constant"))
        return isinstance(value, dict if is_table else int | float | str)
    if "enum" in schema or "const" in schema:
        return value in schema.get("enum", (schema.get("const"),))
    kind = str(schema["type"])
    if isinstance(value, bool) != (kind == "boolean") or not isinstance(value, _TYPES[kind]):
        return False
    return kind != "integer" or bool(schema["minimum"] <= value <= schema["maximum"])


def _is_number(text: str) -> bool:
    return re.search(PLAIN_NUMBER, text) is not None


def _expected(schema: Mapping[str, Any]) -> str:
    """Return in words what a schema takes."""
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

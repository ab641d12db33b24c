"""Fields of a data file: taken if they are what they should be, else noted with line and field."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

from kincompile.errors import ModelError
from kincompile.files.data_text import MAX_PROBLEMS, listed_problems
from kincompile.files.file_format import DECLARED, PLAIN_NUMBER
from kincompile.files.formula_text import ExpressionError
from kincompile.files.safe_expressions import parse_expression
from kincompile.model import tasks
from kincompile.model.declared import choices, chosen, declared_fields, expected, may_be
from kincompile.model.expressions import evaluate
from kincompile.model.sections import Motion
from kincompile.names import LONGEST, escaped, listed, name_problem, shown, suggestion, unit_problem

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    import sympy

    from kincompile.files.data_lines import Address
    from kincompile.files.data_text import Document
    from kincompile.model.declared import Field, Schema

    Names = Mapping[str, sympy.Expr]

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

    def values(
        self,
        row: Mapping[str, Any],
        fields: Mapping[str, Field],
        address: Address,
        names: Names | None,
        skipped: Collection[str] = ("name",),
    ) -> dict[str, Any]:
        """Return the values of a table by attribute; formulas have these names."""
        found = {
            item.attribute or key: self.value(row[key], item.schema, (*address, key), names)
            for key, item in fields.items()
            if key in row and key not in skipped
        }
        return {key: value for key, value in found.items() if value is not None}

    def value(
        self, given: Any, schema: Schema, address: Address, names: Names | None = None
    ) -> Any:
        """Return a value of a kind, tables as their declared classes; None on a problem.

        Without names formulas are numbers.
        """
        if "anyOf" in schema:
            best = chosen(given, schema["anyOf"], lambda name: declared_fields(DECLARED[name]))
            if best is not None:
                return self.value(given, best, address, names)
        elif schema.get("type") == "number":
            return self.number(given, address)
        elif "$ref" in schema:
            name = schema["$ref"].rpartition("/")[2]
            if name in ("constant", "expression") and names is not None:
                read = self.constant if name == "constant" else self.expression
                return read(given, address, names)
            return (
                self.finite(given, address)
                if name == "constant"
                else self.table(given, name, address, names)
            )
        elif may_be(given, schema):
            return self._members(given, schema, address, names)
        hint = suggestion(given, choices(schema)) if isinstance(given, str) else ""
        self.problem(address, f"expected {expected(schema)}, not {shown(given)}{hint}")
        return None

    def _members(self, given: Any, schema: Schema, address: Address, names: Names | None) -> Any:
        """Return a value whose type fits, and so do the values in it."""
        if schema.get("format") == "unit":
            return self.unit(given, address, self.owner(address))
        if "pattern" in schema:
            problem = name_problem(given, f"a {address[-1]}")
            if problem is not None:
                self.problem(address, problem)
            return given
        if isinstance(given, dict):
            of = schema["additionalProperties"]
            return {key: self.value(x, of, (*address, key), names) for key, x in given.items()}
        if not isinstance(given, list):
            return given
        least, most = schema.get("minItems", 0), schema.get("maxItems", len(given))
        if not least <= len(given) <= most:
            count = f"{least}" if least == most else f"at least {least}"
            words = schema.get("description", f"a list of {count}")
            self.problem(address, f"expected {words}, not {shown(given)}")
            return None
        of = schema["items"]
        found = [self.value(item, of, (*address, k), names) for k, item in enumerate(given)]
        return None if None in found else tuple(found)

    def owner(self, address: Address) -> str:
        """Return what a field belongs to, in words: ``parameter 'a'``."""
        return self._field(address[:2])

    def table(self, given: Any, name: str, address: Address, names: Names | None = None) -> Any:
        """Return a table, by its name in the schema, as its declared class; None on a problem."""
        if not isinstance(given, dict):
            self.problem(address, f"expected a table of fields, not {shown(given)}")
            return None
        if name != "target":
            return self.made(DECLARED[name], given, address, names)
        likely = [kind for kind in tasks.TARGETS if kind in given]
        if len(likely) != 1:
            known = listed(tasks.TARGETS)
            self.problem(address, f"expected one target: {known}, not {shown(given)}")
            return None
        return self.made(tasks.TARGETS[likely[0]], given, address, names)

    def made(self, cls: type, row: Mapping[str, Any], address: Address, names: Names | None) -> Any:
        """Return the fields of a table as their declared class, a motion as its expression."""
        known, before = declared_fields(cls), len(self.problems)
        self.has_fields(address, row, known)
        values = self.values(row, known, address, names, ())
        if len(self.problems) > before:
            return None
        found = cls(**values)
        try:
            return found.expression() if isinstance(found, Motion) else found
        except ModelError as error:
            for problem in error.problems:
                self.problem(address, problem)
            return None

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


def _is_number(text: str) -> bool:
    return re.search(PLAIN_NUMBER, text) is not None

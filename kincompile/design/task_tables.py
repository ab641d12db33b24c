"""The tables `tolerance` and `fit` of a model file: what `kc.tolerance` and `kc.fit` are given.

[tolerance]
of = ["slider.x"]
parameters = { r = 1e-4, L = [-1e-4, 2e-4], e = { low = -1e-4, high = 1e-4, sigmas = 2 } }
clearances = { B = 2e-5 }
samples = 1024

[fit]
parameters = { a = [0.5, 2], b = [2, 5] }
targets = [
    { path = "P", points = [[1, 2], [1.5, 2.2]], times = [0.1, 0.2] },
    { limit = "b/a", least = 1.5 },
]
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.design import targets
from kincompile.design.deviation import Deviation
from kincompile.errors import InputError
from kincompile.files.content import file_content
from kincompile.files.data_text import listed_problems, read_json, read_toml
from kincompile.files.file_fields import FieldReader
from kincompile.files.file_format import FIELDS, TARGETS
from kincompile.model.expressions import as_sympy
from kincompile.names import column_name, listed, name_problem

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from kincompile.design.targets import Target
    from kincompile.files.data_lines import Address
    from kincompile.model.mechanism import Mechanism

    Arguments = dict[str, Any]

OPTIONS = ("samples", "starts", "search", "minimizer", "seed")
"""Fields of a fit that are arguments of `kc.fit` as they are."""


def read_tolerance(path: str | os.PathLike[str]) -> Arguments:
    """Return the arguments of `kc.tolerance` that the table `tolerance` of a model file says."""
    reader = _reader(path, "tolerance")
    return reader.checked(reader.tolerance())


def read_fit(path: str | os.PathLike[str], model: Mechanism) -> Arguments:
    """Return the arguments of `kc.fit` that the table `fit` of a model file says."""
    reader = _reader(path, "fit")
    return reader.checked(reader.fit(model))


def _reader(path: str | os.PathLike[str], section: str) -> _TaskReader:
    """Return what reads a table of a file."""
    file = Path(path)
    read = {".toml": read_toml, ".json": read_json}.get(file.suffix.lower())
    if read is None:
        raise InputError(
            f"{file} has no table [{section}]: give a model as .toml or .json, with that table"
        )
    reader = _TaskReader(read(file, file_content(file)), section)
    if reader.row is None:
        fields = listed(FIELDS[section], 20)
        raise InputError(f"{file} has no table [{section}]. Add one; its fields are: {fields}.")
    reader.fits(reader.row, FIELDS["model"][section].schema, (section,))
    reader.checked({})
    return reader


class _TaskReader(FieldReader):
    """Reads the fields of one of the tables."""

    def __init__(self, document: Any, section: str) -> None:
        super().__init__(document)
        self.section = section
        data = document.data
        self.row: Any = data.get(section) if isinstance(data, dict) else None

    def checked(self, found: Arguments) -> Arguments:
        """Return what was read, or raise what is wrong with it."""
        if self.problems:
            raise listed_problems(self.problems)
        return found

    def tolerance(self) -> Arguments:
        """Return the arguments of `kc.tolerance`."""
        row = self.row
        found: Arguments = {
            "tolerances": {
                name: self._deviation(name, value)
                for name, value in row.get("parameters", {}).items()
            },
            "clearances": {
                name: self.finite(value, ("tolerance", "clearances", name))
                for name, value in row.get("clearances", {}).items()
            },
            "of": tuple(row["of"]) if "of" in row else None,
        }
        return found | {key: row[key] for key in ("samples", "seed") if key in row}

    def _deviation(self, name: str, given: Any) -> Any:
        """Return the tolerance of a parameter."""
        address = ("tolerance", "parameters", name)
        if isinstance(given, list):
            return tuple(self.finite(item, (*address, k)) for k, item in enumerate(given))
        if not isinstance(given, dict):
            return self.finite(given, address)
        numbers = {
            key: self.finite(given[key], (*address, key))
            for key in ("low", "high", "sigmas")
            if key in given
        }
        try:
            return Deviation(**numbers, distribution=given.get("distribution", "normal"))
        except InputError as error:
            for problem in error.problems:
                self.problem(address, problem)
        return 1.0

    def fit(self, model: Mechanism) -> Arguments:
        """Return the arguments of `kc.fit`."""
        row = self.row
        bounds = {
            name: tuple(self._numbers(value, ("fit", "parameters", name)))
            for name, value in row["parameters"].items()
        }
        names, rows = _symbols(model), row["targets"]
        read = [self._target(item, ("fit", "targets", k), names) for k, item in enumerate(rows)]
        found: Arguments = {"targets": [item for item in read if item], "bounds": bounds}
        return found | {key: row[key] for key in OPTIONS if key in row}

    def _target(self, row: Any, address: Address, names: Mapping[str, sympy.Expr]) -> Target | None:
        """Return a target."""
        (kind,) = (kind for kind in TARGETS if kind in row)
        if kind == "moves":
            return targets.moves()
        options = {
            key: self._option(key, value, (*address, key))
            for key, value in row.items()
            if key != kind
        }
        what: Any = row[kind]
        if kind == "limit":
            what = self._limited(what, (*address, kind), names)
        known = len(self.problems)
        try:
            found: Target = getattr(targets, kind)(what, **options)
        except InputError as error:
            for problem in error.problems if len(self.problems) == known else ():
                self.problem(address, problem)
            return None
        return found

    def _option(self, key: str, value: Any, address: Address) -> Any:
        """Return the value of a field of a target."""
        if key == "title":
            return value
        if key in ("points", "poses"):
            return [self._numbers(item, (*address, k)) for k, item in enumerate(value)]
        if key in ("times", "values", "between"):
            return self._numbers(value, address)
        return self.finite(value, address)

    def _limited(
        self, text: str, address: Address, names: Mapping[str, sympy.Expr]
    ) -> str | float | sympy.Expr:
        """Return what has a limit: a column by its name, or else a formula."""
        is_name = name_problem(column_name(text), "a column") is None
        if is_name and (text not in names or column_name(text) != text):
            return text
        known = len(self.problems)
        found = as_sympy(self.expression(text, address, names))
        if len(self.problems) == known and not found.free_symbols:
            self.problem(address, "expected a column or a formula of parameters, not a number")
        return found

    def _numbers(self, value: Any, address: Address) -> list[float]:
        """Return a list of numbers, which may be formulas without names."""
        return [self.finite(item, (*address, k)) for k, item in enumerate(value)]


def _symbols(model: Mechanism) -> dict[str, sympy.Expr]:
    """Return the names that may stand in the formula of a limit."""
    system = model.system()
    named = [item.name for item in system.parameters]
    named += [item.name for item in system.coordinates]
    return {name: sympy.Symbol(name) for name in named}

"""The tables `tolerance`, `fit` and `transmission` of a model file: what commands are given.

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

[transmission]
inputs = ["left", "right"]
outputs = ["pitch", "roll"]
grid = { left = { from = 0.21, to = 0.24, count = 4 }, right = [0.22, 0.23] }
efforts = { pitch = 35 }
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.design import targets
from kincompile.design.deviation import Deviation
from kincompile.errors import InputError
from kincompile.files.data_text import listed_problems
from kincompile.files.file_format import fields_of
from kincompile.files.sweep_table import task_reader
from kincompile.model import tasks
from kincompile.model.expressions import as_sympy
from kincompile.names import column_name, listed, name_problem

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping

    from kincompile.files.data_lines import Address
    from kincompile.files.file_fields import FieldReader
    from kincompile.model.mechanism import Mechanism

    Arguments = dict[str, Any]


def read_tolerance(path: str | os.PathLike[str]) -> Arguments:
    """Return the arguments of `kc.tolerance` that the table `tolerance` of a model file says."""
    reader, table = _read(path, "tolerance")
    found = dict(vars(table))
    found["tolerances"] = {
        name: _made(reader, ("tolerance", "parameters", name), Deviation, **vars(item))
        if isinstance(item, tasks.Limits)
        else item
        for name, item in (found.pop("parameters") or {}).items()
    }
    return _checked(reader, found)


def read_fit(path: str | os.PathLike[str], model: Mechanism) -> Arguments:
    """Return the arguments of `kc.fit` that the table `fit` of a model file says."""
    reader, table = _read(path, "fit")
    found, names = dict(vars(table)), _symbols(model)
    found["bounds"] = found.pop("parameters")
    found["targets"] = [
        _target(reader, item, ("fit", "targets", k), names)
        for k, item in enumerate(found["targets"])
    ]
    return _checked(reader, found)


def read_transmission(path: str | os.PathLike[str]) -> Arguments:
    """Return inputs, outputs, values of inputs and efforts of the table of a model file."""
    reader, table = _read(path, "transmission")
    found = dict(vars(table))
    found["efforts"] = found["efforts"] or {}
    found["grid"] = {
        name: _values(reader, item, ("transmission", "grid", name))
        for name, item in (found["grid"] or {}).items()
    }
    return _checked(reader, found)


def _values(reader: FieldReader, item: Any, address: Address) -> list[float]:
    """Return the values of an input."""
    if not isinstance(item, tasks.Span):
        return list(item)
    if item.count is None:
        reader.problem(address, "give it a count of equally spaced values")
        return []
    found: list[float] = np.linspace(item.first, item.last, item.count).tolist()
    return found


def _read(path: str | os.PathLike[str], section: str) -> tuple[FieldReader, Any]:
    """Return what reads a file, and its table of a command as a declared class."""
    found = task_reader(path, section)
    if found is None:
        fields = listed(fields_of(section), 20)
        raise InputError(f"{path} has no table [{section}]. Add one; its fields are: {fields}.")
    reader, row = found
    table = reader.table(row, section, (section,))
    _checked(reader, {})
    return reader, table


def _checked(reader: FieldReader, found: Arguments) -> Arguments:
    """Return what was read, or raise what is wrong with it."""
    if reader.problems:
        raise listed_problems(reader.problems)
    return found


def _made(
    reader: FieldReader, address: Address, make: Callable[..., Any], *given: Any, **named: Any
) -> Any:
    """Return what a function makes of values; note what it refuses with the place in the file."""
    try:
        return make(*given, **named)
    except InputError as error:
        for problem in error.problems:
            reader.problem(address, problem)
        return None


def _target(
    reader: FieldReader, item: Any, address: Address, names: Mapping[str, sympy.Expr]
) -> Any:
    """Return a target; its first field is what it is of, the others are arguments."""
    kind = next(name for name, cls in tasks.TARGETS.items() if isinstance(item, cls))
    options = dict(vars(item))
    what: Any = options.pop(kind)
    if kind == "moves":
        return targets.moves()
    if kind == "limit":
        known = len(reader.problems)
        what = _limited(reader, what, (*address, kind), names)
        if len(reader.problems) > known:
            return None
    return _made(reader, address, getattr(targets, kind), what, **options)


def _limited(
    reader: FieldReader, text: str, address: Address, names: Mapping[str, sympy.Expr]
) -> str | sympy.Expr:
    """Return what has a limit: a column by its name, or else a formula."""
    is_name = name_problem(column_name(text), "a column") is None
    if is_name and (text not in names or column_name(text) != text):
        return text
    known = len(reader.problems)
    found = as_sympy(reader.expression(text, address, names))
    if len(reader.problems) == known and not found.free_symbols:
        reader.problem(address, "expected a column or a formula of parameters, not a number")
    return found


def _symbols(model: Mechanism) -> dict[str, sympy.Expr]:
    """Return the names that may stand in the formula of a limit."""
    system = model.system()
    named = [item.name for item in system.parameters]
    named += [item.name for item in system.coordinates]
    return {name: sympy.Symbol(name) for name in named}

"""The contract of an emitted module (docs/contract.md), as a check."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile import quantities
from kincompile.errors import ContractError, InputError
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Container, Iterator, Mapping
    from types import ModuleType

    from kincompile.quantities import Part, Quantity

FORMATS = (1, 2, quantities.FORMAT)
"""The formats of emitted modules that this version reads."""

REMEDY = "Emit it again with `kincompile compile MODEL -o FILE` of this version."

_CONSTANTS: dict[str, type] = {
    "NAME": str,
    "FORMAT": int,
    "FINGERPRINT": str,
    "N_COORDINATES": int,
    "N_EQUATIONS": int,
    "COORDINATES": tuple,
    "EQUATIONS": tuple,
    "PARAMETERS": tuple,
    "UNITS": dict,
    "DEFAULTS": np.ndarray,
    "GUESS": np.ndarray,
    "PATTERN": np.ndarray,
    "BODIES": tuple,
}


MARKS: Mapping[Part, str] = {
    "outputs": "OUTPUTS",
    "loads": "LOADS",
    "motion": "forward_dynamics",
}
"""By which name a module shows that it has the quantities of a part."""


def present_in(names: Container[str]) -> tuple[Quantity, ...]:
    """Return the quantities of a module with these names: of outputs, loads, motion if it can."""
    return quantities.quantities_of([part for part, mark in MARKS.items() if mark in names])


def functions(names: Container[str]) -> tuple[str, ...]:
    """Return the functions of an emitted module with these names."""
    present = present_in(names)
    matrices = (item.name for item in present if item.is_matrix)
    return (*quantities.functions(present), *(f"{name}_nonzeros" for name in matrices))


def check(module: ModuleType) -> None:
    """Check that a module keeps the contract, and make it raise the package's `InputError`.

    A `ContractError` has all that is wrong, and what to do.
    """
    names = vars(module)
    if names.get("FORMAT") == 1 and "BODIES" not in names:
        names["BODIES"] = _bodies(names.get("COORDINATES", ()))
    # Each stage relies on what the stage before has found to be right.
    for stage in (_format, _missing, _names, _sizes, _numbers):
        problems = [
            f"{module.__name__} is not a module that kincompile emitted: {problem}."
            for problem in stage(names)
        ]
        if problems:
            problems[-1] += f" {REMEDY}"
            raise ContractError(problems)
    names["InputError"] = InputError


def _format(names: Mapping[str, Any]) -> Iterator[str]:
    """Report a format that this version does not read; its names may well be others."""
    if "FORMAT" not in names:
        yield "FORMAT is missing; a model is read by kc.read_model and compiled by kc.compile"
    elif (given := names["FORMAT"]) not in FORMATS:
        yield f"its FORMAT is {given!r} and this version reads {listed(FORMATS)}"
    elif names.get("FORM") == "grouped" and "BLOCKS" not in names:
        yield "it has no BLOCKS, which a module in grouped form is solved by"


def _bodies(coordinates: object) -> tuple[tuple[str, int, int], ...]:
    """Return the bodies of a module of format 1, which has them in the names of coordinates."""
    names = coordinates if isinstance(coordinates, tuple) else ()
    bodies = ((k, str(name).removeprefix("x_")) for k, name in enumerate(names))
    columns = ((k, x, (f"x_{x}", f"y_{x}", f"phi_{x}")) for k, x in bodies)
    return tuple((x, k, 3) for k, x, own in columns if names[k : k + 3] == own)


def _missing(names: Mapping[str, Any]) -> Iterator[str]:
    """Report names that are absent or of the wrong kind."""
    for name, kind in _CONSTANTS.items():
        if name not in names:
            yield f"{name} is missing"
        elif not isinstance(names[name], kind):
            given = type(names[name]).__name__
            yield f"{name} is of type {given}, not {kind.__name__}"
    for name in functions(names):
        if not callable(names.get(name)):
            yield f"the function {name} is missing"


def _names(given: Mapping[str, Any]) -> Iterator[str]:
    """Report tuples of names of the wrong length, with a name twice, or with something else."""
    counts = {"COORDINATES": given["N_COORDINATES"], "EQUATIONS": given["N_EQUATIONS"]}
    for constant in ("COORDINATES", "EQUATIONS", "PARAMETERS"):
        names = given[constant]
        if not all(isinstance(name, str) for name in names):
            yield f"{constant} holds something else than names"
        elif len(set(names)) != len(names):
            yield f"{constant} has a name twice"
        elif len(names) != counts.get(constant, len(names)):
            yield f"{constant} has {len(names)} names, and N_{constant} is {counts[constant]}"


def _sizes(names: Mapping[str, Any]) -> Iterator[str]:
    """Report shapes that contradict the names."""
    n, k = names["N_COORDINATES"], len(names["PARAMETERS"])
    if (shape := names["DEFAULTS"].shape) != (k,):
        yield f"DEFAULTS has shape {shape}, and there are {k} PARAMETERS"
    if (shape := names["GUESS"].shape) != (n,):
        yield f"GUESS has shape {shape}, and there are {n} COORDINATES"
    named = *names["COORDINATES"], *names["PARAMETERS"]
    if without := [name for name in named if name not in names["UNITS"]]:
        yield f"UNITS does not say the unit of {listed(without)}"
    if (shape := names["PATTERN"].shape)[1:] != (2,):
        yield f"PATTERN has shape {shape}, not (nonzeros, 2)"


def _numbers(names: Mapping[str, Any]) -> Iterator[str]:
    """Report values that are not finite or out of range."""
    for name in ("DEFAULTS", "GUESS"):
        values = names[name]
        if values.dtype != np.float64 or not np.isfinite(values).all():
            yield f"{name} does not hold finite floating-point numbers only"
    pattern, m, n = names["PATTERN"], names["N_EQUATIONS"], names["N_COORDINATES"]
    if not np.issubdtype(pattern.dtype, np.integer):
        yield f"PATTERN holds {pattern.dtype}, not integers"
    elif np.any(pattern < 0) or np.any(pattern >= (m, n)):
        yield f"PATTERN points outside the {m} x {n} matrix Phi_q"
    elif np.any(np.diff(pattern[:, 0] * n + pattern[:, 1]) <= 0):
        yield "PATTERN does not go row by row"

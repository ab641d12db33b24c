"""The contract of an emitted module (docs/contract.md), as a check."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile import quantities
from kincompile.errors import ContractError, InputError
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
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
"""What modules have that have quantities of such parts."""


def present_in(module: ModuleType) -> tuple[Quantity, ...]:
    """Return the quantities of a module: of outputs, of loads and of motion where it has any."""
    return quantities.quantities_of([part for part, mark in MARKS.items() if hasattr(module, mark)])


def functions(module: ModuleType) -> tuple[str, ...]:
    """Return the functions of an emitted module."""
    present = present_in(module)
    matrices = (item.name for item in present if item.is_matrix)
    return (*quantities.functions(present), *(f"{name}_nonzeros" for name in matrices))


def check(module: ModuleType) -> None:
    """Check that a module keeps the contract, and make it raise the package's `InputError`.

    A `ContractError` has all that is wrong, and what to do.
    """
    if getattr(module, "FORMAT", None) == 1 and not hasattr(module, "BODIES"):
        module.__dict__["BODIES"] = _bodies(getattr(module, "COORDINATES", ()))
    # Each stage relies on what the stage before has found to be right.
    for stage in (_format, _missing, _names, _sizes, _numbers):
        problems = [
            f"{module.__name__} is not a module that kincompile emitted: {problem}."
            for problem in stage(module)
        ]
        if problems:
            problems[-1] += f" {REMEDY}"
            raise ContractError(problems)
    module.__dict__["InputError"] = InputError


def _format(module: ModuleType) -> Iterator[str]:
    """Report a format that this version does not read; its names may well be others."""
    if not hasattr(module, "FORMAT"):
        yield "FORMAT is missing; a model is read by kc.read_model and compiled by kc.compile"
    elif (given := module.FORMAT) not in FORMATS:
        yield f"its FORMAT is {given!r} and this version reads {listed(FORMATS)}"
    elif getattr(module, "FORM", None) == "grouped" and not hasattr(module, "BLOCKS"):
        yield "it has no BLOCKS, which a module in grouped form is solved by"


def _bodies(coordinates: object) -> tuple[tuple[str, int, int], ...]:
    """Return the bodies of a module of format 1, which has them in the names of coordinates."""
    names = coordinates if isinstance(coordinates, tuple) else ()
    found = []
    for k, name in enumerate(names):
        body = str(name).removeprefix("x_")
        if names[k : k + 3] == (f"x_{body}", f"y_{body}", f"phi_{body}"):
            found.append((body, k, 3))
    return tuple(found)


def _missing(module: ModuleType) -> Iterator[str]:
    """Report names that are absent or of the wrong kind."""
    for name, kind in _CONSTANTS.items():
        if not hasattr(module, name):
            yield f"{name} is missing"
        elif not isinstance(getattr(module, name), kind):
            given = type(getattr(module, name)).__name__
            yield f"{name} is of type {given}, not {kind.__name__}"
    for name in functions(module):
        if not callable(getattr(module, name, None)):
            yield f"the function {name} is missing"


def _names(module: ModuleType) -> Iterator[str]:
    """Report tuples of names of the wrong length, with a name twice, or with something else."""
    counts = {"COORDINATES": module.N_COORDINATES, "EQUATIONS": module.N_EQUATIONS}
    for constant in ("COORDINATES", "EQUATIONS", "PARAMETERS"):
        names = getattr(module, constant)
        if not all(isinstance(name, str) for name in names):
            yield f"{constant} holds something else than names"
        elif len(set(names)) != len(names):
            yield f"{constant} has a name twice"
        elif len(names) != counts.get(constant, len(names)):
            yield f"{constant} has {len(names)} names, and N_{constant} is {counts[constant]}"


def _sizes(module: ModuleType) -> Iterator[str]:
    """Report shapes that contradict the names."""
    n, k = module.N_COORDINATES, len(module.PARAMETERS)
    if module.DEFAULTS.shape != (k,):
        yield f"DEFAULTS has shape {module.DEFAULTS.shape}, and there are {k} PARAMETERS"
    if module.GUESS.shape != (n,):
        yield f"GUESS has shape {module.GUESS.shape}, and there are {n} COORDINATES"
    without = [name for name in module.COORDINATES + module.PARAMETERS if name not in module.UNITS]
    if without:
        yield f"UNITS does not say the unit of {listed(without)}"
    if module.PATTERN.ndim != 2 or module.PATTERN.shape[1] != 2:
        yield f"PATTERN has shape {module.PATTERN.shape}, not (nonzeros, 2)"


def _numbers(module: ModuleType) -> Iterator[str]:
    """Report values that are not finite or out of range."""
    for name in ("DEFAULTS", "GUESS"):
        values = getattr(module, name)
        if values.dtype != np.float64 or not np.isfinite(values).all():
            yield f"{name} does not hold finite floating-point numbers only"
    pattern, n = module.PATTERN, module.N_COORDINATES
    if not np.issubdtype(pattern.dtype, np.integer):
        yield f"PATTERN holds {pattern.dtype}, not integers"
    elif np.any(pattern < 0) or np.any(pattern >= (module.N_EQUATIONS, n)):
        yield f"PATTERN points outside the {module.N_EQUATIONS} x {n} matrix Phi_q"
    elif np.any(np.diff(pattern[:, 0] * n + pattern[:, 1]) <= 0):
        yield "PATTERN does not go row by row"

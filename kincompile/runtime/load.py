"""From the text of an emitted module to a module that is known to keep the contract.

An emitted module is a Python file and loading it runs it: load only files that you trust. Its
contract, docs/contract.md, is a check.
"""

from __future__ import annotations

import linecache
import zlib
from functools import lru_cache, partial
from importlib.util import decode_source
from pathlib import Path
from types import CodeType, ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile import quantities
from kincompile.errors import ContractError, InputError
from kincompile.names import listed
from kincompile.runtime.engine.code import ORIGIN, attach, functions
from kincompile.runtime.memory import empty
from kincompile.runtime.results.html import module_html

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

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


def load(path: str | os.PathLike[str]) -> ModuleType:
    """Run the file of an emitted module, and check that it keeps the contract.

    The file is a Python program: all of it runs before anything is checked. Load only files that
    you trust.

    The search path, the module cache and the file's folder stay as they are: two files of the same
    name do not disturb each other, and a file that was emitted again a moment ago is read afresh.

    Parameters
    ----------
    path : path-like
        A .py file that ``kincompile compile`` or ``kc.emit`` wrote.

    Returns
    -------
    module
        With the constants and functions that every emitted module has.

    Raises
    ------
    InputError
        When the file cannot be read.
    ContractError
        When it is not an emitted module, or one that this version cannot use.
    """
    file = Path(path)
    return _fill(ModuleType(file.stem), str(file.absolute()), _text(file))


def from_source(
    source: str, name: str, arrays: Mapping[str, NDArray[Any]] | None = None
) -> ModuleType:
    """Make a module from emitted text, in memory, and check that it keeps the contract.

    The name is for messages and tracebacks, which show the text as they would for a file, and so
    does `inspect.getsource`. The arrays are what the module would read from the companion file
    beside it.
    """
    # The checksum keeps the lines of two mechanisms of one name apart; the same text takes the
    # same place, so that compiling again and again does not fill the cache.
    filename = f"<kincompile {name} {zlib.crc32(source.encode()):08x}>"
    # Without a modification time `linecache.checkcache` leaves the entry alone.
    linecache.cache[filename] = (len(source), None, source.splitlines(keepends=True), filename)
    module = ModuleType(name)
    if arrays:
        vars(module)["ARRAYS_OF_COMPANION"] = dict(arrays)
    vars(module)[ORIGIN] = name, source, arrays or {}, {}
    return _fill(module, filename, source)


def _text(file: Path) -> str:
    """Read Python source with the encoding that it declares."""
    try:
        return decode_source(file.read_bytes())
    except FileNotFoundError:
        raise InputError(f"cannot load {file}: there is no such file. Check the path.") from None
    except IsADirectoryError:
        raise InputError(f"cannot load {file}: it is a folder. Give the .py file in it.") from None
    except OSError as error:
        raise InputError(f"cannot load {file}: {error.strerror}. Check the file.") from error
    except (SyntaxError, UnicodeDecodeError) as error:
        raise ContractError(f"{file} is not the text of a Python module. {REMEDY}") from error


@lru_cache
def _code(filename: str, source: str) -> CodeType:
    """Return the code of a module's text: Python takes as long to read it as all else takes."""
    return compile(source, filename, "exec")


def _fill(module: ModuleType, filename: str, source: str) -> ModuleType:
    """Run a module's text in it and check the result."""
    module.__file__, names = filename, vars(module)
    try:
        exec(_code(filename, source), names)
    except SyntaxError as error:
        raise ContractError(
            f"{filename} is not a Python module: {error.msg} in line {error.lineno}. {REMEDY}"
        ) from error
    except Exception as error:
        raise ContractError(
            f"{filename} cannot be loaded: {type(error).__name__}: {error}. {REMEDY}"
        ) from error
    check(module)
    names["_empty"] = empty
    names["_repr_html_"] = partial(module_html, attach(module))
    return module


def with_text(module: ModuleType, text: str, what: str) -> Mapping[str, Any]:
    """Run more text of a module, which stays as it is; return all names then."""
    names = dict(vars(module))
    exec(compile(text, f"<kincompile {module.__name__}, {what}>", "exec"), names)
    return names


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

"""From the text of an emitted module to a module that is known to keep the contract.

An emitted module is a Python file and loading it runs it: load only files that you trust.
"""

from __future__ import annotations

import linecache
import zlib
from functools import partial
from importlib.util import decode_source
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from kincompile.errors import ContractError, InputError
from kincompile.runtime.contract import REMEDY, check
from kincompile.runtime.engine.code import attach
from kincompile.runtime.memory import empty
from kincompile.runtime.results.html import module_html

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from typing import Any

    from numpy.typing import NDArray


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


def _fill(module: ModuleType, filename: str, source: str) -> ModuleType:
    """Run a module's text in it and check the result."""
    module.__file__, names = filename, vars(module)
    try:
        exec(compile(source, filename, "exec"), names)
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

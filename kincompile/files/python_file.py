"""A model in a Python file: the file is run, and its one mechanism is taken.

A data file never runs code; a Python file does, with all that this means: run only what you trust.
"""

from __future__ import annotations

import sys
import traceback
from contextlib import contextmanager
from importlib.util import decode_source
from types import ModuleType
from typing import TYPE_CHECKING, Any

from kincompile.errors import InternalError, KincompileError, ModelError
from kincompile.model.mechanism import Mechanism
from kincompile.model.sketch import Sketch
from kincompile.model.system import ConstraintSystem
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

PREFERRED = ("mechanism", "system", "m")
"""The names that decide where a file has several models, the first one first."""

MODULE_NAME = "kincompile_model"
"""The `__name__` of a file while it runs: not "__main__", so that its script part does not run."""

_NUMBERS_ONLY = ("Cannot convert expression to float", "loop of ufunc does not support argument")
"""Messages of Python and NumPy where a function that takes numbers only gets a symbol."""

_COMPILED = ("FORMAT", "FINGERPRINT", "N_COORDINATES")


def read_python(path: Path, content: bytes) -> Mechanism | ConstraintSystem:
    """Run a Python file and return its one mechanism or system at module level.

    Parameters
    ----------
    path
        The file; its folder can be imported from while it runs, as by ``python FILE``.

    Raises
    ------
    ModelError
        If the file is not Python or raises an exception, with file and line; if it has no model, or
        several of which none is called `mechanism`, `system` or `m`; if it is an emitted module.
    """
    names = _run(path, content)
    if all(name in names for name in _COMPILED):
        raise ModelError(
            f"{path} is a compiled module already, not a model. Give the model it was compiled "
            f"from; to use the module: kc.solve(kc.load({str(path)!r}), t)."
        )
    return _only_model(path, names)


def _run(path: Path, content: bytes) -> dict[str, Any]:
    try:
        code = compile(decode_source(content), str(path), "exec")
    except SyntaxError as error:
        line = f", line {error.lineno}" if error.lineno else ""
        text = f": {error.text.strip()}" if error.text else ""
        raise ModelError(f"{path}{line}: this is not Python, {error.msg}{text}") from error
    except ValueError as error:  # undecodable, or null bytes
        raise ModelError(f"{path}: this is not the text of a Python file, {error}.") from error
    module = ModuleType(MODULE_NAME)
    module.__file__ = str(path.absolute())
    with _importable(module, path):
        try:
            exec(code, module.__dict__)
        except (Exception, SystemExit) as error:
            raise _explained(path, error) from error
    return module.__dict__


@contextmanager
def _importable(module: ModuleType, path: Path) -> Iterator[None]:
    """Let a file import its neighbours, and be found where the module of a class is looked up."""
    before = sys.path.copy()
    sys.modules[module.__name__] = module
    sys.path.insert(0, str(path.absolute().parent))
    try:
        yield
    finally:
        sys.path[:] = before
        sys.modules.pop(module.__name__, None)


def _explained(path: Path, error: BaseException) -> KincompileError:
    """Turn what a file raised into one error with file, line and text."""
    if isinstance(error, InternalError):
        return error
    steps = traceback.walk_tb(error.__traceback__)
    line = [number for frame, number in steps if frame.f_code.co_filename == str(path)][-1]
    if isinstance(error, KincompileError):
        what = str(error)
    elif isinstance(error, SystemExit):
        what = f"the file ends the program, sys.exit({error.code!r}); a model file must run through"
    else:
        what = f"{type(error).__name__}: {error}".rstrip(": ")
        if any(part in what for part in _NUMBERS_ONLY):
            what += "; of kc.t and parameters take SymPy's functions: sympy.sin, not math.sin"
        elif "truth value of Relational" in what:
            what += "; a choice that depends on kc.t is a sympy.Piecewise"
    return ModelError(f"{path}, line {line}: {what}")


def _only_model(path: Path, names: Mapping[str, Any]) -> Mechanism | ConstraintSystem:
    """Return the one model among the names of a file, or the one with a preferred name."""
    models = {
        name: value
        for name, value in names.items()
        if isinstance(value, Mechanism | ConstraintSystem)
    }
    if not models:
        others = [name for name in names if not name.startswith("_")]
        drawn = next((name for name, value in names.items() if isinstance(value, Sketch)), "s")
        raise ModelError(
            f"{path} has no Mechanism and no ConstraintSystem at module level; assign one to a "
            f'name there, for instance mechanism = kc.Mechanism("name"), or, of a kc.Sketch, '
            f"mechanism = {drawn}.mechanism(). Its names are: {listed(others)}"
        )
    for name in PREFERRED:
        if name in models:
            return models[name]
    if len({id(model) for model in models.values()}) > 1:
        found = listed(f"{name} ({type(model).__name__})" for name, model in models.items())
        raise ModelError(
            f"{path} has several models: {found}. Call the one that is meant "
            f"{' or '.join(PREFERRED)}, or keep each in a file of its own"
        )
    return next(iter(models.values()))

"""kincompile: a symbolic-to-numeric compiler for the kinematics of mechanisms.

    import kincompile as kc

Public names are loaded when they are first used, so that the runtime works without SymPy being
imported. `__init__.pyi` lists them, for type checkers and for this file.
"""

from __future__ import annotations

import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from kincompile.names import suggestion

_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_LINES = re.findall(r"^from (\S+) import (\w+) as \w+(?: +# (.*))?$", _STUB, re.MULTILINE)
_HOME = {name: module for module, name, _ in _LINES}
_LATER = {name for module, name, kind in _LINES if "result" in kind or module.endswith(".errors")}
"""What no one types first: what calls return, errors and warnings."""
_CATALOGUE = "kincompile.model.catalogue"
_FUNCTIONS = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "sqrt")
_WITHOUT_SYMPY = ("kincompile.runtime", "kincompile.errors")

__version__ = "0.2.0"


def __getattr__(name: str) -> Any:
    if name == "__all__":
        return sorted((*_HOME, *_constraint_types()))
    if name.startswith("__"):  # what tools ask any module for, a thousand times: no advice
        raise AttributeError(f"module 'kincompile' has no attribute {name!r}")
    homes = _HOME
    if name not in homes and (name[:1].isupper() or _CATALOGUE in sys.modules):
        homes = _HOME | dict.fromkeys(_constraint_types(), _CATALOGUE)
    if name not in homes:
        catalogue = sys.modules.get(_CATALOGUE)
        near = (catalogue.meant_by(name) if catalogue else "") or suggestion(name, homes)
        near = f"; functions are SymPy's: sympy.{name}" if name in _FUNCTIONS else near
        raise AttributeError(f"module 'kincompile' has no attribute {name!r}{near}")
    module = homes[name]
    if not module.startswith(_WITHOUT_SYMPY):
        # Models need these without importing them: the text of a file, pictures in a notebook.
        import_module("kincompile.files.write_model")
        if "IPython" in sys.modules:
            import_module("kincompile.view.notebook")
    home = import_module(module)
    value = globals()[name] = getattr(home, name, None) or import_module(f"{module}.{name}")
    return value


def _constraint_types() -> tuple[str, ...]:
    """Return the names of all types of constraints, for which SymPy is loaded."""
    names: tuple[str, ...] = import_module(_CATALOGUE).__all__
    return names


def __dir__() -> list[str]:
    return [*sorted({*__getattr__("__all__")} - _LATER), "__version__"]

"""Which model a module was compiled from in this process, for what is drawn beside its motion."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from types import ModuleType

    from kincompile.model.system import ConstraintSystem

# An emitted module holds numbers and code only; what it looked like is remembered beside it.
_ORIGINS: WeakKeyDictionary[ModuleType, ConstraintSystem] = WeakKeyDictionary()


def remember_model(module: ModuleType, system: ConstraintSystem) -> ModuleType:
    """Note the system that a module was compiled from, and return the module."""
    _ORIGINS[module] = system
    return module


def model_of(module: ModuleType | None) -> ConstraintSystem | None:
    """Return the system that a module was compiled from; None for one loaded from a file."""
    return None if module is None else _ORIGINS.get(module)

"""Modules written by hand to the contract, so that these tests need no compiler."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from kincompile.runtime.load import from_source, load

MODULES = Path(__file__).parent / "modules"


@pytest.fixture
def pendulum() -> ModuleType:
    """Case R1."""
    return load(MODULES / "pendulum.py")


@pytest.fixture
def problem_3_5_6() -> ModuleType:
    """Case R3."""
    return load(MODULES / "problem_3_5_6.py")


@pytest.fixture
def example_3_7_5() -> ModuleType:
    """Case R4."""
    return load(MODULES / "example_3_7_5.py")


@pytest.fixture
def four_bar() -> ModuleType:
    """Case R11."""
    return load(MODULES / "four_bar.py")


@pytest.fixture
def edited() -> Callable[..., ModuleType]:
    """Give a function that loads a module with parts of its text replaced."""

    def edit(name: str, *replacements: tuple[str, str]) -> ModuleType:
        source = (MODULES / f"{name}.py").read_text(encoding="utf-8")
        for old, new in replacements:
            assert old in source, f"{old!r} is not in {name}.py: the edit would change nothing"
            source = source.replace(old, new)
        return from_source(source, name)

    return edit

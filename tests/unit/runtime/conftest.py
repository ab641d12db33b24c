"""Modules written by hand to the contract, so that these tests need no compiler."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import kincompile as kc
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


PIN = 0.99
"""How far beside the line of its slider the pin of a rod of length 1 is: nearly a dead centre."""


def nearly_dead_slider(unit):
    """Return a slider with a rod so long, both of its positions, and guesses near the first.

    These lie beyond the dead centre by the angle of the rod, and Newton's steps go there.
    """
    m = kc.Mechanism("slider")
    rod, block = (m.body(name, guess=(0, 0, 0)) for name in ("rod", "block"))
    m.add(kc.Revolute("A", m.ground, (0, PIN * unit), rod, (0, 0)))
    m.add(kc.Revolute("B", rod, (unit, 0), block, (0, 0)))
    m.add(kc.Translational("line", m.ground, (0, 0), (1, 0), block, (0, 0), (1, 0)))
    lengths = np.array([unit, unit, 1, unit, unit, 1])
    reach = np.sqrt(1 - PIN**2)
    sides = np.array([(0, PIN, np.arctan2(-PIN, x), x, 0, 0) for x in (reach, -reach)])
    guesses = np.array(
        [
            [0.022, 0.953, -1.888, 0.064, 0.05, 0.413],
            [0.03, 0.972, -1.794, 0.177, 0.004, -0.19],
            [-0.078, 0.968, -1.851, 0.165, -0.036, 0.203],
        ]
    )
    return m, sides * lengths, guesses * lengths

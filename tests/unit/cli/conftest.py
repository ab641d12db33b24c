"""Models as text, and the ways to run the command line."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from kincompile.cli import cli

PENDULUM = """
import kincompile as kc

mechanism = kc.Mechanism("pendulum", end=2.0, points=5)
length = mechanism.parameter("length", 1.0, unit="m")
bob = mechanism.body("bob", guess=(1, 0, 0.5))
mechanism.add(kc.Revolute("pin", bob, (-length, 0), mechanism.ground, (0, 0)))
mechanism.add(kc.AbsoluteAngle("motor", bob, 0.5 + 2 * kc.t))
"""

# x^2 = 1 - t: after t = 1 there is no solution.
SLIDER_THAT_STOPS = """
import kincompile as kc
import sympy

x = sympy.Symbol("x")
system = kc.ConstraintSystem("stops", [x], [x**2 - 1 + kc.t], guess=(1,), end=2.0, points=6)
"""


@pytest.fixture
def pendulum(tmp_path: Path) -> Path:
    """Return the file of a driven pendulum: 3 coordinates, one parameter, 5 points to t = 2."""
    path = tmp_path / "pendulum.py"
    path.write_text(PENDULUM, encoding="utf-8")
    return path


@pytest.fixture
def stopping(tmp_path: Path) -> Path:
    """Return the file of a system without a solution after t = 1, of 6 points to t = 2."""
    path = tmp_path / "stops.py"
    path.write_text(SLIDER_THAT_STOPS, encoding="utf-8")
    return path


@pytest.fixture
def kincompile() -> Callable[..., Result]:
    """Return the command line as a function in this process."""
    return lambda *arguments: CliRunner().invoke(cli, [str(part) for part in arguments])


@pytest.fixture
def process() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Return the command line as a process of its own."""

    def run(*arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "kincompile", *map(str, arguments)]
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
        return subprocess.run(command, text=True, check=False, timeout=120, **streams)

    return run

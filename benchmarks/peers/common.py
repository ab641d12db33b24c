"""What the contenders have in common: their interface, the equations in SymPy, C compilation."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import sympy
from numpy.typing import NDArray

from benchmarks import textbook

if TYPE_CHECKING:
    from pathlib import Path

    from benchmarks.linkages import Linkage

Vector: TypeAlias = NDArray[np.float64]
Motion: TypeAlias = tuple[Vector, Vector, Vector]
"""q, q_dot and q_ddot, (N, n) each."""

Analysis: TypeAlias = Callable[[Vector], Motion]
"""A whole analysis: from times (N,) to the motion."""

TOLERANCE = 1e-10
MAX_ITERATIONS = 25


class Skipped(Exception):  # noqa: N818 - nothing is wrong
    """A contender cannot run here; the message is the reason that the tables show."""


def optional(name: str) -> Any:
    """Import a package, or return None where it is not installed."""
    try:
        return import_module(name)
    except ImportError:
        return None


def require(package: Any, name: str) -> None:
    """Check that an optional package is there."""
    if package is None:
        raise Skipped(f"{name} is not installed")


def derived(linkage: Linkage) -> textbook.Derived:
    """Return Phi, Phi_q, nu and gamma of a mechanism as SymPy derives them from Phi."""
    n = len(linkage.guess)
    q, q_dot = ([sympy.Symbol(f"{name}{k}") for k in range(n)] for name in ("q", "w"))
    p = [sympy.Symbol(name) for name in linkage.parameters]
    rows = linkage.residual(sympy, q, textbook.t, p)
    return textbook.derive(textbook.Equations(q, q_dot, p, sympy.Matrix(rows)))


FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math")
"""Those of docs/in_c.md, for everyone's C."""


def compiled_c(source: Path, *more: str) -> ctypes.CDLL:
    """Compile a C file for this machine, -O3, and load it."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise Skipped("no C compiler")
    library = source.with_suffix(".so")
    options = (*FLAGS, *more, "-shared", "-fPIC", "-w")
    subprocess.run([compiler, *options, str(source), "-o", str(library), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def empty_motion(*shape: int) -> Motion:
    """Return arrays for position, velocity and acceleration."""
    return np.empty(shape), np.empty(shape), np.empty(shape)


def pointer(array: Vector) -> ctypes.c_void_p:
    """Return where an array's numbers are."""
    return array.ctypes.data_as(ctypes.c_void_p)

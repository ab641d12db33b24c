"""Counts: do the equations suffice to determine the coordinates, and which do they leave open."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kincompile.names import listed
from kincompile.structure.blocks import matching

if TYPE_CHECKING:
    from kincompile.model.system import ConstraintSystem

Pattern = Sequence[tuple[int, int]] | NDArray[np.intp]
"""Row and column of each entry of Phi_q that is not identically zero."""


LEFT_FREE = (
    "; or leave them free: kc.simulate gives the motion that follows from its masses and forces, "
    "kc.equilibrium where it rests"
)
"""The alternative to more drivers for a mechanism with loads."""


def unmatched(system: ConstraintSystem, pattern: Pattern) -> tuple[list[str], list[str]]:
    """Return the names of equations and coordinates that a maximum matching leaves over."""
    names = [item.name for item in system.coordinates]
    matched = matching(pattern, (len(system.equations), len(names))).tolist()
    equations = [name for name, column in zip(system.equations, matched, strict=True) if column < 0]
    taken = set(matched)
    return equations, [name for column, name in enumerate(names) if column not in taken]


def counting_problem(
    system: ConstraintSystem, pattern: Pattern, dependent: Sequence[str] = ()
) -> str:
    """Return what is wrong with the numbers of equations and coordinates, "" where nothing is.

    It has the counts, the coordinates that nothing determines or the equations that are too many,
    and what to do. Equations known to depend on others are named before those that a matching
    leaves over.
    """
    n, m = len(system.coordinates), len(system.equations)
    equations, coordinates = unmatched(system, pattern)
    if n == m and not equations:
        return ""
    count = f"{system.name!r} has {m} equations for {n} coordinates"
    drivers = [item.name for item in system.constraints if item.is_driver]
    counted = f"{count} (drivers: {listed(drivers)}; {_counts(system)})"
    if m < n:
        return _too_few(counted, n - m, coordinates) + (LEFT_FREE if system.loads else "")
    if m > n:
        return _too_many(counted, m - n, dependent or equations)
    return _mismatch(counted, equations, coordinates)


def _counts(system: ConstraintSystem) -> str:
    parts = [f"{item.name} {len(item.equation_names)}" for item in system.constraints]
    return f"equations of each constraint: {listed(parts, most=40)}"


def _too_few(counted: str, missing: int, coordinates: Sequence[str]) -> str:
    return (
        f"{counted}: {missing} more {_equations(missing)} needed before it can be analysed. "
        f"Nothing determines, for instance, {listed(coordinates)}; add a joint or a driver there "
        "(a driver is a constraint whose value is a function of kc.t)"
    )


def _too_many(counted: str, surplus: int, equations: Sequence[str]) -> str:
    return (
        f"{counted}: {surplus} {_equations(surplus)} too many. Candidates to remove: "
        f"{listed(equations)}; remove a driver or a redundant joint, or replace a Revolute by a "
        "constraint with fewer equations"
    )


def _mismatch(counted: str, equations: Sequence[str], coordinates: Sequence[str]) -> str:
    return (
        f"{counted}, but they cannot determine them: the equations {listed(equations)} only "
        f"repeat what others fix, and nothing determines {listed(coordinates)}; move a driver or "
        "a joint from the first to the second"
    )


def _equations(count: int) -> str:
    return "equation is" if count == 1 else "equations are"

"""The generic rank of a system, by the interpreter, and what it means for compiling."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import StructuralError
from kincompile.ir.interpret import interpret
from kincompile.names import listed
from kincompile.structure.counting import require_square
from kincompile.structure.rank import RankReport, generic_rank

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.ir.program import Program
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.counting import Pattern


def rank_report(system: ConstraintSystem, program: Program) -> RankReport:
    """Return the rank of a system at generic assembled states, with default parameters."""

    def evaluate(
        q: NDArray[np.float64], t: NDArray[np.float64]
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        Phi, Phi_q, _, _ = interpret(program, q, np.zeros_like(q), t)
        return Phi, Phi_q

    return generic_rank(
        evaluate,
        np.array([item.guess for item in system.coordinates]),
        np.array([item.unit == "rad" for item in system.coordinates]),
        driver_rows(system),
        float(system.end),
    )


def driver_rows(system: ConstraintSystem) -> list[int]:
    """Return the rows of constraints that are functions of time."""
    return [
        first + row
        for item, first in zip(system.constraints, system.row_offsets, strict=True)
        if item.is_driver
        for row in range(len(item.equation_names))
    ]


def redundant_equations(
    system: ConstraintSystem, program: Program, pattern: Pattern
) -> tuple[str, ...]:
    """Check that the equations determine the coordinates; return those that are redundant.

    Returns
    -------
    tuple of str
        Nothing where there are as many equations as coordinates. Where there are more: equations of
        joints that depend on others at every assembled position, and agree with them.

    Raises
    ------
    StructuralError
        Where there are too few equations, or too many that do not agree, or drivers too many.
    """
    m, n = len(system.equations), len(system.coordinates)
    if m <= n:
        require_square(system, pattern)
        return ()
    report = rank_report(system, program)
    names = system.equations
    drivers = set(driver_rows(system))
    surplus = len(report.redundant) == m - n and drivers.isdisjoint(report.redundant)
    if surplus and drivers and report.rank == n and report.assembled:
        return tuple(names[row] for row in report.redundant)
    try:
        require_square(system, pattern)
    except StructuralError as error:
        raise StructuralError(f"{error}{_findings(system, report)}") from None
    return ()


def _findings(system: ConstraintSystem, report: RankReport) -> str:
    """Return what the rank adds to the counts."""
    sentences = [""]
    for verb, rows in (("conflicts with", report.conflicting), ("repeats", report.redundant)):
        for row in rows:
            others = listed(partner_constraints(system, report, row))
            sentences.append(f"{system.equations[row]} {verb} {others}")
    if report.free:
        free = [system.coordinates[column].name for column in report.free]
        sentences.append(f"at assembled positions {listed(free)} may still move")
    return ". ".join(sentences)


def partner_constraints(system: ConstraintSystem, report: RankReport, row: int) -> list[str]:
    """Return the names of the constraints that a dependent row is a combination of."""
    rows = set(report.partners[row])
    return [
        item.name
        for item, first in zip(system.constraints, system.row_offsets, strict=True)
        if rows & set(range(first, first + len(item.equation_names)))
    ]


def redundancy_warning(system: ConstraintSystem, redundant: tuple[str, ...]) -> str:
    """Return what to tell of redundant equations that agree with the others."""
    owners = [item for item in system.constraints if set(item.equation_names) & set(redundant)]
    joints = listed(item.name for item in owners)
    return (
        f"{system.name!r} is redundant: {listed(redundant)} repeats what the other joints demand, "
        "as long as the lengths are exactly what they are. All equations are solved together in "
        "the sense of least squares, and whether they agree is checked at every point. To remove "
        f"it, replace {joints} by a constraint with one equation less (a Revolute by a "
        "RevoluteTranslational or a Distance), or leave out the bar"
    )

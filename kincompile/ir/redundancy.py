"""The generic rank of a system, by the interpreter, and what it means for compiling."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import turning
from kincompile.errors import StructuralError
from kincompile.ir.interpret import interpret
from kincompile.model.resolve import Joint
from kincompile.names import listed
from kincompile.structure.choice import rows_left_out
from kincompile.structure.counting import counting_problem
from kincompile.structure.rank import RankReport, generic_rank
from kincompile.structure.remedies import least_squares_will_do, surpluses

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kincompile.ir.program import Program
    from kincompile.model.resolve import FreeEquation
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.counting import Pattern
    from kincompile.structure.rank import Evaluate
    from kincompile.structure.remedies import Surplus


def rank_report(
    system: ConstraintSystem, program: Program, guess: NDArray[np.float64] | None = None
) -> RankReport:
    """Return the rank of a system at generic assembled states, with default parameters.

    The guess, shape (n,), is where it is meant to be assembled; without it, the system's own.
    """
    return generic_rank(
        _evaluation(program),
        np.array([item.guess for item in system.coordinates]) if guess is None else guess,
        np.array(turning((item.unit for item in system.coordinates), system.body_columns)),
        driver_rows(system),
        _rows(system, lambda item: isinstance(item, Joint) and item.written.is_own),
        float(system.end),
        system.equations,
    )


def _evaluation(program: Program) -> Evaluate:
    """Return what gives Phi and Phi_q at states, with default parameters."""

    def evaluate(
        q: NDArray[np.float64], t: NDArray[np.float64]
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        Phi, Phi_q, *_ = interpret(program, q, np.zeros_like(q), t)
        return Phi, Phi_q

    return evaluate


def driver_rows(system: ConstraintSystem) -> list[int]:
    """Return the rows of constraints that are functions of time."""
    return _rows(system, lambda item: item.is_driver)


def _rows(system: ConstraintSystem, wanted: Callable[[Joint | FreeEquation], bool]) -> list[int]:
    """Return the rows of some of the constraints."""
    return [
        first + row
        for item, first in zip(system.constraints, system.row_offsets, strict=True)
        if wanted(item)
        for row in range(len(item.equation_names))
    ]


def redundant_equations(
    system: ConstraintSystem, program: Program, pattern: Pattern
) -> tuple[tuple[str, ...], str, str]:
    """Return which of more equations than coordinates the solve leaves out.

    They depend on others at every assembled position. With them come a warning about them, and
    what is wrong: nothing where they agree with the others.
    """
    report = rank_report(system, program)
    found = surpluses(system, report)
    if least_squares_will_do(system, report):
        joints = [
            range(first, first + len(item.equation_names))
            for item, first in zip(system.constraints, system.row_offsets, strict=True)
            if isinstance(item, Joint) and not item.is_driver
        ]
        rows = rows_left_out(_evaluation(program), report, float(system.end), joints)
        left_out = tuple(system.equations[row] for row in rows)
        return left_out, _warning(system, found, left_out), ""
    names = [name for item in found for name in item.equations]
    sentences = [counting_problem(system, pattern, names)]
    sentences += [f"{item.text}; {item.remedy}" for item in found]
    if report.free:
        free = [system.coordinates[column].name for column in report.free]
        sentences.append(f"at assembled positions {listed(free)} may still move")
    return (), "", ". ".join(sentences)


def independence(
    system: ConstraintSystem, program: Program
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return equations that repeat others, and free coordinates; refuse what contradicts others."""
    report = rank_report(system, program)
    if report.conflicting:
        found = [item for item in surpluses(system, report) if item.conflicting]
        sentences = ". ".join(f"{item.text}; {item.remedy}" for item in found)
        raise StructuralError(f"{system.name}: {sentences}.")
    equations = tuple(system.equations[row] for row in report.redundant)
    return equations, tuple(system.coordinates[column].name for column in report.drive)


def _warning(system: ConstraintSystem, found: Sequence[Surplus], left_out: Sequence[str]) -> str:
    """Return the warning about consistent redundant equations."""
    sentences = ". ".join(f"{item.text}; to remove it, {item.remedy}" for item in found)
    said = {name for item in found for name in item.equations}
    others = "" if said == set(left_out) else f". Left out of the solve are {listed(left_out)}"
    return (
        f"{system.name!r} has redundant equations: the others are solved, and whether these "
        f"agree is checked at every point. {sentences}{others}"
    )

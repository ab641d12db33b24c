"""What a system is made of, counted: bodies, constraints, rows and columns, mobility, sparsity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.html import Shown
from kincompile.model.resolve import Joint
from kincompile.structure.blocks import parts_of
from kincompile.structure.counting import counting_problem, unmatched
from kincompile.structure.findings import ConstraintEntry, Findings, Mobility, NamedBlock
from kincompile.structure.remedies import (
    held_advice,
    least_squares_will_do,
    rank_problem,
    surpluses,
)
from kincompile.structure.report_text import report_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.model.resolve import FreeEquation
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.counting import Pattern
    from kincompile.structure.rank import RankReport
    from kincompile.structure.remedies import MissingDriver


@dataclass(frozen=True, slots=True, repr=False)
class Inspection(Shown, Findings):
    """What `kc.inspect` finds, with its text; see `Findings` for what it holds."""

    def to_text(self) -> str:
        """Return everything as plain text tables; rows and columns count from 0."""
        return report_text(self)


def inspect_system(
    system: ConstraintSystem,
    pattern: Pattern,
    ranks: RankReport,
    missing: tuple[MissingDriver, ...],
) -> Inspection:
    """Count equations, coordinates and degrees of freedom of a checked system.

    Given are the pattern of its Phi_q, its rank, and the drivers that it lacks.
    """
    equations, coordinates = unmatched(system, pattern)
    names, columns = system.equations, [item.name for item in system.coordinates]
    entries = sorted((int(row), int(column)) for row, column in pattern)
    shape = len(names), len(columns)
    whole = parts_of(entries, shape)
    independent = [(row, column) for row, column in entries if row not in ranks.partners]

    def named(rows: Sequence[int], at: Sequence[int]) -> NamedBlock:
        return NamedBlock(tuple(names[row] for row in rows), tuple(columns[k] for k in at))

    return Inspection(
        name=system.name,
        bodies=system.bodies,
        coordinates=system.coordinates,
        parameters=system.parameters,
        constraints=tuple(map(_entry, system.constraints, system.row_offsets)),
        limits=system.limits,
        mobility=gruebler(system),
        pattern=tuple(entries),
        unmatched_equations=tuple(equations),
        unmatched_coordinates=tuple(coordinates),
        problem=_problem(system, pattern, ranks),
        rank=ranks.rank,
        redundant=tuple(names[row] for row in ranks.redundant),
        conflicting=tuple(names[row] for row in ranks.conflicting),
        held=system.held,
        holds=held_advice(system),
        surpluses=surpluses(system, ranks),
        free_coordinates=tuple(columns[column] for column in ranks.free),
        missing_drivers=missing,
        too_many=named(whole.too_many_rows, whole.too_many_columns),
        too_few=named(whole.too_few_rows, whole.too_few_columns),
        blocks=tuple(
            named(block.rows, block.columns) for block in parts_of(independent, shape).blocks
        ),
        is_assembled=ranks.assembled,
        rank_at_start=ranks.rank_at_start,
        nearest=tuple(ranks.nearest.tolist()),
        residuals=tuple(ranks.residuals.tolist()),
    )


def _entry(item: Joint | FreeEquation, first_row: int) -> ConstraintEntry:
    kind = item.type_name if isinstance(item, Joint) else "Equation"
    return ConstraintEntry(
        item.name, kind, first_row, item.equation_names, item.is_driver, item.text, item.source
    )


def gruebler(system: ConstraintSystem) -> Mobility:
    """Count coordinates and equations as Gruebler does."""
    drivers = sum(len(item.equation_names) for item in system.constraints if item.is_driver)
    n = len(system.coordinates)
    others = n - sum(map(len, system.body_columns))
    return Mobility(len(system.bodies), n, others, len(system.equations) - drivers, drivers)


def _problem(system: ConstraintSystem, pattern: Pattern, ranks: RankReport) -> str:
    if least_squares_will_do(system, ranks):
        return ""
    n, m = len(system.coordinates), len(system.equations)
    dependent = [system.equations[row] for row in sorted(ranks.partners)]
    # Where drivers are missing, nothing is said to be too many.
    counted = counting_problem(system, pattern, dependent) if m <= n or ranks.rank == n else ""
    return counted or (rank_problem(system, ranks) if ranks.rank < n else "")

"""What a system is made of, counted: bodies, constraints, rows and columns, mobility, sparsity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.html import Shown
from kincompile.model.resolve import Joint
from kincompile.structure.blocks import parts_of
from kincompile.structure.counting import counting_problem, unmatched
from kincompile.structure.findings import ConstraintEntry, Findings, Mobility, NamedBlock
from kincompile.structure.remedies import least_squares_will_do, missing_drivers, surpluses
from kincompile.structure.report_text import report_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kincompile.model.resolve import FreeEquation
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.counting import Pattern
    from kincompile.structure.rank import RankReport


@dataclass(frozen=True, slots=True, repr=False)
class Inspection(Shown, Findings):
    """What `kc.inspect` finds, with its text; see `Findings` for what it holds."""

    def to_text(self) -> str:
        """Return everything as plain text tables; rows and columns count from 0."""
        return report_text(self)


def inspect_system(system: ConstraintSystem, pattern: Pattern, ranks: RankReport) -> Inspection:
    """Count what there is in a checked system, given the pattern of its Phi_q and its rank."""
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
        mobility=gruebler(system),
        pattern=tuple(entries),
        unmatched_equations=tuple(equations),
        unmatched_coordinates=tuple(coordinates),
        problem=_problem(system, pattern, ranks),
        rank=ranks.rank,
        redundant=tuple(names[row] for row in ranks.redundant),
        conflicting=tuple(names[row] for row in ranks.conflicting),
        surpluses=surpluses(system, ranks),
        free_coordinates=tuple(columns[column] for column in ranks.free),
        missing_drivers=missing_drivers(system, ranks),
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
    kind = item.template.type_name if isinstance(item, Joint) else "Equation"
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
    dependent = [system.equations[row] for row in sorted(ranks.partners)]
    problem = counting_problem(system, pattern, dependent)
    n = len(system.coordinates)
    if not problem and ranks.rank < n:
        return (
            f"{system.name!r} has as many equations as coordinates, {n}, but at assembled "
            f"positions only {ranks.rank} of them are independent: velocities are not determined"
        )
    return problem

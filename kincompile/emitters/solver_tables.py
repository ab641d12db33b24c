"""What a printed solver judges by, as values that each language writes down."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile import criteria, quantities
from kincompile.solver.vocabulary import (
    COUNTS,
    CRITERIA,
    LANES_COUNTS,
    LANES_CRITERIA,
    LINE_CRITERIA,
    SETS_COUNTS,
    SETS_CRITERIA,
    START_COUNTS,
    START_CRITERIA,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.ir.program import Program

NUMBERS: Mapping[str, float] = {
    name: getattr(criteria, name) for name in (*CRITERIA, *START_CRITERIA, *COUNTS, *START_COUNTS)
}
"""The criteria of march and start by name; the counts are whole numbers."""
OF_LANES: Mapping[str, float] = {
    name: getattr(criteria, name)
    for name in (*LANES_CRITERIA, *LANES_COUNTS, *SETS_CRITERIA, *LINE_CRITERIA, *SETS_COUNTS)
}
"""Those of many points at once, and of many parameter sets, besides."""


def solver_tables(program: Program) -> dict[str, Sequence[float]]:
    """Return the tables of `vocabulary.TABLES` but PATTERN by name, of a mechanism."""
    units = [item.unit for item in program.coordinates]
    columns = [body.columns for body in program.bodies]
    most = max(len(units), len(program.equations))
    return {
        "ANGULAR": quantities.turning(units, columns),
        "IS_REDUNDANT": [name in program.redundant for name in program.equations],
        "PROBE": criteria.probe_of(most).tolist(),
        "MAY_TURN": quantities.may_turn(units, columns),
        "COVER": quantities.first_of_cover(len(units), columns),
    }

"""The solve of Phi_q x = b of the grouped form: a function for each class of equal blocks."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.ir.elimination import plan_entries
from kincompile.ir.inline import InlineProgram
from kincompile.structure.stages import Batch, Chain, Sparse, Stage, plan_stages
from kincompile.targets.naming import NameTable
from kincompile.targets.numpy.solve import solve_functions
from kincompile.targets.numpy.target import RESERVED_IN_SOLVE
from kincompile.targets.planned_solve import schedule_solve

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.ir.elimination import SolvePlan
    from kincompile.ir.program import Program

    Index = NDArray[np.intp]


@dataclasses.dataclass(frozen=True, slots=True)
class PlannedBatch:
    """Equal blocks with the elimination that solves one of them."""

    key: str  # name of their arrays, and stem of their functions
    batch: Batch
    plan: SolvePlan
    # (entries, L): numbers of the entries within the blocks that the factorization reads
    varying: Index


@dataclasses.dataclass(frozen=True, slots=True)
class PlannedStage:
    """A stage, and the elimination of each of its classes of blocks; none of a sparse stage."""

    key: str
    stage: Stage
    parts: tuple[PlannedBatch, ...]


def plan_solving(
    program: Program, rows: Index, columns: Index, constants: NDArray[np.float64]
) -> tuple[PlannedStage, ...]:
    """Plan the solve, stages in order; nothing where equations are dependent for every position.

    Rows, columns and constants (nnz,) are of each entry of Phi_q row by row; of one that varies the
    constant is NaN. There may be more equations than coordinates, if they agree.
    """
    size = len(program.equations)
    if size != len(program.coordinates):
        return ()
    planned = []
    for k, stage in enumerate(plan_stages(rows, columns, constants, size) or ()):
        key, parts = f"stage_{k}", []
        for name, batch in _classes(key, stage):
            plan, varying = _plan(batch, constants)
            if plan is None:
                return ()
            parts.append(PlannedBatch(name, batch, plan, varying))
        planned.append(PlannedStage(key, stage, tuple(parts)))
    return tuple(planned)


def _classes(key: str, stage: Stage) -> list[tuple[str, Batch]]:
    """Return the classes of blocks of a stage, with a name for each."""
    if isinstance(stage, Chain):
        return [(f"{key}_{k}", part) for k, part in enumerate(stage.batches)]
    return [] if isinstance(stage, Sparse) else [(key, stage)]


def _plan(batch: Batch, constants: NDArray[np.float64]) -> tuple[SolvePlan | None, Index]:
    """Return the elimination of one of the blocks, and the numbers of the entries that vary."""
    first = constants[batch.inner[:, 0]]
    entries = [
        (row, column, None if np.isnan(value) else float(value))
        for (row, column), value in zip(batch.places, first.tolist(), strict=True)
    ]
    size = batch.rows.shape[0]
    return plan_entries(size, size, entries), batch.inner[np.isnan(first)]


def solving_arrays(stages: tuple[PlannedStage, ...]) -> dict[str, NDArray[Any]]:
    """Return the index arrays of the stages, by name."""
    arrays: dict[str, NDArray[Any]] = {}
    for item in stages:
        if isinstance(item.stage, Chain):
            arrays[f"{item.key}.links"] = item.stage.interface
        elif isinstance(item.stage, Sparse):
            arrays |= _stage_arrays(item.key, item.stage)
        for part in item.parts:
            arrays |= _stage_arrays(part.key, part.batch)
            arrays[f"{part.key}.varying"] = part.varying
    return arrays


def _stage_arrays(key: str, stage: Batch | Sparse) -> dict[str, NDArray[Any]]:
    return {f"{key}.{name}": getattr(stage, name) for name in ("rows", "columns", "inner", "outer")}


def solving_code(stages: tuple[PlannedStage, ...], program: Program) -> list[str]:
    """Return the functions of all classes of blocks as text."""
    code: list[str] = []
    for item in stages:
        for part in item.parts:
            rows, columns = part.batch.rows[:, 0].tolist(), part.batch.columns[:, 0].tolist()
            sample = dataclasses.replace(
                program,
                equations=tuple(program.equations[k] for k in rows),
                coordinates=tuple(program.coordinates[k] for k in columns),
            )
            inline = InlineProgram(sample, (), (), {})
            listing = schedule_solve(inline, part.plan, NameTable(RESERVED_IN_SOLVE))
            code += ["", "", *solve_functions(inline, listing, f"_{part.key}")]
    return code


def solving_table(stages: tuple[PlannedStage, ...]) -> list[str]:
    """Return the lines of the module's table of stages."""
    lines = []
    for item in stages:
        own = []
        for part in item.parts:
            outer = "".join(f"{row}, " for row in part.batch.outer_rows)
            own.append(f'Stage("{part.key}", _{part.key}_factor, _{part.key}_solve, ({outer})),')
        if isinstance(item.stage, Chain):
            lines += [f'Chain("{item.key}", (', *(f"    {line}" for line in own), ")),"]
        else:
            lines += own or [f'Stage("{item.key}", None, None, ()),']
    return lines

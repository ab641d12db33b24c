"""A mechanism at many sets of parameters, in chunks.

model      -> Compiled    the module of this process; workers make their own  compiler.compile
parameters -> Plan        variants, cut into chunks                           plan
names      -> Layout      columns and measures that are kept                  layout
all        -> Job         what every chunk has in common                      worker
           -> Store       in memory or a folder, as an earlier run left it    store
chunks     -> executor    those that are missing, a few at a time             chunks
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.compiler import compile as compiled
from kincompile.criteria import MAX_ITERATIONS, TOLERANCE
from kincompile.errors import AssemblyWarning, InputError, SweepError
from kincompile.model.mechanism import system_of
from kincompile.names import escaped
from kincompile.runtime.engine.code import FORCES, code_of
from kincompile.runtime.inputs import mapping_of, read_inputs, read_sweep
from kincompile.runtime.solve import solve
from kincompile.sweeps.chunks import StoppedError, solved
from kincompile.sweeps.contents import Contents, marks_of
from kincompile.sweeps.layout import bearing_of, read_layout
from kincompile.sweeps.plan import Plan, chunk_size
from kincompile.sweeps.result import Sweep
from kincompile.sweeps.store import open_store
from kincompile.sweeps.worker import Job, run

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping, Sequence
    from concurrent.futures import Executor
    from types import ModuleType

    from numpy.typing import ArrayLike

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.results.solution import Solution
    from kincompile.sweeps.contents import Store
    from kincompile.sweeps.layout import Layout


def sweep(
    model: Mechanism | ConstraintSystem,
    p: Mapping[str, ArrayLike],
    t: ArrayLike | None = None,
    *,
    columns: Sequence[str] | None = None,
    measures: Sequence[str] = (),
    product: bool = False,
    guess: Mapping[str, float] | None = None,
    assembly: int | None = None,
    through: str | None = None,
    target: str = "c",
    store: str | os.PathLike[str] | None = None,
    executor: Executor | None = None,
    chunk: int | None = None,
    pending: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Sweep:
    """Solve a mechanism at many sets of parameters, on many processors, into a file.

    Parameters
    ----------
    model
        A mechanism or a system of free equations; its emitted source is what is sent to workers.
    p : mapping
        Values of parameters by name; those with an array, shape (B,), are swept, and several
        arrays are taken in pairs: B samples.
    t : float or array_like, shape (N,), or None
        The times; None for those of the model.
    columns : sequence of str, optional
        What is kept over time: coordinates, outputs, points of joints and their rates, as in a
        solution. Without `columns` and `measures` it is the outputs, of a model without any the
        coordinates.
    measures : sequence of str
        What is kept of each motion, as ``"foot.x.stroke"``: of an output its least, t_least,
        greatest, t_greatest, stroke, period, time_ratio, mean or rms; of a force, as in
        ``"motor.drive.peak"``, its peak, least, t_least, greatest, t_greatest, mean or rms at the
        times. Forces may be columns too; what `kc.forces` names is known.
    product : bool
        Take every combination of the arrays: a grid.
    guess : mapping, optional
        Where Newton starts for the first set; the others follow its assembly.
    assembly : int, optional
        The way to assemble the first set, instead of a guess, as for `solve`.
    through : {"smooth"}, optional
        Go on past bifurcations along the smooth branch, as in `solve`.
    target : {"c", "numpy"}
        What workers run: C, which each compiles once, or NumPy where there is no compiler.
    store : path-like, optional
        A folder whose name ends in .zarr, or in .parquet for a table: workers write chunks when
        they are done, so that all of them must see it. If it is there, the sweep that was begun
        goes on. None keeps results in memory.
    executor : concurrent.futures.Executor, optional
        Where chunks are solved: anything with this interface. None solves them here, in turn.
    chunk : int, optional
        Largest number of variants that are solved and written together.
    pending : int, optional
        Chunks under way at a time; None for twice the number of workers.
    progress : callable, optional
        Called as ``progress(done, total)`` with numbers of variants, after each chunk.

    Returns
    -------
    Sweep
        ``.to_xarray()`` has the results; a status of each point says what could not be solved.

    Warns
    -----
    AssemblyWarning
        When the first set is on another branch than its guess or the drawing shows.

    Raises
    ------
    InputError
        When a value has the wrong name or is not finite, the store has another sweep, or cannot be
        written to; what is complete in it is kept.
    SweepError
        When the executor dies, or a worker does; `.sweep` has what was solved before.
    UnsupportedError
        If a package or the C compiler is not installed.
    """
    counts: dict[str, Any] = {"chunk": chunk, "pending": pending}  # whatever their types say
    for name, count in counts.items():
        if count is not None and not (isinstance(count, int | np.integer) and count >= 1):
            raise InputError(f"{name} is {count!r}: give a whole number of at least 1.")
    module = compiled(model, target)
    t = _times(model) if t is None else t
    plan, inputs = _planned(module, p, t, guess, product, chunk, through)
    first = dict(zip(module.PARAMETERS, plan.sets(0)[0].tolist(), strict=True))
    begin = solve(module, inputs.t[:1], first, guess, assembly=assembly)
    if begin.doubt:
        warnings.warn(begin.doubt, AssemblyWarning, stacklevel=2)
    # All chunks start from one position, so that one assembly is meant in all.
    position = begin.q[0] if begin.success else inputs.guess
    layout = _layout(begin, columns, measures)
    job = Job(inputs.code, inputs.t, position, plan.sets(0)[0], layout, None, through)
    units = {name: module.UNITS[name] for name in module.PARAMETERS}
    marks = marks_of(job, plan, inputs.guess, assembly)
    contents = Contents(module.NAME, plan, job.layout, job.t, units, marks)
    kept = open_store(store, contents)
    result = Sweep(contents, kept, "" if store is None else str(store))
    try:
        _solve_missing(job, plan, kept, executor, pending, progress)
    except StoppedError as error:
        raise SweepError(_stopped(error, result), result) from error
    _require_all(result)
    return result


def _layout(begin: Solution, columns: Sequence[str] | None, measures: Sequence[str]) -> Layout:
    """Read what is kept; where forces are among it, workers get their code too."""
    try:
        return read_layout(begin, columns, measures)
    except InputError:
        code = code_of(begin.require_module("its forces"))
        if code.lanes is None or not code.has_loads:
            raise
    code.request(FORCES, False)  # for points at which elimination cannot be trusted
    return read_layout(begin, columns, measures, bearing_of(begin))


def _times(model: Mechanism | ConstraintSystem) -> Array:
    """Return the times of a model."""
    system = system_of(model)
    return np.linspace(0.0, system.end, system.points)


def _planned(
    module: ModuleType,
    p: Mapping[str, ArrayLike],
    t: ArrayLike,
    guess: Mapping[str, float] | None,
    product: bool,
    chunk: int | None,
    through: str | None,
) -> tuple[Plan, Inputs]:
    """Read parameters and times: the variants in chunks, and what all of them have in common."""
    given = read_sweep(mapping_of(p, "p"), product)
    if given.problems:
        raise InputError(given.problems)
    inputs = read_inputs(module, t, given.common, guess, TOLERANCE, MAX_ITERATIONS, through=through)
    if not given.sweep:
        raise InputError(
            "nothing is swept: give an array of values of a parameter, such as "
            "{'a': np.linspace(0.2, 0.6, 100)}."
        )
    size = chunk_size(len(module.COORDINATES), inputs.t.size) if chunk is None else chunk
    return Plan(module.PARAMETERS, inputs.p, given.sweep, product, size), inputs


def _solve_missing(
    job: Job,
    plan: Plan,
    kept: Store,
    executor: Executor | None,
    pending: int | None,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Solve the chunks that are not in the store yet."""
    is_done = kept.done()
    done = sum(plan.grid.count(k) for k in np.flatnonzero(is_done).tolist())
    if progress and done:
        progress(done, plan.grid.variants)
    missing = np.flatnonzero(~is_done).tolist()
    if executor is not None and missing:
        # C compiles here what sets need: of workers, each that finds no library would build it.
        begin = replace(job, t=job.t[:1], layout=replace(job.layout, kept=()))
        run(begin, missing[0], plan.sets(missing[0])[:1])
    job = job.written_by(kept.writer())
    for number, values in solved(job, plan, missing, executor, pending):
        if values is not None:
            kept.take(number, values)
        done += plan.grid.count(number)
        if progress:
            progress(done, plan.grid.variants)


def _require_all(result: Sweep) -> None:
    """Refuse results of which chunks are missing though no worker failed."""
    missing, total = np.count_nonzero(~result.store.done()), len(result.contents.plan.grid)
    if missing:
        raise SweepError(
            f"{missing} of {total} chunks are not in {result.where}, and no worker failed: they "
            "were written elsewhere. Give a folder that all workers see under this name, or no "
            "store, and workers hand their results back.",
            result,
        )


def _stopped(error: StoppedError, result: Sweep) -> str:
    """Say that the executor stopped the sweep, what is kept and what to do."""
    done, total = int(result.store.done().sum()), len(result.contents.plan.grid)
    if result.where:
        kept = f"{escaped(result.where)} has them; the same call goes on from there"
    else:
        kept = ".sweep has them; with store='NAME.zarr' the same call would go on from there"
    return (
        f"{result.contents.name}: the sweep stopped after {done} of {total} chunks ({error}). "
        f"{kept}. A worker that was killed may have had too little memory: fewer workers, or a "
        "smaller chunk, need less."
    )

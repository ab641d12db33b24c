"""What a worker does: it makes the module from the emitted source, once, and solves chunks.

This module loads neither SymPy nor the compiler, so that a worker starts quickly.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import threading
import warnings
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from kincompile.errors import KincompileWarning
from kincompile.runtime.engine.code import FORCES, JOINTS, code_of
from kincompile.runtime.load import from_source
from kincompile.runtime.native.module import make_native
from kincompile.runtime.solve import solve_sets

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.sweeps.layout import Layout


class Writer(Protocol):
    """What writes a chunk; it is sent to workers, with each chunk, so that it is small."""

    def write(self, number: int, sets: Array, values: Mapping[str, NDArray[Any]]) -> None:
        """Keep the values of a chunk, by name, whose parameters are (B, k)."""


@dataclass(frozen=True, slots=True, eq=False)
class Sources:
    """The emitted source of a mechanism, from which a worker makes its module."""

    name: str  # of the mechanism
    numpy: str  # text of the NumPy module
    arrays: Mapping[str, NDArray[Any]]  # what that would read from a companion file
    native: Mapping[str, str]  # text of the C files by name; none where C is not used
    # those of its forces, planned and with multipliers given, and its joints; where they are wanted
    forces: tuple[Sources | None, Sources, Mapping[str, tuple[str, ...]]] | None = None
    digest: str = field(init=False)  # of all of them: a worker compiles what has one digest once

    def __post_init__(self) -> None:
        """Compute the digest."""
        found = hashlib.sha256()
        for part in (self.numpy, *self.native, *self.native.values(), *self.arrays):
            found.update(part.encode() + b"\0")
        if self.forces is not None:
            planned, given, _ = self.forces
            found.update(((planned.digest if planned else "") + given.digest).encode())
        for array in self.arrays.values():
            found.update(np.ascontiguousarray(array).tobytes())
        object.__setattr__(self, "digest", found.hexdigest())

    def __eq__(self, other: object) -> bool:
        """Say whether two have the same text."""
        return isinstance(other, Sources) and self.digest == other.digest

    def __hash__(self) -> int:
        """Return a number that goes with `__eq__`."""
        return hash(self.digest)

    def module(self) -> ModuleType:
        """Return the module, compiled once a process."""
        return _module(self)


@lru_cache(maxsize=8)
def _module(sources: Sources) -> ModuleType:
    module = from_source(sources.numpy, sources.name, sources.arrays)
    module = make_native(module, sources.native) if sources.native else module
    if sources.forces is not None:
        makers, joints = code_of(module).makers, sources.forces[2]
        makers |= {FORCES: partial(_forces, sources), JOINTS: lambda: joints}
    return module


def _forces(sources: Sources, is_planned: bool) -> Compiled | None:
    """Return the compiled forces, as `FORCES` describes."""
    assert sources.forces is not None
    planned, given, _ = sources.forces
    chosen = planned if is_planned else given
    return None if chosen is None else code_of(chosen.module())


@dataclass(frozen=True, slots=True)
class Job:
    """What all chunks of a sweep have in common."""

    sources: Sources  # the emitted source
    t: Array  # (N,): the times
    guess: Array  # (n,): where every chunk starts
    p: Array  # (k,): the parameters with which that is a position
    layout: Layout  # what is kept
    writer: Writer | None  # what a worker writes a chunk with; None where it hands the values back
    through: str | None  # "smooth" where motions go on past bifurcations

    def written_by(self, writer: Writer | None) -> Job:
        """Return the job of workers that write what they have solved."""
        return replace(self, writer=writer)


def run(job: Job, number: int, sets: Array) -> dict[str, NDArray[Any]] | None:
    """Solve a chunk and write it, or return its values by name, (B, N) over time, else (B,)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", KincompileWarning)  # statuses say the same
        module = job.sources.module()
        solution = solve_sets(module, job.t, sets, job.guess, job.p, through=job.through)
        values = job.layout.values(solution)
    if job.writer is None:
        return values
    job.writer.write(number, sets, values)
    return None


def end_with_parent() -> None:
    """End this process when the one that started it has ended: the initializer of a pool.

    Without it the workers of a program that was killed wait for work for ever.
    """
    parent = multiprocessing.parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=wait, daemon=True).start()

"""What a worker does: it makes the module from the emitted source, once, and solves chunks.

This module loads neither SymPy nor the compiler, so that a worker starts quickly.
"""

from __future__ import annotations

import hashlib
import warnings
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from kincompile.errors import KincompileWarning
from kincompile.runtime.load import from_source
from kincompile.runtime.native.module import make_native
from kincompile.runtime.solve import solve

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import ModuleType

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.sweep.layout import Layout

_MODULES: dict[str, ModuleType] = {}


class Writer(Protocol):
    """What writes a chunk; it is sent to workers, with each chunk, so that it is small."""

    def write(self, number: int, sets: Array, values: Mapping[str, NDArray[Any]]) -> None:
        """Keep the values of a chunk, by name, whose parameters are (B, k)."""


@dataclass(frozen=True, slots=True)
class Sources:
    """The emitted source of a mechanism, from which a worker makes its module.

    Attributes
    ----------
    name
        Of the mechanism.
    numpy
        Text of the NumPy module.
    arrays
        What that would read from a companion file.
    native
        Text of the C files by name; none where C is not used.
    digest
        Of all of them: a worker compiles what has one digest once.
    """

    name: str
    numpy: str
    arrays: Mapping[str, NDArray[Any]]
    native: Mapping[str, str]
    digest: str = field(init=False)

    def __post_init__(self) -> None:
        """Compute the digest."""
        found = hashlib.sha256()
        for part in (self.numpy, *self.native, *self.native.values(), *self.arrays):
            found.update(part.encode() + b"\0")
        for array in self.arrays.values():
            found.update(np.ascontiguousarray(array).tobytes())
        object.__setattr__(self, "digest", found.hexdigest())

    def module(self) -> ModuleType:
        """Return the module, compiled once a process."""
        if self.digest not in _MODULES:
            module = from_source(self.numpy, self.name, self.arrays)
            if self.native:
                module = make_native(module, self.native)
            _MODULES[self.digest] = module
        return _MODULES[self.digest]


@dataclass(frozen=True, slots=True)
class Job:
    """What all chunks of a sweep have in common.

    Attributes
    ----------
    sources
        The emitted source.
    t : ndarray, shape (N,)
        The times.
    guess : ndarray, shape (n,)
        Where every chunk starts.
    layout
        What is kept.
    writer
        What a worker writes a chunk with; None where it hands the values back.
    """

    sources: Sources
    t: Array
    guess: Array
    layout: Layout
    writer: Writer | None

    def written_by(self, writer: Writer | None) -> Job:
        """Return the job of workers that write what they have solved."""
        return replace(self, writer=writer)


def run(job: Job, number: int, sets: Array) -> dict[str, NDArray[Any]] | None:
    """Solve a chunk and write it, or return its values by name, (B, N) over time, else (B,)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", KincompileWarning)  # statuses say the same
        solution = solve(job.sources.module(), job.t, sets[:, np.newaxis], job.guess)
        values = job.layout.values(solution)
    if job.writer is None:
        return values
    job.writer.write(number, sets, values)
    return None

"""What a worker does: it makes a mechanism from its emitted source, once, and solves chunks.

This module loads neither SymPy nor the compiler, so that a worker starts quickly.
"""

from __future__ import annotations

import copyreg
import hashlib
import multiprocessing
import os
import pickle
import threading
import warnings
import zlib
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from kincompile.errors import KincompileWarning
from kincompile.runtime.engine.code import FORCES, JOINTS, POINTS, Compiled, code_of
from kincompile.runtime.load import from_source
from kincompile.runtime.native.module import make_native
from kincompile.runtime.solve import solve_sets

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Origin
    from kincompile.sweeps.layout import Layout


class Writer(Protocol):
    """What writes a chunk; it is sent to workers, with each chunk, so that it is small."""

    def write(self, number: int, sets: Array, values: Mapping[str, NDArray[Any]]) -> None:
        """Keep the values of a chunk, by name, whose parameters are (B, k)."""


KEPT = 16
"""Mechanisms that a process keeps of those that it was sent."""

SENT = (FORCES, JOINTS, POINTS)
"""What goes with a mechanism of what was compiled on request."""

known: dict[str, Compiled] = {}


def digest_of(code: Compiled) -> str:
    """Return the digest of all that decides the numbers of a mechanism, forces where wanted."""
    assert code.origin is not None
    _, text, arrays, native = code.origin
    found = hashlib.sha256()
    for part in (text, *native, *native.values(), *arrays):
        found.update(part.encode() + b"\0")
    forces = (code.made.get((FORCES, (is_planned,))) for is_planned in (True, False))
    found.update("".join(digest_of(item) for item in forces if item).encode())
    for array in arrays.values():
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def _packed(code: Compiled) -> tuple[Any, ...]:
    """Return by what function and from what another process makes a mechanism again."""
    sent = {place: made for place, made in code.made.items() if place[0] in SENT}
    return _unpacked, (digest_of(code), code.origin, sent)


def _unpacked(digest: str, origin: Origin, sent: dict[Any, Any]) -> Compiled:
    """Return a mechanism that was sent; what has one digest is compiled once."""
    if digest not in known:
        name, text, arrays, native = origin
        module = from_source(text, name, arrays)
        known[digest] = code_of(make_native(module, native) if native else module)
        if len(known) > KEPT:
            del known[next(iter(known))]
    known[digest].made.update(sent)
    return known[digest]


copyreg.pickle(Compiled, _packed)


@dataclass(frozen=True, slots=True)
class Job:
    """What all chunks of a sweep have in common."""

    code: Compiled  # the mechanism
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
        solution = solve_sets(job.code.module, job.t, sets, job.guess, job.p, through=job.through)
        values = job.layout.values(solution)
    if job.writer is None:
        return values
    job.writer.write(number, sets, values)
    return None


def packed(job: Job) -> bytes:
    """Return a job as it is sent: made once, and small, whatever the executor does with it.

    Dask looks through the arguments of each task: 0.2 s for the objects of a four-bar.
    """
    return zlib.compress(pickle.dumps(job))


@lru_cache(maxsize=KEPT)
def _unpacked_job(sent: bytes) -> Job:
    job: Job = pickle.loads(zlib.decompress(sent))
    return job


def run_packed(sent: bytes, number: int, sets: Array) -> dict[str, NDArray[Any]] | None:
    """Do the same in a worker, which unpacks a job once."""
    return run(_unpacked_job(sent), number, sets)


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

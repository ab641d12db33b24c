"""Chunks on an executor: never more of them under way than are needed to keep it busy."""

from __future__ import annotations

import os
from contextlib import contextmanager
from itertools import islice
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from kincompile.errors import KincompileError
from kincompile.sweeps.worker import packed, run, run_packed

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from concurrent.futures import Executor, Future

    from numpy.typing import NDArray

    from kincompile.sweeps.plan import Plan
    from kincompile.sweeps.worker import Job

    Values = dict[str, NDArray[Any]] | None


class StoppedError(Exception):
    """The executor, or a worker, could not go on; says which exception that was."""


PER_WORKER = 2
"""Chunks under way for each worker: one that is solved, and one that waits."""


def solved(
    job: Job, plan: Plan, numbers: Iterable[int], executor: Executor | None, pending: int | None
) -> Iterator[tuple[int, Values]]:
    """Give the number of each chunk when it is done, with its values if they are not written yet.

    Without an executor they are solved in this process; without `pending` twice as many are under
    way as there are workers.
    """
    if executor is None:
        for number in numbers:
            try:
                values = run(job, number, plan.sets(number))
            except MemoryError as error:
                raise StoppedError(_named(error)) from error
            yield number, values
        return
    left, sent = iter(numbers), packed(job)
    waiting: dict[Future[Values], int] = {}
    # Each future reports itself: to ask all that wait would cost more the more there are.
    finished: SimpleQueue[Future[Values]] = SimpleQueue()
    most = pending or PER_WORKER * _workers(executor)
    try:
        while True:
            for number in islice(left, most - len(waiting)):
                with _of_executor():
                    future = executor.submit(run_packed, sent, number, plan.sets(number))
                waiting[future] = number
                future.add_done_callback(finished.put)
            if not waiting:
                return
            future = finished.get()
            with _of_executor():
                values = future.result()
            yield waiting.pop(future), values
    finally:
        for future in waiting:
            future.cancel()


@contextmanager
def _of_executor() -> Iterator[None]:
    """Turn what an executor raises, which may be anything, into a `StoppedError`."""
    try:
        yield
    except KincompileError:
        raise
    except Exception as error:
        raise StoppedError(_named(error)) from error


def _named(error: Exception) -> str:
    name = type(error).__name__
    return f"{name}: {error}" if str(error) else name


def _workers(executor: Executor) -> int:
    """Return how many workers an executor has; where it does not say, one for each processor."""
    for name in ("_max_workers", "num_workers"):
        found = getattr(executor, name, None)
        if isinstance(found, int) and found > 0:
            return found
    return os.cpu_count() or 1

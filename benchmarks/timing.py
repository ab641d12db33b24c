"""How times are taken: the contenders in turn, many times over, median and minimum."""

from __future__ import annotations

import gc
import json
import statistics
import subprocess
import sys
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence


@dataclass(frozen=True, slots=True)
class Timing:
    """Samples of one time, in seconds."""

    samples: tuple[float, ...]

    @property
    def median(self) -> float:
        """The median: what a user sees."""
        return statistics.median(self.samples)

    @property
    def least(self) -> float:
        """The minimum: what is left when nothing else runs on the machine."""
        return min(self.samples)


def in_turn(
    contenders: Mapping[str, Callable[[], object]],
    *,
    calls: int,
    rounds: int,
    clock: Callable[[], float] = process_time,
) -> dict[str, Timing]:
    """Time calls in this process: processor time, or what another clock tells.

    Nothing that is timed here waits or starts threads: on an idle machine processor time is what
    passes on the wall, and on a busy one it still is what the work costs. Every round gives each
    contender the same number of calls, so that all of them see the same disturbances, the same
    state of the memory allocator and the same caches.
    """
    samples: dict[str, list[float]] = {name: [] for name in contenders}
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, call in contenders.items():
                call()
                start = clock()
                for _ in range(calls):
                    call()
                samples[name].append((clock() - start) / calls)
    finally:
        gc.enable()
    return {name: Timing(tuple(times)) for name, times in samples.items()}


def printed_by_processes(
    commands: Mapping[str, Sequence[str]], *, rounds: int
) -> dict[str, tuple[Timing, ...]]:
    """Collect the times that fresh Python processes print as a JSON list, place by place."""
    printed: dict[str, list[list[float]]] = {name: [] for name in commands}
    for _ in range(rounds):
        for name, command in commands.items():
            done = subprocess.run(
                [sys.executable, *command], check=True, capture_output=True, text=True
            )
            printed[name].append(json.loads(done.stdout))
    return {
        name: tuple(Timing(times) for times in zip(*lists, strict=True))
        for name, lists in printed.items()
    }


def of_processes(commands: Mapping[str, Sequence[str]], *, rounds: int) -> dict[str, Timing]:
    """Time Python processes from start to exit, on the wall."""

    def run(command: Sequence[str]) -> Callable[[], object]:
        return lambda: subprocess.run([sys.executable, *command], check=True, capture_output=True)

    calls = {name: run(command) for name, command in commands.items()}
    return in_turn(calls, calls=1, rounds=rounds, clock=perf_counter)

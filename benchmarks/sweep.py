"""Sweeps: 10^6 four-bars at 100 times into a Zarr folder, on one process and on two.

`python -m benchmarks.sweep [variants]` prints tables: the cost of a position, the overhead of a
chunk, what two processes gain, how memory grows, and whether a sweep that was killed in the middle
goes on to the same bytes. Times are those on the wall: give it a quiet machine, and 2 GB of disk.
"""

from __future__ import annotations

import hashlib
import json
import os
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from time import perf_counter, process_time
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

import kincompile as kc
from benchmarks import machine
from benchmarks.linkages import FOUR_BAR
from benchmarks.tables import Target, print_table, print_targets
from kincompile.runtime.results.measures import measures_together, output_measures

if TYPE_CHECKING:
    from collections.abc import Callable

VARIANTS, TIMES = 1_000_000, 100
SPREAD = 0.02
ROUNDS = 3
MEASURED = 500
CHUNKS = 50, 250
"""Numbers of chunks of one variant, whose times give the overhead of one."""


def main(variants: int) -> None:
    """Measure in fresh processes and print."""
    before = machine.load()
    found: dict[int, list[dict[str, float]]] = {1: [], 2: []}
    with tempfile.TemporaryDirectory() as folder:
        wanted = found_again = ""
        for number in range(ROUNDS):
            for workers, runs in found.items():
                store = Path(folder) / f"{workers}.zarr"
                runs.append(measured(variants, workers, store))
                wanted = wanted or digest(store)
                remove(store)
            if number == 0:
                found_again = killed_and_resumed(variants, Path(folder) / "killed.zarr")
        print_chunks(Path(folder))
    print_measures()
    report(variants, found, found_again == wanted)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


def measured(variants: int, workers: int, store: Path) -> dict[str, float]:
    """Sweep in a fresh process and return what it prints."""
    done = subprocess.run(command(variants, workers, store), check=True, capture_output=True)
    return dict(json.loads(done.stdout))


def killed_and_resumed(variants: int, store: Path) -> str:
    """Kill a sweep, with its workers, when a half is done; go on, and return its digest."""
    killed = subprocess.run(
        [*command(variants, 2, store), "kill"], start_new_session=True, check=False
    )
    if killed.returncode != -signal.SIGKILL:
        raise RuntimeError("the sweep was not killed")
    measured(variants, 2, store)
    found = digest(store)
    remove(store)
    return found


def command(variants: int, workers: int, store: Path) -> list[str]:
    """Return the command of one process."""
    return [sys.executable, "-m", "benchmarks.sweep", str(variants), str(workers), str(store)]


def one_process(variants: int, workers: int, store: str, ends: bool) -> None:
    """Sweep, and print seconds, and how the memory of this process and its workers grew."""
    first = list[float]()

    def progress(done: int, total: int) -> None:
        if ends and done >= total // 2:
            os.killpg(0, signal.SIGKILL)
        if not first and done >= total // 10:
            first.append(memory())

    pool = ProcessPoolExecutor(workers) if workers > 1 else nullcontext()
    start = perf_counter()
    with pool as executor:

        def memory() -> float:
            own = [os.getpid(), *getattr(executor, "_processes", ())]
            return max(resident(pid) for pid in own)

        found = sweep(variants, TIMES, store=store, executor=executor, progress=progress)
        last = memory()
    seconds = perf_counter() - start
    if set(found.statuses()) != {"CONVERGED"}:
        raise ArithmeticError(str(found))
    print(json.dumps({"seconds": seconds, "peak": last, "growth": last - first[0]}))


def resident(pid: int) -> float:
    """Return the peak memory of a process [MB]."""
    status = Path(f"/proc/{pid}/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    lines = status.read_text().splitlines()
    return float(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1e3


def sweep(variants: int, times: int, **options: Any) -> kc.Sweep:
    """Sweep the lengths of the four-bar; all can be assembled and turn."""
    rng = np.random.default_rng(4)
    *lengths, _ = FOUR_BAR.parameters.items()
    p = {name: value * (1 + SPREAD * rng.uniform(-1, 1, variants)) for name, value in lengths}
    return kc.sweep(
        FOUR_BAR.mechanism(), p, FOUR_BAR.times(times), columns=["phi_rocker"], **options
    )


def digest(store: Path) -> str:
    """Return a digest of the names and bytes of all files."""
    found = hashlib.sha256()
    for path in sorted(item for item in store.rglob("*") if item.is_file()):
        found.update(str(path.relative_to(store)).encode())
        found.update(hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()


def remove(store: Path) -> None:
    """Remove a folder, so that the disk holds one at a time."""
    subprocess.run(["rm", "-r", str(store)], check=True)


def print_chunks(folder: Path) -> None:
    """Print the overhead of a chunk: what one more of a single variant at two times takes.

    In this process that is processor time, with another one the time on the wall.
    """
    rows = []
    kinds: dict[str, Callable[[int], dict[str, Any]]] = {
        "here, results in memory": lambda _: {},
        "here, Zarr": lambda count: {"store": folder / f"{count}.zarr"},
        "here, Parquet": lambda count: {"store": folder / f"{count}.parquet"},
    }
    for name, options in kinds.items():
        rows.append([name, f"{per_chunk(options, process_time):.3g}"])
    with ProcessPoolExecutor(1) as executor:
        sweep(2, 2, executor=executor)  # it compiles
        waited = per_chunk(lambda _: {"executor": executor}, perf_counter)
        rows.append(["a process, memory", f"{waited:.3g}"])
    print_table("Overhead of a chunk", ("where", "ms"), rows)


def per_chunk(options: Callable[[int], dict[str, Any]], clock: Callable[[], float]) -> float:
    """Return milliseconds a chunk."""
    seconds = []
    for count in CHUNKS:
        own, samples = options(count), []
        for _ in range(ROUNDS):
            start = clock()
            sweep(count, 2, chunk=1, **own)
            samples.append(clock() - start)
            if "store" in own:
                remove(own["store"])
        seconds.append(statistics.median(samples))
    return (seconds[1] - seconds[0]) / (CHUNKS[1] - CHUNKS[0]) * 1e3


def print_measures() -> None:
    """Print what a measure of a motion costs, all motions together and each alone."""
    mechanism = FOUR_BAR.mechanism()
    mechanism.output("swing", sympy.Symbol("phi_rocker"), "rad")
    module, rng = kc.compile(mechanism), np.random.default_rng(4)
    *lengths, _ = FOUR_BAR.parameters.items()
    p = {name: x * (1 + SPREAD * rng.uniform(-1, 1, MEASURED)) for name, x in lengths}
    several = kc.solve(module, FOUR_BAR.times(TIMES), p)
    sets = np.array(list(several.parameters.values())).T
    seconds: dict[str, list[float]] = {"together": [], "each alone": []}
    for _ in range(ROUNDS):
        start = process_time()
        measures_together([several.variant(k) for k in range(MEASURED)], module, sets, ("swing",))
        seconds["together"].append(process_time() - start)
        start = process_time()
        for number in range(MEASURED):
            output_measures(several.variant(number), module, sets[number], ("swing",))
        seconds["each alone"].append(process_time() - start)
    least = {name: min(runs) for name, runs in seconds.items()}
    rows = [[name, f"{x / MEASURED * 1e3:.3g}"] for name, x in least.items()]
    rows.append(["ratio", f"{least['each alone'] / least['together']:.3g}"])
    print_table("Measures of an output", ("motions", "ms a motion"), rows)


def report(variants: int, found: dict[int, list[dict[str, float]]], is_same: bool) -> None:
    """Print what was measured, and what was to be reached."""
    median = {
        workers: {name: statistics.median(run[name] for run in runs) for name in runs[0]}
        for workers, runs in found.items()
    }
    heads = ("processes", "s", "us a position", "peak of a process, MB", "growth from 10 %, MB")
    rows = [
        [str(workers), f"{x['seconds']:.3g}", f"{x['seconds'] / (variants * TIMES) * 1e6:.3g}",
         f"{x['peak']:.0f}", f"{x['growth']:.1f}"]
        for workers, x in median.items()
    ]  # fmt: skip
    print_table(f"Sweep of {variants:,} four-bars x {TIMES} times into Zarr", heads, rows)
    gain = median[1]["seconds"] / median[2]["seconds"]
    growth = max(x["growth"] / x["peak"] for x in median.values())
    print_targets(
        "Sweeps: what was to be reached",
        (
            Target("two processes / one", gain, "at least", 1.8, "x"),
            Target("growth of memory from 10 % to the end / peak", growth, "at most", 0.05),
            Target("killed in the middle and resumed: other bytes", 1 - is_same, "at most", 0),
        ),
    )


if __name__ == "__main__":
    arguments = sys.argv[1:]
    count = int(arguments[0]) if arguments else VARIANTS
    if len(arguments) > 1:  # the process of one measurement
        one_process(count, int(arguments[1]), arguments[2], "kill" in arguments)
    else:
        main(count)

"""A checkout beside another: `python -m benchmarks.versus PATH_OF_OTHER_CHECKOUT [ROUNDS]`.

Fresh processes of both take turns; the tables give the least processor times and their ratio,
the first by the second. So a change is judged on one machine, in one run; a machine that changes
its speed by half meanwhile spoils medians, not minima.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
from json import loads
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from benchmarks import machine, mechanisms
from benchmarks.tables import print_table

HERE = Path(__file__).resolve().parents[1]
PROCESS = HERE / "benchmarks" / "versus_process.py"
ROUNDS = 7

LIMITS = {"C analysis": 1.3, "C variants": 1.3}
"""Largest ratio of a measurement, by the beginning of its name."""

LIMIT = 1.1
"""That of all others."""

STARTS = {
    "kincompile compile": (["compile", "examples/four_bar.py", "-o", os.devnull], False, 2.5),
    "kincompile run": (["run"], True, 3.0),
}
"""Commands whose start counts, whether they are given a data file, and how many times as long as
`import sympy` each may take."""


def main(other: Path, rounds: int) -> None:
    """Print the ratios."""
    print(f"{machine.description()}; load {machine.load()}\n")
    found: dict[Path, list[dict[str, float]]] = {HERE: [], other: []}
    for _ in range(rounds):
        for checkout, samples in found.items():
            samples.append(_measured(checkout))
    rows = []
    for name in found[HERE][0]:
        here, there = (min(sample[name] for sample in samples) for samples in found.values())
        limit = next((x for start, x in LIMITS.items() if name.startswith(start)), LIMIT)
        reached = "yes" if here <= limit * there else "**no**"
        rows.append([name, _text(here), _text(there), f"{here / there:.2f}", f"{limit}", reached])
    heads = ("what", "this", "other", "ratio", "at most", "reached")
    print_table("This checkout and another", heads, rows)
    with TemporaryDirectory() as folder:
        model = Path(folder) / "four_bar.toml"
        model.write_text(mechanisms.four_bar().to_toml(), encoding="utf-8")
        _print_starts(rounds, model)


def _measured(checkout: Path) -> dict[str, float]:
    """Return the times that a fresh process of a checkout prints, by name."""
    paths = os.pathsep.join((str(checkout), str(HERE)))
    done = subprocess.run(
        [sys.executable, str(PROCESS)],
        env={**os.environ, "PYTHONPATH": paths},
        check=True,
        capture_output=True,
        text=True,
    )
    times: dict[str, float] = loads(done.stdout)
    return times


def _print_starts(rounds: int, model: Path) -> None:
    """Print how long whole commands take, beside a process that imports SymPy, on the wall."""
    commands = {
        "import sympy": [sys.executable, "-c", "import sympy"],
        **{
            name: [sys.executable, "-m", "kincompile", *command, *([str(model)] if takes else [])]
            for name, (command, takes, _) in STARTS.items()
        },
    }
    times: dict[str, list[float]] = {name: [] for name in commands}
    for _ in range(rounds + 1):
        for name, command in commands.items():
            start = perf_counter()
            subprocess.run(command, cwd=HERE, check=True, capture_output=True)
            times[name].append(perf_counter() - start)
    medians = {name: statistics.median(samples[1:]) for name, samples in times.items()}
    sympy = medians.pop("import sympy")
    rows = [["import sympy", _text(sympy), "1", "", ""]]
    for name, seconds in medians.items():
        limit = STARTS[name][-1]
        reached = "yes" if seconds <= limit * sympy else "**no**"
        rows.append([name, _text(seconds), f"{seconds / sympy:.2f}", f"{limit}", reached])
    heads = ("process", "median", "by import sympy", "at most", "reached")
    print_table("Starting", heads, rows)


def _text(seconds: float) -> str:
    """Return a time with its unit."""
    units = ((1.0, "s"), (1e3, "ms"), (1e6, "us"))
    factor, unit = next(((f, u) for f, u in units if seconds * f >= 1), units[-1])
    return f"{seconds * factor:.3g} {unit}"


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]).resolve(), int(sys.argv[2]) if len(sys.argv) > 2 else ROUNDS)

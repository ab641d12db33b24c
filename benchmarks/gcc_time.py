"""What a cold `target="c"` costs the C compiler in space, beside `import sympy`.

`python -m benchmarks.gcc_time` prints a table and what was to be reached. All are processor times
of processes that this one starts: the compiler's, at `kc.compile` with a first motion and its
outputs, then at the first call for all quantities of a point in one go, then at that for many
parameter sets, and Python's for the import. Each mechanism begins with an empty cache.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import kincompile as kc
from benchmarks import machine
from benchmarks.tables import Target, print_table, print_targets
from kincompile.files.files import read_model

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
MODELS = (EXAMPLES / "double_wishbone.toml", *sorted((EXAMPLES / "space").glob("*.toml")))
LIMIT = 4
ROUNDS = 3
IMPORT = (sys.executable, "-c", "import sympy")


def main() -> None:
    """Measure and print."""
    before = machine.load()
    imported = min(of_children(lambda: subprocess.run(IMPORT, check=True)) for _ in range(5))
    rows, targets = [], []
    for path in MODELS:
        found = [cold(path) for _ in range(ROUNDS)]
        first, *later = (min(times) for times in zip(*found, strict=True))
        rows.append([path.stem, *(f"{x:.2f}" for x in (first, *later)), f"{first / imported:.1f}"])
        targets.append(Target(path.stem, first / imported, "at most", LIMIT, "x import sympy"))
    heads = (
        "mechanism", "first motion", "`kinematics`", "parameter sets", "first / `import sympy`"
    )  # fmt: skip
    print_table(f"The C compiler, s (`import sympy`: {imported:.2f} s)", heads, rows)
    print_targets("Targets", targets)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


def cold(path: Path) -> tuple[float, float, float]:
    """Return what the compiler takes for a mechanism [s]: at first, for `kinematics`, for sets."""
    model = read_model(path)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        made = []
        first = of_children(lambda: made.append(moved(kc.compile(model, target="c"))))
        module = made[0]
        p = np.tile(module.DEFAULTS, (2, 1, 1))
        together = of_children(lambda: module.kinematics(module.GUESS, 0 * module.GUESS, 0.0))
        return first, together, of_children(lambda: kc.solve(module, np.zeros(1), p))


def moved(module: ModuleType) -> ModuleType:
    """Return a module whose motion was solved, and its outputs computed."""
    solution = kc.solve(module, np.array([0.0, 0.001]))
    for name in getattr(module, "OUTPUTS", ()):
        solution[name]
    return module


def of_children(do: Callable[[], object]) -> float:
    """Return the processor time of the processes that something starts and waits for [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    do()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()

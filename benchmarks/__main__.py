"""Measure everything and print it as Markdown tables; takes about a minute."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks import machine
from benchmarks.evaluation import POINTS, Peers
from benchmarks.timing import Timing, in_turn, of_processes, printed_by_processes

if TYPE_CHECKING:
    from collections.abc import Sequence

ROOT = Path(__file__).resolve().parents[1]
PROCESSES = 15
ROUNDS = 60
COMPILE = "import sys; from kincompile.cli import main; sys.exit(main())"


@dataclass(frozen=True, slots=True)
class Row:
    """kincompile beside one peer: what they do, their times, and what must be reached [s]."""

    what: str
    ours: Timing
    peer: str
    theirs: Timing
    limit: float | None = None

    def cells(self, unit: float) -> list[str]:
        """Return the cells of the table; times in multiples of a unit."""
        ratio = f"{self.theirs.median / self.ours.median:.2g}"
        limit = "" if self.limit is None else f"{self.limit / unit:g}"
        ours, theirs = _times(self.ours, unit), _times(self.theirs, unit)
        return [self.what, self.peer, ratio, ours, limit, theirs]


def main() -> None:
    """Measure and print."""
    before = machine.load()
    peers = Peers()
    peers.check()
    _print("Building, ms", building(), 1e-3)
    _print("One point, us", one_point(peers), 1e-6)
    _print(f"A batch of {POINTS}, ns per point", batch(peers), 1e-9 * POINTS)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


def building() -> list[Row]:
    """Time fresh processes: what they print, and the command from start to exit."""
    names = ("kincompile", "sympy", "sympy-warm")
    commands = {name: ("-m", "benchmarks.cold", name) for name in names}
    cold = printed_by_processes(commands, rounds=PROCESSES)
    (first, second), sympy, warm = (cold[name] for name in names)
    whole = _command()
    compile_first, compile_second = "`kc.compile`, four-bar", "`kc.compile`, a second mechanism"
    return [
        Row(compile_first, first, "jacobian, nu, gamma, 4 lambdify", sympy[0], 60e-3),
        Row(compile_first, first, "the same, printers imported before", warm[0]),
        Row(compile_second, second, "all of it again", warm[1], 10e-3),
        Row("`kincompile compile`", whole["compile"], "`import sympy`", whole["import"], 1.0),
    ]


def _command() -> dict[str, Timing]:
    with tempfile.TemporaryDirectory() as folder:
        model, target = ROOT / "examples" / "four_bar.py", Path(folder) / "four_bar.py"
        commands = {
            "compile": ("-c", COMPILE, "compile", str(model), "-o", str(target)),
            "import": ("-c", "import sympy"),
        }
        return of_processes(commands, rounds=PROCESSES)


def one_point(peers: Peers) -> list[Row]:
    """Time all four quantities at one point."""
    found = in_turn(peers.point_calls(), calls=1000, rounds=ROUNDS)
    four, together = found["four functions"], found["kinematics"]
    return [
        Row("four functions", four, "4 lambdify of matrices", found["four matrices"], 9e-6),
        Row("four functions", four, "4 lambdify, `math`, into arrays", found["four lists"]),
        Row("`kinematics`", together, "1 lambdify, `math`, into arrays", found["arrays"]),
        Row("its code alone", found["code alone"], "1 lambdify, `math`, list", found["list"]),
    ]


def batch(peers: Peers) -> list[Row]:
    """Time all four quantities of a batch."""
    found = in_turn(peers.batch_calls(), calls=20, rounds=ROUNDS)
    last, alone = found["kinematics_batch_last"], found["code alone, last"]
    four, together = found["four functions"], found["kinematics"]
    rows, arrays = found["list, last"], found["arrays"]
    per_point = 1e-9 * POINTS
    return [
        Row("`kinematics_batch_last`", last, "1 lambdify, list of rows", rows, 110 * per_point),
        Row("its code alone", alone, "1 lambdify, list of rows", rows),
        Row("four functions", four, "1 lambdify, into dense arrays", arrays, 350 * per_point),
        Row("`kinematics`", together, "1 lambdify, into dense arrays", arrays),
    ]


def _times(timing: Timing, unit: float) -> str:
    return f"{timing.median / unit:.3g} ({timing.least / unit:.3g})"


def _print(title: str, rows: Sequence[Row], unit: float) -> None:
    heads = ("kincompile", "SymPy", "ratio", "kincompile, median (least)", "limit", "SymPy")
    print(f"### {title}\n\n| {' | '.join(heads)} |\n| {' | '.join('---' for _ in heads)} |")
    for row in rows:
        print(f"| {' | '.join(row.cells(unit))} |")
    print()


if __name__ == "__main__":
    main()

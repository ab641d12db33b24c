"""Eight mechanisms beside six peers in one table.

`python -m benchmarks.table [mechanism ...]` measures those named, or all, and prints the table;
`--points N` takes other than 10,000 times, `--write` puts it into both pages of README.md.
The rules are in benchmarks/README.md. Mechanisms are those of linkages.py and space.py, with their
data and units; what is measured, and how, is analysis.py's.
"""

from __future__ import annotations

import argparse
import signal
import sys
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import analysis, linkages, machine, space
from benchmarks.peers import casadi_peer, dyads, hand_loop, jax_peer, numba_peer, plain_c
from benchmarks.peers.common import Skipped
from benchmarks.tables import print_table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from benchmarks.linkages import Linkage
    from benchmarks.peers.common import Analysis, Vector
    from benchmarks.timing import Timing

    Found = Mapping[str, Timing | str]
    """Of each contender its time, or why there is no time."""

MECHANISMS: dict[str, Linkage] = {x.name: x for x in (*linkages.LINKAGES, *space.LINKAGES)}
LAMBDIFY = "SymPy lambdify"
PEERS: analysis.Builders = {
    "plain C": lambda linkage: plain_c.PlainC(linkage).analysis(is_predicted=False),
    "CasADi, its C": casadi_peer.generated,
    "Numba": numba_peer.whole_loop,
    "JAX": jax_peer.scan,
    LAMBDIFY: partial(hand_loop.by_sympy, cse=True),
    "dyads in NumPy": dyads.of_joints,
}
OURS: analysis.Builders = {
    analysis.C: partial(analysis.kincompile, target="c"),
    analysis.NUMPY: partial(analysis.kincompile, target="numpy"),
}
LESS_WORK = {"dyads in NumPy"}
"""Peers that give positions of joints alone."""
POINTS, ROUNDS, PATIENCE = 10_000, 7, 20
"""Times of a turn, how often each contender has its turn, seconds of the processor for building."""
SAME, AGREEMENT = 1e-12, 1e-10
"""How far our positions may miss the peers' equations, and theirs our positions, in parts of the
largest: peers end Newton's method at 1e-10."""
PAGE = Path(__file__).with_name("README.md")
README, IN_README = (
    PAGE.parents[1] / "README.md",
    {analysis.NUMPY, "plain C", "CasADi, its C", "JAX", *LESS_WORK},
)
"""The first page, and the contenders whose rows it has."""
BEGIN, END = "<!-- python -m benchmarks.table --write -->\n", "<!-- end of the table -->\n"


def main() -> None:
    """Measure, print, and write the table where that is asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.table")
    parser.add_argument("mechanisms", nargs="*", choices=[[], *MECHANISMS], metavar="mechanism")
    parser.add_argument("--points", type=int, default=POINTS)
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    names, before, measured = given.mechanisms or list(MECHANISMS), machine.load(), {}
    for name in names:
        measured[name] = measure(MECHANISMS[name], given.points)
        print(*table({name: measured[name]}, given.points), file=sys.stderr, flush=True)
    heads, *rows = table(measured, given.points)
    print_table(f"A turn at {given.points:,} times", heads, rows)
    for name, found in measured.items():
        for contender, why in found.items():
            if isinstance(why, str):
                print(f"{name}, {contender}: {why}")
    print(f"\n{machine.description()}. Load before {before}, after {machine.load()}.")
    if given.write:
        for page, shown in ((PAGE, rows), (README, rows_of_readme(rows))):
            page.write_text(with_table(page.read_text("utf-8"), (heads, *shown)), "utf-8")


def measure(linkage: Linkage, points: int, peers: analysis.Builders = PEERS) -> Found:
    """Time all contenders on one mechanism, once they have the same equations and numbers."""
    t = linkage.times(points)
    analyses: dict[str, Analysis] = {}
    skipped: dict[str, str] = {}
    wanted = None
    for name, build in {**OURS, **peers}.items():
        try:
            with patience():
                analyses[name] = build(linkage)
                q = analyses[name](t)[0]
        except Skipped as reason:
            analyses.pop(name, None)
            skipped[name] = str(reason)
            continue
        if wanted is None:
            wanted = q
            require_equations(linkage, t, q)
        if name not in LESS_WORK:
            size = AGREEMENT * np.abs(wanted).max()
            np.testing.assert_allclose(q, wanted, 0, size, err_msg=name)
    return {**analysis.measure(analyses, t, slow={LAMBDIFY}, rounds=ROUNDS), **skipped}


def require_equations(linkage: Linkage, t: Vector, q: Vector) -> None:
    """Require that positions (N, n) at times (N,) hold the equations that peers are given."""
    for row in linkage.residual(np, q.T, t, linkage.values.tolist()):
        np.testing.assert_allclose(row, 0, atol=SAME * np.abs(q).max(), err_msg=linkage.name)


@contextmanager
def patience() -> Iterator[None]:
    """Skip a contender that takes too long to build."""

    def stop(*_: Any) -> None:
        raise Skipped(f"more than {PATIENCE} s of the processor to build")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def table(measured: Mapping[str, Found], points: int) -> list[list[str]]:
    """Return the table: a column a mechanism, a row a contender, in multiples of kincompile's C."""
    rows = [["", *(name.replace("_", " ") for name in measured)]]
    rows.append(
        ["kincompile, C, us a time", *(_us(x[analysis.C], points) for x in measured.values())]
    )
    rows += [
        [f"{name} / C", *(_ratio(found, name) for found in measured.values())]
        for name in (analysis.NUMPY, *PEERS)
    ]
    return rows


def rows_of_readme(rows: list[list[str]]) -> list[list[str]]:
    """Return the rows of the table that the first page has."""
    first, *others = rows
    return [first, *(row for row in others if row[0].removesuffix(" / C") in IN_README)]


def _us(found: Timing | str, points: int) -> str:
    return "-" if isinstance(found, str) else f"{found.median / points * 1e6:.2g}"


def _ratio(found: Found, name: str) -> str:
    """Return a ratio of medians; bold where kincompile's C is behind."""
    one, other = found.get(name, ""), found[analysis.C]
    if isinstance(one, str) or isinstance(other, str):
        return "-"
    ratio = one.median / other.median
    shown = f"{ratio:.2g}" if ratio < 100 else f"{ratio:.0f}"
    return f"**{shown}**" if ratio < 1 else shown


def with_table(text: str, rows: tuple[list[str], ...]) -> str:
    """Return a page with a table between its marks."""
    head, _, rest = text.partition(BEGIN)
    _, _, tail = rest.partition(END)
    lines = [f"| {' | '.join(row)} |\n" for row in rows]
    lines.insert(1, "| " + " | ".join("---" for _ in rows[0]) + " |\n")
    return f"{head}{BEGIN}{''.join(lines)}{END}{tail}"


if __name__ == "__main__":
    main()

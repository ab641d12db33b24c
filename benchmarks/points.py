"""Phi, Phi_q, nu and gamma of the four-bar at one point and for a batch of 100,000, NumPy and C.

`python -m benchmarks.points` prints its tables in a minute; the peer is SymPy (`textbook.py`).
`python -m benchmarks` has the smaller batch, and more of SymPy.

The limits were set on another machine. So those of a batch are given twice: as they are, and as a
part of what SymPy took there, beside the same part in this run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import kincompile as kc
from benchmarks import machine, mechanisms
from benchmarks.evaluation import Peers
from benchmarks.tables import Target, print_table, print_targets
from benchmarks.timing import in_turn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from benchmarks.timing import Timing

    Calls = dict[str, Callable[[], object]]

BATCH = 100_000
NUMPY, C, SYMPY = "kincompile, NumPy", "kincompile, C", "SymPy cse"
FOUR, TOGETHER = "four functions", "`kinematics`"
LAST, DENSE, REUSED = "batch last", "dense Phi_q", "batch last, into the arrays of a call before"

LIMITS = {
    f"{NUMPY}: {FOUR}": 9,
    f"{C}: {TOGETHER}": 2,
    f"{NUMPY}: {LAST}": 90,
    f"{NUMPY}: {DENSE}": 250,
    f"{C}: {LAST}": 25,
    f"{C}: {REUSED}": 25,
    f"{C}: {DENSE}": 80,
}
"""At one point [us], of a batch [ns a point]."""

SYMPY_THERE = {LAST: 174, DENSE: 317}
"""What SymPy took for a batch on the machine on which the limits were set [ns a point]."""


def main() -> None:
    """Measure and print."""
    before, peers = machine.load(), {NUMPY: Peers()}
    peers[NUMPY].check()
    try:
        peers[C] = Peers(kc.compile(mechanisms.four_bar(), target="c"))
        peers[C].check()
    except kc.UnsupportedError as error:
        print(f"{C}: skipped: {error}\n")
    point = in_turn(point_calls(peers), calls=1000, rounds=40)
    batch = in_turn(batch_calls(peers), calls=1, rounds=25)
    print_table("One point, us", ("what", "median (least)"), rows(point, 1e-6))
    title = f"A batch of {BATCH:,}, ns a point"
    print_table(title, ("what", "median (least)"), rows(batch, 1e-9 * BATCH))
    print_targets("Points: what was to be reached", reached(point | batch))
    title = "Points: what was to be reached, as a part of SymPy's time in the same run"
    print_targets(title, reached_beside_sympy(batch))
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


def point_calls(peers: dict[str, Peers]) -> Calls:
    """Return the calls at one point."""
    calls: Calls = {}
    for name, peer in peers.items():
        found = peer.point_calls()
        calls[f"{name}: {FOUR}"] = found["four functions"]
        calls[f"{name}: {TOGETHER}"] = found["kinematics"]
    calls[f"{SYMPY}, `math`, into arrays"] = peers[NUMPY].point_calls()["arrays"]
    return calls


def batch_calls(peers: dict[str, Peers]) -> Calls:
    """Return the calls for a batch."""
    calls: Calls = {}
    for name, peer in peers.items():
        found = peer.batch_calls(BATCH)
        calls[f"{name}: {LAST}"] = found["kinematics_batch_last"]
        calls[f"{name}: {DENSE}"] = found["kinematics"]
        if name == C:
            calls[f"{name}: {REUSED}"] = peer.batch_call_into_arrays(BATCH)
    found = peers[NUMPY].batch_calls(BATCH)
    calls |= {f"{SYMPY}: {LAST}": found["list, last"], f"{SYMPY}: {DENSE}": found["arrays"]}
    return calls


def rows(found: dict[str, Timing], unit: float) -> Iterator[list[str]]:
    """Give a row per call."""
    for name, timing in found.items():
        yield [name, f"{timing.median / unit:.3g} ({timing.least / unit:.3g})"]


def reached(times: dict[str, Timing]) -> Iterator[Target]:
    """Compare with the limits."""
    for name, limit in LIMITS.items():
        if name in times:
            is_point = FOUR in name or TOGETHER in name
            unit, word = (1e-6, "us") if is_point else (1e-9 * BATCH, "ns")
            yield Target(f"{name}, a point", times[name].median / unit, "at most", limit, word)


def reached_beside_sympy(times: dict[str, Timing]) -> Iterator[Target]:
    """Compare the ratios to SymPy with those of the limits to SymPy there."""
    for name in filter(times.__contains__, LIMITS):
        kind = DENSE if DENSE in name else LAST
        ratio = times[name].median / times[f"{SYMPY}: {kind}"].median
        there = round(LIMITS[name] / SYMPY_THERE[kind], 2)
        yield Target(f"{name} / {SYMPY}: {kind}", ratio, "at most", there)


if __name__ == "__main__":
    main()

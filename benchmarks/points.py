"""Phi, Phi_q, nu and gamma of the four-bar at one point and for a batch of 100,000, NumPy and C.

`python -m benchmarks.points` prints two tables and takes a minute; the peer is SymPy
(`textbook.py`). `python -m benchmarks` has the smaller batch, and more of SymPy.
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
    print_targets("Points: what was to be reached", reached(point, batch))
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


def reached(point: dict[str, Timing], batch: dict[str, Timing]) -> Iterator[Target]:
    """Compare with what was to be reached."""
    limits = {
        f"{NUMPY}: {LAST}": 90,
        f"{NUMPY}: {DENSE}": 250,
        f"{C}: {LAST}": 25,
        f"{C}: {REUSED}": 25,
        f"{C}: {DENSE}": 80,
    }
    for name, limit in limits.items():
        if name in batch:
            nanoseconds = batch[name].median / BATCH * 1e9
            yield Target(f"{name}, ns a point", nanoseconds, "at most", limit, "ns")
    for name, limit in ((f"{NUMPY}: {FOUR}", 9), (f"{C}: {TOGETHER}", 2)):
        if name in point:
            yield Target(f"{name}, one point", point[name].median * 1e6, "at most", limit, "us")


if __name__ == "__main__":
    main()

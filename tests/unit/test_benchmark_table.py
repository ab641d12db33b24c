"""The table of the benchmarks: what it requires before it measures, and what it writes."""

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def table():
    sys.path.insert(0, str(ROOT))
    try:
        from benchmarks import table as module
    finally:
        sys.path.remove(str(ROOT))
    return module


def test_that_one_mechanism_is_measured_beside_two_peers(table, quick_compiler):
    peers = {name: table.PEERS[name] for name in (table.LAMBDIFY, "dyads in NumPy")}
    found = table.measure(table.MECHANISMS["four_bar"], 12, peers)
    assert set(found) == {*table.OURS, *peers}
    assert all(not isinstance(timing, str) for timing in found.values())
    heads, first, *others = table.table({"four_bar": found}, 12)
    assert heads == ["", "four bar"]
    assert [row[0] for row in others] == [f"{x} / C" for x in (table.analysis.NUMPY, *table.PEERS)]
    assert [row[1] == "-" for row in others] == [
        x not in found for x in ("kincompile, NumPy", *table.PEERS)
    ]
    assert float(first[1]) > 0


def test_that_a_peer_with_other_numbers_is_not_timed(table, quick_compiler):
    def wrong(linkage):
        right = table.analysis.kincompile(linkage, "numpy")
        return lambda t: tuple(part * (1 + 1e-8) for part in right(t))

    with pytest.raises(AssertionError, match="wrong"):
        table.measure(table.MECHANISMS["four_bar"], 12, {"wrong": wrong})


@pytest.mark.parametrize("name", ["slider_crank", "six_bar", "rssr", "pump"])
def test_that_positions_hold_the_equations_that_peers_are_given(table, name):
    linkage = table.MECHANISMS[name]
    t = linkage.times(5)
    q, _, _ = table.analysis.kincompile(linkage, "numpy")(t)
    table.require_equations(linkage, t, q)
    with pytest.raises(AssertionError, match=name):
        table.require_equations(linkage, t, q + 1e-9 * np.arange(q.shape[1]))


def test_that_a_table_is_written_between_its_marks(table):
    page = f"a\n{table.BEGIN}old\n{table.END}b\n"
    found = table.with_table(page, (["", "x"], ["C", "1"]))
    assert found == f"a\n{table.BEGIN}|  | x |\n| --- | --- |\n| C | 1 |\n{table.END}b\n"
    assert table.BEGIN in table.PAGE.read_text("utf-8")

"""Where a mechanism stands, its unit and the grid change no status and no event."""

import numpy as np
import pytest

import kincompile as kc

from .linkages import four_bar

END = 3.3
WAYS = (("march", 12), ("march", 90), ("grid", 90), ("grid", 700))
WORLDS = tuple(
    {"place": place, "turn": turn, "size": size}
    for place, turn, size in (
        ((0, 0), 0.0, 1e-9), ((0, 0), 1.1, 1e9), ((1e4, -1e4), 1.1, 1.0), ((1e6, 3e5), 0.0, 1e-9),
        ((1e6, 3e5), 1.1, 1.0), ((3e5, 1e6), 2.5, 1e9),
    )
)  # fmt: skip
LENGTHS = {"turning": (0.3, 1.0, 0.8, 1.1), "locking": (0.9, 0.7, 0.6, 1.2)}


def told(lengths, method, points, world, target="numpy"):
    """Return what is said of a motion: how far it goes, by which statuses, and its events."""
    module = kc.compile(four_bar(lengths, **world).mechanism, target=target)
    t = np.linspace(0, END, points)
    solution = kc.solve(module, t, method=method)
    reached = t[solution.status == 0]
    events = [(event.kind, round(event.t, 5), event.bodies) for event in solution.events]
    return sorted(set(solution.status.tolist())), events, reached[-1] + END / (points - 1)


@pytest.mark.parametrize("kind", LENGTHS)
@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.slow
def test_no_place_no_unit_and_no_grid_is_judged_otherwise(kind, world):
    statuses, events, _ = told(LENGTHS[kind], "march", 90, {})
    assert [event[0] for event in events] == ([] if kind == "turning" else ["lock-up"])
    for method, points in WAYS:
        found, where, end = told(LENGTHS[kind], method, points, world)
        assert (found, where) == (statuses, events), (method, points)
        assert not events or end > events[0][1]


@pytest.mark.parametrize("world", WORLDS[2:])
def test_the_compiled_march_takes_a_mechanism_wherever_it_stands(world, quick_compiler):
    module = kc.compile(four_bar(**world).mechanism, target="c")
    solution = kc.solve(module, np.linspace(0, END, 500))
    assert solution.success
    assert solution.statistics["compiled"] == 500

"""Whoever has columns finds them by the same rule, and refuses an unknown one in the same words."""

from collections.abc import Callable
from typing import Any

import pytest

import kincompile as kc
from kincompile.errors import InputError
from kincompile.names import rate_of

TIMES = [0.0, 0.1]


def pendulum() -> kc.Mechanism:
    """Return a driven rod of the length L."""
    m = kc.Mechanism("pendulum")
    length = m.parameter("L", 0.5, unit="m")
    rod = m.body("rod", (0.5, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), rod, (-length, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, kc.t))
    return m


@pytest.fixture(scope="module")
def solution() -> Any:
    return kc.solve(kc.compile(pendulum()), TIMES)


def asked_of_a_solution(solution: Any, name: str) -> None:
    solution[name]


def asked_of_sensitivities(solution: Any, name: str) -> None:
    kc.sensitivities(solution, "L")[name, "L"]


def asked_for_sensitivities(solution: Any, name: str) -> None:
    kc.sensitivities(solution, "L", of=name)


def asked_for_tolerances(solution: Any, name: str) -> None:
    kc.tolerance(pendulum(), {"L": 0.001}, of=name, t=TIMES)


def asked_for_a_sweep(solution: Any, name: str) -> None:
    kc.sweep(pendulum(), {"L": [0.1]}, t=TIMES, columns=[name], target="numpy")


@pytest.mark.parametrize(
    "ask",
    [
        asked_of_a_solution,
        asked_of_sensitivities,
        asked_for_sensitivities,
        asked_for_tolerances,
        asked_for_a_sweep,
    ],
)
def test_an_unknown_column_is_refused_in_the_same_words(
    ask: Callable[[Any, str], None], solution: Any
) -> None:
    name = solution.name
    message = rf"{name} has no column 'rod\.ph'; did you mean 'phi_rod'\? The coordinates are x_"
    with pytest.raises(InputError, match=message):
        ask(solution, "rod.ph")


def test_that_a_sweep_lists_what_it_kept() -> None:
    found = kc.sweep(pendulum(), {"L": [0.1]}, t=TIMES, columns=["rod.phi"], target="numpy")
    with pytest.raises(InputError, match=r"has no column 'rod\.ph'.* There are .*phi_rod"):
        found["rod.ph"]


@pytest.mark.parametrize(
    ("given", "known", "meant"),
    [
        ("rod.phi_dot", ["phi_rod"], ("phi_rod", 1)),
        ("phi_rod_ddot", ["phi_rod"], ("phi_rod", 2)),
        ("v_dot", ["v", "v_dot"], ("v_dot", 0)),  # a known name comes before a rate
        ("v_dot_dot", ["v"], None),
        ("v_ddot", ["v", "v_dot"], ("v", 2)),
    ],
)
def test_which_rate_of_which_name_is_meant(
    given: str, known: list[str], meant: tuple[str, int] | None
) -> None:
    assert rate_of(given, known) == meant

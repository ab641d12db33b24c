"""The checker takes the golden rows in both forms, and names slips in those of a screw."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from tests.unit.spatial.test_golden_rows import (
    CASES,
    GIVEN,
    Q_DOT,
    ROWS,
    Q,
    at_angle,
    mechanism,
)
from tests.unit.spatial.test_small_rotations import by_turns

TURN = GIVEN["pitch"] / (2 * np.pi)
C_DDOT = -1.2 * np.sin(2 * GIVEN["t"])
"""Of C = 2 + 0.3 sin 2t, which the drivers of the golden file have, and a screw does not."""

OF_P = slice(3, 7)
NORM_ROWS = np.zeros((2, 14))
NORM_ROWS[0, OF_P], NORM_ROWS[1, 10:] = 2 * Q[OF_P], 2 * Q[10:]
NORM_GAMMA = [-2 * np.sum(p_dot**2) for p_dot in (Q_DOT[OF_P], Q_DOT[10:])]


def by_p(golden: dict[str, Any]) -> Any:
    return np.array(golden["Phi_q"])


def answer(name: str, form: str) -> dict[str, Any]:
    """Return Phi_q, nu and gamma as the golden file has them, in one of the two forms."""
    columns, gamma_name = (by_p, "gamma") if form == "r-p" else (by_turns, "gamma_omega")
    if name == "norm":
        Phi_q, nu, gamma = np.zeros((0, 14)), [], []
    elif name == "screw":
        # Its angle is a coordinate, so that its last row is two: theta - alpha = 0, and
        # h_i^T d - pitch alpha/(2 pi) = 0. Both are golden, in two drivers.
        parts = [ROWS[key] for key in ("screw", "relative_rotation", "relative_translation")]
        rows = np.vstack([columns(parts[0])[:4], columns(parts[1]), columns(parts[2])])
        Phi_q = np.column_stack([rows, [0, 0, 0, 0, -1, -TURN]])
        nu = [0.0] * 6
        gamma = [*parts[0][gamma_name][:4], *(item[gamma_name][0] - C_DDOT for item in parts[1:])]
        without_angle = Phi_q[5] - TURN * Phi_q[4]
        np.testing.assert_allclose(without_angle[:-1], columns(parts[0])[4], atol=1e-12)
        assert gamma[5] - TURN * gamma[4] == pytest.approx(parts[0][gamma_name][4], abs=1e-12)
    else:
        golden = ROWS[name]
        Phi_q, nu, gamma = columns(golden), golden["nu"], golden[gamma_name]
    if form == "r-p":
        own = np.zeros((2, Phi_q.shape[1]))
        own[:, :14] = NORM_ROWS
        Phi_q, nu, gamma = np.vstack([Phi_q, own]), [*nu, 0, 0], [*gamma, *NORM_GAMMA]
    return {"Phi_q": Phi_q, "nu": np.array(nu), "gamma": np.array(gamma)}


@cache
def model(name: str) -> Any:
    return mechanism(CASES[name]())


def states(name: str) -> dict[str, Any]:
    q, q_dot = at_angle(name, Q, 0.3), at_angle(name, Q_DOT, -0.7)
    return {"q": q, "q_dot": q_dot, "t": GIVEN["t"]}


def test_that_the_norm_row_is_that_of_the_golden_file() -> None:
    np.testing.assert_allclose(NORM_ROWS[0], ROWS["norm"]["Phi_q"][0], atol=1e-12)
    assert NORM_GAMMA[0] == pytest.approx(ROWS["norm"]["gamma"][0], abs=1e-12)
    np.testing.assert_allclose(ROWS["norm"]["Phi_pi"], 0, atol=1e-15)  # so the other form has none
    assert ROWS["norm"]["gamma_omega"] == pytest.approx([0], abs=1e-15)


CHECKED = [("norm", "r-p")] + [
    (name, form) for name in CASES if name != "norm" for form in ("r-p", "r-omega")
]


@pytest.mark.parametrize(("name", "form"), CHECKED)
def test_that_the_checker_accepts_the_golden_rows(name: str, form: str) -> None:
    given = answer(name, form)
    report = kc.compare(model(name), **given, states=states(name))
    assert report.verdict == "equal"
    kinds = [item.kind for item in report.conventions]
    assert kinds == ([] if form == "r-p" else ["r-omega form"])


def times_turn(given: Any, p: slice) -> None:
    given["Phi_q"][5, -1] *= 2 * np.pi


def right_handed(given: Any, p: slice) -> None:
    given["Phi_q"][5, -1] *= -1


def turned_back(given: Any, p: slice) -> None:
    given["Phi_q"][4] *= -1
    given["Phi_q"][4, -1] *= -1


def half(given: Any, p: slice) -> None:
    given["Phi_q"][:6, p] /= 2


def last(given: Any, p: slice) -> None:
    given["Phi_q"][:6, p] = given["Phi_q"][:6, p][:, [1, 2, 3, 0]]


def no_gyration(given: Any, p: slice) -> None:
    given["gamma"][:6] *= -1


FAULTS: dict[str, tuple[Callable[[Any, slice], None], str]] = {
    "pitch without 2 pi": (times_turn, "the factor 2 pi^-1 is missing"),
    "the other hand": (right_handed, "the entry has the wrong sign"),
    "the angle counted back": (turned_back, "wrong sign"),
    "2 in B": (half, "the derivative by p_i is half what it should be"),
    "e0": (last, "e0 stands last in the columns of p_i"),
    "sign of gamma": (no_gyration, "wrong sign"),
}


@pytest.mark.slow
@pytest.mark.parametrize(("spoil", "named"), FAULTS.values(), ids=[*FAULTS])
def test_that_slips_in_a_screw_are_named(spoil: Any, named: str) -> None:
    given = answer("screw", "r-p")
    spoil(given, OF_P)
    changed = {name: given[name] for name in given if (name == "gamma") == (spoil is no_gyration)}
    report = kc.compare(model("screw"), **changed, states=states("screw"))
    assert not report.equal
    assert named in str(report)
    assert {entry.row[:2] for entry in report.different} == {"a."}


@pytest.mark.slow
@pytest.mark.parametrize("slip", ["global", "sign"])
def test_that_slips_in_a_screw_by_small_rotations_are_named(slip: str) -> None:
    given = answer("screw", "r-omega")
    if slip == "sign":
        given["Phi_q"][:, 3:6] *= -1
    else:  # body i alone about the global axes
        p = np.array(GIVEN["p_i"])
        e = p[1:]
        skew = np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
        A = (p[0] ** 2 - e @ e) * np.eye(3) + 2 * np.outer(e, e) + 2 * p[0] * skew  # noqa: N806
        given["Phi_q"][:, 3:6] = given["Phi_q"][:, 3:6] @ A.T
    report = kc.compare(model("screw"), **given, states=states("screw"))
    assert not report.equal
    named = "wrong sign" if slip == "sign" else "the small rotations are about the global axes"
    assert named in str(report)

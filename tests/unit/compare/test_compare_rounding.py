"""What rounding may hide: terms that cancel, numbers with few digits, small and far mechanisms."""

import json
import math
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from tests.pendulum import pendulum

ANGLE = "phi_bob"
DOUBLE = "(sin(2*phi_bob) - 2*sin(phi_bob)*cos(phi_bob))"
RIGHT: dict[str, list[Any]] = {
    "Phi": ["x1 - cos(phi1)", "y1 - sin(phi1)", "phi1 - t^2"],
    "Phi_q": [["1", "0", "sin(phi1)"], ["0", "1", "-cos(phi1)"], ["0", "0", "1"]],
    "nu": ["0", "0", "2*t"],
    "gamma": ["-cos(phi1)*phi1d^2", "-sin(phi1)*phi1d^2", "2"],
}


def slow(value):
    """Return a parameter of the slow run."""
    return pytest.param(value, marks=pytest.mark.slow)


def of(length, guess=None, at=0):
    """Return a driven pendulum of a length, at a place."""
    m = kc.Mechanism("pendulum")
    bob = m.body("bob", guess=guess or (at + length, at, 0))
    m.add(kc.Revolute("pin", bob, (-length, 0), m.ground, (at, at)))
    m.add(kc.AbsoluteAngle("motor", bob, 0.5 + kc.t))
    return m


@pytest.mark.parametrize("size", ["1e13", slow("1e7"), slow("1e10"), slow("1e15")])
def test_that_zeros_alone_have_no_point(size):
    zero = f"{size}*{DOUBLE}"
    given = {"Phi": [zero] * 3, "Phi_q": [[zero] * 3] * 3, "nu": [zero] * 3, "gamma": [zero] * 3}
    for strict in (False, True):
        report = kc.compare(pendulum(), **given, strict=strict)
        wrong = [item.label for item in report.different]
        # Five entries of Phi_q and nu are zero, so that a zero is right where it can be decided.
        assert len(wrong) == 18 if float(size) > 1e12 else len(wrong) >= 12
        assert not report.equal
    tests = json.loads(report.to_gradescope())["tests"]
    assert sum(item["score"] for item in tests if not item["name"].startswith("nu")) == 0


def test_that_what_cannot_be_decided_says_so_and_what_to_do():
    report = kc.compare(pendulum(), gamma=[f"7 + 1e15*{DOUBLE}", *RIGHT["gamma"][1:]])
    assert (report.verdict, report.equal) == ("undecided", False)
    (entry,) = report.different
    (diagnosis,) = entry.diagnoses
    assert diagnosis.kind == "terms that cancel"
    assert "cannot be decided" in diagnosis.text
    assert "Write the entry without them" in diagnosis.text
    assert "undecided" in report.to_text()
    (test,) = (item for item in json.loads(report.to_gradescope())["tests"] if not item["score"])
    assert "cannot be decided" in test["output"]
    assert "gamma[pin.x]: undecided" in report.to_text()


def test_that_numbers_with_exponents_do_not_hide_what_is_wrong():
    zero = f"1.234e9*sin(2*{ANGLE}) - 2.468e9*sin({ANGLE})*cos({ANGLE})"
    report = kc.compare(pendulum(), gamma=[zero, zero, "2"])
    assert [item.diagnoses[0].kind for item in report.different] == ["too few digits"] * 2
    assert "Write more digits" in report.different[0].diagnoses[0].text


@pytest.mark.parametrize("name", ["gamma", *map(slow, ("Phi", "Phi_q", "nu"))])
def test_that_small_zeros_leave_a_right_answer_right(name):
    model = pendulum()
    for zero in (f"1e3*{DOUBLE}", f"100*(sin({ANGLE})^2 + cos({ANGLE})^2 - 1)"):
        rows = [
            [f"{x} + {zero}" for x in row] if isinstance(row, list) else f"{row} + {zero}"
            for row in RIGHT[name]
        ]
        assert kc.compare(model, **{name: rows}).equal


def test_that_zeros_do_not_hide_a_wrong_mass_or_force():
    m = kc.Mechanism("pendulum")
    m.gravity = (0, -9.81)
    bob = m.body("bob", guess=(1, 0, 0), mass=2, inertia=0.3)
    m.add(kc.Revolute("pin", bob, (-1, 0), m.ground, (0, 0)))
    for size in ("1e6", "1e15"):
        zero = f"{size}*{DOUBLE}"
        report = kc.compare(m, M=[[zero] * 3] * 3, Q=[zero] * 3)
        labels = {item.label for item in report.different}
        assert {"M[x_bob, x_bob]", "M[phi_bob, phi_bob]", "Q[y_bob]"} <= labels
    assert report.verdict == "undecided"
    M = [[2, 0, 0], [0, 2, 0], [0, 0, f"0.3 + 1e3*{DOUBLE}"]]
    assert kc.compare(m, M=M, Q=["0", "-19.62", f"1e3*{DOUBLE}"]).equal


@pytest.mark.parametrize("length", [slow(1e-3), 1e-5, slow(1e-7)])
@pytest.mark.parametrize("is_guessed", [True, slow(False)])
def test_that_a_small_mechanism_is_compared_in_its_own_size(length, is_guessed):
    m = of(length, None if is_guessed else (0, 0, 0))
    eye = np.eye(3)
    for wrong in (lambda q, t: eye, eye.astype(np.float32), eye):
        report = kc.compare(m, Phi_q=wrong)
        assert [item.label for item in report.different] == [
            "Phi_q[pin.x, phi_bob]", "Phi_q[pin.y, phi_bob]",
        ]  # fmt: skip

    def right(q, t, *, dtype=float):
        s, c = length * math.sin(q[2]), length * math.cos(q[2])
        return np.array([[1, 0, s], [0, 1, -c], [0, 0, 1]], dtype)

    assert kc.compare(m, Phi_q=right).equal
    assert kc.compare(m, Phi_q=lambda q, t: right(q, t, dtype=np.float32)).equal
    q = np.array([0.2 * length, 0.5 * length, 0.7])
    at = {"states": {"q": q, "t": 0.2}}
    assert kc.compare(m, Phi_q=right(q, 0.2, dtype=np.float32), **at).equal


@pytest.mark.parametrize("place", [slow(10**3), slow(10**7), 10**9, slow(10**10)])
def test_that_a_slip_is_seen_wherever_a_mechanism_stands(place):
    m = of(1, at=place)
    Phi = [f"x1 - cos(phi1) - {place}", f"y1 - sin(phi1) - {place}", "phi1 - 1/2 - t"]
    assert kc.compare(m, Phi=Phi).equal
    assert not kc.compare(m, Phi=[f"{Phi[0]} - 1/10", *Phi[1:]]).equal
    m = kc.Mechanism("tethered")
    plate = m.body("plate", guess=(place + 3, place + 4, 0))
    m.add(kc.AbsoluteDistance("rope", plate, (0.2, 0), (place, place), 5))
    square = f"(x1 + cos(phi1)/5 - {place})^2 + (y1 + sin(phi1)/5 - {place})^2"
    assert kc.compare(m, Phi=f"[{square} - 25]").equal
    assert not kc.compare(m, Phi=f"[{square} - 26]").equal


@pytest.mark.parametrize(
    ("number", "is_right"),
    [("0.7071", True), ("0.70711", True), ("0.7072", False), ("0.707", False), ("0.70", False)],
)
def test_that_a_number_counts_to_half_of_its_last_digit(number, is_right):
    rows = [f"-{number}*{name}(phi1)*phi1d^2" for name in ("cos", "sin")]
    assert kc.compare(of(math.sqrt(0.5)), gamma=[*rows, "0"]).equal is is_right


def test_that_a_number_hides_nothing_that_is_smaller_than_its_own_entry():
    """A crank of 0.01 beside a distance of 1: half of a last digit is as large as the entry."""
    m = kc.Mechanism("crank")
    bob = m.body("bob", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", bob, (-0.01, 0), m.ground, (0, 0)))
    m.add(kc.AbsoluteX("slide", bob, (1, 0), 1))
    zero = f"19.99*sin(2*{ANGLE}) - 39.98*sin({ANGLE})*cos({ANGLE})"
    Phi_q = [[1, 0, f"0.01*cos(phi1) + {zero}"], [0, 1, "-0.01*cos(phi1)"], [1, 0, "-sin(phi1)"]]
    labels = [item.label for item in kc.compare(m, Phi_q=Phi_q).different]
    assert labels == ["Phi_q[pin.x, phi_bob]"]

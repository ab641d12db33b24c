"""A sign is forgiven where the author's own Phi or Phi_q has it, or where it is stated."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.checker.reference import Reference
from kincompile.checker.report import Report
from tests.pendulum import pendulum

QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")


@cache
def derived(model: kc.Mechanism) -> dict[str, sympy.ImmutableMatrix]:
    return {name: getattr(model, name) for name in QUANTITIES}


def right(model: kc.Mechanism) -> dict[str, sympy.Matrix]:
    return {name: matrix.as_mutable() for name, matrix in derived(model).items()}


def nonzero(matrix: sympy.Matrix) -> list[int]:
    return [k for k in range(matrix.rows) if any(matrix.row(k))]


def flagged(report: Report) -> set[tuple[str, str]]:
    return {(entry.quantity, entry.row) for entry in report.different}


def flipped(matrix: Any, rows: list[int]) -> Any:
    result = matrix.as_mutable()
    for k in rows:
        result[k, :] = -result[k, :]
    return result


REFERENCES: dict[str, Reference] = {}


@pytest.fixture
def reference(joint: kc.Mechanism) -> Reference:
    kind = type(joint.constraints[0]).__name__
    return REFERENCES.setdefault(kind, Reference(joint))


@pytest.mark.slow
def test_that_a_sign_of_phi_q_nu_or_gamma_alone_is_a_mistake(
    joint: kc.Mechanism, reference: Reference
) -> None:
    given = right(joint)
    for name in QUANTITIES[1:]:
        rows = nonzero(given[name])
        for chosen in ([rows] if rows else []) + [[k] for k in rows if len(rows) > 1]:
            report = kc.compare(reference, **{**given, name: flipped(given[name], chosen)})
            expected = {(name, reference.equations[k]) for k in chosen}
            assert (flagged(report), report.equal) == (expected, False)


@pytest.mark.every(5)
def test_that_nu_and_gamma_need_not_have_phi_beside_them(
    joint: kc.Mechanism, reference: Reference
) -> None:
    given = right(joint)
    for name in ("nu", "gamma"):
        if rows := nonzero(given[name]):
            wrong = flipped(given[name], rows)
            expected = {(name, reference.equations[k]) for k in rows}
            for beside in ({}, {"Phi": given["Phi"]}, {"Phi_q": given["Phi_q"]}):
                assert flagged(kc.compare(reference, **beside, **{name: wrong})) == expected


@pytest.mark.every(5)
def test_that_a_sign_of_the_whole_row_is_a_convention(
    joint: kc.Mechanism, reference: Reference
) -> None:
    given = right(joint)
    for chosen in ([0], list(range(given["Phi"].rows))):
        for names in (QUANTITIES, QUANTITIES[1:]):
            report = kc.compare(reference, **{n: flipped(given[n], chosen) for n in names})
            assert report.verdict == "equal up to convention"
            assert [item.kind for item in report.conventions] == ["row sign"]
            strict = kc.compare(
                reference, strict=True, **{n: flipped(given[n], chosen) for n in names}
            )
            assert not strict.equal


@pytest.mark.every(5)
def test_that_gamma_must_follow_a_row_of_phi_q_that_is_flipped(
    joint: kc.Mechanism, reference: Reference
) -> None:
    given = right(joint)
    report = kc.compare(reference, Phi_q=-given["Phi_q"], nu=given["nu"], gamma=given["gamma"])
    rows = {k for name in ("nu", "gamma") for k in nonzero(given[name])}
    # Either they have the wrong sign, or Phi_q has.
    assert {row for _, row in flagged(report)} == {reference.equations[k] for k in rows}


@pytest.mark.every(5)
@pytest.mark.parametrize(
    ("name", "stated", "kind"),
    [("nu", "Phi_t", "driver's rate reversed"), ("gamma", "left side", "whole sign")],
)
def test_that_an_opposite_sign_may_be_stated(
    joint: kc.Mechanism, reference: Reference, name: str, stated: str, kind: str
) -> None:
    given = right(joint)
    given[name] = -given[name]
    report = kc.compare(reference, **given, conventions={name: stated})
    assert report.equal
    assert [item.kind for item in report.conventions] == [f"sign of {name}"]
    if nonzero(given[name]):
        report = kc.compare(reference, **given)
        assert {item.kind for entry in report.different for item in entry.diagnoses} == {kind}
        assert f'state {name} = "{stated}" in [conventions]' in report.to_text()
        usual = right(joint)[name]
        assert not kc.compare(reference, **{name: usual}, conventions={name: stated}).equal


@pytest.mark.parametrize("suffix", [".txt", ".toml", ".json"])
def test_that_a_hand_file_may_state_a_convention(tmp_path: Path, suffix: str) -> None:
    text = {
        ".txt": "gamma = [0; 0; -2]\nPhi_q = [0 0 1]\n[conventions]\ngamma = left side\n",
        ".toml": 'gamma = [-2]\n[conventions]\ngamma = "left side"\n',
        ".json": '{"gamma": [-2], "conventions": {"gamma": "left side"}}',
    }[suffix]
    file = tmp_path / f"hand{suffix}"
    file.write_text(text.replace("0; 0; -2", "-2"))
    assert kc.compare_file(pendulum(), file, constraint="motor").equal
    file.write_text(text.replace("0; 0; -2", "-2").replace("left side", "left"))
    with pytest.raises(kc.InputError, match=r'gamma = "left side" or "right side"'):
        kc.compare_file(pendulum(), file, constraint="motor")


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_that_what_is_not_finite_is_not_defined(value: float) -> None:
    model = pendulum()
    for name, shape in (("Phi", 3), ("nu", 3), ("gamma", 3), ("Phi_q", (3, 3))):
        report = kc.compare(model, **{name: np.full(shape, value)})
        assert len(report.different) == np.prod(shape)
        assert {e.diagnoses[0].kind for e in report.different} == {"not defined"}


def test_that_an_infinite_number_hides_no_other() -> None:
    matrix = np.full((3, 3), 42.0)
    matrix[:, 0] = np.inf
    assert len(kc.compare(pendulum(), Phi_q=matrix).different) >= 7
    assert not kc.compare(pendulum(), Phi_q=lambda q, t: matrix * q[0]).equal


def test_that_a_pole_on_the_manifold_is_no_answer() -> None:
    wrong = "[log(phi_bob-t^2), 3/(phi_bob-t^2), 1/(phi_bob-t^2)]"
    for name in ("nu", "gamma"):
        assert len(kc.compare(pendulum(), **{name: wrong}).different) == 3


def test_that_a_circular_nu_is_no_answer() -> None:
    model = pendulum()
    circular: Any = model.Phi_q * model.q_dot
    report = kc.compare(model, Phi_q=model.Phi_q, nu=circular)
    assert flagged(report) == {("nu", row) for row in model.system().equations}
    assert {e.diagnoses[0].kind for e in report.different} == {"rates where none belong"}


def test_that_phi_q_must_be_right_off_the_manifold_too() -> None:
    model = pendulum()
    report = kc.compare(model, Phi_q=model.Phi_q + 42 * model.Phi * sympy.ones(1, 3))
    assert (report.verdict, report.equal) == ("equal on the manifold", False)
    assert "right only where the constraints hold" in report.to_text()
    nu = kc.compare(model, nu=model.nu + 42 * model.Phi)
    assert (nu.verdict, nu.equal) == ("equal on the manifold", True)
    assert not kc.compare(model, nu=model.nu + 42 * model.Phi, strict=True).equal


def test_that_phi_q_must_not_need_another_joint() -> None:
    model = kc.Mechanism("slider")
    slider, rod = model.body("slider", guess=(1, 0, 0)), model.body("rod", guess=(0.5, 0, 0.2))
    model.add(kc.Translational("rail", slider, (0, 0), (1, 0), model.ground, (0, 0), (1, 0)))
    model.add(kc.Revolute("pin", slider, (0, 0), rod, (0.5, 0)))
    model.add(kc.AbsoluteAngle("motor", rod, kc.t))
    Phi_q = model.Phi_q.as_mutable()
    row = model.system().equations.index("pin.x")
    Phi_q[row, 0] += 5 * sympy.sin(sympy.Symbol("phi_slider"))
    report = kc.compare(model, Phi_q=Phi_q)
    assert [(e.row, e.column, e.verdict) for e in report.different] == [
        ("pin.x", "x_slider", "equal on the manifold")
    ]

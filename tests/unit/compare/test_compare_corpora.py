"""Two corpora: right answers in other forms, none called wrong; single faults, all of them found.

They are data: `tests/corpora/*.toml`, with the form or the fault beside each answer.
"""

import os
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.checker.fault import OMISSIONS
from kincompile.checker.reference import Reference
from kincompile.checker.report import Report

CORPORA = Path(__file__).resolve().parents[2] / "corpora"
QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")
Models = dict[str, Callable[[], kc.Mechanism]]

KEPT: dict[str, tuple[kc.Mechanism, Reference]] = {}


def model_of(kind: str, models: Models) -> tuple[kc.Mechanism, Reference]:
    if kind not in KEPT:
        KEPT[kind] = models[kind](), Reference(models[kind]())
    return KEPT[kind]


def answers(corpus: str, name: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = tomllib.loads((CORPORA / corpus).read_text(encoding="utf-8"))[
        name
    ]
    return found


def compared(reference: Reference, model: kc.Mechanism, answer: dict[str, Any]) -> Report:
    given = {name: answer[name] for name in QUANTITIES if name in answer}
    more = {"conventions": answer["conventions"]} if "conventions" in answer else {}
    if "given_as" in answer:
        given, more = GIVEN_AS[answer["given_as"]](model)
    report: Report = kc.compare(reference, **given, **more)
    return report


def matrices(model: kc.Mechanism) -> tuple[dict[str, Any], dict[str, Any]]:
    return {name: getattr(model, name) for name in QUANTITIES}, {}


def functions(model: kc.Mechanism, dtype: Any = float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return functions that SymPy writes, apart from the compiler."""
    system = model.system()
    p = [sympy.Symbol(item.name) for item in system.parameters]

    def function(name: str) -> Callable[..., Any]:
        q, q_dot = list(model.q), list(model.q_dot)
        if name == "gamma":
            moving = sympy.lambdify([q, q_dot, kc.t, p], model.gamma, "numpy")
            return lambda q, q_dot, t, p: np.asarray(moving(q, q_dot, t, p), dtype)
        still = sympy.lambdify([q, kc.t, p], getattr(model, name), "numpy")
        return lambda q, t, p: np.asarray(still(q, t, p), dtype)

    return {name: function(name) for name in QUANTITIES}, {}


def by_differences(model: kc.Mechanism) -> tuple[dict[str, Any], dict[str, Any]]:
    given, more = functions(model)
    Phi, h = given["Phi"], 1e-4

    def gamma(q: Any, q_dot: Any, t: float, p: Any) -> Any:
        ahead, behind = Phi(q + h * q_dot, t + h, p), Phi(q - h * q_dot, t - h, p)
        return -(ahead - 2 * Phi(q, t, p) + behind) / h**2

    return {"Phi": Phi, "Phi_q": given["Phi_q"], "gamma": gamma}, more


def printed(model: kc.Mechanism) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return arrays with four decimals at three states."""
    given, _ = functions(model)
    system, random = model.system(), np.random.default_rng(6)
    p = np.array([item.default for item in system.parameters])
    q, q_dot = random.uniform(-1, 1, (2, 3, len(system.coordinates)))
    values = {
        name: np.stack(
            [
                item(*((a, b, 0.3) if name == "gamma" else (a, 0.3)), p)
                for a, b in zip(q, q_dot, strict=True)
            ]
        )
        for name, item in given.items()
    }
    arrays = {
        name: np.round(item if name == "Phi_q" else item[..., 0], 4)
        for name, item in values.items()
    }
    return arrays, {"states": {"q": q, "q_dot": q_dot, "t": 0.3}}


def in_degrees(model: kc.Mechanism) -> tuple[dict[str, Any], dict[str, Any]]:
    angles = [item.name for item in model.system().coordinates if item.unit == "rad"]
    to_radians = {
        symbol: symbol * sympy.pi / 180
        for name in angles
        for symbol in (sympy.Symbol(name), sympy.Symbol(f"{name}_dot"))
    }
    given, more = matrices(model)
    return {name: item.xreplace(to_radians) for name, item in given.items()}, more


GIVEN_AS: dict[str, Callable[[kc.Mechanism], tuple[dict[str, Any], dict[str, Any]]]] = {
    "sympy": matrices,
    "functions": functions,
    "functions of single precision": lambda model: functions(model, np.float32),
    "gamma by differences": by_differences,
    "arrays with four decimals": printed,
    "degrees": in_degrees,
}

SIGNS = {"sign", "whole sign", "driver's rate reversed"}
MISSING = {"missing term", *OMISSIONS}
MEANT = {kind: kinds for kinds in (SIGNS, MISSING) for kind in kinds}
"""Names of the same fault: a term that is missing has a name by its place in the derivation."""

SOME, ALL = 29, pytest.param(1, marks=pytest.mark.slow)


@pytest.mark.parametrize("step", [SOME, ALL], ids=["some", "all"])
def test_that_no_right_answer_is_called_wrong(step: int, joint_types: Models) -> None:
    corpus = answers("right_answers.toml", "answer")
    assert len(corpus) >= 300
    assert {item["model"] for item in corpus} == set(joint_types)
    for item in corpus[::step]:
        model, reference = model_of(item["model"], joint_types)
        report = compared(reference, model, item)
        told = item["model"], item["form"], report.to_text()
        assert report.equal, told
        assert item.get("convention") in {None, *(found.kind for found in report.conventions)}, told


@pytest.mark.slow
@pytest.mark.parametrize("step", [1 if "ADVERSARY_REPORT" in os.environ else 6])
def test_that_every_single_fault_is_found_and_named(step: int, joint_types: Models) -> None:
    corpus = answers("single_faults.toml", "answer")
    assert len(corpus) >= 1000
    assert {item["model"] for item in corpus} == set(joint_types)
    unique, found = [], []
    for item in corpus[::step]:
        model, reference = model_of(item["model"], joint_types)
        quantity = item["quantity"]
        rows = getattr(model, quantity).tolist()
        for row, column, formula in item["entries"]:
            rows[row][column] = formula
        # What is right beside it decides what a sign or a factor is.
        beside = "Phi_q" if quantity == "Phi" else "Phi"
        given = {beside: getattr(model, beside), quantity: rows}
        report = kc.compare(reference, **given, strict=True)
        assert not report.equal, item
        kinds = {name.kind for entry in report.different for name in entry.diagnoses}
        meant = MEANT.get(item["fault"], {item["fault"]})
        # Entries that are all zero have one name, whatever led to them.
        unique.append(bool(kinds) and (kinds <= meant or kinds == {"left zero"}))
        found.append(not kinds.isdisjoint({*meant, "left zero"}))
    # The rest has two names: xi and eta swapped can be sine and cosine swapped, in numbers.
    assert np.mean(unique) >= 0.94
    assert np.mean(found) >= 0.99

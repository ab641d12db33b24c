"""The look-up of faults has an end: matrices by hand that are nothing but random numbers."""

from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.checker import reference as references
from kincompile.checker import slips, transmission_comparer
from kincompile.checker.report import Report
from kincompile.checker.transmission_faults import MOST_READINGS
from kincompile.checker.transmission_reference import TransmissionReference

POSES = 12
UNKNOWN = "no fault of the catalogue fits."


@cache
def reference(n: int) -> TransmissionReference:
    """Return n outputs, each a sum of sines of n inputs."""
    names = [f"m_{k}" for k in range(n)], [f"x_{k}" for k in range(n)]
    u, x = (sympy.symbols(own) for own in names)
    equations = [
        x[i] - sum(sympy.sin(u[j] * (1 + i / 10)) * (1 + i + j) / 10 for j in range(n))
        for i in range(n)
    ]
    system = kc.ConstraintSystem("gears", [*u, *x], equations)
    return TransmissionReference(kc.transmission(system, *names))


def require_unknown(report: Report, n: int) -> None:
    """Every entry is wrong, and plainly so."""
    assert len(report.different) == n * n
    for entry in report.different:
        (diagnosis,) = entry.diagnoses
        assert diagnosis.text.startswith(UNKNOWN)


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, 8])
def test_that_a_function_is_called_a_bounded_number_of_times(n: int) -> None:
    numbers = np.random.default_rng(n).normal(size=(n, n))
    calls = []

    def jacobian(u: Any, x: Any) -> Any:
        calls.append(u)
        return numbers * np.sin(u[0] + x)

    require_unknown(kc.compare(reference(n), J=jacobian), n)
    assert POSES < len(calls) <= (MOST_READINGS + 4) * POSES


@pytest.mark.parametrize("n", [6, 8])
def test_that_a_number_of_orders_is_tried_that_is_rows_squared(
    n: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = []
    own = vars(transmission_comparer)["_is_better"]

    def counted(*both: Any) -> bool:
        tried.append(both)
        return bool(own(*both))

    monkeypatch.setattr(transmission_comparer, "_is_better", counted)
    numbers = np.random.default_rng(n).normal(size=(n, n))
    require_unknown(kc.compare(reference(n), J=numbers), n)
    assert len(tried) <= 4 * (n * n + 1)  # dx/du, its inverse, and the transpose of both


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, 8])
def test_that_formulas_are_evaluated_in_a_bounded_number_of_ways(
    n: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hand J of n x n random products, numbers of three digits in each, so that pairs abound."""
    rng = np.random.default_rng(n)

    def entry() -> str:
        a, b, c = rng.choice(n, 3)
        first, second = rng.choice(["sin", "cos"], 2)
        return f"{rng.uniform(0.1, 2):.3f}*{first}(m_{a})*{second}(m_{b} - x_{c})*x_{a}"

    evaluated, pairs = [], []
    run, fitting = vars(references)["run"], vars(slips)["_fitting"]

    def counted(nodes: Any, *others: Any) -> Any:
        evaluated.append(len(nodes))
        return run(nodes, *others)

    def fitted(changes: Any, *others: Any) -> Any:
        pairs.append(changes.shape[1])
        return fitting(changes, *others)

    monkeypatch.setattr(references, "run", counted)
    monkeypatch.setattr(slips, "_fitting", fitted)
    require_unknown(kc.compare(reference(n), J=[[entry() for _ in range(n)] for _ in range(n)]), n)
    assert sum(evaluated) <= 160_000
    assert sum(pairs) <= n * n * slips.MOST_SUMS

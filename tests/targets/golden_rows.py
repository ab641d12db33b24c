"""All spatial constraints of the golden file between two bodies, as one mechanism."""

import re
from typing import Any

import numpy as np

import kincompile as kc
from kincompile import spatial
from tests.unit.spatial import test_golden_rows as golden

Q, Q_DOT = (golden.at_angle("screw", *item) for item in ((golden.Q, 0.3), (golden.Q_DOT, -0.7)))
"""The golden state; the last coordinate is the angle of the screw."""


def mechanism() -> spatial.Mechanism:
    """Return two bodies with all constraints between them, called as in the golden file."""
    constraints = [
        called(item, f"{name}_{k}")
        for name, case in golden.CASES.items()
        for k, item in enumerate(case())
    ]
    return golden.mechanism(constraints)


def called(constraint: Any, name: str) -> Any:
    """Return a constraint by another name."""
    if isinstance(constraint, kc.Equation):
        return kc.Equation(name, *constraint.expressions)
    return type(constraint)(name, *(getattr(constraint, x) for x in constraint.arguments()))


def assert_golden(equations: Any, found: dict[str, Any]) -> None:
    """Compare Phi, Phi_q, nu and gamma at the golden state, constraint by constraint."""
    for name, rows in golden.ROWS.items():
        own = re.compile("norm_i" if name == "norm" else rf"{name}_\d\b.*")
        places = [k for k, item in enumerate(equations) if own.fullmatch(item)]
        for quantity, values in found.items():
            away = golden.golden_rows(name, np.asarray(values)[places])
            away = (away[:, :14] if away.ndim > 1 else away) - rows[quantity]
            if (name, quantity) == ("screw", "Phi"):  # the advance of a whole turn does not count
                away[-1] -= golden.GIVEN["pitch"] * round(away[-1] / golden.GIVEN["pitch"])
            assert np.abs(away).max() < 1e-9, (name, quantity)

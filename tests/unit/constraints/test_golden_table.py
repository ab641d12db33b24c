"""The golden table: one generic state, every constraint, by three routes that share little."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.ir.inline import inline
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower
from kincompile.structure.counting import unmatched

TABLE = json.loads(
    (Path(__file__).parents[2] / "data" / "constraints_golden.json").read_text(encoding="utf-8")
)
STATE = TABLE["state"]
ROWS = {row["row"]: row for row in TABLE["rows"]}
TOLERANCE = 1e-9  # the table has ten decimals

C = 2 + 0.3 * sympy.sin(2 * kc.t)
rho_i = 1 + 0.3 * sympy.cos(kc.alpha) + 0.1 * sympy.sin(2 * kc.alpha)
rho_j = 0.7 + 0.2 * sympy.cos(3 * kc.alpha)
S = SimpleNamespace(
    **{key: tuple(value) if isinstance(value, list) else value for key, value in STATE.items()}
)

CONSTRAINTS: dict[str, Callable[[Any, Any], Any]] = {
    "ax": lambda i, j: kc.AbsoluteX("k", i, S.s_i, C),
    "ay": lambda i, j: kc.AbsoluteY("k", i, S.s_i, C),
    "aphi": lambda i, j: kc.AbsoluteAngle("k", i, C),
    "ad": lambda i, j: kc.AbsoluteDistance("k", i, S.s_i, S.c, C),
    "rx": lambda i, j: kc.RelativeX("k", i, S.s_i, j, S.s_j, C),
    "ry": lambda i, j: kc.RelativeY("k", i, S.s_i, j, S.s_j, C),
    "rphi": lambda i, j: kc.RelativeAngle("k", i, j, C),
    "rd": lambda i, j: kc.Distance("k", i, S.s_i, j, S.s_j, C),
    "revolute": lambda i, j: kc.Revolute("k", i, S.s_i, j, S.s_j),
    "translational": lambda i, j: kc.Translational("k", i, S.s_i, S.v_i, j, S.s_j, S.v_j),
    "rt": lambda i, j: kc.RevoluteTranslational("k", i, S.s_i, S.v_i, j, S.s_j, C),
    "tdd": lambda i, j: kc.TranslationalDistance("k", i, S.s_i, S.v_i, j, S.s_j, C),
    # The book's relative angle driver counts from angles theta in both bodies.
    "rrd": lambda i, j: kc.RelativeAngle("k", i, j, C + S.theta_i - S.theta_j),
    "gear": lambda i, j: kc.Gear("k", i, S.s_i, S.R_i, S.theta_i, j, S.s_j, S.R_j, S.theta_j),
    "rack-pinion": lambda i, j: kc.RackAndPinion(
        "k", i, S.s_P, S.s_Q, S.theta_i, j, S.s_j, S.R_j, S.theta_j
    ),
    "point-follower": lambda i, j: kc.PointFollower("k", i, S.s_i, j, S.s_j, rho_j),
    "cam-follower": lambda i, j: kc.CamFollower("k", i, S.s_i, rho_i, j, S.s_j, rho_j),
    "cam, flat follower": lambda i, j: kc.CamFlatFollower("k", i, S.s_i, rho_i, j, S.s_j, S.v_j),
}
CONTACTS = {"point-follower": "j", "cam-follower": "ij", "cam, flat follower": "i"}


def rows_of(key: str) -> list[dict[str, Any]]:
    """Return the rows of a constraint: `key`, `key, 1`, or `key (+ alpha), 1`."""
    return [
        row
        for name, row in ROWS.items()
        if name == key or name.startswith((f"{key}, ", f"{key} ("))
    ]


@cache
def mechanism(key: str) -> kc.Mechanism:
    """Return the constraint between two bodies, and coordinates held until the system is square."""
    m = kc.Mechanism("golden")
    m.add(CONSTRAINTS[key](m.body("i"), m.body("j")))
    system = m.system()
    _, coordinates = unmatched(system, inline(lower(system)).pattern())
    for name in coordinates:
        m.add(kc.Equation(f"hold_{name}", sympy.Symbol(name)))
    return m


def state(key: str) -> tuple[Any, Any]:
    contacts = CONTACTS.get(key, "")
    q = [*S.q_i, *S.q_j, *(STATE[f"alpha_{letter}"] for letter in contacts)]
    q_dot = [*S.q_dot_i, *S.q_dot_j, *(STATE[f"alpha_dot_{letter}"] for letter in contacts)]
    return np.array(q), np.array(q_dot)


@cache
def compiled(m: kc.Mechanism) -> Any:
    return kc.compile(m)


def by_module(m: kc.Mechanism, q: Any, q_dot: Any) -> Any:
    return compiled(m).kinematics(q, q_dot, S.t)


def by_single_functions(m: kc.Mechanism, q: Any, q_dot: Any) -> Any:
    module = compiled(m)
    return (
        module.Phi(q, S.t), module.Phi_q(q, S.t), module.nu(q, S.t), module.gamma(q, q_dot, S.t),
    )  # fmt: skip


def by_matrices(m: kc.Mechanism, q: Any, q_dot: Any) -> Any:
    system = m.system()
    values = dict(zip([*system.q, *system.q_dot, kc.t], [*q, *q_dot, S.t], strict=True))
    found = (system.Phi, system.Phi_q, system.nu, system.gamma)
    Phi, Phi_q, nu, gamma = (np.array(matrix.subs(values).evalf(), float) for matrix in found)
    return Phi[:, 0], Phi_q, nu[:, 0], gamma[:, 0]


def by_interpreter(m: kc.Mechanism, q: Any, q_dot: Any) -> Any:
    return interpret(lower(m.system()), q, q_dot, S.t)


@pytest.mark.parametrize("route", [by_module, by_single_functions, by_matrices, by_interpreter])
@pytest.mark.parametrize("key", CONSTRAINTS)
def test_that_the_rows_of_the_table_come_out(key: str, route: Callable[..., Any]) -> None:
    Phi, Phi_q, nu, gamma = route(mechanism(key), *state(key))
    for k, row in enumerate(rows_of(key)):
        np.testing.assert_allclose(Phi[k], row["Phi"], atol=TOLERANCE, rtol=0)
        np.testing.assert_allclose(Phi_q[k], row["Phi_q"], atol=TOLERANCE, rtol=0)
        np.testing.assert_allclose(nu[k], row["nu"], atol=TOLERANCE, rtol=0)
        np.testing.assert_allclose(gamma[k], row["gamma"], atol=TOLERANCE, rtol=0)


def test_that_no_row_is_left_out() -> None:
    compared = [row["row"] for key in CONSTRAINTS for row in rows_of(key)]
    assert sorted(compared) == sorted(ROWS)
    assert len(compared) == 25


@pytest.mark.parametrize("key", CONSTRAINTS)
def test_that_the_table_has_all_equations_of_a_constraint(key: str) -> None:
    m = kc.Mechanism("golden")
    constraint = m.add(CONSTRAINTS[key](m.body("i"), m.body("j")))
    assert len(rows_of(key)) == len(constraint.equation_names)

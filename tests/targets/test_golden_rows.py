"""Every spatial constraint against golden rows, on every target."""

import numpy as np
import pytest

import kincompile as kc
from tests.spatial_golden import CASES, GIVEN, Q_DOT, ROWS, Q, assert_golden, mechanism

# One process evaluates each target once for all of them.
pytestmark = pytest.mark.xdist_group("targets")

QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")


def test_that_every_golden_row_has_a_case() -> None:
    assert CASES.keys() == ROWS.keys()


@pytest.mark.slow
def test_that_all_targets_give_the_golden_rows(target, case_named) -> None:
    found = {quantity: target["golden"][quantity][0] for quantity in QUANTITIES}
    assert_golden(CASES, case_named("golden").module.EQUATIONS, found)


@pytest.mark.parametrize("name", CASES)
def test_that_the_module_of_each_constraint_gives_its_golden_rows(name: str) -> None:
    module = kc.compile(mechanism(name))
    n = module.N_COORDINATES
    values = module.kinematics(Q[:n], Q_DOT[:n], GIVEN["t"])
    assert_golden([name], module.EQUATIONS, dict(zip(QUANTITIES, values, strict=True)))


@pytest.mark.slow
def test_that_the_matrices_of_the_system_give_the_golden_rows() -> None:
    m = mechanism(*CASES)
    values = [*Q.tolist(), *Q_DOT.tolist()]
    numbers = {kc.t: GIVEN["t"]} | dict(zip([*m.q, *m.q_dot], values, strict=True))
    found = {
        quantity: np.array(getattr(m, quantity).xreplace(numbers).evalf(), dtype=float)
        for quantity in QUANTITIES
    }
    found |= {quantity: found[quantity][:, 0] for quantity in ("Phi", "nu", "gamma")}
    assert_golden(CASES, m.system().equations, found)

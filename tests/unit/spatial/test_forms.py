"""What examples in space compile to: every form of it is verified, and gives one motion."""

from typing import Any

import numpy as np
import pytest
import sympy
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from tests.unit.spatial.test_examples import NAMES, compiled, model, solved

pytestmark = pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")


def derived(found: Any) -> bool:
    """Return whether all that is derived agrees, the planned solve too."""
    assert {"Phi", "Phi_q", "nu", "gamma"} <= {item.quantity for item in found.checks}
    return all(item.passed for item in found.checks)


@pytest.mark.parametrize("name", NAMES)
def test_that_an_example_is_verified(name: str) -> None:
    assert derived(kc.verify(compiled(name)))


@pytest.mark.parametrize("name", [pytest.param(x, marks=pytest.mark.slow) for x in NAMES])
def test_that_the_grouped_form_moves_alike(name: str) -> None:
    t = np.linspace(0, model(name).end, 12)
    module = kc.compile(model(name), form="grouped")
    assert derived(kc.verify(module))
    found, expected = kc.solve(module, t), solved(name, t)
    assert found.success
    np.testing.assert_allclose(found.q, expected.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.q_dot, expected.q_dot, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["rssr", "screw_jack"])
def test_c(name: str, quick_compiler: str) -> None:
    t = np.linspace(0, model(name).end, 12)
    found, expected = kc.solve(kc.compile(model(name), target="c"), t), solved(name, t)
    np.testing.assert_allclose(found.q, expected.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.q_ddot, expected.q_ddot, rtol=0, atol=1e-8)


AXES = np.random.default_rng(3).normal(size=(45, 3))


def pose(time: float, count: int) -> tuple[Any, Any]:
    """Return the place and the rotation of a link of the arm: a product of rotations."""
    turn, place = Rotation.identity(), np.zeros(3)
    for k, axis in enumerate(AXES[:count]):
        place = place + (turn.apply([1, 0, 0]) if k else 0)
        turn = turn * Rotation.from_rotvec(np.sin(time + k) * axis / np.linalg.norm(axis))
    return place, turn


def test_that_a_long_arm_is_grouped() -> None:
    """Forty-five links, each turned about a hinge of the one before."""
    m = spatial.Mechanism("arm")
    last, joint = m.ground, (0.0, 0.0, 0.0)
    for k, axis in enumerate(AXES):
        link = m.body(f"link_{k}", *pose(0.0, k + 1))
        m.add(spatial.Revolute(f"hinge_{k}", last, joint, axis, link, (0, 0, 0), axis))
        cross = np.cross(axis, (0.3, 0.7, -0.2))
        turning = (axis, cross, link, axis, cross)
        m.add(spatial.RelativeRotation(f"motor_{k}", last, *turning, sympy.sin(kc.t + k)))
        last, joint = link, (1.0, 0.0, 0.0)
    module = kc.compile(m)
    assert module.FORM == "grouped"
    t = np.linspace(0, 0.5, 6)
    found = kc.solve(module, t)
    assert found.success, found.message
    turns = spatial.orientation(found, "link_44")
    for row, time in enumerate(t):
        place, turn = pose(time, 45)
        end = [found[f"{letter}_link_44"][row] for letter in "xyz"]
        np.testing.assert_allclose(end, place, rtol=0, atol=1e-11)
        assert (turns[row] * turn.inv()).magnitude() < 1e-11

"""p and -p are one orientation, and Euler parameters have a scale of their own."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from tests.unit.spatial.test_motions import X, Y, Z

SIGNS = [(1, 1), (-1, 1), (1, -1), (-1, -1)]


def crossed_cranks(size: float, signs: tuple[int, int] = (1, 1)) -> spatial.Mechanism:
    """Return a crank about z and a rocker about y, joined by a rod of two balls."""
    m = spatial.Mechanism("crossed_cranks")
    crank = m.body("crank", (0, 0, 0), (signs[0], 0, 0, 0))
    rocker = m.body("rocker", (3 * size, 0, 0), (signs[1], 0, 0, 0))
    m.add(spatial.Revolute("O", m.ground, (0, 0, 0), Z, crank, (0, 0, 0), Z))
    m.add(spatial.Revolute("P", m.ground, (3 * size, 0, 0), Y, rocker, (0, 0, 0), Y))
    rod = spatial.Distance("rod", crank, (size, 0, 0), rocker, (0, 0, 2 * size), 3 * size)
    m.add(rod)
    motor = (m.ground, Z, X, crank, Z, X)
    m.add(spatial.RelativeRotation("motor", *motor, 0.3 + 2 * kc.t))
    return m


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e3])
def test_that_assemblies_are_orientations(size: float) -> None:
    """Two ways round for each hinge's axis, and two angles of the rocker; none twice."""
    found = kc.assemblies(kc.compile(crossed_cranks(size)))
    assert len(found) == 8
    turned = [Rotation.from_quat(found[:, [k + 1, k + 2, k + 3, k]]) for k in (3, 10)]
    matrices = np.stack([item.as_matrix() for item in turned], axis=1).reshape(8, -1)
    assert len(np.unique(np.round(matrices, 6) + 0.0, axis=0)) == 8
    assert (found[:, [3, 10]] > -1e-9).all()  # the guess's own sign where it has one


def test_that_the_unit_of_length_changes_no_iteration() -> None:
    t = np.linspace(0, 6, 50)
    counts = [kc.solve(kc.compile(crossed_cranks(size)), t).iterations for size in (1e-3, 1, 1e3)]
    np.testing.assert_array_equal(counts[0], counts[1])
    np.testing.assert_array_equal(counts[2], counts[1])


def test_that_a_guess_of_either_sign_gives_the_same_motion_with_its_sign() -> None:
    t = np.linspace(0, 9, 60)  # the crank makes almost three turns
    first, *others = (kc.solve(kc.compile(crossed_cranks(1.0, signs)), t) for signs in SIGNS)
    for found, signs in zip(others, SIGNS[1:], strict=True):
        for body, sign in zip(("crank", "rocker"), signs, strict=True):
            for k in range(4):
                name = f"e{k}_{body}"
                np.testing.assert_allclose(found[name], sign * first[name], rtol=0, atol=1e-12)
        assert np.abs(np.diff(found["e0_crank"])).max() < 0.2
    np.testing.assert_allclose(first["e0_crank"], np.cos(0.15 + t), rtol=0, atol=1e-13)


def test_that_an_assembly_can_be_chosen() -> None:
    module = kc.compile(crossed_cranks(1.0))
    second = kc.assemblies(module)[1]
    found = kc.solve(module, [0.0, 0.1], assembly=2)
    np.testing.assert_allclose(found.q[0], second, rtol=0, atol=1e-12)

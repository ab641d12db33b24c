"""A constraint type, derived as the textbook derives it."""

from typing import Any

import pytest

from kincompile.calculus.expressions import (
    ONE,
    ZERO,
    ZERO_VECTOR,
    Basis,
    Symbol,
    TimeFunction,
    Vector,
)
from kincompile.calculus.rotations import turned
from kincompile.calculus.symbols import i, j, s_i, s_j
from kincompile.derive.derivation import derive
from kincompile.derive.partials import partials
from kincompile.model.absolute import AbsoluteDistance
from kincompile.model.cams import PointFollower
from kincompile.model.catalogue import CONSTRAINTS
from kincompile.model.joints import Revolute, Translational
from kincompile.model.relative import RelativeAngle

TYPES = list(CONSTRAINTS.values())


def test_that_a_revolute_joint_reads_like_the_book() -> None:
    """Haug 3.3.10 and 3.3.12."""
    (block,) = derive(Revolute.template())
    B_s_i, B_s_j = turned(i.phi, s_i, 1), turned(j.phi, s_j, 1)
    e_x, e_y = Basis(0), Basis(1)
    assert block.Phi == i.point(s_i) - j.point(s_j)
    assert block.Phi_q == (e_x, e_y, B_s_i, -e_x, -e_y, -B_s_j)
    (printed,) = partials(Revolute.template())
    assert [item.entry for item in printed] == [ONE, B_s_i, -ONE, -B_s_j]
    assert block.nu == ZERO_VECTOR
    w_i, w_j = Symbol("phi_i_dot"), Symbol("phi_j_dot")
    centripetal_i = w_i**2 * turned(i.phi, s_i)
    centripetal_j = w_j**2 * turned(j.phi, s_j)
    assert block.gamma == centripetal_i - centripetal_j


def test_that_a_driver_moves_nu_and_gamma() -> None:
    (block,) = derive(RelativeAngle.template())
    assert block.nu == TimeFunction("C", 1)
    assert block.gamma == TimeFunction("C", 2)
    assert block.gamma_terms == (ZERO, ZERO, TimeFunction("C", 2))


def test_that_a_squared_distance_has_the_driver_squared() -> None:
    (block,) = derive(AbsoluteDistance.template())
    value, first, second = (TimeFunction("C", order) for order in range(3))
    assert block.nu == 2 * value * first
    assert block.gamma_terms[2] == 2 * first**2 + 2 * value * second


def test_that_the_gamma_of_a_translational_joint_is_the_general_one() -> None:
    """The book prints 0 for the second row: true on the manifold only, where phi_i' = phi_j'."""
    _, parallel = derive(Translational.template())
    assert parallel.gamma != ZERO


@pytest.mark.parametrize("kind", TYPES, ids=lambda kind: kind.__name__)
def test_that_every_type_has_an_entry_for_each_coordinate(kind: Any) -> None:
    template = kind.template()
    for block, row in zip(derive(template), partials(template), strict=True):
        assert len(block.Phi_q) == sum(item.size for item in template.coordinates)
        assert len(row) == len(template.coordinates)
        is_vector = isinstance(block.Phi, Vector)
        assert isinstance(block.gamma, Vector) is is_vector
        assert isinstance(block.nu, Vector) is is_vector
        assert all(isinstance(column, Vector) is is_vector for column in block.Phi_q)
        for item in row:
            # By a position: k of k I, or the row of a scalar; by an angle: of the type of Phi.
            is_position = isinstance(item.coordinate, Vector)
            assert isinstance(item.entry, Vector) is (is_vector != is_position)


@pytest.mark.parametrize("kind", TYPES, ids=lambda kind: kind.__name__)
def test_that_gamma_is_the_sum_of_its_terms(kind: Any) -> None:
    for block in derive(kind.template()):
        rest: Any = block.gamma
        for term in block.gamma_terms:
            rest = rest - term
        assert rest == (ZERO_VECTOR if isinstance(block.Phi, Vector) else ZERO)


def test_that_a_type_is_derived_once() -> None:
    assert derive(Revolute.template()) is derive(Revolute.template())
    assert PointFollower.template() is PointFollower.template()


def test_that_an_unused_coordinate_has_a_zero_entry() -> None:
    (block,) = derive(RelativeAngle.template())
    assert block.Phi_q == (ZERO, ZERO, -ONE, ZERO, ZERO, ONE)
    (printed,) = partials(RelativeAngle.template())
    assert [item.entry for item in printed] == [ZERO_VECTOR, -ONE, ZERO_VECTOR, ONE]

"""Large blocks in parts: the legs of a platform, and what they carry."""

import math
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import spatial
from kincompile.ir.elimination import Sizes, SolvePlan, plan_entries
from kincompile.ir.interpret import apply

OWN, SHARED = 4, 3
"""Columns of a leg, and of what all carry."""
ROWS = (5, 5)
"""Of the legs; one more has entries in the shared columns alone."""


def entries_of(matrix: Any) -> list[tuple[int, int, None]]:
    """Return the places of a matrix that are not zero; all of them vary."""
    return [(int(row), int(column), None) for row, column in np.argwhere(matrix)]


def legs(seed: int) -> Any:
    """Return a matrix of two legs in a random order."""
    rng = np.random.default_rng(seed)
    n = len(ROWS) * OWN + SHARED
    matrix, row = np.zeros((n, n)), 0
    for leg, count in enumerate(ROWS):
        rows = slice(row, row := row + count)
        matrix[rows, leg * OWN : (leg + 1) * OWN] = rng.normal(size=(count, OWN))
        matrix[rows, len(ROWS) * OWN :] = rng.normal(size=(count, SHARED))
    matrix[row, len(ROWS) * OWN :] = rng.normal(size=SHARED)
    return matrix[rng.permutation(n)][:, rng.permutation(n)]


def planned(matrix: Any, values: Any = None) -> SolvePlan:
    """Return the plan of a matrix, of which such values are known."""

    known = {
        (r, c): float((matrix if values is None else values)[r, c])
        for r, c, _ in entries_of(matrix)
    }
    sizes = Sizes({k: abs(x) for k, x in known.items()}, {}, known)
    plan = plan_entries(len(matrix), len(matrix), entries_of(matrix), sizes=sizes)
    assert plan is not None
    return plan


def run(plan: SolvePlan, matrix: Any, right: Any) -> tuple[Any, Any]:
    """Return x and the product of the determinants, by interpreting the plan."""
    names = {plan.nodes[node][1]: matrix[row, column] for row, column, node in plan.entries}
    names |= {plan.nodes[node][1]: value for node, value in zip(plan.right, right, strict=True)}
    found: list[Any] = []
    for operation, *operands in plan.nodes:
        found.append(apply(operation, operands, found, names, {}))
    return np.array([found[k] for k in plan.solution]), np.prod(
        [found[k] for k in plan.determinants]
    )


@pytest.mark.parametrize("seed", range(8))
def test_that_legs_are_solved_one_at_a_time(seed):
    matrix = legs(seed)
    plan, right = planned(matrix), np.random.default_rng(seed).normal(size=len(matrix))
    assert [len(block.rows) for block in plan.blocks] == [len(matrix)]
    assert plan.largest_call == 0
    x, determinant = run(plan, matrix, right)
    expected = np.linalg.solve(matrix, right)
    assert np.abs(x - expected).max() < 1e-12 * np.linalg.cond(matrix) * np.abs(expected).max()
    assert determinant == pytest.approx(np.linalg.det(matrix), rel=1e-10)


def test_that_rows_change_places_where_a_pivot_vanishes():
    matrix = legs(1)
    plan = planned(matrix)
    for row, column, _ in plan.entries:
        other = matrix.copy()
        other[row, column] = 0.0
        right = np.arange(1.0, len(other) + 1)
        x, _ = run(plan, other, right)
        error = np.abs(other @ x - right).max()
        assert error < 1e-12 * np.linalg.cond(other) * right.max(), (row, column)


def test_that_what_falls_into_no_parts_is_solved_by_a_call():
    matrix = np.random.default_rng(0).normal(size=(8, 8))
    assert planned(matrix).largest_call == 8


def test_that_a_leg_which_is_singular_by_itself_is_no_part():
    matrix, rng = legs(2), np.random.default_rng(3)
    shared = [k for k in range(matrix.shape[1]) if np.count_nonzero(matrix[:, k]) == len(matrix)]
    own = [k for k in range(matrix.shape[1]) if k not in shared]
    rows = np.flatnonzero(matrix[:, own[0]])
    columns = [k for k in own if matrix[rows[0], k]]
    matrix[rows[:, np.newaxis], columns] = rng.normal(size=(len(rows), 1)) * rng.normal(
        size=len(columns)
    )
    assert planned(matrix).largest_call == len(matrix)


def platform(*, has_bodies: bool) -> spatial.Mechanism:
    """Return a platform on six legs: a cylinder and a rod each, or a distance."""
    m = spatial.Mechanism("platform", end=2.0)
    top = m.body("platform", (0, 0, 0.7))
    for k in range(6):
        angle, above = np.pi / 3 * k + 0.3 * (-1) ** k, np.pi / 3 * k - 0.2 * (-1) ** k
        foot = np.array([0.6 * np.cos(angle), 0.6 * np.sin(angle), 0.0])
        ball = np.array([0.35 * np.cos(above), 0.35 * np.sin(above), 0.0])
        along = ball - foot + np.array([0, 0, 0.7])
        length = float(np.linalg.norm(along))
        axis = along / length
        side = np.cross(axis, (0.0, 0.0, 1.0))
        side /= np.linalg.norm(side)
        reach = length + 0.04 * (sympy.sin(3 * kc.t + k) - math.sin(k))
        if not has_bodies:
            m.add(spatial.Distance(f"leg_{k}", m.ground, foot, top, ball, reach))
            continue
        cylinder, rod = m.body(f"cylinder_{k}", foot), m.body(f"rod_{k}", foot + along)
        up, across = tuple(axis), tuple(np.cross(axis, side))
        m.add(spatial.Universal(f"foot_{k}", m.ground, foot, side, cylinder, (0, 0, 0), across))
        axes = up, tuple(side), rod, (0, 0, 0), up, across
        m.add(spatial.Translational(f"slide_{k}", cylinder, (0, 0, 0), *axes))
        m.add(spatial.Spherical(f"ball_{k}", rod, (0, 0, 0), top, ball))
        driven = cylinder, (0, 0, 0), up, rod, (0, 0, 0), reach
        m.add(spatial.RelativeTranslation(f"reach_{k}", *driven))
    return m


@pytest.mark.parametrize("target", ["numpy", pytest.param("c", marks=pytest.mark.slow)])
def test_that_thirteen_bodies_move_a_platform_as_six_distances_do(target):
    t = np.linspace(0, 2, 101)
    bodies = kc.solve(kc.compile(platform(has_bodies=True), target=target), t)
    distances = kc.solve(kc.compile(platform(has_bodies=False)), t)
    assert bodies.success
    assert distances.success
    for kind in ("q", "q_dot", "q_ddot"):
        found, expected = (getattr(x, kind)[:, :7] for x in (bodies, distances))
        assert np.abs(found - expected).max() < 1e-11 * max(1.0, np.abs(expected).max())

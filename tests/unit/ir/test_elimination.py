"""The planned solve: small blocks for mechanisms, and right for any system it accepts."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import kincompile as kc
from kincompile.errors import StructuralError
from kincompile.ir.elimination import plan_solve
from kincompile.ir.graph import number_of
from kincompile.ir.inline import inline
from kincompile.ir.lower import lower
from kincompile.ir.redundancy import redundant_equations


@pytest.mark.parametrize(
    ("name", "sizes"),
    [
        ("four_bar", [2]),
        ("slider_crank", [1]),
        ("simple_pendulum", []),
    ],
)
def test_that_a_mechanism_leaves_small_blocks(
    name: str, sizes: list[int], example_named: Callable[[str], Any]
) -> None:
    plan = plan_solve(inline(lower(example_named(name).model.system())))
    assert plan is not None
    assert [len(block.rows) for block in plan.blocks] == sizes


def linear_system(matrix: Any, constant: Any) -> kc.ConstraintSystem:
    """Return equations whose Phi_q is a matrix: its entries parameters, or numbers where marked."""
    n = len(matrix)
    names = [f"x{k}" for k in range(n)]
    parameters: dict[str, float] = {}
    equations = []
    for row in range(n):
        terms = []
        for column in range(n):
            if constant[row][column] or not matrix[row][column]:
                factor: Any = sympy.Float(matrix[row][column]) if matrix[row][column] else 0
            else:
                factor = sympy.Symbol(f"a{row}_{column}")
                parameters[factor.name] = matrix[row][column]
            terms.append(factor * sympy.Symbol(names[column]))
        equations.append(sympy.Add(*terms) - sympy.Symbol("t"))
    return kc.ConstraintSystem("linear", names, equations, parameters=parameters)


entries = st.one_of(st.just(0.0), st.just(0.0), st.sampled_from([1.0, -1.0, 2.0, 0.7, -1.3, 3.1]))


@st.composite
def systems(draw: Any) -> tuple[Any, Any]:
    n = draw(st.integers(1, 6))
    rows = st.lists(st.lists(entries, min_size=n, max_size=n), min_size=n, max_size=n)
    marks = st.lists(st.lists(st.booleans(), min_size=n, max_size=n), min_size=n, max_size=n)
    matrix = draw(rows)
    for k, place in enumerate(draw(st.permutations(range(n)))):
        matrix[k][place] = matrix[k][place] or 1.9
    return matrix, draw(marks)


@given(systems(), st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_that_the_plan_solves_what_lapack_solves(system: tuple[Any, Any], seed: int) -> None:
    matrix = np.array(system[0])
    if abs(np.linalg.det(matrix)) < 1e-3:
        return
    module = kc.compile(linear_system(*system))
    if not hasattr(module, "solve"):  # dependent for every q: said by the structure of numbers
        return
    n = len(matrix)
    b = np.random.default_rng(seed).normal(size=(4, n))
    nonzeros = module.Phi_q_nonzeros(np.zeros(n), 0.0)
    expected = np.linalg.solve(matrix, b[..., np.newaxis])[..., 0]
    found = module.solve(nonzeros, b)
    if np.isfinite(found).all():  # a pivot that happens to vanish gives no finite number
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)
    else:
        assert has_vanishing_pivot(module, nonzeros)


def has_vanishing_pivot(module: Any, nonzeros: Any) -> bool:
    """Return whether the factorization itself says that a block is singular."""
    varying = [k for k in range(len(nonzeros)) if k not in module._CONSTANTS]  # noqa: SLF001
    _, determinants = module.LANES["factor"](module.ARRAYS, [nonzeros[k] for k in varying])
    return any(not np.isfinite(value) or abs(value) < 1e-12 for value in determinants)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_that_a_full_matrix_is_solved_at_every_size(n: int) -> None:
    """Closed forms up to three rows, LAPACK above."""
    rng = np.random.default_rng(n)
    matrix = rng.uniform(0.5, 2, size=(n, n)) + 2 * np.eye(n)
    module = kc.compile(linear_system(matrix.tolist(), np.zeros((n, n), dtype=bool)))
    b = rng.normal(size=(2, 3, n))
    found = module.solve(module.Phi_q_nonzeros(np.zeros(n), 0.0), b)
    assert found.shape == b.shape
    np.testing.assert_allclose(found @ matrix.T, b, atol=1e-12)


def test_that_only_the_singular_members_of_a_batch_are_lost() -> None:
    matrix = np.eye(4) + 0.5
    module = kc.compile(linear_system(matrix.tolist(), np.zeros((4, 4), dtype=bool)))
    nonzeros = np.stack([matrix.ravel(), np.zeros(16), matrix.ravel()])
    found = module.solve(nonzeros, np.ones((3, 4)))
    np.testing.assert_allclose(found[[0, 2]] @ matrix, 1.0)
    assert not np.isfinite(found[1]).any()


def test_that_rows_of_equal_numbers_have_no_plan() -> None:
    """They match one to one, and yet Phi_q is singular for every q."""
    x, y = sympy.symbols("x y")
    system = kc.ConstraintSystem("twice", "x y", [x + y - 1, x + y - kc.t])
    assert plan_solve(inline(lower(system))) is None
    assert not hasattr(kc.compile(system), "solve")


def test_that_a_system_with_too_few_equations_has_no_plan() -> None:
    x, y = sympy.symbols("x y")
    system = kc.ConstraintSystem("few", "x y", [x + y**2])
    assert plan_solve(inline(lower(system))) is None
    with pytest.raises(StructuralError):
        kc.solve(kc.compile(system), 0)


def test_that_rows_without_a_term_are_not_compared_for_the_pivot(
    example_named: Callable[[str], Any],
) -> None:
    """In a block whose rows change places a zero is never the largest."""
    system = example_named("bennett").model.system()
    code = inline(lower(system))
    left_out, *_ = redundant_equations(system, code.program, code.pattern())
    plan = plan_solve(replace(code, program=replace(code.program, redundant=left_out)))
    assert plan is not None
    assert plan.has_choices
    compared = [x[2:] for x in plan.nodes if x[0] == "compare"]
    assert compared
    assert all(number_of(plan.nodes, node) is None for pair in compared for node in pair)

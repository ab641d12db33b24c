"""Free equations of equal structure share one kernel, and keep their numbers."""

from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.ir import equation_shapes
from kincompile.ir.differentiate import derivative_code
from kincompile.ir.graph import Graph
from kincompile.ir.grouping import group
from kincompile.ir.lower import lower

COUNT = 12
a, b = sympy.symbols("a b")
x = sympy.symbols(f"x1:{COUNT + 1}")
t = kc.t

ALIKE = {
    "linear": lambda k, now, before: now - (1.5 + k) * before - t / (3 + k),
    "circle": lambda k, now, before: now**2 + k * before**2 - (2 + k) ** 2 - a,
    "trigonometric": lambda k, now, before: now - sympy.sin(k * before + t) * sympy.exp(-b * k * t),
    "quotient": lambda k, now, before: now / (before + 2 * k) - sympy.sqrt(a + k) * t,
    "nested": lambda k, now, before: (
        sympy.log(3 + k + (now - k * before) ** 2) - sympy.atan2(t, now)
    ),
}


def system(equations: Any) -> kc.ConstraintSystem:
    return kc.ConstraintSystem(
        "alike", [str(item) for item in x], equations, parameters={"a": 0.3, "b": 0.7}
    )


def alike(write: Any) -> kc.ConstraintSystem:
    """Return equations of one structure: names that sort in different orders, other numbers."""
    first = x[0] - t
    return system([first, *(write(k, x[k - 1], x[k - 2]) for k in range(2, COUNT + 1))])


@pytest.mark.parametrize("write", ALIKE.values(), ids=ALIKE)
def test_that_equations_of_one_structure_are_one_group(write: Any) -> None:
    program = group(lower(alike(write), share_equations=True))
    assert len(program.groups) == 2
    assert sorted(item.size for item in program.groups) == [1, COUNT - 1]


@pytest.mark.parametrize("write", ALIKE.values(), ids=ALIKE)
def test_that_the_numbers_are_those_of_equations_written_out(write: Any) -> None:
    model = alike(write)
    ours, theirs = kc.compile(model, form="grouped"), kc.compile(model, form="inline")
    rng = np.random.default_rng(6)
    q, q_dot, times = *rng.uniform(0.5, 2, (2, 3, COUNT)), np.array([0.2, 0.5, 0.9])
    np.testing.assert_array_equal(ours.PATTERN, theirs.PATTERN)
    for found, known in zip(
        ours.kinematics(q, q_dot, times), theirs.kinematics(q, q_dot, times), strict=True
    ):
        np.testing.assert_allclose(found, known, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (x[1] - x[0] * 2, x[1] - x[0]),
        (x[1] ** 2 - x[0], x[1] ** 3 - x[0]),
        (x[1] - sympy.sin(x[0]), x[1] - sympy.cos(x[0])),
        (x[1] - a * x[0], x[1] - x[2] * x[0]),
        (x[1] * x[0] + x[1] * x[2], x[1] * x[0] + x[2] * x[3]),
    ],
    ids=["coefficient of one", "exponent", "function", "parameter", "same symbol twice"],
)
def test_that_other_structures_are_other_groups(one: Any, other: Any) -> None:
    equations = [one, other, *(item - t for item in x[2:])]
    program = group(lower(system(equations), share_equations=True))
    assert [item.size for item in program.groups][:2] == [1, 1]


def test_that_conditions_are_shared_too() -> None:
    bends = [
        sympy.Piecewise((now**2, now < before), (2 * now * before - before**2, True)) - t
        for now, before in zip(x[1:], x, strict=False)
    ]
    model = system([x[0] - t, *bends])
    # SymPy writes "x10 < x9" but "x1 > x2".
    assert len(group(lower(model, share_equations=True)).groups) == 3
    ours, theirs = kc.compile(model, form="grouped"), kc.compile(model, form="inline")
    q = np.random.default_rng(8).uniform(0.5, 2, COUNT)
    np.testing.assert_allclose(ours.Phi(q, 0.3), theirs.Phi(q, 0.3), rtol=1e-13)


def test_that_the_text_does_not_grow_with_equal_equations() -> None:
    def text(count: int) -> str:
        names = sympy.symbols(f"y1:{count + 1}")
        steps = (names[k] - 1.1 * k * names[k - 1] for k in range(1, count))
        model = kc.ConstraintSystem("long", [str(item) for item in names], [names[0] - t, *steps])
        return str(kc.emit(model, form="grouped").source)

    assert len(text(400)) < 1.02 * len(text(40))


def test_that_sharing_changes_nothing_where_equations_are_written_out() -> None:
    model = alike(ALIKE["linear"])
    apart = lower(model)
    assert len({id(item.kernel) for item in apart.instances}) == COUNT
    assert len({id(item.kernel) for item in lower(model, share_equations=True).instances}) == 2


def test_that_drivers_of_one_structure_are_differentiated_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    m = kc.Mechanism("wheels")
    for k in range(20):
        wheel = m.body(f"wheel{k}")
        m.add(kc.Revolute(f"axle{k}", m.ground, (k, 0), wheel, (0, 0)))
        m.add(kc.AbsoluteAngle(f"motor{k}", wheel, (1 + k) * t + sympy.sin(t * (2 + k)) / (3 + k)))
    built = []

    def counted(graph: Graph, node: int, variable: str, order: int) -> Any:
        built.append(order)
        return derivative_code(graph, node, variable, order)

    monkeypatch.setattr(equation_shapes, "derivative_code", counted)
    lower(m.system(), share_equations=True)
    assert len(built) <= 2 * 3  # C, C', C''; the first wheel's t has no factor

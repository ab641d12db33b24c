"""Random mechanisms: the emitted module computes what the interpreter does, however they share.

The interpreter runs kernels and instances as they are; the emitted text has been folded, shared
between joints, scheduled and named.
"""

from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import kincompile as kc
from kincompile import spatial
from kincompile.ir.inline import inline
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower
from kincompile.model.arguments import Kind
from kincompile.model.catalogue import CONSTRAINTS
from kincompile.model.loads import LOADS
from kincompile.runtime.engine.blocks import BlockSolver
from kincompile.runtime.engine.code import code_of
from kincompile.space.catalogue import CONSTRAINTS as CONSTRAINTS_IN_SPACE
from kincompile.space.loads import LOADS as LOADS_IN_SPACE
from kincompile.structure.counting import unmatched

L, h = sympy.symbols("L h")
numbers = st.sampled_from([0, 1, -1, 0.3, -0.7, L, -L / 2, h])
profiles = [1 + 0.1 * sympy.cos(kc.alpha), 2, L + h * sympy.sin(3 * kc.alpha) / 9]
RATE, PLACE = sympy.symbols("x_one_dot y_two")
pulls = st.sampled_from([3, -L, h * sympy.sin(L * kc.t), RATE * L - 2, PLACE**2 * h])
AXES = [(1, 0, 0), (0, 0.6, -0.9), (L, h, 0), (h, 1, L)]
CROSSES = [(0.2, 1, 3), (-1, L, 2)]
ARGUMENTS: dict[Kind, Any] = {
    Kind.SCALAR: numbers,
    Kind.RADIUS: st.sampled_from([0.5, 1, L, -0.3]),
    Kind.VALUE: st.sampled_from([0, 0.4, L, kc.t, h * sympy.sin(L * kc.t), kc.t**2 + L]),
    Kind.DISTANCE: st.sampled_from([1, 0.7, L, 2 + sympy.sin(kc.t)]),
    Kind.PROFILE: st.sampled_from(profiles),
    Kind.LOAD: pulls,
}
IN_PLANE = ARGUMENTS | {
    Kind.POINT: st.tuples(numbers, numbers),
    Kind.AXIS: st.sampled_from([(1, 0), (0, 1), (0.6, -0.9), (L, h)]),
    Kind.LOADS: st.tuples(pulls, pulls),
}
IN_SPACE = ARGUMENTS | {
    Kind.POINT: st.tuples(numbers, numbers, numbers),
    Kind.AXIS: st.sampled_from(AXES),
    Kind.LOADS: st.tuples(pulls, pulls, pulls),
}
POSITIVE = st.sampled_from([0.4, 1, L])
SPATIAL = {name: kind for name, kind in CONSTRAINTS_IN_SPACE.items() if not kind.is_own}
NAMES = ["one", "two", "f"]  # the last is a name of the emitted code's own


def argument(draw: Any, item: Any, values: dict[Kind, Any]) -> Any:
    """Draw what is given for one argument; a cross is never along an axis."""
    if item.symbol in ("f_i", "f_j"):
        return draw(st.sampled_from(CROSSES))
    if item.symbol in ("v_0", "l_0", "k"):
        return draw(POSITIVE)
    return draw(values[item.kind])


@st.composite
def mechanisms(draw: Any, *, in_space: bool = False, first: Any = None, load: Any = None) -> Any:
    """Draw a mechanism in the plane or in space; some types of it may be given.

    With a type of load it has that, others, and masses.
    """
    world: Any = spatial if in_space else kc
    values = IN_SPACE if in_space else IN_PLANE
    types = list((SPATIAL if in_space else CONSTRAINTS).values())
    m = world.Mechanism("random")
    m.parameter("L", 0.8)
    m.parameter("h", 0.25)
    inertia: Any = (0.3, 0.4, 0.5) if in_space else 0.3
    for name in NAMES:
        masses = {}
        if load is not None:
            masses = {
                "mass": draw(POSITIVE),
                "inertia": inertia,
                "centre": draw(values[Kind.POINT]),
            }
        m.body(name, **masses)
    for number in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(types))
        enter(draw, m, first if first and not number else kind, f"k{number}", values)
    if load is not None:
        m.gravity = (0, -9.81, 0.3) if in_space else (0.3, -9.81)
        pulling = list((LOADS_IN_SPACE if in_space else LOADS).values())
        for number in range(draw(st.integers(1, 3))):
            enter(draw, m, draw(st.sampled_from(pulling)) if number else load, f"w{number}", values)
    return m


def enter(draw: Any, m: Any, kind: Any, name: str, values: dict[Kind, Any]) -> None:
    """Add a constraint or a load of a type."""
    bodies = iter(draw(st.permutations([*NAMES, "ground"])))
    if sum(item.kind is Kind.BODY for item in kind.arguments().values()) == 1:
        bodies = iter([draw(st.sampled_from(NAMES))])
    given = {
        key: next(bodies) if item.kind is Kind.BODY else argument(draw, item, values)
        for key, item in kind.arguments().items()
        if key != "angle" or item.symbol != "theta"  # of a torsion spring, which makes its own
    }
    m.add(kind(name=name, **given))


def is_usable(m: kc.Mechanism) -> bool:
    """Hold what is free; return whether the model is accepted and nothing is held twice."""
    try:
        system = m.system()
    except kc.ModelError:  # radii that add to zero
        return False
    equations, coordinates = unmatched(system, inline(lower(system)).pattern())
    for name in coordinates:
        m.add(kc.Equation(f"hold_{name}", sympy.Symbol(name)))
    return not equations


def check(module: Any, program: Any) -> None:
    n = module.N_COORDINATES
    rng = np.random.default_rng(12)
    q, q_dot = rng.normal(size=(2, 3, n))
    p = np.array([0.9, 0.35])
    batch = module.kinematics(q, q_dot, 0.3, p)
    expected = interpret(program, q, q_dot, 0.3, p)
    for found, known in zip(batch, expected, strict=True):
        np.testing.assert_allclose(found, known, rtol=1e-11, atol=1e-12)
    for k in range(3):
        for found, known in zip(module.kinematics(q[k], q_dot[k], 0.3, p), expected, strict=True):
            np.testing.assert_allclose(found, known[k], rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("form", ["inline", "grouped"])
@given(mechanisms())
@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
def test_that_the_emitted_module_is_the_interpreter(form: str, m: kc.Mechanism) -> None:
    if is_usable(m):
        check(kc.compile(m, form=form), lower(m.system()))


@pytest.mark.parametrize("form", ["inline", "grouped"])
@given(mechanisms())
@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
def test_that_the_planned_solve_solves(form: str, m: kc.Mechanism) -> None:
    if not is_usable(m):
        return
    module = kc.compile(m, form=form)
    # Joints that repeat each other have no solve in either form.
    assert hasattr(module, "solve") == hasattr(kc.compile(m), "solve")
    if not hasattr(module, "solve"):
        return
    n = module.N_COORDINATES
    rng = np.random.default_rng(13)
    q, b = rng.normal(size=(2, n))
    Phi_q = module.Phi_q(q, 0.3)
    if np.linalg.cond(Phi_q) < 1e6:
        x = module.solve(module.Phi_q_nonzeros(q, 0.3), b)
        np.testing.assert_allclose(Phi_q @ x, b, rtol=1e-8, atol=1e-8)
        if form == "grouped":
            solver = BlockSolver(code_of(module))
            x = solver.solve(solver.factor(module.Phi_q_nonzeros(q, 0.3)), b)
            np.testing.assert_allclose(Phi_q @ x, b, rtol=1e-8, atol=1e-8)


@given(mechanisms(), st.randoms(use_true_random=False))
@settings(max_examples=15, suppress_health_check=[HealthCheck.too_slow])
def test_that_the_order_of_the_joints_only_permutes_rows(m: kc.Mechanism, random: Any) -> None:
    if not is_usable(m):
        return
    first = kc.compile(m)
    contacts = [name for name in first.COORDINATES if name.startswith("alpha")]
    random.shuffle(m.constraints)
    second = kc.compile(m)
    q = np.random.default_rng(14).normal(size=first.N_COORDINATES)
    rows = [first.EQUATIONS.index(name) for name in second.EQUATIONS]
    columns = [first.COORDINATES.index(name) for name in second.COORDINATES]
    assert set(second.COORDINATES[len(columns) - len(contacts) :]) == set(contacts)
    found = second.acceleration(q[columns], q[columns], 0.3)
    Phi_q, gamma = first.acceleration(q, q, 0.3)
    np.testing.assert_allclose(found[0], Phi_q[np.ix_(rows, columns)], rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(found[1], gamma[rows], rtol=1e-11, atol=1e-12)

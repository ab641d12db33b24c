"""What must not matter: where the ground is, the order of the joints, and the names."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import kincompile as kc
from kincompile.model.arguments import Kind
from kincompile.model.bodies import Body

MECHANISMS = (
    "simple_pendulum", "slider_crank", "double_pendulum", "four_bar", "inverted_slider_crank",
    "wrecker_boom", "gear_train", "rack_and_pinion", "cam_flat_follower", "slot_follower",
)  # fmt: skip


def rebuilt(
    model: kc.Mechanism,
    *,
    body: Callable[[Body], Body] = lambda body: body,
    parameter: Callable[[str], str] = lambda name: name,
    constraint: Callable[[Any], Any] = lambda item: item,
) -> kc.Mechanism:
    """Return a copy of a mechanism with its bodies, parameter names and constraints replaced."""
    copy = kc.Mechanism(model.name)
    copy.parameters = [
        dataclasses.replace(item, name=parameter(item.name)) for item in model.parameters
    ]
    copy.bodies = [body(item) for item in model.bodies]
    copy.constraints = [constraint(item) for item in model.constraints]
    return copy


def grid(example):
    """Return forty times over the first half of an example's motion."""
    return np.linspace(0, example.model.end / 2, 40)


# --- rigid motion of the ground -----------------------------------------------------------------


class Displacement:
    """A rigid motion of the whole world: turned by an angle, then shifted."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.angle = float(rng.uniform(0.3, 2.8))
        self.shift = rng.uniform(-2, 2, 2)
        c, s = np.cos(self.angle), np.sin(self.angle)
        self.A = np.array([[c, -s], [s, c]])

    def axis(self, v):
        """Return a direction of the ground."""
        return sympy.Matrix(self.A) * sympy.Matrix(v)

    def point(self, s):
        """Return a point of the ground."""
        return tuple(self.axis(s) + sympy.Matrix(self.shift))

    def body(self, body: Body) -> Body:
        """Return a body with its guess displaced."""
        x, y, phi = body.guess
        return dataclasses.replace(body, guess=(*self.point((x, y)), phi + self.angle))

    def constraint(self, item: Any) -> Any:
        """Return a constraint with what belongs to the ground displaced."""
        if isinstance(item, kc.AbsoluteAngle):
            return dataclasses.replace(item, angle=item.angle + self.angle)
        if isinstance(item, kc.AbsoluteY):
            origin, along = self.point((0, 0)), tuple(self.axis((1, 0)))
            ground = kc.Mechanism("any").ground
            return kc.RevoluteTranslational(
                item.name, ground, origin, along, item.body, item.point, item.value
            )
        changes: dict[str, Any] = {}
        on_ground = False
        for name, argument in item.arguments().items():
            given = getattr(item, name)
            if argument.kind is Kind.BODY:
                on_ground = given.is_ground
            elif on_ground and argument.kind is Kind.POINT:
                changes[name] = self.point(given)
            elif on_ground and argument.kind is Kind.AXIS:
                changes[name] = tuple(self.axis(given))
            elif on_ground and name.startswith("theta"):
                changes[name] = given + self.angle
        return dataclasses.replace(item, **changes)

    def coordinates(self, values, bodies: int, *, order: int):
        """Return q, q_dot or q_ddot of the displaced mechanism; contact angles stay."""
        values = values.copy()
        for first in range(0, 3 * bodies, 3):
            r = values[:, first : first + 2] @ self.A.T
            values[:, first : first + 2] = r if order else r + self.shift
            if order == 0:
                values[:, first + 2] += self.angle
        return values


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", MECHANISMS)
def test_that_a_rigid_motion_of_the_ground_changes_nothing_relative(example_named, name, seed):
    example, move = example_named(name), Displacement(seed)
    moved = rebuilt(example.model, body=move.body, constraint=move.constraint)
    t, bodies = grid(example), len(example.model.bodies)
    here = kc.solve(example.module, t, throw=True)
    there = kc.solve(kc.compile(moved), t, throw=True)
    for order, quantity in enumerate(("q", "q_dot", "q_ddot")):
        expected = move.coordinates(getattr(here, quantity), bodies, order=order)
        tolerance = 1e-11 * max(1.0, np.abs(expected).max())
        np.testing.assert_allclose(getattr(there, quantity), expected, rtol=0, atol=tolerance)


# --- order of the joints ------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", MECHANISMS)
def test_that_reordering_the_joints_permutes_the_rows(example_named, name, seed):
    example, rng = example_named(name), np.random.default_rng(seed)
    shuffled = rebuilt(example.model)
    count = len(shuffled.constraints)
    order = [*rng.permutation(range(1, count)), 0]  # the first one last, so that rows do change
    shuffled.constraints = [shuffled.constraints[k] for k in order]
    module, other = example.module, kc.compile(shuffled)
    assert other.COORDINATES == module.COORDINATES
    assert other.EQUATIONS != module.EQUATIONS
    rows = [other.EQUATIONS.index(equation) for equation in module.EQUATIONS]
    q, q_dot = rng.uniform(-1, 1, (2, 7, module.N_COORDINATES))
    t = rng.uniform(0, 1, 7)
    for mine, theirs in zip(
        module.kinematics(q, q_dot, t), other.kinematics(q, q_dot, t), strict=True
    ):
        np.testing.assert_allclose(theirs[:, rows], mine, rtol=1e-13, atol=1e-13)


# --- names --------------------------------------------------------------------------------------

# Names that mean something in Python, in NumPy, in SymPy, in the emitted module or elsewhere in
# the mechanism; none may change a number. "t", "pi" and "alpha" are refused by the model.
NAMES = (
    "lambda", "class", "None", "print", "f", "q", "p", "q_dot", "np", "math", "sin", "cos",
    "cos_sin", "E", "I", "S", "N", "Q", "beta", "Phi", "Phi_q", "nu", "gamma", "DEFAULTS", "GUESS",
    "c_crank", "s_rod", "k_1", "b_1", "J", "F", "b", "Z9", "a", "crank", "rod", "self",
    "float", "result",
)  # fmt: skip


def renamed(model: kc.Mechanism, names: list[str]) -> kc.Mechanism:
    """Return a mechanism in which bodies, parameters and constraints have the given names."""
    supply = iter(names)
    bodies = {item.name: next(supply) for item in model.bodies}
    parameters = {item.name: next(supply) for item in model.parameters}
    constraints = {item.name: next(supply) for item in model.constraints}
    symbols = {sympy.Symbol(old): sympy.Symbol(new) for old, new in parameters.items()}

    def new(value: Any) -> Any:
        if isinstance(value, Body):
            guess = tuple(new(item) for item in value.guess)
            return dataclasses.replace(value, name=bodies.get(value.name, value.name), guess=guess)
        if isinstance(value, tuple):
            return tuple(new(item) for item in value)
        return value.xreplace(symbols) if isinstance(value, sympy.Expr) else value

    def constraint(item: Any) -> Any:
        fields = {name: new(getattr(item, name)) for name in item.arguments()}
        return dataclasses.replace(item, name=constraints[item.name], **fields)

    return rebuilt(model, body=new, parameter=lambda name: parameters[name], constraint=constraint)


@pytest.mark.parametrize("name", ["four_bar", "wrecker_boom", "cam_flat_follower"])
@settings(max_examples=12)
@given(names=st.permutations(NAMES), seed=st.integers(0, 10**6))
def test_that_renaming_changes_no_number(example_named, name, names, seed):
    example, rng = example_named(name), np.random.default_rng(seed)
    module, other = example.module, kc.compile(renamed(example.model, names))
    q, q_dot = rng.uniform(-1, 1, (2, 5, module.N_COORDINATES))
    t = rng.uniform(0, 1, 5)
    for mine, theirs in zip(
        module.kinematics(q, q_dot, t), other.kinematics(q, q_dot, t), strict=True
    ):
        np.testing.assert_allclose(theirs, mine, rtol=1e-13, atol=1e-13)
    ours, them = (kc.solve(m, grid(example)[:8], throw=True) for m in (module, other))
    np.testing.assert_allclose(them.q, ours.q, rtol=0, atol=1e-11)
    np.testing.assert_allclose(them.q_ddot, ours.q_ddot, rtol=0, atol=1e-9)

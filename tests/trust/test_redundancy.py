"""Redundant equations: found, told apart, taken away as asked for, and solved with nevertheless."""

import math
import warnings

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.runtime.engine.code import attach


def pendulum(*extra):
    """Return a driven rod with what else is added to it."""
    m = kc.Mechanism("pendulum")
    rod = m.body("rod", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), rod, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, kc.t))
    for constraint in extra:
        m.add(constraint)
    return m


def block(*constraints):
    """Return a block that is driven along the x axis, and what else holds it."""
    m = kc.Mechanism("block")
    m.body("block", guess=(0.5, 0, 0))
    for constraint in constraints:
        m.add(constraint)
    m.add(kc.AbsoluteX("push", "block", (0, 0), 0.5 + kc.t / 4))
    return m


GUIDE = kc.Translational("guide", "ground", (0, 0), (1, 0), "block", (0, 0), (1, 0))
RAIL = kc.Translational("rail", "ground", (0, 2), (1, 0), "block", (0, 2), (1, 0))
FLOOR = kc.AbsoluteY("floor", "block", (0, 0), 0)
LEVEL = kc.AbsoluteAngle("level", "block", 0)
PIN = kc.Revolute("again", "ground", (0, 0), "rod", (-1, 0))


def pinned_on_both_ends():
    """Return a rod between two bearings: a structure."""
    m = kc.Mechanism("beam")
    rod = m.body("rod", guess=(1, 0, 0))
    m.add(kc.Revolute("A", m.ground, (0, 0), rod, (-1, 0)))
    m.add(kc.Revolute("B", m.ground, (2, 0), rod, (1, 0)))
    return m


def rack():
    """Return a guided rack on a pinion whose bearing is where the rack's pitch line wants it."""
    m = kc.Mechanism("rack")
    bar, wheel = m.body("bar", guess=(0, -1, 0)), m.body("wheel")
    m.add(kc.Translational("guide", m.ground, (0, -1), (1, 0), bar, (0, 0), (1, 0)))
    m.add(kc.Revolute("bearing", m.ground, (0, 0), wheel, (0, 0)))
    mesh = (bar, (-0.2, 0), (0, 0), 0, wheel, (0, 0), 1, 3 * kc.pi / 2)
    m.add(kc.RackAndPinion("mesh", *mesh))
    m.add(kc.AbsoluteAngle("motor", wheel, kc.t / 5))
    return m


# Mechanism, and for each constraint: its equations that repeat others, and what to take instead.
CONSISTENT = {
    "two guides": (lambda: block(GUIDE, RAIL), {"rail": (("rail.normal", "rail.parallel"), "")}),
    "angle held twice": (lambda: block(GUIDE, LEVEL), {"level": (("level",), "")}),
    "guide after angle": (
        lambda: block(LEVEL, GUIDE),
        {"guide": (("guide.parallel",), "RevoluteTranslational")},
    ),
    "guide after floor": (
        lambda: block(FLOOR, GUIDE),
        {"guide": (("guide.normal",), "RelativeAngle")},
    ),
    "joint twice": (lambda: pendulum(PIN), {"again": (("again.x", "again.y"), "")}),
    "driver twice": (
        lambda: pendulum(kc.AbsoluteAngle("again", "rod", kc.t)),
        {"again": (("again",), "")},
    ),
    "beam": (pinned_on_both_ends, {"B": (("B.x",), "RelativeY")}),
}


@pytest.fixture
def mechanisms(build):
    """Return all consistent cases, with those that other tests use too."""
    return CONSISTENT | {
        "double parallelogram": (
            build["double_parallelogram"],
            {"head2": (("head2.y",), "RelativeX")},
        ),
        "Scott-Russell": (build["scott_russell_pair"], {"wall": (("wall",), "")}),
    }


def applied(model, surplus):
    """Do what is asked for: take a constraint away, and put the simpler one in its place."""
    system = model.system()
    kept = [system.Phi[system.equations.index(name)] for name in surplus.others]
    at = [item.name for item in model.constraints].index(surplus.constraint)
    old = model.constraints.pop(at)
    name = old.name
    if surplus.instead in ("RelativeX", "RelativeY"):
        simpler = getattr(kc, surplus.instead)
        model.add(simpler(name, old.i, old.point_i, old.j, old.point_j, 0))
    elif surplus.instead == "RevoluteTranslational":
        place = (old.i, old.point_i, old.axis_i, old.j, old.point_j, 0)
        model.add(kc.RevoluteTranslational(name, *place))
    elif surplus.instead == "RelativeAngle":
        model.add(kc.RelativeAngle(name, old.i, old.j, 0))
    elif surplus.others:
        model.add(kc.Equation(name, *kept))


@pytest.mark.parametrize("name", [*CONSISTENT, "double parallelogram", "Scott-Russell"])
def test_that_what_repeats_is_named_and_goes_when_one_does_as_told(mechanisms, name):
    make, expected = mechanisms[name]
    model = make()
    found = kc.inspect(model)
    assert {item.constraint: (item.equations, item.instead) for item in found.surpluses} == expected
    assert found.conflicting == ()
    assert found.redundant == tuple(row for rows, _ in expected.values() for row in rows)
    text = found.to_text()
    for item in found.surpluses:
        assert item.remedy in text
        assert f"redundant: {', '.join(item.equations)} repeat" in text
        applied(model, item)
    after = kc.inspect(model)
    assert (after.redundant, after.conflicting) == ((), ())
    assert (after.rank, after.degrees_of_freedom) == (found.rank, found.degrees_of_freedom)
    assert len(after.equations) == after.rank


@pytest.mark.parametrize(
    "replacement",
    [
        kc.RevoluteTranslational("head2", "coupler", (2, 0), (1, 0), "crank2", (0.5, 0), 0),
        kc.Distance("head2", "crank2", (0.5, 0), "coupler", (2, -0.4), 0.4),
    ],
    ids=lambda item: type(item).__name__,
)
def test_the_other_ways_of_replacing_a_revolute_of_a_parallel_bar(build, replacement):
    model = build["double_parallelogram"]()
    at = [item.name for item in model.constraints].index("head2")
    model.constraints[at] = replacement
    found = kc.inspect(model)
    assert (found.rank, found.redundant, found.problem) == (12, (), "")
    assert len(found.equations) == 12


CONFLICTING = {
    "joint elsewhere": (
        lambda: pendulum(kc.Revolute("again", "ground", (0, 1), "rod", (-1, 0))),
        {"again.y"},
        "correct the lengths, points or values of again, or ",
    ),
    "other motion": (
        lambda: pendulum(kc.AbsoluteAngle("again", "rod", 2 * kc.t)),
        {"again"},
        "remove the driver again",
    ),
    "motion with a lead": (
        lambda: pendulum(kc.AbsoluteAngle("again", "rod", kc.t + 0.1)),
        {"again"},
        "remove the driver again",
    ),
    "brake": (
        lambda: pendulum(kc.AbsoluteAngle("brake", "rod", 0)),
        {"motor"},
        "remove the driver motor",
    ),
    "rail askew": (
        lambda: block(
            GUIDE, kc.Translational("rail", "ground", (0, 2), (1, 0), "block", (0, 1), (1, 0))
        ),
        {"rail.normal"},
        "correct the lengths, points or values of rail, or ",
    ),
}


@pytest.mark.parametrize(("make", "wrong", "remedy"), CONFLICTING.values(), ids=CONFLICTING)
def test_that_what_contradicts_is_an_error_that_names_it(make, wrong, remedy):
    model = make()
    found = kc.inspect(model)
    assert set(found.conflicting) == wrong
    text = found.to_text()
    assert f"conflicting: {', '.join(found.conflicting)} contradicts" in text
    assert remedy in text
    with pytest.raises(kc.StructuralError, match=f"{found.conflicting[0]} contradicts "):
        kc.solve(kc.compile(model), 0)
    for name in {item.constraint for item in found.surpluses}:
        model.constraints[:] = [item for item in model.constraints if item.name != name]
    assert kc.inspect(model).surpluses == ()


def test_that_part_of_another_joint_is_to_be_replaced_by_an_equation():
    """The bearing already holds the pinion at the rack's pitch line."""
    model = rack()
    (item,) = kc.inspect(model).surpluses
    assert (item.constraint, item.instead, len(item.others)) == ("mesh", "", 1)
    assert f"a constraint that demands {item.others[0]} alone, such as an Equation" in item.remedy
    applied(model, item)
    after = kc.inspect(model)
    assert (after.surpluses, after.degrees_of_freedom, after.problem) == ((), 0, "")


def double_parallelogram_at(phi):
    """Return the closed form: three cranks at an angle, the coupler carried along."""
    c, s = math.cos(phi), math.sin(phi)
    cranks = [value for k in range(3) for value in (2 * k + c / 2, s / 2, phi)]
    return np.array([*cranks, 2 + c, s, 0])


def scott_russell_at(phi):
    """Return the closed form: the crank at an angle, the rod at its opposite."""
    c, s = math.cos(phi), math.sin(phi)
    return np.array([c / 2, s / 2, phi, c, s, -phi])


def test_the_ranks_against_numpy_at_closed_forms(build):
    """Phi_q by complex steps of Phi, at positions that are written down."""
    for make, at, rank, size in (
        (build["double_parallelogram"], double_parallelogram_at, 12, 13),
        (build["scott_russell_pair"], scott_russell_at, 6, 7),
    ):
        model = make()
        system = model.system()
        Phi = sympy.lambdify([*system.q, kc.t], list(system.Phi), "numpy")
        for phi in (0.4, 0.9, 1.3):
            q = at(phi)
            steps = q + 1e-30j * np.eye(q.size)
            Phi_q = np.array([np.imag(Phi(*step, 0.0)) for step in steps]).T / 1e-30
            assert Phi_q.shape[0] == size
            assert np.linalg.matrix_rank(Phi_q, tol=1e-10) == rank
            # Without the redundant equation the rank is the same; without another it is less.
            spare = [
                row
                for row in range(size)
                if np.linalg.matrix_rank(np.delete(Phi_q, row, 0), tol=1e-10) == rank
            ]
            found = kc.inspect(model)
            assert found.rank == rank
            assert set(found.redundant) <= {found.equations[row] for row in spare}


def check_motion(solution, at, phi, speed):
    """Compare a motion with a closed form in an angle that grows at constant speed."""
    assert solution.success
    assert (solution.residual < 1e-12).all()
    exact = np.array([at(value) for value in phi])
    np.testing.assert_allclose(solution.q, exact, atol=1e-12)
    h = 1e-3
    around = {k: np.array([at(value + k * h) for value in phi]) for k in (-2, -1, 0, 1, 2)}
    rates = (around[-2] - 8 * around[-1] + 8 * around[1] - around[2]) / (12 * h)
    second = -around[-2] + 16 * around[-1] - 30 * around[0] + 16 * around[1] - around[2]
    np.testing.assert_allclose(solution.q_dot, speed * rates, atol=1e-11)
    np.testing.assert_allclose(solution.q_ddot, speed**2 * second / (12 * h**2), atol=1e-8)


def test_that_redundant_mechanisms_move_as_they_should(build, compiled):
    t = np.linspace(0, 1, 21)
    module = compiled(build["double_parallelogram"]())
    check_motion(kc.solve(module, t), double_parallelogram_at, t + 0.8, 1.0)
    module = compiled(build["scott_russell_pair"]())
    check_motion(kc.solve(module, t), scott_russell_at, 0.3 + t / 2, 0.5)


@pytest.mark.parametrize("extra", [PIN, kc.AbsoluteAngle("again", "rod", kc.t)])
def test_that_what_is_written_twice_does_no_harm(compiled, extra):
    t = np.linspace(0, 2, 9)
    solution = kc.solve(compiled(pendulum(extra)), t)
    assert solution.success
    np.testing.assert_allclose(
        solution.q_ddot, np.array([-np.cos(t), -np.sin(t), 0 * t]).T, atol=1e-12
    )


@pytest.mark.parametrize("method", ["grid", "march"])
def test_that_a_grid_solves_the_independent_equations_and_checks_the_others(build, method):
    t = np.linspace(0, 1, 401)
    with pytest.warns(kc.RedundantConstraintWarning):
        module = kc.compile(build["double_parallelogram"]())
    solution = kc.solve(module, t, method=method)
    check_motion(solution, double_parallelogram_at, t + 0.8, 1.0)
    assert (solution.statistics["coarse"] > 0) == (method == "grid")


@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
def test_that_equations_that_agree_in_position_alone_end_the_motion():
    """A second driver has the value of the first at every time of the grid, and another rate."""
    module = kc.compile(pendulum(kc.AbsoluteAngle("again", "rod", kc.t)))
    names = list(module.EQUATIONS)
    original = vars(module)["nu"]

    def wrong(q, t, p=module.DEFAULTS):
        nu = np.array(original(q, t, p))
        nu[..., names.index("again")] += 0.01
        return nu

    vars(module)["nu"] = wrong
    attach(module)
    solution = kc.solve(module, np.linspace(0, 1, 101))
    assert not solution.success


@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
def test_that_compiled_functions_of_a_redundant_mechanism_are_solved_too(build, quick_compiler):
    t = np.linspace(0, 1, 21)
    module = kc.compile(build["double_parallelogram"](), target="c")
    assert module.REDUNDANT == ("head2.y",)
    check_motion(kc.solve(module, t), double_parallelogram_at, t + 0.8, 1.0)


def test_the_warning_names_what_repeats_and_what_to_do(build):
    with pytest.warns(kc.RedundantConstraintWarning, match=r"head2\.y repeats .* RelativeX"):
        module = kc.compile(build["double_parallelogram"]())
    assert module.N_EQUATIONS == module.N_COORDINATES + 1


def test_that_a_mechanism_without_redundancy_gives_no_warning(build):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        kc.compile(build["four_bar"]())

"""From what is written to a checked system: order, names, units, guesses, and its matrices."""

import pickle
from typing import Any

import numpy as np
import pytest
import sympy
from sympy.physics.mechanics import dynamicsymbols

import kincompile as kc
from kincompile.model.bodies import Parameter

x, y, L = sympy.symbols("x y L")


def mechanism() -> kc.Mechanism:
    m = kc.Mechanism("m", length_unit="mm", end=2.0, points=21)
    length = m.parameter("L", 0.5, unit="mm")
    first, second = m.body("first", guess=(length, 2 * length, kc.pi / 2)), m.body("second")
    rho = 1 + 0.1 * sympy.cos(kc.alpha)
    m.add(kc.CamFlatFollower("flat", first, (0, 0), rho, second, (0, 0), (1, 0), guess=0.7))
    m.add(kc.CamFollower("pair", first, (0, 0), rho, second, (0, 0), rho, guess=(0.1, 0.2)))
    m.add(kc.Revolute("A", m.ground, (0, 0), first, (length, 0)))
    m.add(kc.Equation("two", first.x - second.x, first.y - kc.t))
    return m


def test_that_coordinates_are_in_order_with_units_and_guesses() -> None:
    coordinates = mechanism().system().coordinates
    assert [item.name for item in coordinates] == [
        "x_first", "y_first", "phi_first", "x_second", "y_second", "phi_second", "alpha_flat",
        "alpha_i_pair", "alpha_j_pair",
    ]  # fmt: skip
    assert [item.unit for item in coordinates] == ["mm", "mm", "rad"] * 2 + ["rad"] * 3
    guesses = [item.guess for item in coordinates]
    assert guesses == pytest.approx([0.5, 1.0, np.pi / 2, 0, 0, 0, 0.7, 0.1, 0.2])


def test_that_equations_are_in_order_of_the_constraints() -> None:
    system = mechanism().system()
    assert system.equations == (
        "flat.contact", "flat.tangent", "pair.x", "pair.y", "pair.tangent", "A.x", "A.y", "two.1",
        "two.2",
    )  # fmt: skip
    assert system.row_offsets == (0, 2, 5, 7)


def test_that_drivers_are_told_from_joints() -> None:
    m = kc.Mechanism("m")
    omega, body = m.parameter("omega", 2.0), m.body("b")
    m.add(kc.AbsoluteAngle("held", body, 2))
    m.add(kc.AbsoluteAngle("set", body, 2 * omega))
    m.add(kc.AbsoluteY("rail", body, (0, 0), omega))
    m.add(kc.AbsoluteX("moved", body, (0, 0), omega * kc.t))
    m.add(kc.Equation("free", body.y - kc.t))
    drivers = [item.name for item in m.system().constraints if item.is_driver]
    assert drivers == ["set", "moved", "free"]


def test_that_the_grid_and_the_units_go_along() -> None:
    system = mechanism().system()
    assert (system.name, system.length_unit, system.end, system.points) == ("m", "mm", 2.0, 21)
    assert system.system() is system


def test_that_sizes_can_be_seen() -> None:
    assert repr(mechanism()) == "<Mechanism 'm': 2 bodies, 4 constraints>"
    assert repr(mechanism().system()) == "<ConstraintSystem 'm': 9 coordinates, 9 equations>"


@pytest.mark.parametrize("written", ["x y", "x, y", "x,y", ["x", "y"], (x, y), [x, "y"]])
def test_that_coordinates_may_be_written_in_many_ways(written: object) -> None:
    system = kc.ConstraintSystem("s", written, [x - y, y - kc.t])
    assert [item.name for item in system.coordinates] == ["x", "y"]


def test_that_dynamicsymbols_are_coordinates() -> None:
    a, b = dynamicsymbols("a b")
    system = kc.ConstraintSystem("s", [a, b], [sympy.sin(a) - b, a - kc.t], guess={a: 0.1})
    assert [item.name for item in system.coordinates] == ["a", "b"]
    assert system.coordinates[0].guess == 0.1
    assert system.Phi_q == sympy.Matrix([[sympy.cos(sympy.Symbol("a")), -1], [1, 0]])


def test_that_assumptions_on_symbols_do_not_matter() -> None:
    length = sympy.Symbol("L", positive=True)
    angle = sympy.Symbol("x", real=True)
    system = kc.ConstraintSystem("s", [angle], [length * sympy.cos(angle)], parameters={length: 2})
    assert system.Phi == sympy.Matrix([L * sympy.cos(x)])


def test_that_time_is_the_symbol_of_sympy_mechanics() -> None:
    assert dynamicsymbols("a").args == (kc.t,)


@pytest.mark.parametrize(
    ("guess", "expected"),
    [
        (None, (0, 0)),
        ((1, 2), (1, 2)),
        (np.array([1, 2]), (1, 2)),
        ({"y": 3}, (0, 3)),
        ({y: L}, (0, 0.5)),
        ((kc.pi, sympy.Rational(1, 4)), (np.pi, 0.25)),
    ],
)
def test_that_a_guess_may_be_a_list_or_by_name(guess: object, expected: object) -> None:
    system = kc.ConstraintSystem("s", "x y", [x - L, y], parameters={"L": 0.5}, guess=guess)
    assert [item.guess for item in system.coordinates] == pytest.approx(expected)


def test_that_parameters_may_have_units() -> None:
    system = kc.ConstraintSystem("s", "x", [x - L], parameters=[Parameter("L", 2, "mm")])
    assert system.parameters == (Parameter("L", 2.0, "mm"),)


def test_that_an_equation_may_be_an_eq() -> None:
    system = kc.ConstraintSystem("s", "x y", [sympy.Eq(x, 2 * y), kc.Equation("e", y)])
    assert system.Phi == sympy.Matrix([x - 2 * y, y])
    assert system.equations == ("equation_1", "e")


def test_that_bodies_give_their_symbols() -> None:
    m = kc.Mechanism("m")
    body = m.body("rod")
    assert [str(item) for item in (body.x, body.y, body.phi)] == ["x_rod", "y_rod", "phi_rod"]
    assert [str(item) for item in (body.x_dot, body.y_dot, body.phi_dot)] == [
        "x_rod_dot", "y_rod_dot", "phi_rod_dot",
    ]  # fmt: skip
    assert m.ground.x == m.ground.phi == m.ground.y_dot == 0


def test_that_a_body_may_be_named_by_text() -> None:
    m = kc.Mechanism("m")
    m.body("rod")
    m.add(kc.Revolute("A", "ground", (0, 0), "rod", (1, 0)))
    by_body = kc.Mechanism("m")
    by_body.add(kc.Revolute("A", by_body.ground, (0, 0), by_body.body("rod"), (1, 0)))
    assert m.Phi == by_body.Phi


def test_that_every_argument_may_be_given_by_name() -> None:
    m = kc.Mechanism("m")
    i, j = m.body("i"), m.body("j")
    by_place = kc.Translational("S", i, (1, 2), (3, 4), j, (5, 6), (7, 8))
    by_name = kc.Translational(
        name="S", i=i, point_i=(1, 2), axis_i=(3, 4), j=j, point_j=(5, 6), axis_j=(7, 8)
    )
    assert by_place == by_name
    assert m.add(by_name) is by_name


def test_that_the_matrices_are_those_of_the_textbook() -> None:
    """Haug 3.3.10, written out for a pendulum."""
    m = kc.Mechanism("pendulum")
    length = m.parameter("L", 1.0)
    rod = m.body("rod")
    m.add(kc.Revolute("A", rod, (-length, 0), m.ground, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, kc.t**2))
    c, s, w = sympy.cos(rod.phi), sympy.sin(rod.phi), rod.phi_dot
    assert m.q == sympy.Matrix([rod.x, rod.y, rod.phi])
    assert m.q_dot == sympy.Matrix([rod.x_dot, rod.y_dot, w])
    assert sympy.expand(
        m.Phi - sympy.Matrix([rod.x - L * c, rod.y - L * s, rod.phi - kc.t**2])
    ) == (sympy.zeros(3, 1))
    assert m.Phi_q == sympy.Matrix([[1, 0, L * s], [0, 1, -L * c], [0, 0, 1]])
    assert m.nu == sympy.Matrix([0, 0, 2 * kc.t])
    assert m.gamma == sympy.Matrix([-L * w**2 * c, -L * w**2 * s, 2])


def test_that_the_matrices_are_immutable() -> None:
    for matrix in (mechanism().Phi, mechanism().Phi_q, mechanism().q):
        assert isinstance(matrix, sympy.ImmutableDenseMatrix)


def test_that_the_contact_of_a_cam_has_a_symbol() -> None:
    m = mechanism()
    assert [str(item.alpha) for item in m.constraints[:2]] == ["alpha_flat", "alpha_i_pair"]


@pytest.mark.parametrize("rho", [lambda a: 1 + a, 1 + sympy.Symbol("theta"), 1 + kc.alpha])
def test_that_a_profile_may_be_a_function_or_have_any_argument(rho: object) -> None:
    m = kc.Mechanism("m")
    pin = m.body("pin")
    m.add(kc.PointFollower("slot", pin, (0, 0), m.ground, (0, 0), rho))
    a = sympy.Symbol("alpha_slot")
    assert sympy.expand(m.Phi[0] - (pin.x - (1 + a) * sympy.cos(a))) == 0


def test_that_a_profile_may_be_a_number_or_have_parameters() -> None:
    m = kc.Mechanism("m")
    r = m.parameter("r", 0.2)
    a = sympy.Symbol("alpha_slot")
    for rho, expected in ((2, 2), (r * sympy.cos(kc.alpha), r * sympy.cos(a)), (r + 1, r + 1)):
        other = kc.Mechanism("m")
        other.parameter("r", 0.2)
        pin = other.body("pin")
        other.add(kc.PointFollower("slot", pin, (0, 0), other.ground, (0, 0), rho))
        assert sympy.expand(other.Phi[0] - (pin.x - expected * sympy.cos(a))) == 0


def test_that_an_axis_need_not_have_length_one() -> None:
    def row(axis: tuple[int, int]) -> Any:
        m = kc.Mechanism("m")
        i, j = m.body("i"), m.body("j")
        m.add(kc.TranslationalDistance("S", i, (0, 0), axis, j, (0, 0), 1))
        return m.Phi[0]

    assert sympy.simplify(row((3, 4)) - row((6, 8))) == 0


@pytest.mark.parametrize("name", ["four_bar", "rssr"])
def test_that_a_pickled_mechanism_is_the_same_model(name, example_named):
    """So that a process of an executor can compile it."""
    model = example_named(name).model
    copy = pickle.loads(pickle.dumps(model))
    assert copy.to_toml() == model.to_toml()
    assert kc.compile(copy).FINGERPRINT == kc.compile(model).FINGERPRINT

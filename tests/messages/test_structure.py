"""Too few equations, too many, or not the right ones: counts, names and a way out."""

import pytest
import sympy

import kincompile as kc

x, y, z = sympy.symbols("x y z")


def crank_and_rod(*left_out: str) -> kc.Mechanism:
    """Return a slider-crank with a motor, without some of its joints."""
    m = kc.Mechanism("slider")
    crank, rod = m.body("crank"), m.body("rod")
    joints = [
        kc.Revolute("A", m.ground, (0, 0), crank, (0, 0)),
        kc.Revolute("B", crank, (1, 0), rod, (0, 0)),
        kc.AbsoluteY("C", rod, (2, 0), 0),
        kc.AbsoluteAngle("motor", crank, kc.t),
    ]
    for joint in joints:
        if joint.name not in left_out:
            m.add(joint)
    return m


def solve(model: kc.Mechanism | kc.ConstraintSystem) -> kc.Solution:
    """Compile a model, which works for all of them, and solve it, which must say what is wrong."""
    module = kc.compile(model)
    assert module.Phi_q(module.GUESS, 0.0).shape == (module.N_EQUATIONS, module.N_COORDINATES)
    for function in (kc.newton, kc.assemblies):
        with pytest.raises(kc.StructuralError, match=r"has . equations for . coord") as caught:
            function(module, 0.0, None)
        assert str(caught.value) == module.UNSOLVABLE
    return kc.solve(module, 0.0)


def test_that_a_missing_driver_is_asked_for() -> None:
    message = (
        r"'slider' has 5 equations for 6 coordinates \(drivers: none; equations of each "
        r"constraint: A 2, B 2, C 1\): 1 more equation is needed before it can be analysed. "
        r"Nothing determines, for instance, \w+; add a joint or a driver there \(a driver is a "
        r"constraint whose value is a function of kc.t\)"
    )
    with pytest.raises(kc.StructuralError, match=message):
        solve(crank_and_rod("motor"))


def test_that_several_missing_equations_are_counted() -> None:
    with pytest.raises(kc.StructuralError, match=r"has 2 equations for 6 coord.* 4 more equations"):
        solve(crank_and_rod("A", "C", "motor"))


def test_that_a_body_that_nothing_holds_is_named() -> None:
    m = crank_and_rod()
    m.body("idler")
    with pytest.raises(kc.StructuralError, match=r"instance, x_idler, y_idler, phi_idler; add"):
        solve(m)


def test_that_too_many_equations_are_counted_and_named() -> None:
    m = crank_and_rod()
    m.add(kc.AbsoluteAngle("second_motor", "rod", 2 * kc.t))
    message = (
        r"'slider' has 7 equations for 6 coordinates \(drivers: motor, second_motor; .*\): 1 "
        r"equation is too many. Candidates to remove: [\w.]+; remove a driver or a redundant "
        "joint, or replace a Revolute by a constraint with fewer equations"
    )
    with pytest.raises(kc.StructuralError, match=message):
        solve(m)


def test_that_equations_that_hold_the_same_coordinate_twice_are_named() -> None:
    m = kc.Mechanism("twice")
    crank = m.body("crank")
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    m.add(kc.AbsoluteAngle("brake", crank, 0))
    m.add(kc.AbsoluteX("slide", crank, (0, 0), 0))
    message = (
        r"'twice' has 3 equations for 3 coordinates .*, but they cannot determine them: the "
        r"equations (motor|brake) only repeat what others fix, and nothing determines y_crank; "
        "move a driver or a joint from the first to the second"
    )
    with pytest.raises(kc.StructuralError, match=message):
        solve(m)


@pytest.mark.parametrize(
    ("equations", "message"),
    [
        ([x - 1], r"'s' has 1 equations for 3 coordinates .* 2 more equations are needed"),
        ([x, y, z, x + y], "4 equations for 3 coordinates .* 1 equation is too many"),
        ([x, x**2, y - z], "only repeat what others fix, and nothing determines [yz]"),
        ([x + 0 * y, x * 2, z], "nothing determines y"),
    ],
)
def test_that_free_equations_are_counted_too(equations: list[sympy.Expr], message: str) -> None:
    with pytest.raises(kc.StructuralError, match=message):
        solve(kc.ConstraintSystem("s", "x y z", equations))


def test_that_a_structural_error_is_a_value_error_and_no_model_error() -> None:
    with pytest.raises(ValueError, match="more equation") as caught:
        solve(crank_and_rod("motor"))
    assert not isinstance(caught.value, kc.ModelError)


def test_that_the_matrices_of_an_incomplete_mechanism_can_be_seen() -> None:
    """What is missing is easier to see in Phi_q."""
    assert crank_and_rod("motor").Phi_q.shape == (5, 6)


def test_that_a_complete_mechanism_compiles() -> None:
    assert kc.compile(crank_and_rod()).N_EQUATIONS == 6

"""A mechanism whose inputs are parameters: names, freedoms, and what no output sees."""

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.model.inputs import with_inputs
from kincompile.transmissions.loop import loop_of
from tests import transmission_models as models


def test_that_the_value_of_a_driver_becomes_a_parameter():
    loop = loop_of(models.crank_rocker(), ["motor"], ["rocker.phi"])
    assert loop.inputs == ("motor",)
    assert loop.parameters == ("u_motor",)
    assert loop.outputs == ("phi_rocker",)
    assert loop.held == ()
    parameter = loop.system.parameters[-1]
    assert (parameter.name, parameter.default, parameter.unit) == ("u_motor", 1.5, "rad")
    solution = kc.solve(kc.compile(loop.system), 0, p={"u_motor": 0.3})
    assert solution["phi_crank"] == pytest.approx(0.3)
    assert solution["phi_rocker"] == pytest.approx(1.48084826378253)  # the golden table's T1a


def test_that_a_motion_law_is_not_needed_and_does_not_matter():
    model = models.crank_rocker(motor=1.5 + sympy.sin(2 * kc.t))
    system, _ = with_inputs(model, ["motor"])
    assert system.parameters[-1].default == 1.5
    assert not any("t" in str(item.text).split() for item in system.constraints)


def test_that_a_coordinate_is_an_input_by_one_more_equation():
    model = models.crank_rocker(motor=None)
    system, names = with_inputs(model, ["crank.phi"])
    assert names == ("phi_crank",)
    assert system.equations[-1] == "input_phi_crank"
    solution = kc.solve(kc.compile(system), 0, p={"u_phi_crank": 0.3})
    assert solution["phi_rocker"] == pytest.approx(1.48084826378253)


def test_that_a_rod_is_an_input_by_its_length_and_a_point_is_two_outputs():
    loop = loop_of(models.ankle(), ["left", "right"], ["pitch", "roll"])
    assert [item.unit for item in loop.system.parameters] == ["m", "m"]
    five_bar = loop_of(models.five_bar(), ["motor_1", "motor_2"], ["end"])
    assert five_bar.outputs == ("x_end", "y_end")


def test_that_what_no_output_sees_is_held_and_named():
    loop = loop_of(models.ankle_with_rods(), ["left", "right"], ["pitch", "roll"])
    assert len(loop.held) == 2
    assert all(name.startswith("spin of ") for name in loop.held)
    lean, full = (
        kc.solve(kc.compile(item.system), 0, p={"u_left": left, "u_right": right})
        for item, left, right in (
            (loop_of(models.ankle(), ["left", "right"], ["pitch"]), 0.21, 0.22),
            (loop, -0.21, -0.22),
        )
    )
    assert full["pitch"] == pytest.approx(lean["pitch"], abs=1e-9)
    assert full["roll"] == pytest.approx(lean["roll"], abs=1e-9)


def test_that_a_roller_is_held_in_the_plane():
    model = models.crank_rocker()
    roller = model.body("roller", (0.13, 0.08, 0.7))
    model.add(kc.Revolute("pin", "rocker", (0.08, 0), roller, (0, 0)))
    loop = loop_of(model, ["motor"], ["rocker.phi"])
    assert loop.held == ("phi_roller",)
    assert kc.solve(kc.compile(loop.system), 0)["phi_roller"] == pytest.approx(0.7, abs=1e-3)


WRONG = [
    (["moter"], ["rocker.phi"], "no driver and no coordinate 'moter'; did you mean 'motor'?"),
    (["B"], ["rocker.phi"], "'B' of four_bar is a constraint without a value of its own: name"),
    ([], ["rocker.phi"], "is given no inputs: name drivers or coordinates"),
    (["motor", "motor"], ["rocker.phi"], "is there 2 times: name it once"),
    (["motor"], ["rockr.phi"], "no coordinate, output or point 'rockr.phi'"),
    (["motor"], [], "is given no outputs"),
    (["motor"], ["rocker.phi", "phi_rocker"], "is there 2 times: name it once"),
    (["motor", "rocker.phi"], ["coupler.x"], "1 degree of freedom for the inputs motor, phi_rocke"),
    (["a"], ["rocker.phi"], "no driver and no coordinate 'a'. There are motor, x_crank,"),
    (["crank"], ["rocker.phi"], "did you mean 'y_crank'? There are motor, x_crank,"),
    (["motor"], ["rocker"], "did you mean 'y_rocker'?"),
    (["crank.phi"], ["rocker.phi"], "A driver with a number as its value counts as a joint"),
    (["motor"], ["late"], "output 'late' of four_bar depends on t"),
]


@pytest.mark.parametrize(("inputs", "outputs", "message"), WRONG)
def test_that_wrong_names_and_counts_are_told_with_what_to_do(inputs, outputs, message):
    model = models.crank_rocker()
    model.output("late", sympy.Symbol("phi_rocker") + kc.t, "rad")
    with pytest.raises(kc.InputError) as error:
        loop_of(model, inputs, outputs)
    assert message in str(error.value)


def test_that_a_driver_that_moves_by_itself_is_named():
    model = models.five_bar(second=0.9 + kc.t)
    with pytest.raises(kc.InputError, match="'motor_2' of five_bar depends on t and is no input"):
        loop_of(model, ["motor_1"], ["end"])
    free = kc.ConstraintSystem("free", "x y", [sympy.Symbol("x") - kc.t, sympy.Symbol("y")])
    with pytest.raises(kc.InputError, match="leave it out, and name the coordinate that it drives"):
        loop_of(free, ["x"], ["y"])


def test_that_an_output_that_still_moves_is_named_with_the_missing_driver():
    model = models.five_bar(second=None)
    with pytest.raises(kc.InputError) as error:
        loop_of(model, ["motor_1"], ["end", "arm_1.phi"])
    text = str(error.value)
    assert "motor_1 of five_bar do not determine x_end, y_end: 1 degree of freedom left" in text
    assert "a driver is missing: add, for instance," in text


def test_that_an_output_whose_name_an_input_needs_is_refused():
    model = models.crank_rocker()
    model.parameter("u_motor", 1.0)
    with pytest.raises(kc.InputError, match="has the name 'u_motor', which the input 'motor'"):
        with_inputs(model, ["motor"])


def test_that_a_driver_needs_a_value_at_the_start():
    model = models.crank_rocker(motor=1 / kc.t)
    with pytest.raises(kc.InputError, match="'motor' of four_bar has no value at t = 0"):
        with_inputs(model, ["motor"])


def test_that_the_hinge_of_a_driven_angle_counts_from_the_input():
    m = kc.spatial.Mechanism("shaft")
    shaft = m.body("shaft", (0, 0, 0))
    axes = (0, 0, 1), (1, 0, 0)
    m.add(kc.spatial.Revolute("hinge", m.ground, (0, 0, 0), (0, 0, 1), shaft, (0, 0, 0), (0, 0, 1)))
    m.add(kc.spatial.RelativeRotation("motor", m.ground, *axes, shaft, *axes, kc.t))
    m.add(kc.spatial.JointAngle("turn", m.ground, *axes, shaft, *axes))
    loop = loop_of(m, ["motor"], ["theta_turn"])
    found = kc.solve(kc.compile(loop.system), 0, p={"u_motor": np.array([0.0, 0.5, 7.0])})
    np.testing.assert_allclose(found["theta_turn"][:, 0], [0.0, 0.5, 7.0], atol=1e-12)

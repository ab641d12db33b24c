"""What a unit for co-simulation says of calls: steps, states, instances, errors.

FMPy makes the calls, with the signatures of FMI 3.0.
"""

import math

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

import kincompile as kc
from tests.fmi_units import COUNT, Instance, Units, instance_of, slider_crank

pytestmark = pytest.mark.usefixtures("quick_compiler")


@pytest.fixture(scope="module")
def units(tmp_path_factory):
    return Units(tmp_path_factory.mktemp("units"))


def test_a_step_may_be_any_and_the_branch_stays(units):
    """A whole turn in one step: Newton from the last position alone could end anywhere."""
    with instance_of(units["slider"]) as unit:
        unit.begin()
        unit.step(0.0, 0.25)
        near = unit.get("rod.phi", "crank.phi", "slider.x")
        unit.step(0.25, 3.0)
        far = unit.get("rod.phi", "crank.phi", "slider.x")
    np.testing.assert_allclose(far, [near[0], near[1] + 6 * math.pi, near[2]], rtol=0, atol=1e-12)


def test_a_start_may_be_any(units):
    with instance_of(units["slider"]) as unit:
        unit.begin(0.2).step(0.2, 0.1)
        found = unit.get("t", "slider.x")
    solution = kc.solve(kc.compile(slider_crank()), [0.3])
    np.testing.assert_allclose(found, [0.3, solution["slider.x"][0]], rtol=0, atol=1e-14)


def test_a_lock_up_is_an_error_with_name_and_time(units):
    (event,) = kc.solve(kc.compile(slider_crank(0.09)), np.linspace(0, 1, COUNT)).events
    assert event.kind == "lock-up"
    with instance_of(units["locked"]) as unit:
        unit.begin().step(0.0, 0.1)
        with pytest.raises(FMICallException) as caught:
            unit.step(0.1, 0.9)
        assert caught.value.status == 3
        last = unit.get("t", "crank.phi")  # the last position of the motion
    (said,) = unit.said
    time = said.split("t = ")[1].split(" s:")[0]
    assert last == [pytest.approx(event.t, abs=1e-6), pytest.approx(2 * math.pi * last[0])]
    assert said.startswith("slider_crank locks up near t = ")
    assert abs(float(time) - event.t) < 1e-6
    assert said.endswith("shorten the range of the drivers, or change lengths.")


def test_a_step_of_too_many_turns_is_no_jump(units):
    with instance_of(units["slider"]) as unit:
        unit.begin()
        with pytest.raises(FMICallException):
            unit.step(0.0, 1e5)
        (said,) = unit.said
        assert said.startswith("slider_crank cannot go from t = 0 s to 100000 s in one step: it is")
        assert said.endswith(". Take shorter steps.")
        t, phi = unit.get("t", "crank.phi")
        assert t > 100
        assert phi == pytest.approx(2 * math.pi * t)  # it stands where it was followed to


def test_two_instances_do_not_disturb_each_other(units):
    with instance_of(units["slider"]) as one, instance_of(units["slider"]) as other:
        other.put(r=0.05)
        one.begin()
        other.begin()
        one.step(0.0, 0.125)
        other.step(0.0, 0.25)
        found = [*one.get("crank.phi", "stroke"), *other.get("crank.phi", "stroke")]
    expected = []
    for r, phi in ((0.1, math.pi / 4), (0.05, math.pi / 2)):
        rod = math.sqrt(0.09 - (r * math.sin(phi)) ** 2)
        expected += [phi, 2 * (r * math.cos(phi) + rod)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


def test_states_are_kept_written_and_restored(units):
    with instance_of(units["five_bar"]) as unit, instance_of(units["five_bar"]) as other:
        unit.begin()
        unit.put(motor_1=2.2)
        unit.step(0.0, 0.1)
        kept = unit.fmu.getFMUState()
        written_out = unit.fmu.serializeFMUState(kept)
        before = unit.get("t", "motor_1", "end.x", "end.y")
        unit.put(motor_1=2.0, motor_2=1.0)
        unit.step(0.1, 0.1)
        after = unit.get("t", "motor_1", "end.x", "end.y")
        with pytest.raises(FMICallException):
            unit.put(motor_1=math.nan)
        unit.fmu.setFMUState(kept)
        assert unit.get("t", "motor_1", "end.x", "end.y") == before
        other.fmu.setFMUState(other.fmu.deserializeFMUState(written_out))
        for each in (unit, other):
            each.put(motor_1=2.0, motor_2=1.0)
            each.step(0.1, 0.1)
            assert each.get("t", "motor_1", "end.x", "end.y") == after
        with pytest.raises(FMICallException):
            unit.fmu.deserializeFMUState(b"x" + written_out[1:])
        assert unit.said[-1] == "five_bar: these bytes are no state of this unit."
        unit.fmu.freeFMUState(kept)


def test_parameters_may_change_until_the_initialization_ends(units):
    with instance_of(units["slider"]) as unit:
        unit.fmu.enterInitializationMode()
        assert unit.get("slider.x") == [pytest.approx(0.4, abs=1e-14)]
        unit.put(r=0.05)
        assert unit.get("slider.x") == [pytest.approx(0.35, abs=1e-14)]
        unit.put(L=0.2)
        unit.fmu.exitInitializationMode()
        assert unit.get("slider.x") == [pytest.approx(0.25, abs=1e-14)]


def test_a_reset_leads_to_the_first_start(units):
    with instance_of(units["slider"]) as unit:
        first = unit.begin().get("slider.x", "r")
        unit.fmu.reset()
        unit.put(r=0.05)
        assert unit.begin().get("slider.x", "r") == [pytest.approx(0.35, abs=1e-14), 0.05]
        unit.fmu.terminate()
        assert unit.get("r") == [0.05]  # values may be read after the end
        unit.fmu.reset()
        assert unit.begin().get("slider.x", "r") == first


WRONG = {
    "before": (lambda x: x.step(0, 0.1), "fmi3DoStep may not be called before fmi3EnterInit"),
    "twice": (lambda x: x.begin().begin(), "fmi3EnterInitializationMode may not be called once st"),
    "backward": (lambda x: x.begin().step(0, -0.1), "a step of -0.1 s from t = 0 s cannot be"),
    "none": (lambda x: x.begin().step(0, 0), "a step of 0 s from t = 0 s cannot be taken; give"),
    "not finite": (lambda x: x.begin().step(0, math.nan), "a step of nan s from t = 0 s cannot"),
    "elsewhere": (lambda x: x.begin().step(1, 0.1), "stands at t = 0 s, and the step begins at 1"),
    "nan": (lambda x: x.put(r=math.nan), "the value of r is not a finite number"),
    "late": (lambda x: x.begin().put(r=0.2), "r is a parameter; set it before fmi3ExitInit"),
    "output": (lambda x: x.put(stroke=1), "reference 32 is not that of a parameter or an input"),
    "time": (lambda x: x.put(t=1), "the value reference 0 is not that of a parameter or an input"),
    "early": (lambda x: x.get("stroke"), "outputs have values after fmi3EnterInitializationMode"),
    "reference": (lambda x: x.fmu.getFloat64([999]), "no variable with the value reference 999"),
    "type": (lambda x: x.fmu.getInt32([1]), "has no variables of the type Int32, but of Float64"),
    "event": (lambda x: x.fmu.enterEventMode(), "slider_crank has no fmi3EnterEventMode"),
    "slope": (
        lambda x: x.fmu.getDirectionalDerivative([6], [1], [1.0]), "no fmi3GetDirectionalDerivative"
    ),
    "assembly": (lambda x: (x.put(L=0.0), x.begin()), "slider_crank cannot be assembled at t = 0"),
    "start": (lambda x: x.begin(math.inf), "slider_crank cannot begin at t = inf s"),
    "category": (
        lambda x: x.fmu.setDebugLogging(True, ["logAll"]), "no such category of messages; there is"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_call_is_an_error_with_a_sentence(units, name):
    call, sentence = WRONG[name]
    with instance_of(units["slider"]) as unit:
        with pytest.raises(FMICallException) as caught:
            call(unit)
        assert caught.value.status == 3
        (said,) = unit.said
        assert said.startswith("slider_crank")
        assert sentence in said
        assert said.endswith(".")
        with pytest.raises(FMICallException):
            unit.begin()
        unit.fmu.reset()
        unit.begin().step(0.0, 0.1)  # a reset leads on


def test_a_step_beyond_the_stop_time_is_an_error(units):
    with instance_of(units["slider"]) as unit:
        unit.fmu.enterInitializationMode(startTime=0.0, stopTime=0.15)
        unit.fmu.exitInitializationMode()
        unit.step(0.0, 0.1)
        unit.step(0.1, 0.05)
        with pytest.raises(FMICallException):
            unit.step(0.15, 0.05)
        (said,) = unit.said
    assert said == "slider_crank: the step ends at t = 0.2 s, after the stop time 0.15 s."


def test_the_unit_of_another_file_is_not_instantiated(units):
    said: list[str] = []
    with pytest.raises(Exception, match="instantiate"):
        Instance(units["slider"], said, token="another")
    assert said == [
        "slider_crank cannot be instantiated: the instantiationToken is that of another "
        "modelDescription.xml."
    ]


def test_inputs_beyond_a_singular_position_are_an_error(units):
    with instance_of(units["five_bar"]) as unit:
        unit.begin()
        unit.put(motor_1=2.8, motor_2=0.8)
        with pytest.raises(FMICallException):
            unit.step(0.0, 0.1)
        (said,) = unit.said
    assert said.startswith(
        "five_bar cannot follow its inputs to motor_1 = 2.8, motor_2 = 0.8 at t = 0.1 s: a "
        "singular position lies on the way. It was followed to motor_1 = "
    )
    assert said.endswith("; keep them on that side.")


def test_lengths_that_do_not_close_a_transmission_are_an_error(units):
    with instance_of(units["crank"]) as unit:
        unit.put(d=1.0)
        with pytest.raises(FMICallException):
            unit.begin()
        assert unit.said[0].startswith("four_bar cannot be assembled at t = 0 s with these para")

"""A mechanism as a function of its inputs: what is solved for, and what is refused."""

from typing import Any

import pytest
import sympy

import kincompile as kc
from kincompile.compiler import _lowered
from kincompile.ir.inline import InlineProgram
from kincompile.ir.transmission import transmission_code
from kincompile.model.points import rate
from kincompile.transmissions.loop import loop_of
from tests import transmission_models as models


def code_of(model, inputs, outputs):
    """Return the code of a mechanism as a function, near its guess."""
    loop = loop_of(model, inputs, outputs)
    code = _lowered(loop.system, "inline")
    assert isinstance(code, InlineProgram)
    near = [item.guess for item in code.program.coordinates]
    names = dict(zip(loop.parameters, loop.inputs, strict=True))
    return transmission_code(code, names, loop.outputs, near)


@pytest.mark.parametrize(
    ("build", "inputs", "outputs", "left"),
    [
        (models.crank_rocker, ["motor"], ["phi_rocker"], ["phi_coupler", "phi_rocker"]),
        (models.five_bar, ["motor_1", "motor_2"], ["end"], ["phi_rod_1", "phi_rod_2"]),
        (models.ankle, ["left", "right"], ["pitch"], [f"e{k}_foot" for k in range(4)]),
    ],
)
def test_what_single_equations_give_is_not_solved_for(build, inputs, outputs, left):
    found = code_of(build(), inputs, outputs)
    names = [found.code.program.coordinates[k].name for k in found.free]
    assert names == left
    assert found.count("change") == len(left)
    assert found.count("J") == len(inputs) * len(found.outputs)


def test_a_chain_without_a_loop_has_nothing_to_solve():
    m = kc.Mechanism("arm")
    bar = m.body("bar", (0.3, 0, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), bar, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, 0.3))
    m.point("tip", bar, (0.2, 0))
    found = code_of(m, ["motor"], ["tip"])
    assert found.free == ()
    module: dict[str, Any] = {}
    source = kc.emit(m, transmission=(["motor"], ["tip"])).source
    exec(compile(source, "arm", "exec"), module)
    state, status = module["start"]()
    x, slopes, status = module["transmission"](state, [0.5])
    assert status == 0
    assert x == pytest.approx([0.2 * sympy.cos(0.5), 0.2 * sympy.sin(0.5)], abs=1e-15)
    assert [row[0] for row in slopes] == pytest.approx([-x[1], x[0]], abs=1e-15)


def test_a_velocity_has_the_slopes_of_its_place_and_no_value():
    m = models.five_bar()
    m.output("drift", rate(m.system().body_points[0].x), "m/s")
    module: dict[str, Any] = {}
    wanted = ["motor_1", "motor_2"], ["x_end", "drift"]
    exec(compile(kc.emit(m, transmission=wanted).source, "five_bar", "exec"), module)
    state, _ = module["start"]()
    x, slopes, status = module["transmission"](state, [2.2, 1.0])
    assert status == 0
    assert x[1] != x[1]
    assert slopes[1] == pytest.approx(slopes[0], rel=1e-13)
    f = kc.transmission(m, *wanted)
    assert f.J([2.2, 1.0])[1] == pytest.approx(slopes[0], rel=1e-10)
    assert f.second([2.2, 1.0])[1] == pytest.approx(f.second([2.2, 1.0])[0], rel=1e-9)


@pytest.mark.parametrize(
    "output",
    [
        lambda x, y: sympy.sqrt(rate(x) ** 2 + rate(y) ** 2),
        lambda x, y: rate(x) + 1,
        lambda x, y: rate(rate(x)),
    ],
)
def test_what_is_not_linear_in_velocities_is_refused(output):
    m = models.five_bar()
    end = m.system().body_points[0]
    m.output("drift", output(end.x, end.y), "1")
    for call in (code_of, kc.transmission):
        with pytest.raises(kc.InputError, match="'drift' of five_bar reads velocities and is not"):
            call(m, ["motor_1", "motor_2"], ["drift"])


@pytest.mark.parametrize("beside", [{"form": "grouped"}, {"dynamics": True}])
def test_a_transmission_is_a_file_of_its_own(beside):
    wanted = (["motor"], ["phi_rocker"])
    with pytest.raises(kc.UnsupportedError, match="a file of its own"):
        kc.emit(models.crank_rocker(), transmission=wanted, **beside)


def test_a_start_that_cannot_be_assembled_is_said():
    with pytest.raises(kc.InputError, match="no position of four_bar was found"):
        kc.emit(models.crank_rocker(b=0.01), transmission=(["motor"], ["phi_rocker"]))

"""`kc.verify` looks at outputs too: every single wrong sign in them is found."""

import re

import numpy as np
import pytest

import kincompile as kc
from kincompile import outputs
from kincompile.model.system import remember_model
from kincompile.runtime.load import from_source


@pytest.fixture(scope="module")
def model():
    m = kc.read_model("examples/slider_crank.py")
    rod, crank = (next(b for b in m.bodies if b.name == name) for name in ("rod", "crank"))
    end = m.point("end", rod, (0.1, 0.05))
    m.output("speed", outputs.speed(end), "m/s")
    m.output("ratio", outputs.velocity_ratio(end.x, crank.phi))
    m.output("angle", outputs.angle((end, (0, 1)), rod))
    return m


def test_that_right_outputs_pass(model):
    found = kc.verify(model)
    assert found.passed
    names = {(check.quantity, check.equation) for check in found.checks}
    assert {("outputs_dot", "speed"), ("outputs_ddot", "x_end"), ("outputs_q", "angle")} <= names


def test_that_where_differences_are_rough_a_right_output_is_not_called_wrong():
    """At a random state the two links of the angle are nearly in line."""
    m = kc.Mechanism("four_bar_asked")
    r = m.parameter("r", 1.0, "m")
    crank, rod = m.body("crank"), m.body("rod", (1, 0, 0.96))
    rocker = m.body("rocker", (3.2, 0, 1.76))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (r, 0), rod, (0, 0)))
    m.add(kc.Revolute("B", rod, (3, 0), rocker, (2.5, 0)))
    m.add(kc.Revolute("C", m.ground, (3.2, 0), rocker, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 2 * kc.pi * kc.t))
    ends = m.point("A1", rod, (0, 0)), m.point("B1", rod, (3, 0)), m.point("C1", rocker, (0, 0))
    m.output("mu", outputs.transmission_angle(*ends), "rad")
    found = kc.verify(m)
    assert found.passed, found


def test_that_a_wrong_sign_in_outputs_is_found(model):
    source = kc.emit(model).source
    at = source.index(" - ", source.index("def _observe("))
    assert not kc.verify(from_source(f"{source[:at]} + {source[at + 3 :]}", "wrong")).passed


@pytest.mark.slow
def test_that_every_wrong_sign_in_outputs_is_found(model):
    source = kc.emit(model).source
    start = source.index("def _outputs_q(")
    stop = source.index("\ndef ", source.index("def _observe("))
    numbers = _numbers(from_source(source, "right"))
    missed, tried = [], 0
    for at in (
        match.start() + start for match in re.finditer(r"(?<= )[+-](?= )", source[start:stop])
    ):
        sign = "-" if source[at] == "+" else "+"
        module = from_source(source[:at] + sign + source[at + 1 :], "wrong")
        changed = _numbers(module)
        if all(np.array_equal(a, b, equal_nan=True) for a, b in zip(numbers, changed, strict=True)):
            continue
        tried += 1
        remember_model(module, model.system())
        if kc.verify(module).passed:
            missed.append(source[source.rindex("\n", 0, at) : source.index("\n", at)])
    assert tried > 30
    assert not missed


def _numbers(module):
    rng = np.random.default_rng(3)
    q, q_dot, q_ddot = rng.uniform(-1, 1, (3, 4, module.N_COORDINATES))
    t = rng.uniform(0, 1, 4)
    return [*module.observe(q, q_dot, q_ddot, t), module.outputs_q(q, q_dot, q_ddot, t)]

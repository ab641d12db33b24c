"""Wrong arguments of everything that goes on from a motion: an InputError, and nothing else."""

from __future__ import annotations

from importlib import import_module
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import spatial
from kincompile.errors import InputError, ModelError

if TYPE_CHECKING:
    from collections.abc import Callable

NAN, LAWS = float("nan"), cast("Any", import_module("scipy.stats"))


@pytest.fixture(scope="module")
def room() -> SimpleNamespace:
    """Give a driven crank with a spring, its module, and its motion."""
    m = kc.Mechanism("crank", end=1.0, points=3)
    a = m.parameter("a", 1.0, "m")
    arm = m.body("arm", (1, 0, 0), mass=1, inertia=0.1)
    m.add(kc.Revolute("O", m.ground, (0, 0), arm, (-1, 0)))
    m.add(kc.Spring("s", m.ground, (0, 2), arm, (0, 0), stiffness=10, free_length=0.5))
    m.point("tip", arm, (a, 0))
    free = kc.compile(m)
    m.add(kc.AbsoluteAngle("motor", arm, kc.t))
    module = kc.compile(m)
    motion = kc.solve(module, [0, 0.5, 1])
    return SimpleNamespace(m=m, free=free, module=module, motion=motion, forces=kc.forces(motion))


WRONG: dict[str, Callable[[Any], object]] = {
    "parameters that are none": lambda r: kc.sensitivities(r.motion, None),
    "a number as parameters": lambda r: kc.sensitivities(r.motion, 3),
    "no columns": lambda r: kc.sensitivities(r.motion, ["a"], of=[]),
    "a number as a column": lambda r: kc.sensitivities(r.motion, ["a"], of=[3]),
    "tolerances that are none": lambda r: kc.tolerance(r.m, None),
    "tolerances as pairs": lambda r: kc.tolerance(r.m, [("a", 1)]),
    "columns of tolerances": lambda r: kc.tolerance(r.m, {"a": 0.1}, of=3),
    "a joint that is a number": lambda r: kc.tolerance(r.m, {"a": 0.1}, clearances={3: 1}),
    "a tolerance beyond squares": lambda r: kc.tolerance(r.m, {"a": 1e200}),
    "a seed of a tolerance": lambda r: kc.tolerance(r.m, {"a": 0.1}, samples=2, seed=-1),
    "a distribution without mean": lambda r: kc.Deviation(-1, 1, LAWS.cauchy(0, 0.01)),
    "a distribution beside its limits": lambda r: kc.Deviation(-1, 1, LAWS.norm(3, 0.1)),
    "limits at no standard deviation": lambda r: kc.Deviation(-1, 1, sigmas=1e-300),
    "a sweep of nothing": lambda r: kc.sweep(r.m, None, target="numpy"),
    "a measure that is a number": lambda r: kc.sweep(
        r.m, {"a": [1, 2]}, measures=[3], target="numpy"
    ),
    "half a chunk": lambda r: kc.sweep(r.m, {"a": [1, 2]}, chunk=1.5),
    "a number as store": lambda r: kc.sweep(r.m, {"a": [1, 2]}, target="numpy", store=3),
    "a position that is a number": lambda r: kc.simulate(r.free, [0, 1], position=3),
    "events as a list": lambda r: kc.simulate(r.free, [0, 1], events=["arm.x"]),
    "an event at NaN": lambda r: kc.simulate(r.free, [0, 1], events={"arm.x": NAN}),
    "a stop at a text": lambda r: kc.simulate(r.free, [0, 1], stops={"arm.x": "1"}),
    "a stop of a number": lambda r: kc.simulate(r.free, [0, 1], stops={3: 3}),
    "stiffness at a number": lambda r: kc.equilibrium(r.free).stiffness(3),
    "one force for all times": lambda r: r.forces.in_axes_of("arm", [1, 2, 3]),
    "a fluctuation as text": lambda r: kc.flywheel(r.forces, "motor", fluctuation="0.1"),
    "a target that is none": lambda r: kc.fit(r.m, None, bounds={"a": (1, 2)}),
    "values that are a number": lambda r: kc.fit(r.m, _wanted(), bounds={"a": (1, 2)}, p=3),
    "bounds of all numbers": lambda r: kc.fit(r.m, _wanted(), bounds={"a": (1e-300, 1e300)}),
    "a sequence with no laws": lambda r: kc.motion.sequence([(0, 0), (1, 1)], law=[]),
    "a sequence without end": lambda r: kc.motion.sequence([(k, k % 2) for k in range(3000)]),
    "times as good as equal": lambda r: kc.motion.table([0, 1e-300, 1], [0, 1, 2]),
    "angles without end": lambda r: kc.motion.flat_cam(kc.t, 1.0, points=10**9),
    "values as text": lambda r: kc.times_at(r.module, "arm.phi", ["x"], [0, 1]),
    "no values": lambda r: kc.times_at(r.module, "arm.phi", [], [0, 1]),
    "a direction of two components": lambda r: _spatial_body().direction((1, 0)),
    "an angle of numbers": lambda r: spatial.outputs.inclination(cast("Any", 3), (0, 0, 1)),
    "joints that are none": lambda r: _drawn(),
    "a trace of a number": lambda r: kc.animate(r.motion, "x.svg", trace=3),
    "half a student": lambda r: kc.exercise(r.m, 1.5),
    "an output called status": lambda r: kc.compile(_named("status")),
    "an output called t": lambda r: kc.compile(_named("t")),
    "a seed of a fit": lambda r: kc.fit(r.m, _wanted(), bounds={"a": (1, 2)}, seed=1.5),
}


def _wanted() -> Any:
    return kc.targets.value("tip.x", [1.5], [0.1])


def _spatial_body() -> Any:
    return spatial.Mechanism("s").body("b")


def _drawn() -> kc.Mechanism:
    s = kc.Sketch("s")
    s.link("l", cast("Any", None))
    return s.mechanism()


def _named(name: str) -> kc.Mechanism:
    m = kc.Mechanism("named")
    m.output(name, m.body("arm").phi)
    return m


@pytest.mark.parametrize("what", WRONG)
def test_wrong_arguments_are_refused(room: SimpleNamespace, what: str) -> None:
    with pytest.raises((InputError, ModelError)):
        WRONG[what](room)


def test_a_batch_holds_where_a_position_of_its_size_is_not_finite() -> None:
    m = kc.Mechanism("growth", end=1.0, points=3)
    a = m.parameter("a", 1.0)
    arm = m.body("arm", (0, 0, 1))
    m.add(kc.Revolute("O", m.ground, (0, 0), arm, (0, 0)))
    m.add(kc.Equation("e", sympy.exp(a * arm.phi) - 2))
    wanted = kc.targets.value("arm.phi", [0.1], [0.0])
    found = kc.fit(m, wanted, bounds={"a": (1, 1e4)}, samples=8, starts=1)
    assert np.isfinite(list(found.parameters.values())).all()


def test_a_measure_is_found_by_its_name(room: SimpleNamespace) -> None:
    found = kc.sweep(room.m, {"a": [1.0, 2.0]}, measures=["tip.x.stroke"], target="numpy")
    assert found["tip.x.stroke"].equals(found["x_tip_stroke"])
    with pytest.raises(InputError, match=r"has no column 'tip\.x\.mean'"):
        found["tip.x.mean"]


def test_axes_may_have_any_length() -> None:
    axis, other, o = (1e-300, 0, 0), (1e300, 0, 0), (0, 0, 0)
    m = spatial.Mechanism("axes")
    arm = m.body("arm")
    m.add(spatial.Revolute("O", m.ground, o, axis, arm, o, other))
    assert np.isfinite(kc.compile(m).Phi_q(np.eye(7)[3], 0.0)).all()

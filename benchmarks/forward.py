"""Forward dynamics of the double pendulum beside Exudyn, on the same model no less exactly.

``python -m benchmarks.forward`` simulates two seconds from rest; the last angle is known to 14
digits. kincompile takes DOP853, in NumPy and in C, Exudyn its generalized-alpha method with so many
steps that it is off by 2e-7 at most. Building the models is not counted. Then half a second of
ten rods with springs of 1e8 N/m across their hinges, by implicit methods with the generated
Jacobian of the right side, beside the same by differences, and by DOP853.
"""

from __future__ import annotations

import math
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

import numpy as np

import kincompile as kc
from benchmarks import machine
from benchmarks.timing import in_turn
from kincompile.runtime.dynamics.equations import Equations

if TYPE_CHECKING:
    from collections.abc import Callable

EXACT = -6.59309391380594 - math.pi / 2
"""The angle of the second rod after two seconds."""

ROUNDS, RTOL, STEPS = 5, 3e-9, 20_000


def model() -> kc.Mechanism:
    """Return two rods of 1 m and 1 kg; the first is horizontal, the second hangs."""
    m = kc.Mechanism("double_pendulum")
    m.gravity = (0, -9.81)
    first = m.body("first", (0.5, 0, 0), mass=1, inertia=1 / 12)
    second = m.body("second", (1, -0.5, -math.pi / 2), mass=1, inertia=1 / 12)
    m.add(kc.Revolute("O", m.ground, (0, 0), first, (-0.5, 0)))
    m.add(kc.Revolute("A", first, (0.5, 0), second, (-0.5, 0)))
    return m


def ours(module: Any) -> float:
    """Return the last angle of the second rod."""
    start = {"first.phi": 0.0, "second.phi": -math.pi / 2}
    return float(kc.simulate(module, [0.0, 2.0], position=start, rtol=RTOL)["second.phi"][-1])


def exudyn() -> Callable[[], float]:
    """Return the same by Exudyn."""
    exu: Any = import_module("exudyn")
    item: Any = import_module("exudyn.itemInterface")
    mbs = exu.SystemContainer().AddSystem()
    bodies = [mbs.AddObject(item.ObjectGround())]
    for place in ([0.5, 0, 0], [1, -0.5, -math.pi / 2]):
        node = mbs.AddNode(item.NodeRigidBody2D(referenceCoordinates=place))
        body = item.ObjectRigidBody2D(physicsMass=1, physicsInertia=1 / 12, nodeNumber=node)
        bodies.append(mbs.AddObject(body))

    def marker(body: int, x: float) -> Any:
        return mbs.AddMarker(
            item.MarkerBodyPosition(bodyNumber=bodies[body], localPosition=[x, 0, 0])
        )

    for body in (1, 2):
        mbs.AddLoad(item.Force(markerNumber=marker(body, 0), loadVector=[0, -9.81, 0]))
    for ends in ((marker(0, 0), marker(1, -0.5)), (marker(1, 0.5), marker(2, -0.5))):
        mbs.AddObject(item.RevoluteJoint2D(markerNumbers=list(ends)))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime = 2
    settings.timeIntegration.numberOfSteps = STEPS
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.solutionSettings.writeSolutionToFile = False

    def run() -> float:
        mbs.SolveDynamic(settings)
        return float(mbs.systemData.GetODE2Coordinates()[5]) - math.pi / 2

    return run


def stiff_chain() -> kc.Mechanism:
    """Return ten rods, one hinged to the other, a stiff spring and damper across each hinge."""
    m = kc.Mechanism("stiff_chain")
    m.gravity = (0, -9.81)
    before: Any = m.ground
    for k in range(10):
        rod = m.body(f"rod_{k}", (k + 0.5, 0, 0), mass=1, inertia=1 / 12)
        m.add(kc.Revolute(f"A_{k}", before, (0.5 if k else 0, 0), rod, (-0.5, 0)))
        if k:
            m.add(kc.Spring(f"s_{k}", before, (0, 0.2), rod, (0, 0.2), 1e8, 1.0, 1e4))
        before = rod
    return m


def by_differences(_equations: Equations, t: float, y: Any) -> Any:
    """Return the Jacobian of the right side by differences, as SciPy and SUNDIALS take it."""
    step = math.sqrt(np.finfo(float).eps) * np.maximum(1e-5, np.abs(y))
    rate, columns = _equations.rate(t, y), []
    for k, size in enumerate(step):
        moved = y.copy()
        moved[k] += size
        columns.append((_equations.rate(t, moved) - rate) / size)
    return np.array(columns).T


def stiff(module: Any, method: str, jacobian: Any) -> dict[str, int]:
    """Simulate half a second, and return how much was evaluated."""
    with patch.object(Equations, "jacobian", jacobian):
        return dict(kc.simulate(module, [0.0, 0.5], method=method, rtol=1e-7).statistics)


def measure_stiff() -> None:
    """Measure and print implicit methods with both Jacobians."""
    module = kc.compile(stiff_chain())
    contenders = {
        f"{method}, {name}": partial(stiff, module, method, jacobian)
        for method in ("Radau", "BDF", "CVODE")
        for name, jacobian in (
            ("differences", by_differences), ("generated Jacobian", Equations.jacobian),
        )
    }  # fmt: skip
    contenders["DOP853"] = partial(stiff, module, "DOP853", Equations.jacobian)
    counts = {name: run()["evaluations"] for name, run in contenders.items()}
    times = in_turn(contenders, calls=1, rounds=ROUNDS)
    base = times["Radau, differences"].median
    for name, timing in times.items():
        print(
            f"{name}: {timing.median:.3g} s, {timing.median / base:.2g} x Radau by differences, "
            f"{counts[name]:,} evaluations"
        )


def main() -> None:
    """Measure and print."""
    contenders: dict[str, Callable[[], float]] = {
        "kincompile, NumPy": partial(ours, kc.compile(model())),
        "kincompile, C": partial(ours, kc.compile(model(), target="c")),
        "Exudyn": exudyn(),
    }
    errors = {name: abs(run() - EXACT) for name, run in contenders.items()}
    times = in_turn(contenders, calls=1, rounds=ROUNDS)
    base = times["Exudyn"].median
    for name, timing in times.items():
        ratio = timing.median / base
        print(f"{name}: {timing.median:.3g} s, {ratio:.2g} x Exudyn, error {errors[name]:.1e}")
    measure_stiff()
    print(machine.description())


if __name__ == "__main__":
    main()

"""Forward dynamics of the double pendulum beside Exudyn, on the same model no less exactly.

``python -m benchmarks.forward`` simulates two seconds from rest; the last angle is known to 14
digits. kincompile takes DOP853, in NumPy and in C, Exudyn its generalized-alpha method with so many
steps that it is off by 2e-7 at most. Building the models is not counted.
"""

from __future__ import annotations

import math
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import kincompile as kc
from benchmarks import machine
from benchmarks.timing import in_turn

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
    print(machine.description())


if __name__ == "__main__":
    main()

"""Dynamics of robots against Pinocchio: its tree and its loads, with the loops added here."""

import dataclasses
import itertools
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import kincompile as kc

pin: Any = pytest.importorskip("pinocchio", reason="Pinocchio is not installed: pip install pin")

DATA = Path(__file__).parents[2] / "data" / "robots"
MACHINES = ["5bar_linkage_iso3d", "5bar_linkage"]  # cassie_like agrees too, in a minute
WARNED = "ignore::kincompile.RedundantConstraintWarning"
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings(WARNED)]
RATES = 0.7, -0.4, 0.9, 0.3, -0.8, 0.5, 0.6


class Oracle:
    """The tree of a URDF in Pinocchio, closed by the frames of its sidecar."""

    def __init__(self, text: str, sidecar: dict[str, Any]) -> None:
        self.model = pin.buildModelFromXML(text)
        self.data = self.model.createData()
        self.pairs = [[self.frame(x) for x in pair] for pair in sidecar["closed_loop"]]
        self.counts = [{"3d": 3, "6d": 6}[x.lower()] for x in sidecar["type"]]

    def frame(self, name: str) -> int:
        kinds = pin.FrameType.BODY if self.model.existBodyName(name) else pin.FrameType.JOINT
        return int(self.model.getFrameId(name, kinds))

    def loops(self, q: Any, v: Any) -> tuple[Any, Any, Any]:
        """Return by what loops are missed, its derivatives, and accelerations at those of zero."""
        pin.computeJointJacobians(self.model, self.data, q)
        pin.forwardKinematics(self.model, self.data, q, v, 0 * v)
        pin.updateFramePlacements(self.model, self.data)
        world, rows = pin.LOCAL_WORLD_ALIGNED, []
        for (a, b), count in zip(self.pairs, self.counts, strict=True):
            at, to = self.data.oMf[a], self.data.oMf[b]
            turn = at.rotation @ pin.log3(at.rotation.T @ to.rotation)
            missed = np.concatenate((to.translation - at.translation, turn))
            slope, gamma = (
                after - before
                for before, after in (
                    [pin.getFrameJacobian(self.model, self.data, k, world) for k in (a, b)],
                    [
                        pin.getFrameClassicalAcceleration(self.model, self.data, k, world).vector
                        for k in (a, b)
                    ],
                )
            )
            rows.append((missed[:count], slope[:count], gamma[:count]))
        return tuple(np.concatenate(x) for x in zip(*rows, strict=True))  # type: ignore[return-value]

    def columns(self, names: Any) -> list[int]:
        return [self.model.joints[self.model.getJointId(name)].idx_v for name in names]

    def closed(self, q: Any, motors: dict[str, float]) -> Any:
        """Return the position at values of motors, by Newton's method."""
        own = np.eye(self.model.nv)[self.columns(motors)]
        for _ in range(30):
            missed, slope, _ = self.loops(q, 0 * q)
            every = np.concatenate((missed, own @ q - list(motors.values())))
            q = q - np.linalg.pinv(np.vstack((slope, own)), rcond=1e-9) @ every
        assert np.abs(self.loops(q, 0 * q)[0]).max() < 1e-12
        return q


@pytest.fixture(scope="module", params=MACHINES)
def robot(request: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, ...]:
    """Return files with a mass of its own for each link, motors, the oracle, and a position."""
    name, number = request.param, itertools.count(1)

    def heavy(_: Any) -> str:
        k = next(number)
        return (
            f'<inertial><origin xyz="{0.01 * k % 0.05} -0.02 {0.03 - 0.01 * k % 0.04}" rpy="0.2 0 '
            f'{0.1 * k}"/><mass value="{0.1 + 0.03 * k}"/><inertia ixx="{(2 + 0.1 * k) * 1e-3}" '
            'iyy="2.2e-3" izz="3e-3" ixy="1e-4" iyz="-2e-4" ixz="0"/></inertial>'
        )

    known = json.loads((DATA / f"{name}.json").read_text())
    text = re.sub("<inertial>.*?</inertial>", heavy, (DATA / f"{name}.urdf").read_text())
    path = tmp_path_factory.mktemp("robot") / "robot.urdf"
    path.write_text(text)
    sidecar = yaml.safe_load((DATA / f"{name}.yaml").read_text())
    path.with_suffix(".yaml").write_text((DATA / f"{name}.yaml").read_text())
    oracle = Oracle(text, sidecar)
    # Idle hinges have an inertia, so that they are driven.
    motors = known["poses"][0]["motors"] | {x: known["guess"][x] for x in known["idle"]}
    q = np.array([known["guess"].get(x, 0.0) for x in oracle.model.names[1:]])
    return path, motors, oracle, oracle.closed(q, motors)


def test_that_torques_of_motors_are_those_of_pinocchio(robot: tuple[Any, ...]) -> None:
    path, motors, oracle, q = robot
    rates = np.array(RATES[: len(motors)])
    missed, slope, _ = oracle.loops(q, 0 * q)
    solve = np.linalg.pinv(np.vstack((slope, np.eye(len(q))[oracle.columns(motors)])), rcond=1e-9)
    v = solve @ [*(0 * missed), *rates]
    a = solve @ [*-oracle.loops(q, v)[2], *(0 * rates)]
    wanted = pin.rnea(oracle.model, oracle.data, q, v, a) @ solve[:, len(missed) :]
    m = kc.read(path, motors=list(motors), pose=dict(zip(oracle.model.names[1:], q, strict=True)))
    for k, item in enumerate(m.constraints):
        if item.name in motors:
            rate = rates[list(motors).index(item.name)]
            m.constraints[k] = dataclasses.replace(item, angle=item.angle + rate * kc.t)
    found = kc.forces(kc.solve(kc.compile(m), [0.0]))
    torques = [found[f"drive_{name}"][0] for name in motors]
    np.testing.assert_allclose(torques, wanted, atol=1e-9 * np.abs(wanted).max())


def test_that_a_robot_without_motors_falls_as_in_pinocchio(robot: tuple[Any, ...]) -> None:
    path, _, oracle, q = robot
    _, slope, _ = oracle.loops(q, 0 * q)
    M = pin.crba(oracle.model, oracle.data, q)
    M = np.triu(M) + np.triu(M, 1).T
    weights = pin.rnea(oracle.model, oracle.data, q, 0 * q, 0 * q)
    n, rows = slope.shape[1], slope.shape[0]
    matrix = np.block([[M, slope.T], [slope, np.zeros((rows, rows))]])
    a = np.linalg.lstsq(matrix, [*-weights, *np.zeros(rows)], rcond=1e-11)[0][:n]
    pin.forwardKinematics(oracle.model, oracle.data, q, 0 * q, a)
    m = kc.read(path, motors=[], pose=dict(zip(oracle.model.names[1:], q, strict=True)))
    found = kc.simulate(kc.compile(m), [0.0, 1e-4])
    for link, (body, _) in m.links.items():
        if body != "ground" and link == body:
            frame = oracle.frame(link)
            wanted = pin.getFrameClassicalAcceleration(
                oracle.model, oracle.data, frame, pin.LOCAL_WORLD_ALIGNED
            ).linear
            here = [found[f"{x}_{body}_ddot"][0] for x in "xyz"]
            np.testing.assert_allclose(here, wanted, atol=1e-8 * (1 + np.abs(a).max()))

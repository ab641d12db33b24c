"""Robots from their files, against the frames of Pinocchio and MuJoCo (tests/data/robots)."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial

DATA = Path(__file__).parents[2] / "data" / "robots"
SMALL, LARGE = "5bar_linkage_iso3d", [
    "5bar_linkage", "battobot_6d", "cassie_like", "digit_like", "wl16_like",
]  # fmt: skip


def oracle(name: str) -> dict[str, Any]:
    """Return motors, idle hinges, a rough pose, and frames at values of the motors."""
    found: dict[str, Any] = json.loads((DATA / f"{name}.json").read_text())
    return found


@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
@pytest.mark.parametrize(
    "name", [SMALL, *(pytest.param(name, marks=pytest.mark.slow) for name in LARGE)]
)
def test_that_frames_are_those_of_the_oracle(name: str) -> None:
    known = oracle(name)
    path = next(x for x in (DATA / f"{name}.urdf", DATA / f"{name}.xml") if x.is_file())
    # An idle hinge moves nothing that is compared: it is driven, so that it stays.
    m = kc.read(path, motors=known["motors"] + known["idle"], pose=known["guess"])
    code = kc.compile(m)
    by_joint = dict(zip(known["motors"], (x.name for x in m.parameters), strict=False))
    for pose in known["poses"]:
        values = {by_joint[joint]: value for joint, value in pose["motors"].items()}
        solution = kc.solve(code, [0.0], values)
        assert solution.residual.max() < 1e-12
        for link, place in pose["frames"].items():
            origin, turn = spatial.frame(solution, link)
            if "r" in place:
                assert np.abs(origin[0] - place["r"]).max() < 1e-9, link
            if "p" in place:
                expected = Rotation.from_quat(np.roll(place["p"], -1))
                assert (turn[0] * expected.inv()).magnitude() < 1e-9, link

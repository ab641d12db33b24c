"""Small robots, as the text of files, and how one is read."""

from pathlib import Path
from typing import Any

import kincompile as kc

LINKS = '<link name="base"/><link name="a"/><link name="b"/>'
HINGES = (
    '<joint name="first" type="revolute"><parent link="base"/><child link="a"/>'
    '<axis xyz="0 0 2"/><limit lower="-1" upper="1"/></joint>\n'
    '<joint name="second" type="{}"><parent link="base"/><child link="b"/>'
    '<origin xyz="1 0 0" rpy="0 0 0.5"/><axis xyz="0 0 1"/>{}</joint>\n'
)
TREE = f"<robot name='r'>{LINKS}\n{HINGES}</robot>"


def model(tmp_path: Path, text: str, sidecar: str = "", **given: Any) -> Any:
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    if sidecar:
        path.with_suffix(".yaml").write_text(sidecar)
    return kc.read(path, **given)


GOOD = TREE.format("continuous", "")

MJCF = (
    '<mujoco><include file="{}"/><worldbody><body><inertial pos="0 0 0" mass="2" '
    'diaginertia="1 1 1"/><joint name="j" axis="{}"/>{}</body></worldbody></mujoco>'
)

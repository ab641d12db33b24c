"""A robot's file as a mechanism in space, assembled."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from kincompile.errors import InputError, ModelError
from kincompile.files.content import file_content
from kincompile.files.robots.closing import CLOSED, Tree, led, start_of
from kincompile.files.robots.mjcf import read_mjcf
from kincompile.files.robots.sidecar import read_sidecar
from kincompile.files.robots.to_mechanism import mechanism_of
from kincompile.files.robots.urdf import read_urdf
from kincompile.files.robots.xml_text import read_xml
from kincompile.names import escaped, listed, shown, suggestion

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence

    from kincompile.files.robots.robot import Array, Robot
    from kincompile.space.mechanism import Mechanism

LOG = logging.getLogger(__name__)

MOVED = 1e-6
"""How far a start moves the joints without mention [rad or m]."""


def read_robot(
    path: Path,
    content: bytes,
    *,
    loops: str | os.PathLike[str] | None = None,
    motors: Sequence[str] | None = None,
    pose: Mapping[str, Any] | None = None,
) -> Mechanism:
    """Read a robot as a mechanism in space: a URDF or an MJCF file, by its root element.

    Parameters
    ----------
    loops
        The sidecar, a YAML file. Without, and without loops in the file, one of the same name that
        ends in ``.yaml`` is taken.
    motors
        Names of the joints that are driven, in place of those of the files.
    pose
        Values of joints where the search begins, by their names; others are zero.

    Raises
    ------
    InputError
        If a motor or a joint of the pose is nowhere, or the sidecar cannot be read.
    ModelError
        If the files are no robot, or its loops cannot be closed.
    """
    root = read_xml(path, content)
    if root.tag == "mujoco":
        if loops is not None:
            raise InputError(
                f"{escaped(path)} is MJCF, whose loops are in <equality>: leave out the sidecar"
            )
        return assembled(read_mjcf(path, root), motors, pose)
    robot = read_urdf(path, root)
    beside = path.with_suffix(".yaml")
    if loops is None and not robot.closures and beside.is_file():
        loops = beside
        LOG.info("%s: its loops are read from %s", path, beside)
    if loops is not None:
        read_sidecar(Path(loops), file_content(Path(loops)), robot)
    return assembled(robot, motors, pose)


def assembled(
    robot: Robot, motors: Sequence[str] | None, pose: Mapping[str, Any] | None
) -> Mechanism:
    """Return the mechanism of a robot whose loops are closed, as near to a pose as they can be."""
    tree = Tree(robot)
    if not tree.size:
        raise ModelError(f"{robot.file}: no joint of it moves; give one that turns or slides")
    _drop_couplings_of_fixed(robot)
    begin = _begin(tree, pose or {})
    x, outside = start_of(tree, begin, is_given=pose is not None)
    if tree.missed(x) > CLOSED:
        raise ModelError(
            f"{robot.file}: its loops cannot be closed; from where it begins they miss by "
            f"{tree.missed(x):.3g} [m or rad] at least. Give a pose near a closed one, "
            "pose={'joint': value}, or correct lengths, and types of the loops."
        )
    robot.motors = _motors(tree, x, motors)
    asked = {name: begin[tree.places[name]][0] for name in robot.motors if name in (pose or {})}
    x = _led(tree, x, asked)
    _say_moved(tree, begin, x, outside)
    return mechanism_of(tree, x)


def _drop_couplings_of_fixed(robot: Robot) -> None:
    """Refuse couplings of joints that a sidecar has made something else."""
    for coupling in robot.couplings:
        for name in (*coupling.left, *coupling.right):
            if robot.joints[name].freedoms != 1:
                raise ModelError(
                    f"{robot.file}, line {coupling.line}: {coupling.name!r} couples joint "
                    f"{name!r}, which is {robot.joints[name].kind}; take it out of joint_name, or "
                    "out of here"
                )


def _begin(tree: Tree, pose: Mapping[str, Any]) -> Array:
    """Return the values of the joints where the search begins."""
    x = np.zeros(tree.size)
    for name, given in {**tree.robot.start, **pose}.items():
        joint = tree.robot.joints.get(name)
        if joint is None or not joint.freedoms:
            near = suggestion(name, tree.places) or "."
            raise InputError(
                f"pose has {shown(name)}, which is no joint that moves in {tree.robot.file}{near}"
            )
        values = np.atleast_1d(np.asarray(given, dtype=float))
        count = 4 if joint.kind == "spherical" else joint.freedoms
        if values.shape != (count,) or not np.isfinite(values).all():
            raise InputError(
                f"pose has {given!r} for joint {name!r}; give {count} "
                + ("numbers (w, x, y, z)" if count == 4 else f"number{'s' * (count > 1)}")
            )
        is_ball = joint.kind == "spherical"
        x[tree.places[name]] = _of_quaternion(values, name) if is_ball else values
    return x


def _of_quaternion(values: Array, name: str) -> Array:
    """Return the rotation vector of (w, x, y, z)."""
    if not np.linalg.norm(values):
        raise InputError(f"pose has zeros for the ball {name!r}; (1, 0, 0, 0) is no turn")
    return np.asarray(Rotation.from_quat(np.roll(values, -1)).as_rotvec())


def _motors(tree: Tree, x: Array, given: Sequence[str] | None) -> list[str]:
    """Return the joints that are driven; those that cannot be, or that follow, are left out."""
    robot = tree.robot
    if given is None and robot.motors is None:
        names = [x for x in tree.places if robot.joints[x].freedoms == 1 and x not in robot.passive]
        return tree.independent(x, names)
    names = list(dict.fromkeys((robot.motors or []) if given is None else given))
    for name in names:
        if name not in robot.joints:
            near = suggestion(name, robot.joints) or f" It has {listed(tree.places)}."
            raise InputError(f"motor {shown(name)} is no joint of {robot.file}{near}")
        if robot.joints[name].freedoms != 1:
            raise InputError(
                f"motor {name!r} of {robot.file} is {robot.joints[name].kind}: name joints that "
                "turn about one axis, or slide"
            )
    driven = {name for x in robot.couplings for name in x.left} if robot.couplings else set()
    coupled = [name for name in names if name in driven and name in robot.passive]
    if coupled:
        LOG.warning("%s: joints that mimic others are no motors: %s are left out", robot.file,
                    listed(coupled))  # fmt: skip
    names = [name for name in names if name not in coupled]
    found = tree.independent(x, names)
    follow = [name for name in names if name not in found]
    if follow:
        LOG.warning("%s: motors that follow from the others are left out: %s", robot.file,
                    listed(follow))  # fmt: skip
    return found


def _led(tree: Tree, x: Array, asked: Mapping[str, float]) -> Array:
    """Follow the motors to the values of the pose."""
    if all(abs(x[tree.places[name]][0] - value) < 1e-15 for name, value in asked.items()):
        return x
    found, done = led(tree, x, asked)
    if done < 1:
        raise ModelError(
            f"{tree.robot.file}: its motors cannot be led to the values of the pose: the way ends "
            f"at {done:.1%} of it. Give values that the loops allow."
        )
    return found


def _say_moved(tree: Tree, begin: Array, x: Array, outside: Sequence[str]) -> None:
    """Say how far the joints were moved to close the loops, and which are beyond their limits."""
    names, moved = tree.names(), np.abs(x - begin)
    if tree.size and moved.max() > MOVED:
        k = int(np.argmax(moved))
        unit = "m" if tree.robot.joints[names[k]].kind == "prismatic" else "rad"
        LOG.warning(
            "%s: the pose where it begins does not close the loops; the joints were moved, most "
            "%s, by %.3g %s", tree.robot.file, names[k], moved[k], unit,
        )  # fmt: skip
    if outside:
        LOG.warning("%s: beyond their limits are the joints %s", tree.robot.file, listed(outside))

"""The sidecar of a URDF, in YAML: what closes its loops, kinds of joints, and motors.

As the models of example-parallel-robots (arXiv 2504.04767) have it.
"""

from __future__ import annotations

import logging
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.errors import InputError, ModelError
from kincompile.files.content import decoded
from kincompile.files.robots.robot import Closure
from kincompile.files.robots.xml_text import XmlReader
from kincompile.names import escaped, listed, shown, suggestion

try:
    import yaml
except ModuleNotFoundError:
    yaml = None

if TYPE_CHECKING:
    from pathlib import Path

    from kincompile.files.robots.robot import Robot

LOG = logging.getLogger(__name__)

KEYS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type")
MOST_BYTES, MOST_LEVELS = 200_000, 8
KINDS = {"6d": "fixed", "3d": "spherical"}

Words = list[Any]
"""A text with its line, or a list of such."""


def read_sidecar(path: Path, content: bytes, robot: Robot) -> None:
    """Add the closures and motors of a sidecar to a robot, and the kinds of its joints.

    Raises
    ------
    InputError
        If PyYAML is missing.
    ModelError
        If it is not such a file, or names what the robot has not; every problem with file and line.
    """
    if yaml is None:
        raise InputError(
            f"{escaped(path)} is YAML, which the package PyYAML reads: pip install "
            "'kincompile[robots]'"
        )
    reader = _Sidecar(path, robot)
    reader.read(_document(path, content))
    reader.raise_problems()


def _document(path: Path, content: bytes) -> dict[str, Any]:
    """Return the lists of a sidecar by their keys, without aliases, tags or types of values."""
    shown_path = escaped(path)
    if len(content) > MOST_BYTES:
        raise ModelError(f"{shown_path}: the file has more than {MOST_BYTES:,} bytes; shorten it")
    text = decoded(path, content)
    try:
        depth = 0
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            line = event.start_mark.line + 1
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent):
                raise ModelError(f"{shown_path}, line {line}: aliases (*) are not read; repeat it")
            if depth > MOST_LEVELS:
                raise ModelError(f"{shown_path}, line {line}: the lists are nested too deeply")
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = mark.line + 1 if mark else 1
        what = escaped(getattr(error, "problem", None) or "it cannot be read")
        raise ModelError(f"{shown_path}, line {line}: this is not YAML: {what}") from None
    if not isinstance(node, yaml.MappingNode):
        raise ModelError(f"{shown_path}, line 1: a sidecar has the keys {listed(KEYS)}")
    found: dict[str, Any] = {}
    for key, value in node.value:
        line, name = key.start_mark.line + 1, str(key.value)
        if name in found or not isinstance(key, yaml.ScalarNode):
            what = f"{shown(name)} is there twice" if name in found else "a key is no text"
            raise ModelError(f"{shown_path}, line {line}: {what}; keys are {listed(KEYS)}")
        found[name] = _words(value), line
    return found


def _words(node: Any) -> Any:
    if isinstance(node, yaml.SequenceNode):
        return [_words(item) for item in node.value]
    return str(node.value), node.start_mark.line + 1


class _Sidecar(XmlReader):
    def __init__(self, path: Path, robot: Robot) -> None:
        super().__init__(path)
        self._robot = robot

    def read(self, given: dict[str, Any]) -> None:
        """Take closures, kinds of joints and motors."""
        lists: dict[str, Words] = {}
        for key, (words, line) in given.items():
            if key not in KEYS:
                near = suggestion(key, KEYS)
                LOG.warning("%s, line %d: %s is not read%s", self.file, line, shown(key), near)
            elif not isinstance(words, list):
                if words[0] not in ("", "null", "~"):
                    self.problem(line, f"{key} is no list; write {key}: [...]")
            else:
                lists[key] = words
        self._replace(self._texts(lists, "joint_name"), self._texts(lists, "joint_type"), given)
        self._close(lists.get("closed_loop", []), self._texts(lists, "type"), given)
        if "name_mot" in given:
            self._robot.motors = [self._joint(*word) for word in self._texts(lists, "name_mot")]

    def _texts(self, lists: dict[str, Words], key: str) -> list[tuple[str, int]]:
        found = lists.get(key, [])
        for item in found:
            if isinstance(item, list):
                self.problem(1, f"{key} has a list in it; give names alone")
                return []
        return found

    def _joint(self, name: str, line: int) -> str:
        if name not in self._robot.joints:
            near = suggestion(name, self._robot.joints) or "; name a joint"
            self.problem(line, f"joint {shown(name)} is nowhere in {self._robot.file}{near}")
        return name

    def _replace(self, names: Words, kinds: Words, given: dict[str, Any]) -> None:
        """Give joints other kinds: a ball, a universal joint, or none."""
        if len(names) != len(kinds):
            line = next(given[key][1] for key in ("joint_name", "joint_type") if key in given)
            self.problem(line, f"joint_name has {len(names)} names, joint_type {len(kinds)} types; "
                         "give one each")  # fmt: skip
            return
        for (name, line), (kind, at) in zip(names, kinds, strict=True):
            joint = self._robot.joints.get(self._joint(name, line))
            universal = re.fullmatch(r"UJOINT_([XYZ])([XYZ])", kind.upper())
            if joint is None:
                continue
            joint.limits = (0.0, 0.0)
            if kind.upper() == "FIXED":
                joint.kind, joint.axes = "fixed", ()
            elif kind.upper() == "SPHERICAL":
                joint.kind, joint.axes = "spherical", ()
            elif universal and universal[1] != universal[2]:
                first, second = (np.eye(3)["XYZ".index(universal[k])] for k in (1, 2))
                joint.kind, joint.axes = "universal", (first, second)
            else:
                self.problem(at, f"joint {name!r} has the type {shown(kind)}: types are SPHERICAL, "
                             "FIXED, and UJOINT_XY with two different axes of X, Y, Z")  # fmt: skip

    def _close(self, pairs: Words, types: Words, given: dict[str, Any]) -> None:
        if pairs and "type" not in given:
            LOG.warning(
                "%s, line %d: closed_loop has no type: all are taken for 6d; "
                "write type: [6d, ...]", self.file, given["closed_loop"][1],
            )  # fmt: skip
            types = [("6d", 1)] * len(pairs)
        if len(types) != len(pairs):
            self.problem(
                given["type"][1],
                f"type has {len(types)} entries for {len(pairs)} pairs of closed_loop; give one "
                "each, 6d or 3d",
            )
            return
        line = given.get("closed_loop", (None, 1))[1]
        for number, (pair, (kind, at)) in enumerate(zip(pairs, types, strict=True), 1):
            names = pair if isinstance(pair, list) else [pair]
            if len(names) != 2 or any(isinstance(name, list) for name in names):
                self.problem(line, f"pair {number} of closed_loop is no pair; write [frame, frame]")
                continue
            if kind.lower() not in KINDS:
                self.problem(at, f"type {shown(kind)} is no type of a loop: write 6d or 3d")
                continue
            links = tuple(self._frame(*name) for name in names)
            if "" in links:
                continue
            if links[0] == links[1]:
                self.problem(names[0][1], f"pair {number} of closed_loop joins {links[0]!r} to "
                             "itself; name two links")  # fmt: skip
                continue
            axes = np.eye(3)[2], np.eye(3)[2]
            found = Closure(
                f"closure_{number}", KINDS[kind.lower()], (links[0], links[1]),
                (np.eye(4), np.eye(4)), axes, names[0][1],
            )  # fmt: skip
            self._robot.closures.append(found)

    def _frame(self, name: str, line: int) -> str:
        link = self._robot.link_of(name)
        if link is None:
            near = self._robot.near(name) or "; name a link or a joint"
            self.problem(line, f"frame {shown(name)} is nowhere in {self._robot.file}{near}")
        return link or ""

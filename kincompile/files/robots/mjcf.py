"""MJCF through MuJoCo's own reader: MjSpec resolves classes, angles, orientations and references.

It is given a text without anything that names files or grows: includes are spliced in here, shapes,
assets, plugins and macros are left out, and each element keeps its line.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.polynomial import Polynomial

from kincompile.errors import InputError
from kincompile.files.content import file_content
from kincompile.files.robots.robot import (
    MOST_LINKS,
    Closure,
    Coupling,
    Joint,
    Mass,
    Robot,
    from_quaternion,
    order_tree,
    placement,
    turned,
)
from kincompile.files.robots.xml_text import LARGEST, Element, XmlReader, read_xml
from kincompile.names import escaped, shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path


MOST_INCLUDES = 50
"""Files that are included."""
KEPT: Mapping[str, Sequence[str] | None] = {
    "mujoco": ("model",), "compiler": ("angle", "eulerseq", "autolimits", "balanceinertia"),
    "option": ("gravity",), "default": None, "worldbody": None, "body": None, "frame": None,
    "joint": None, "freejoint": None, "inertial": None, "equality": None, "connect": None,
    "weld": None, "site": (
        "name", "class", "pos", "quat", "axisangle", "xyaxes", "zaxis", "euler", "fromto",
    ),
    "geom": (
        "class", "type", "size", "fromto", "pos", "quat", "axisangle", "xyaxes", "zaxis", "euler",
    ),
}  # fmt: skip
"""Elements that are read, and their attributes where not all are."""
REFUSED = ("replicate", "composite", "flexcomp", "attach", "plugin")
"""Macros that stand for more than they say, and code."""
GEOMS = {2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box"}
FREE, BALL, SLIDE = 0, 1, 2
CONNECT, WELD, JOINT = 0, 1, 2
"""Types of shapes, of joints and of equalities, as MuJoCo counts them."""


def read_mjcf(path: Path, root: Element) -> Robot:
    """Return the robot in an MJCF file.

    Raises
    ------
    InputError
        If MuJoCo is missing.
    ModelError
        If it is not such a file; the message has file and line.
    """
    try:
        import mujoco
    except ModuleNotFoundError:
        raise InputError(
            f"{escaped(path)} is MJCF, which the package MuJoCo reads: pip install "
            "'kincompile[robots]'"
        ) from None
    reader = _MjcfReader(path)
    reader.prepare(root)
    for left_out in ("", "geom"):  # shapes are for pictures, and may be of files
        try:
            model = mujoco.MjSpec.from_string(reader.text(root, left_out)).compile()
            break
        except (ValueError, mujoco.FatalError) as error:
            refused = " ".join(str(error).split())
    else:
        reader.problem(1, f"MuJoCo refuses this file: {refused}; correct it")
        reader.raise_problems()
    return reader.read(model)


class _MjcfReader(XmlReader):
    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._folder = path.resolve().parent
        self._included: list[Path] = []
        self._lines: dict[str, int] = {}
        self._heavy: set[str] = set()
        self._motors: list[str] = []
        self._made: Counter[str] = Counter()
        self._meshes: list[str] = []
        self._equalities: list[Element] = []

    def prepare(self, root: Element) -> None:
        """Put includes in their places; note names, motors and lines."""
        self._splice(root, ())
        self._check(root)
        self.raise_problems()

    def text(self, root: Element, left_out: str) -> str:
        """Return what MuJoCo is to read, without the elements of a tag."""
        pieces: list[str] = []
        self._write(root, pieces, 1, left_out)
        return "".join(pieces)

    def _splice(self, element: Element, above: tuple[Path, ...]) -> None:
        """Put in the place of each include the children of its root."""
        found: list[Element] = []
        for child in element.children:
            if child.tag != "include":
                self._splice(child, above)
                found.append(child)
                continue
            name = self.name(child, "file")
            file = (self._folder / name).resolve()
            if not file.is_relative_to(self._folder) or not name:
                text = f"the include {shown(name)} is outside the folder of this file"
                self.problem(child.line, f"{text}; move it beside it")
            elif file in above or len(self._included) >= MOST_INCLUDES:
                text = "includes itself" if file in above else f"is one of over {MOST_INCLUDES}"
                self.problem(child.line, f"the include {shown(name)} {text}; leave it out")
            else:
                self._included.append(file)
                other = read_xml(file, file_content(file))
                self._splice(other, (*above, file))
                found += other.children
        element.children[:] = found

    def _new(self, name: str) -> str:
        """Return a name that was not given before, for what has none."""
        self._made[name] += 1
        return name if self._made[name] == 1 else f"{name}_{self._made[name]}"

    def _check(self, element: Element) -> None:
        """Refuse macros and plugins, and note motors."""
        if element.tag in REFUSED:
            self.problem(element.line, f"<{element.tag}> is not read; write out what it stands for")
        for key, value in element.attributes.items():
            for word in value.split():
                if _is_wild(word):
                    text = f"{key} of <{element.tag}> has {shown(word)}: give numbers up to 1e9"
                    self.problem(element.line, text)
        for child in element.children:
            if element.tag == "actuator" and "joint" in child.attributes:
                self._motors.append(child.attributes["joint"])
            if element.tag == "equality" and child.tag in ("tendon", "flex", "flexvert"):
                text = f"an equality of <{child.tag}> is not read; write it with joints"
                self.problem(child.line, text)
            if element.tag == "equality":
                self._equalities.append(child)
            if child.tag == "geom" and "mesh" in child.attributes:
                self._meshes.append(child.attributes["mesh"])
            if child.tag == "body":
                name = child.attributes.setdefault("name", self._new(f"body_{child.line}"))
                self._lines[name] = child.line
                joints = [x for x in child.children if x.tag == "joint"]
                for joint in joints:
                    own = self._new(f"{name}_joint_{joint.line}")
                    joint.attributes.setdefault("name", own)
                if child.one("inertial"):
                    self._heavy.add(name)
            self._check(child)
        if element.tag == "mujoco" and len(self._lines) > MOST_LINKS:
            text = f"the robot has {len(self._lines)} bodies; at most {MOST_LINKS} are read"
            self.problem(1, f"{text}: leave out a part")

    def _write(self, element: Element, pieces: list[str], line: int, left_out: str) -> int:
        """Write an element where it was, as far as it is read; return the line that is reached."""
        given = element.attributes
        kept = KEPT[element.tag]
        chosen = {key: given[key] for key in given if kept is None or key in kept}
        if element.tag == "compiler":
            chosen |= {"boundmass": "1e-9", "boundinertia": "1e-12"}
        pieces.append("\n" * max(0, element.line - line))
        line = max(line, element.line)
        pieces.append(f"<{element.tag}{''.join(f' {k}={quoteattr(chosen[k])}' for k in chosen)}>")
        if element.tag == "mujoco" and element.one("compiler") is None:
            pieces.append('<compiler boundmass="1e-9" boundinertia="1e-12"/>')
        for child in element.children:
            is_file = child.tag == "geom" and child.attributes.keys() & {"mesh", "hfield"}
            if child.tag in KEPT and child.tag != left_out and not is_file:
                line = self._write(child, pieces, line, left_out)
        pieces.append(f"</{element.tag}>")
        return line

    def read(self, model: Any) -> Robot:
        """Return the robot of a compiled model."""
        robot = self._robot = Robot(self.file, model.names.split(b"\0")[0].decode() or "robot")
        robot.gravity = tuple(model.opt.gravity.tolist())
        robot.links["world"] = None
        self._bodies = ["world", *(model.body(k).name for k in range(1, model.nbody))]
        self._joints: dict[int, str] = {}
        for k, name in enumerate(self._bodies[1:], 1):
            inertia = from_quaternion(model.body_ipos[k], model.body_iquat[k])
            own = Mass(model.body_mass[k], np.zeros(3), np.diag(model.body_inertia[k]))
            self._body(model, k, name)
            robot.links[name] = own.seen_from(inertia) if name in self._heavy else None
        for k in range(model.ngeom):
            if kind := GEOMS.get(int(model.geom_type[k])):
                at = from_quaternion(model.geom_pos[k], model.geom_quat[k])
                body = self._bodies[model.geom_bodyid[k]]
                robot.add_shape(body, kind, model.geom_size[k].tolist(), at)
        robot.meshes = self._meshes
        order_tree(robot, self)
        for k in range(model.neq):
            if model.eq_active0[k]:
                self._equality(model, k)
        known = [name for name in dict.fromkeys(self._motors) if name in robot.joints]
        robot.motors = known or None
        self.raise_problems()
        return robot

    def _body(self, model: Any, k: int, name: str) -> None:
        """Add the joints of a body; several act in turn, with links of no mass between them."""
        parent = self._bodies[model.body_parentid[k]]
        at = from_quaternion(model.body_pos[k], model.body_quat[k])
        line = self._lines.get(name, 1)
        first = model.body_jntadr[k]
        numbers = [
            j for j in range(first, first + model.body_jntnum[k]) if model.jnt_type[j] != FREE
        ]
        if not numbers:
            self._robot.joints[f"{name} on {parent}"] = Joint(
                f"{name} on {parent}", "fixed", parent, name, at, line=line
            )
        for j in numbers:
            joint = model.joint(j).name
            child = name if j == numbers[-1] else f"{name} after {joint}"
            pivot = placement(model.jnt_pos[j])
            kind = {BALL: "spherical", SLIDE: "prismatic"}.get(int(model.jnt_type[j]), "revolute")
            made = Joint(joint, kind, parent, child, at @ pivot, on=pivot, line=line)
            if kind != "spherical":
                axis, reference = np.array(model.jnt_axis[j]), model.qpos0[model.jnt_qposadr[j]]
                back = -reference * axis
                made.axes = (axis,)
                slides = kind == "prismatic"
                zero = placement(back) if slides else placement((0, 0, 0), turned(back))
                made.at = made.at @ zero
                self._robot.start[joint] = (float(reference),)
                if model.jnt_limited[j]:
                    made.limits = tuple(model.jnt_range[j].tolist())
            self._robot.joints[joint] = made
            self._robot.links[child] = None
            self._joints[j] = joint
            parent, at = child, np.eye(4)

    def _equality(self, model: Any, k: int) -> None:
        kind, data = int(model.eq_type[k]), np.array(model.eq_data[k])
        ids = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        name = f"closure_{k + 1}"
        line = self._equalities[k].line
        if kind == JOINT:
            names = [self._joints.get(j, "") for j in ids]
            first, second = (self._robot.start.get(x, (0.0,))[0] for x in names)
            of_values = Polynomial(data[:5]).trim()(Polynomial([-second, 1.0])) + first
            left, right = ({x: 1.0} if x else {} for x in names)
            factors = tuple(of_values.coef.tolist())
            self._robot.couplings.append(Coupling(name, left, right, factors, line))
            return
        if "site1" in self._equalities[k].attributes:
            links = [self._bodies[model.site_bodyid[j]] for j in ids]
            a, b = (from_quaternion(model.site_pos[j], model.site_quat[j]) for j in ids)
        else:
            links = [self._bodies[j] for j in ids]
            if kind == CONNECT:
                a, b = placement(data[:3]), placement(data[3:6])
            else:
                a, b = from_quaternion(data[3:6], data[6:10]), placement(data[:3])
        axes = np.eye(3)[2], np.eye(3)[2]
        joint = "spherical" if kind == CONNECT else "fixed"
        self._robot.closures.append(Closure(name, joint, (links[0], links[1]), (a, b), axes, line))


def _is_wild(word: str) -> bool:
    """Return whether a word is NaN, infinite, or a number beyond what robots have."""
    try:
        return not abs(float(word)) <= LARGEST
    except ValueError:
        return False

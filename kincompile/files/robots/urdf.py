"""URDF: the tree of links, and the loops of its dialects.

URDF+ (arXiv 2411.19753) has `<loop>` and `<coupling>`, its parser `<constraint>` and
`<loop_constraint>`; the constraints proposed for urdfdom (pull request 264) name parent and child.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.files.robots.robot import (
    CLOSURES,
    FREEDOMS,
    Closure,
    Coupling,
    Joint,
    Mass,
    Robot,
    from_rpy,
    order_tree,
)
from kincompile.files.robots.xml_text import XmlReader
from kincompile.names import escaped, listed, shown, suggestion

if TYPE_CHECKING:
    from pathlib import Path

    from kincompile.files.robots.robot import Array
    from kincompile.files.robots.xml_text import Element

TYPES = ("revolute", "continuous", "prismatic", "fixed")
X, Y, Z = np.eye(3)


def read_urdf(path: Path, root: Element) -> Robot:
    """Return the robot in a URDF file.

    Raises
    ------
    ModelError
        If it is not one; every problem with file and line.
    """
    reader = _UrdfReader(path)
    if root.tag != "robot":
        reader.problem(root.line, f"this is no URDF: it begins with <{escaped(root.tag)}>, not "
                       "<robot>; a URDF ends in .urdf, an MJCF file in .xml")  # fmt: skip
        reader.raise_problems()
    return reader.read(root)


class _UrdfReader(XmlReader):
    """Reads links, joints and loops."""

    def read(self, root: Element) -> Robot:
        """Return the robot."""
        robot = self._robot = Robot(self.file, root.attributes.get("name", "robot") or "robot")
        for element in root.all("link"):
            if (name := self.name(element)) in robot.links:
                self.problem(element.line, f"there are two links {name!r}; rename one")
            robot.links[name] = self._mass(element.one("inertial"))
            self._shapes(name, element)
        for element in root.all("joint"):
            self._joint(element)
        if not robot.links:
            self.problem(root.line, "the robot has no links; add <link name=...>")
        for element in root.children:
            if element.tag.startswith("xacro:"):
                self.problem(element.line, "this is a xacro file; expand it by the program xacro")
                break
        self.raise_problems()
        order_tree(robot, self)
        self.raise_problems()
        for element in root.all("joint"):
            self._mimic(element)
        for element in root.all("loop", "constraint", "loop_constraint", "coupling"):
            kind = element.attributes.get("type", "")
            is_coupling = element.tag == "coupling" or kind == "rolling"
            (self._coupling if is_coupling else self._loop)(element)
        self.raise_problems()
        return robot

    def _origin(self, element: Element | None) -> Array:
        zeros = (0.0, 0.0, 0.0)
        return from_rpy(self.numbers(element, "xyz", zeros), self.numbers(element, "rpy", zeros))

    def _mass(self, element: Element | None) -> Mass | None:
        if element is None:
            return None
        mass = self.number(element.one("mass"), "value", 0.0)
        matrix = element.one("inertia")
        a, b, c, d, e, f = (
            self.number(matrix, key, 0.0) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        if mass < 0:
            self.problem(element.line, f"the mass is {mass:g}; give one of at least 0")
        if mass <= 0:
            return None
        own = Mass(mass, np.zeros(3), np.array([[a, b, c], [b, d, e], [c, e, f]]))
        return own.seen_from(self._origin(element.one("origin")))

    def _shapes(self, link: str, element: Element) -> None:
        """Read what is drawn of a link; meshes by name."""
        for visual in element.all("visual"):
            at, geometry = self._origin(visual.one("origin")), visual.one("geometry")
            for item in () if geometry is None else geometry.children:
                if item.tag == "mesh":
                    self._robot.meshes.append(item.attributes.get("filename", ""))
                    continue
                sizes = [x / 2 for x in self.numbers(item, "size", (0.0,) * 3)]
                if item.tag != "box":
                    length = self.number(item, "length", 0.0)
                    sizes = [self.number(item, "radius", 0.0), length / 2]
                if item.tag in ("box", "cylinder", "sphere") and min(sizes) >= 0:
                    self._robot.add_shape(link, item.tag, sizes, at)

    def _link(self, element: Element, *tags: str) -> str:
        """Return the link that a child with one of these tags names; "" with a problem."""
        child = element.one(*tags)
        name = "" if child is None else child.attributes.get("link", "")
        if child is None or name not in self._robot.links:
            what = f'<{tags[0]} link="...">'
            near = suggestion(name, self._robot.links) or f"; name a link in {what}"
            missing = f"has no {what}" if child is None else f"names the link {shown(name)}"
            end = "" if child is None else ", which is nowhere"
            self.problem((child or element).line, f"<{element.tag}> {missing}{end}{near}")
            return ""
        return name

    def _joint(self, element: Element) -> None:
        name, kind = self.name(element), element.attributes.get("type", "")
        if kind not in TYPES:
            is_known = kind in ("floating", "planar")
            extra = "; write the joints that it stands for" if is_known else suggestion(kind, TYPES)
            self.problem(
                element.line,
                f"joint {name!r} has the type {shown(kind)}: types that are read are "
                f"{listed(TYPES)}{extra}",
            )
            kind = "fixed"
        if name in self._robot.joints:
            self.problem(element.line, f"there are two joints {name!r}; rename one")
        parent, child = self._link(element, "parent"), self._link(element, "child")
        kind = "revolute" if kind == "continuous" else kind
        axis = np.array(self.direction(element.one("axis"), "xyz", (1.0, 0.0, 0.0)))
        at = self._origin(element.one("origin"))
        joint = Joint(name, kind, parent, child, at, line=element.line)
        if joint.freedoms:
            joint.axes = (axis,)
            limit = element.one("limit")
            if limit is not None and element.attributes.get("type") != "continuous":
                low, high = (self.number(limit, key, 0.0) for key in ("lower", "upper"))
                joint.limits = low, high
                if low > high:
                    text = f"its lower limit {low:g} is above its upper limit {high:g}"
                    self.problem(limit.line, f"joint {name!r}: {text}; exchange them")
        if element.attributes.get("independent", "true") == "false":
            self._robot.passive.add(name)
        self._robot.joints[name] = joint

    def _mimic(self, element: Element) -> None:
        mimic = element.one("mimic")
        if mimic is None:
            return
        name, other = element.attributes["name"], mimic.attributes.get("joint", "")
        problem = _not_coupled(self._robot, name) or _not_coupled(self._robot, other)
        leads = {next(iter(x.left)): next(iter(x.right)) for x in self._robot.couplings}
        ahead = other
        while ahead in leads and ahead != name:
            ahead = leads[ahead]
        if problem or ahead == name:
            self.problem(mimic.line, problem or f"joint {name!r} mimics itself; name another one")
            return
        factors = self.number(mimic, "offset", 0.0), self.number(mimic, "multiplier", 1.0)
        found = Coupling(f"mimic_{name}", {name: 1.0}, {other: 1.0}, factors, mimic.line)
        self._robot.couplings.append(found)
        self._robot.passive.add(name)

    def _loop(self, element: Element) -> None:
        """Read `<loop>` and `<constraint>`, of the forms that have been proposed."""
        kind = element.attributes.get("type", "spherical")
        kind = {"position": "spherical", "continuous": "revolute"}.get(kind, kind)
        if kind not in CLOSURES:
            text = f"<{element.tag}> has the type {shown(kind)}: types are {listed(CLOSURES)}"
            self.problem(element.line, text + suggestion(kind, CLOSURES))
            return
        links, places, axes = [], [], []
        for side, old in (("predecessor", "parent"), ("successor", "child")):
            links.append(self._link(element, side, old))
            holder = element.one(side, old)
            inner = None if holder is None else holder.one("origin")
            places.append(self._origin(inner or element.one(f"{old}_origin")))
            axis = element.one(f"{old}_axis", "axis")
            axes.append(np.array(self.direction(axis, "xyz", (1.0, 0.0, 0.0))))
        if kind == "universal" and element.one("child_axis") is None:
            axes[1] = np.cross(axes[0], X) if abs(axes[0] @ X) < 0.9 else np.cross(axes[0], Y)
            axes[1] /= np.linalg.norm(axes[1])
        name = element.attributes.get("name") or f"closure_{len(self._robot.closures) + 1}"
        if links[0] == links[1] != "":
            text = f"{name!r} joins link {links[0]!r} to itself; name two links"
            self.problem(element.line, text)
            return
        a, b = links
        sides = (a, b), (places[0], places[1]), (axes[0], axes[1])
        self._robot.closures.append(Closure(name, kind, *sides, element.line))

    def _coupling(self, element: Element) -> None:
        """Read a coupling of the values from the nearest common ancestor of two links."""
        links = self._link(element, "predecessor"), self._link(element, "successor")
        ratio = self.number(element.one("ratio"), "value", 1.0)
        if not all(links):
            return
        first, second = ([joint.name for joint in self._robot.above(link)] for link in links)
        ways = [[x for x in first if x not in second], [x for x in second if x not in first]]
        ways = [[x for x in way if self._robot.joints[x].freedoms == 1] for way in ways]
        name = element.attributes.get("name") or f"coupling_{element.line}"
        if not ways[1]:
            text = f"{name!r}: no joint leads to {links[1]!r}; exchange the links"
            self.problem(element.line, text)
            return
        right, left = (dict.fromkeys(way, 1.0) for way in ways)
        self._robot.couplings.append(Coupling(name, left, right, (0.0, ratio), element.line))


def _not_coupled(robot: Robot, name: str) -> str:
    """Return why a joint's value cannot be coupled with others; "" where it can."""
    if name not in robot.joints:
        return f"joint {name!r} is nowhere" + (suggestion(name, robot.joints) or "; name a joint")
    if FREEDOMS[robot.joints[name].kind] != 1:
        return f"joint {name!r} does not turn or slide; name one that does"
    return ""

"""What a description of a robot says: a tree of links, and what closes it.

Placements are arrays (4, 4): they take coordinates of a frame to those of the frame that it is
placed in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from kincompile.names import MOST_CHARACTERS, suggestion

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.files.robots.xml_text import XmlReader

    Array = NDArray[np.float64]

FREEDOMS: Mapping[str, int] = {
    "fixed": 0, "revolute": 1, "prismatic": 1, "universal": 2, "spherical": 3,
}  # fmt: skip
"""Kinds of joints of the tree, and how many values each has."""

CLOSURES = ("spherical", "revolute", "fixed", "universal", "prismatic")
"""Kinds of joints that close a loop."""

ROUND = np.pi / 6 * np.arange(12)
"""Angles of the corners of what is round."""

THIN = 1e-6
"""Thickness from which a solid is one."""

MOST_JOINTS, MOST_LINKS, MOST_SHAPES = 300, 3000, 500
"""Joints that move, links, and shapes; the largest robots that were met have 78 and 150."""


@dataclass(frozen=True, slots=True, eq=False)
class Mass:
    """Mass, centre (3,), and inertia about the centre (3, 3), in the frame of a link."""

    mass: float
    centre: Array
    inertia: Array

    def seen_from(self, placement: Array) -> Mass:
        """Return it in the frame that the link is placed in."""
        turn = placement[:3, :3]
        centre = turn @ self.centre + placement[:3, 3]
        return Mass(self.mass, centre, turn @ self.inertia @ turn.T)

    def __add__(self, other: Mass) -> Mass:
        """Return what two have together, in one frame."""
        mass = self.mass + other.mass
        centre = (self.mass * self.centre + other.mass * other.centre) / mass
        inertia = sum(
            part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
            for part, d in ((self, self.centre - centre), (other, other.centre - centre))
        )
        return Mass(mass, centre, np.asarray(inertia))


@dataclass(slots=True, eq=False)
class Joint:
    """A joint of the tree. T_child = T_parent at motion(value) on^-1."""

    name: str
    kind: str
    parent: str
    child: str
    at: Array
    axes: tuple[Array, ...] = ()  # unit vectors in the joint's frame; a universal joint has two
    on: Array = field(default_factory=lambda: np.eye(4))  # its frame after the motion, in the child
    limits: tuple[float, float] = (0.0, 0.0)  # where both are equal there are none
    line: int = 1

    @property
    def freedoms(self) -> int:
        """How many values it has."""
        return FREEDOMS[self.kind]

    @property
    def is_limited(self) -> bool:
        """Whether it has limits."""
        return self.limits[0] < self.limits[1]


@dataclass(slots=True, eq=False)
class Closure:
    """A joint of a kind in `CLOSURES` between frames of two links."""

    name: str
    kind: str
    links: tuple[str, str]
    at: tuple[Array, Array]
    axes: tuple[Array, Array]  # in these frames
    line: int = 1


@dataclass(slots=True, eq=False)
class Coupling:
    """Sum of left values = a_0 + a_1 x + ... with the sum x of right values.

    Values are those of hinges and slides, with factors.
    """

    name: str
    left: Mapping[str, float]
    right: Mapping[str, float]
    polynomial: tuple[float, ...] = (0.0, 1.0)
    line: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A solid for pictures: the corners (k, 3) of its hull, in the frame of a link."""

    link: str
    corners: Array

    @classmethod
    def of(cls, link: str, kind: str, sizes: Sequence[float], at: Array) -> Shape:
        """Return a box, a sphere, a cylinder or a capsule about z.

        Sizes are the halves of a box and of an ellipsoid; else the radius, and half the length of a
        cylinder, or between the centres of the ends of a capsule.
        """
        if kind == "box":
            points = np.array(list(product((-1.0, 1.0), repeat=3))) * sizes
        else:
            r, half = (1.0, 0.0) if kind == "ellipsoid" else (*sizes, 0.0)[:2]
            balls = [(r * math.sin(x), r * math.cos(x)) for x in math.pi / 5 * np.arange(6)]
            rings = [(a, z + math.copysign(half, z)) for a, z in balls]
            rings = [(r, half), (r, -half)] if kind == "cylinder" else rings
            points = np.array(
                [(a * math.cos(x), a * math.sin(x), z) for a, z in rings for x in ROUND]
            )
            points = points * sizes if kind == "ellipsoid" else points
        corners = points @ at[:3, :3].T + at[:3, 3]
        return cls(link, np.unique(np.round(corners, 9) + 0.0, axis=0))

    @property
    def is_solid(self) -> bool:
        """Whether it has a volume that can be seen."""
        away = self.corners - self.corners[0]
        return int(np.linalg.matrix_rank(away, tol=THIN)) == 3


@dataclass(slots=True, eq=False)
class Robot:
    """A robot as its file says it."""

    file: str
    name: str
    root: str = ""
    links: dict[str, Mass | None] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)  # each after that of its parent link
    closures: list[Closure] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    motors: list[str] | None = None  # None where no one names any
    passive: set[str] = field(default_factory=set)  # joints that are said to be no motors
    start: dict[str, tuple[float, ...]] = field(default_factory=dict)
    gravity: tuple[float, ...] = (0.0, 0.0, -9.81)
    shapes: list[Shape] = field(default_factory=list)
    shapes_left: bool = False  # whether there are more
    meshes: list[str] = field(default_factory=list)  # names of files that are not read

    @property
    def parents(self) -> dict[str, Joint]:
        """The joint above each link."""
        return {joint.child: joint for joint in self.joints.values()}

    def add_shape(self, link: str, kind: str, sizes: Sequence[float], at: Array) -> None:
        """Add a shape of a link, where there is anything to see of it."""
        if len(self.shapes) == MOST_SHAPES:
            self.shapes_left = True
        elif (made := Shape.of(link, kind, sizes, at)).is_solid:
            self.shapes.append(made)

    def link_of(self, name: str) -> str | None:
        """Return the link whose frame is meant by the name of a link, or of a joint above it."""
        if name in self.links:
            return name
        return self.joints[name].child if name in self.joints else None

    def near(self, name: str) -> str:
        """Return a hint at a link or a joint with a name like this one."""
        return suggestion(name, [*self.links, *self.joints])

    def above(self, link: str) -> Iterator[Joint]:
        """Yield the joints from a link to the root."""
        parents = self.parents
        while link in parents:
            yield parents[link]
            link = parents[link].parent


def order_tree(robot: Robot, reader: XmlReader) -> None:
    """Find the root of the links, and put the joints in order from it; note what is no tree."""
    below: dict[str, list[Joint]] = {}
    above: dict[str, Joint] = {}
    for joint in robot.joints.values():
        if (other := above.get(joint.child)) is not None:
            reader.problem(
                joint.line,
                f"link {joint.child!r} has two parents, by the joints {other.name!r} and "
                f"{joint.name!r}; keep one, and close the loop with <loop> or a sidecar",
            )
        above[joint.child] = joint
        below.setdefault(joint.parent, []).append(joint)
    roots = [link for link in robot.links if link not in above]
    if len(roots) > 1:
        reader.problem(1, f"the links {', '.join(map(repr, roots[:5]))} have no parent: one link, "
                       "the root, may have none; join the others")  # fmt: skip
    ordered: dict[str, Joint] = {}
    waiting = roots[:1]
    while waiting:
        for joint in below.get(waiting.pop(0), ()):
            if joint.name not in ordered:
                ordered[joint.name] = joint
                waiting.append(joint.child)
    cyclic = [joint for joint in robot.joints.values() if joint.name not in ordered]
    if cyclic and len(roots) < 2:
        reader.problem(
            cyclic[0].line,
            f"joint {cyclic[0].name!r} is part of a cycle that hangs on no root; leave out one "
            "joint of the cycle, and close the loop with <loop> or a sidecar",
        )
    robot.root, robot.joints = (roots or [""])[0], ordered
    moving = sum(joint.freedoms > 0 for joint in ordered.values())
    if moving > MOST_JOINTS or len(robot.links) > MOST_LINKS:
        reader.problem(
            1,
            f"the robot has {len(robot.links)} links and {moving} joints that move; at most "
            f"{MOST_LINKS} and {MOST_JOINTS} are read: leave out a part",
        )


def legal_names(names: Iterable[str], taken: Collection[str] = ()) -> dict[str, str]:
    """Return names that may stand in code, by the names of the file.

    Other characters than letters, digits and underscores become underscores, one that begins with
    no letter gets ``n_`` before it, and one that is taken a number behind it.
    """
    found: dict[str, str] = {}
    used = {*taken}
    for name in names:
        legal = "".join(x if x.isascii() and x.isalnum() else "_" for x in name)
        legal = (legal if legal[:1].isalpha() else f"n_{legal}")[: MOST_CHARACTERS - 30]
        number, stem = 1, legal
        while legal in used:
            number += 1
            legal = f"{stem}_{number}"
        used.add(legal)
        found[name] = legal
    return found


def placement(r: Sequence[float] | Array, turn: Array | None = None) -> Array:
    """Return the placement of a frame with its origin at r, turned by a matrix (3, 3)."""
    made = np.eye(4)
    made[:3, 3] = r
    if turn is not None:
        made[:3, :3] = turn
    return made


def from_rpy(r: Sequence[float], angles: Sequence[float]) -> Array:
    """Return the placement by roll, pitch and yaw about the fixed axes x, y, z."""
    return placement(r, Rotation.from_euler("xyz", angles).as_matrix())


def from_quaternion(r: Sequence[float] | Array, wxyz: Sequence[float] | Array) -> Array:
    """Return the placement by (w, x, y, z), of any length."""
    return placement(r, Rotation.from_quat(np.roll(wxyz, -1)).as_matrix())


def skew(v: Array) -> Array:
    """Return v~, with v~ w = v x w."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def turned(rotation: Array) -> Array:
    """Return the matrix (3, 3) of a rotation vector; for one at a time twice as fast as SciPy's."""
    angle = float(np.linalg.norm(rotation))
    v = skew(rotation)
    if angle < 1e-9:
        return np.asarray(np.eye(3) + v)
    s, c = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2
    return np.asarray(np.eye(3) + s * v + c * v @ v)


def beside(axis: Array) -> Array:
    """Return a unit vector at a right angle to a unit vector."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    found = other - (other @ axis) * axis
    return np.asarray(found / np.linalg.norm(found))

"""A robot as a mechanism in space: bodies, joints, and a driver for each motor."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.files.formula_text import GRAMMAR
from kincompile.files.robots.robot import beside, legal_names
from kincompile.model.equation import Equation
from kincompile.names import COLUMNS, RESERVED, listed, shown
from kincompile.space.guesses import euler_parameters
from kincompile.space.joints import (
    Fixed,
    JointAngle,
    RelativeRotation,
    Revolute,
    Spherical,
    Translational,
    Universal,
)
from kincompile.space.joints import RelativeTranslation as Slide
from kincompile.space.mechanism import Mechanism
from kincompile.space.points import SpatialPoint

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.files.robots.closing import Tree
    from kincompile.files.robots.robot import Array, Coupling, Joint, Mass
    from kincompile.model.constraint import Constraint
    from kincompile.space.bodies import SpatialBody

LOG = logging.getLogger(__name__)

ROUNDING = 1e-15
"""Components of places and directions up to which rounding leaves what is zero."""
SLIDER = 0.5
"""How far the slider of a motor without limits goes to either side [rad or m]."""


def mechanism_of(tree: Tree, x: Array) -> Mechanism:
    """Return the mechanism of a robot, at values x of its joints."""
    return _Builder(tree, x).built()


class _Builder:
    def __init__(self, tree: Tree, x: Array) -> None:
        self._robot = robot = tree.robot
        self._tree, self._x = tree, x
        self._made = Mechanism(legal_names([robot.name])[robot.name])
        self._made.gravity = robot.gravity
        self._host: dict[str, tuple[str, Array]] = {}
        for joint in ({robot.root: None} | robot.parents).items():
            self._find_host(*joint)
        bodies = [link for link in robot.links if self._host[link][0] == link != robot.root]
        parents = {joint.parent for joint in robot.joints.values()}
        closed = {link for closure in robot.closures for link in closure.links}
        inner = parents | closed | {*bodies, robot.root}
        self._tips = [
            link for link in robot.links if link not in inner and self._host[link][0] != robot.root
        ]
        self._names = legal_names([*bodies, *self._tips], {"ground"})
        self._joint_names = legal_names(tree.places, self._taken())
        self._parameters: dict[str, Any] = {}
        self._measured: dict[str, Any] = {}
        self._bodies: dict[str, Any] = {robot.root: self._made.ground}

    def _find_host(self, link: str, joint: Joint | None) -> None:
        if joint is None or joint.freedoms:
            self._host[link] = link, np.eye(4)
            return
        body, place = self._host[joint.parent]
        self._host[link] = body, place @ joint.at @ np.linalg.inv(joint.on)

    def _taken(self) -> set[str]:
        """Return names that parameters may not have."""
        letters = ("x", "y", "z", "e0", "e1", "e2", "e3")
        return {
            *RESERVED,
            *COLUMNS,
            *GRAMMAR,
            *(f"{x}_{name}" for name in self._names.values() for x in letters),
        }

    def built(self) -> Mechanism:
        """Return the mechanism."""
        made, robot = self._made, self._robot
        frames, *_ = self._tree.frames(self._x)
        masses, outlines = self._masses(), self._outlines()
        made.outline = outlines.get(robot.root, ())
        for link, name in self._names.items():
            if link in self._tips:
                continue
            place = frames[link]
            p, _ = euler_parameters(place[:3, :3], None, None, {})
            mass = masses.get(link)
            heavy = {} if mass is None else _heavy(mass)
            outline = outlines.get(link, ())
            self._bodies[link] = made.body(name, _tidy(place[:3, 3]), p, outline=outline, **heavy)
        for joint in robot.joints.values():
            if joint.freedoms:
                made.add(self._joint(joint))
        for name in robot.motors or ():
            self._drive(name)
        for closure in robot.closures:
            (i, a), (j, b) = map(self._side, closure.links, closure.at)
            made.add(_constraint(closure.kind, self._free(closure.name), i, a, j, b, closure.axes))
        for coupling in robot.couplings:
            self._couple(coupling)
        for link in self._tips:
            body, place = self._side(link, np.eye(4))
            made.point(self._names[link], body, _point(place))
        made.links = {
            link: ("ground" if body == robot.root else self._names[body], place)
            for link, (body, place) in self._host.items()
        }
        for joint in robot.joints.values():
            if joint.freedoms == 1 and joint.is_limited:
                self._limit(joint)
        self._show_names()
        return made

    def _limit(self, joint: Joint) -> None:
        """Give a hinge or a slide its limits."""
        crosses: dict[str, Any] = {}
        if joint.kind == "revolute" and joint.name not in self._parameters:
            sides = self._side(joint.parent, joint.at), self._side(joint.child, joint.on)
            found = (_triad(frame, joint.axes[0])[1] for _, frame in sides)
            crosses = dict(zip(("cross_i", "cross_j"), found, strict=True))
        self._made.limit(self._joint_names[joint.name], *joint.limits, **crosses)

    def _show_names(self) -> None:
        pairs = {**self._joint_names, **self._names}
        changed = [f"{shown(old)} is {new}" for old, new in pairs.items() if old != new]
        if changed:
            LOG.warning(
                "%s: names that may not stand in code are changed: %s", self._robot.file,
                listed(changed, 20),
            )  # fmt: skip

    def _free(self, name: str) -> str:
        """Return a name for a constraint that neither joints nor other constraints have."""
        used = {item.name for item in self._made.constraints} | {*self._joint_names.values()}
        return legal_names([name], used)[name]

    def _side(self, link: str, at: Array) -> tuple[SpatialBody, Array]:
        body, place = self._host[link]
        return self._bodies[body], place @ at

    def _masses(self) -> dict[str, Mass]:
        """Return the masses of bodies, of all links that belong to each."""
        found: dict[str, Mass] = {}
        for link, mass in self._robot.links.items():
            if mass is not None:
                body, place = self._host[link]
                own = mass.seen_from(place)
                found[body] = found[body] + own if body in found else own
        impossible = [body for body, mass in found.items() if not _is_possible(mass)]
        if impossible:
            LOG.warning(
                "%s: masses are left out whose moments of inertia no body can have: %s",
                self._robot.file, listed(impossible),
            )  # fmt: skip
        return {body: mass for body, mass in found.items() if body not in impossible}

    def _outlines(self) -> dict[str, list[Any]]:
        """Return the solids of bodies, for pictures; meshes are named, and not read."""
        found: dict[str, list[Any]] = {}
        for shape in self._robot.shapes:
            body, place = self._host[shape.link]
            corners = shape.corners @ place[:3, :3].T + place[:3, 3]
            found.setdefault(body, []).append([_tidy(x) for x in np.round(corners, 9)])
        if self._robot.shapes_left:
            count = len(self._robot.shapes)
            LOG.warning("%s: shapes beyond the first %d are not drawn", self._robot.file, count)
        if self._robot.meshes:
            names = listed(list(dict.fromkeys(self._robot.meshes)), 5)
            LOG.info("%s: meshes are not read: %s", self._robot.file, names)
        return found

    def _joint(self, joint: Joint) -> Constraint:
        i, a = self._side(joint.parent, joint.at)
        j, b = self._side(joint.child, joint.on)
        axes = (joint.axes[0], joint.axes[-1]) if joint.axes else (np.eye(3)[2],) * 2
        name = self._joint_names[joint.name]
        if joint.name in (self._robot.motors or ()):  # the driver has the joint's name
            name = self._free(f"{name}_joint")
        return _constraint(joint.kind, name, i, a, j, b, axes)

    def _drive(self, name: str) -> None:
        joint = self._robot.joints[name]
        unit = "rad" if joint.kind == "revolute" else "m"
        (value,) = _tidy(self._x[self._tree.places[name]])
        low, high = joint.limits if joint.is_limited else (value - SLIDER, value + SLIDER)
        limits = (low, high) if low <= value <= high else None
        legal = self._joint_names[name]
        parameter = self._made.parameter(legal, value, unit, limits)
        self._parameters[name] = parameter
        self._made.add(self._driver(joint, legal, parameter))

    def _driver(self, joint: Joint, name: str, value: Any) -> Constraint:
        """Return the driver that gives a hinge or a slide a value."""
        i, a = self._side(joint.parent, joint.at)
        j, b = self._side(joint.child, joint.on)
        axis = joint.axes[0]
        if joint.kind == "prismatic":
            return Slide(name, i, _point(a), _along(a, axis), j, _point(b), value)
        return RelativeRotation(name, i, *_triad(a, axis), j, *_triad(b, axis), value)

    def _couple(self, coupling: Coupling) -> None:
        """Add the equation of a coupling, or a driver where it follows motors alone."""
        name = self._free(coupling.name)
        (first, factor), *more = coupling.left.items()
        if not more and factor == 1 and all(x in self._parameters for x in coupling.right):
            value = _polynomial(coupling.polynomial, self._sum(coupling.right))
            self._made.add(self._driver(self._robot.joints[first], name, value))
            return
        right = _polynomial(coupling.polynomial, self._sum(coupling.right))
        self._made.add(Equation(name, self._sum(coupling.left) - right))

    def _sum(self, factors: Mapping[str, float]) -> Any:
        return sum((factor * self._value(name) for name, factor in factors.items()), sympy.S.Zero)

    def _value(self, name: str) -> Any:
        """Return a joint's value as an expression."""
        joint = self._robot.joints[name]
        if name in self._parameters:
            return self._parameters[name]
        if name not in self._measured:
            i, a = self._side(joint.parent, joint.at)
            j, b = self._side(joint.child, joint.on)
            axis, found = joint.axes[0], self._x[self._tree.places[name]][0]
            if joint.kind == "prismatic":
                way = zip(_place(j, b).coordinates, _place(i, a).coordinates, strict=True)
                along = _direction(i, _along(a, axis))
                self._measured[name] = sum(
                    ((q - p) * u for (q, p), u in zip(way, along, strict=True)), sympy.S.Zero
                )
            else:
                own = self._free(f"angle_{name}")
                sides = i, *_triad(a, axis), j, *_triad(b, axis)
                angle = JointAngle(own, *sides, guess=float(found))
                self._measured[name] = self._made.add(angle).theta
        return self._measured[name]


def _constraint(
    kind: str,
    name: str,
    i: SpatialBody,
    a: Array,
    j: SpatialBody,
    b: Array,
    axes: Sequence[Array],
) -> Constraint:
    """Return a joint of a kind between frames of two bodies."""
    if kind == "spherical":
        return Spherical(name, i, _point(a), j, _point(b))
    u, v = axes
    if kind == "prismatic":
        h, f = _triad(b, v)
        g = tuple(np.cross(h, f).tolist())
        return Translational(name, i, _point(a), *_triad(a, u), j, _point(b), h, g)
    if kind == "fixed":
        return Fixed(name, i, _point(a), *_triad(a, u), j, _point(b), *_triad(b, v))
    joint = Universal if kind == "universal" else Revolute
    return joint(name, i, _point(a), _along(a, u), j, _point(b), _along(b, v))


def _tidy(vector: Array) -> tuple[float, ...]:
    return tuple(0.0 if abs(x) < ROUNDING else x for x in vector.tolist())


def _point(frame: Array) -> tuple[float, ...]:
    return _tidy(frame[:3, 3])


def _along(frame: Array, axis: Array) -> tuple[float, ...]:
    return _tidy(frame[:3, :3] @ axis)


def _triad(frame: Array, axis: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return an axis and a cross beside it, in the frame of the body."""
    return _along(frame, axis), _along(frame, beside(axis))


def _place(body: SpatialBody, frame: Array) -> SpatialPoint:
    return SpatialPoint(body.name, body, _point(frame))


def _direction(body: SpatialBody, vector: tuple[float, ...]) -> tuple[Any, ...]:
    return vector if body.is_ground else body.direction(vector)


def _polynomial(factors: Sequence[float], x: Any) -> Any:
    return sum((factor * x**k for k, factor in enumerate(factors) if factor), sympy.S.Zero)


def _is_possible(mass: Mass) -> bool:
    """Return whether a body may have this inertia: no moment exceeds the sum of both others."""
    moments = np.linalg.eigvalsh(mass.inertia)
    return bool(moments[0] > 0 and moments[2] <= moments[0] + moments[1])


def _heavy(mass: Mass) -> dict[str, Any]:
    rows = tuple(map(_tidy, mass.inertia))
    return {"mass": mass.mass, "inertia": rows, "centre": _tidy(mass.centre)}

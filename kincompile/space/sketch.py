"""`Sketch` in space: a mechanism from its hardpoints, named once, and the links that join them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, cast

import sympy

from kincompile.model.drawing import Drawing
from kincompile.model.expressions import as_sympy
from kincompile.model.link_shape import ShapeError, number
from kincompile.model.sketch_parts import Line, Link, minus
from kincompile.names import listed
from kincompile.space.bodies import SpatialBody
from kincompile.space.drawn_masses import mass_of_bar
from kincompile.space.joints import (
    RelativeRotation,
    RelativeTranslation,
    Revolute,
    Spherical,
    Translational,
)
from kincompile.space.mechanism import Mechanism
from kincompile.space.primitives import AbsoluteX, AbsoluteY, AbsoluteZ, Distance

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.model.arguments import PointLike, ValueLike
    from kincompile.model.constraint import Constraint
    from kincompile.model.scope import Point
    from kincompile.space.points import SpatialPoint

ORIGIN = (0, 0, 0)


class Sketch(Drawing[SpatialBody]):
    """A mechanism in space as one draws it: where the joints are, and which of them a link joins.

        s = spatial.Sketch("swing")
        s.ground(A=(0, 0, 1), B=(0, 0.2, 1))
        s.joints(C=(0.5, 0.1, 0.9))
        s.link("arm", "A B C")

    A joint of two links is a ball. Two joints that the same two links share are a hinge about the
    line through them; `hinges` gives the axis of a hinge that is drawn as one joint. Frames, local
    points and guesses follow: every link is as drawn, and its frame has its origin at its first
    joint and the axes of the ground. Where the places are expressions of parameters the lengths
    are.

    Nothing is refused while drawing; `mechanism` tells all mistakes together.

    Parameters
    ----------
    name, length_unit, mass_unit, end, points
        As for `Mechanism`.
    live
        As for `Drawing`: each number of a joint's place is a parameter, ``A_x``, ``A_y``, ``A_z``.
    """

    builder = Mechanism
    coordinates: ClassVar[Mapping[str, type[Constraint]]] = {
        "x": AbsoluteX, "y": AbsoluteY, "z": AbsoluteZ,
    }  # fmt: skip
    distance = Distance

    def hinges(self, /, **axes: PointLike) -> None:
        """Let joints be hinges: the direction (x, y, z) of the axis by the name of the joint."""
        for joint, axis in axes.items():
            what = f"hinge {joint!r}"
            if self._drawn.named(joint, what, 1, most=1):
                self._drawn.axes[joint] = self._drawn.direction(axis, what, "a direction (x, y, z)")

    def link(
        self,
        name: str,
        joints: str | Sequence[str],
        *,
        mass: ValueLike | None = None,
        inertia: Any = None,
        centre: PointLike | None = None,
        density: ValueLike | None = None,
        width: ValueLike | None = None,
    ) -> SpatialBody:
        """Join joints by a rigid link, as they are drawn, and return its body.

        Parameters
        ----------
        name
            Name of the link and of its body.
        joints
            Two joints or more, as ``"A B C"``. Those that other links have already connect it to
            them: one by a ball or its hinge, two by a hinge through both.
        mass, inertia, centre
            Mass, inertia as that of `Mechanism.body`, and place of the centre of mass; the axes are
            those of the ground. Without inertia and centre they are those of a straight bar between
            two joints.
        density, width
            In place of the mass: those of a bar with a square section [mass/length^3, length].
        """
        what, drawn = f"link {name!r}", self._drawn
        named = drawn.named(joints, what, 2) or ()
        given = {
            "mass": mass, "inertia": inertia, "centre": centre, "density": density, "width": width,
        }  # fmt: skip
        heavy: Mapping[str, Any] = {}
        try:
            heavy = mass_of_bar([drawn.joints[joint] for joint in named], given, drawn.values)
        except ShapeError as error:
            drawn.problems.append(f"{what}: {error}")
        return self._added(name, named, heavy=heavy)

    def _sliding(
        self, name: str, joints: Sequence[str], guide: Line | None, heavy: Mapping[str, Any]
    ) -> SpatialBody:
        body = self._added(name, joints, guide, heavy)
        if guide is not None:
            cross = self._beside(guide.axis)
            base = (guide.link.body, guide.point, guide.axis, cross)
            own = (body, ORIGIN, guide.axis, _crossed(guide.axis, cross))
            self.add(Translational(f"{name}_guide", *base, *own))
        return body

    def rod(self, name: str, joints: str | Sequence[str], length: ValueLike | None = None) -> None:
        """Keep the distance of two joints of links: a rod with a ball at either end.

        Parameters
        ----------
        name
            Name of the constraint; a rod is no body.
        joints
            The two joints, which links have already.
        length
            Its length, a function of `kc.t` where it is driven; without, it is as drawn.
        """
        drawn, what = self._drawn, f"rod {name!r}"
        named = drawn.named(joints, what, 2, most=2) or ()
        held = [(drawn.holder(end, what), end) for end in named]
        points = [(link.body, link.places[end]) for link, end in held if link is not None]
        if len(points) == 2:
            way = minus(drawn.joints[named[1]], drawn.joints[named[0]])
            square = sympy.Add(*(as_sympy(part) ** 2 for part in way))
            self.add(Distance(name, *points[0], *points[1], length or sympy.sqrt(square)))

    def drive(self, what: str, value: ValueLike) -> None:
        """Prescribe a motion by a function of `kc.t`; the constraint is ``drive_<what>``.

        Parameters
        ----------
        what
            A slider: its way along the guide, from the first joint of the guide, or from where it
            is drawn; a link that hangs in a hinge: its angle [rad] about the axis, zero as drawn;
            two joints ``"A B"``: their distance; ``"A.z"``: a coordinate of a joint.
        value
            What it is.
        """
        self._drive(what, value, lambda name, link: self._turning_or_sliding(name, link, value))

    def point(self, joint: str) -> SpatialPoint:
        """Name a joint as a point of the first link that has it, and return it, for outputs."""
        return cast("SpatialPoint", super().point(joint))

    def mechanism(self) -> Mechanism:
        """Return the mechanism, to which more may be added.

        Raises
        ------
        ModelError
            With everything that is wrong with the drawing.
        """
        return cast("Mechanism", super().mechanism())

    def _added(
        self,
        name: str,
        joints: Sequence[str],
        guide: Line | None = None,
        heavy: Mapping[str, Any] | None = None,
    ) -> SpatialBody:
        drawn = self._drawn
        if name in drawn.links:
            drawn.problems.append(f"there is a link {name!r} already; rename")
        origin = drawn.joints[joints[0]] if joints else ORIGIN
        body = cast("Mechanism", self._mechanism).body(name, origin, **(heavy or {}))
        places = {joint: minus(drawn.joints[joint], origin) for joint in joints}
        hinges = self._connected(Link(body, places))
        drawn.keep(Link(body, places, guide=guide, hinge=next(iter(hinges), None)))
        return body

    def _connected(self, link: Link) -> list[Line]:
        shared: dict[str, list[str]] = {}
        for joint in link.places:
            other = self._drawn.first(joint)
            if other is not None:
                shared.setdefault(other.body.name, []).append(joint)
        made = (self._connect(link, self._drawn.links[name], shared[name]) for name in shared)
        return list(filter(None, made))

    def _connect(self, link: Link, other: Link, joints: Sequence[str]) -> Line | None:
        first, *others = joints
        if len(others) > 1:
            self._drawn.problems.append(
                f"link {link.body.name!r} shares {listed(joints)} with {other.body.name!r}, and "
                "three shared joints lock the two links; share two (a hinge), or merge the links"
            )
        axis = self._drawn.axes.get(first)
        if others:
            axis = minus(link.places[others[0]], link.places[first])
        taken = {item.name for item in self._mechanism.constraints}
        name = "_".join(joints)
        name = name if name not in taken else f"{name}_{link.body.name}"
        i, j = (other.body, other.places[first]), (link.body, link.places[first])
        if axis is None:
            self.add(Spherical(name, *i, *j))
            return None
        self.add(Revolute(name, *i, axis, *j, axis))
        return Line(other, other.places[first], axis)

    def _turning_or_sliding(self, name: str, link: Link, value: ValueLike) -> Constraint | None:
        if link.guide is not None:
            base = (link.guide.link.body, link.guide.point, link.guide.axis)
            return RelativeTranslation(name, *base, link.body, ORIGIN, value)
        if link.hinge is None:
            self._drawn.problems.append(
                f"drive of {link.body.name!r}: it neither slides nor hangs in a hinge; drive the "
                "distance of two joints 'A B', or a coordinate of a joint 'A.z'"
            )
            return None
        axis = link.hinge.axis
        turning = (axis, self._beside(axis))
        return RelativeRotation(name, link.hinge.link.body, *turning, link.body, *turning, value)

    def _beside(self, axis: Point) -> Point:
        """Return a direction at a right angle to an axis, of its components."""
        sizes = [abs(number(part, self._drawn.values)) for part in axis]
        farthest = sizes.index(min(sizes))
        return _crossed(axis, tuple(int(k == farthest) for k in range(3)))


def _crossed(u: Point, v: Point) -> Point:
    """Return u x v."""
    return tuple(u[k - 2] * v[k - 1] - u[k - 1] * v[k - 2] for k in range(3))

"""`Sketch`: a mechanism from a drawing, joints named once and the links that join them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from kincompile.model.absolute import AbsoluteAngle
from kincompile.model.bodies import GROUND, Body
from kincompile.model.drawing import Drawing
from kincompile.model.drawn_masses import mass_of_link
from kincompile.model.gears import Gear
from kincompile.model.joints import (
    Revolute,
    RevoluteTranslational,
    Translational,
    TranslationalDistance,
)
from kincompile.model.link_shape import ShapeError, shape
from kincompile.model.relative import RelativeAngle
from kincompile.model.sketch_parts import Line, Link, minus

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.model.arguments import BodyLike, PointLike, ValueLike
    from kincompile.model.constraint import Constraint
    from kincompile.model.expressions import Scalar
    from kincompile.model.scope import Point


class Sketch(Drawing[Body]):
    """A mechanism as one draws it: where the joints are, and which of them each link joins.

    Frames, local points, revolute joints and guesses follow. What is on the ground is where it is
    drawn. A moving link has its shape from its lengths where they are given, and then the drawing
    is the guess and says on which side a joint is; without lengths it is as drawn. The frame of a
    link has its origin at its first joint and its xi axis through the second.

    Nothing is refused while drawing; `mechanism` tells all mistakes together.

    Parameters
    ----------
    name, length_unit, mass_unit, end, points
        As for `Mechanism`.
    live
        As for `Drawing`: each number of a joint's place is a parameter, ``A_x`` and ``A_y``.
    """

    def link(
        self,
        name: str,
        joints: str | Sequence[str],
        length: ValueLike | None = None,
        /,
        *,
        mass: ValueLike | None = None,
        inertia: ValueLike | None = None,
        centre: PointLike | None = None,
        density: ValueLike | None = None,
        width: ValueLike | None = None,
        thickness: ValueLike | None = None,
        **lengths: ValueLike | PointLike,
    ) -> Body:
        """Join joints by a rigid link and return its body.

        Parameters
        ----------
        name
            Name of the link and of its body.
        joints
            Two joints or more, as ``"A B C"``.
        length
            Length of a link of two joints.
        mass, inertia, centre
            Mass, moment of inertia about the centre of mass, and its place (xi, eta). Without
            inertia and centre they are those of a straight bar through the joints, or of a plate
            with the joints as its corners, in order.
        density, width, thickness
            In place of the mass: density [mass/length^3] and width of a bar, whose thickness is its
            width where it is not given; density and thickness of a plate.
        **lengths
            Distances of joints by their names: ``AB=0.3``, or ``hip_knee=0.3``. A joint's own name
            gives its place in the frame of the link: ``P=(0.1, 0.05)``.
        """
        drawn, what = self._drawn, f"link {name!r}"
        named = drawn.named(joints, what, 2)
        if named is None:
            return self._added(name)
        outline = drawn.outline(named, *drawn.lengths(what, named, length, lengths))
        places: Mapping[str, Point] = dict.fromkeys(named, (0, 0))
        heavy: Mapping[str, Any] = {}
        given = {
            "mass": mass, "inertia": inertia, "centre": centre, "density": density, "width": width,
            "thickness": thickness,
        }  # fmt: skip
        try:
            places = shape(outline)
            heavy = mass_of_link([*places.values()], given, drawn.values)
        except ShapeError as error:
            drawn.problems.append(f"{what}: {error}")
        angle = drawn.angle(named[0], named[1])
        return self._added(name, places, drawn.joints[named[0]], angle, **heavy)

    def wheel(
        self,
        name: str,
        joint: str,
        *,
        mass: ValueLike | None = None,
        inertia: ValueLike | None = None,
        centre: PointLike | None = None,
    ) -> Body:
        """Add a body that turns about one joint, a gear wheel, and return it; drawn at angle 0.

        Mass, inertia and centre are those of `Mechanism.body`.
        """
        named = self._drawn.named(joint, f"wheel {name!r}", 1, most=1)
        if named is None:
            return self._added(name)
        heavy: dict[str, Any] = {"mass": mass, "inertia": inertia, "centre": centre or (0, 0)}
        return self._added(name, {named[0]: (0, 0)}, self._drawn.joints[named[0]], **heavy)

    def _sliding(
        self, name: str, joints: Sequence[str], guide: Line | None, heavy: Mapping[str, Any]
    ) -> Body:
        if guide is None:
            return self._added(name)
        drawn, base = self._drawn.joints, guide.link
        origin = drawn[joints[0]]
        places = {joint: base.turned(minus(drawn[joint], origin)) for joint in joints}
        body = self._added(name, places, origin, base.angle, guide, **heavy)
        own = (body, (0, 0), guide.axis)
        self.add(Translational(f"{name}_guide", base.body, guide.point, guide.axis, *own))
        return body

    def slot(self, joint: str, along: str | PointLike, on: BodyLike = GROUND) -> None:
        """Let a joint of a link run along a straight line of another, as a pin in a slot.

        Parameters
        ----------
        joint
            The joint; a link has it already. The constraint is ``<joint>_slot``.
        along, on
            The line, as for `slider`.
        """
        what = f"slot of {joint!r}"
        line = self._drawn.line(joint, along, on, what)
        pin = None if line is None else self._drawn.holder(joint, what)
        if line is not None and pin is not None:
            pinned = (pin.body, pin.places[joint], 0)
            slot = (line.link.body, line.point, line.axis)
            self.add(RevoluteTranslational(f"{joint}_slot", *slot, *pinned))

    def gear(
        self,
        name: str,
        i: BodyLike,
        centre_i: str,
        radius_i: ValueLike,
        j: BodyLike,
        centre_j: str,
        radius_j: ValueLike,
    ) -> None:
        """Let two links roll on each other as gears, whose teeth mesh as drawn.

        Parameters
        ----------
        name
            Name of the gear.
        i, j
            The links or wheels.
        centre_i, centre_j
            The joint at the centre of each; what keeps them apart is a link.
        radius_i, radius_j
            Pitch radii [length], negative for an internal gear.
        """
        drawn, what = self._drawn, f"gear {name!r}"
        first, second = drawn.link_of(i, what), drawn.link_of(j, what)
        named = drawn.named((centre_i, centre_j), what, 2, most=2)
        if named is None or first is None or second is None:
            return
        towards = drawn.angle(*named)
        wheel_i = (first.body, self.place(i, centre_i), radius_i, towards - first.angle)
        wheel_j = (second.body, self.place(j, centre_j), radius_j, towards + math.pi - second.angle)
        self.add(Gear(name, *wheel_i, *wheel_j))

    def drive(self, what: str, value: ValueLike, against: BodyLike | None = None) -> None:
        """Prescribe a motion by a function of `kc.t`; the constraint is ``drive_<what>``.

        Parameters
        ----------
        what
            A link: the angle of its xi axis [rad]; a slider: its way along the guide, from the
            first joint of the guide, or from where it is drawn; two joints ``"A B"``: their
            distance; ``"A.x"`` or ``"A.y"``: a coordinate of a joint.
        value
            What it is.
        against
            The link from which the angle of a link is counted; the x axis if none is named.
        """
        self._drive(
            what, value, lambda name, link: self._turning_or_sliding(name, link, value, against)
        )

    def _added(
        self,
        name: str,
        places: Mapping[str, Point] | None = None,
        origin: Point = (0, 0),
        angle: Scalar = 0.0,
        guide: Line | None = None,
        **heavy: Any,
    ) -> Body:
        """Add a body, and a pin for each of its joints that another link has already."""
        drawn, places = self._drawn, places or {}
        if name in drawn.links:
            remedy = "draw its joints with s.ground(A=(x, y))" if name == GROUND.name else "rename"
            drawn.problems.append(f"there is a link {name!r} already; {remedy}")
        body = self._mechanism.body(name, guess=(*origin, angle), **heavy)
        taken = {item.name for item in self._mechanism.constraints}
        for joint, place in places.items():
            other = drawn.first(joint)
            if other is not None:
                pin = joint if joint not in taken else f"{joint}_{name}"
                self.add(Revolute(pin, other.body, other.places[joint], body, place))
        drawn.keep(Link(body, places, angle, guide))
        return body

    def _turning_or_sliding(
        self, name: str, link: Link, value: ValueLike, against: BodyLike | None
    ) -> Constraint | None:
        if link.guide is not None:
            guide = (link.guide.link.body, link.guide.point, link.guide.axis)
            return TranslationalDistance(name, *guide, link.body, (0, 0), value)
        if against is None:
            return AbsoluteAngle(name, link.body, value)
        base = self._drawn.link_of(against, f"drive of {link.body.name!r}")
        return None if base is None else RelativeAngle(name, base.body, link.body, value)

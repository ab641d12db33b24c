"""What drawings in the plane and in space share: joints, named once, and links that have them."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import sympy

from kincompile.errors import ModelError
from kincompile.model.absolute import AbsoluteX, AbsoluteY
from kincompile.model.arguments import Kind
from kincompile.model.bodies import Body
from kincompile.model.constraint import Constraint, Element
from kincompile.model.equation import Equation
from kincompile.model.link_shape import number
from kincompile.model.live_drawings import are_live
from kincompile.model.mechanism import Mechanism
from kincompile.model.points import BodyPoint
from kincompile.model.relative import Distance
from kincompile.model.sketch_parts import Drawn, Line, Link
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.model.arguments import BodyLike, PointLike, ValueLike
    from kincompile.model.expressions import Scalar, Scalars
    from kincompile.model.scope import Point

Item = TypeVar("Item", bound=Element | Equation)
Made = TypeVar("Made", bound=Body)
"""The type of bodies."""


def _is_number(value: Scalar) -> bool:
    return not isinstance(value, sympy.Expr) or not value.free_symbols


class Drawing(Generic[Made]):
    """Joints and links of a drawing, and the mechanism that it makes; `Sketch` is one.

    Nothing is refused while drawing; `mechanism` tells all mistakes together.

    Parameters
    ----------
    name, length_unit, mass_unit, end, points
        As for `Mechanism`.
    live
        Whether each number of a joint's place is a parameter, ``A_x`` and ``A_y`` of a joint A, so
        that a page can pull it.
    """

    builder: ClassVar[type[Mechanism]] = Mechanism
    coordinates: ClassVar[Mapping[str, type[Constraint]]] = {"x": AbsoluteX, "y": AbsoluteY}
    distance: ClassVar[type[Constraint]] = Distance

    def __init__(
        self,
        name: str,
        *,
        length_unit: str = "m",
        mass_unit: str = "kg",
        end: Scalar = 1.0,
        points: int = 101,
        live: bool | None = None,
    ) -> None:
        units = {"length_unit": length_unit, "mass_unit": mass_unit}
        self._mechanism = self.builder(name, **units, end=end, points=points)
        self._drawn = Drawn(self._mechanism, is_live=are_live() if live is None else live)

    def parameter(
        self,
        name: str,
        default: Scalar | None = None,
        unit: str = "",
        range: Scalars | None = None,  # noqa: A002
    ) -> sympy.Symbol:
        """Declare a parameter and return its symbol, as `Mechanism.parameter` does."""
        return self._mechanism.parameter(name, default, unit, range)

    def length(
        self,
        name: str,
        default: float,
        range: Scalars | None = None,  # noqa: A002
    ) -> sympy.Symbol:
        """Declare a parameter in the unit of length and return its symbol."""
        return self.parameter(name, default, self._mechanism.length_unit, range)

    @property
    def gravity(self) -> Scalars:
        """Acceleration of gravity, as that of `Mechanism`: ``s.gravity = (0, -9.81)``."""
        return self._mechanism.gravity

    @gravity.setter
    def gravity(self, given: Scalars) -> None:
        self._mechanism.gravity = given

    def joints(self, /, **places: PointLike) -> None:
        """Draw joints: a place by name [length], numbers or expressions of parameters.

        A place is (x, y), in space (x, y, z).

        A joint that several links have is a pin. One of a single link that nothing else holds is a
        free end, with columns ``G.x`` and ``G.y`` in a solution; `point` names any other for that.
        Where lengths are given, a rough place will do.
        """
        for name, place in places.items():
            if name in self._drawn.joints:
                self._drawn.problems.append(f"joint {name!r} is drawn twice; draw it once")
            where = self._drawn.place(place, f"joint {name!r}")
            if self._drawn.is_live:
                where = self._live(name, where)
            self._drawn.joints[name] = where

    def _live(self, name: str, where: Point) -> Point:
        """Return the place of a joint with a parameter for each number of it."""
        return tuple(
            self.length(f"{name}_{letter}", float(part)) if _is_number(part) else part
            for letter, part in zip(self.coordinates, where, strict=True)
        )

    def coordinates_of(self, joint: str) -> list[str]:
        """Return the names of the parameters that a joint of a live drawing brings."""
        symbols = map(str, self._drawn.joints.get(joint, ()) if self._drawn.is_live else ())
        return [name for name in symbols if name in {f"{joint}_{x}" for x in self.coordinates}]

    def ground(self, /, **places: PointLike) -> None:
        """Draw joints of the ground, as `joints` does: these are exactly where they are drawn."""
        self.joints(**places)
        ground = self._mechanism.ground
        known = self._drawn.links[ground.name].places
        own = {name: self._drawn.joints[name] for name in places}
        self._drawn.keep(Link(ground, {**known, **own}))

    def add(self, constraint: Item) -> Item:
        """Add any constraint or load, as `Mechanism.add` does; a point may be a joint's name."""
        return self._mechanism.add(constraint)

    def output(self, name: str, expression: Scalar, unit: str = "") -> Scalar:
        """Ask for an expression over the motion, as `Mechanism.output` does."""
        return self._mechanism.output(name, expression, unit)

    def slider(
        self,
        name: str,
        joints: str | Sequence[str],
        along: str | PointLike,
        on: BodyLike | None = None,
        *,
        mass: ValueLike | None = None,
        inertia: Any = None,
        centre: PointLike | None = None,
    ) -> Made:
        """Add a body that slides along a straight guide without turning, and return it.

        Parameters
        ----------
        name
            Name of the slider; its guide is the constraint ``<name>_guide``.
        joints
            Joints that it carries, as drawn; the first is on the guide.
        along
            The guide: through two joints of one link, as ``"C D"``; or a direction (x, y), in space
            (x, y, z), in the drawing, through the place where the first joint is drawn.
        on
            The link that has a guide given by a direction; the ground if none is named.
        mass, inertia, centre
            As those of `Mechanism.body`. On a guide of the ground it never turns, and needs no
            inertia; it gets one that nothing sees.
        """
        what, on = f"slider {name!r}", self._mechanism.ground if on is None else on
        named = self._drawn.named(joints, what, 1) or ()
        guide = self._drawn.line(named[0], along, on, what) if named else None
        if inertia is None and guide is not None and guide.link.body.is_ground:
            size = self._drawn.size
            inertia = mass if size == len("xy") or mass is None else (mass,) * size
        given = {"mass": mass, "inertia": inertia, "centre": centre}
        heavy = {name: item for name, item in given.items() if item is not None}
        return self._sliding(name, named, guide, heavy)

    def _sliding(
        self, name: str, joints: Sequence[str], guide: Line | None, heavy: Mapping[str, Any]
    ) -> Made:
        """Return the body of a slider, without a guide where something is wrong with it."""
        raise NotImplementedError

    def place(self, link: BodyLike, joint: str) -> Point:
        """Return where a joint is in the frame of a link that has it."""
        found = self._drawn.link_of(link, f"joint {joint!r}")
        if found is not None and joint not in found.places:
            self._drawn.problems.append(
                f"the link {found.body.name!r} has no joint {joint!r}; it has "
                f"{listed(found.places)}"
            )
        nowhere = (0,) * self._drawn.size
        return nowhere if found is None else found.places.get(joint, nowhere)

    def point(self, joint: str) -> BodyPoint:
        """Name a joint as a point of the first link that has it, and return it, for outputs."""
        known = (item for item in self._mechanism.outputs if isinstance(item, BodyPoint))
        named = next((item for item in known if item.name == joint), None)
        if named is not None:
            return named
        what, ground = f"point {joint!r}", self._mechanism.ground
        held = self._drawn.holder(joint, what) if self._drawn.named(joint, what, 1) else None
        link = held or Link(ground, {joint: (0,) * self._drawn.size})
        return self._mechanism.point(joint, link.body, link.places[joint])

    def mechanism(self) -> Mechanism:
        """Return the mechanism, to which more may be added.

        Raises
        ------
        ModelError
            With everything that is wrong with the drawing.
        """
        drawn = self._drawn
        held = {joint for link in drawn.links.values() for joint in link.places}
        loose = [joint for joint in drawn.joints if joint not in held]
        problems = [*drawn.problems]
        if loose:
            problems.append(
                f"no link has the joints {listed(loose)}; name them in a link, or do not draw them"
            )
        if problems:
            raise ModelError(list(dict.fromkeys(problems)))
        self._name_points()
        if drawn.is_live:
            self._give_ranges()
        return self._mechanism

    def _give_ranges(self) -> None:
        """Let each coordinate of a joint go as far as the drawing is long, either way."""
        drawn, parameters = self._drawn, self._mechanism.parameters
        places = drawn.joints.items()
        own = {parameter for name, _ in places for parameter in self.coordinates_of(name)}
        values = drawn.values
        columns = [[number(place[k], values) for _, place in places] for k in range(drawn.size)]
        size = math.hypot(*(max(own) - min(own) for own in columns if own)) or 1.0
        reach = float(f"{size:.1g}")
        for k, item in enumerate(parameters):
            if item.name in own and item.range is None and item.default is not None:
                ends = (item.default - reach, item.default + reach)
                parameters[k] = replace(item, range=ends)

    def _name_points(self) -> None:
        """Name the free ends: joints that one moving link has alone, and no other link holds.

        Where there is none, and nothing is asked for, it is the last joint of one link alone.
        """
        named = {item.name for item in self._mechanism.outputs}
        alone, held = {}, self._held()
        for joint in self._drawn.joints:
            holders = [link for link in self._drawn.links.values() if joint in link.places]
            if len(holders) == 1 and not holders[0].body.is_ground and joint not in named:
                alone[joint] = holders[0].body, holders[0].places[joint]
        free = [joint for joint, (body, place) in alone.items() if (body.name, place) not in held]
        for joint in free or (list(alone)[-1:] if not named else ()):
            self._mechanism.point(joint, *alone[joint])

    def _held(self) -> list[tuple[str, Point]]:
        """Return the points that constraints of two bodies hold, each with the name of its body."""
        found = []
        for item in self._mechanism.constraints:
            if isinstance(item, Constraint) and len(item.frames()) > 1:
                given = {x.symbol: getattr(item, key) for key, x in item.arguments().items()}
                for x in item.arguments().values():
                    body = given.get(x.on) if x.kind is Kind.POINT else None
                    if body is not None:
                        found.append((getattr(body, "name", body), given[x.symbol]))
        return found

    def __repr__(self) -> str:
        """Return name and sizes."""
        sizes = f"{len(self._drawn.joints)} joints, {len(self._drawn.links) - 1} links"
        return f"<Sketch {self._mechanism.name!r}: {sizes}; .mechanism() makes the model>"

    def _drive(
        self, what: str, value: ValueLike, of_link: Callable[[str, Link], Constraint | None]
    ) -> None:
        """Add a driver: that of a link, by its name, or that of joints."""
        what = str(what)
        name = "drive_" + "_".join(what.replace(".", " ").split())
        link = self._drawn.links.get(what)
        made = self._moving_joints(name, what, value) if link is None else of_link(name, link)
        if made is not None:
            self.add(made)

    def _moving_joints(self, name: str, what: str, value: ValueLike) -> Constraint | None:
        """Return the driver of a joint's coordinate, or of the distance of two joints."""
        drawn, title = self._drawn, f"drive of {what!r}"
        joint, _, letter = what.partition(".")
        kind = self.coordinates.get(letter)
        ends = (joint,) if kind is not None else tuple(what.split())
        if kind is None and len(ends) < 2:
            drawn.problems.append(
                f"{title}: drive a link, a slider, the distance of two joints 'A B', or a "
                f"coordinate of a joint 'A.x'; links so far are: {listed(drawn.links)}"
            )
            return None
        named = drawn.named(ends, title, len(ends), most=1 if kind else 2)
        held = [(drawn.holder(end, title), end) for end in named or ()]
        points = [(link.body, link.places[end]) for link, end in held if link is not None]
        if len(points) < len(ends):
            return None
        make: Any = kind or self.distance
        made: Constraint = make(name, *chain(*points), value)
        return made

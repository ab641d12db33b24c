"""Points and outputs: what is asked of a mechanism beside its coordinates.

An output is an expression y of coordinates, time and parameters, and of rates if need be. The
compiler differentiates it along the motion as it does a constraint, y_dot = y_q q_dot + y_t. A
point of a body is two outputs, its global coordinates. The functions below write down outputs that
are often wanted; `rate` stands for the time derivative of an expression, in any of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, TypeAlias, TypeVar, cast

import sympy

from kincompile.errors import ModelError
from kincompile.model import declared as kinds
from kincompile.model.arguments import Kind
from kincompile.model.bodies import Body
from kincompile.model.declared import declared, given
from kincompile.model.directions import angle_between, length_of, turning
from kincompile.model.drawn_joints import asked
from kincompile.model.expressions import (
    NotAnExpressionError,
    as_expression,
    as_sympy,
    symbol_names,
    t,
)
from kincompile.model.points import (
    BodyPoint,
    Observed,
    OutputColumn,
    PlacedPoint,
    rate,
    written_out,
)
from kincompile.model.scope import body_named, checked_expression, checked_point, named_tables
from kincompile.names import rate as rate_name
from kincompile.names import unit_problem

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from kincompile.model.expressions import Scalar
    from kincompile.model.resolve import Joint
    from kincompile.model.scope import Scope


@declared(slots=True)
class Output:
    """An output as it was written; made by `Mechanism.output`. The unit None is that of lengths."""

    name: str = given(kinds.NAME, "Name of the output.")
    expression: Scalar = given(
        kinds.EXPRESSION, "What it is, in coordinates, points, rates, parameters and t."
    )
    unit: str | None = given(kinds.UNIT, "Its unit.", default="")


@dataclass(frozen=True, slots=True)
class ResolvedOutput(Observed):
    """An output that is known to be good."""

    name: str
    # In plain symbols of coordinates, rates, parameters and t, with `rate` and points in it.
    value: sympy.Expr
    unit: str
    columns: tuple[str, ...]  # the coordinates on which it depends, or on whose rates
    written: Output

    @property
    def expressions(self) -> tuple[sympy.Expr, ...]:
        """The value with every `rate` and every point written out."""
        motion = {rate_name(name, k): (name, k) for name in self.columns for k in range(2)}

        def along_motion(found: sympy.Expr) -> sympy.Expr:
            inner = cast("sympy.Expr", found.args[0])
            terms = [inner.diff(t)]
            for name in sorted(symbol_names(inner) & motion.keys()):
                coordinate, order = motion[name]
                following = sympy.Symbol(rate_name(coordinate, order + 1))
                terms.append(inner.diff(sympy.Symbol(name)) * following)
            return sympy.Add(*terms)

        plain = written_out(self.value)
        found = plain.replace(lambda x: isinstance(x, rate), along_motion, simultaneous=False)
        return (cast("sympy.Expr", found),)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """An output names coordinates, not bodies."""
        return ()

    @property
    def rows(self) -> tuple[OutputColumn, ...]:
        """The one output that it is."""
        return (OutputColumn(self.name, self.unit),)


AnyPoint: TypeAlias = BodyPoint | str | tuple["Scalar", ...]
"""A point of a body, the name of one or of a drawn joint, or a fixed one (x, y), (x, y, z)."""

Function = TypeVar("Function", bound="Callable[..., sympy.Expr]")


def _by_name(function: Function) -> Function:
    """Let a function of points take names too, in whose places `Mechanism.output` puts points."""

    @wraps(function)
    def taking(*given: AnyPoint) -> sympy.Expr:
        if any(isinstance(item, str) for item in given):
            points = (x.coordinates if isinstance(x, BodyPoint) else x for x in given)
            return asked(taking, *points)
        return function(*given)

    return cast("Function", taking)


def angle(i: Body | tuple[AnyPoint, AnyPoint], j: Body | tuple[AnyPoint, AnyPoint]) -> sympy.Expr:
    """Return the angle from i to j [rad], each a body or a direction from one point to another.

    Between two bodies it counts whole turns; with a direction it lies between -pi and pi.
    """
    if isinstance(i, Body) and isinstance(j, Body):
        return _expression(j.phi - i.phi)
    u, v = _direction(i), _direction(j)
    if len(u) + len(v) != 4:
        raise ModelError("an angle in space has no sign: kincompile.spatial.outputs.angle")
    return _expression(turning(*u, *v))


@_by_name
def distance(point: AnyPoint, other: AnyPoint) -> sympy.Expr:
    """Return the distance of two points [length]."""
    return length(_direction((point, other)))


@_by_name
def speed(point: BodyPoint | str) -> sympy.Expr:
    """Return the magnitude of a point's velocity."""
    return length(tuple(map(rate, _moving(point))))


@_by_name
def acceleration(point: BodyPoint | str) -> sympy.Expr:
    """Return the magnitude of a point's acceleration; it has no rates of its own."""
    return length(tuple(rate(rate(item)) for item in _moving(point)))


@_by_name
def transmission_angle(before: AnyPoint, joint: AnyPoint, after: AnyPoint) -> sympy.Expr:
    """Return the angle between two links at their joint [rad], 0 to pi: pi/2 transmits best.

    `joint` is that of coupler and follower, `before` and `after` are their other joints.
    """
    return between(_direction((joint, before)), _direction((joint, after)))


def velocity_ratio(output: Scalar, by: Scalar) -> sympy.Expr:
    """Return the ratio of the rates of two outputs, of coordinates, or of an output to a driver.

    It is not defined where `by` is at rest.
    """
    return _expression(rate(_scalar(output)) / rate(_scalar(by)))


def mechanical_advantage(output: Scalar, driver: Scalar) -> sympy.Expr:
    """Return the force that an output gives by the force that a driver takes.

    Without friction, masses and other loads the power that goes in comes out,
    F_in u_dot = F_out y_dot, so that it is u_dot / y_dot, the reciprocal of `velocity_ratio`:
    positive where the output pushes the way that y grows while the driver pushes the way that u
    grows. The forces belong to y and u: of an angle it is a torque. Its unit is that of u by that
    of y, 1/mm for an angle that drives a length in mm. It has no bound at a dead point of the
    output.
    """
    return velocity_ratio(driver, output)


def _expression(found: object) -> sympy.Expr:
    return cast("sympy.Expr", found)


def scalar_product(u: Sequence[sympy.Expr], v: Sequence[sympy.Expr]) -> sympy.Expr:
    """Return u^T v."""
    return _expression(sympy.Add(*(a * b for a, b in zip(u, v, strict=True))))


def length(u: Sequence[sympy.Expr]) -> sympy.Expr:
    """Return the length of a vector."""
    return _expression(length_of(*u))


def between(u: Sequence[sympy.Expr], v: Sequence[sympy.Expr]) -> sympy.Expr:
    """Return the angle between two vectors, 0 to pi."""
    if len(u) == 2:
        return _expression(angle_between(*u, *v))
    sizes = sympy.sqrt(scalar_product(u, u) * scalar_product(v, v))
    return _expression(sympy.acos(scalar_product(u, v) / sizes))


def _direction(given: Body | tuple[AnyPoint, AnyPoint]) -> tuple[sympy.Expr, ...]:
    """Return the components of a body's xi axis, or of the way from a point to another."""
    if isinstance(given, Body):
        return _expression(sympy.cos(given.phi)), _expression(sympy.sin(given.phi))
    places: object = given
    if not isinstance(places, tuple | list) or len(places) != 2:
        raise ModelError(f"{given!r} is no direction: give a body, or two points")
    start, end = (coordinates(place) for place in given)
    if len(start) != len(end):
        raise ModelError(f"of {given!r} one is in the plane and the other in space")
    return tuple(b - a for a, b in zip(start, end, strict=True))


def coordinates(place: AnyPoint) -> tuple[sympy.Expr, ...]:
    """Return the global coordinates of a point."""
    if isinstance(place, BodyPoint):
        return place.coordinates
    if isinstance(place, tuple | list):
        return tuple(map(_scalar, place))
    raise ModelError(
        f"{place!r} is no point: give one of a body, as m.point(...) returns it, or a fixed one, "
        "(x, y)"
    )


def _scalar(value: object) -> sympy.Expr:
    try:
        return as_sympy(as_expression(value))
    except NotAnExpressionError as error:
        raise ModelError(f"{error}; give a number, or an expression as foot.x is one") from None


def _moving(point: object) -> tuple[sympy.Expr, ...]:
    if isinstance(point, BodyPoint):
        return point.coordinates
    raise ModelError(f"{point!r} is no point of a body: give one, as m.point(...) returns it")


def point_of(joint: Joint) -> BodyPoint | None:
    """Return the first point of a joint that is on a moving body, under the joint's name."""
    bodies = dict(zip(("i", "j"), joint.bodies, strict=False))
    for item in joint.written.arguments().values():
        body = bodies.get(item.on)
        if item.kind is Kind.POINT and body is not None and not body.is_ground:
            return BodyPoint(joint.name, body, joint.points[item.symbol])
    return None


def resolved_observers(
    points: Iterable[BodyPoint], outputs: Iterable[Output], scope: Scope, length_unit: str
) -> tuple[PlacedPoint | ResolvedOutput, ...]:
    """Return the valid points, then the valid outputs, resolved."""
    found = (
        *(resolved_point(item, scope, length_unit) for item in points),
        *(_resolved(item, scope, length_unit) for item in outputs),
    )
    return tuple(item for item in found if item is not None)


def resolved_point(point: BodyPoint, scope: Scope, length_unit: str) -> PlacedPoint | None:
    """Check that a point lies on a body of the mechanism, at a place fixed in it."""
    where, before = f"point {point.name!r}", len(scope.problems)
    body = body_named(point.body, where, scope)
    local = checked_point(point.local, Kind.POINT, where, scope)
    if body is None or len(scope.problems) > before:
        return None
    rows = tuple(OutputColumn(name, length_unit) for name in point.output_names)
    columns = scope.columns[body.name]
    return PlacedPoint(point.name, columns, local, (body,), rows, body.kind.frame("i"))


def _resolved(output: Output, scope: Scope, length_unit: str) -> ResolvedOutput | None:
    where, before = f"output {output.name!r}", len(scope.problems)
    unit = length_unit if output.unit is None else output.unit
    scope.problems += filter(None, [unit_problem(unit, where)])
    declared = scope.declared | scope.motion.keys()
    given = output.expression
    value = checked_expression(given, where, declared, scope, unit=unit, is_output=True)
    if isinstance(value, sympy.Expr):
        highest_rate(value, where, scope)
    if value is None or len(scope.problems) > before:
        return None
    occurring = {scope.motion[name][0] for name in symbol_names(value) if name in scope.motion}
    columns = tuple(sorted(occurring, key=scope.places.__getitem__))
    value = named_tables(as_sympy(value), output.name)
    return ResolvedOutput(output.name, value, unit, columns, output)


def highest_rate(value: sympy.Basic, where: str, scope: Scope) -> int:
    """Return the highest order of rates in an expression, -1 where nothing in it moves."""
    if isinstance(value, sympy.Symbol):
        return scope.motion.get(value.name, ("", -1))[1]
    order = max((highest_rate(part, where, scope) for part in value.args), default=-1)
    if isinstance(value, rate):
        if order == 2:
            problem = f"{where}: {value} would be a third derivative; rates go to the second"
            scope.problems.append(problem)
        return min(order + 1, 2) if order >= 0 else -1
    return order

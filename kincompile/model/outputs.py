"""Points and outputs: what is asked of a mechanism beside its coordinates.

An output is an expression y of coordinates, time and parameters, and of rates if need be. The
compiler differentiates it along the motion as it does a constraint, y_dot = y_q q_dot + y_t. A
point of a body is two outputs, its global coordinates. The functions below write down outputs that
are often wanted; `rate` stands for the time derivative of an expression, in any of them.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, cast

import sympy

from kincompile.model.arguments import Kind
from kincompile.model.bodies import Body
from kincompile.model.expressions import (
    NotAnExpressionError,
    as_expression,
    as_sympy,
    symbol_names,
    t,
)
from kincompile.model.points import BodyPoint, rate
from kincompile.model.resolve import body_named, checked_expression, checked_point, named_tables
from kincompile.names import rate as rate_name
from kincompile.names import unit_problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from kincompile.model.expressions import Scalar
    from kincompile.model.resolve import Joint, Scope


@dataclass(frozen=True, slots=True)
class Output:
    """An output as it was written; made by `Mechanism.output`. The unit None is that of lengths."""

    name: str
    expression: Scalar
    unit: str | None = ""


@dataclass(frozen=True, slots=True)
class ResolvedOutput:
    """An output that is known to be good.

    Attributes
    ----------
    name, unit
        As in the columns of a solution.
    expression
        In plain symbols of coordinates, rates, parameters and t; every `rate` is written out.
    columns
        The coordinates on which it depends, or on whose rates.
    written
        As it was written, for files.
    """

    name: str
    expression: sympy.Expr
    unit: str
    columns: tuple[str, ...]
    written: Output

    @property
    def bodies(self) -> tuple[Body, ...]:
        """An output names coordinates, not bodies."""
        return ()

    @property
    def text(self) -> str:
        """The output in words, for comments."""
        return str(self.expression)

    @property
    def source(self) -> str:
        """Where it comes from."""
        return "output"

    @property
    def is_driver(self) -> bool:
        """An output drives nothing."""
        return False

    @property
    def corners(self) -> bool:
        """An output drives nothing, and so has no corners of its own."""
        return False


Place: TypeAlias = BodyPoint | tuple["Scalar", "Scalar"]
"""A point of a body, or a fixed one (x, y)."""


def angle(i: Body | tuple[Place, Place], j: Body | tuple[Place, Place]) -> sympy.Expr:
    """Return the angle from i to j [rad], each a body or a direction from one point to another.

    Between two bodies it counts whole turns; with a direction it lies between -pi and pi.
    """
    if isinstance(i, Body) and isinstance(j, Body):
        return _expression(j.phi - i.phi)
    (a, b), (c, d) = _direction(i), _direction(j)
    return _expression(sympy.atan2(a * d - b * c, a * c + b * d))


def distance(point: Place, other: Place) -> sympy.Expr:
    """Return the distance of two points [length]."""
    a, b = _direction((point, other))
    return _expression(sympy.sqrt(a**2 + b**2))


def speed(point: BodyPoint) -> sympy.Expr:
    """Return the magnitude of a point's velocity."""
    return _expression(sympy.sqrt(rate(point.x) ** 2 + rate(point.y) ** 2))


def acceleration(point: BodyPoint) -> sympy.Expr:
    """Return the magnitude of a point's acceleration; it has no rates of its own."""
    return _expression(sympy.sqrt(rate(rate(point.x)) ** 2 + rate(rate(point.y)) ** 2))


def transmission_angle(before: Place, joint: Place, after: Place) -> sympy.Expr:
    """Return the angle between two links at their joint [rad], 0 to pi: pi/2 transmits best.

    `joint` is that of coupler and follower, `before` and `after` are their other joints.
    """
    (a, b), (c, d) = _direction((joint, before)), _direction((joint, after))
    cosine = (a * c + b * d) / sympy.sqrt((a**2 + b**2) * (c**2 + d**2))
    return _expression(sympy.acos(cosine))


def velocity_ratio(output: Scalar, by: Scalar) -> sympy.Expr:
    """Return the ratio of the rates of two outputs, of coordinates, or of an output to a driver.

    Without friction the ratio of forces is its reciprocal: the mechanical advantage. It is not
    defined where `by` is at rest.
    """
    return _expression(rate(as_sympy(output)) / rate(as_sympy(by)))


def _expression(found: object) -> sympy.Expr:
    return cast("sympy.Expr", found)


def _direction(given: Body | tuple[Place, Place]) -> tuple[sympy.Expr, sympy.Expr]:
    """Return the components of a body's xi axis, or of the way from a point to another."""
    if isinstance(given, Body):
        return _expression(sympy.cos(given.phi)), _expression(sympy.sin(given.phi))
    (a, b), (c, d) = (_coordinates(place) for place in given)
    return c - a, d - b


def _coordinates(place: Place) -> tuple[sympy.Expr, sympy.Expr]:
    if isinstance(place, BodyPoint):
        return place.x, place.y
    x, y = place
    return as_sympy(x), as_sympy(y)


def point_of(joint: Joint) -> BodyPoint | None:
    """Return the first point of a joint that is on a moving body, under the joint's name."""
    bodies = dict(zip(("i", "j"), joint.bodies, strict=False))
    for item in joint.written.arguments().values():
        body = bodies.get(item.on)
        if item.kind is Kind.POINT and body is not None and not body.is_ground:
            return BodyPoint(joint.name, body, joint.points[item.symbol])
    return None


def outputs_of_points(points: Sequence[BodyPoint]) -> tuple[Output, ...]:
    """Return the outputs that points are: x and y of each."""
    return tuple(
        Output(f"{letter}_{item.name}", getattr(item, letter), None)
        for item in points
        for letter in ("x", "y")
    )


def resolve_point(point: BodyPoint, scope: Scope) -> None:
    """Check that a point lies on a body of the mechanism, at a place fixed in it."""
    where = f"point {point.name!r}"
    body_named(point.body, where, scope)
    checked_point(point.local, Kind.POINT, where, scope)


def resolved_outputs(
    given: Iterable[Output], scope: Scope, length_unit: str
) -> tuple[ResolvedOutput, ...]:
    """Return the valid outputs, resolved."""
    found = (_resolved(item, scope, length_unit) for item in given)
    return tuple(item for item in found if item is not None)


def _resolved(output: Output, scope: Scope, length_unit: str) -> ResolvedOutput | None:
    """Check an output against the names that exist; write out every `rate` in it."""
    where, before = f"output {output.name!r}", len(scope.problems)
    unit = length_unit if output.unit is None else output.unit
    scope.problems += filter(None, [unit_problem(unit, where)])
    given = output.expression
    with suppress(NotAnExpressionError):  # the check below says what is wrong
        given = as_expression(given)
    if isinstance(given, sympy.Expr) and given.has(rate):
        given = _written_out(given, where, scope)
    declared = scope.declared | scope.motion.keys()
    value = checked_expression(given, where, declared, scope, unit=unit)
    if value is None or len(scope.problems) > before:
        return None
    occurring = {scope.motion[name][0] for name in symbol_names(value) if name in scope.motion}
    columns = tuple(sorted(occurring, key=scope.places.__getitem__))
    value = named_tables(as_sympy(value), output.name)
    return ResolvedOutput(output.name, value, unit, columns, output)


def _written_out(given: sympy.Expr, where: str, scope: Scope) -> sympy.Expr:
    """Return an expression in which every `rate` is a time derivative along the motion."""

    def along_motion(found: sympy.Expr) -> sympy.Expr:
        inner = cast("sympy.Expr", found.args[0])
        terms = [inner.diff(t)]
        for name in sorted(symbol_names(inner) & scope.motion.keys()):
            coordinate, order = scope.motion[name]
            if order == 2:
                problem = f"{where}: {found} would be a third derivative; rates go to the second"
                scope.problems.append(problem)
                return sympy.S.Zero
            following = sympy.Symbol(rate_name(coordinate, order + 1))
            terms.append(inner.diff(sympy.Symbol(name)) * following)
        return sympy.Add(*terms)

    found = given.replace(lambda part: isinstance(part, rate), along_motion, simultaneous=False)
    return cast("sympy.Expr", found)

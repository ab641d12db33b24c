"""The names that may be used in a system, and what is written with them, checked.

Every problem is collected, none is raised.
"""

from __future__ import annotations

from collections.abc import Mapping, Set, Sized
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING, Any, cast

import sympy

from kincompile.model.arguments import Kind
from kincompile.model.bodies import GROUND, Body, Parameter
from kincompile.model.expressions import (
    Degree,
    NotAnExpressionError,
    Scalar,
    as_expression,
    degrees_problem,
    evaluate,
    in_radians,
    smoothness_problem,
    symbol_names,
    t,
    unknown_problem,
)
from kincompile.model.laws import MotionLaw, TableLaw
from kincompile.model.points import WrittenOut, written_out
from kincompile.model.points import rate as rate_of
from kincompile.names import listed, rate, suggestion

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence


Point = tuple[Scalar, ...]
"""A place or direction in a frame: two or three components."""


@dataclass
class Scope:
    """The names that may be used, and the problems found so far."""

    bodies: Mapping[str, Body]
    coordinates: Sequence[str]
    parameters: Mapping[str, Parameter]
    problems: list[str] = field(default_factory=list)
    ground: Body = GROUND

    @cached_property
    def declared(self) -> frozenset[str]:
        """Every name that may occur in an expression."""
        return frozenset((*self.coordinates, *self.parameters, "t"))

    @cached_property
    def places(self) -> dict[str, int]:
        """The number of each coordinate."""
        return {name: place for place, name in enumerate(self.coordinates)}

    @cached_property
    def motion(self) -> dict[str, tuple[str, int]]:
        """The coordinate, and the order of the derivative, by names of coordinates and rates."""
        orders = range(3)
        return {rate(name, k): (name, k) for name in self.coordinates for k in orders}

    @cached_property
    def columns(self) -> dict[str, tuple[str | None, ...]]:
        """The names of the columns of each body, by its name; the ground has none."""
        found: dict[str, tuple[str | None, ...]] = {
            name: body.coordinates for name, body in self.bodies.items()
        }
        return found | {GROUND.name: (None,) * len(self.ground.coordinates)}

    @cached_property
    def coordinate_names(self) -> frozenset[str]:
        """The coordinates, for membership."""
        return frozenset(self.coordinates)

    @cached_property
    def defaults(self) -> dict[str, float]:
        """Parameters with a default."""
        values = self.parameters.values()
        return {item.name: item.default for item in values if item.default is not None}


def body_named(given: Any, where: str, scope: Scope) -> Body | None:
    """Return the body with the given name, None where there is none."""
    name = given.name if isinstance(given, Body) else given
    if isinstance(name, str) and name == GROUND.name:
        return scope.ground
    if not isinstance(name, str) or name not in scope.bodies:
        hint = suggestion(name, scope.bodies) if isinstance(name, str) else ""
        scope.problems.append(
            f"{where}: there is no body {name!r} in this mechanism{hint}; bodies are: ground, "
            f"{listed(scope.bodies)}"
        )
        return None
    return scope.bodies[name]


def checked_expression(
    given: Any,
    where: str,
    declared: Collection[str],
    scope: Scope,
    *,
    unit: str = "",
    corners: bool = False,
    is_output: bool = False,
) -> Scalar | None:
    """Return a checked expression, with radians for degrees; None where a problem was noted.

    In an output there may be rates, and points stay what they are; elsewhere points are written
    out.
    """
    try:
        value = as_expression(given)
    except NotAnExpressionError as error:
        expected = "give a finite number or a SymPy expression"
        if isinstance(given, str) and "*" in given:
            expected += ", as 2*kc.pi*kc.t; formulas as text are for model files"
        scope.problems.append(f"{where}: {error}; {expected}")
        return None
    if not isinstance(value, sympy.Expr):
        return value
    known = (WrittenOut, rate_of) if is_output else ()
    value = value if is_output else written_out(value)
    problem = smoothness_problem(value, corners=corners, known=known)
    # Rare, so that large mechanisms pay for one look alone.
    if problem is None and (laws := value.atoms(Degree, MotionLaw)):
        problem = degrees_problem(value, unit) or _falling_problem(laws, scope)
        value = in_radians(value)
    if problem is not None:
        scope.problems.append(f"{where}: {problem}")
        return None
    problem = unknown_problem(value, declared, where)
    if problem is not None:
        scope.problems.append(problem)
        return None
    return value


def _falling_problem(laws: Set[sympy.Basic], scope: Scope) -> str | None:
    """Return a message about a motion law whose argument falls with time, or None."""
    for law in sorted((item for item in laws if isinstance(item, MotionLaw)), key=str):
        argument = cast("sympy.Expr", law.args[0])
        slope = evaluate(argument.diff(t), scope.defaults)
        if slope is not None and slope <= 0 and argument.has(t):
            return (
                f"the times of {law} must rise, but at the default parameters its argument changes "
                f"by {slope:g} per unit of time"
            )
    return None


def named_tables(value: Any, name: str) -> Any:
    """Return an expression whose tables over time are called after a constraint."""
    if not isinstance(value, sympy.Expr) or not value.has(TableLaw):
        return value
    tables = sorted(value.atoms(TableLaw), key=lambda item: item.given)
    numbers = {given: k for k, given in enumerate(dict.fromkeys(item.given for item in tables))}
    stem = f"C_{name}".replace(".", "_")
    named = {
        item: item.called(f"{stem}_{numbers[item.given]}" if numbers[item.given] else stem)(
            *item.args
        )
        for item in tables
    }
    return value.xreplace(named)


def checked_attribute(given: Any, where: str, scope: Scope, unit: str) -> Scalar:
    """Return an attribute: a number or an expression of parameters."""
    if type(given) is float and isfinite(given):
        return given  # of a large mechanism nearly all
    value = checked_expression(given, where, scope.declared, scope, unit=unit)
    if value is None:
        return 1
    if not isinstance(value, sympy.Expr):
        return value
    varying = sorted(symbol_names(value) - set(scope.parameters))
    if varying:
        scope.problems.append(
            f"{where}: {value} depends on {listed(varying)}; an attribute is fixed in its body, so "
            "only parameters may occur in it"
        )
        return 1
    return value


def checked_point(given: Any, kind: Kind, where: str, scope: Scope) -> Point:
    """Return a place or a direction: numbers or expressions of parameters, as many as axes."""
    # A generator would be used up here, a set has no order.
    is_list = type(given) is tuple or (
        isinstance(given, Sized) and not isinstance(given, str | Set | Mapping)
    )
    axes = scope.ground.kind.axes
    try:
        components = tuple(given) if is_list else ()
    except (TypeError, ValueError):
        components = ()
    if isinstance(given, str) and kind is Kind.POINT:
        scope.problems.append(
            f"{where}: no joint {given!r} is drawn on this body; give one that is, or "
            f"({', '.join(axes)}) in its frame"
        )
        return (1,) * len(axes)
    if len(components) != len(axes):
        group, number = {2: ("pair", "two"), 3: ("triple", "three")}[len(axes)]
        scope.problems.append(
            f"{where}: {given!r} is not a {group} ({', '.join(axes)}) of coordinates in the body's "
            f"frame; give {number} numbers, or expressions of parameters"
        )
        return (1,) * len(axes)
    unit = "" if kind is Kind.AXIS else "length"
    point = tuple(checked_attribute(value, where, scope, unit) for value in components)
    if kind is Kind.AXIS and not any(evaluate(value, scope.defaults) != 0 for value in point):
        example = (1, *(0,) * (len(axes) - 1))
        scope.problems.append(
            f"{where}: the axis has length zero; give a direction such as {example}"
        )
    return point

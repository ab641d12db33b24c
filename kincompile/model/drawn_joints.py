"""Joints of a drawing by their names, where a constraint or an output wants a point."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar, cast

import sympy

from kincompile.errors import ModelError
from kincompile.model.arguments import Kind
from kincompile.model.bodies import GROUND, Body
from kincompile.names import unknown

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from kincompile.model.constraint import Element
    from kincompile.model.points import BodyPoint
    from kincompile.model.scope import Point

Item = TypeVar("Item", bound="Element")


def with_places(item: Item, drawn: Mapping[str, Mapping[str, Point]]) -> Item:
    """Return a constraint or load with the places of joints that it names on its bodies.

    A name that its body does not have stays, and is refused by the check of the mechanism.
    """
    known = item.arguments()
    bodies = {x.symbol: getattr(item, name) for name, x in known.items() if x.kind is Kind.BODY}
    found: dict[str, Any] = {}
    for name, argument in known.items():
        given = getattr(item, name)
        if argument.kind is Kind.POINT and isinstance(given, str):
            body = bodies.get(argument.on, GROUND)
            places = drawn.get(body.name if isinstance(body, Body) else body, {})
            if given in places:
                found[name] = places[given]
    return replace(item, **found) if found else item


class OfJoints(sympy.Function):
    """An output of points that are called by their names, until a mechanism is known.

    Its arguments are the function of `kincompile.outputs` and what it was given.
    """


def asked(function: Callable[..., Any], *given: Any) -> sympy.Expr:
    """Return a stand-in for a function of points, which has their names."""
    names = (sympy.Symbol(item) if isinstance(item, str) else sympy.Tuple(*item) for item in given)
    return cast("sympy.Expr", OfJoints(sympy.Symbol(function.__name__), *names))


def with_points(
    expression: Any, functions: Mapping[str, Any], points: Mapping[str, BodyPoint]
) -> Any:
    """Return an output with the points that it names.

    Raises
    ------
    ModelError
        If there is no joint and no point of a name.
    """
    if not isinstance(expression, sympy.Basic) or not expression.has(OfJoints):
        return expression

    def place(given: Any) -> Any:
        if isinstance(given, sympy.Tuple):
            return tuple(given)
        if given.name in points:
            return points[given.name]
        raise ModelError(unknown(f"there is no joint or point {given.name!r}", given.name, points))

    return expression.replace(
        OfJoints, lambda name, *given: functions[name.name](*map(place, given))
    )

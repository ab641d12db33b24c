"""A mechanism with a change: clearances at joints, other values of parameters, another guess."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.errors import InputError
from kincompile.model.bodies import Body, Parameter
from kincompile.model.constraint import Constraint
from kincompile.model.mechanism import Mechanism, changed
from kincompile.names import listed, suggestion

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


def require_mechanism(model: object, what: str) -> Mechanism:
    """Return the model if it is a mechanism of bodies and joints; `what` says who asks."""
    if isinstance(model, Mechanism):
        return model
    kind = type(model).__name__
    raise InputError(f"{what} takes a Mechanism, not a {kind}: build one with kc.Mechanism(name)")


def clearance_names(joint: str) -> tuple[str, str]:
    """Return the names of the components of a clearance, along the axes of body i."""
    return f"clearance_xi_{joint}", f"clearance_eta_{joint}"


def with_clearances(model: Mechanism, joints: Iterable[str]) -> Mechanism:
    """Return a mechanism in which a small vector shifts the point of body i of each joint.

    Its components are parameters, zero by default.
    """
    loose = set(joints)
    if not loose:
        return model
    pinned = {
        item.name: item
        for item in model.constraints
        if isinstance(item, Constraint)
        and "point_i" in {entry.name for entry in fields(item)}
        and len(_point(item)) == 2
    }
    problems = [
        f"{model.name} has no joint {name!r} with a point on body i in the plane"
        f"{suggestion(name, pinned) or '.'} Clearances are those of {listed(pinned)}."
        for name in sorted(loose - set(pinned))
    ]
    if problems:
        raise InputError(problems)
    shifts = {name: clearance_names(name) for name in pinned if name in loose}
    names = [name for pair in shifts.values() for name in pair]
    more = [Parameter(name, 0.0, model.length_unit) for name in names]
    constraints = [
        _shifted(item, shifts[item.name]) if item.name in shifts else item
        for item in model.constraints
    ]
    return changed(model, parameters=[*model.parameters, *more], constraints=constraints)


def _point(item: Any) -> tuple[Any, ...]:
    """Return the point of a joint on body i; of a named point its place on its body."""
    given = item.point_i
    return tuple(given) if isinstance(given, tuple | list) else ()


def _shifted(item: Any, names: tuple[str, str]) -> Any:
    """Return a joint whose point on body i is shifted by two parameters."""
    xi, eta = _point(item)
    by = [sympy.Symbol(name) for name in names]
    return replace(item, point_i=(xi + by[0], eta + by[1]))


def with_values(
    model: Mechanism, values: Mapping[str, float], guess: Mapping[str, float]
) -> Mechanism:
    """Return a mechanism whose parameters have these defaults, and whose bodies are guessed here.

    Parameters without a value keep theirs, and so do bodies of which a coordinate is missing.
    """
    return changed(
        model,
        parameters=[_valued(item, values) for item in model.parameters],
        bodies=[_guessed(item, guess) for item in model.bodies],
    )


def _valued(item: Parameter, values: Mapping[str, float]) -> Parameter:
    """Return a parameter with another default, whose range is widened to have it."""
    if item.name not in values:
        return item
    value = values[item.name]
    limits: Any = item.range
    if limits is not None:
        limits = (min(limits[0], value), max(limits[1], value))
    return replace(item, default=value, range=limits)


def _guessed(body: Body, guess: Mapping[str, float]) -> Body:
    """Return a body with another guess."""
    if not set(body.coordinates) <= set(guess):
        return body
    return replace(body, guess=tuple(guess[name] for name in body.coordinates))

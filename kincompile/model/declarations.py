"""Bodies, parameters, coordinates and names as a user gives them: every problem is noted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any

import sympy

from kincompile.errors import ModelError
from kincompile.model.bodies import GROUND, Body, Coordinate, Parameter
from kincompile.model.constraint import CamConstraint, Constraint
from kincompile.model.equation import Equation
from kincompile.model.expressions import (
    NotAnExpressionError,
    as_expression,
    degrees_problem,
    number_in,
)
from kincompile.names import listed, name_problem, rate, unit_problem


def written_constraints(
    equations: Iterable[Any], problems: list[str]
) -> list[Constraint | Equation]:
    """Return the constraints as written; an expression is named by its place."""
    return [
        item if isinstance(item, Constraint | Equation) else Equation(f"equation_{k}", item)
        for k, item in enumerate(members(equations, "equations", problems), 1)
    ]


def checked_bodies(given: Iterable[Any], problems: list[str]) -> tuple[Body, ...]:
    """Return the valid bodies; report everything else as a problem."""
    found = members(given, "bodies", problems)
    problems += [
        f"{item!r} is not a body; make one with Mechanism.body"
        for item in found
        if not isinstance(item, Body)
    ]
    return tuple(item for item in found if isinstance(item, Body))


def members(given: Iterable[Any], what: str, problems: list[str]) -> list[Any]:
    """Return the members of a list, none where it is not one."""
    if not isinstance(given, str):
        with suppress(TypeError):
            return list(given)
    problems.append(f"the {what} {given!r} are not a list; write {what}=[...]")
    return []


def _name_of(item: Any) -> str:
    """Return the name of a symbol, of a function of time, or of itself."""
    if isinstance(item, sympy.Symbol):
        return str(item.name)
    return str(item.func.__name__) if isinstance(item, sympy.Function) else str(item)


def checked_number(
    given: Any, where: str, values: dict[str, float], problems: list[str], unit: str = ""
) -> float:
    """Return a finite number, angles in radians, from a number or an expression of parameters."""
    try:
        number = number_in(as_expression(given), unit, values)
    except NotAnExpressionError as error:
        problems.append(f"{where}: {error}; give a finite number")
        return 0.0
    problem = degrees_problem(given, unit)
    if problem:
        problems.append(f"{where}: {problem}")
    if number is None:
        problems.append(
            f"{where}: {given} is not a number at the default parameters; give a finite number"
        )
        return 0.0
    return number


def checked_parameters(
    given: Mapping[Any, float] | Iterable[Parameter], problems: list[str]
) -> tuple[Parameter, ...]:
    """Return the parameters, with their defaults and ranges as numbers."""
    if isinstance(given, Mapping):
        given = [Parameter(_name_of(key), value) for key, value in given.items()]
    checked = []
    for item in members(given, "parameters", problems):
        if not isinstance(item, Parameter):
            problems.append(
                f"{item!r} is not a parameter; give values by name: parameters={{'a': 1.0}}"
            )
            continue
        if not isinstance(item.name, str):
            problems.append(f"{name_problem(item.name, 'a parameter')}")
            continue
        default = item.default
        if default is None:
            problems.append(
                f"parameter {item.name!r} has no value; give a default: "
                f"parameter({item.name!r}, 1.0)"
            )
        else:
            unit = str(item.unit)
            default = checked_number(default, f"parameter {item.name!r}", {}, problems, unit)
        limits = _range(item, default, problems)
        checked.append(Parameter(item.name, default, item.unit, limits))
    return tuple(checked)


def _range(
    item: Parameter, default: float | None, problems: list[str]
) -> tuple[float, float] | None:
    """Return the least and the greatest value of a parameter as numbers, if it has them."""
    given, where = item.range, f"parameter {item.name!r}"
    if given is None or default is None:
        return None
    try:
        low, high = given
    except (TypeError, ValueError):
        problems.append(f"{where}: its range is {given!r}; give (least, greatest) value")
        return None
    low, high = (
        checked_number(end, f"{where}, range", {}, problems, str(item.unit)) for end in (low, high)
    )
    if not low < high:
        problems.append(
            f"{where}: its range goes from {low:g} to {high:g}; give the least value first"
        )
    elif not low <= default <= high:
        problems.append(
            f"{where}: its default {default:g} is outside its range from {low:g} to {high:g}"
        )
    return low, high


def body_coordinates(
    bodies: tuple[Body, ...], unit: str, values: dict[str, float], problems: list[str]
) -> list[Coordinate]:
    """Return the coordinates of the bodies, with their guesses as numbers."""
    found = []
    for body in bodies:
        problems += filter(None, [body.problem])
        try:
            guess = tuple(body.guess)
        except TypeError:
            guess = ()
        kind = body.kind
        if len(guess) != len(kind.letters):
            expected = ", ".join(kind.letters)
            problems.append(f"body {body.name!r}: the guess {body.guess!r} is not ({expected})")
            guess = kind.ground
        for name, value, own in zip(body.coordinates, guess, kind.units, strict=True):
            where, own_unit = f"guess of {name}", unit if own is None else own
            found.append(
                Coordinate(name, checked_number(value, where, values, problems, own_unit), own_unit)
            )
    return found


def check_outlines(bodies: tuple[Body, ...], values: dict[str, float], problems: list[str]) -> None:
    """Check that every outline is a list of corners, in space a list of such lists, or none."""
    for body in bodies:
        axes = _LOCAL[: len(body.kind.axes)]
        for label, corners in body.solids:
            _check_corners(corners, f"outline of {body.name}{label}", axes, values, problems)


_LOCAL = ("xi", "eta", "zeta")


def _check_corners(
    given: Any,
    where: str,
    axes: Sequence[str],
    values: dict[str, float],
    problems: list[str],
) -> None:
    components, least = f"({', '.join(axes)})", len(axes) + 1
    try:
        corners = [tuple(corner) for corner in given]
    except TypeError:
        problems.append(f"{where}: {given!r} is not a list of corners {components}")
        return
    if 0 < len(corners) < least:
        what = ("a polygon", "a solid")[len(axes) - 2]
        problems.append(f"{where}: it has {len(corners)} corners; {what} has {least} or more")
    for k, corner in enumerate(corners, 1):
        if len(corner) != len(axes):
            is_one = f"is not a pair {components}; give two numbers"
            is_one = is_one if len(axes) == 2 else f"is not {components}; give three numbers"
            problems.append(f"{where}: corner {k}, {corner!r}, {is_one}")
        for number in corner:
            checked_number(number, f"{where}, corner {k}", values, problems)


def free_coordinates(
    given: str | Iterable[Any],
    guess: Sequence[float] | Mapping[Any, float] | None,
    values: dict[str, float],
    problems: list[str],
) -> list[Coordinate]:
    """Return the coordinates that belong to no body."""
    if isinstance(given, str):
        given = given.replace(",", " ").split()
    names = [_name_of(item) for item in members(given, "coordinates", problems)]
    if guess is None:
        guess = [0.0] * len(names)
    if isinstance(guess, Mapping):
        by_name = {_name_of(key): value for key, value in guess.items()}
        unknown = sorted(set(by_name) - set(names))
        if unknown:
            problems.append(f"the guess names {listed(unknown)}; coordinates are: {listed(names)}")
        guess = [by_name.get(name, 0.0) for name in names]
    try:
        guess = list(guess)
    except TypeError:
        problems.append(f"the guess {guess!r} is not a list; give a value for each coordinate")
        guess = [0.0] * len(names)
    if len(guess) != len(names):
        problems.append(
            f"the guess has {len(guess)} values for {len(names)} coordinates ({listed(names)}); "
            "give one for each"
        )
        guess = [0.0] * len(names)
    return [
        Coordinate(name, checked_number(value, f"guess of {name}", values, problems))
        for name, value in zip(names, guess, strict=True)
    ]


def contact_coordinates(
    constraints: list[Constraint | Equation], values: dict[str, float], problems: list[str]
) -> list[Coordinate]:
    """Return the contact angles of cams."""
    found = []
    for item in constraints:
        if not isinstance(item, CamConstraint):
            continue
        names = item.contact_names
        guess: Sequence[Any] = (0.0,) * len(names)
        if item.guess is not None:
            guess = item.guess if isinstance(item.guess, tuple | list) else (item.guess,)
        if len(guess) != len(names):
            problems.append(
                f"{type(item).__name__} {item.name!r}: the guess has {len(guess)} values; give one "
                f"for each of {listed(names)}"
            )
            guess = (0.0,) * len(names)
        for name, value in zip(names, guess, strict=True):
            found.append(
                Coordinate(name, checked_number(value, f"guess of {name}", values, problems), "rad")
            )
    return found


def check_names(
    name: str,
    bodies: tuple[Body, ...],
    coordinates: list[Coordinate],
    parameters: tuple[Parameter, ...],
    constraints: list[Constraint | Equation],
    outputs: Sequence[str],
    problems: list[str],
) -> None:
    """Check that names and units are well formed, and that each name means one thing."""
    named = [("the system", name)]
    named += [("a body", body.name) for body in bodies]
    named += [("a parameter", item.name) for item in parameters]
    named += [("a coordinate", item.name) for item in coordinates]
    named += [("a constraint", item.name) for item in constraints]
    named += [("an output", name) for name in outputs]
    problems += [problem for what, text in named if (problem := name_problem(text, what))]
    if not all(isinstance(text, str) for _, text in named):
        raise ModelError(problems)  # further checks need names
    problems += [
        f"body {body.name!r}: this is the name of the fixed frame; use m.ground, or another name"
        for body in bodies
        if body.name == GROUND.name
    ]
    units = [(f"parameter {item.name!r}", item.unit) for item in parameters]
    units += [("lengths", item.unit) for item in coordinates]
    problems += [problem for what, unit in units if (problem := unit_problem(unit, what))]
    _check_unique("bodies", [body.name for body in bodies], problems)
    _check_unique("constraints", [item.name for item in constraints], problems)
    symbols = [item.name for item in parameters]
    if len({body.name for body in bodies}) == len(bodies):
        symbols += [item.name for item in coordinates]
        known = dict.fromkeys(item.name for item in coordinates)
        known |= dict.fromkeys(outputs)
        symbols += [rate(name, order) for name in known for order in (1, 2)]
    symbols += outputs
    kinds = "coordinates, outputs, rates" if outputs else "coordinates, rates"
    _check_unique(f"{kinds} and parameters", symbols, problems)


def _check_unique(what: str, names: list[Any], problems: list[str]) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            problems.append(f"{count} {what} are named {name!r}; give each a name of its own")

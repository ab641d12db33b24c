"""`ConstraintSystem`: coordinates, parameters and constraints as a checked, frozen value."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import chain
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.errors import ModelError
from kincompile.model.arguments import Kind
from kincompile.model.bodies import GROUND, Body, Coordinate, Parameter, body_columns
from kincompile.model.constraint import CamConstraint, Constraint, Element
from kincompile.model.equation import Equation
from kincompile.model.expressions import (
    NotAnExpressionError,
    Scalar,
    as_expression,
    degrees_problem,
    evaluate,
    number_in,
)
from kincompile.model.matrices import MatrixViews
from kincompile.model.outputs import (
    Output,
    ResolvedOutput,
    point_of,
    resolved_observers,
)
from kincompile.model.points import BodyPoint, PlacedPoint
from kincompile.model.resolve import FreeEquation, Joint, Scope, resolve_equation, resolve_joint
from kincompile.model.text_views import TextViews
from kincompile.names import listed, name_problem, rate, unit_problem

if TYPE_CHECKING:
    from kincompile.model.expressions import Scalars
    from kincompile.model.resolve_loads import AppliedLoad


class ConstraintSystem(MatrixViews, TextViews):
    """Constraint equations Phi(q, t) = 0, checked.

    Parameters
    ----------
    name
        Name of the system.
    coordinates
        Names of free coordinates, as one string or a sequence of strings, SymPy symbols or
        `dynamicsymbols`.
    equations
        SymPy expressions (each understood as ``expression = 0``), `Equation` or other constraints.
    parameters
        Default values by name, or a sequence of `Parameter`.
    guess
        Start values of the free coordinates for Newton's method, shape (n,), or by name.
    bodies
        Bodies, whose coordinates come first.
    outputs
        `Output` and `BodyPoint`, as `Mechanism.output` and `Mechanism.point` make them.
    loads
        Springs, forces and the like.
    gravity, length_unit, end, points
        As for `Mechanism`.

    Attributes
    ----------
    coordinates : tuple of Coordinate
        Those of each body in order, the free ones, then the contact parameters of cams: the
        columns of Phi_q.
    parameters : tuple of Parameter
        In the order of declaration: the entries of p.
    constraints : tuple of Joint or FreeEquation
        As written, with their arguments resolved: the rows of Phi_q.
    equations : tuple of str
        Names of the equations, in order.
    end : float
        The last time, at the default parameters; `end_given` is it as it was given.
    body_points : tuple of BodyPoint
        The named points.
    observers : tuple of PlacedPoint or ResolvedOutput
        The points, whose coordinates are outputs, then the other outputs, in order.
    loads : tuple of AppliedLoad
        The masses of bodies, then the loads in order.

    Raises
    ------
    ModelError
        If anything is wrong; every problem is listed.
    """

    __slots__ = (
        "bodies", "body_points", "constraints", "coordinates", "end", "end_given", "equations",
        "gravity", "length_unit", "loads", "name", "observers", "parameters", "points",
    )  # fmt: skip

    name: str
    bodies: tuple[Body, ...]
    coordinates: tuple[Coordinate, ...]
    parameters: tuple[Parameter, ...]
    constraints: tuple[Joint | FreeEquation, ...]
    equations: tuple[str, ...]
    body_points: tuple[BodyPoint, ...]
    observers: tuple[PlacedPoint | ResolvedOutput, ...]
    loads: tuple[AppliedLoad, ...]
    gravity: Scalars
    length_unit: str
    end: float
    end_given: Scalar
    points: int

    def __init__(
        self,
        name: str,
        coordinates: str | Iterable[Any] = (),
        equations: Iterable[Any] = (),
        *,
        parameters: Mapping[Any, float] | Iterable[Parameter] = (),
        guess: Sequence[float] | Mapping[Any, float] | None = None,
        bodies: Iterable[Body] = (),
        outputs: Iterable[BodyPoint | Output] = (),
        loads: Iterable[Element] = (),
        gravity: Scalars = (0, 0),
        length_unit: str = "m",
        end: Scalar = 1.0,
        points: int = 101,
    ) -> None:
        problems: list[str] = []
        bodies = _bodies(bodies, problems)
        written = _written(equations, problems)
        declared = _parameters(parameters, problems)
        defaults = {item.name: item.default for item in declared if item.default is not None}
        found = [
            *_body_coordinates(bodies, length_unit, defaults, problems),
            *_free_coordinates(coordinates, guess, defaults, problems),
            *_contact_coordinates(written, defaults, problems),
        ]
        _check_outlines(bodies, defaults, problems)
        last: Any = _number(end, "end", defaults, problems) if isinstance(end, sympy.Expr) else end
        wanted = _items(outputs, "outputs", problems)
        body_points = tuple(item for item in wanted if isinstance(item, BodyPoint))
        asked = [item for item in wanted if isinstance(item, Output)]
        named = [*chain(*(item.output_names for item in body_points)), *(x.name for x in asked)]
        _check_names(name, bodies, found, declared, written, named, problems)
        scope = _scope(bodies, found, declared, problems)
        constraints = _resolved(written, scope)
        observers = resolved_observers(body_points, asked, scope, length_unit)
        applied = _loads(bodies, _items(loads, "loads", problems), gravity, scope, written)
        if not written:
            problems.append(f"{name!r} has no constraints; add joints and drivers, or equations")
        if not found and not bodies:
            problems.append(f"{name!r} has no coordinates; add a body, or name coordinates")
        if problems:
            raise ModelError(list(dict.fromkeys(problems)))
        names = tuple(name for item in constraints for name in item.equation_names)
        values = {
            "name": name, "bodies": bodies, "coordinates": tuple(found), "parameters": declared,
            "constraints": constraints, "equations": names, "body_points": body_points,
            "observers": observers, "loads": applied, "gravity": gravity,
            "length_unit": length_unit, "end": last, "end_given": end, "points": points,
        }  # fmt: skip
        _fill(self, values)

    def __setattr__(self, key: str, value: object) -> None:
        raise AttributeError(f"a ConstraintSystem is frozen; make a new one to change {key!r}")

    def system(self) -> ConstraintSystem:
        """Return the system itself."""
        return self

    def observing(self, points: Sequence[BodyPoint]) -> ConstraintSystem:
        """Return the same system with these points as its outputs, no others, and no loads."""
        scope = _scope(self.bodies, self.coordinates, self.parameters, [])
        observers = resolved_observers(points, (), scope, self.length_unit)
        values = {key: getattr(self, key) for key in self.__slots__}
        other = ConstraintSystem.__new__(ConstraintSystem)
        _fill(other, {**values, "body_points": tuple(points), "observers": observers, "loads": ()})
        return other

    def joint_points(self) -> tuple[BodyPoint, ...]:
        """Return a point for each joint that has one: on body i, or on body j if i is the ground.

        Those whose coordinates would have the name of a body's are left out.
        """
        taken = {body.name for body in self.bodies}
        joints = (item for item in self.constraints if isinstance(item, Joint))
        found = (point_of(item) for item in joints if item.name not in taken)
        return tuple(item for item in found if item is not None)

    @property
    def outputs(self) -> tuple[Output, ...]:
        """The outputs in plain symbols, points first, with every rate written out."""
        return tuple(
            Output(row.name, expression, row.unit)
            for item in self.observers
            for row, expression in zip(item.rows, item.expressions, strict=True)
        )

    def drivers_at(
        self, t: float, p: Iterable[float]
    ) -> tuple[tuple[str, str, int, float, bool], ...]:
        """Return of each driver name, unit, row, value at t, and whether its row squares that."""
        names = [item.name for item in self.parameters]
        values = {"t": t, **{name: float(x) for name, x in zip(names, p, strict=True)}}
        found = []
        for item, row in zip(self.constraints, self.row_offsets, strict=True):
            if isinstance(item, Joint) and item.is_driver:
                (given,) = (x for x in item.written.arguments().values() if x.symbol == "C")
                unit = "rad" if given.unit == "rad" else self.length_unit
                value = evaluate(item.scalars["C"], values)
                if value is not None:
                    found.append((item.name, unit, row, value, given.kind is Kind.DISTANCE))
        return tuple(found)

    @property
    def row_offsets(self) -> tuple[int, ...]:
        """First row of each constraint, from 0: the exclusive prefix scan of equation counts."""
        offsets, total = [], 0
        for item in self.constraints:
            offsets.append(total)
            total += len(item.equation_names)
        return tuple(offsets)

    @property
    def body_columns(self) -> tuple[range, ...]:
        """Columns of each body's coordinates."""
        return body_columns(self.bodies)

    def __repr__(self) -> str:
        """Return name and sizes."""
        sizes = f"{len(self.coordinates)} coordinates, {len(self.equations)} equations"
        return f"<ConstraintSystem {self.name!r}: {sizes}>"


def _loads(
    bodies: Iterable[Body],
    loads: Sequence[Any],
    gravity: Scalars,
    scope: Scope,
    constraints: Iterable[Constraint | Equation],
) -> tuple[AppliedLoad, ...]:
    """Return the masses and the loads, for which a model without any loads nothing."""
    if not loads and not any(body.is_heavy for body in bodies):
        return ()
    from kincompile.model.resolve_loads import check_named, resolved_loads

    check_named(loads, (item.name for item in constraints), scope.problems)
    return resolved_loads(bodies, loads, gravity, scope)


def _fill(system: ConstraintSystem, values: Mapping[str, Any]) -> None:
    """Set the attributes of a system, once."""
    for key, value in values.items():
        object.__setattr__(system, key, value)


def _scope(
    bodies: Iterable[Body],
    coordinates: Iterable[Coordinate],
    parameters: Iterable[Parameter],
    problems: list[str],
) -> Scope:
    """Return the names that may be used in a system."""
    return Scope(
        {body.name: body for body in bodies},
        [item.name for item in coordinates],
        {item.name: item for item in parameters},
        problems,
    )


def _resolved(
    written: list[Constraint | Equation], scope: Scope
) -> tuple[Joint | FreeEquation, ...]:
    """Return the valid constraints, resolved."""
    found = (
        resolve_equation(item, scope) if isinstance(item, Equation) else resolve_joint(item, scope)
        for item in written
    )
    return tuple(item for item in found if item is not None)


def _written(equations: Iterable[Any], problems: list[str]) -> list[Constraint | Equation]:
    """Return the constraints as written; an expression is named by its place."""
    return [
        item if isinstance(item, Constraint | Equation) else Equation(f"equation_{k}", item)
        for k, item in enumerate(_items(equations, "equations", problems), 1)
    ]


def _bodies(given: Iterable[Any], problems: list[str]) -> tuple[Body, ...]:
    """Return the valid bodies; report everything else as a problem."""
    found = _items(given, "bodies", problems)
    problems += [
        f"{item!r} is not a body; make one with Mechanism.body"
        for item in found
        if not isinstance(item, Body)
    ]
    return tuple(item for item in found if isinstance(item, Body))


def _items(given: Iterable[Any], what: str, problems: list[str]) -> list[Any]:
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


def _number(
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


def _parameters(
    given: Mapping[Any, float] | Iterable[Parameter], problems: list[str]
) -> tuple[Parameter, ...]:
    if isinstance(given, Mapping):
        given = [Parameter(_name_of(key), value) for key, value in given.items()]
    checked = []
    for item in _items(given, "parameters", problems):
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
            default = _number(default, f"parameter {item.name!r}", {}, problems, unit)
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
        _number(end, f"{where}, range", {}, problems, str(item.unit)) for end in (low, high)
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


def _body_coordinates(
    bodies: tuple[Body, ...], unit: str, values: dict[str, float], problems: list[str]
) -> list[Coordinate]:
    found = []
    for body in bodies:
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
                Coordinate(name, _number(value, where, values, problems, own_unit), own_unit)
            )
    return found


def _check_outlines(
    bodies: tuple[Body, ...], values: dict[str, float], problems: list[str]
) -> None:
    """Check that every outline is a list of corners, or none."""
    for body in bodies:
        where = f"outline of {body.name}"
        try:
            corners = [tuple(corner) for corner in body.outline]
        except TypeError:
            problems.append(f"{where}: {body.outline!r} is not a list of corners (xi, eta)")
            continue
        if len(corners) in (1, 2):
            problems.append(f"{where}: it has {len(corners)} corners; a polygon has 3 or more")
        for k, corner in enumerate(corners, 1):
            if len(corner) != 2:
                problems.append(
                    f"{where}: corner {k}, {corner!r}, is not a pair (xi, eta); give two numbers"
                )
            for number in corner:
                _number(number, f"{where}, corner {k}", values, problems)


def _free_coordinates(
    given: str | Iterable[Any],
    guess: Sequence[float] | Mapping[Any, float] | None,
    values: dict[str, float],
    problems: list[str],
) -> list[Coordinate]:
    if isinstance(given, str):
        given = given.replace(",", " ").split()
    names = [_name_of(item) for item in _items(given, "coordinates", problems)]
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
        Coordinate(name, _number(value, f"guess of {name}", values, problems))
        for name, value in zip(names, guess, strict=True)
    ]


def _contact_coordinates(
    constraints: list[Constraint | Equation], values: dict[str, float], problems: list[str]
) -> list[Coordinate]:
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
                Coordinate(name, _number(value, f"guess of {name}", values, problems), "rad")
            )
    return found


def _check_names(
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

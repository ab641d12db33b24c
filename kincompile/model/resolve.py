"""From constraints as written to constraints that are known to be good.

Every problem is collected, none is raised.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from numbers import Real
from typing import TYPE_CHECKING, Any, cast

import sympy

from kincompile.model.arguments import Kind
from kincompile.model.bodies import Body
from kincompile.model.expressions import (
    Scalar,
    alpha,
    as_sympy,
    depends_on,
    evaluate,
    symbol_names,
)
from kincompile.model.scope import (
    Point,
    Scope,
    body_named,
    checked_attribute,
    checked_expression,
    checked_point,
    named_tables,
)
from kincompile.model.spline import PeriodicSpline, fit
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from kincompile.calculus.template import Template
    from kincompile.model.arguments import Argument
    from kincompile.model.constraint import Constraint, Element
    from kincompile.model.equation import Equation


@dataclass(frozen=True, slots=True)
class Joint:
    """A constraint of a known type with its attributes resolved."""

    written: Constraint
    template: Template
    bodies: tuple[Body, ...]
    # scalars, points, profiles: attributes by their symbol in the template. The value C(t) is among
    # the scalars; a profile is an expression of `alpha`.
    scalars: Mapping[str, Scalar]
    points: Mapping[str, Point]
    profiles: Mapping[str, sympy.Expr]
    # Names of the coordinates in the order of the template, None for those of the ground.
    columns: tuple[str | None, ...]

    @property
    def name(self) -> str:
        """Name of the constraint."""
        return self.written.name

    @property
    def type_name(self) -> str:
        """Name of its type."""
        return type(self.written).__name__

    @property
    def equation_names(self) -> tuple[str, ...]:
        """Names of its rows."""
        return self.written.equation_names

    @property
    def source(self) -> str:
        """Where the textbook has it."""
        return self.written.source

    @property
    def text(self) -> str:
        """The constraint in words, for comments: bodies, points, values."""
        return text_of(self.written)

    @property
    def corners(self) -> bool:
        """Whether the slope of its value may jump."""
        return self.written.corners

    @property
    def has_value(self) -> bool:
        """Whether it has a value C(t) of its own."""
        return any(item.symbol == "C" for item in self.written.arguments().values())

    @property
    def is_driver(self) -> bool:
        """Whether its value is a function of time, or an angle or a stroke given by parameters."""
        names = symbol_names(self.scalars["C"]) if self.has_value else ()
        return "t" in names or (self.written.sets_motion and bool(names))


SPIN = "spin of "
"""How the freedom of a body in space to turn begins, before its name."""


@dataclass(frozen=True, slots=True)
class FreeEquation:
    """A free equation in plain symbols, with the coordinates that occur in it."""

    name: str
    expressions: tuple[sympy.Expr, ...]
    columns: tuple[str, ...]
    equation_names: tuple[str, ...]
    source: str = "free equation"
    corners: bool = False
    # What it holds because nothing sees it, as "spin of rod"; "" where somebody wrote it.
    holds: str = ""

    @property
    def spinning(self) -> str:
        """Name of the body whose spin it holds, which nothing sees; "" where it holds none."""
        return self.holds.removeprefix(SPIN) if self.holds.startswith(SPIN) else ""

    @property
    def bodies(self) -> tuple[Body, ...]:
        """A free equation names coordinates, not bodies."""
        return ()

    @property
    def text(self) -> str:
        """The equation in words, for comments."""
        said = f"{held_text(self.holds)}: " if self.holds else ""
        return said + "; ".join(f"{expression} = 0" for expression in self.expressions)

    @property
    def is_driver(self) -> bool:
        """Whether it depends on time."""
        return any(depends_on(expression, ("t",)) for expression in self.expressions)


def held_text(freedom: str) -> str:
    """Return that a freedom is held: ``"spin of rod"``, or the name of a coordinate."""
    spins = freedom.startswith(SPIN)
    body = freedom.removeprefix(SPIN)
    may = f"{body} may spin about its own axis" if spins else f"{freedom} may change"
    return f"{may}; nothing sees it, so it is held"


def resolve_equation(equation: Equation, scope: Scope) -> FreeEquation | None:
    """Check a free equation against the names that exist."""
    before = len(scope.problems)
    if not equation.expressions:
        scope.problems.append(f"Equation {equation.name!r} has no expression; give at least one")
    corners = _corners(equation.corners, f"Equation {equation.name!r}", scope)
    expressions = []
    for name, given in zip(equation.equation_names, equation.expressions, strict=True):
        where = f"equation {name!r}"
        value = checked_expression(given, where, scope.declared, scope, corners=corners)
        if value is not None and not depends_on(value, scope.coordinate_names):
            scope.problems.append(
                f"{where} contains no coordinate, so it cannot constrain anything; coordinates "
                f"are: {listed(scope.coordinates)}"
            )
        expressions.append(named_tables(as_sympy(0 if value is None else value), name))
    if len(scope.problems) > before:
        return None
    occurring = set().union(*(symbol_names(expression) for expression in expressions))
    columns = tuple(sorted(occurring & scope.places.keys(), key=scope.places.__getitem__))
    return FreeEquation(
        equation.name,
        tuple(expressions),
        columns,
        equation.equation_names,
        corners=corners,
    )


def resolve_joint(constraint: Constraint, scope: Scope) -> Joint | None:
    """Check the arguments of a constraint of a known type."""
    before = len(scope.problems)
    bodies: list[Body | None] = []
    scalars: dict[str, Scalar] = {}
    points: dict[str, Point] = {}
    profiles: dict[str, sympy.Expr] = {}
    title = title_of(constraint)
    if problem := kind_problem(constraint, scope):
        scope.problems.append(f"{title}: {problem}")
        return None
    corners = _corners(constraint.corners, title, scope)
    for name, item in constraint.arguments().items():
        given, where = getattr(constraint, name), f"{title}, {name}"
        if item.kind is Kind.BODY:
            bodies.append(body_named(given, where, scope))
        elif item.kind in (Kind.POINT, Kind.AXIS):
            points[item.symbol] = checked_point(given, item.kind, where, scope)
        elif item.kind is Kind.PROFILE:
            table_name = f"{item.symbol}_{constraint.name}"
            profiles[item.symbol] = _profile(given, table_name, where, scope)
        else:
            value = _scalar(given, item, where, scope, corners=corners)
            scalars[item.symbol] = named_tables(value, constraint.name)
    if "C" not in scalars and corners:
        scope.problems.append(
            f"{title}: it drives nothing, so it has no corners; leave corners out"
        )
    known = [body for body in bodies if body is not None]
    if len(known) == len(bodies):
        check_bodies(constraint, known, scope)
    check_whole(constraint, scalars, points, scope)
    if len(scope.problems) > before:
        return None
    if problem := constraint.misplaced(known, points, scope.defaults):
        scope.problems.append(f"{title}: {problem}")
        return None
    return Joint(
        constraint,
        constraint.template(),
        tuple(known),
        scalars,
        constraint.completed(points, scope.defaults),
        profiles,
        (*(name for body in known for name in scope.columns[body.name]), *constraint.contact_names),
    )


def beside_drivers(
    resolved: Sequence[Joint | FreeEquation],
) -> tuple[Joint | FreeEquation, ...]:
    """Return joints and equations, each joint as it holds beside the driver of its angle."""
    joints = [item for item in resolved if isinstance(item, Joint)]
    kinds = {item.written.driven_by for item in joints} - {None}
    drivers = [item for item in joints if type(item.written) in kinds]
    by_bodies: dict[tuple[str, ...], list[Joint]] = {}
    for item in drivers:
        by_bodies.setdefault(_pair(item), []).append(item)
    return tuple(
        _beside(item, by_bodies.get(_pair(item), ())) if isinstance(item, Joint) else item
        for item in resolved
    )


def _pair(joint: Joint) -> tuple[str, ...]:
    return tuple(body.name for body in joint.bodies)


def _beside(joint: Joint, drivers: Iterable[Joint]) -> Joint:
    for item in drivers:
        driven = type(item.written) is joint.written.driven_by
        if driven and item.points.items() <= joint.points.items():
            scalars = {**joint.scalars, "C": item.scalars["C"]}
            return replace(joint, template=joint.written.driven_template(), scalars=scalars)
    return joint


_WHERE = {2: "in the plane", 3: "in space"}


def kind_problem(constraint: Element, scope: Scope) -> str | None:
    """Return a message about a constraint or a load of another kind of bodies, or None."""
    kind = scope.ground.kind
    if constraint.bodies is kind:
        return None
    name, what = type(constraint).__name__, "load" if constraint.is_load else "constraint"
    given, own = _WHERE[len(constraint.bodies.axes)], _WHERE[len(kind.axes)]
    found = kind.elsewhere.get(name)
    if found is None and len(kind.axes) == 2 and name in constraint.bodies.elsewhere:
        found = f"kincompile.{name}"
    remedy = f"take {found}" if found else "it has none like it there"
    return f"it is a {what} of bodies {given}, and those of this mechanism are {own}; {remedy}"


def title_of(constraint: Element) -> str:
    """Return the type and the name of a constraint or a load, for messages."""
    return f"{type(constraint).__name__} {constraint.name!r}"


def _corners(given: Any, title: str, scope: Scope) -> bool:
    if not isinstance(given, bool):
        scope.problems.append(f"{title}, corners: {given!r} is neither True nor False")
    return given is True


def check_bodies(constraint: Element, bodies: list[Body], scope: Scope) -> None:
    """Check that a joint or a load has something to act on."""
    what = title_of(constraint)
    if len(bodies) == 2 and bodies[0] == bodies[1]:
        kind = "load between two bodies needs" if constraint.is_load else "joint connects"
        scope.problems.append(
            f"{what}: bodies i and j are both {bodies[0].name!r}; a {kind} two different bodies"
        )
    elif len(bodies) == 1 and bodies[0].is_ground:
        done = "feels no force" if constraint.is_load else "cannot be constrained"
        scope.problems.append(f"{what}: the ground {done}; name a body of the mechanism")


def _scalar(given: Any, item: Argument, where: str, scope: Scope, *, corners: bool) -> Scalar:
    kind, unit = item.kind, item.unit
    if kind in (Kind.SCALAR, Kind.RADIUS):
        value = checked_attribute(given, where, scope, unit)
        if kind is Kind.RADIUS and evaluate(value, scope.defaults) == 0:
            scope.problems.append(
                f"{where}: the radius is zero; give the pitch radius "
                "(negative for an internal gear)"
                if item.symbol.startswith("R")
                else f"{where}: it is zero; give a length, negative for the other hand"
            )
        return value
    declared = scope.declared
    value_or_none = checked_expression(given, where, declared, scope, unit=unit, corners=corners)
    if value_or_none is None:
        return 1
    coordinates = sorted(symbol_names(value_or_none) & scope.coordinate_names)
    if coordinates:
        scope.problems.append(
            f"{where}: the value {value_or_none} depends on {listed(coordinates)}; a driver is a "
            "function of t and parameters only; write a coordinate-dependent condition as an "
            "Equation"
        )
        return 1
    number = evaluate(value_or_none, scope.defaults)
    if kind is Kind.DISTANCE and number is not None and number <= 0:
        scope.problems.append(
            f"{where}: the distance is {number:g}, but must be positive: at distance 0 the "
            "Jacobian row 2 d^T [I, B s] vanishes; to make the two points coincide use a Revolute "
            "(or AbsoluteX and AbsoluteY)"
        )
    return value_or_none


def _profile(given: Any, table_name: str, where: str, scope: Scope) -> sympy.Expr:
    """Return rho as an expression of alpha: from an expression, a function, or a table."""
    if isinstance(given, sympy.Lambda) or (callable(given) and not isinstance(given, sympy.Basic)):
        try:
            given = given(alpha)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            scope.problems.append(
                f"{where}: the function cannot be called with the symbol alpha ({error}); write "
                "it as rho(alpha) with SymPy's functions, sympy.cos instead of math.cos"
            )
            return sympy.S.One
    elif isinstance(given, tuple | list) and len(given) == 2:
        try:
            given = PeriodicSpline.of(table_name, fit(*given))(alpha)
        except (TypeError, ValueError) as error:
            scope.problems.append(f"{where}: {error}")
            return sympy.S.One
    if isinstance(given, sympy.Expr):
        given = _of_alpha(given, scope)
    elif not isinstance(given, Real):
        scope.problems.append(
            f"{where}: {given!r} is neither a radius rho(alpha) nor a table (angles, radii); "
            "give an expression of kc.alpha, or two lists of equal length"
        )
        return sympy.S.One
    value = checked_expression(given, where, {*scope.parameters, alpha.name}, scope, unit="length")
    rho: sympy.Expr = as_sympy(1 if value is None else value)
    return rho


def _of_alpha(rho: sympy.Expr, scope: Scope) -> sympy.Expr:
    """Return a radius as a function of alpha, whatever its one free symbol is called."""
    others = symbol_names(rho) - set(scope.parameters)
    if len(others) != 1 or not others.isdisjoint(scope.declared):
        return rho
    named = {symbol: alpha for symbol in rho.free_symbols if str(symbol) in others}
    return cast("sympy.Expr", rho.xreplace(named))


def check_whole(
    constraint: Element, scalars: Mapping[str, Scalar], points: Mapping[str, Point], scope: Scope
) -> None:
    """Check what involves several arguments of a constraint or a load."""

    def numbers(symbol: str) -> tuple[float | None, ...]:
        given = points[symbol] if symbol in points else (scalars[symbol],)
        return tuple(evaluate(value, scope.defaults) for value in given)

    problem = constraint.problem(numbers)
    if problem is not None:
        scope.problems.append(f"{title_of(constraint)}: {problem}")


def text_of(constraint: Element) -> str:
    """Return arguments in a line, for instance `ground (0, 0) - crank (-a/2, 0)`."""
    parts: list[str] = []
    for name, item in constraint.arguments().items():
        given = getattr(constraint, name)
        if item.kind is Kind.BODY:
            body = given.name if isinstance(given, Body) else given
            parts.append(f"- {body}" if parts else body)
        elif item.kind in (Kind.POINT, Kind.AXIS):
            text = f"({', '.join(map(_component, given))})"
            parts.append(text if item.kind is Kind.POINT else f"axis {text}")
        elif item.kind is Kind.PROFILE:
            parts.append("profile table" if isinstance(given, tuple | list) else "profile")
        elif item.kind is Kind.LOADS:
            parts.append(f"({', '.join(map(str, given))})")
        elif not constraint.is_load or given != 0:  # most springs have no damper
            parts.append(f"{name} {given}")
    return " ".join(parts)


def _component(given: Scalar) -> str:
    """Return a component of a point; SymPy would fill up a float with zeros."""
    return str(float(given) if isinstance(given, sympy.Float) else given)

"""From loads as written to loads that are known to be good, the masses of bodies among them.

Every problem is collected, none is raised.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from itertools import chain
from typing import TYPE_CHECKING, Any, ClassVar

import sympy

from kincompile.derive.loads import derive_load
from kincompile.model.arguments import Kind
from kincompile.model.dimensions import scaled, unit_problems
from kincompile.model.expressions import as_sympy, symbol_names
from kincompile.model.load import Load
from kincompile.model.outputs import Output, ResolvedOutput, highest_rate
from kincompile.model.resolve import (
    check_bodies,
    check_whole,
    kind_problem,
    text_of,
    title_of,
)
from kincompile.model.scope import (
    body_named,
    checked_attribute,
    checked_expression,
    checked_point,
    named_tables,
)
from kincompile.names import listed, name_problem, newtons

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from kincompile.calculus.expressions import Scalar as Expression
    from kincompile.derive.loads import LoadTemplate
    from kincompile.model.bodies import Body
    from kincompile.model.expressions import Scalar
    from kincompile.model.scope import Point, Scope


@dataclass(frozen=True, slots=True)
class AppliedLoad:
    """A load with its attributes resolved."""

    written: Load
    template: LoadTemplate
    bodies: tuple[Body, ...]
    # scalars, points: attributes and values by their symbol in the template, in plain symbols.
    scalars: Mapping[str, Scalar]
    points: Mapping[str, Point]
    # Names of the coordinates of the bodies, None for those of the ground, then of the others on
    # which its values depend.
    columns: tuple[str | None, ...]
    varies: bool  # whether its values depend on coordinates or rates

    profiles: ClassVar[Mapping[str, sympy.Expr]] = {}
    is_driver: ClassVar[bool] = False
    corners: ClassVar[bool] = False

    @property
    def name(self) -> str:
        """Name of the load; of the mass of a body, that of the body."""
        return self.written.name

    @property
    def source(self) -> str:
        """Where the textbook has it."""
        return self.written.source

    @property
    def text(self) -> str:
        """The load in words, for comments."""
        return text_of(self.written)

    def values(self) -> tuple[Scalar, ...]:
        """Return the forces and attributes."""
        return *self.scalars.values(), *chain(*self.points.values())

    def by_symbol(self) -> dict[str, tuple[Scalar, ...]]:
        """Return the forces and attributes by their symbol, points as their components."""
        return {name: (value,) for name, value in self.scalars.items()} | dict(self.points)

    def times(self, factor: float) -> AppliedLoad:
        """Return the mass of a body in newtons: with mass and inertias times a factor."""
        scalars = {name: scaled(x, factor, name) for name, x in self.scalars.items()}
        points = {
            name: tuple(scaled(x, factor, name) for x in point)
            for name, point in self.points.items()
        }
        return replace(self, scalars=scalars, points=points)

    def entries(self, quantity: str) -> Iterator[tuple[int, int, Expression]]:
        """Yield row, column and formula of the entries of M or of Q that it adds to."""
        derived = derive_load(self.template, self.others, varies=self.varies)
        if quantity == "Q":
            yield from ((row, 0, force) for row, force in enumerate(derived.Q))
            return
        for row, entries in enumerate(derived.M):
            yield from ((row, column, entry) for column, entry in enumerate(entries))

    @property
    def others(self) -> int:
        """How many coordinates of other bodies its values depend on."""
        return len(self.columns) - sum(item.size for item in self.template.coordinates)


def resolved_loads(
    bodies: Iterable[Body],
    loads: Sequence[Any],
    gravity: Any,
    scope: Scope,
    length_unit: str,
    mass_unit: str,
) -> tuple[AppliedLoad, ...]:
    """Return the masses of bodies, then the loads, as far as they are good."""
    masses = (
        import_module(body.kind.masses).mass_of(body, gravity, scope)
        for body in bodies
        if body.is_heavy
    )
    heavy = _known((item for item in masses if item is not None), scope)
    known = (*heavy, *_known(loads, scope))
    units = {name: parameter.unit for name, parameter in scope.parameters.items()}
    values = ((item.written, item.by_symbol()) for item in known)
    wrong = [*unit_problems(values, units, length_unit, mass_unit)]
    scope.problems += wrong
    factor = 1.0 if wrong else newtons(mass_unit, length_unit)
    if factor == 1:
        return known
    return (*(item.times(factor) for item in heavy), *known[len(heavy) :])


def _known(loads: Iterable[Any], scope: Scope) -> tuple[AppliedLoad, ...]:
    found = (_resolved(item, scope) for item in loads)
    return tuple(item for item in found if item is not None)


def _resolved(load: Any, scope: Scope) -> AppliedLoad | None:
    if not isinstance(load, Load):
        scope.problems.append(f"{load!r} is not a load; make one with kc.Force or kc.Spring")
        return None
    before, title = len(scope.problems), title_of(load)
    if problem := kind_problem(load, scope):
        scope.problems.append(f"{title}: {problem}")
        return None
    bodies: list[Body | None] = []
    scalars: dict[str, Scalar] = {}
    points: dict[str, Point] = {}
    occurring: set[str] = set()
    for name, item in load.arguments().items():
        given, where = getattr(load, name), f"{title}, {name}"
        match item.kind:
            case Kind.BODY:
                bodies.append(body_named(given, where, scope))
            case Kind.POINT | Kind.AXIS:
                points[item.symbol] = checked_point(given, item.kind, where, scope)
            case Kind.LOAD:
                scalars[item.symbol] = _value(given, where, load.name, occurring, scope)
            case Kind.LOADS:
                points[item.symbol] = _values(given, where, load.name, occurring, scope)
            case _:
                scalars[item.symbol] = checked_attribute(given, where, scope, item.unit)
    known = [body for body in bodies if body is not None]
    if len(known) == len(bodies):
        check_bodies(load, known, scope)
    if len(scope.problems) == before:
        check_whole(load, scalars, points, scope)
    if len(scope.problems) > before:
        return None
    own = tuple(name for body in known for name in scope.columns[body.name])
    others = sorted(occurring.difference(own), key=scope.places.__getitem__)
    columns = (*own, *others)
    points = dict(load.completed(points, scope.defaults))
    return AppliedLoad(
        load, load.template(), tuple(known), scalars, points, columns, bool(occurring)
    )


def _value(given: Any, where: str, name: str, occurring: set[str], scope: Scope) -> Scalar:
    """Return a force in plain symbols, and note the coordinates on which it depends."""
    declared = scope.declared | scope.motion.keys()
    value = checked_expression(given, where, declared, scope, corners=True, is_output=True)
    if not isinstance(value, sympy.Expr):
        return 0 if value is None else value
    if highest_rate(value, where, scope) > 1:
        scope.problems.append(
            f"{where}: a force cannot depend on accelerations, as {value} does; write it "
            "with coordinates and rates, or model added mass as mass of a body"
        )
        return 0
    names = sorted(symbol_names(value) & scope.motion.keys())
    found = {scope.motion[item][0] for item in names}
    occurring |= found
    columns = tuple(sorted(found, key=scope.places.__getitem__))
    written = Output(name, value)
    (plain,) = ResolvedOutput(name, as_sympy(value), "", columns, written).expressions
    named: Scalar = named_tables(plain, name)
    return named


def _values(given: Any, where: str, name: str, occurring: set[str], scope: Scope) -> Point:
    try:
        components = tuple(given)
    except TypeError:
        components = ()
    size = len(scope.ground.kind.axes)
    if len(components) != size or isinstance(given, str):
        scope.problems.append(
            f"{where}: {given!r} is not a force of {size} components; give {size} numbers or "
            "expressions"
        )
        return (0,) * size
    return tuple(_value(item, where, name, occurring, scope) for item in components)


def check_named(loads: Sequence[Any], taken: Iterable[str], problems: list[str]) -> None:
    """Check that every load has a name of its own, other than those of constraints."""
    known = set(taken)
    for name in (item.name for item in loads if isinstance(item, Load)):
        if problem := name_problem(name, "a load"):
            problems.append(problem)
        elif name in known:
            problems.append(
                f"the load {name!r} has the name of another load or a constraint; give each a name "
                f"of its own, not one of {listed(sorted(known))}"
            )
        known.add(name)

"""`ConstraintSystem`: coordinates, parameters and constraints as a checked, frozen value."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import sympy

from kincompile.errors import ModelError
from kincompile.model.arguments import Kind
from kincompile.model.bodies import GROUND, Body, Coordinate, Parameter, body_columns
from kincompile.model.declarations import (
    body_coordinates,
    check_names,
    check_outlines,
    checked_bodies,
    checked_number,
    checked_parameters,
    contact_coordinates,
    free_coordinates,
    members,
    written_constraints,
)
from kincompile.model.equation import Equation
from kincompile.model.expressions import (
    Scalar,
    evaluate,
)
from kincompile.model.limits import JointLimit, check_limits
from kincompile.model.matrices import MatrixViews
from kincompile.model.outputs import (
    Output,
    ResolvedOutput,
    point_of,
    resolved_observers,
)
from kincompile.model.points import BodyPoint, PlacedPoint
from kincompile.model.resolve import (
    FreeEquation,
    Joint,
    beside_drivers,
    resolve_equation,
    resolve_joint,
)
from kincompile.model.scope import Scope
from kincompile.model.text_views import TextViews

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence
    from types import ModuleType

    from kincompile.model.constraint import Constraint, Element
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
    ground
        The fixed frame of the bodies.
    gravity, length_unit, mass_unit, end, points, tasks, links, limits
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
        "gravity", "ground", "length_unit", "limits", "links", "loads", "mass_unit", "name",
        "observers", "parameters", "points", "tasks",
    )  # fmt: skip

    name: str
    bodies: tuple[Body, ...]
    coordinates: tuple[Coordinate, ...]
    parameters: tuple[Parameter, ...]
    constraints: tuple[Joint | FreeEquation, ...]
    equations: tuple[str, ...]
    ground: Body
    body_points: tuple[BodyPoint, ...]
    observers: tuple[PlacedPoint | ResolvedOutput, ...]
    loads: tuple[AppliedLoad, ...]
    gravity: Scalars
    length_unit: str
    mass_unit: str
    end: float
    end_given: Scalar
    points: int
    tasks: Mapping[str, Any]
    limits: tuple[JointLimit, ...]
    links: Mapping[str, tuple[str, Any]]

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
        ground: Body = GROUND,
        length_unit: str = "m",
        mass_unit: str = "kg",
        end: Scalar = 1.0,
        points: int = 101,
        tasks: Mapping[str, Any] | None = None,
        links: Mapping[str, tuple[str, Any]] | None = None,
        limits: Sequence[JointLimit] = (),
    ) -> None:
        problems: list[str] = []
        bodies = checked_bodies(bodies, problems)
        written = written_constraints(equations, problems)
        declared = checked_parameters(parameters, problems)
        defaults = {item.name: item.default for item in declared if item.default is not None}
        found = [
            *body_coordinates(bodies, length_unit, defaults, problems),
            *free_coordinates(coordinates, guess, defaults, problems),
            *contact_coordinates(written, defaults, problems),
        ]
        check_outlines((ground, *bodies), defaults, problems)
        last: Any = (
            checked_number(end, "end", defaults, problems) if isinstance(end, sympy.Expr) else end
        )
        wanted = members(outputs, "outputs", problems)
        body_points = tuple(item for item in wanted if isinstance(item, BodyPoint))
        asked = [item for item in wanted if isinstance(item, Output)]
        named = [*chain(*(item.output_names for item in body_points)), *(x.name for x in asked)]
        check_names(name, bodies, found, declared, written, named, problems)
        scope = _scope(bodies, found, declared, problems, ground)
        constraints = _resolved(written, scope)
        check_limits(limits, [item.name for item in written], constraints, scope)
        observers = resolved_observers(body_points, asked, scope, length_unit)
        given = members(loads, "loads", problems)
        applied = _loads(bodies, given, gravity, scope, written, (length_unit, mass_unit))
        if not written and not applied:
            problems.append(f"{name!r} has no constraints; add joints and drivers, or equations")
        if not found and not bodies:
            problems.append(f"{name!r} has no coordinates; add a body, or name coordinates")
        if problems:
            raise ModelError(list(dict.fromkeys(problems)))
        names = tuple(name for item in constraints for name in item.equation_names)
        values = {
            "name": name, "bodies": bodies, "coordinates": tuple(found), "parameters": declared,
            "constraints": constraints, "equations": names, "body_points": body_points,
            "observers": observers, "loads": applied, "gravity": gravity, "ground": ground,
            "length_unit": length_unit, "mass_unit": mass_unit, "end": last, "end_given": end,
            "points": points, "tasks": tasks or {}, "links": links or {}, "limits": tuple(limits),
        }  # fmt: skip
        _fill(self, values)

    def __setattr__(self, key: str, value: object) -> None:
        raise AttributeError(f"a ConstraintSystem is frozen; make a new one to change {key!r}")

    def system(self) -> ConstraintSystem:
        """Return the system itself."""
        return self

    def observing(self, points: Sequence[BodyPoint], *, spinning: bool = True) -> ConstraintSystem:
        """Return the system with these points, and how bodies spin, as outputs, and no loads."""
        scope = _scope(self.bodies, self.coordinates, self.parameters, [], self.ground)
        turning = self.bodies if spinning else ()
        spins = [Output(*given) for body in turning for given in body.on_request]
        observers = resolved_observers(points, spins, scope, self.length_unit)
        return self._with({"body_points": tuple(points), "observers": observers, "loads": ()})

    def rewritten(
        self,
        constraints: Sequence[Joint | FreeEquation],
        more: Sequence[Constraint | Equation],
        parameters: Sequence[Parameter] | None = None,
        outputs: Sequence[Output] = (),
    ) -> ConstraintSystem:
        """Return the system with these constraints and more of them, and with more outputs.

        It has no loads, and other parameters where these are given.

        Raises
        ------
        ModelError
            If one of those that come new cannot be used as written.
        """
        every = self.parameters if parameters is None else tuple(parameters)
        scope = _scope(self.bodies, self.coordinates, every, [], self.ground)
        found = beside_drivers([*constraints, *_resolved(list(more), scope)])
        seen = resolved_observers((), outputs, scope, self.length_unit)
        if scope.problems:
            raise ModelError(scope.problems)
        names = tuple(name for item in found for name in item.equation_names)
        changed = {
            "constraints": found, "equations": names, "parameters": every, "loads": (),
            "observers": (*self.observers, *seen),
        }  # fmt: skip
        return self._with(changed)

    def about(self, bodies: Collection[str]) -> ConstraintSystem:
        """Return the system with the constraints of some bodies alone, and without outputs."""
        own = {x for body in self.bodies if body.name in bodies for x in body.coordinates}
        found = tuple(item for item in self.constraints if own.intersection(item.columns))
        names = tuple(name for item in found for name in item.equation_names)
        changed = {
            "constraints": found, "equations": names, "loads": (),
            "observers": (), "body_points": (),
        }  # fmt: skip
        return self._with(changed)

    def holding(self, rows: Sequence[FreeEquation]) -> ConstraintSystem:
        """Return the system with equations more, for freedoms that nothing sees."""
        found = (*self.constraints, *rows)
        names = tuple(name for item in found for name in item.equation_names)
        return self._with({"constraints": found, "equations": names})

    @property
    def held(self) -> tuple[str, ...]:
        """Names of the freedoms that are held because nothing sees them, one for each."""
        free = (item for item in self.constraints if isinstance(item, FreeEquation))
        return tuple(item.holds for item in free if item.holds)

    def without(
        self, bodies: Collection[str], observers: Sequence[PlacedPoint | ResolvedOutput]
    ) -> ConstraintSystem:
        """Return the system without bodies that nothing in it names, with these outputs alone."""
        left = tuple(body for body in self.bodies if body.name not in bodies)
        gone = {x for body in self.bodies if body not in left for x in body.coordinates}
        names = {item.name for item in observers}
        changed = {
            "bodies": left, "observers": tuple(observers),
            "coordinates": tuple(x for x in self.coordinates if x.name not in gone),
            "body_points": tuple(x for x in self.body_points if x.name in names),
        }  # fmt: skip
        return self._with(changed)

    def _with(self, changed: Mapping[str, Any]) -> ConstraintSystem:
        other = ConstraintSystem.__new__(ConstraintSystem)
        _fill(other, {**{key: getattr(self, key) for key in self.__slots__}, **changed})
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
    units: tuple[str, str],
) -> tuple[AppliedLoad, ...]:
    """Return the masses and the loads; a model that has none does not import what they need."""
    if not loads and not any(body.is_heavy for body in bodies):
        return ()
    from kincompile.model.resolve_loads import check_named, resolved_loads

    check_named(loads, (item.name for item in constraints), scope.problems)
    return resolved_loads(bodies, loads, gravity, scope, *units)


def _fill(system: ConstraintSystem, values: Mapping[str, Any]) -> None:
    for key, value in values.items():
        object.__setattr__(system, key, value)


def _scope(
    bodies: Iterable[Body],
    coordinates: Iterable[Coordinate],
    parameters: Iterable[Parameter],
    problems: list[str],
    ground: Body,
) -> Scope:
    return Scope(
        {body.name: body for body in bodies},
        [item.name for item in coordinates],
        {item.name: item for item in parameters},
        problems,
        ground,
    )


def _resolved(
    written: list[Constraint | Equation], scope: Scope
) -> tuple[Joint | FreeEquation, ...]:
    found = (
        resolve_equation(item, scope) if isinstance(item, Equation) else resolve_joint(item, scope)
        for item in written
    )
    return beside_drivers([item for item in found if item is not None])


# An emitted module holds numbers and code only; what it looked like is remembered beside it.
_ORIGINS: WeakKeyDictionary[ModuleType, ConstraintSystem] = WeakKeyDictionary()


def remember_model(module: ModuleType, system: ConstraintSystem) -> ModuleType:
    """Note the system that a module was compiled from, and return the module."""
    _ORIGINS[module] = system
    return module


def model_of(module: ModuleType | None) -> ConstraintSystem | None:
    """Return the system that a module was compiled from; None for one loaded from a file."""
    return None if module is None else _ORIGINS.get(module)

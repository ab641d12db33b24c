"""Variants of a mechanism: other numbers, frames turned, lengths changed; each one assembles."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from random import Random
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import sympy

from kincompile.compiler import compile as compile_model
from kincompile.errors import (
    InputError,
    KincompileError,
    RedundantConstraintWarning,
    UnsupportedError,
)
from kincompile.model.arguments import Kind
from kincompile.model.bodies import GROUND, PLANAR
from kincompile.model.constraint import Constraint
from kincompile.model.declared import EXPRESSION, declared_fields
from kincompile.model.equation import Equation
from kincompile.model.mechanism import changed
from kincompile.model.points import BodyPoint
from kincompile.runtime.solve import solve

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.bodies import Body
    from kincompile.model.mechanism import Mechanism

    Values: TypeAlias = Mapping[str, float]

FACTORS = tuple(k / 20 for k in (*range(15, 20), *range(21, 27)))
"""What a number is multiplied by: 0.75 to 1.3 in steps of 0.05, without 1."""

ATTEMPTS = 60
"""Draws for a variant that assembles and moves before the model is refused."""

STEPS = 30
"""Points of the motion that a variant must reach."""

LARGEST_CONDITION = 1e6
"""Condition number of Phi_q, in radians and sizes of the mechanism, up to which it is regular."""


@dataclass(frozen=True, slots=True)
class Choices:
    """What differs from student to student besides the values of parameters."""

    # Whether the frames of some bodies are turned by half a turn, so that signs in them change.
    signs: bool = False
    # Whether points and distances that are given as numbers change too; they do in any case where a
    # model has no parameters.
    lengths: bool = False


@dataclass(frozen=True, slots=True)
class Change:
    """How a variant differs: values of parameters, factor of lengths by body, turned bodies."""

    values: tuple[tuple[str, float], ...]
    factors: tuple[tuple[str, float], ...]
    turned: tuple[str, ...]


def variants(mechanism: Mechanism, count: int, seed: int, choices: Choices) -> list[Mechanism]:
    """Return variants of a mechanism that all differ, assemble and move; the same for a seed.

    Their parameters are numbers, so that formulas by hand are written with these.
    """
    _require_generic(mechanism)
    found: dict[Change, Mechanism] = {}
    for student in range(1, count + 1):
        random = Random(f"{seed}-{student}")
        for _ in range(ATTEMPTS):
            change = _drawn(mechanism, random, choices)
            if change not in found and (made := _checked(mechanism, change)) is not None:
                found[change] = made
                break
        else:
            raise InputError(
                f"{mechanism.name}: no variant was found for student {student} of {count} that "
                "assembles, moves through its motion and differs from the others; ask for fewer "
                "students, or let the model bear changes of 25 % in its parameters"
            )
    return list(found.values())


def _require_generic(mechanism: Mechanism) -> None:
    """Refuse a model whose equations agree at its own numbers alone, before any is drawn."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RedundantConstraintWarning)
        try:
            compile_model(mechanism)
        except RedundantConstraintWarning as found:
            raise InputError(
                f"{mechanism.name} is overconstrained: it moves at its own lengths and angles, and "
                f"would not at those of a variant. {found}"
            ) from None


def _drawn(mechanism: Mechanism, random: Random, choices: Choices) -> Change:
    values = tuple(
        (item.name, _rounded((item.default or 0.0) * random.choice(FACTORS)))
        for item in mechanism.system().parameters
    )
    bodies = [GROUND.name, *(body.name for body in mechanism.bodies)]
    has_lengths = choices.lengths or not mechanism.parameters
    factors = [random.choice(FACTORS) if has_lengths else 1.0 for _ in bodies]
    if _has_profiles(mechanism):  # what rolls on each other keeps its shape
        factors = factors[:1] * len(bodies)
    turned = [body for body in bodies[1:] if choices.signs and random.random() < 0.5]
    return Change(values, tuple(zip(bodies, factors, strict=True)), tuple(turned))


def _has_profiles(mechanism: Mechanism) -> bool:
    """Return whether something rolls or touches: its radii belong together."""
    return any(
        item.kind in (Kind.RADIUS, Kind.PROFILE)
        for constraint in mechanism.constraints
        if isinstance(constraint, Constraint)
        for item in constraint.arguments().values()
    )


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")


def _checked(mechanism: Mechanism, change: Change) -> Mechanism | None:
    """Return a variant, None if it does not assemble or its motion is singular somewhere."""
    made = VariantBuilder(mechanism, change).mechanism()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            solution = solve(compile_model(made), np.linspace(0.0, made.end, STEPS))
        except UnsupportedError:
            raise
        except (KincompileError, Warning):
            return None
    is_regular = solution.success and not solution.events
    return made if is_regular and float(solution.condition.max()) < LARGEST_CONDITION else None


class VariantBuilder:
    """Builds the variant of a mechanism: numbers for parameters, frames turned, lengths changed."""

    def __init__(self, mechanism: Mechanism, change: Change) -> None:
        self._mechanism = mechanism
        self._values: Any = {sympy.Symbol(name): _exact(value) for name, value in change.values}
        self._moved: Any = {}
        self._factors = dict(change.factors)
        self._turned = frozenset(change.turned)
        self._bodies = {body.name: self._body(body) for body in mechanism.bodies}
        points = [item for item in mechanism.outputs if isinstance(item, BodyPoint)]
        # What stands for a point's coordinates in equations, outputs and forces.
        self._moved = {
            old: new
            for item in points
            for old, new in zip(item.coordinates, self._point(item).coordinates, strict=True)
        }

    def mechanism(self) -> Mechanism:
        """Return the variant; tables of commands, which are of parameters, are left out."""
        given = self._mechanism
        return changed(
            given,
            parameters=[],
            bodies=list(self._bodies.values()),
            constraints=[
                self._equation(item) if isinstance(item, Equation) else self._element(item)
                for item in given.constraints
            ],
            loads=[self._element(item) for item in given.loads],
            outputs=[
                self._point(item)
                if isinstance(item, BodyPoint)
                else replace(item, expression=self._substituted(item.expression))
                for item in given.outputs
            ],
            gravity=tuple(self._value(item, 1.0) for item in given.gravity),
            end=float(sympy.sympify(given.end_given).subs(self._values)),
            tasks={},
            limits=[],
            outline=(),
        )

    def _body(self, body: Body) -> Body:
        factor, signs = self._factors[body.name], self._signs(body.name)
        own = {
            name: self._value(value, 1.0)
            for name, item in declared_fields(type(body.written())).items()
            if item.schema == EXPRESSION and (value := getattr(body, name, None)) is not None
        }
        outline = body.outline_by(lambda corner: self._moved_by(corner, signs, factor))
        centre = self._moved_by(body.centre, signs, factor)
        guess = self._guess(body, factor)
        own |= {"guess": guess, "outline": outline, "centre": centre}
        return replace(body, **own | {"inertia": self._inertia(body.inertia, signs)})

    def _guess(self, body: Body, factor: float) -> tuple[float, ...]:
        """Return the guess; half a turn of a frame is one about zeta, p to p (0, 0, 0, 1)."""
        size = len(body.kind.axes)
        place = tuple(self._number(value, factor) for value in body.guess[:size])
        is_turned = body.name in self._turned
        if body.kind is PLANAR:
            turn = sympy.pi if is_turned else 0
            return (*place, float(self._number(body.guess[2]) + turn))
        p = [float(sympy.sympify(value).subs(self._values)) for value in body.guess[size:]]
        if is_turned:
            p = [-p[3], p[2], -p[1], p[0]]
        length = math.hypot(*p)
        return (*place, *(item / length for item in p))

    def _inertia(self, given: Any, signs: tuple[int, ...]) -> Any:
        """Return an inertia: products of inertia change their signs with the axes."""
        if given is None or not hasattr(given, "__len__"):
            return self._value(given, 1.0)
        if not hasattr(given[0], "__len__"):
            return tuple(self._value(item, 1.0) for item in given)
        return [
            [self._value(i * j * sympy.sympify(x), 1.0) for x, j in zip(row, signs, strict=True)]
            for row, i in zip(given, signs, strict=True)
        ]

    def _point(self, point: BodyPoint) -> BodyPoint:
        """Return a named point, moved with its body."""
        name = point.body.name
        local = self._moved_by(point.local, self._signs(name), self._factors[name])
        return replace(point, body=self._bodies.get(name, self._mechanism.ground), local=local)

    def _moved_by(self, given: Any, signs: tuple[int, ...], factor: float) -> tuple[float, ...]:
        """Return a vector of a body whose frame is turned, and whose lengths are multiplied."""
        return tuple(self._number(x, sign * factor) for x, sign in zip(given, signs, strict=True))

    def _signs(self, body: str) -> tuple[int, ...]:
        """Return what half a turn of a frame makes of the components of its vectors."""
        sign = -1 if body in self._turned else 1
        return (sign, sign, 1)[: len(self._mechanism.ground.kind.axes)]

    def _equation(self, equation: Equation) -> Equation:
        expressions = [self._substituted(item) for item in equation.expressions]
        return Equation(equation.name, *expressions, corners=equation.corners)

    def _element(self, element: Any) -> Any:
        """Return a constraint or a load with numbers for parameters, moved with its bodies."""
        arguments = element.arguments()
        names = {
            item.symbol: _name(getattr(element, key))
            for key, item in arguments.items()
            if item.kind is Kind.BODY
        } | {GROUND.name: GROUND.name}
        made: dict[str, Any] = {}
        for key, item in arguments.items():
            given, owner = getattr(element, key), names.get(item.on, GROUND.name)
            if item.kind is Kind.BODY:
                made[key] = self._bodies.get(_name(given), self._mechanism.ground)
            elif item.kind in (Kind.POINT, Kind.AXIS):
                scale = self._factors[owner] if item.kind is Kind.POINT else 1.0
                made[key] = self._moved_by(given, self._signs(owner), scale)
            elif item.kind is Kind.PROFILE:
                made[key] = self._profile(given)
            elif item.kind is Kind.LOADS:
                made[key] = tuple(self._value(part, 1.0) for part in given)
            else:
                is_length = item.kind in (Kind.RADIUS, Kind.DISTANCE)
                made[key] = self._value(given, self._common if is_length else 1.0)
        return replace(element, **made)

    def _substituted(self, given: Any) -> sympy.Expr:
        """Return an expression with numbers for parameters, and points where they are now."""
        found: sympy.Expr = sympy.sympify(given).xreplace(self._moved).subs(self._values)
        return found

    @property
    def _common(self) -> float:
        return self._factors[GROUND.name]

    def _profile(self, given: Any) -> Any:
        if isinstance(given, tuple | list):
            angles, radii = given
            return angles, [self._number(value, self._common) for value in radii]
        return sympy.nsimplify(_exact(self._common)) * sympy.sympify(given).subs(self._values)

    def _value(self, given: Any, factor: float) -> Any:
        """Return a number, or an expression of time, with numbers for the parameters."""
        if given is None:
            return None
        value = self._substituted(given)
        return value if value.free_symbols else self._number(given, factor)

    def _number(self, given: Any, factor: float = 1.0) -> float:
        value = sympy.sympify(given).subs(self._values) * _exact(factor)
        number = float(f"{float(value):.6g}")
        return int(number) if number.is_integer() else number


def _exact(value: float) -> sympy.Expr:
    """Return a number as it is written, so that products of it are as short."""
    exact: sympy.Expr = sympy.Rational(str(value))
    return exact


def _name(body: Any) -> str:
    return str(getattr(body, "name", body))

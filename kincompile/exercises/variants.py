"""Variants of a mechanism: other numbers, frames turned, lengths changed; each one assembles."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, fields, replace
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
from kincompile.model.bodies import GROUND
from kincompile.model.constraint import Constraint
from kincompile.model.equation import Equation
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
class _Change:
    """How a variant differs: values of parameters, factor of lengths by body, turned bodies."""

    values: tuple[tuple[str, float], ...]
    factors: tuple[tuple[str, float], ...]
    turned: tuple[str, ...]


def variants(mechanism: Mechanism, count: int, seed: int, choices: Choices) -> list[Mechanism]:
    """Return variants of a mechanism that all differ, assemble and move; the same for a seed.

    Their parameters are numbers, so that formulas by hand are written with these.
    """
    _require_generic(mechanism)
    found: dict[_Change, Mechanism] = {}
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


def _drawn(mechanism: Mechanism, random: Random, choices: Choices) -> _Change:
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
    return _Change(values, tuple(zip(bodies, factors, strict=True)), tuple(turned))


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


def _checked(mechanism: Mechanism, change: _Change) -> Mechanism | None:
    """Return a variant, None if it does not assemble or its motion is singular somewhere."""
    made = _VariantBuilder(mechanism, change).mechanism()
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


class _VariantBuilder:
    """Builds the variant of a mechanism, constraint by constraint."""

    def __init__(self, mechanism: Mechanism, change: _Change) -> None:
        self._mechanism = mechanism
        self._values: Any = {sympy.Symbol(name): _exact(value) for name, value in change.values}
        self._factors = dict(change.factors)
        self._turned = frozenset(change.turned)
        self._made = type(mechanism)(
            mechanism.name,
            length_unit=mechanism.length_unit,
            end=float(sympy.sympify(mechanism.end_given).subs(self._values)),
            points=mechanism.points,
        )
        self._bodies = {body.name: self._body(body) for body in mechanism.bodies}

    def mechanism(self) -> Mechanism:
        """Return the variant."""
        for item in self._mechanism.constraints:
            self._made.add(
                self._equation(item) if isinstance(item, Equation) else self._constraint(item)
            )
        return self._made

    def _body(self, body: Body) -> Body:
        factor = self._factors[body.name]
        if len(body.kind.axes) == len("xyz"):
            return self._in_space(body, factor)
        sign, _ = self._signs(body.name)
        x, y, phi = (self._number(value) for value in body.guess)
        turn = sympy.pi if sign < 0 else 0
        guess = (x * factor, y * factor, float(phi + turn))
        outline = [tuple(self._number(v, sign * factor) for v in corner) for corner in body.outline]
        return self._made.body(body.name, guess, outline)

    def _in_space(self, body: Body, factor: float) -> Body:
        """Return a body in space; half a turn about its zeta axis makes p to p (0, 0, 0, 1)."""
        place = tuple(self._number(value, factor) for value in body.guess[:3])
        p = [float(sympy.sympify(value).subs(self._values)) for value in body.guess[3:]]
        if body.name in self._turned:
            p = [-p[3], p[2], -p[1], p[0]]
        size = math.hypot(*p)
        made: Any = self._made
        turned: Body = made.body(body.name, place, tuple(item / size for item in p))
        return turned

    def _signs(self, body: str) -> tuple[int, ...]:
        """Return what half a turn of a frame makes of the components of its vectors."""
        sign = -1 if body in self._turned else 1
        return (sign, sign, 1)[: len(self._mechanism.ground.kind.axes)]

    def _equation(self, equation: Equation) -> Equation:
        expressions: list[Any] = [
            sympy.sympify(item).subs(self._values) for item in equation.expressions
        ]
        return Equation(equation.name, *expressions)

    def _constraint(self, constraint: Constraint) -> Constraint:
        """Return a constraint with numbers for parameters, its points moved with their bodies."""
        arguments = constraint.arguments()
        changed: dict[str, Any] = {}
        names = {
            item.symbol: _name(getattr(constraint, key))
            for key, item in arguments.items()
            if item.kind is Kind.BODY
        } | {GROUND.name: GROUND.name}
        for item in fields(constraint):
            given = getattr(constraint, item.name)
            argument = arguments.get(item.name)
            if argument is None:
                continue
            owner = names.get(argument.on, GROUND.name)
            if argument.kind is Kind.BODY:
                changed[item.name] = self._bodies.get(_name(given), self._made.ground)
            elif argument.kind in (Kind.POINT, Kind.AXIS):
                scale = self._factors[owner] if argument.kind is Kind.POINT else 1.0
                changed[item.name] = tuple(
                    self._number(value, sign * scale)
                    for value, sign in zip(given, self._signs(owner), strict=True)
                )
            elif argument.kind is Kind.PROFILE:
                changed[item.name] = self._profile(given)
            else:
                is_length = argument.kind in (Kind.RADIUS, Kind.DISTANCE)
                changed[item.name] = self._value(given, self._common if is_length else 1.0)
        return replace(constraint, **changed)

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
        value = sympy.sympify(given).subs(self._values)
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

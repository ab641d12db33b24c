r"""Verification of an emitted module by oracles that know nothing of derivatives.

Phi_q is compared with a complex step of Phi, nu with one in time, and gamma with the line oracle:
along :math:`q + s\,\dot q,\ t + s`, where no acceleration acts, gamma is minus the second
derivative of Phi by s. All that is used is the Phi of the module itself: who trusts Phi, which is
what was written down, may then trust the rest.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import kincompile.compiler as compiler
from kincompile.errors import InputError, RedundantConstraintWarning
from kincompile.runtime.newton import newton
from kincompile.runtime.problem import problem
from kincompile.runtime.status import Status
from kincompile.tables import indented, table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

Array = NDArray[Any]

STATES, SEED = 6, 1989
"""States of each kind, generic ones and assembled ones."""

STEP = 1e-30
"""Complex step: no difference is taken, so that it may be as small as one likes."""

RADIUS, POINTS = 0.05, 16
"""Circle around s = 0 over which Cauchy's integral gives the second derivative."""

DIFFERENCE = 1e-3
"""Step of the differences that judge where Phi cannot be continued to complex numbers."""

ALLOWED, ALLOWED_OF_DIFFERENCES = 1e-8, 1e-5
"""Error, relative to what the terms of an equation contribute, up to which numbers agree."""


@dataclass(frozen=True, slots=True)
class Check:
    """The comparison of one quantity of one constraint's rows.

    Attributes
    ----------
    quantity
        ``"Phi_q"``, ``"nu"`` or ``"gamma"``.
    equation
        Name of the equation.
    oracle
        What it was compared with.
    error
        Largest difference over all states, relative to what the terms contribute.
    passed
        Whether it is small enough.
    """

    quantity: str
    equation: str
    oracle: str
    error: float
    passed: bool


@dataclass(frozen=True, slots=True)
class Verification:
    """What `kc.verify` finds.

    Attributes
    ----------
    name
        Name of the mechanism.
    states
        Number of generic states, and of assembled ones.
    checks
        One for each equation and quantity.
    """

    name: str
    states: tuple[int, int]
    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Whether everything agrees."""
        return bool(self.checks) and all(check.passed for check in self.checks)

    @property
    def table(self) -> tuple[Check, ...]:
        """The checks, row by row."""
        return self.checks

    def to_text(self) -> str:
        """Give the table and the verdict as plain text."""
        rows = [
            [
                check.equation,
                check.quantity,
                check.oracle,
                f"{check.error:.1e}",
                "agrees" if check.passed else "DIFFERS",
            ]
            for check in self.checks
        ]
        header = ("equation", "quantity", "compared with", "error", "verdict")
        generic, assembled = self.states
        wrong = [
            f"{check.quantity} of {check.equation}" for check in self.checks if not check.passed
        ]
        verdict = f"DIFFERS: {', '.join(wrong)}" if wrong else "all agree"
        return "\n".join([
            f"Verification of {self.name}",
            *indented(table(header, rows, right=("error",))),
            f"  {generic} generic and {assembled} assembled states: {verdict}",
        ])  # fmt: skip

    def __str__(self) -> str:
        """Give the text."""
        return self.to_text()


def verify(model: Mechanism | ConstraintSystem | ModuleType) -> Verification:
    """Compare Phi_q, nu and gamma of an emitted module with what follows from its Phi alone.

    Parameters
    ----------
    model
        A mechanism or a system of free equations, which is compiled; or an emitted module.

    Returns
    -------
    Verification
        `.passed`, a `.table` with an entry for each equation and quantity, and `.to_text()`.

    Raises
    ------
    ModelError, StructuralError
        As `kc.compile` does.
    InputError
        If the equations have no finite value near the guess.
    """
    module = model if isinstance(model, ModuleType) else _compiled(model)
    with np.errstate(all="ignore"):
        states, assembled = _states(module)
        if not states:
            raise InputError(
                f"the equations of {module.NAME} have no finite value near the guess: give a guess "
                "near the assembled mechanism."
            )
        checks = tuple(_checks(module, states))
    return Verification(module.NAME, (len(states) - assembled, assembled), checks)


def _compiled(model: Mechanism | ConstraintSystem) -> ModuleType:
    """Compile a model; that equations are redundant is no matter here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RedundantConstraintWarning)
        return compiler.compile(model)


State = tuple[Array, Array, float]


def _states(module: ModuleType) -> tuple[list[State], int]:
    """Return states q, q_dot, t, and how many of them, the last ones, are assembled."""
    random = np.random.default_rng(SEED)
    guess, p = module.GUESS, module.DEFAULTS
    reference = problem(module, p, guess, 0.0).reference
    generic: list[State] = []
    assembled: list[State] = []
    for _ in range(STATES):
        t = float(random.uniform(0.1, 0.9))
        away, rates = random.uniform(-0.4, 0.4, (2, guess.size)) * reference
        if _is_finite(module, guess + away, t):
            generic.append((guess + away, 3 * rates, t))
        found = newton(module, t, guess)
        if found.status is Status.CONVERGED:
            assembled.append((found.q, 3 * rates, t))
    return generic + assembled, len(assembled)


def _is_finite(module: ModuleType, q: Array, t: float) -> bool:
    try:
        return bool(np.isfinite(module.Phi(q, t)).all() and np.isfinite(module.Phi_q(q, t)).all())
    except (ArithmeticError, ValueError):
        return False


def _checks(module: ModuleType, states: list[State]) -> Iterator[Check]:
    """Yield what each oracle says of each equation."""
    scale = problem(module, module.DEFAULTS, module.GUESS, 0.0).reference
    for quantity, exact, rough in (
        ("Phi_q", "complex step", "differences"),
        ("nu", "complex step in t", "differences in t"),
        ("gamma", "line oracle, contour", "line oracle, differences"),
    ):
        errors = np.max([_errors(module, state, quantity, scale, _EXACT) for state in states], 0)
        doubtful = ~(errors <= ALLOWED)
        # Beside a corner, and within a spline, complex numbers do not tell.
        second = errors
        if doubtful.any():
            second = np.max(
                [_errors(module, state, quantity, scale, _ROUGH) for state in states], 0
            )
        for row, equation in enumerate(module.EQUATIONS):
            error = float(second[row] if doubtful[row] else errors[row])
            limit = ALLOWED_OF_DIFFERENCES if doubtful[row] else ALLOWED
            oracle = rough if doubtful[row] else exact
            yield Check(quantity, equation, oracle, error, error <= limit)


def _errors(
    module: ModuleType,
    state: State,
    quantity: str,
    scale: Array,
    derivatives: tuple[Callable[..., Array], Callable[..., Array]],
) -> Array:
    """Return the relative error of each equation at a state; infinite where it cannot be judged."""
    q, q_dot, t = state
    first, second = derivatives
    Phi_q = module.Phi_q(q, t)
    terms = np.abs(Phi_q) @ scale
    terms = np.where(terms > 0, terms, 1.0)
    try:
        if quantity == "Phi_q":
            columns = [first(module, q, t, direction, 0.0) for direction in np.eye(q.size)]
            away = np.abs(np.array(columns).T - Phi_q) * scale
            return np.asarray(np.nan_to_num(np.max(away, axis=1) / terms, nan=np.inf))
        if quantity == "nu":
            found, given = -first(module, q, t, 0 * q, 1.0), module.nu(q, t)
        else:
            found, given = -second(module, q, t, q_dot, 1.0), module.gamma(q, q_dot, t)
            terms = terms * max(1.0, float(np.max(np.abs(q_dot / scale))) ** 2)
    except (ArithmeticError, TypeError, ValueError):
        return np.full(len(terms), np.inf)
    away = np.abs(found - given) / np.maximum(terms, np.abs(given))
    return np.asarray(np.nan_to_num(away, nan=np.inf))


def _complex_step(module: ModuleType, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the derivative of Phi along a direction of (q, t)."""
    moved = module.Phi(q + 1j * STEP * along, t + 1j * STEP * time if time else t)
    return np.asarray(np.imag(moved) / STEP)


def _contour(module: ModuleType, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the second derivative of Phi along a line, by Cauchy's integral over a circle."""
    turns = np.exp(2j * np.pi * np.arange(POINTS) / POINTS)
    values = [module.Phi(q + RADIUS * s * along, t + RADIUS * s * time) for s in turns]
    total = sum(value / s**2 for value, s in zip(values, turns, strict=True))
    return np.asarray(np.real(total) * 2 / (POINTS * RADIUS**2))


def _difference(module: ModuleType, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the derivative of Phi along a direction by central differences of fourth order."""
    near, far = (
        module.Phi(q + h * along, t + h * time) - module.Phi(q - h * along, t - h * time)
        for h in (DIFFERENCE, 2 * DIFFERENCE)
    )
    return np.asarray((8 * near - far) / (12 * DIFFERENCE))


def _second_difference(module: ModuleType, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the second derivative of Phi along a line by differences of fourth order."""
    here = module.Phi(q, t)
    near, far = (
        module.Phi(q + h * along, t + h * time) + module.Phi(q - h * along, t - h * time) - 2 * here
        for h in (DIFFERENCE, 2 * DIFFERENCE)
    )
    return np.asarray((16 * near - far) / (12 * DIFFERENCE**2))


_EXACT = (_complex_step, _contour)
_ROUGH = (_difference, _second_difference)

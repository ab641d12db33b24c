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
from kincompile.teach.oracles import ORACLES, Oracle

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem

Array = NDArray[Any]

STATES, SEED = 6, 1989
"""States of each kind, generic ones and assembled ones."""

ALL_SHOWN = 60
"""Equations up to which each has lines of its own; beyond, the largest errors stand for all."""

LARGEST = 10
"""How many of the largest errors of each quantity stand for all."""


@dataclass(frozen=True, slots=True)
class Check:
    """The comparison of one quantity of one equation.

    Attributes
    ----------
    quantity
        ``"Phi_q"``, ``"nu"`` or ``"gamma"``.
    equation
        Name of the equation.
    coordinate
        Of Phi_q, the coordinate of the entry with the largest error; else "".
    oracle
        What it was compared with.
    error
        Largest difference over all states, relative to what the terms contribute.
    passed
        Whether it is small enough.
    """

    quantity: str
    equation: str
    coordinate: str
    oracle: str
    error: float
    passed: bool

    @property
    def entry(self) -> str:
        """The entry as in ``Phi_q of A.x by phi_rod``."""
        by = f" by {self.coordinate}" if self.coordinate else ""
        return f"{self.quantity} of {self.equation}{by}"


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
        shown = self._shown()
        rows = [
            [
                check.equation,
                check.quantity,
                check.coordinate,
                check.oracle,
                f"{check.error:.1e}",
                "agrees" if check.passed else "DIFFERS",
            ]
            for check in shown
        ]
        header = ("equation", "quantity", "worst by", "compared with", "error", "verdict")
        rest = len(self.checks) - len(shown)
        more = [f"  {rest} more comparisons agree better than these"] if rest else []
        return "\n".join([
            f"Verification of {self.name}",
            *indented(table(header, rows, right=("error",))),
            *more,
            f"  {self._verdict()}",
        ])  # fmt: skip

    def _shown(self) -> list[Check]:
        """Return the checks to be shown: all, or what differs and the largest errors."""
        if len(self.checks) <= 3 * ALL_SHOWN:
            return list(self.checks)
        shown: set[Check] = {check for check in self.checks if not check.passed}
        for quantity in ORACLES:
            own = [check for check in self.checks if check.quantity == quantity]
            shown |= set(sorted(own, key=lambda check: -check.error)[:LARGEST])
        return [check for check in self.checks if check in shown]

    def _verdict(self) -> str:
        generic, assembled = self.states
        wrong = [check.entry for check in self.checks if not check.passed]
        verdict = f"DIFFERS: {', '.join(wrong)}" if wrong else "all agree"
        if not assembled:
            verdict += (
                "; no assembled position was found near the guess, so that none is among them "
                "(`kincompile inspect` says what does not fit)"
            )
        return f"{generic} generic and {assembled} assembled states: {verdict}"

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
    """Yield what the oracles say of each equation."""
    reference = problem(module, module.DEFAULTS, module.GUESS, 0.0).reference
    for quantity in ORACLES:
        given, size = _given(module, states, quantity, reference)
        error, limit, judge = _judged(module, states, quantity, given, size)
        # The entry and the state at which an equation is worst, compared with what is allowed.
        columns = np.argmax(error, axis=2)
        errors = np.max(error, axis=2)
        worst = np.argmax(errors / limit, axis=0)
        for row, equation in enumerate(module.EQUATIONS):
            at = worst[row], row
            column = module.COORDINATES[columns[at]] if quantity == "Phi_q" else ""
            yield Check(
                quantity,
                equation,
                column,
                ORACLES[quantity][judge[at]][0],
                float(errors[at]),
                bool(errors[at] <= limit[at]),
            )


def _given(
    module: ModuleType, states: list[State], quantity: str, reference: Array
) -> tuple[Array, Array]:
    """Return what the module gives, and what errors are relative to, both (states, m, k).

    Of Phi_q k is n, else 1. An equation's error is relative to what its terms contribute.
    """
    Phi_q = np.array([module.Phi_q(q, t) for q, _, t in states])
    terms = np.abs(Phi_q) @ reference
    terms = np.where(terms > 0, terms, 1.0)[:, :, np.newaxis]
    if quantity == "Phi_q":
        return Phi_q, terms / reference
    if quantity == "nu":
        given = np.array([module.nu(q, t) for q, _, t in states])
    else:
        given = np.array([module.gamma(q, q_dot, t) for q, q_dot, t in states])
        fastest = np.array([np.max(np.abs(q_dot / reference)) for _, q_dot, _ in states])
        terms = terms * np.maximum(1.0, fastest**2)[:, np.newaxis, np.newaxis]
    given = given[:, :, np.newaxis]
    return given, np.maximum(terms, np.abs(given))


def _judged(
    module: ModuleType, states: list[State], quantity: str, given: Array, size: Array
) -> tuple[Array, Array, Array]:
    """Return errors (states, m, k), the allowed ones and the number of the oracle (states, m).

    What disagrees with the exact oracle may be wrong, or the oracle may: Phi need not have a
    continuation to complex numbers. It is believed where it agrees with the plain one.
    """
    exact, plain = ORACLES[quantity]
    found = _estimates(module, states, quantity, exact)
    error = _away(found, given, size)
    limit, judge = np.full(error.shape[:2], exact[2]), np.zeros(error.shape[:2], dtype=int)
    if (error > exact[2]).any():
        other = _estimates(module, states, quantity, plain)
        doubted = np.max(_away(found, other, size), axis=2) > plain[2]
        error[doubted] = _away(other, given, size)[doubted]
        limit[doubted], judge[doubted] = plain[2], 1
    return error, limit, judge


def _away(found: Array, given: Array, size: Array) -> Array:
    """Return how far numbers are apart; infinitely, where one of them is not finite."""
    return np.asarray(np.nan_to_num(np.abs(found - given) / size, nan=np.inf))


def _estimates(module: ModuleType, states: list[State], quantity: str, oracle: Oracle) -> Array:
    """Return what an oracle gives for a quantity at all states, (states, m, k); NaN for nothing."""
    _, derivative, _ = oracle
    found = []
    for q, q_dot, t in states:
        along, time = (
            (np.eye(q.size), 0.0)
            if quantity == "Phi_q"
            else (np.zeros((1, q.size)), 1.0)
            if quantity == "nu"
            else (q_dot[np.newaxis], 1.0)
        )
        try:
            rates = derivative(module, q, t, along, time).T
        except (ArithmeticError, TypeError, ValueError):
            rates = np.full((len(module.EQUATIONS), len(along)), np.nan)
        found.append(rates if quantity == "Phi_q" else -rates)
    return np.array(found)

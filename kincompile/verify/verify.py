r"""Verification of an emitted module by oracles that know nothing of derivatives.

Phi_q is compared with a complex step of Phi, nu with one in time, and gamma with the line oracle:
along :math:`q + s\,\dot q,\ t + s`, with zero acceleration, gamma is minus the second derivative
of Phi by s. Only the Phi of the module itself is used: if Phi is right, so is the rest.
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
from kincompile.quantities import QUANTITIES, TOGETHER, functions, is_moving
from kincompile.runtime.contract import check as check_contract
from kincompile.runtime.engine.code import code_of, require_square
from kincompile.runtime.newton import newton
from kincompile.runtime.problem import problem
from kincompile.runtime.status import Status
from kincompile.tables import indented, table
from kincompile.verify.oracles import ORACLES, Oracle

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.quantities import Quantity

Array = NDArray[Any]

STATES, SEED = 6, 1989
"""States of each kind, generic ones and assembled ones."""

FAR = 100.0
"""How far from the guess, in radians and sizes of the mechanism, an assembled position may be: far
away a coordinate has no digits left for a difference."""

ALL_SHOWN = 60
"""Equations up to which each has lines of its own; beyond, the largest errors stand for all."""

LEGEND = (
    "complex step: Phi_q = Im Phi(q + i h) / h, nu = -Im Phi(q, t + i h) / h",
    "line oracle: gamma = -d2/ds2 Phi(q + s q_dot, t + s) at s = 0",
)
"""The oracles, for readers of the table."""

LARGEST = 10
"""How many of the largest errors of each quantity stand for all."""


@dataclass(frozen=True, slots=True)
class Check:
    """The comparison of one quantity of one equation.

    Attributes
    ----------
    quantity
        ``"Phi_q"``, ``"nu"`` or ``"gamma"``; ``"Phi"`` for the functions that give Phi with others.
    equation
        Name of the equation.
    coordinate
        Of Phi_q, the coordinate of the entry with the largest error; else "".
    oracle
        Name of the oracle.
    error
        Largest difference over all states, relative to the size of the terms.
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
    """The outcome of `kc.verify`.

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
        """Return the table and the verdict as plain text."""
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
        lines = table(header, rows, right=("error",))
        lines += [f"{rest} more comparisons agree better than these"] if rest else []
        title = f"Verification of {self.name}"
        return "\n".join([title, *indented([*lines, *LEGEND, self._verdict()])])

    def _shown(self) -> list[Check]:
        """Return the checks to be shown: all, or those that differ and the largest errors."""
        if len(self.checks) <= len(ORACLES) * ALL_SHOWN:
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
        """Return the text."""
        return self.to_text()


def verify(model: Mechanism | ConstraintSystem | ModuleType) -> Verification:
    """Compare Phi_q, nu and gamma of an emitted module with derivatives of its Phi.

    Parameters
    ----------
    model
        A mechanism or a system of free equations, which is compiled; or an emitted module.

    Returns
    -------
    Verification
        `.passed`, a `.table` with a check of each equation and quantity, and `.to_text()`.

    Raises
    ------
    ModelError
        As `kc.compile` does.
    StructuralError
        As `kc.newton` does, because some of the states are assembled positions.
    ContractError
        If the module is not an emitted one.
    InputError
        If the equations have no finite value near the guess.
    """
    if isinstance(model, ModuleType):
        check_contract(model)
        module = model
    else:
        module = _compiled(model)
    require_square(code_of(module))
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
    """Compile a model, without warnings of redundant equations."""
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
        is_near = np.max(np.abs(found.q - guess) / reference, initial=0.0) <= FAR
        if found.status is Status.CONVERGED and is_near:
            assembled.append((found.q, 3 * rates, t))
    return generic + assembled, len(assembled)


def _is_finite(module: ModuleType, q: Array, t: float) -> bool:
    try:
        return bool(np.isfinite(module.Phi(q, t)).all() and np.isfinite(module.Phi_q(q, t)).all())
    except (ArithmeticError, ValueError):
        return False


def _checks(module: ModuleType, states: list[State]) -> Iterator[Check]:
    """Yield the checks of each equation by the oracles."""
    reference = problem(module, module.DEFAULTS, module.GUESS, 0.0).reference
    for quantity in QUANTITIES:
        size = _sizes(module, states, quantity, reference)
        error, limit, judge = _judged(module, states, quantity, size)
        # The entry and the state with the largest error, compared with the allowed one.
        columns = np.argmax(error, axis=2)
        errors = np.max(error, axis=2)
        worst = np.argmax(errors / limit, axis=0)
        for row, equation in enumerate(module.EQUATIONS):
            at = worst[row], row
            yield Check(
                quantity.name,
                equation,
                module.COORDINATES[columns[at]] if quantity.is_matrix else "",
                ORACLES[quantity.name][judge[at]].name,
                float(errors[at]),
                bool(errors[at] <= limit[at]),
            )


def _sizes(module: ModuleType, states: list[State], quantity: Quantity, reference: Array) -> Array:
    """Return the scale of errors: the size of an equation's terms.

    Its shape is (states, m, n) for a matrix, (states, m, 1) for a vector.
    """
    Phi_q = np.array([module.Phi_q(q, t) for q, _, t in states])
    terms = np.abs(Phi_q) @ reference
    terms = np.where(terms > 0, terms, 1.0)[:, :, np.newaxis]
    if quantity.is_moving:
        fastest = np.array([np.max(np.abs(q_dot / reference)) for _, q_dot, _ in states])
        terms = terms * np.maximum(1.0, fastest**2)[:, np.newaxis, np.newaxis]
    return np.asarray(terms / reference if quantity.is_matrix else terms)


def _forms(module: ModuleType, states: list[State], quantity: Quantity) -> Iterator[Array]:
    """Yield a quantity as each function of the module gives it, (states, m, k).

    They are written out one by one, and a batch runs on other numbers than a single state.
    """
    shape = len(states), len(module.EQUATIONS), -1
    q, q_dot, t = (np.array(part) for part in zip(*states, strict=True))
    for name, given in functions().items():
        if quantity.name not in given or name == "Phi":  # all else is judged by Phi
            continue

        def value(
            q: Array, q_dot: Array, t: Any, name: str = name, given: tuple[str, ...] = given
        ) -> Array:
            function = getattr(module, name)
            found = function(q, q_dot, t) if is_moving(given) else function(q, t)
            return np.asarray(found if len(given) == 1 else found[given.index(quantity.name)])

        yield np.array([value(*state) for state in states]).reshape(shape)
        yield value(q, q_dot, t).reshape(shape)
    if quantity.name not in TOGETHER["kinematics"]:
        return
    place = TOGETHER["kinematics"].index(quantity.name)
    found = module.kinematics_batch_last(q.T, q_dot.T, t)[place].T
    if not quantity.is_matrix:
        yield found.reshape(shape)
        return
    matrix = np.zeros((len(states), len(module.EQUATIONS), len(module.COORDINATES)))
    matrix[:, module.PATTERN[:, 0], module.PATTERN[:, 1]] = found
    yield matrix


def _judged(
    module: ModuleType, states: list[State], quantity: Quantity, size: Array
) -> tuple[Array, Array, Array]:
    """Return errors (states, m, k), the allowed ones and the number of the oracle (states, m).

    Where the module disagrees with the exact oracle, either may be wrong: Phi need not have a
    continuation to complex numbers. The exact oracle is believed where it agrees with the plain
    one.
    """
    exact, plain = ORACLES[quantity.name]
    forms = list(_forms(module, states, quantity))

    def deviation(estimate: Array) -> Array:
        """Return the largest deviation of the module from an oracle."""
        scale = size if quantity.is_matrix else np.maximum(size, np.abs(estimate))
        return np.asarray(np.max([_distance(form, estimate, scale) for form in forms], axis=0))

    estimate = _estimates(module, states, quantity, exact)
    error = deviation(estimate)
    limit, judge = np.full(error.shape[:2], exact.limit), np.zeros(error.shape[:2], dtype=int)
    if (error > exact.limit).any():
        other = _estimates(module, states, quantity, plain)
        doubted = np.max(_distance(estimate, other, size), axis=2) > plain.limit
        error[doubted] = deviation(other)[doubted]
        limit[doubted], judge[doubted] = plain.limit, 1
        # Beside a pole, and where a root begins, no oracle gives a number: the other states do.
        silent = doubted & ~np.isfinite(other).all(axis=2)
        silent &= ~silent.all(axis=0)
        error[silent] = 0.0
    return error, limit, judge


def _distance(found: Array, given: Array, size: Array) -> Array:
    """Return the relative distance of numbers; infinite if one of them is not finite."""
    return np.asarray(np.nan_to_num(np.abs(found - given) / size, nan=np.inf))


def _estimates(
    module: ModuleType, states: list[State], quantity: Quantity, oracle: Oracle
) -> Array:
    """Return the values of an oracle at all states, (states, m, k); NaN where it has none."""
    sign = -1.0 if quantity.name in ("nu", "gamma") else 1.0
    found = []
    for q, q_dot, t in states:
        along, time = np.eye(q.size), 0.0
        if not quantity.is_matrix:
            along, time = (q_dot if quantity.is_moving else 0 * q)[np.newaxis], 1.0
        try:
            rates = oracle.derivative(module, q, t, along, time).T
        except (ArithmeticError, TypeError, ValueError):
            rates = np.full((len(module.EQUATIONS), len(along)), np.nan)
        found.append(sign * rates)
    return np.array(found)

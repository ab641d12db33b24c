r"""Verification of an emitted module by oracles that know nothing of derivatives.

Phi_q is compared with a complex step of Phi, nu with one in time, and gamma with the line oracle:
along :math:`q + s\,\dot q,\ t + s`, with zero acceleration, gamma is minus the second derivative
of Phi by s. Only the Phi of the module itself is used: if Phi is right, so is the rest. Phi is
compared with the interpreter's where the module was compiled in this process, and what the planned
solve gives is multiplied by Phi_q.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import kincompile.compiler as compiler
from kincompile.errors import RedundantConstraintWarning
from kincompile.html import Shown
from kincompile.ir.interpret import interpreter
from kincompile.ir.lower import lower
from kincompile.model.system import model_of
from kincompile.quantities import OF_EQUATIONS, QUANTITIES
from kincompile.runtime.engine.code import code_of, require_square
from kincompile.runtime.load import check as check_contract
from kincompile.tables import indented, table
from kincompile.verification.motion import errors_of_motion
from kincompile.verification.oracles import ORACLES, Oracle
from kincompile.verification.outputs import LIMIT as LARGEST_ERROR
from kincompile.verification.outputs import errors_of_outputs
from kincompile.verification.planned_solve import LIMIT, PlannedSolve
from kincompile.verification.samples import Samples, samples_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.model.mechanism import Mechanism
    from kincompile.model.system import ConstraintSystem
    from kincompile.quantities import Quantity

Array = NDArray[Any]
PhiOfParameters = Callable[[Array, Any, Array], Array]
"""Phi of q (..., n), t and p (k,)."""

ALL_SHOWN = 60
"""Equations up to which each has lines of its own; beyond, the largest errors stand for all."""

LEGEND = (
    "complex step: Phi_q = Im Phi(q + i h) / h, nu = -Im Phi(q, t + i h) / h",
    "line oracle: gamma = -d2/ds2 Phi(q + s q_dot, t + s) at s = 0",
    "multiplied back: Phi_q x = b for random b; the determinants of its blocks make det Phi_q",
)
"""The oracles, for readers of the table."""

THE_MODEL = "the model"
"""The reference for Phi of a module that was compiled here."""

SOLVE, DETERMINANTS, ALL_BLOCKS = "solve", "determinants", "all blocks"
"""What else is compared: the planned solve, equation by equation, and the determinants it gives."""

OF_OUTPUTS = tuple(item.name for item in QUANTITIES if item.rows == "outputs")

LARGEST = 8
"""How many of the largest errors of each quantity stand for all."""


@dataclass(frozen=True, slots=True)
class Check:
    """The comparison of one quantity of one equation.

    Attributes
    ----------
    quantity
        ``"Phi_q"``, ``"nu"`` or ``"gamma"``; ``"Phi"`` for the functions that give Phi with others;
        ``"solve"`` for the planned solve, and ``"determinants"``.
    equation
        Name of the equation, or of the output; of determinants ``"all blocks"``.
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


@dataclass(frozen=True, slots=True, repr=False)
class Verification(Shown):
    """The outcome of `kc.verify`.

    Attributes
    ----------
    name
        Name of the mechanism.
    states
        Number of generic states, and of assembled ones.
    checks
        One for each equation and quantity; where the module has a planned solve, one more for each
        equation, and one of the determinants.
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
        for quantity in (*ORACLES, SOLVE, *OF_OUTPUTS):
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

    def headline(self) -> str:
        """Return the name and the verdict."""
        return f"{self.name}, {self._verdict()}"


def verify(model: Mechanism | ConstraintSystem | ModuleType) -> Verification:
    """Compare Phi_q, nu and gamma of an emitted module with derivatives of its Phi.

    What its planned solve gives is multiplied by Phi_q. Of a module with masses and forces M, Q and
    its Jacobians are looked at too, and accelerations and multipliers are put back into the
    equations of motion; it need not have as many equations as coordinates. Phi, M and Q themselves
    are compared with the model where that is known; of a module that was loaded from a file they
    are believed, as far as the rest agrees with them.

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
    if not (code := code_of(module)).has_loads:
        require_square(code)
    with np.errstate(all="ignore"):
        samples = samples_of(module)
        checks = (
            *_checks(samples),
            *_checks_of_solve(samples),
            *_checks_of_outputs(samples),
            *_checks_of_motion(samples),
        )
    states = len(samples.q) - samples.assembled, samples.assembled
    return Verification(module.NAME, states, checks)


def _compiled(model: Mechanism | ConstraintSystem) -> ModuleType:
    """Compile a model, without warnings of redundant equations."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RedundantConstraintWarning)
        return compiler.compile(model)


def _checks(samples: Samples) -> Iterator[Check]:
    """Yield the checks of each equation by the oracles."""
    code, known = samples.code, _Phi_of_model(samples.code.module)
    for quantity in OF_EQUATIONS:
        Phi = known if quantity.name == "Phi" and known else code.functions["Phi"]
        error, limit, judge = _judged(samples, quantity, Phi)
        # The entry and the state with the largest error, compared with the allowed one.
        columns = np.argmax(error, axis=2)
        errors = np.max(error, axis=2)
        worst = np.argmax(errors / limit, axis=0)
        for row, equation in enumerate(code.equations):
            at = worst[row], row
            yield Check(
                quantity.name,
                equation,
                code.coordinates[columns[at]] if quantity.is_matrix else "",
                THE_MODEL if Phi is known else ORACLES[quantity.name][judge[at]].name,
                float(errors[at]),
                bool(errors[at] <= limit[at]),
            )


def _Phi_of_model(module: ModuleType) -> PhiOfParameters | None:
    """Return Phi of the model that a module was compiled from, by the interpreter, if it is known.

    Of a module from a file nothing else is known, and its own Phi is believed.
    """
    system = model_of(module)
    if system is None:
        return None
    found = interpreter(lower(system), ("Phi",))
    return lambda q, t, p: found(q, np.zeros_like(q), t, p)[0]


def _checks_of_solve(samples: Samples) -> Iterator[Check]:
    """Yield the checks of the planned solve, if there is one, where Phi_q is regular."""
    plan = PlannedSolve(samples) if "solve" in samples.code.functions else None
    if plan is None or not plan.states:
        return
    oracle = "multiplied back"
    for equation, error in zip(samples.code.equations, plan.errors().tolist(), strict=True):
        yield Check(SOLVE, equation, "", oracle, error, error <= LIMIT)
    if plan.has_blocks:
        error = plan.error_of_determinants()
        yield Check(DETERMINANTS, ALL_BLOCKS, "", oracle, error, error <= LIMIT)


def _checks_of_outputs(samples: Samples) -> Iterator[Check]:
    """Yield the checks of the derivatives of outputs, if there are any."""
    if not samples.code.outputs:
        return
    found = errors_of_outputs(samples, model_of(samples.code.module))
    for quantity, output, coordinate, error in found:
        oracle = THE_MODEL if quantity == "outputs" else "differences"
        yield Check(quantity, output, coordinate, oracle, error, error <= LARGEST_ERROR)


def _checks_of_motion(samples: Samples) -> Iterator[Check]:
    """Yield the checks of masses, forces and equations of motion, if there are any."""
    if samples.code.has_loads:
        found = errors_of_motion(samples, model_of(samples.code.module))
        for quantity, row, coordinate, oracle, error, limit in found:
            yield Check(quantity, row, coordinate, oracle, error, error <= limit)


def _judged(
    samples: Samples, quantity: Quantity, Phi: PhiOfParameters
) -> tuple[Array, Array, Array]:
    """Return errors (S, m, k), the allowed ones and the number of the oracle (S, m).

    Where the module disagrees with the exact oracle, either may be wrong: Phi need not have a
    continuation to complex numbers. The exact oracle is believed where it agrees with the plain
    one.
    """
    exact, plain = ORACLES[quantity.name]
    size, forms = samples.sizes(quantity), list(samples.forms(quantity))

    def deviation(estimate: Array) -> Array:
        """Return the largest deviation of the module from an oracle."""
        scale = size if quantity.is_matrix else np.maximum(size, np.abs(estimate))
        return np.asarray(np.max([_distance(form, estimate, scale) for form in forms], axis=0))

    estimate = _estimates(samples, quantity, exact, Phi)
    error = deviation(estimate)
    limit, judge = np.full(error.shape[:2], exact.limit), np.zeros(error.shape[:2], dtype=int)
    if (error > exact.limit).any():
        other = _estimates(samples, quantity, plain, Phi)
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


def _estimates(samples: Samples, quantity: Quantity, oracle: Oracle, Phi: PhiOfParameters) -> Array:
    """Return the values of an oracle at all states, (S, m, k); NaN where it has none."""
    sign = -1.0 if quantity.name in ("nu", "gamma") else 1.0
    found = []
    for q, q_dot, t, p in samples.each():
        along, time = np.eye(q.size), 0.0
        if not quantity.is_matrix:
            along, time = (q_dot if len(quantity.states) > 1 else 0 * q)[np.newaxis], 1.0
        function = partial(_with_parameters, Phi, p)
        try:
            rates = oracle.derivative(function, q, t, along, time).T
        except (ArithmeticError, TypeError, ValueError):
            rates = np.full((samples.terms.shape[1], len(along)), np.nan)
        found.append(sign * rates)
    return np.array(found)


def _with_parameters(Phi: PhiOfParameters, p: Array, q: Array, t: Any) -> Array:
    return Phi(q, t, p)

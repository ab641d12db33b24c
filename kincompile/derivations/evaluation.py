"""The emitted module at one state: each entry as a formula, a number and a line of code."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.calculus.expressions import Symbol
from kincompile.derivations.emitted_lines import emitted_lines
from kincompile.derivations.expanded import Writer
from kincompile.derivations.positions import followed, generic_time, newton_table
from kincompile.emitters.emission import emit_program
from kincompile.errors import InputError
from kincompile.ir.inline import InlineProgram, inline
from kincompile.ir.lower import lower
from kincompile.names import listed, rate, suggestion
from kincompile.report.document import Display, Math
from kincompile.report.formulas import Decimal, DerivativeSymbol, Equated, Glyph, size
from kincompile.runtime.load import from_source
from kincompile.runtime.newton import NewtonResult, newton
from kincompile.runtime.status import Status
from kincompile.structure.counting import counting_problem

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import ModuleType

    from kincompile.derivations.emitted_lines import EntryKey
    from kincompile.ir.inline import ConstraintRows as Rows
    from kincompile.ir.inline import Entry
    from kincompile.model.system import ConstraintSystem
    from kincompile.report.document import SourceLine
    from kincompile.report.formulas import Formula

Array = NDArray[np.float64]

BRIEF = 30
"""Nodes of a formula that still fits into a cell of a table."""

ROUNDING = 1e-14
"""Numbers this much smaller than the largest of their kind are shown as zero."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A system, its emitted module and the numbers at one state."""

    system: ConstraintSystem
    code: InlineProgram
    source: str
    module: ModuleType
    origin: str  # the source of the state, in words
    t: float
    # q, q_dot, q_ddot: coordinates and rates, shape (n,); the rates are zero where they are not
    # determined.
    q: Array
    q_dot: Array
    q_ddot: Array
    p: Array
    # Phi, Phi_q, nu, gamma: the values of the emitted module there.
    Phi: Array
    Phi_q: Array
    nu: Array
    gamma: Array
    # The iterates of Newton's method; None where the system is not square.
    assembly: NewtonResult | None
    start: str  # in words, from where they come
    is_assembled: bool  # whether the state lies on the constraints
    problem: str  # the reason why the system cannot be solved, "" where it can

    @property
    def values(self) -> dict[str, float]:
        """Numbers by name: coordinates, rates, parameters and t."""
        found = dict(zip(self.coordinates, self.q.tolist(), strict=True))
        found |= dict(zip(map(rate, self.coordinates), self.q_dot.tolist(), strict=True))
        parameters = (item.name for item in self.system.parameters)
        return found | dict(zip(parameters, self.p.tolist(), strict=True)) | {"t": self.t}

    @cached_property
    def coordinates(self) -> list[str]:
        """Names of the coordinates."""
        return [item.name for item in self.system.coordinates]

    @cached_property
    def shown(self) -> dict[str, Array]:
        """The numbers by name, with zero for those that are rounding errors of zero."""
        names = ("q", "q_dot", "q_ddot", "nu", "gamma", "Phi_q", "Phi")
        found: dict[str, Array] = {name: getattr(self, name) for name in names}
        sizes = {name: np.max(np.abs(values), initial=0.0) for name, values in found.items()}
        sizes["Phi"] = sizes["q"]  # Phi of an assembled mechanism is nothing but rounding error
        return {
            name: np.where(np.abs(values) <= ROUNDING * sizes[name], 0.0, values)
            for name, values in found.items()
        }

    @cached_property
    def _writer(self) -> Writer:
        return Writer(self.code.nodes)

    @cached_property
    def _lines(self) -> dict[EntryKey, SourceLine]:
        return emitted_lines(self.code, self.source)

    def expanded(self, entry: Entry) -> Formula:
        """Return an entry in sines and cosines."""
        return self._writer.formula(entry.node)

    def line(self, quantity: str, entry: Entry) -> SourceLine | None:
        """Return where the emitted module computes an entry."""
        return self._lines.get((quantity, entry.row, entry.column))

    def symbol(self, quantity: str, row: int) -> Glyph:
        """Return the symbol of an equation's Phi, nu or gamma."""
        return Glyph(quantity, self.system.equations[row], bold=False)

    def value(self, quantity: str, entry: Entry) -> float:
        """Return an entry's number at the chosen state, from the emitted module."""
        values = self.shown[quantity]
        return float(values[entry.row, entry.column] if values.ndim == 2 else values[entry.row])

    def partial(self, entry: Entry) -> DerivativeSymbol:
        """Return the symbol of an entry of Phi_q."""
        return DerivativeSymbol(
            self.symbol("Phi", entry.row), Symbol(self.coordinates[entry.column])
        )

    def brief(self, quantity: str, entry: Entry) -> Math:
        """Return an entry in sines and cosines where that is short, else its symbol."""
        formula = self.expanded(entry)
        if size(formula) <= BRIEF:
            return Math(formula)
        is_cell = quantity == "Phi_q"
        return Math(self.partial(entry) if is_cell else self.symbol(quantity, entry.row))

    def display(self, quantity: str, entry: Entry) -> Display:
        """Return an entry's line: symbol, formula, number, and the code that computes it."""
        is_cell = quantity == "Phi_q"
        left = self.partial(entry) if is_cell else self.symbol(quantity, entry.row)
        formula, number = self.expanded(entry), Decimal(self.value(quantity, entry))
        parts = (left, formula) if is_number(formula) else (left, formula, number)
        return Display(Equated(parts), anchor(quantity, entry), self.line(quantity, entry))

    def expansion(self, rows: Rows, quantities: tuple[str, ...]) -> tuple[Display, ...]:
        """Return the lines of a constraint's entries."""
        return tuple(
            self.display(quantity, entry) for name in quantities
            for quantity, entry in ((name, item) for item in rows.entries[name])
        )  # fmt: skip


def evaluation(system: ConstraintSystem, state: Mapping[str, float] | float | None) -> Evaluation:
    """Choose a state and evaluate the emitted module there.

    Parameters
    ----------
    state
        A time, at which the mechanism is assembled; or numbers by name (coordinates, rates,
        parameters, t), taken as they are, the rest from the guess, zero and the defaults. None is
        the time 0.

    Raises
    ------
    InputError
        If a name is unknown or a number not finite, or the formulas have no finite values there.
    """
    code = inline(lower(system))
    source = emit_program("numpy", code).source
    module = from_source(source, system.name)
    problem = counting_problem(system, code.pattern())
    given: dict[str, float] = {}
    if isinstance(state, int | float):
        given["t"] = finite_value("t", state)
    elif state is not None:
        given = _checked(system, state)
    return _evaluated(system, code, source, module, problem, given)


def finite_value(name: str, value: Any) -> float:
    """Return a number of a state, checked."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"state, {name}: {value!r} is not a finite number")
    return number


def _checked(system: ConstraintSystem, state: Mapping[str, Any]) -> dict[str, float]:
    coordinates = [item.name for item in system.coordinates]
    known = [*coordinates, *(rate(name) for name in coordinates)]
    known += [*(item.name for item in system.parameters), "t"]
    unknown = [str(name) for name in state if str(name) not in known]
    if unknown:
        raise InputError(
            f"the state names {listed(unknown)}{suggestion(unknown[0], known)}; names are: "
            f"{listed(known)}"
        )
    return {str(name): finite_value(str(name), value) for name, value in state.items()}


def _evaluated(
    system: ConstraintSystem,
    code: InlineProgram,
    source: str,
    module: ModuleType,
    problem: str,
    given: dict[str, float],
) -> Evaluation:
    names = [item.name for item in system.coordinates]
    guess = np.array([item.guess for item in system.coordinates], dtype=float)
    p = np.array([given.get(item.name, item.default) for item in system.parameters], dtype=float)
    is_given = any(name in given for name in (*names, *map(rate, names)))
    t, found = _position(module, system, given, is_given, guess, p, problem)
    is_assembled = found is not None and not is_given
    assembly, start = None, ""
    if not problem:
        assembly, start = newton_table(module, t, guess, guess if found is None else found, p)
    default = found if is_assembled and found is not None else guess
    q = np.array([given.get(name, default[k]) for k, name in enumerate(names)])
    with np.errstate(all="ignore"):  # what is not finite is refused below
        Phi, Phi_q = module.position(q, t, p)
        nu = module.nu(q, t, p)
        q_dot = _solved(Phi_q, nu) if is_assembled else np.zeros_like(q)
        q_dot = np.array([given.get(rate(name), q_dot[k]) for k, name in enumerate(names)])
        gamma = module.gamma(q, q_dot, t, p)
    if not all(np.isfinite(item).all() for item in (Phi, Phi_q, nu, gamma)):
        raise InputError(f"the formulas of {system.name!r} have no finite values at this state")
    q_ddot = _solved(Phi_q, gamma) if is_assembled else np.zeros_like(q)
    return Evaluation(
        system, code, source, module, _origin(t, is_assembled, is_given), t, q, q_dot, q_ddot, p,
        Phi, Phi_q, nu, gamma, assembly, start, is_assembled, problem,
    )  # fmt: skip


def _position(
    module: ModuleType,
    system: ConstraintSystem,
    given: Mapping[str, float],
    is_given: bool,
    guess: Array,
    p: Array,
    problem: str,
) -> tuple[float, Array | None]:
    """Return the time of the numbers, and the assembled position there if there is one.

    Without a time, a generic one that the motion reaches; 0 where it does not.
    """
    if not (problem or is_given or "t" in given):
        t = generic_time(system.end)
        q = followed(module, t, p)
        if q is not None:
            return t, q
    t = given.get("t", 0.0)
    result = None if problem else newton(module, t, guess, p)
    converged = result is not None and result.status is Status.CONVERGED
    return t, result.q if result is not None and converged else None


def _solved(Phi_q: Array, side: Array) -> Array:
    """Return x of Phi_q x = side, zeros where Phi_q is singular."""
    try:
        return np.asarray(np.linalg.solve(Phi_q, side), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.zeros_like(side)


def _origin(t: float, is_assembled: bool, is_given: bool) -> str:
    if is_given:
        return "the state that was asked for"
    if is_assembled:
        return f"the assembled state at t = {t:g}"
    return f"the guess, because the mechanism does not assemble at t = {t:g}"


def is_number(formula: Formula) -> bool:
    """Return whether a formula is a plain number as it stands."""
    return type(formula).__name__ in ("Number", "Decimal")


def anchor(quantity: str, entry: Entry) -> str:
    """Return the anchor of an entry's line."""
    place = f"{entry.row}-{entry.column}" if quantity == "Phi_q" else str(entry.row)
    return f"{quantity}-{place}"

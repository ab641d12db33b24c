"""The state at which a page shows numbers, and the emitted module that gives them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.errors import InputError, StructuralError
from kincompile.ir.inline import InlineProgram, inline
from kincompile.ir.lower import lower
from kincompile.names import listed, rate, suggestion
from kincompile.runtime.load import from_source
from kincompile.runtime.newton import NewtonResult, newton
from kincompile.runtime.status import Status
from kincompile.structure.counting import require_square
from kincompile.targets.emission import emit_program

if TYPE_CHECKING:
    from collections.abc import Mapping
    from types import ModuleType

    from kincompile.model.system import ConstraintSystem

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """A system, its emitted module and a state.

    Attributes
    ----------
    system, code, source, module
        The system, its program, the text of the emitted module, the module.
    origin
        Where the state comes from, in words.
    t
        Time.
    q, q_dot, q_ddot
        Coordinates and rates, shape (n,); the rates are zero where they are not determined.
    p
        Parameters, shape (k,).
    Phi, Phi_q, nu, gamma
        What the emitted module gives there.
    assembly
        The way of Newton's method from the guess, None where there is none.
    is_assembled
        Whether the state lies on the constraints.
    problem
        Why the system cannot be solved, "" where it can.
    """

    system: ConstraintSystem
    code: InlineProgram
    source: str
    module: ModuleType
    origin: str
    t: float
    q: Array
    q_dot: Array
    q_ddot: Array
    p: Array
    Phi: Array
    Phi_q: Array
    nu: Array
    gamma: Array
    assembly: NewtonResult | None
    is_assembled: bool
    problem: str

    @property
    def values(self) -> dict[str, float]:
        """Numbers by name: coordinates, rates, parameters and t."""
        names = [item.name for item in self.system.coordinates]
        found = dict(zip(names, self.q.tolist(), strict=True))
        found |= dict(zip((rate(name) for name in names), self.q_dot.tolist(), strict=True))
        parameters = (item.name for item in self.system.parameters)
        return found | dict(zip(parameters, self.p.tolist(), strict=True)) | {"t": self.t}


def situation(system: ConstraintSystem, state: Mapping[str, float] | float | None) -> Situation:
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
    problem = _problem(system, code)
    if isinstance(state, int | float) or state is None:
        t = _finite("t", 0.0 if state is None else state)
        given: dict[str, float] = {}
    else:
        given = _checked(system, state)
        t = given.pop("t", 0.0)
    return _evaluated(system, code, source, module, problem, t, given)


def _problem(system: ConstraintSystem, code: InlineProgram) -> str:
    try:
        require_square(system, code.pattern())
    except StructuralError as error:
        return str(error)
    return ""


def _finite(name: str, value: Any) -> float:
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
    return {str(name): _finite(str(name), value) for name, value in state.items()}


def _evaluated(
    system: ConstraintSystem,
    code: InlineProgram,
    source: str,
    module: ModuleType,
    problem: str,
    t: float,
    given: dict[str, float],
) -> Situation:
    names = [item.name for item in system.coordinates]
    guess = np.array([item.guess for item in system.coordinates], dtype=float)
    p = np.array([given.get(item.name, item.default) for item in system.parameters], dtype=float)
    assembly = None if problem else newton(module, t, guess, p)
    is_given = any(name in given for name in (*names, *map(rate, names)))
    converged = assembly is not None and assembly.status is Status.CONVERGED
    is_assembled = converged and not is_given
    start = assembly.q if is_assembled and assembly is not None else guess
    q = np.array([given.get(name, start[k]) for k, name in enumerate(names)])
    with np.errstate(all="ignore"):  # what is not finite is refused below
        Phi, Phi_q = module.position(q, t, p)
        nu = module.nu(q, t, p)
        q_dot = _solved(Phi_q, nu) if is_assembled else np.zeros_like(q)
        q_dot = np.array([given.get(rate(name), q_dot[k]) for k, name in enumerate(names)])
        gamma = module.gamma(q, q_dot, t, p)
    if not all(np.isfinite(item).all() for item in (Phi, Phi_q, nu, gamma)):
        raise InputError(f"the formulas of {system.name!r} have no finite values at this state")
    q_ddot = _solved(Phi_q, gamma) if is_assembled else np.zeros_like(q)
    return Situation(
        system, code, source, module, _origin(t, is_assembled, is_given), t, q, q_dot, q_ddot, p,
        Phi, Phi_q, nu, gamma, assembly, is_assembled, problem,
    )  # fmt: skip


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

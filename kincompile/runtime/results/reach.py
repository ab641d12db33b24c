r"""How far a driver can go either way before the mechanism locks up.

At the start of a motion time stands still, and one driver is moved by :math:`\lambda`:
:math:`\Phi(q, t_0) = \lambda e` with :math:`e` its row. The solution curve in q and
:math:`\lambda` is followed as `singular.events` follows that in q and t.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import TOLERANCE
from kincompile.names import listed
from kincompile.runtime.engine.code import DRIVERS, Code
from kincompile.runtime.march import March, State
from kincompile.runtime.problem import Dense, problem
from kincompile.runtime.singular.events import locate

if TYPE_CHECKING:
    from types import ModuleType

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.problem import Problem
    from kincompile.runtime.results.columns import MotionTable

LARGEST_STEERED = 300
"""Coordinates up to which a range is searched for: it solves dense matrices, some hundred times."""

ROUND = math.tau
"""How far an angle is driven; further on everything comes again."""

SIZES = 4.0
"""How far a length is driven, in sizes of the mechanism."""


@dataclass(frozen=True, slots=True)
class Driver:
    """A driver at one time, as the compiler describes it.

    Attributes
    ----------
    name, unit
        Its name, and the unit of its value.
    row
        Its row in Phi.
    value
        C at that time.
    is_squared
        Whether the row is that of C^2, as of a distance.
    """

    name: str
    unit: str
    row: int
    value: float
    is_squared: bool


@dataclass(frozen=True, slots=True, eq=False)
class Limit:
    """Where a driver can go no further.

    Attributes
    ----------
    value : float
        The driver's value there, infinite where nothing was met.
    kind : str
        Of the event: ``"lock-up"`` or ``"bifurcation"``; "" where nothing was met.
    bodies : tuple of str
        The bodies whose movement nothing determines there.
    q : ndarray, shape (n,)
        The position there; empty where nothing was met.
    """

    value: float
    kind: str
    bodies: tuple[str, ...]
    q: Array

    def __str__(self) -> str:
        """Return value, kind and bodies."""
        if not self.kind:
            return "no limit met"
        return f"{self.value:.6g} ({self.kind}: {listed(self.bodies)})"


@dataclass(frozen=True, slots=True)
class DriverRange:
    """How far a driver can go either way from where the motion starts.

    Attributes
    ----------
    name, unit
        Of the driver.
    start : float
        Its value at the first time.
    low, high : Limit
        Where it ends below and above; an angle is tried for a turn, a length for four times the
        size of the mechanism, with the other drivers held.
    """

    name: str
    unit: str
    start: float
    low: Limit
    high: Limit


def driver_ranges(solution: MotionTable, module: ModuleType, p: Array) -> tuple[DriverRange, ...]:
    """Return the range of every driver from the first position of a motion."""
    describe = vars(module).get(DRIVERS)
    q, t = np.ascontiguousarray(solution.q[0]), float(solution.t[0])
    if describe is None or q.size > LARGEST_STEERED or not np.isfinite(solution.q_ddot[0]).all():
        return ()
    with np.errstate(all="ignore"):
        return tuple(_range(module, driver, q, t, p) for driver in describe(t, p))


def _range(module: ModuleType, driver: Driver, q: Array, t: float, p: Array) -> DriverRange:
    equations = problem(module, p, q, t, q)
    equations.code = _steered(equations.code, driver.row, t)
    equations.engine = Dense(equations.code, p)
    low, high = (_limit(equations, driver, q, sign) for sign in (-1.0, 1.0))
    return DriverRange(driver.name, driver.unit, driver.value, low, high)


def _limit(equations: Problem, driver: Driver, q: Array, sign: float) -> Limit:
    """Follow the driver one way."""
    reach = ROUND if driver.unit == "rad" else SIZES * float(np.max(equations.spread(q)))
    way = _Way(driver)
    latest = way.path(driver.value + sign * reach)
    march = March(equations, equations.engine, TOLERANCE)
    point = equations.at(q, 0.0)
    state = None if point is None else march.state(point)
    found = locate(march, state, latest, abs(latest)) if isinstance(state, State) else None
    if found is None:
        return Limit(sign * math.inf, "", (), np.empty(0))
    event = found[0]
    return Limit(way.value(event.t), event.kind, event.bodies, event.q)


@dataclass(frozen=True, slots=True)
class _Way:
    """What a driver is moved by, in its row of Phi, and its value then."""

    driver: Driver

    def path(self, value: float) -> float:
        """Return what the row is moved by where the driver has a value; a distance is positive."""
        start = self.driver.value
        return max(value, 0.0) ** 2 - start**2 if self.driver.is_squared else value - start

    def value(self, path: float) -> float:
        """Return the driver's value where its row is moved by so much."""
        start = self.driver.value
        return math.sqrt(max(start**2 + path, 0.0)) if self.driver.is_squared else start + path


def _steered(code: Code, row: int, t: float) -> Code:
    """Return a module at a fixed time, whose time is what is added to a row of its right side."""

    def position(q: Array, path: float, p: Array) -> tuple[Array, Array]:
        Phi, Phi_q = code.position(q, t, p)
        Phi = np.array(Phi)
        Phi[row] -= path
        return Phi, Phi_q

    def nu(_q: Array, _path: float, _p: Array) -> Array:
        return np.asarray(np.arange(len(code.equations)) == row, dtype=np.float64)

    def gamma(q: Array, q_dot: Array, _path: float, p: Array) -> Array:
        there, back, at_rest = (code.gamma(q, v, t, p) for v in (q_dot, -q_dot, 0 * q_dot))
        return np.asarray((there + back) / 2 - at_rest)

    functions: dict[str, Any] = {"position": position, "nu": nu, "gamma": gamma}
    return replace(code, lanes=None, stages=(), march=None, march_variants=None, **functions)

"""How far a driver can go either way before the mechanism locks up.

At the start of a motion time stands still, and one driver is freed: the curve on which all other
equations hold is followed to the first place where the value of the driver turns back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.names import listed
from kincompile.runtime.engine.code import DRIVERS
from kincompile.runtime.problem import problem
from kincompile.runtime.results.columns import shown_unit
from kincompile.runtime.singular.events import BIFURCATION, LOCK_UP, involved
from kincompile.runtime.singular.reach import Measure, freed_curve
from kincompile.tables import table, without_noise

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.problem import Problem
    from kincompile.runtime.results.columns import MotionTable

LARGEST_FREED = 100
"""Coordinates up to which a range is searched for: it solves dense matrices, some hundred times."""

ROUND = math.tau
"""How far an angle is driven; further on everything comes again."""

SIZES = 4.0
"""How far a length is driven, in sizes of the mechanism."""


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

    def text(self, factor: float) -> str:
        """Return the value times a factor, kind and bodies."""
        if not self.kind:
            return "no limit met"
        return f"{factor * self.value:.6g} ({self.kind}: {listed(self.bodies)})"


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


def driver_ranges(solution: MotionTable, code: Compiled, p: Array) -> tuple[DriverRange, ...]:
    """Return the range of every driver from the first position of a motion."""
    q, t = np.ascontiguousarray(solution.q[0]), float(solution.t[0])
    is_square = len(code.equations) == q.size <= LARGEST_FREED
    if DRIVERS not in code.makers or not is_square or not np.isfinite(solution.q_ddot[0]).all():
        return ()
    with np.errstate(all="ignore"):
        equations = problem(code, p, q, t)
        found = []
        for name, unit, row, value, is_squared in code.request(DRIVERS)(t, p):
            form = Measure(unit, value**2 if is_squared else value, is_squared)
            low, high = (limit(equations, form, row, q, t, sign) for sign in (-1.0, 1.0))
            found.append(DriverRange(name, unit, value, low, high))
        return tuple(found)


def limit(equations: Problem, form: Measure, row: int, q: Array, t: float, sign: float) -> Limit:
    """Follow the driver of a row one way, up to the first singular configuration."""
    reach = ROUND if form.unit == "rad" else SIZES * float(np.max(equations.reference))
    point = equations.at(q, t)
    assert point is not None  # it was solved
    curve, state = freed_curve(equations, row, point, t)
    start = curve.start(state, sign)
    bracket = start and curve.next_singular(start, form.residual(form.value(0.0) + sign * reach))
    found = bracket and curve.singular_point(bracket)
    if not (bracket and found):
        return Limit(sign * math.inf, "", (), np.empty(0))
    place = found[0]
    kind = LOCK_UP if bracket.turns else BIFURCATION
    value = float(without_noise(form.value(place.t), reach))
    return Limit(value, kind, involved(equations.code, place.tangent[:-1]), place.q)


def driver_table(drivers: tuple[DriverRange, ...], angle_unit: str) -> list[str]:
    """Return the lines of the table of drivers."""
    rows = []
    for item in drivers:
        unit, factor = shown_unit(item.unit, angle_unit)
        limits = (limit.text(factor) for limit in (item.low, item.high))
        rows.append([item.name, unit, f"{factor * item.start:.6g}", *limits])
    header = ("driver", "unit", "at start", "goes down to", "goes up to")
    return table(header, rows, right=header[2:3]) if rows else []

r"""Exact derivatives of a motion by parameters: position, velocity, acceleration and outputs.

The matrix is the mechanism's own Phi_q for all of them. Straight-line code with the planned
elimination in it (`ir/implicit.py`) gives them, compiled on request for these parameters. Where
that may not be trusted, the right sides come from the mechanism with its sensitivities
(`ir/sensitive.py`),

.. math:: \Phi_q q_a = -\Phi_a, \qquad \Phi_q \dot q_a = \nu_a - C \dot q, \qquad
          \Phi_q \ddot q_a = \gamma_a - C \ddot q, \qquad C = (\Phi_q q_a + \Phi_a)_q.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from kincompile.criteria import AGREEMENT, SOLVED
from kincompile.errors import InputError
from kincompile.html import Tabled
from kincompile.names import (
    listed,
    parameters_problem,
    quotient_unit,
    rate_unit,
    unknown,
)
from kincompile.runtime.engine.code import SENSITIVE, SENSITIVITIES, code_of, column_meant
from kincompile.runtime.engine.linear import powers_of_rows
from kincompile.runtime.inputs import names_of
from kincompile.runtime.results.columns import largest
from kincompile.runtime.results.observed import Points, observed
from kincompile.runtime.results.solution import require_solution

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.results.solution import Solution

    Coupling = Sequence[tuple[int, int, Array]]

WITNESSES = 5
"""Points at which redundant equations are looked at; most of them stand nowhere special."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sensitivities(Tabled):
    """Derivatives of a motion by k parameters, over N points of n coordinates and r outputs.

    ``found["phi_rod", "a"]``, ``found["rod.phi_dot", "a"]`` and the like give them by name, and
    ``found["phi_rod", "a", "b"]`` second derivatives where they were asked for. All are
    NaN where the motion was not found, or has no velocity. Of B parameter sets, all arrays have a
    leading axis of length B.

    Attributes
    ----------
    t : ndarray, shape (N,)
        Time.
    q_p, q_dot_p, q_ddot_p : ndarray, shape (N, n, k)
        Derivatives of the coordinates, their rates and second rates.
    y_p, y_dot_p, y_ddot_p : ndarray, shape (N, r, k)
        Those of the outputs; NaN where an output has no such rate.
    name
        Name of the mechanism.
    coordinates, outputs, parameters : tuple of str
        What the axes belong to.
    units : dict
        Unit of each coordinate, output and parameter.
    second : ndarray, shape (3, N, n + r, k, k), or None
        Second derivatives of coordinates and outputs, of their rates and second rates; NaN also
        where Phi_q is nearly singular, or both planned eliminations miss their equations.
    """

    header = ("column", "by", "largest", "unit")
    numbers = ("largest",)

    t: Array
    q_p: Array
    q_dot_p: Array
    q_ddot_p: Array
    y_p: Array
    y_dot_p: Array
    y_ddot_p: Array
    name: str
    coordinates: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    units: dict[str, str]
    second: Array | None = None

    def __getitem__(self, names: tuple[str, str] | tuple[str, str, str]) -> Array:
        """Return the derivative of a column by a parameter, or by two, shape (N,).

        Raises
        ------
        InputError
            When there is no such column, or no such parameter among those asked for.
        """
        column, *parameters = _names(names, self.name)
        k, *others = map(self._place, parameters)
        name, order = self._found(column)
        if others:
            return self._second(order)[
                ..., (*self.coordinates, *self.outputs).index(name), k, others[0]
            ]
        if name in self.coordinates:
            values = (self.q_p, self.q_dot_p, self.q_ddot_p)[order]
            return values[..., self.coordinates.index(name), k]
        values = (self.y_p, self.y_dot_p, self.y_ddot_p)[order]
        return values[..., self.outputs.index(name), k]

    def _second(self, order: int) -> Array:
        """Return the second derivatives of columns, or of their rates."""
        if self.second is None:
            raise InputError(
                f"second derivatives of {self.name} were not asked for: give second=True to "
                "kc.sensitivities."
            )
        found: Array = self.second[order]
        return found

    def unit(self, column: str, *parameters: str) -> str:
        """Return the unit of the derivative of a column by parameters: that of their quotient."""
        name, order = self._found(column)
        unit = rate_unit(self.units[name], order)
        for parameter in parameters:
            self._place(parameter)
            unit = quotient_unit(unit, self.units[parameter])
        return unit

    def _place(self, name: str) -> int:
        """Return the number of a parameter."""
        if name in self.parameters:
            return self.parameters.index(name)
        text = f"{self.name} has no sensitivities to {name!r}"
        raise InputError(unknown(text, name, self.parameters, "; ask kc.sensitivities for others"))

    def _found(self, column: str) -> tuple[str, int]:
        """Return the coordinate or output, and the order of the rate, that a name means."""
        return column_meant(self.name, column, self.coordinates, self.outputs)

    def rows(self) -> list[tuple[str, ...]]:
        """Return by parameter the largest absolute derivative of each column."""
        return [
            (name, parameter, f"{largest(self[name, parameter]):.6g}", self.unit(name, parameter))
            for name in (*self.coordinates, *self.outputs)
            for parameter in self.parameters
        ]

    def headline(self) -> str:
        """Return the name and the parameters."""
        return f"{self.name}: sensitivities to {listed(self.parameters)} at {self.t.size} times"


def _names(names: object, mechanism: str) -> tuple[str, ...]:
    """Return a column and one or two parameters, checked."""
    match names:
        case (str(), str()) | (str(), str(), str()):
            return cast("tuple[str, ...]", names)
    raise InputError(
        f"sensitivities of {mechanism} are asked for by a column and a parameter, as in "
        f'found["rod.phi", "a"], not by {names!r}.'
    )


def sensitivities(
    solution: Solution,
    parameters: str | Sequence[str],
    of: str | Sequence[str] | None = None,
    *,
    second: bool = False,
) -> Sensitivities:
    r"""Differentiate a motion by parameters, exactly.

    With :math:`\Phi(q, t, p) = 0` all derivatives of q, its rates and the outputs are solutions of
    linear systems whose matrix is Phi_q. Their code is derived and compiled on request, and kept.

    Parameters
    ----------
    solution
        A motion, or one for each of several parameter sets.
    parameters
        Names of parameters.
    of
        Coordinates and outputs that are wanted, ``["foot.x", "rod.phi"]``; all where it is not
        given. Of a few columns many parameters cost hardly more than one: they are differentiated
        by solves with the transposed matrix.
    second
        Whether second derivatives are wanted too: the code grows with the square of the number of
        parameters.

    Returns
    -------
    Sensitivities
        ``found["rod.phi", "a"]`` is :math:`\partial\varphi_{rod}/\partial a` over time.

    Raises
    ------
    InputError
        If this is no Solution, or one that was pickled or solved with a module from a file, a
        name belongs to no parameter or column, or is there twice, or redundant equations would no
        longer agree if a parameter changed.
    UnsupportedError
        If the mechanism is so large that its module is in grouped form.
    """
    require_solution(solution)
    names = names_of(parameters, "parameters")
    if problem := parameters_problem(names, tuple(solution.parameters), solution.name):
        raise InputError(problem)
    code = code_of(solution.require_module("its sensitivities"))
    columns = (*code.coordinates, *code.outputs)
    if of is not None:
        columns = _columns(names_of(of, "of"), code)
    found = _Asked(code, names, columns, second).over(Points.of(solution))
    found = found.reshape(*found.shape[:3], *solution.q.shape[:-1])
    found, pairs = found[:, : len(names)], found[:, len(names) :]
    size = len(set(columns) & set(code.coordinates))
    parts = found[:, :, :size], found[:, :, size:]
    q_p, y_p = (np.moveaxis(part, (1, 2), (-1, -2)) for part in parts)
    return Sensitivities(
        solution.t,
        *(q_p[0], q_p[1], q_p[2]),
        *(y_p[0], y_p[1], y_p[2]),
        solution.name,
        columns[:size],
        columns[size:],
        names,
        dict(code.units),
        _symmetric(pairs, len(names)) if second else None,
    )


def slopes_of(
    code: Compiled, names: tuple[str, ...], columns: Sequence[str], points: Points
) -> Array:
    """Return derivatives of columns by parameters at points, (3, k, columns, L).

    The columns come in the order of the coordinates, then of the outputs. They are NaN where the
    planned elimination cannot be trusted.
    """
    asked = _Asked(code, names, _columns(tuple(columns), code), False)
    with np.errstate(all="ignore"):
        found, is_trusted = asked.by_plan(points)
    found[..., ~is_trusted] = np.nan
    return found


def _symmetric(pairs: Array, count: int) -> Array:
    """Return derivatives by pairs (3, pairs, columns, ..., N) as (3, ..., N, columns, k, k)."""
    places = np.empty((count, count), dtype=np.intp)
    first, other = np.triu_indices(count)
    places[first, other] = places[other, first] = np.arange(first.size)
    found: Array = np.moveaxis(pairs[:, places], (1, 2, 3), (-2, -1, -3))
    return found


def _columns(of: Sequence[str], code: Compiled) -> tuple[str, ...]:
    """Return the names of columns, the coordinates first."""
    if not of:
        raise InputError(f"no column of {code.name} is asked for: name one.")
    wanted = code.columns(of, advice="derivatives of rates come with them")
    known = (*code.coordinates, *code.outputs)
    return tuple(name for k, name in enumerate(known) if k in wanted)


def _are_met(matrix: Array, rates: Array, sides: Array, part: float) -> NDArray[np.bool_]:
    """Say at which of (..., n) rates all equations are met, up to a part of the largest terms."""
    rates = rates[..., np.newaxis]
    terms = (np.abs(matrix) @ np.abs(rates))[..., 0] + np.abs(sides)
    missing = np.abs((matrix @ rates)[..., 0] - sides)
    return np.asarray(np.max(missing, axis=-1) <= part * np.max(terms, axis=-1))


@dataclass(frozen=True, slots=True, eq=False)
class _Asked:
    """What is asked for: the derivatives of columns by parameters."""

    code: Compiled
    names: tuple[str, ...]
    columns: tuple[str, ...]
    second: bool

    def over(self, points: Points) -> Array:
        """Return derivatives of columns and their rates, shape (3, k, columns, L).

        Those by pairs of parameters come after those by one.
        """
        k = len(self.names)
        finite = np.isfinite(points.q_dot.sum(axis=0))
        if self.code.redundant and finite.any():
            some = np.flatnonzero(finite)
            self._require_agreement(points.at(some[:: max(1, some.size // WITNESSES)]))
        with np.errstate(all="ignore"):
            found, is_trusted = self.by_plan(points)
            # A pivot of a generic state may vanish wherever the equations are met.
            for own, some_points in points.parts(finite & ~is_trusted):
                found[..., own], is_trusted[own] = self.by_plan(some_points, is_near=True)
            for own, some_points in points.parts(finite & ~is_trusted):
                found[:, :k, :, own] = self._by_matrices(some_points)
                found[:, k:, :, own] = np.nan
        if not finite.all():
            found[..., ~finite] = np.nan
        accelerated = np.isfinite(points.q_ddot.sum(axis=0))
        if not accelerated.all():  # a corner of a driver
            size = sum(name in self.code.coordinates for name in self.columns)
            found[2, :, :size, ~accelerated] = np.nan
        return found

    def _require_agreement(self, points: Points) -> None:
        """Refuse parameters that would take apart a mechanism with redundant equations."""
        matrices, sides = self._slopes(points)
        moved = np.linalg.pinv(matrices)[:, np.newaxis] @ sides[..., np.newaxis]
        are_met = _are_met(matrices[:, np.newaxis], moved[..., 0], sides, AGREEMENT)
        agree = (are_met.mean(axis=0) > 1 / 2).tolist()
        if wrong := [name for name, good in zip(self.names, agree, strict=True) if not good]:
            raise InputError(
                f"{self.code.name} has redundant equations, {listed(self.code.redundant)}, which "
                f"would no longer agree with the others if {listed(wrong)} changed alone: it could "
                "not be assembled. Make one parameter of all dimensions that have to change "
                "together."
            )

    def by_plan(self, points: Points, *, is_near: bool = False) -> tuple[Array, NDArray[np.bool_]]:
        """Return the derivatives by the planned elimination, and where that can be trusted.

        Its pivots are those of a generic state, or of the position at the start.
        """
        code = self.code.request(SENSITIVITIES, self.names, self.columns, self.second, is_near)
        k, count = len(self.names), points.t.size
        size = k + self.second * k * (k + 1) // 2, len(self.columns)
        if code is None:
            return np.empty((3, *size, count)), np.zeros(count, dtype=bool)
        found, is_trusted = points.solved(code, math.prod(size), 3)
        return found.reshape(3, *size, count), is_trusted

    def _slopes(self, points: Points) -> tuple[Array, Array]:
        """Return Phi_q, (L, m, n), and -Phi_a of each parameter, (L, k, m)."""
        m, k, q, t, p = len(self.code.equations), len(self.names), points.q.T, points.t, points.p.T
        held = np.concatenate((q, np.zeros((len(q), k * q.shape[1]))), axis=1)
        sides = -self.code.request(SENSITIVE, self.names).position(held, t, p)[0][:, m:]
        return self.code.Phi_q(q, t, p), sides.reshape(-1, k, m)

    def _by_matrices(self, points: Points) -> Array:
        """Return the derivatives by singular values; of redundant equations by least squares."""
        larger = self.code.request(SENSITIVE, self.names)
        m, n, k = len(self.code.equations), len(self.code.coordinates), len(self.names)
        q, q_dot, q_ddot, p = points.q.T, points.q_dot.T, points.q_ddot.T, points.p.T
        t, (matrices, first) = points.t, self._slopes(points)
        powers = powers_of_rows(matrices)[:, np.newaxis]
        even, part = powers.swapaxes(1, 2) * matrices, AGREEMENT if self.code.redundant else SOLVED
        inverses = np.linalg.pinv(even)

        def solved(sides: Array) -> Array:
            """Return derivatives, (L, k n), for right sides below the mechanism's own."""
            own = sides.reshape(-1, k, m)
            found: Array = np.einsum("lij,lkj->lki", inverses, powers * own)
            found[~_are_met(even[:, np.newaxis], found, powers * own, part)] = np.nan
            return found.reshape(-1, k * n)

        every_q = np.concatenate((q, solved(first)), axis=1)
        coupling = _coupling(larger, every_q, t, p, m, n)
        nu = _reduced(larger.nu(every_q, t, p), coupling, q_dot)
        every_q_dot = np.concatenate((q_dot, solved(nu[:, m:])), axis=1)
        gamma = _reduced(larger.gamma(every_q, every_q_dot, t, p), coupling, q_ddot)
        every = every_q, every_q_dot, np.concatenate((q_ddot, solved(gamma[:, m:])), axis=1)
        found = np.array(every)[..., n:].reshape(3, -1, k, n)
        if outputs := self.code.outputs:
            # As motions of one point each, where each has parameters of its own.
            if p.ndim > 1:
                first, rates, second = (part[:, np.newaxis] for part in every)
                every, t = (first, rates, second), t[:1]
            seen = observed(larger, every, t, p)
            y = np.array((seen.y, seen.y_dot, seen.y_ddot))[..., len(outputs) :]
            found = np.concatenate((found, y.reshape(3, -1, k, len(outputs))), axis=-1)
        places = [(*self.code.coordinates, *outputs).index(name) for name in self.columns]
        by_point: Array = np.moveaxis(found[..., places], 1, -1)
        return by_point


def _coupling(larger: Compiled, q: Array, t: Array, p: Array, m: int, n: int) -> Coupling:
    """Return row, column and values of the entries left of the diagonal blocks."""
    entries = larger.nonzeros(q, t, p)
    return [
        (row, column, entries[:, number])
        for number, (row, column) in enumerate(larger.pattern.tolist())
        if row >= m and column < n
    ]


def _reduced(sides: Array, coupling: Coupling, rates: Array) -> Array:
    """Return right sides without the part of the rates that are known."""
    for row, column, values in coupling:
        sides[:, row] -= values * rates[:, column]
    return sides

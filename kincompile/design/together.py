"""Starts that need not be assembled: parameters and positions are found together.

sets   -> pulled   positions at the times of targets where the equations are missed least
pulled -> led      steps of Gauss and Newton in variables and all positions at once

Links may be stretched at first so that points come to their targets, and then less and less: the
method of deformation energy (Avilés, Ajuria, García de Jalón 1985). Positions at one time depend on
those at another through the variables alone, so they are eliminated time by time; what remains is
one system of the size of the variables for each start.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import probe_of
from kincompile.design.demands import deviation
from kincompile.design.descent import lanes_of
from kincompile.runtime.engine.code import SENSITIVE, code_of
from kincompile.runtime.engine.linear import Planned, stacked
from kincompile.runtime.results.observed import Points

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.design.descent import Descent
    from kincompile.runtime.engine.code import Compiled

    Array = NDArray[np.float64]
    Rows = tuple[Array, Array, Array]

STEPS, PULLS = 20, 4
"""Steps of a start; of its positions alone at each time, before that."""

STIFFNESS = (0.1, 100.0)
"""Weight of the equations beside that of targets, in the first step and in the last."""

PULL, EASE, HOLD = 1e-4, 1e-5, 1e-2
"""Damping: of positions alone, as a part of their terms; of positions; of variables."""

LARGEST_TURN, LARGEST_CHANGE = 0.5, 0.3
"""The most that a step turns a body by [rad], and changes a variable by, in parts of its bounds."""

FURTHER = 0.05
"""Part of all that was changed by which parameters are changed further."""

MOST_ENTRIES = 2**19
"""Entries of Phi_q at all times of all starts: of a four-bar at 18 times 359 starts."""


class Together:
    """Leads starts to where they are assembled, near their targets."""

    def __init__(self, descent: Descent) -> None:
        bench, self._variables = descent.bench, descent.variables
        self._descent, self._demands = descent, bench.demands
        self._code = code_of(bench.module)
        self._larger = self._code.request(SENSITIVE, bench.names)
        self._count = len(bench.names)
        self._known = self._code.coordinates + tuple(_without_rates(self._code))
        # (N, nt): derivatives of all times by the variables that are times
        size = self._variables.low.size
        times = descent.times(np.eye(size + 1)[self._count :, :size])
        self._times_by = (times[:-1] - times[-1]).T

    def led(self, values: Array, guesses: Array) -> tuple[Array, Array]:
        """Return parameters (2 B, k) that sets are led to, of as many as there is time for.

        With them come positions (2 B, n) at the first time, from which they can be assembled.
        Each begins with one of the guesses (g, n) in turn. What can only just be assembled is
        singular: there are also parameters a little further on.
        """
        entries = len(self._times_by) * len(self._code.equations) * guesses.shape[1]
        values = values[: max(1, MOST_ENTRIES // entries)]
        times = np.repeat([self._even_times()], len(values), axis=0)
        x = np.concatenate((values, times), axis=1)
        with np.errstate(all="ignore"):
            q = self._pulled(x, guesses[np.arange(len(x)) % len(guesses)])
            found, q = self._followed(x, q)
        variables = self._variables
        begun, u = variables.to_u(x), variables.to_u(found)
        change = np.where(variables.is_turn, (u - begun + 0.5) % 1.0 - 0.5, u - begun)
        further = variables.to_x(variables.within(u + FURTHER * change))
        first = q[:, self._descent.times(x)[0].argmin()]
        return np.concatenate((found, further))[:, : self._count], np.concatenate((first, first))

    def _even_times(self) -> Array:
        """Return variables that are times, evenly spread, (nt,)."""
        parts = [np.empty(0)]
        for (first, last), (target, _) in zip(
            self._demands.free, self._demands.untimed, strict=True
        ):
            steps = np.full(len(target.values), (last - first) / len(target.values))
            steps[0] = first + steps[0] / 2
            parts.append(steps)
        return np.concatenate(parts)

    def _pulled(self, x: Array, q: Array) -> Array:
        """Return positions (B, N, n), each pulled on from that at the time before."""
        t, sets = self._descent.times(x), self._descent.bench.sets(x)
        found = np.empty((*t.shape, q.shape[1]))
        q = q[:, np.newaxis]
        for place in np.argsort(t[0], kind="stable").tolist():
            for _ in range(PULLS):
                off, by = self._equations(sets, t[:, [place]], q)
                scale, terms = self._scales(by)
                by, off = by * scale / terms[..., np.newaxis], off / terms
                square = np.einsum("bpri,bprj->bpij", by, by)
                damping = PULL * np.einsum("bpii->bpi", square)
                slope = np.einsum("bpri,bpr->bpi", by, off)
                change = -_damped(square, damping, slope[..., np.newaxis])[..., 0]
                part = self._shortening(change)[:, np.newaxis, np.newaxis]
                q = q + part * scale[..., 0, :] * np.nan_to_num(change)
            found[:, place] = q[:, 0]
        return found

    def _followed(self, x: Array, q: Array) -> tuple[Array, Array]:
        """Return variables, and positions, that steps in both lead to."""
        variables, m = self._variables, len(self._code.equations)
        u = variables.to_u(x)
        for weight in np.geomspace(*STIFFNESS, STEPS).tolist():
            x = variables.to_x(u)
            off, by_q, by_u = self.rows(x, q)
            scale, terms = self._scales(by_q)
            terms[..., :m] /= weight
            terms[..., m:] = terms[..., m:].max(axis=-1, keepdims=True, initial=0.0)
            off, by_q = off / terms, by_q * scale / terms[..., np.newaxis]
            by_u = by_u * variables.slopes(x)[:, np.newaxis, np.newaxis] / terms[..., np.newaxis]
            change, du = _step(off, by_q, by_u, partial(variables.step, u))
            part = LARGEST_CHANGE / np.maximum(np.abs(du).max(axis=1), LARGEST_CHANGE)
            part = np.where(np.isfinite(part), self._shortening(change, part), 0.0)
            u = variables.within(u + part[:, np.newaxis] * np.nan_to_num(du))
            q = q + part[:, np.newaxis, np.newaxis] * scale[..., 0, :] * np.nan_to_num(change)
        return variables.to_x(u), q

    def _shortening(self, change: Array, part: Any = 1.0) -> Array:
        """Return which part of a change of positions (B, N, n), in scales, is taken."""
        turns = np.abs(change[..., self._code.angular])
        part = np.minimum(part, LARGEST_TURN / turns.max(axis=(1, 2), initial=LARGEST_TURN))
        return np.where(np.isfinite(change).all(axis=(1, 2)), part, 0.0)

    def _scales(self, by: Array) -> tuple[Array, Array]:
        """Return scales of coordinates (B, 1, 1, n), and sizes of rows (B, 1, R).

        The size of a mechanism is its largest lever arm, dPhi/dphi, among the derivatives.
        """
        m, angular = len(self._code.equations), self._code.angular
        arm = np.abs(by[:, :, :m, angular]).max(axis=(1, 2, 3), initial=0.0)
        arm = np.where(arm > 0, arm, 1.0)[:, np.newaxis]
        scale = np.where(angular, 1.0, arm)[:, np.newaxis, np.newaxis]
        terms = np.abs(by * scale).max(axis=(1, 3))[:, np.newaxis]
        return scale, np.where(terms > 0, terms, 1.0)

    def _equations(self, sets: Array, t: Array, q: Array) -> tuple[Array, Array]:
        """Return Phi (B, N, m) and Phi_q (B, N, m, n)."""
        code, (count, steps, n) = self._code, q.shape
        at = Planned(code, lanes_of(sets, steps)).evaluate(q.reshape(-1, n).T, t.ravel())
        by = np.zeros((count * steps, len(code.equations), n))
        varying = iter(at.Phi_q)
        for row, column, number in code.entries:
            by[:, row, column] = next(varying) if number is None else number
        Phi = stacked(at.Phi, count * steps).T
        return Phi.reshape(count, steps, -1), by.reshape(count, steps, -1, n)

    def rows(self, x: Array, q: Array) -> Rows:
        """Return equations and deviations of targets (B, N, R), by positions and by variables.

        Their derivatives are (B, N, R, n) and (B, N, R, nx). Rates are not asked for.
        """
        descent, larger, k = self._descent, self._larger, self._count
        (count, steps, n), t, sets = q.shape, descent.times(x), descent.bench.sets(x)
        m, size = len(self._code.equations), count * steps
        held = np.concatenate((q.reshape(-1, n).T, np.zeros((n * k, size))))
        none = np.zeros_like(held)
        points = Points(lanes_of(sets, steps), t.ravel(), held, none, none)
        assert larger.lanes is not None
        f, own = larger.lanes.arrays, larger.lanes
        values = own.position(f, held, points.t, points.p)[: m * (1 + k)]
        moving = own.nu(f, held, points.t, points.p)[:m]

        def by_variables(parts: Array, rates: Array) -> Array:
            """Return derivatives by parameters (k r, L) and by time (r, L), by all variables."""
            by_p = np.moveaxis(parts.reshape(k, -1, count, steps), (0, 1), (3, 2))
            by_t = np.moveaxis(rates.reshape(-1, count, steps), 0, 2)[..., np.newaxis]
            return np.concatenate((by_p, by_t * self._times_by[:, np.newaxis]), axis=3)

        Phi, Phi_q = self._equations(sets, t, q)
        Phi_u = by_variables(stacked(values[m:], size), -stacked(moving, size))
        y, y_q, y_u = self._columns(points, q, by_variables)
        targets = self._deviations(y, y_q, y_u)
        found = zip((Phi, Phi_q, Phi_u), targets, strict=True)
        off, by_q, by_u = (np.concatenate(pair, axis=2) for pair in found)
        return off, by_q, by_u

    def _columns(self, points: Points, q: Array, by_variables: Any) -> Rows:
        """Return coordinates and outputs, (B, N, n + r), by positions and by variables."""
        (count, steps, n), code = q.shape, self._code
        r, own = len(code.outputs), np.broadcast_to(np.eye(n), (count, steps, n, n))
        none = np.zeros((count, steps, n, self._variables.low.size))
        if not r:
            return q, own, none
        values, rates, _ = points.observe(self._larger, points.p, 3)
        y = np.moveaxis(values[:r].reshape(r, count, steps), 0, 2)
        still = np.zeros((count * steps, n))
        flat = q.reshape(-1, n)
        y_q = code.outputs_q(flat, still, still, points.t, points.p.T).reshape(count, steps, r, n)
        y_u = by_variables(values[r:], rates[:r])
        pairs = (q, y), (own, y_q), (none, y_u)
        every, by_q, by_u = (np.concatenate(pair, axis=2) for pair in pairs)
        return every, by_q, by_u

    def _deviations(self, y: Array, y_q: Array, y_u: Array) -> Rows:
        """Return weighted deviations of passing targets from columns, each at its own times."""
        names, demands = (*self._code.coordinates, *self._code.outputs), self._demands
        width = max((len(columns) for _, columns in demands.passing), default=0)
        found = [np.zeros((*part.shape[:2], width, *part.shape[3:])) for part in (y, y_q, y_u)]
        first = len(demands.grid)
        for target, columns in demands.passing:
            own = slice(first, first + len(target.values))
            first = own.stop
            for j, column in enumerate(columns):
                if column.order or column.of not in self._known:
                    continue
                place, weight = names.index(column.of), float(target.weights[j])
                found[0][:, own, j] = weight * deviation(
                    target.values[:, j], column, y[:, own, place]
                )
                for part, by in zip(found[1:], (y_q, y_u), strict=True):
                    part[:, own, j] = weight * by[:, own, place]
        return found[0], found[1], found[2]


def _without_rates(code: Compiled) -> list[str]:
    """Return the outputs that have no rates in them: the others have no second rate."""
    if not code.outputs:
        return []
    probe = probe_of(code.guess.size)
    with np.errstate(all="ignore"):
        rates = code.observe(code.guess, probe, probe**2, 0.0, code.defaults)[2]
    return [name for name, rate in zip(code.outputs, rates, strict=True) if not np.isnan(rate)]


def _step(off: Array, by_q: Array, by_u: Array, solved: Any) -> tuple[Array, Array]:
    """Return the step in positions (B, N, n) and in variables (B, nx) to the least squares.

    `solved` gives the one in variables of the matrix and the slope that remain for them.
    """
    transposed = by_q.swapaxes(2, 3)
    square, across = transposed @ by_q, transposed @ by_u
    slope = transposed @ off[..., np.newaxis]
    both = _damped(square, EASE, np.concatenate((across, slope), axis=3))
    by_change, change = both[..., :-1], both[..., -1]
    matrix = np.einsum("bpri,bprj->bij", by_u, by_u)
    matrix -= np.einsum("bpij,bpik->bjk", across, by_change)
    matrix += HOLD * np.eye(matrix.shape[1])
    rest = np.einsum("bpri,bpr->bi", by_u, off) - np.einsum("bpij,bpi->bj", across, change)
    du = solved(matrix, rest)
    return -change - np.einsum("bpij,bj->bpi", by_change, du), du


def _damped(square: Array, damping: Any, right: Array) -> Array:
    """Return x of (A + damping) x = b of many symmetric matrices."""
    count = square.shape[-1]
    added = np.where(damping > 0, damping, 1.0) * np.ones(count)
    return np.asarray(np.linalg.solve(square + added[..., np.newaxis] * np.eye(count), right))

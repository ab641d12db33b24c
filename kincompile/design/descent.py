"""Many starts of a fit at once, each followed to a minimum by least squares of its own.

starts  -> Batch     motions, each solved at its own times alone, from the positions of before
Placing -> Batch     moved, turned and scaled as a whole to where targets are, where that can be
Batch   -> steps     of Levenberg and Marquardt, damped as Nielsen (1999) does
linear  -> Batch     parameters on which targets depend linearly have their best values in every
                     trial: variable projection (Golub, Pereyra 1973)

All points of all motions are one batch. Determinants keep their signs, so that no point leaves its
branch; whether the mechanism gets from one point to the next is seen when the end is judged.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import TOLERANCE
from kincompile.design.designs import Designs
from kincompile.design.placing import Placing, best_places
from kincompile.design.rows import Columns, Motions
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.engine.linear import Planned
from kincompile.runtime.march import March, all_hold
from kincompile.runtime.problem import problem
from kincompile.runtime.results.observed import Points
from kincompile.runtime.results.sensitivities import slopes_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from kincompile.design.trial import Workbench
    from kincompile.design.variables import Variables

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

CORRECTIONS = 6
"""Of Newton's method, for a trial; one that takes more is too far from the trial before."""

ITERATIONS = 120
"""Steps of a start, at most."""

KEPT = {8: 4.0, 20: 2.0, 40: 1.0, 80: 0.25}
"""After how many steps the best are kept, in parts of the starts that are followed. Others are left
out, and in the end stay where they are."""

MOST_POINTS = 2**16
"""Points of a batch: of a four-bar with ten parameters some hundred megabytes."""

FEWEST = 8
"""Starts that are kept, at least."""

SETTLED = 1e-13
"""Relative change of the error at which a start has come to its end."""

MOST_DAMPED, REACHED = 1e12, 1e-28
"""Damping at which a start has come to its end, and error that is as good as zero."""

WITNESSES = 24
"""Motions from which it is seen which parameters are linear, and which move the whole."""

PROBE = 1e-3
"""Part of the bounds by which a parameter is changed for that."""

SAME = 1e-10
"""Part of the largest singular value of derivatives up to which one counts as zero."""

LINEAR = 1e-8
"""Part of the largest derivative within which derivatives are the same."""


@dataclass(slots=True, eq=False)
class Batch:
    """Motions of B sets of variables at N times each."""

    x: Array  # (B, nx)
    t: Array  # (B, N)
    # (B, N, n) each
    q: Array
    q_dot: Array
    q_ddot: Array
    signs: Array  # (B, N, blocks): of the determinants
    # (B,): error, with what limits are exceeded by; infinite where not all points were found
    cost: Array

    @property
    def good(self) -> Mask:
        """Where all points were found."""
        return np.isfinite(self.cost)

    def some(self, which: Any) -> Batch:
        """Return some of them."""
        return Batch(*(getattr(self, name)[which] for name in self.__slots__))

    def put(self, which: Any, other: Batch) -> None:
        """Take others in the places of some."""
        for name in self.__slots__:
            getattr(self, name)[which] = getattr(other, name)


@dataclass(slots=True, eq=False)
class Descent:
    """Follows many starts."""

    bench: Workbench
    variables: Variables
    motions: int = 0  # how many were solved
    _linear: tuple[int, ...] | None = field(default=None, init=False)

    def solved(self, x: Array, q: Array, signs: Array | None = None) -> Batch:
        """Solve motions (B, nx) from positions nearby (B, N, n), on the branch of signs."""
        code, t, sets = code_of(self.bench.module), self.times(x), self.bench.sets(x)
        count, steps, n = q.shape
        flat = np.ascontiguousarray(q.reshape(-1, n).T)
        self.motions += count
        with np.errstate(all="ignore"):
            equations = problem(code, sets[0], q[0, 0], float(t[0, 0]))
            march = March(equations, Planned(code, lanes_of(sets, steps)), TOLERANCE)
            found = march.correct_together(flat, t.ravel(), CORRECTIONS)
            state, checks = march.complete(found.point)
        good = np.reshape(all_hold(found.good, checks), (count, steps))
        now = np.sign(state.determinants).T.reshape(count, steps, -1)
        if signs is not None:
            good = good & (now == signs).all(axis=2)
        states = state.point.q, state.q_dot, state.q_ddot
        q, q_dot, q_ddot = (part.T.reshape(count, steps, n) for part in states)
        batch = Batch(x, t, q, q_dot, q_ddot, now, np.where(good.all(axis=1), 0.0, np.inf))
        if batch.good.any():
            batch.cost[batch.good] = self.seen(batch.some(batch.good)).costs()
        return batch

    def times(self, x: Array) -> Array:
        """Return the times of motions, (B, N): those of the grid, then of each passing target."""
        demands = self.bench.demands
        own = [demands.instants(row) for row in x[:, len(self.bench.names) :]]
        return np.array([np.concatenate([demands.grid, *parts]) for parts in own])

    def seen(self, batch: Batch, names: tuple[str, ...] = ()) -> Motions:
        """Return their columns, with derivatives by some parameters."""
        code, demands = code_of(self.bench.module), self.bench.demands
        motion, sets = (batch.q, batch.q_dot, batch.q_ddot), self.bench.sets(batch.x)
        slope: Callable[[str, int], Array] | None = None
        if names:
            count, steps, n = batch.q.shape
            states = (np.ascontiguousarray(part.reshape(-1, n).T) for part in motion)
            points = Points(lanes_of(sets, steps), batch.t.ravel(), *states)
            found = slopes_of(code, names, demands.columns, points)
            by = found.reshape(3, len(names), -1, count, steps)
            order_of = [x for x in (*code.coordinates, *code.outputs) if x in demands.columns]

            def slope(name: str, order: int) -> Array:
                return np.moveaxis(by[order, :, order_of.index(name)], 0, -1)

        first, places = demands.grid.size, []
        for target, _ in demands.passing:
            own = np.arange(first, first + len(target.values))
            places.append(np.broadcast_to(own, (len(batch.x), own.size)))
            first += own.size
        grid = np.arange(demands.grid.size)
        column = Columns(code, motion, batch.t, sets).column
        return Motions(demands, batch.t, grid, places, column, slope, is_fine=False)

    def run(self, x: Array, q: Array, starts: int, is_over: Callable[[int], bool]) -> Designs:
        """Follow motions (B, nx), the best first, from positions (B, N, n) to the ends of the best.

        Of many times they are fewer, as memory is bounded.
        """
        few = slice(max(FEWEST, MOST_POINTS // q.shape[1]))
        batch = self.solved(x[few], q[few])
        batch = batch.some(batch.good)
        if not len(batch.x):
            return Designs.none()
        ends, walk = [], _Walk(self, self.projected(self._placed(batch)))
        for step in range(ITERATIONS):
            count, cost = len(walk.u), walk.batch.cost
            if step in KEPT and (most := max(FEWEST, int(KEPT[step] * starts))) < count:
                rest = np.ones(count, dtype=bool)
                rest[np.argsort(cost, kind="stable")[:most]] = False
                if KEPT[step] < 1:
                    ends.append(walk.ends(rest))
                walk.drop(rest)
            if walk.is_done.any():
                ends.append(walk.ends(walk.is_done))
                walk.drop(walk.is_done)
            if is_over(step) or not len(walk.u):
                break
            walk.step()
        ends.append(walk.ends(slice(None)))
        return Designs.best(ends)

    def _placed(self, batch: Batch) -> Batch:
        """Move, turn and scale mechanisms as a whole to where their points are wanted."""
        pairs = self._point_pairs()
        if not pairs or not len(batch.x):
            return batch
        names, some = self.bench.names, batch.some(slice(WITNESSES))
        seen = self.seen(some, names)
        z, slopes = _complex(seen, pairs[:1])
        placing = Placing.of(z, slopes, some.x[:, : len(names)])
        if placing is None:
            return batch
        linear = [names[k] for k in self.linear_of(some) if not placing.fields[:2, k].any()]
        seen = self.seen(batch, tuple(linear) or names[:1])
        parts = [
            _complex(seen, [pair], places)
            for pair, places in zip(pairs, seen.instants, strict=True)
        ]
        z, slopes = (np.concatenate([part[k] for part in parts], axis=1) for k in range(2))
        passing = [target for target, _ in self.bench.demands.passing]
        wanted = np.concatenate([item.values @ [1, 1j] for item in passing])
        weights = np.concatenate([np.full(len(item.values), item.weights[0]) for item in passing])
        known = np.isfinite(slopes).all(axis=(1, 2))
        batch, z, slopes = batch.some(known), z[known], slopes[known][..., : len(linear)]
        place, turn, along = best_places(z, slopes, wanted, weights)
        x, k = batch.x.copy(), len(names)
        x[:, [names.index(name) for name in linear]] += along
        x[:, :k] = placing.moved(x[:, :k], place, turn)
        return self._taken(
            batch,
            self.variables.around(x),
            _turned(code_of(self.bench.module), batch.q, place, turn),
        )

    def _taken(self, batch: Batch, x: Array, q: Array) -> Batch:
        """Return motions at other variables, where these lie within bounds and are no worse."""
        inside = np.flatnonzero(self.variables.hold(x))
        if inside.size:
            found = self.solved(x[inside], q[inside], batch.signs[inside])
            better = found.cost < batch.cost[inside]
            batch.put(inside[better], found.some(better))
        return batch

    def _point_pairs(self) -> list[tuple[str, str]]:
        """Return the points whose two coordinates all targets are about; else nothing."""
        demands, pairs = self.bench.demands, []
        for _, columns in demands.passing:
            names = [item.of for item in columns]
            letters = [name.partition("_")[0] for name in names]
            if letters != ["x", "y"] or any(item.order for item in columns):
                return []
            pairs.append((names[0], names[1]))
        return [] if demands.shaped or demands.ratios else pairs

    def linear_of(self, batch: Batch) -> tuple[int, ...]:
        """Return the numbers of parameters on which deviations depend linearly, all together.

        They are those whose derivatives none of them changes; limits must not depend on them.
        """
        if self._linear is None:
            self._linear = tuple(self._found_linear(batch))
        return self._linear

    def _found_linear(self, batch: Batch) -> list[int]:
        names, (low, high) = self.bench.names, (self.variables.low, self.variables.high)
        seen = self.seen(batch, names)
        before, (_, limits) = seen.rows()[1], seen.gaps()
        assert before is not None
        assert limits is not None
        keeps = np.zeros((len(names), len(names)), dtype=bool)
        for k in range(len(names)):
            x = batch.x.copy()
            step = PROBE * (high[k] - low[k])
            x[:, k] += np.where(x[:, k] + step > high[k], -step, step)
            found = self.solved(x, batch.q, batch.signs)
            if not found.good.any():
                continue
            after = self.seen(found.some(found.good), names).rows()[1]
            assert after is not None
            own = before[found.good]
            # A motion without derivatives says nothing of what is linear.
            has_both = np.isfinite(after + own).all(axis=(1, 2))
            after, own = after[has_both], own[has_both]
            same = np.abs(after - own) <= LINEAR * np.abs(own).max(axis=(1, 2), keepdims=True)
            keeps[:, k] = same.all(axis=(0, 1))[: len(names)] & has_both.any()
        chosen: list[int] = []
        for k in np.flatnonzero(keeps.diagonal()).tolist():
            is_free = not np.nan_to_num(limits[..., k]).any() and before[..., k].any()
            if is_free and keeps[k, chosen].all() and keeps[chosen, k].all():
                chosen.append(k)
        return chosen

    def projected(self, batch: Batch) -> Batch:
        """Put the linear parameters of what was found to their best values, within bounds."""
        some = np.flatnonzero(batch.good)
        linear = list(self.linear_of(batch.some(some[:WITNESSES]))) if some.size else []
        if not linear:
            return batch
        own = batch.some(some)
        off, by = self.seen(own, tuple(self.bench.names[k] for k in linear)).rows()
        assert by is not None
        known = np.isfinite(by).all(axis=(1, 2)) & np.isfinite(off).all(axis=1)
        inverse = np.linalg.pinv(by[known][..., : len(linear)], rcond=SAME)
        x = own.x.copy()
        x[np.flatnonzero(known)[:, np.newaxis], linear] -= np.einsum(
            "bij,bj->bi", inverse, off[known]
        )
        batch.put(some, self._taken(own, x, own.q))
        return batch


class _Walk:
    """The steps of many starts."""

    def __init__(self, descent: Descent, batch: Batch) -> None:
        self.descent, self.batch = descent, batch
        self.u = descent.variables.to_u(batch.x)
        count, nx = batch.x.shape
        self.off, self.by = self._sloped(batch)
        self.damping, self.growth = np.full(count, 1e-4), np.full(count, 2.0)
        self.scale = np.zeros((count, nx))
        self.is_done = ~np.isfinite(self.by).all(axis=(1, 2))
        self.drop(self.is_done)

    def _sloped(self, batch: Batch) -> tuple[Array, Array]:
        """Return deviations and derivatives."""
        off, by = self.descent.seen(batch, self.descent.bench.names).combined()
        assert by is not None
        return off, by

    def drop(self, which: Any) -> None:
        """Leave some out."""
        keep = ~which
        self.batch = self.batch.some(keep)
        for name in ("u", "off", "by", "damping", "growth", "scale", "is_done"):
            setattr(self, name, getattr(self, name)[keep])

    def ends(self, which: Any) -> Designs:
        """Return where some are."""
        own = self.batch.some(which)
        return Designs(own.cost, own.x, own.t, own.q)

    def step(self) -> None:
        """Take a step with each; one that is no better damps the next."""
        descent, variables = self.descent, self.descent.variables
        by = self.by * variables.slopes(self.batch.x)[:, np.newaxis]
        slope = np.einsum("bri,br->bi", by, self.off)
        square = np.einsum("bri,brj->bij", by, by)
        self.scale = np.maximum(self.scale, np.einsum("bii->bi", square))
        damped = self.damping[:, np.newaxis] * np.where(self.scale > 0, self.scale, 1.0)
        one = np.eye(self.u.shape[1])
        matrix = square + damped[..., np.newaxis] * one
        u = self.u + variables.step(self.u, matrix, slope)
        moved = np.where(variables.is_turn, u, np.clip(u, 0.0, 1.0)) - self.u
        x = variables.to_x(variables.within(u))
        trial = descent.projected(descent.solved(x, self.batch.q, self.batch.signs))
        before, cost = self.batch.cost, trial.cost
        foreseen = -(2 * slope * moved).sum(axis=1) - np.einsum(
            "bi,bij,bj->b", moved, square, moved
        )
        with np.errstate(all="ignore"):
            gain = np.where(foreseen > 0, (before - cost) / foreseen, 0.0)
        better = cost < before
        settled = better & (before - cost <= SETTLED * before)
        self.is_done = settled | (self.damping > MOST_DAMPED) | (before < REACHED)
        eased = np.maximum(1 / 3, 1 - (2 * np.clip(gain, 0.0, 1.0) - 1) ** 3)
        self.damping = self.damping * np.where(better, eased, self.growth)
        self.growth = np.where(better, 2.0, 2 * self.growth)
        own = np.flatnonzero(better)
        if own.size:
            self.batch.put(own, trial.some(own))
            self.u[own] = variables.to_u(self.batch.x[own])
            self.off[own], self.by[own] = self._sloped(self.batch.some(own))
            lost = ~np.isfinite(self.by).all(axis=(1, 2))
            self.by[lost] = 0.0
            self.is_done |= lost


def lanes_of(sets: Array, steps: int) -> Array:
    """Return parameters (B, k) of motions for each of their points, (k, B * steps)."""
    return np.ascontiguousarray(np.repeat(sets, steps, axis=0).T)


def _complex(
    seen: Motions, pairs: Sequence[tuple[str, str]], places: Any = None
) -> tuple[Any, Any]:
    """Return points as complex numbers (B, K) at places, and their derivatives."""
    (x, y), slope = pairs[0], seen.slope
    assert slope is not None
    z, by = seen.column(x, 0) + 1j * seen.column(y, 0), slope(x, 0) + 1j * slope(y, 0)
    if places is None:
        return z, by
    return np.take_along_axis(z, places, 1), np.take_along_axis(by, places[..., np.newaxis], 1)


def _turned(code: Any, q: Array, place: Any, turn: Any) -> Array:
    """Return positions (B, N, n) of which bodies of the plane are turned, scaled and moved."""
    found, names = q.copy(), code.coordinates
    for k, name in enumerate(names):
        letter, _, body = name.partition("_")
        if letter == "x" and f"y_{body}" in names:
            other = names.index(f"y_{body}")
            z = turn[:, np.newaxis] * (q[..., k] + 1j * q[..., other]) + place[:, np.newaxis]
            found[..., k], found[..., other] = z.real, z.imag
        elif letter == "phi":
            found[..., k] += np.angle(turn)[:, np.newaxis]
    return found

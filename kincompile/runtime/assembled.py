"""Parameter sets of one mechanism at the first time, assembled on the branch of one of them.

They are assembled side by side: by Newton's own steps from the first position, led there along a
line of parameters, or from the guess.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import (
    FOLDED,
    LARGE_ERROR,
    MAX_CORRECTIONS,
    SAME_POSITION,
    SETTLED,
    TOO_NEAR,
)
from kincompile.runtime.along import lead, lead_together
from kincompile.runtime.attempts import other_sides, safeguarded
from kincompile.runtime.engine.linear import Planned
from kincompile.runtime.engine.scales import Point
from kincompile.runtime.follow import Motion, follow
from kincompile.runtime.march import March, all_hold
from kincompile.runtime.problem import problem
from kincompile.runtime.singular.sides import doubt
from kincompile.runtime.start import start, turned_guesses
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.problem import Problem

    Mask = NDArray[np.bool_]
    Places = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Begin:
    """Where all sets start from: a position with the parameters of the inputs."""

    equations: Problem
    q: Array  # (n,): assembled, or the guess
    is_assembled: bool  # whether other sets can follow from there
    doubt: str = ""  # that it may not be the one that is meant


def first_position(inputs: Inputs) -> tuple[Inputs, Begin]:
    """Assemble the mechanism with the first set, or else with the parameters of the model.

    The robust start finds it, and all sets are to be on its branch. Returns the inputs with those
    parameters and that position as the guess, as a chunk of a sweep has them.
    """
    time = float(inputs.t[0])
    for p in (inputs.p, inputs.code.defaults):
        own = replace(inputs, p=p)
        equations = problem(inputs.code, p, inputs.guess, time)
        march = March(equations, equations.engine, inputs.tolerance)
        together = own.code.lanes is not None
        outcome = start(march, time, own, is_in_vain=together)
        if together and outcome.status is Status.NOT_ASSEMBLED:  # by Newton's own steps
            here = p[np.newaxis], time, own.guess[np.newaxis]
            if not np.isnan(safeguarded(equations, *here, own.max_iterations)).any():
                outcome = start(march, time, own)
        found = outcome.state
        if found is not None and found.sensitivity <= TOO_NEAR:
            begin = found.point.q
            said = doubt(equations, inputs.guess, outcome, time)
            return replace(own, guess=begin), Begin(equations, begin, is_assembled=True, doubt=said)
    equations = problem(inputs.code, inputs.p, inputs.guess, time)
    return inputs, Begin(equations, inputs.guess, is_assembled=False)


def followed(inputs: Inputs, begin: Begin, p: Array) -> Motion:
    """Follow the motion of one set, from the branch on which all of them are to be."""
    own = replace(inputs, p=p)
    if not begin.is_assembled:
        return follow(own)[0]
    motion, _ = follow(replace(own, guess=begin.q))
    equations, q = begin.equations, motion.states[0, :, 0]
    is_there = motion.status[0] == Status.CONVERGED
    if not is_there or not (is_elsewhere(equations, q, begin.q) or leaves(begin, own, q)):
        return motion
    led, crosses = lead(inputs, equations, begin.q, p)
    motion, _ = follow(own if led is None else replace(own, guess=led))
    is_there = motion.status[0] == Status.CONVERGED
    if led is None and is_there and (crosses or leaves(begin, own, motion.states[0, :, 0])):
        motion.states[:] = np.nan
        motion.status[:] = Status.NOT_REACHED
        motion.status[0] = Status.NOT_CONVERGED
    return motion


def is_elsewhere(equations: Problem, q: Array, begin: Array) -> Any:
    """Say whether a position, or each of a batch, is not as near as what is assembled beside it."""
    return equations.is_far(q, begin) | equations.is_turned(q, begin)


def leaves(begin: Begin, own: Inputs, q: Array) -> bool:
    """Say whether a position of a set is on another branch than all start from."""
    t = float(own.t[0])
    there, here = begin.equations.at(begin.q, t), problem(own.code, own.p, q, t)
    found = here.at(q, t)
    if there is None or found is None:
        return True
    return here.engine.signs(found) != begin.equations.engine.signs(there)


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """Where B parameter sets are at the first time."""

    point: Point  # positions (n, B), of those on the branch
    on_branch: Mask
    crosses: Mask  # led to a bifurcation, beyond which nothing says which branch is theirs
    left: Places  # those that are assembled, but not on the branch
    hopeless: Places  # those that no attempt assembles
    iterations: NDArray[np.int64]  # (B,): of Newton's own steps from the first position


@dataclass(frozen=True, slots=True, eq=False)
class Sets:
    """Parameter sets of a mechanism, and where all of them start from."""

    inputs: Inputs
    begin: Begin
    p: Array  # (B, k)

    @property
    def place(self) -> Array:
        """The first position (n, 1)."""
        return self.begin.q[:, np.newaxis]

    def march(self, variants: Places | slice = slice(None)) -> March:
        """Return the march of some of them together."""
        engine = Planned(self.inputs.code, np.ascontiguousarray(self.p[variants].T))
        return March(self.begin.equations, engine, self.inputs.tolerance)

    def alone(self, variant: int, q: Array) -> March:
        """Return the march of one of them."""
        inputs, time = self.inputs, float(self.inputs.t[0])
        equations = problem(inputs.code, self.p[variant], q, time)
        return March(equations, equations.engine, inputs.tolerance)

    def left_branch(self, variants: Places, q: Array) -> Mask:
        """Say which may have been assembled, at positions (n, V), in another way than the first."""
        equations, begin = self.begin.equations, self.place
        found: Mask = is_elsewhere(equations, q, begin)
        unsettled = np.flatnonzero(~found & (equations.away(q, begin) > SETTLED))
        if unsettled.size:
            found[unsettled] = self.leave(variants[unsettled], q[:, unsettled])
        return found

    def leave(self, variants: NDArray[np.intp], q: Array) -> Mask:
        """Say which variants are at positions (n, V) on another branch than all start from."""
        p = np.vstack((self.p[variants], self.inputs.p))
        engine = Planned(self.inputs.code, np.ascontiguousarray(p.T))
        point = engine.evaluate(np.column_stack((q, self.begin.q)), float(self.inputs.t[0]))
        found = engine.determinants(point)
        here, shown = found[:, :-1], found[:, -1:]
        folded = np.abs(shown) <= FOLDED * np.abs(here)  # then nothing shows a branch
        return np.asarray(((np.sign(here) != np.sign(shown)) & ~folded).any(axis=0))

    def assembled(self, known: NDArray[np.int64] | None = None) -> Assembled:
        """Assemble all at the first time.

        Known may be with which `Status` (B,) Newton's own steps from the first position end in
        compiled code: those that converge there end elsewhere.
        """
        inputs, time, count = self.inputs, float(self.inputs.t[0]), len(self.p)
        q, on_branch = np.repeat(self.place, count, axis=1), np.zeros(count, dtype=bool)
        good, untried = on_branch.copy(), on_branch.copy()
        iterations, new = np.zeros(count, dtype=np.int64), np.arange(count)
        if known is not None:
            # Where these steps lose their way, rounding decides: the guess may still lead there.
            untried = (known == Status.NOT_CONVERGED) & self._may_show_branch
            good = known == Status.CONVERGED
            new = np.flatnonzero(~good & ~untried)
        point = Point(q, time, None, None)
        if new.size:
            found = self.march(new).correct_together(q[:, new], time, inputs.max_iterations)
            point, iterations[new], good[new] = found.point, found.iterations, found.good
            q[:, new], on_branch[new] = point.q, found.good & ~self.left_branch(new, point.q)
        lost, crosses = np.flatnonzero(~on_branch), np.zeros(count, dtype=bool)
        if lost.size and self.begin.is_assembled:
            led = lead_together(inputs, self.begin.equations, self.begin.q, self.p[lost])
            way, on_branch[lost], crosses[lost] = led
            q[:, lost[on_branch[lost]]] = way[:, on_branch[lost]]
        left, hopeless = np.flatnonzero(~on_branch), np.zeros(0, dtype=np.intp)
        if left.size:
            tried = self._from_the_guess(left, good[left], untried[left])
            near, follows, is_assembled, vain = tried
            on_branch[left] = follows & ~crosses[left]
            q[:, left[on_branch[left]]] = near[:, on_branch[left]]
            hopeless, left = left[vain], left[is_assembled & ~on_branch[left]]
        if lost.size:
            point = self.march().engine.evaluate(q, time)
        return Assembled(point, on_branch, crosses, left, hopeless, iterations)

    @property
    def _may_show_branch(self) -> bool:
        """Whether determinants show a branch; of redundant equations there are none."""
        return self.begin.is_assembled and not self.inputs.code.redundant

    def _from_the_guess(
        self, variants: Places, plain: Mask, untried: Mask
    ) -> tuple[Array, Mask, Mask, Mask]:
        """Assemble variants from the guess, as `start.assemble` does, on the branch of the first.

        Tried are Newton's own steps, unless those from the guess as it is are known to lead to a
        position (`plain`) or not (neither that nor `untried`), the safeguarded attempt, and beyond
        the singular positions that are nearest to where these lead. Returns positions (n, V), those
        nearest to the guess on the branch, which have one, which are assembled at all, and which no
        attempt assembles.
        """
        inputs, time, equations = self.inputs, float(self.inputs.t[0]), self.begin.equations
        most, sets, march = inputs.max_iterations, self.p[variants], self.march(variants)
        assert isinstance(march.engine, Planned)
        guesses = np.repeat(inputs.guess[:, np.newaxis], variants.size, axis=1)
        guesses = turned_guesses(equations, march.engine, guesses, time)
        near = safeguarded(equations, sets, time, guesses.T, most)
        found, least = np.full_like(guesses, np.nan), np.full(variants.size, np.inf)
        is_assembled: Mask = np.zeros(variants.size, dtype=bool)
        ends = plain | np.isfinite(near[0])

        def attempt(begin: Array) -> Array:
            q, good = self._corrected(variants, begin, most)
            ends[good & untried] = True
            q = np.where(good, equations.turned_back(q, guesses), np.nan)
            q, holds = self._corrected(variants, q, MAX_CORRECTIONS, LARGE_ERROR)
            state, checks = march.complete(march.engine.evaluate(q, time))
            good = all_hold(good & holds, checks) & (state.sensitivity <= TOO_NEAR)
            is_assembled[good] = True
            reached = np.where(good, q, np.nan)
            good &= ~self.leave(variants, q) & ~equations.is_turned(q, guesses)
            away = np.where(good, equations.away(q, guesses), np.inf)
            found[:, away < least] = q[:, away < least]
            least[:] = np.minimum(away, least)
            return reached

        if self._may_show_branch:
            is_new = plain | untried | (guesses != self.place).any(axis=0)
            own = np.where(is_new, guesses, np.nan)
            first, last = attempt(own), attempt(near)
            last[:, equations.extent(last - first) <= SAME_POSITION] = np.nan
            for reached in (first, last):
                attempt(other_sides(equations, sets, time, reached))
        return found, least < np.inf, is_assembled, ~ends

    def _corrected(
        self, variants: Places, begin: Array, most: int, reach: float = np.inf
    ) -> tuple[Array, Mask]:
        """Return where Newton's own steps lead from positions (n, V), and which get there.

        Where Phi_q is singular a position may be unknown.
        """
        q, good = begin.copy(), np.asarray(np.isfinite(begin).all(axis=0))
        some, inputs = np.flatnonzero(good), self.inputs
        if some.size and inputs.code.march is not None and reach == np.inf:
            here = replace(inputs, t=inputs.t[:1], max_iterations=most)
            march = self.march(variants[some])
            motions = Motion.over(here, some.size)
            motions.march_compiled(here, march, q[:, some], self.p[variants[some]])
            status = motions.status[0]
            q[:, some] = motions.states[0, :, 0]
            good[some] = (status == Status.CONVERGED) | (status == Status.SINGULAR)
            # Whether a position or its rates have no values compiled code does not say.
            some = some[status == Status.NOT_FINITE]
            q[:, some] = begin[:, some]
        if some.size:
            march = self.march(variants[some])
            found = march.correct_together(q[:, some], float(inputs.t[0]), most, reach)
            q[:, some], good[some] = found.point.q, found.good
        return q, good

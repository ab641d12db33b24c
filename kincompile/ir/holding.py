"""Freedoms that nothing sees are held: a rod between two balls does not spin about itself.

A freedom in the null space of Phi_q is idle if no centre of a joint moves, no output and no
coordinate beside those of bodies, and the bodies that move hang between two others and turn about
one line. It is looked for at the generic state of `inspect`, so a singular position does not count.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from kincompile.ir.held_rows import SPACE, holding, product, spins_of
from kincompile.ir.interpret import interpreter
from kincompile.ir.lower import lower
from kincompile.ir.redundancy import rank_report
from kincompile.model.points import BodyPoint
from kincompile.structure.idle import RIGID, Loose, Web, spread
from kincompile.structure.rank import DEPENDENT

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.ir.program import Program
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.rank import RankReport

    Array = NDArray[np.float64]

CLEAR = 0.1
"""Singular value of Phi_q at the guess, in scales, from which bodies that might turn do not."""


def with_held(system: ConstraintSystem, loose: Mapping[str, Loose]) -> ConstraintSystem:
    """Return a system with an equation more for each freedom that nothing sees.

    `loose` are the bodies that may turn, by geometry.
    """
    if len(system.equations) == len(system.coordinates) and _is_clear(system, loose):
        return system
    program = lower(system)
    ranks = rank_report(system, program)
    if not len(ranks.motions):
        return system
    motions = _Idle(system, program, ranks, Web.of(system), loose).motions()
    if not len(motions):
        return system
    return system.holding(holding(system, program, ranks, motions, loose))


def _is_clear(system: ConstraintSystem, loose: Collection[str]) -> bool:
    """Return whether some bodies are held well at the guess, were all others at rest."""
    guess = np.array([[item.guess for item in system.coordinates]])
    columns = _columns(system, loose)
    with np.errstate(all="ignore"):
        (found,) = interpreter(lower(system.about(loose)), ("Phi_q",))(guess, guess, 0.0)
        matrix = found[0][:, columns]
    own = matrix[np.abs(matrix).max(axis=1) > 0]
    if len(own) < len(columns) or not np.isfinite(own).all() or not own.any(axis=0).all():
        return False
    own = own / np.linalg.norm(own, axis=1, keepdims=True)
    own = own / np.linalg.norm(own, axis=0)
    return bool(np.linalg.svd(own, compute_uv=False)[-1] > CLEAR)


def _columns(system: ConstraintSystem, names: Collection[str]) -> list[int]:
    """Return the columns of the coordinates of some bodies."""
    pairs = zip(system.bodies, system.body_columns, strict=True)
    return [k for body, columns in pairs if body.name in names for k in columns]


def moved_outputs(program: Program, ranks: RankReport) -> Array:
    """Return how each motion changes the outputs and their rates, (motions, 2, outputs)."""
    count = len(ranks.motions)
    q = np.repeat(ranks.state[0], count, axis=0)
    q_dot, t = ranks.motions * ranks.scale, np.repeat(ranks.state[1], count)
    outputs = interpreter(program, ("outputs", "outputs_dot"))
    rest, moving = (np.array(outputs(q, x, t)) for x in (0 * q_dot, q_dot))
    return np.asarray(((moving - rest) / (1 + np.abs(rest[0]))).swapaxes(0, 1))


@dataclass(frozen=True, slots=True, eq=False)
class _Idle:
    """A system, the bodies in it that may turn, and the motions that are left to it."""

    system: ConstraintSystem
    program: Program
    ranks: RankReport
    web: Web
    loose: Mapping[str, Loose]

    def motions(self) -> Array:
        """Return the motions that nothing sees, (k, n), orthonormal and in scales."""
        places, rates = self._centres()
        count = len(self.ranks.motions)
        seen = [rates[name] for name in self.loose]
        if self.system.outputs:
            seen.append(moved_outputs(self.program, self.ranks).reshape(count, -1).T)
        lines = self._lines(places)
        found = _span([self._idle(some, seen, places) for some in lines])
        if self.system.loads and len(found) < count:
            return found[:0]  # the others move by masses and forces, and so do these
        return found

    def _lines(self, places: Mapping[str, Array]) -> list[set[str]]:
        """Return the bodies whose centres are on one line, or in one place, for each of these."""
        solids, found = self._solids(self.loose), list[set[str]]()
        ends = [np.vstack([places[name] for name in some]) for some in solids]
        joined = [
            np.vstack((ends[a], ends[b]))
            for a, b in combinations(range(len(solids)), 2)
            if any(self.web.others[name] & solids[b] for name in solids[a])
        ]
        for points in (*ends, *joined):
            shape = self._spread(points)
            members = {
                name
                for name, own in places.items()
                if shape < 2 and self._spread(points, own) == shape
            }
            if members and members not in found:
                found.append(members)
        return found

    def _idle(self, members: set[str], seen: Sequence[Array], places: Mapping[str, Array]) -> Array:
        """Return the motions of bodies on a line that nothing sees, (k, n)."""
        while True:
            found = self._unseen(seen, members)
            size = np.abs(found).max(axis=0, initial=0.0)
            moving = [x for x in members if size[_columns(self.system, [x])].max() > DEPENDENT]
            idle = {
                name
                for group in self.web.groups(moving)
                if self.web.hangs_between(group) and self._is_one_turn(group, places, found)
                for name in group
            }
            if idle == members or not idle:
                return found if idle else found[:0]
            members = idle

    def _unseen(self, seen: Sequence[Array], loose: Collection[str]) -> Array:
        """Return the motions that none of some rates (rows, motions) sees: others' are zero."""
        own = _columns(self.system, loose)
        every = np.vstack([*seen, np.delete(self.ranks.motions.T, own, axis=0)])
        _, values, rest = np.linalg.svd(every)
        return np.asarray(rest[np.sum(values > DEPENDENT) :] @ self.ranks.motions)

    def _centres(self) -> tuple[Mapping[str, Array], Mapping[str, Array]]:
        """Return where the centres on each loose body are, and how the motions move them."""
        own = [body for body in self.system.bodies if body.name in self.loose]
        points = [
            BodyPoint(f"{body.name}_{k}", body, tuple(centre))
            for body in own
            for k, centre in enumerate(self.loose[body.name].centres.tolist())
        ]
        q, t = self.ranks.state
        motions = self.ranks.motions * self.ranks.scale
        program = lower(self.system.about(()).observing(points, spinning=False))
        states = np.repeat(q, len(motions), axis=0), motions, np.repeat(t, len(motions))
        values, moved = interpreter(program, ("outputs", "outputs_dot"))(*states)
        places, rates, first = {}, {}, 0
        for body in own:
            shape = self.loose[body.name].centres.shape
            end = first + shape[0] * shape[1]
            places[body.name] = values[0, first:end].reshape(shape)
            rates[body.name] = moved[:, first:end].T / self.ranks.scale.max()
            first = end
        return places, rates

    def _is_one_turn(
        self, group: Collection[str], places: Mapping[str, Array], found: Array
    ) -> bool:
        """Return whether bodies on one line turn about it, or hang on it at one point.

        Links with all their centres in one place make a ball of hinges, and turn about their own.
        """
        solids = [np.vstack([places[x] for x in some]) for some in self._solids(group)]
        every = np.vstack(solids)
        if self.system.ground.kind.frame.size != SPACE or any(map(self._spread, solids)):
            return self.system.ground.kind.frame.size == SPACE or not self._spread(every)
        spins = spins_of(self.system, self.ranks.state[0][0])
        turned = [(found * self.ranks.scale) @ spins[name].T for name in group]
        axes = [self._outside(name, spin) for name, spin in zip(group, turned, strict=True)]
        apart = every - every[:1]
        axes.append(apart[np.argmax(np.linalg.norm(apart, axis=1))][np.newaxis])
        return len(group) == 1 or spread(np.vstack((np.zeros(3), *axes)), 1.0) == 1

    def _spread(self, *points: Array) -> int:
        return spread(np.vstack(points), float(self.ranks.scale.max()))

    def _outside(self, name: str, vectors: Array) -> Array:
        """Return vectors of a body (k, 3) in the ground's frame."""
        columns = _columns(self.system, [name])[SPACE:]
        e0, *e = self.ranks.state[0][0][columns]
        turned = [product(product((e0, *e), (0.0, *x)), (e0, *(-k for k in e))) for x in vectors]
        return np.array(turned)[:, 1:]

    def _solids(self, group: Collection[str]) -> list[set[str]]:
        """Return the bodies of a group that turn together."""
        rigid = [x for x in self.web.joints if x.type_name in RIGID]
        names = [{body.name for body in x.bodies} for x in rigid]
        found = [{name} for name in group]
        for pair in names:
            if pair <= set(group):
                one = set().union(*(x for x in found if x & pair))
                found = [one, *(x for x in found if not x & pair)]
        return found


def _span(motions: Sequence[Array]) -> Array:
    """Return an orthonormal basis of some motions."""
    _, values, basis = np.linalg.svd(np.vstack(motions))
    return np.asarray(basis[: np.sum(values > DEPENDENT)])

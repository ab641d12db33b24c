"""A module with its parameters set: its equations, what solves them, and their scales."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kincompile.criteria import FARTHEST, ROUNDING, STEEP, probe_of, rounded, size_of
from kincompile.runtime.engine.dense import Dense
from kincompile.runtime.engine.scales import Scales
from kincompile.runtime.engine.sparse import Sparse

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.engine.linear import Linear
    from kincompile.runtime.engine.scales import Point


@dataclass(slots=True, eq=False, kw_only=True)
class Problem(Scales):
    """The equations of a module with its parameters set, and the scales they are judged by."""

    engine: Linear  # what solves them
    p: Array  # (k,): parameters

    def at(self, q: Array, t: float) -> Point | None:
        """Evaluate the equations, or give None where they have no finite value."""
        point = self.engine.evaluate(q, t)
        return point if math.isfinite(point.Phi.sum()) else None


def problem(
    code: Compiled,
    p: Array,
    q: Array,
    t: float,
    *,
    sparse: bool = False,
    engine: Linear | None = None,
) -> Problem:
    """Set the parameters; the equations at a guess or a position give the scales.

    With `sparse`, code that has blocks is solved by them, without a dense matrix. An engine with
    these parameters may be given.
    """
    m, angular, pattern = len(code.equations), code.angular, code.pattern
    if engine is None:
        engine = Sparse(code, p) if sparse and code.blocks else Dense(code, p)

    def entries(q: Array) -> tuple[Array, Array]:
        point = engine.evaluate(q, t)
        values = point.Phi_q
        return point.Phi, values if values.ndim == 1 else values[pattern[:, 0], pattern[:, 1]]

    size = float(rounded(size_of(entries, pattern, angular, q))) or 1.0
    reference = np.where(angular, 1.0, size)
    if isinstance(engine, Sparse):
        engine.reference = reference
    place, probe = np.minimum(np.abs(q), FARTHEST * reference), probe_of(m)
    floor = float(ROUNDING * (place[~angular] / size).max(initial=0.0))
    none = np.zeros(m)
    equations = Problem(
        code=code, engine=engine, p=p, angular=angular, size=size, reference=reference,
        place=place, floor=floor, probe=probe, magnitude=none, noise=none,
    )  # fmt: skip
    generic = equations.at(q + reference * probe_of(q.size), t)
    if generic is not None and np.isfinite(generic.Phi_q).all():
        equations.magnitude = rounded(equations.terms(generic, reference))
        here = equations.terms(generic, reference + equations.place)
        equations.noise = ROUNDING * here
        equations.limit = np.where(here > 0, STEEP * here, np.inf)
    return equations

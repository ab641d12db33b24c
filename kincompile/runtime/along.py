"""Sets of parameters on the branch of one of them: the march, on a straight line of parameters.

A mechanism that is assembled with some parameters leads to how it is assembled with others: along
the line between them it moves as under a driver, and stays on its branch. So a part of that line
takes the place of time, and all that follows a motion follows this one too.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import (
    BEYOND,
    FIRST_DIFFERENCE,
    LARGE_ERROR,
    MAX_CORRECTIONS,
    SECOND_DIFFERENCE,
)
from kincompile.runtime.engine.linear import Dense, Planned
from kincompile.runtime.engine.sparse import Sparse
from kincompile.runtime.lanes import Lanes, take_on
from kincompile.runtime.march import March, State
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from kincompile.runtime.engine.code import Array, Compiled
    from kincompile.runtime.inputs import Inputs
    from kincompile.runtime.problem import Problem

    Mask = NDArray[np.bool_]


def along(code: Compiled, p: Array, t: float) -> Compiled:
    """Return the equations at one time on lines from parameters p: the way along is their time."""

    def parameters(part: Any, given: Array | Sequence[float]) -> Array:
        to = np.asarray(given)
        begin = p if to.ndim == 1 else p[:, np.newaxis]
        return np.asarray(begin + part * (to - begin))

    def position(q: Array, part: Any, to: Array) -> Any:
        return (code.evaluate or code.position)(q, t, parameters(part, to))

    def nu(q: Array, part: float, to: Array) -> Array:
        before, after = (position(q, part + side * FIRST_DIFFERENCE, to)[0] for side in (-1, 1))
        return np.asarray((before - after) / (2 * FIRST_DIFFERENCE))

    def gamma(q: Array, q_dot: Array, part: float, to: Array) -> Array:
        before, here, after = (
            position(q + side * SECOND_DIFFERENCE * q_dot, part + side * SECOND_DIFFERENCE, to)[0]
            for side in (-1, 0, 1)
        )
        return np.asarray((2 * here - before - after) / SECOND_DIFFERENCE**2)

    found = replace(code, position=position, written=position, nu=nu, gamma=gamma, redundant=())
    own, m = code.lanes, len(code.equations)
    if own is None:
        return replace(found, evaluate=code.evaluate and position)

    def lanes(f: Any, q: Sequence[Any], part: Any, to: Array) -> Sequence[Any]:
        return own.position(f, q, t, parameters(part, to))

    def nu_of_lanes(f: Any, q: Sequence[Any], part: Any, to: Array) -> Sequence[Any]:
        before, after = (lanes(f, q, part + side * FIRST_DIFFERENCE, to)[:m] for side in (-1, 1))
        return [(x - y) / (2 * FIRST_DIFFERENCE) for x, y in zip(before, after, strict=True)]

    def gamma_of_lanes(f: Any, q: Any, q_dot: Any, part: Any, to: Array) -> Sequence[Any]:
        before, here, after = (
            lanes(f, [x + side * SECOND_DIFFERENCE * v for x, v in zip(q, q_dot, strict=True)],
                  part + side * SECOND_DIFFERENCE, to)[:m]
            for side in (-1, 0, 1)
        )  # fmt: skip
        rows = zip(before, here, after, strict=True)
        return [(2 * y - x - z) / SECOND_DIFFERENCE**2 for x, y, z in rows]

    own_lanes = replace(own, position=lanes, nu=nu_of_lanes, gamma=gamma_of_lanes)
    return replace(found, lanes=own_lanes)


def lead_together(
    inputs: Inputs, equations: Problem, begin: Array, sets: Array
) -> tuple[Array, Mask, Mask]:
    """Lead a position (n,) with the inputs' parameters to sets (B, k) of them, side by side.

    Returns positions (n, B), which of them are those of their set, and which lines end at a
    bifurcation: the mechanism goes on there, but nothing says on which branch.
    """
    time, count = float(inputs.t[0]), len(sets)
    code = along(inputs.code, inputs.p, time)
    q = np.repeat(begin[:, np.newaxis], count, axis=1)
    reached, crosses = np.zeros((2, count), dtype=bool)
    everyone = np.arange(count)
    # Compiled code has no word for a bifurcation: that is left to the steps here.
    if inputs.code.lead is not None:
        given = inputs.p, time, begin, sets, equations.size, inputs.tolerance
        found, known = inputs.code.lead(*given, inputs.max_iterations)
        reached = known == Status.CONVERGED
        q[:, reached] = found[:, reached]
        everyone = np.flatnonzero(~reached & (known != Status.LOCK_UP))
        if not everyone.size:
            return q, reached, crosses

    def march_of(some: NDArray[np.intp]) -> March:
        engine = Planned(code, np.ascontiguousarray(sets[some].T))
        return March(equations, engine, inputs.tolerance)

    def record(lanes: Lanes, state: State, good: Mask, _: Any) -> None:
        own = lanes.motions[good]
        q[:, own], reached[own] = state.point.q[:, good], True

    march, some = march_of(everyone), q[:, everyone]
    state, _ = march.complete(march.engine.evaluate(some, np.zeros(everyone.size)))
    lanes = Lanes(everyone, np.ones(everyone.size, dtype=np.intp), state)
    ends, status = take_on(lanes, np.array([0.0, 1.0]), march_of, record)
    crosses[ends.motions] = status == Status.SINGULAR
    return q, reached, crosses


def lead(inputs: Inputs, equations: Problem, begin: Array, p: Array) -> tuple[Array | None, bool]:
    """Do the same for one set (k,): its position, None where it is not reached, and how it ends."""
    code = along(inputs.code, inputs.p, float(inputs.t[0]))
    engine = Sparse(code, p) if code.blocks else Dense(code, p)
    march = March(replace(equations, engine=engine), engine, inputs.tolerance)
    state = march.state(engine.evaluate(begin, 0.0))
    if not isinstance(state, State):
        return None, False
    outcome = march.advance(state, 1.0, inputs.max_iterations)
    if outcome.position is not None:
        return outcome.position.q, False
    last = outcome.state or state
    beyond = march.correct(last.point.q, last.t + BEYOND, MAX_CORRECTIONS)
    if last.t <= 0 or beyond.status is not Status.CONVERGED:
        return None, False
    return None, bool(equations.extent(beyond.last.q - last.point.q) <= LARGE_ERROR)

"""One point at a time, from a state that the caller keeps: what a controller has of the march."""

from __future__ import annotations

from kincompile.criteria import *
from kincompile.solver.step import *
from kincompile.solver.walk import *
from kincompile.solver.words import *


def settle(b: Point, size: Real, s: Scales, at: State, o: Outcome):
    """Assemble a point near where it is, by plain steps, for a size of the mechanism."""
    constants(b, lanes=1)
    o.is_over[0] = False
    measure(b, size, s, lanes=1)
    correct(b, s, MAX_ITERATIONS, o, lanes=1)
    complete(b, s, o, lanes=1)
    # The guess may be rough.
    measure(b, size, s, lanes=1)
    take_up(at, b, 0)


def go(b: Point, s: Scales, at: State, t: Real, o: Outcome):
    """Take a point from a good one to a time: in one step, or in parts where that fails."""
    put_at(b, at, 0, 1)
    step(b, s, t, o, lanes=1)
    if o.status[0] == CONVERGED:
        take_up(at, b, 0)
    else:
        walk(b, s, at, t, o)

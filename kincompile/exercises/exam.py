"""Exams on paper: entries are asked for as numbers too, at a state of the sheet's own."""

from __future__ import annotations

from dataclasses import replace
from random import Random
from typing import TYPE_CHECKING

import numpy as np

from kincompile.checker.agreement import CLOSE
from kincompile.checker.entry_faults import TypedEntry
from kincompile.checker.fault import Kind
from kincompile.checker.judged import UNEXPLAINED
from kincompile.checker.reference import Reference
from kincompile.checker.states import States
from kincompile.checker.written import vocabulary
from kincompile.compiler import compile as compile_model
from kincompile.errors import KincompileError
from kincompile.exercises.blanks import DIGITS
from kincompile.exercises.graded import RIGHT, Mark
from kincompile.exercises.variants import STEPS
from kincompile.model.expressions import NotAnExpressionError
from kincompile.names import rate
from kincompile.runtime.solve import solve

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.checker.states import Array
    from kincompile.exercises.blanks import Blank, State
    from kincompile.exercises.rounded import Leeway
    from kincompile.model.mechanism import Mechanism

SHOWN = 5
"""Significant digits of the state on a sheet: two more than those of an answer."""

ZERO = 12
"""Decimals of a state behind which there is rounding alone."""

LOUD = 3
"""A state is drawn from this part of the motion, in which no entry is near zero."""

SMALLEST = 1e-9
"""An entry that is smaller all the way is zero wherever the constraints hold: it is no question.

Of gamma all answers that are zero there would be right."""


def choose_questions(variant: Mechanism, blanks: Sequence[Blank]) -> tuple[Blank, ...]:
    """Return the blanks that have a value other than zero in the motion, numbered anew."""
    reference, states = _motion(variant)
    sizes = np.max(np.abs(_values(reference, blanks, states)), axis=0)
    asked = (item for item, size in zip(blanks, sizes, strict=True) if size > SMALLEST)
    return tuple(replace(item, name=f"B{k}") for k, item in enumerate(asked, 1))


def _motion(variant: Mechanism) -> tuple[Reference, States]:
    """Return a variant as marking knows it, with the states of its motion."""
    reference = Reference(variant.system())
    found = solve(compile_model(variant), np.linspace(0.0, variant.end, STEPS))
    p = np.tile(reference.defaults, (STEPS, 1))
    return reference, States(found.q, found.q_dot, found.t, p, np.zeros(STEPS, dtype=int))


def choose_state(variant: Mechanism, blanks: Sequence[Blank], seed: str) -> tuple[State, list[str]]:
    """Return a state of a sheet and the values of its blanks, as text, with the digits asked for.

    It is drawn from the third of the motion in which the smallest entry, compared with the largest
    value that it takes, is largest: digits of what cancels say nothing.
    """
    reference, found = _motion(variant)
    shown = np.vectorize(lambda x: float(f"{round(x, ZERO):.{SHOWN}g}") + 0.0)  # no -0
    q, q_dot, t = (shown(item) for item in (found.q, found.q_dot, found.t))
    states = replace(found, q=q, q_dot=q_dot, t=t)
    values = _values(reference, blanks, states)
    sizes = np.abs(values)
    loudness = np.min(sizes / np.max(sizes, axis=0), axis=1)
    chosen = np.argsort(-loudness, kind="stable")[: max(1, len(t) // LOUD)]
    k = int(Random(f"exam-{seed}").choice(chosen.tolist()))
    names = reference.coordinates
    state = dict(zip(names, q[k].tolist(), strict=True))
    state |= dict(zip(map(rate, names), q_dot[k].tolist(), strict=True)) | {"t": float(t[k])}
    return state, [f"{value:#.{DIGITS}g}" for value in values[k]]


def _values(reference: Reference, blanks: Sequence[Blank], states: States) -> Array:
    """Return the values of blanks, (N, blanks)."""
    entries = [reference.expression(x.quantity, x.row, x.column or 0) for x in blanks]
    return reference.evaluate(entries, states)[0]


def states_of(reference: Reference, state: Mapping[str, float]) -> States:
    """Return the state of a sheet as states, of which there is one."""
    names = reference.coordinates
    q, q_dot = [[state[x] for x in own] for own in (names, map(rate, names))]
    t, p = np.array([state["t"]]), reference.defaults[None]
    return States(np.array([q]), np.array([q_dot]), t, p, np.zeros(1, dtype=int))


def value_mark(
    reference: Reference, blank: Blank, answer: str, state: Mapping[str, float], leeway: Leeway
) -> Mark | None:
    """Return the mark of an answer that is a number, None of a formula and what is not read."""
    try:
        written = vocabulary(reference, {}).read(answer)
    except (KincompileError, NotAnExpressionError):
        return None
    if written.free_symbols or not written.is_finite:
        return None
    states, number = states_of(reference, state), float(written)
    right = float(_values(reference, [blank], states)[0, 0])
    if leeway.allows(number, right):
        return Mark(blank, 1, RIGHT, RIGHT)
    if leeway.allows(-number, right):
        return Mark(blank, 0, "the value has the wrong sign", Kind.SIGN)
    derived = reference.expression(blank.quantity, blank.row, blank.column or 0)
    for fault in TypedEntry(reference, blank.quantity, derived, states).formulas():
        values, _ = reference.evaluate([fault.result], states)
        if abs(values[0, 0] - right) > CLOSE * abs(right) and leeway.allows(number, values[0, 0]):
            return Mark(blank, 0, f"the value is that of a slip: {fault.text}", fault.kind)
    return Mark(blank, 0, "the value is not that of the entry at the state given", UNEXPLAINED)

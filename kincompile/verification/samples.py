"""States at which a module is verified: generic ones of any parameters, and assembled ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.errors import InputError
from kincompile.quantities import OF_EQUATIONS, TOGETHER, functions, states_of
from kincompile.runtime.engine.code import read
from kincompile.runtime.newton import newton
from kincompile.runtime.problem import nearest, problem
from kincompile.runtime.status import Status

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    from kincompile.quantities import Quantity
    from kincompile.runtime.engine.code import Compiled

Array = NDArray[Any]

STATES, SEED = 6, 1989
"""States of each kind, generic ones and assembled ones."""

AWAY, APART = 0.4, 0.1
"""How far from the guess generic states are, in radians and sizes of the mechanism, and by which
part their parameters differ from the defaults: a wrong sign of a parameter that is 0 shows, too."""

FAR = 100.0
"""How far from the guess, in radians and sizes of the mechanism, an assembled position may be: far
away a coordinate has no digits left for a difference."""


@dataclass(frozen=True, eq=False)
class Samples:
    """States of a module."""

    code: Compiled
    # q, q_dot (S, n): positions and rates
    q: Array
    q_dot: Array
    t: Array  # (S,): times
    p: Array  # (S, k): parameters
    reference: Array  # (n,): scale of each coordinate
    # How many of the states, the last ones, are assembled; their parameters are the defaults.
    assembled: int

    def only(self, chosen: Array) -> Samples:
        """Return some of the states, given by a mask."""
        parts = {name: getattr(self, name)[chosen] for name in ("q", "q_dot", "t", "p")}
        return replace(self, **parts)

    def each(self) -> Iterator[tuple[Array, Array, float, Array]]:
        """Yield q, q_dot, t and p of one state after the other."""
        return zip(self.q, self.q_dot, self.t.tolist(), self.p, strict=True)

    @cached_property
    def terms(self) -> Array:
        """What the terms of each equation contribute to it, shape (S, m)."""
        Phi_q = np.array([self.code.Phi_q(q, t, p) for q, _, t, p in self.each()])
        found = np.abs(Phi_q) @ self.reference
        return np.where(found > 0, found, 1.0)

    def sizes(self, quantity: Quantity) -> Array:
        """Return the scale of errors, (S, m, n) for a matrix and (S, m, 1) for a vector."""
        terms = self.terms[..., np.newaxis]
        if len(quantity.states) > 1:
            fastest = np.max(np.abs(self.q_dot / self.reference), axis=1)
            terms = terms * np.maximum(1.0, fastest**2)[:, np.newaxis, np.newaxis]
        return np.asarray(terms / self.reference if quantity.is_matrix else terms)

    def forms(self, quantity: Quantity) -> Iterator[Array]:
        """Yield a quantity as each function of the module gives it, (S, m, k).

        They are written out one by one, and a batch runs on other numbers than a single state.
        """
        code, q, t, p = self.code, self.q, self.t, self.p
        shape = len(q), len(code.equations), -1
        for name, given in functions(OF_EQUATIONS).items():
            if quantity.name in given:
                yield np.array([self._value(quantity, name, *state) for state in self.each()])
                yield self._value(quantity, name, q, self.q_dot, t, p).reshape(shape)
        if quantity.name not in TOGETHER["kinematics"]:
            return
        place = TOGETHER["kinematics"].index(quantity.name)
        found = code.functions["kinematics_batch_last"](q.T, self.q_dot.T, t, p.T)[place].T
        if not quantity.is_matrix:
            yield found.reshape(shape)
            return
        singles = np.array([code.nonzeros(q, t, p) for q, _, t, p in self.each()])
        for entries in (found, singles, code.nonzeros(q, t, p)):
            yield dense(code, entries)

    def _value(
        self, quantity: Quantity, name: str, q: Array, q_dot: Array, t: Any, p: Array
    ) -> Array:
        """Return a quantity as a function of the module gives it; a vector as a column."""
        given, function = functions(OF_EQUATIONS)[name], self.code.functions[name]
        found = function(*(q, q_dot)[: len(states_of(given))], t, p)
        value = np.asarray(found if len(given) == 1 else found[given.index(quantity.name)])
        return value if quantity.is_matrix else value[..., np.newaxis]


def dense(code: Compiled, nonzeros: Array) -> Array:
    """Return matrices (..., m, n) of the entries (..., nnz) of their pattern."""
    shape = *nonzeros.shape[:-1], len(code.equations), len(code.coordinates)
    matrix = np.zeros(shape, nonzeros.dtype)
    matrix[..., code.pattern[:, 0], code.pattern[:, 1]] = nonzeros
    return matrix


def samples_of(module: ModuleType) -> Samples:
    """Return the states of a module, seeded; refuse equations without a value near the guess."""
    random = np.random.default_rng(SEED)
    code = read(module)  # as it is now: a function may have been replaced since it was loaded
    guess, defaults = code.guess, code.defaults
    reference = problem(code, defaults, guess, 0.0).reference
    spread = _spread(code, reference)
    generic, assembled = [], []
    for _ in range(STATES):
        t = float(random.uniform(0.1, 0.9))
        away, rates = random.uniform(-AWAY, AWAY, (2, guess.size)) * reference
        other = defaults + random.uniform(-1, 1, defaults.size) * spread
        for p in (other, defaults):  # other parameters may be outside of a domain
            if _is_finite(code, guess + away, t, p):
                generic.append((guess + away, 3 * rates, t, p))
                break
        q = _assembled(code, guess + away, t)
        if q is not None and np.max(np.abs(q - guess) / reference, initial=0.0) <= FAR:
            assembled.append((q, 3 * rates, t, defaults))
    if not generic + assembled:
        raise InputError(
            f"the equations of {code.name} have no finite value near the guess: give a guess "
            "near the assembled mechanism."
        )
    positions, rates, times, parameters = zip(*generic, *assembled, strict=True)
    arrays = np.array(positions), np.array(rates), np.array(times), np.array(parameters)
    return Samples(code, *arrays, reference, len(assembled))


def _assembled(code: Compiled, near: Array, t: float) -> Array | None:
    """Return an assembled position; of what moves freely one near a state, else near the guess."""
    if not code.unsolvable and len(code.equations) >= near.size:
        found = newton(code.module, t, code.guess)
        return found.q if found.status is Status.CONVERGED else None
    attempt = nearest(problem(code, code.defaults, near, t), t, near)
    return attempt.last.q if attempt.status is Status.CONVERGED else None


def _spread(code: Compiled, reference: Array) -> Array:
    """Return by how much each parameter may differ from its default, shape (k,)."""
    units = code.units
    size = dict(zip((units[name] for name in code.coordinates), reference, strict=True))
    small = [AWAY * size.get(units[name], 1.0) for name in code.parameters]
    return np.where(code.defaults == 0, small, APART * np.abs(code.defaults))


def _is_finite(code: Compiled, q: Array, t: float, p: Array) -> bool:
    try:
        values = code.position(q, t, p)
    except (ArithmeticError, ValueError):
        return False
    return all(bool(np.isfinite(value).all()) for value in values)

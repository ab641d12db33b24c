"""States at which two formulas are compared: random and generic, or on the constraint manifold.

No formula is simplified anywhere in this package. Two analytic formulas that agree at a dozen
generic states agree everywhere, except with probability zero; a state is generic when every
coordinate, rate and parameter differs from zero and none is related to another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kincompile.errors import InputError
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from kincompile.model.system import ConstraintSystem

Array = NDArray[Any]

GROUPS = 3
"""Sets of parameters; within a set a factor between two rows must be the same at every state."""
STATES_PER_GROUP = 4
SEED = 1989  # any will do; fixed, so that a report is the same on every run
MAX_ITERATIONS = 40
ON_MANIFOLD = 1e-12


@dataclass(frozen=True, eq=False)
class States:
    """States of a system: q and q_dot (N, n), t (N,), p (N, k); `group` (N,) numbers equal p."""

    q: Array
    q_dot: Array
    t: Array
    p: Array
    group: Array

    def __len__(self) -> int:
        return len(self.t)

    def take(self, chosen: Array) -> States:
        """Return some of the states."""
        return States(*(item[chosen] for item in (self.q, self.q_dot, self.t, self.p, self.group)))

    def with_default_parameters(self, defaults: Array) -> States:
        """Return the same states, all with the parameters' default values."""
        p = np.broadcast_to(defaults, self.p.shape)
        return replace(self, p=p, group=np.zeros_like(self.group))

    def in_degrees(self, angular: Array) -> States:
        """Return the states with angles and their rates as numbers of degrees."""
        factor = np.where(angular, 180 / np.pi, 1.0)
        return replace(self, q=self.q * factor, q_dot=self.q_dot * factor)


def is_angular(system: ConstraintSystem) -> Array:
    """Return which coordinates are angles, shape (n,)."""
    return np.array([item.unit == "rad" for item in system.coordinates], dtype=bool)


def default_parameters(system: ConstraintSystem) -> Array:
    """Return the default values of the parameters, shape (k,)."""
    return np.array([item.default for item in system.parameters], dtype=float)


def random_states(
    system: ConstraintSystem, is_usable: Callable[[States], Array], sizes: Array, is_far: bool
) -> States:
    """Return generic states at which the system's formulas have finite values.

    Parameters
    ----------
    sizes
        How far they are spread, (n,).
    is_far
        Whether the mechanism stands so far away that states about zero would hide its lengths.
    is_usable
        Returns for each state whether it can be used, shape (N,). Far from the guess a root or a
        logarithm may not exist; then states near the guess serve.

    Raises
    ------
    InputError
        If the formulas are not defined at any state tried.
    """
    wanted = GROUPS * STATES_PER_GROUP
    random = np.random.default_rng(SEED)
    defaults = default_parameters(system)
    factors = random.uniform(0.8, 1.25, (GROUPS, defaults.size))
    # A parameter that is zero by default is not zero here.
    parameters = np.where(defaults == 0, factors, factors * defaults)
    for spread in (1.0, 0.3, 0.05):
        about_guess = is_far or spread < 1
        states = _spread_states(system, parameters, random, 4 * wanted, sizes, spread, about_guess)
        found = states.take(np.flatnonzero(is_usable(states)))
        if len(found) >= wanted:
            by_group = [np.flatnonzero(found.group == k)[:STATES_PER_GROUP] for k in range(GROUPS)]
            return found.take(np.concatenate(by_group))
    raise InputError(
        f"the formulas of {system.name!r} have no finite values at or near the guess; "
        "give a guess at which every root, logarithm and quotient exists."
    )


def _spread_states(
    system: ConstraintSystem,
    parameters: Array,
    random: np.random.Generator,
    count: int,
    sizes: Array,
    spread: float,
    about_guess: bool,
) -> States:
    """Return random states about zero, or about the guess."""
    angular = is_angular(system)
    guess = np.array([item.guess for item in system.coordinates])

    def generic() -> Array:
        """Return numbers of size 0.4 to 1.6 and either sign."""
        shape = (count, guess.size)
        return np.asarray(random.uniform(0.4, 1.6, shape) * random.choice((-1.0, 1.0), shape))

    q = spread * np.where(angular, 1.3, sizes) * generic() + (guess if about_guess else 0.0)
    q_dot = sizes * generic()
    t = system.end * random.uniform(0.1, 0.9, count)
    group = np.arange(count) % GROUPS
    return States(q, q_dot, t, parameters[group], group)


def given_states(given: Mapping[str, ArrayLike], system: ConstraintSystem) -> States:
    """Return states that the user gives.

    Parameters
    ----------
    given
        Arrays ``q`` (N, n), and ``q_dot`` (N, n), ``t`` (N,), ``p`` (N, k), which default to zero
        rates, t = 0 and the parameters' defaults. One state may do without its leading axis.

    Raises
    ------
    InputError
        If a key is unknown, `q` is missing, a shape does not fit or a number is not finite.
    """
    n, defaults = len(system.coordinates), default_parameters(system)
    values = {"q": np.zeros(n), "q_dot": np.zeros(n), "t": 0.0, "p": defaults, **given}
    if len(values) > 4 or "q" not in given:
        raise InputError(
            f"states has {listed(given)}; give 'q', and where they matter 'q_dot', 't' and 'p'."
        )
    count = len(np.atleast_2d(np.asarray(given["q"], dtype=float)))
    shapes = {"q": (count, n), "q_dot": (count, n), "t": (count,), "p": (count, defaults.size)}
    arrays = {name: shaped(values[name], name, shape) for name, shape in shapes.items()}
    _, group = np.unique(arrays["p"], axis=0, return_inverse=True)
    return States(**arrays, group=np.asarray(group).reshape(count))


def shaped(value: ArrayLike, name: str, shape: tuple[int, ...]) -> Array:
    """Return finite numbers of a shape; an `InputError` says which of the states has others."""
    try:
        array = np.broadcast_to(np.asarray(value, dtype=float), shape)
    except (TypeError, ValueError):
        raise InputError(
            f"states: {name} has shape {np.shape(value)}; it should be {shape}, or broadcast to it."
        ) from None
    if not np.isfinite(array).all():
        raise InputError(f"states: {name} holds a number that is not finite.")
    return array


Linearised = Callable[[States], tuple[Array, Array, Array]]
"""Gives Phi (N, m), Phi_q (N, m, n) and nu (N, m)."""


def consistent_states(start: States, constraints: Linearised) -> States | None:
    """Move states onto the constraint manifold, and their rates onto its tangent.

    Gauss-Newton with the pseudoinverse takes q to the nearest point with Phi = 0, whatever the
    number of equations; the same projection makes Phi_q q_dot = nu.

    Returns
    -------
    States or None
        The states for which this converged; None where fewer than two did.
    """
    states = start
    for _ in range(MAX_ITERATIONS):
        Phi, Phi_q, _ = constraints(states)
        step = _least_squares(Phi_q, Phi)
        length = np.sqrt(np.sum(step**2, axis=-1))
        longest = 1 + np.abs(states.q).max(axis=-1)
        step = step / np.maximum(1.0, length / longest)[:, None]
        states = replace(states, q=states.q - step)
        if np.all(length <= 1e-14):
            break
    Phi, Phi_q, nu = constraints(states)
    rates = states.q_dot - _least_squares(Phi_q, _times(Phi_q, states.q_dot) - nu)
    size = 1 + np.max(np.abs(Phi_q), axis=(-2, -1)) * (1 + np.max(np.abs(states.q), axis=-1))
    residual = np.max(np.abs(_times(Phi_q, rates) - nu), axis=-1)
    converged = np.max(np.abs(Phi), axis=-1) <= ON_MANIFOLD * size
    converged &= residual <= ON_MANIFOLD * (1 + np.max(np.abs(rates), axis=-1) * size)
    found = replace(states, q_dot=rates).take(np.flatnonzero(converged))
    return found if len(found) >= 2 else None


def _times(matrix: Array, vector: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", matrix, vector))


def _least_squares(Phi_q: Array, right: Array) -> Array:
    usable = np.asarray(np.isfinite(Phi_q).all(axis=(-2, -1)) & np.isfinite(right).all(axis=-1))
    inverse = np.linalg.pinv(np.where(usable[:, None, None], Phi_q, 0.0), rcond=1e-10)
    return _times(inverse, np.where(usable[:, None], right, 0.0))

"""JAX: derivatives by `jacfwd` and `jvp`, time by `scan`, Newton by `while_loop`, in one jit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.peers.common import (
    MAX_ITERATIONS,
    TOLERANCE,
    Analysis,
    Motion,
    Vector,
    optional,
    require,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.linkages import Linkage

jax, jnp = optional("jax"), optional("jax.numpy")


def scan(linkage: Linkage) -> Analysis:
    """Return the compiled scan over all times."""
    require(jax, "jax")
    jax.config.update("jax_enable_x64", True)
    p, guess = jnp.array(linkage.values), jnp.array(linkage.guess)

    def Phi(q: Any, t: Any, p: Any) -> Any:
        return jnp.stack([jnp.asarray(row) for row in linkage.residual(jnp, q, t, p)])

    def march(times: Any, p: Any, guess: Any) -> Any:
        return jax.lax.scan(lambda q, t: _step(Phi, q, t, p), guess, times)[1]

    compiled = jax.jit(march)

    def analyse(times: Vector) -> Motion:
        q, q_dot, q_ddot = (np.asarray(x) for x in compiled(times, p, guess))
        return q, q_dot, q_ddot

    return analyse


def _step(Phi: Any, q: Any, t: Any, p: Any) -> Any:
    """Return the position twice (to go on from, and in the results), velocity, acceleration."""

    def correct(state: Any) -> Any:
        q, _, count = state
        correction = jnp.linalg.solve(jax.jacfwd(Phi)(q, t, p), Phi(q, t, p))
        return q - correction, jnp.linalg.norm(correction), count + 1

    def is_open(state: Any) -> Any:
        return (state[1] >= TOLERANCE) & (state[2] < MAX_ITERATIONS)

    q, _, _ = jax.lax.while_loop(is_open, correct, (q, jnp.inf, 0))
    return q, (q, *_rates(Phi, q, t, p))


def _rates(Phi: Any, q: Any, t: Any, p: Any) -> tuple[Any, Any]:
    """Return velocity and acceleration."""
    factors = jax.scipy.linalg.lu_factor(jax.jacfwd(Phi)(q, t, p))

    def rate(q: Any, t: Any, q_dot: Any, t_dot: Any) -> Any:
        """Return d/dt Phi along (q_dot, t_dot)."""
        return jax.jvp(lambda q, t: Phi(q, t, p), (q, t), (q_dot, t_dot))[1]

    zero, one = jnp.zeros_like(q), jnp.ones_like(t)
    q_dot = jax.scipy.linalg.lu_solve(factors, -rate(q, t, zero, one))
    along = jax.jvp(lambda q, t: rate(q, t, q_dot, one), (q, t), (q_dot, one))[1]
    return q_dot, jax.scipy.linalg.lu_solve(factors, -along)


def sensitivities(linkage: Linkage) -> Callable[[Vector, Vector], Vector]:
    """Return a function of times and positions that gives q_p, q_dot_p and q_ddot_p by `jacfwd`.

    A step of Newton's method from a position has the derivative of the position.
    """
    require(jax, "jax")
    jax.config.update("jax_enable_x64", True)
    values = jnp.array(linkage.values)

    def Phi(q: Any, t: Any, p: Any) -> Any:
        return jnp.stack([jnp.asarray(row) for row in linkage.residual(jnp, q, t, p)])

    def state(p: Any, q: Any, t: Any) -> Any:
        q = q - jnp.linalg.solve(jax.jacfwd(Phi)(q, t, p), Phi(q, t, p))
        return jnp.stack([q, *_rates(Phi, q, t, p)])

    def march(p: Any, q: Any, times: Any) -> Any:
        # Not vmap: on two cores its batched solves wait for each other for ever (JAX 0.10.2).
        return jax.lax.map(lambda at: jax.jacfwd(state)(p, *at), (q, times))

    compiled = jax.jit(march)
    return lambda times, q: np.moveaxis(np.asarray(compiled(values, q, times)), 1, 0)


CONTENDERS = {"JAX scan and while_loop, jit": scan}

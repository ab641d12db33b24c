r"""`kc.jax`: a motion, or a transmission, as a function of JAX that can be differentiated.

The code is the emitted module's own, on JAX's numbers. A position is sought along the straight
way from a known one, in time and parameters, with the criteria of a march; its derivatives are
those of the equations, not of the iterations:

.. math:: \Phi_q \, dq = -(\Phi_t \, dt + \Phi_p \, dp)
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile import criteria
from kincompile.errors import InputError, SolveError, UnsupportedError, package_of_extra
from kincompile.functions.transmission import Transmission
from kincompile.runtime.engine.code import code_of
from kincompile.runtime.problem import problem
from kincompile.runtime.solve import solve

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

    from numpy.typing import ArrayLike


def jax(given: ModuleType | Transmission, times: ArrayLike = 0.0) -> Callable[..., Any]:
    """Return the motion of a module as a function of JAX, or the outputs of a transmission.

    ``f = kc.jax(module)`` is a function ``q, q_dot, q_ddot = f(t, p)`` of one time and of the
    parameters (k,), by default those of the module; ``f = kc.jax(transmission)`` is ``x = f(u, p)``
    of the inputs (m,) and of the parameters beside them. They can be given to ``jax.jit``,
    ``vmap``, ``grad``, ``jvp``, ``vjp`` and ``jax.export``. For a batch use ``vmap``.

    Parameters
    ----------
    given
        What `compile` or `load` returned, or `transmission`.
    times : array_like, optional
        Of a motion, times whose positions are found beforehand, as by `solve`: others are sought
        from the nearest of them. A motion of many turns is faster with some times in each.

    Returns
    -------
    callable
        Coordinates (n,) and their rates, or outputs (n,), in double precision. They are NaN where
        the mechanism cannot be assembled on the branch of its first position, and beyond a
        singular one: `solve` and `Transmission.at` say why.

    Raises
    ------
    InputError
        If JAX computes in single precision.
    UnsupportedError
        If JAX is not installed, or the module has no planned solve, as in grouped form, or is of an
        earlier version.
    StructuralError, SolveError
        If the equations do not determine the coordinates, or cannot be assembled at `times`.
    """
    _double_precision()
    if isinstance(given, Transmission):
        return _outputs(given)
    return _motion(given, times)


def _double_precision() -> None:
    """Check that JAX is there and has numbers of 64 bits."""
    with package_of_extra("jax", "jax"):
        import jax.numpy as jnp
    if jnp.zeros(()).dtype != np.float64:
        raise InputError(
            "JAX computes in single precision, in which no position converges. "
            'Call jax.config.update("jax_enable_x64", True) first.'
        )


def _motion(module: ModuleType, times: ArrayLike) -> Callable[..., Any]:
    """Return the function of time and parameters."""
    import jax
    import jax.numpy as jnp

    first = solve(module, times)
    if not first.success:
        raise SolveError(f"kc.jax starts from the positions at `times`: {first.message}", first)
    defaults = np.array(module.DEFAULTS)
    position, linear, solved, lanes = _positions(module, first.t, first.q, defaults)

    def motion(t: Any, p: Any = defaults) -> tuple[Any, Any, Any]:
        """Return q, q_dot and q_ddot (n,) at a time t and with parameters p (k,)."""
        t, p = _numbers(t, (), "t", "one time"), _vector(p, defaults, "p", module.PARAMETERS)
        q = position(t, p)
        factors, is_missing = linear(q, t, p)[1], ~jnp.isfinite(q).all()  # a driven rate is known
        q_dot = jnp.where(is_missing, jnp.nan, solved(factors, lanes["nu"](q, t, p)))
        q_ddot = solved(factors, lanes["gamma"](q, q_dot, t, p))
        return q, q_dot, jnp.where(is_missing, jnp.nan, q_ddot)

    return jax.jit(motion)


def _outputs(f: Transmission) -> Callable[..., Any]:
    """Return the function of inputs and parameters."""
    import jax
    import jax.numpy as jnp

    module, home, inputs = f.module, f.home, len(f.inputs)
    position, _, _, lanes = _positions(module, np.zeros(1), home.q[None], home.p)
    count = len(home.p) - inputs - len(f.loop.rates)
    others = np.zeros(len(f.loop.rates))
    names = (*module.COORDINATES, *getattr(module, "OUTPUTS", ()))
    places = np.array([names.index(name) for name in f.outputs])
    is_twist = np.array([name in f.twists for name in f.outputs])

    def outputs(u: Any, p: Any = home.p[:count]) -> Any:
        """Return the outputs x (n,) at inputs u (m,) and with parameters p (k,)."""
        given = _vector(p, home.p[:count], "p", module.PARAMETERS[:count])
        whole = jnp.concatenate([given, others, _vector(u, home.u, "u", f.inputs)])
        q = position(jnp.zeros(()), whole)
        still = jnp.zeros_like(q)
        y = lanes["observe"](q, still, still, jnp.zeros(()), whole) if "observe" in lanes else ()
        columns = jnp.concatenate([q, _array(y[: len(names) - len(q)])])
        return jnp.where(is_twist | ~jnp.isfinite(q).all(), jnp.nan, columns[places])

    return jax.jit(outputs)


def _vector(given: Any, like: Any, what: str, names: tuple[str, ...]) -> Any:
    """Return a vector, checked."""
    return _numbers(given, like.shape, what, f"{len(names)} numbers, {', '.join(names) or 'none'}")


def _numbers(given: Any, shape: tuple[int, ...], what: str, wanted: str) -> Any:
    """Return real numbers of a shape."""
    import jax.numpy as jnp

    if isinstance(given, dict) or jnp.iscomplexobj(given):
        kind = "a mapping" if isinstance(given, dict) else "complex"
        raise InputError(f"{what} is {kind}: give {wanted}, as an array of real numbers.")
    found = jnp.asarray(given, dtype=float)
    if found.shape != shape:
        raise InputError(
            f"{what} has the shape {found.shape}: give {wanted}. For a batch use jax.vmap."
        )
    return found


def _array(values: Any) -> Any:
    """Return numbers, some of them plain, as a vector."""
    import jax.numpy as jnp

    return jnp.stack([jnp.asarray(x, dtype=float) for x in values]) if values else jnp.zeros(0)


def _positions(module: ModuleType, t_0: Any, q_0: Any, p_0: Any) -> tuple[Any, Any, Any, Any]:
    """Return the position q(t, p) with its derivatives, factors of Phi_q, solve, and the code."""
    import jax
    import jax.numpy as jnp

    code, name = code_of(module), module.NAME
    if code.lanes is None or not hasattr(module, "lanes"):
        raise UnsupportedError(
            f"{name} has no planned solve that runs on JAX: it is in grouped form, or was emitted "
            "by an earlier version. Compile it again, with form='inline' if it is large."
        )
    lanes, m = module.lanes(jnp), module.N_EQUATIONS
    scale = jnp.asarray(problem(code, p_0, q_0[0], float(t_0[0])).reference)

    def equations(q: Any, t: Any, p: Any) -> Any:
        return _array(lanes["position"](q, t, p)[:m])

    def linear(q: Any, t: Any, p: Any) -> tuple[Any, Any, Any]:
        """Return Phi, the factors of Phi_q, and the signs of the determinants of its blocks."""
        values = lanes["position"](q, t, p)
        factors, determinants = lanes["factor"](values[m:])
        return values[:m], factors, jnp.sign(_array(determinants))

    def solved(factors: Any, right: Any) -> Any:
        return _array(lanes["solve"](factors, list(right)))

    def size(vector: Any) -> Any:
        return jnp.max(jnp.abs(vector / scale), initial=0.0)

    def corrected(q: Any, t: Any, p: Any) -> tuple[Any, Any, Any]:
        """Return the position near q, whether it converged, and the signs there."""

        def correct(carry: Any) -> Any:
            at, k, _, _ = carry
            Phi, factors, own = linear(at, t, p)
            change = solved(factors, Phi)
            return at - change, k + 1, size(change), own

        def goes_on(carry: Any) -> Any:
            _, k, change, _ = carry
            return (change > criteria.TOLERANCE) & (k < criteria.MAX_CORRECTIONS)

        found, _, change, own = jax.lax.while_loop(goes_on, correct, (q, 0, jnp.inf, signs[0]))
        return found, change <= criteria.TOLERANCE, own

    def along(t: Any, p: Any) -> Any:
        """Return the position at the end of a straight way from a known one, or NaN."""
        nearest = jnp.argmin(jnp.abs(t - begin))
        begun, kept = begin[nearest], signs[nearest]

        def at(s: Any) -> tuple[Any, Any]:
            return begun + s * (t - begun), p_0 + s * (p - p_0)

        def step(carry: Any) -> Any:
            s, h, q = carry
            end = jnp.minimum(s + h, 1.0)
            missed = jax.jvp(lambda s: equations(q, *at(s)), (s,), (end - s,))[1]
            moved = -solved(linear(q, *at(s))[1], missed)
            found, is_good, own = corrected(q + moved, *at(end))
            error, movement = size(found - q - moved), size(moved)
            is_good &= (movement <= 1.0) & jnp.all(own == kept)
            is_good &= (error <= criteria.SMALL_ERROR) | (error <= criteria.ALLOWED_PART * movement)
            s, q = jnp.where(is_good, end, s), jnp.where(is_good, found, q)
            return s, jnp.where(is_good, 2 * h, h / 2), q

        def goes_on(carry: Any) -> Any:
            return (carry[0] < 1.0) & (carry[1] > criteria.SMALLEST_PART)

        s, _, q = jax.lax.while_loop(goes_on, step, (0.0, 1.0, known[nearest]))
        # Laws by pieces have a value at a time that is no number.
        return jnp.where((s == 1.0) & jnp.isfinite(t) & jnp.all(jnp.isfinite(p)), q, jnp.nan)

    @jax.custom_jvp
    def position(t: Any, p: Any) -> Any:
        return along(t, p)

    @position.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        q = position(*primals)
        _, missed = jax.jvp(partial(equations, q), primals, tangents)
        return q, -solved(linear(q, *primals)[1], missed)

    begin, known = jnp.asarray(t_0), jnp.asarray(q_0)
    signs = jax.vmap(lambda q, t: linear(q, t, jnp.asarray(p_0))[2])(known, begin)
    return position, linear, solved, lanes

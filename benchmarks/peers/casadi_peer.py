"""CasADi: its own derivatives and its `rootfinder`, in its virtual machine or as generated C."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.peers.common import (
    MAX_ITERATIONS,
    TOLERANCE,
    Analysis,
    Motion,
    Vector,
    compiled_c,
    empty_motion,
    optional,
    require,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from benchmarks.linkages import Linkage

casadi = optional("casadi")


def call_per_step(linkage: Linkage) -> Analysis:
    """Return a Python loop that calls the step for each time."""
    step, p = _step(linkage), linkage.values
    guess = np.array(linkage.guess)

    def analyse(times: Vector) -> Motion:
        motion = empty_motion(times.size, guess.size)
        q = guess
        for k, t in enumerate(times):
            q, q_dot, q_ddot = step(q, t, p)
            for place, values in zip(motion, (q, q_dot, q_ddot), strict=True):
                place[k] = values.full()[:, 0]
        return motion

    return analyse


def accumulated(linkage: Linkage) -> Analysis:
    """Return `mapaccum` of the step over all times, in the virtual machine."""
    step = _step(linkage)
    return _analysis(linkage, lambda count: step.mapaccum("march", count))


def generated(linkage: Linkage) -> Analysis:
    """Return the same as C that CasADi generates, gcc -O3."""
    step = _step(linkage)
    return _analysis(linkage, lambda count: external(step.mapaccum("march", count)))


def _analysis(linkage: Linkage, build: Any) -> Analysis:
    """Return an analysis by a function over all times, which is built when first needed."""
    built: dict[int, Any] = {}

    def analyse(times: Vector) -> Motion:
        if times.size not in built:
            built[times.size] = build(times.size)
        p = np.repeat(linkage.values[:, np.newaxis], times.size, axis=1)
        q, q_dot, q_ddot = built[times.size](np.array(linkage.guess), times[np.newaxis], p)
        return q.full().T, q_dot.full().T, q_ddot.full().T

    return analyse


def external(function: Any) -> Any:
    """Compile a function's generated C and load it."""
    with tempfile.TemporaryDirectory() as folder:
        generator = casadi.CodeGenerator("march.c")
        generator.add(function)
        generator.generate(f"{folder}/")
        compiled_c(Path(folder) / "march.c")
        return casadi.external(function.name(), str(Path(folder) / "march.so"))


def sensitivities(linkage: Linkage, *, is_compiled: bool) -> Callable[[Vector, Vector], Vector]:
    """Return a function of times and positions that gives q_p, q_dot_p and q_ddot_p.

    A step of Newton's method from a position has the derivative of the position.
    """
    four = all_four(*equations(linkage))
    symbols = four.sx_in()
    position = casadi.Function("position", [symbols[0], *symbols[2:]], four(*symbols)[:2])
    before, time = casadi.MX.sym("before", symbols[0].numel()), casadi.MX.sym("time")
    values = casadi.MX.sym("values", symbols[3].numel())
    residual, matrix = position(before, time, values)
    q = before - casadi.solve(matrix, residual)
    state = casadi.vertcat(q, *_rates(four, q, time, values))
    slopes = casadi.densify(casadi.jacobian(state, values))
    function = casadi.Function("slopes", [before, time, values], [slopes])
    built: dict[int, Any] = {}

    def differentiate(times: Vector, q: Vector) -> Vector:
        if times.size not in built:
            mapped = function.map(times.size)
            built[times.size] = external(mapped) if is_compiled else mapped
        p = np.repeat(linkage.values[:, np.newaxis], times.size, axis=1)
        found = built[times.size](q.T, times[np.newaxis], p).full()
        return np.moveaxis(found.reshape(3, q.shape[1], times.size, -1), 1, 2)

    return differentiate


def equations(linkage: Linkage) -> tuple[Any, Any, Any, Any]:
    """Return Phi, q, t and p of a linkage in SX."""
    require(casadi, "casadi")
    q, t = casadi.SX.sym("q", len(linkage.guess)), casadi.SX.sym("t")
    p = casadi.SX.sym("p", len(linkage.parameters))
    rows = linkage.residual(casadi, casadi.vertsplit(q), t, casadi.vertsplit(p))
    return casadi.vertcat(*rows), q, t, p


def _step(linkage: Linkage) -> Any:
    """Return the function (q before, t, p) -> (q, q_dot, q_ddot) of a linkage."""
    return step_function(*equations(linkage))


def all_four(Phi: Any, q: Any, t: Any, p: Any) -> Any:
    """Return the function (q, q_dot, t, p) -> (Phi, Phi_q, nu, gamma) of equations in SX."""
    q_dot = casadi.SX.sym("q_dot", q.numel())
    rate = casadi.jtimes(Phi, q, q_dot)
    nu = -casadi.jacobian(Phi, t)
    gamma = -casadi.jtimes(rate, q, q_dot) - 2 * casadi.jacobian(rate, t)
    gamma += casadi.jacobian(nu, t)
    results = [Phi, casadi.jacobian(Phi, q), nu, gamma]
    return casadi.Function("all_four", [q, q_dot, t, p], results)


def step_function(Phi: Any, q: Any, t: Any, p: Any) -> Any:
    """Return the function (q before, t, p) -> (q, q_dot, q_ddot) of equations in SX."""
    options = {"abstol": TOLERANCE, "abstolStep": TOLERANCE, "max_iter": MAX_ITERATIONS}
    problem = {"x": q, "p": casadi.vertcat(t, p), "g": Phi}
    root = casadi.rootfinder("root", "fast_newton", problem, options)
    before, time = casadi.MX.sym("before", q.numel()), casadi.MX.sym("time")
    values = casadi.MX.sym("values", p.numel())
    found = root(before, casadi.vertcat(time, values))
    results = [found, *_rates(all_four(Phi, q, t, p), found, time, values)]
    return casadi.Function("step", [before, time, values], results)


def _rates(four: Any, q: Any, t: Any, p: Any) -> tuple[Any, Any]:
    """Return velocity and acceleration at a position."""
    symbols = four.sx_in()
    _, Phi_q, nu, gamma = four(*symbols)
    velocity = casadi.Function("velocity", [symbols[0], *symbols[2:]], [Phi_q, nu])
    acceleration = casadi.Function("acceleration", symbols, [gamma])
    matrix, right_side = velocity(q, t, p)
    q_dot = casadi.solve(matrix, right_side)
    return q_dot, casadi.solve(matrix, acceleration(q, q_dot, t, p))


CONTENDERS = {
    "CasADi rootfinder, one call a step": call_per_step,
    "CasADi fast_newton in mapaccum": accumulated,
    "CasADi fast_newton in mapaccum, generated C": generated,
}

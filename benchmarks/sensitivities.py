"""What exact sensitivities cost and what they are worth, beside the same by other means.

``python -m benchmarks.sensitivities`` differentiates the motion of a four-bar, 10,000 points,
q, q_dot and q_ddot by its five parameters: kincompile in NumPy and in C, central differences of the
same solvers, JAX's jacfwd and CasADi's jacobian, both of a Newton step and the rates, at positions
that are given. Errors are against complex steps. The limits are 2 times the kinematics of the same
target, a tenth of the time of differences and a 10,000th of their error.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

import kincompile as kc
from benchmarks import machine
from benchmarks.linkages import FOUR_BAR, POINTS, Linkage
from benchmarks.peers import casadi_peer, jax_peer
from benchmarks.peers.common import Skipped
from benchmarks.tables import Target, print_table, print_targets
from benchmarks.timing import in_turn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from types import ModuleType

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROUNDS = 15
STEP = 1e-5
"""Of the differences, relative to the parameter: near the best for second rates."""

JAX, CASADI = "JAX jacfwd, jit and map", "CasADi jacobian, map"
GENERATED = "CasADi jacobian, map, generated C"


def motion(solution: kc.Solution) -> Array:
    """Return q, q_dot and q_ddot, shape (3, N, n)."""
    return np.array((solution.q, solution.q_dot, solution.q_ddot))


def differences(module: ModuleType, t: Array) -> Array:
    """Return central differences of the motion, shape (3, N, n, 5)."""
    found = []
    for name, value in zip(module.PARAMETERS, module.DEFAULTS.tolist(), strict=True):
        h = STEP * value
        ends = [motion(kc.solve(module, t, p={name: value + s * h})) for s in (1, -1)]
        found.append((ends[0] - ends[1]) / (2 * h))
    return np.stack(found, axis=-1)


def complex_steps(solution: kc.Solution) -> Array:
    """Return the derivatives by Newton's method with p + 1e-30 i, shape (3, N, n, 5)."""
    module, t = solution.module, solution.t
    assert module is not None
    found = []
    for name in module.PARAMETERS:
        p = module.DEFAULTS.astype(complex)
        p[module.PARAMETERS.index(name)] += 1e-30j
        q = solution.q.astype(complex)
        for _ in range(3):
            Phi, Phi_q = module.position(q, t, p)
            q = q - np.linalg.solve(Phi_q, Phi[..., np.newaxis])[..., 0]
        Phi_q, nu = module.velocity(q, t, p)
        q_dot = np.linalg.solve(Phi_q, nu[..., np.newaxis])[..., 0]
        gamma = module.gamma(q, q_dot, t, p)
        q_ddot = np.linalg.solve(Phi_q, gamma[..., np.newaxis])[..., 0]
        found.append(np.array((q, q_dot, q_ddot)).imag / 1e-30)
    return np.stack(found, axis=-1)


def error(found: Array, known: Array) -> float:
    """Return the largest error, of each order relative to its largest number."""
    axes = (1, 2, 3)
    return float(np.max(np.abs(found - known).max(axis=axes) / np.abs(known).max(axis=axes)))


def exact(solution: kc.Solution) -> Array:
    """Return the sensitivities, shape (3, N, n, k)."""
    found = kc.sensitivities(solution, tuple(solution.parameters))
    return np.array((found.q_p, found.q_dot_p, found.q_ddot_p))


def peers(linkage: Linkage, t: Array, q: Array) -> Iterator[tuple[str, Callable[[], Array]]]:
    """Yield the contenders that are installed."""
    builders: Mapping[str, Callable[[Linkage], Callable[[Array, Array], Array]]] = {
        JAX: jax_peer.sensitivities,
        CASADI: partial(casadi_peer.sensitivities, is_compiled=False),
        GENERATED: partial(casadi_peer.sensitivities, is_compiled=True),
    }
    for name, build in builders.items():
        try:
            yield name, partial(build(linkage), t, q)
        except Skipped as reason:
            print(f"{name}: {reason}")


def measure(linkage: Linkage) -> list[Target]:
    """Print the table of a linkage; return what was to be reached."""
    t = linkage.times(POINTS)
    modules = {target: kc.compile(linkage.mechanism(), target) for target in ("numpy", "c")}
    solutions = {target: kc.solve(module, t) for target, module in modules.items()}
    names = tuple(linkage.parameters)
    calls: dict[str, Callable[[], object]] = {}
    arrays: dict[str, Callable[[], Array]] = {}
    for target, solution in solutions.items():
        calls[f"kinematics, {target}"] = partial(kc.solve, modules[target], t)
        calls[f"sensitivities, {target}"] = partial(kc.sensitivities, solution, names)
        arrays[f"sensitivities, {target}"] = partial(exact, solution)
        arrays[f"differences, {target}"] = partial(differences, modules[target], t)
    arrays |= peers(linkage, t, np.ascontiguousarray(solutions["numpy"].q))
    times = in_turn(arrays | calls, calls=1, rounds=ROUNDS)
    known = complex_steps(solutions["numpy"])
    errors = {name: error(call(), known) for name, call in arrays.items()}
    rows = [
        [
            name,
            f"{1e3 * time.median:.2f} ({1e3 * time.least:.2f})",
            f"{errors[name]:.0e}" if name in errors else "",
        ]
        for name, time in times.items()
    ]
    print_table(
        f"{linkage.name}, {POINTS} points, {len(names)} parameters",
        ("contender", "ms, median (least)", "error"),
        rows,
    )
    return list(reached(linkage.name, {k: x.least for k, x in times.items()}, errors))


def reached(name: str, least: Mapping[str, float], errors: Mapping[str, float]) -> Iterator[Target]:
    """Yield the ratios that have limits."""
    for target in ("numpy", "c"):
        own, other = f"sensitivities, {target}", f"differences, {target}"
        by_motion = least[own] / least[f"kinematics, {target}"]
        yield Target(f"{name}, {target}: time by kinematics", by_motion, "at most", 2)
        ratio = least[other] / least[own]
        yield Target(f"{name}, {target}: time of differences", ratio, "at least", 10)
        ratio = errors[other] / errors[own]
        yield Target(f"{name}, {target}: error of differences", ratio, "at least", 1e4)
        for peer in (JAX, CASADI, GENERATED):
            if peer in least:
                yield Target(f"{name}, {target}: {peer}", least[peer] / least[own], "at least", 1)


def main() -> None:
    """Measure and print."""
    before = machine.load()
    targets = measure(FOUR_BAR)
    print_targets("Sensitivities: what was to be reached, ratios of the least times", targets)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


if __name__ == "__main__":
    main()

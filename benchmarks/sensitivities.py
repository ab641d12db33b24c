"""What exact sensitivities cost and what they are worth: as ratios, in one process.

``python -m benchmarks.sensitivities`` differentiates the motion of a four-bar, 10,000 points, by
five parameters, beside its kinematics and central differences of the same solver; the limits are
2 times its kinematics, a tenth of the time of differences and a 10,000th of their error.
"""

from __future__ import annotations

import runpy
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import kincompile as kc
from benchmarks.outputs import POINTS
from benchmarks.timing import in_turn

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

NAMES = ("a", "b", "c", "d", "omega")
ROUNDS = 25
STEP = 1e-5
"""Of the differences, relative to the parameter: near the best for second rates."""


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
    for name in NAMES:
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


def main() -> None:
    """Measure and print."""
    path = Path(__file__).resolve().parents[1] / "examples" / "four_bar.py"
    model = runpy.run_path(str(path))["mechanism"]
    t = np.linspace(0, 2 * np.pi / 1.5, POINTS)
    for target in ("numpy", "c"):
        module = kc.compile(model, target)
        solution = kc.solve(module, t)
        calls = {
            "kinematics": partial(kc.solve, module, t),
            "sensitivities": partial(kc.sensitivities, solution, NAMES),
            "differences": partial(differences, module, t),
        }
        least = {name: x.least for name, x in in_turn(calls, calls=1, rounds=ROUNDS).items()}
        exact = kc.sensitivities(solution, NAMES)
        known = complex_steps(solution)
        ours = error(np.array((exact.q_p, exact.q_dot_p, exact.q_ddot_p)), known)
        theirs = error(differences(module, t), known)
        times = ", ".join(f"{name} {1e3 * x:.2f} ms" for name, x in least.items())
        print(
            f"{target}: {times}; sensitivities by kinematics "
            f"{least['sensitivities'] / least['kinematics']:.2f} (limit 2), differences by "
            f"sensitivities {least['differences'] / least['sensitivities']:.1f} (limit 10); "
            f"errors {ours:.1e} and {theirs:.1e}, ratio {theirs / ours:.1e} (limit 1e4)"
        )


if __name__ == "__main__":
    main()

"""One position at a time: `kc.stepper` and `kc.solve` beside the loop of docs/emitted_modules.md.

``python -m benchmarks.stepper`` prints, for a four-bar, a six-bar and an RSSR linkage, what a call
takes of the time of that loop, in one process and in turn; the limits are 2 times the loop, and 5
microseconds a call where the module is compiled C. The loop gives positions and velocities; the
stepper gives accelerations too, and checks what it gives. A second table has `kc.solve` of one
time: from a near guess at each time, from the model's own guess at each time, and at one time again
and again, whose start the module keeps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import kincompile as kc
from benchmarks import linkages, machine, space
from benchmarks.tables import Target, print_table, print_targets
from benchmarks.timing import in_turn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import ModuleType

    from benchmarks.timing import Timing

CALLS, ROUNDS = 200, 15
"""Calls over a turn, and how often each contender has its turn."""
MOST, MOST_US = 2.0, 5.0
"""What a call may take of the loop's time, and in C in microseconds."""
BY_HAND, STEPPER, WITH_P = "loop by hand", "stepper", "stepper, a parameter given"
NEAR, ROUGH, AGAIN = "from a near guess", "from the model's guess", "the same time again"
ASIDE = 0.01
"""How far a near guess is from its position."""
MOST_SOLVE_US = {"numpy": 150.0, "c": 80.0}
"""What `kc.solve` of one time may take, in microseconds."""


def by_hand(module: ModuleType, q: Any) -> Callable[[float], Any]:
    """Return the loop of docs/emitted_modules.md, which goes on from its last position."""

    def step(t: float) -> Any:
        for _ in range(20):
            Phi, Phi_q = module.position(q, t)
            correction = np.linalg.solve(Phi_q, -Phi)
            q[:] += correction
            if np.linalg.norm(correction) < 1e-12:
                break
        Phi_q, nu = module.velocity(q, t)
        return q, np.linalg.solve(Phi_q, nu)

    return step


def contenders(module: ModuleType, times: list[float]) -> dict[str, Callable[[], object]]:
    """Return what is timed, each over all times, after a look at whether they agree."""
    first, name = kc.solve(module, times[0]), module.PARAMETERS[0]
    value, step = float(module.DEFAULTS[0]), kc.stepper(module)
    loop, other = by_hand(module, first.q[0].copy()), kc.stepper(module)
    for t in times:
        q, q_dot = loop(t)
        now = step(t)
        assert now.success
        np.testing.assert_allclose(now.q, q, rtol=0, atol=1e-11 * max(1.0, abs(q).max()))
        np.testing.assert_allclose(now.q_dot, q_dot, rtol=0, atol=1e-9 * max(1.0, abs(q_dot).max()))
    back = times + times[::-1]
    return {
        BY_HAND: lambda: [loop(t) for t in back],
        STEPPER: lambda: [step(t) for t in back],
        WITH_P: lambda: [other(t, **{name: value}) for t in back],
    }


def solves(module: ModuleType, times: list[float]) -> dict[str, Callable[[], object]]:
    """Return `kc.solve` of one time, each over all times."""
    near = [(t, kc.solve(module, t).q[0] + ASIDE) for t in times]
    return {
        NEAR: lambda: [kc.solve(module, t, guess=guess, throw=True) for t, guess in near],
        ROUGH: lambda: [kc.solve(module, t, throw=True) for t in times],
        AGAIN: lambda: [kc.solve(module, times[1], throw=True) for _ in times],
    }


def mechanisms() -> Iterator[tuple[Any, list[float]]]:
    """Give mechanisms, and times of a turn of each."""
    for linkage in (linkages.FOUR_BAR, linkages.SIX_BAR):
        yield linkage.mechanism(), linkage.times(CALLS).tolist()
    rssr = space.LINKAGES[0]
    yield rssr.mechanism(), rssr.times(CALLS).tolist()


def main() -> None:
    """Measure and print."""
    before, rows, of_solve, targets = machine.load(), [], [], []
    for model, times in mechanisms():
        for target in ("numpy", "c"):
            try:
                module = kc.compile(model, target=target)
            except kc.UnsupportedError as error:
                print(f"{target}: skipped: {error}\n")
                continue
            found = in_turn(contenders(module, times), calls=1, rounds=ROUNDS)
            rows.append([f"{model.name}, {target}", *cells(found)])
            ratio = found[STEPPER].least / found[BY_HAND].least
            what = f"{model.name}, {target}, beside the loop"
            targets.append(Target(what, ratio, "at most", MOST))
            if target == "c":
                each = found[STEPPER].least / (2 * CALLS) / 1e-6
                targets.append(Target(f"{model.name}, C, a call", each, "at most", MOST_US, "us"))
            found = in_turn(solves(module, times), calls=1, rounds=ROUNDS)
            each = [found[name].least / CALLS / 1e-6 for name in (NEAR, ROUGH, AGAIN)]
            of_solve.append([f"{model.name}, {target}", *(f"{x:.3g}" for x in each)])
            for name, us in ((NEAR, each[0]), (AGAIN, each[-1])):
                what = f"{model.name}, {target}, `kc.solve` {name}"
                targets.append(Target(what, us, "at most", MOST_SOLVE_US[target], "us"))
    heads = ("mechanism, target", BY_HAND, STEPPER, WITH_P, "stepper / loop")
    print_table("One position at a time, us a call, least", heads, rows)
    heads = ("mechanism, target", NEAR, ROUGH, AGAIN)
    print_table("`kc.solve` of one time, us a call, least", heads, of_solve)
    print_targets("Steppers: what was to be reached", targets)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


def cells(found: dict[str, Timing]) -> list[str]:
    """Return the cells of a row: microseconds a call, and the ratio."""
    each = [found[name].least / (2 * CALLS) / 1e-6 for name in (BY_HAND, STEPPER, WITH_P)]
    return [*(f"{x:.3g}" for x in each), f"{each[1] / each[0]:.2g}"]


if __name__ == "__main__":
    main()

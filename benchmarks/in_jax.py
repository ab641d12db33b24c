"""Motions as functions of JAX: `kc.jax` beside compiled C.

``python -m benchmarks.in_jax`` prints, for a four-bar and an RSSR linkage over a turn, what one
call for 10,000 times takes of compiled C's, with one known position and with some in the turn, and
what its derivatives by all parameters take. JAX runs on the device that it finds: an accelerator
where there is one. How long XLA compiles each is printed too.
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np

import kincompile as kc
from benchmarks import linkages, machine, space
from benchmarks.tables import print_table
from benchmarks.timing import in_turn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

TIMES = 10_000
KNOWN = (1, 11, 101)
"""Positions that are found beforehand."""
C, DERIVATIVES = "C", "q by all parameters"


def mechanisms() -> Iterator[tuple[Any, Any]]:
    """Give mechanisms, and times of a turn of each."""
    yield linkages.FOUR_BAR.mechanism(), linkages.FOUR_BAR.times(TIMES)
    yield space.LINKAGES[0].mechanism(), space.LINKAGES[0].times(TIMES)


def contenders(jax: Any, model: Any, times: Any) -> tuple[dict[str, Callable[[], Any]], list[str]]:
    """Return what is timed, which agrees, and the seconds in which XLA compiled each."""
    compiled, module = kc.compile(model, target="c"), kc.compile(model)
    wanted = kc.solve(compiled, times)
    scale = np.abs(wanted.q_ddot).max()
    runs: dict[str, Callable[[], Any]] = {C: lambda: kc.solve(compiled, times)}
    seconds = [""]
    known = np.linspace(times[0], times[-1], KNOWN[-1])

    def prepared(name: str, f: Any) -> Any:
        start = time.perf_counter()
        found = jax.block_until_ready(f(times))
        seconds.append(f"{time.perf_counter() - start:.2g}")
        runs[name] = lambda: jax.block_until_ready(f(times))
        return found

    for count in KNOWN:
        own = kc.jax(module, times[0] if count == 1 else known[:: (KNOWN[-1] - 1) // (count - 1)])
        _, _, q_ddot = prepared(f"JAX, {count} known", jax.jit(jax.vmap(own)))
        np.testing.assert_allclose(q_ddot, wanted.q_ddot, rtol=0, atol=1e-9 * scale)
    by_p = jax.jacrev(lambda t, p: own(t, p)[0], argnums=1)
    prepared(DERIVATIVES, jax.jit(jax.vmap(lambda t: by_p(t, module.DEFAULTS))))
    return runs, seconds


def main() -> None:
    """Measure and print."""
    try:
        import jax
    except ImportError:
        sys.exit("JAX is not installed: pip install -e '.[jax]' in the checkout brings it.")
    jax.config.update("jax_enable_x64", True)
    before, rows = machine.load(), []
    for model, times in mechanisms():
        runs, seconds = contenders(jax, model, times)
        found = in_turn(runs, calls=1, rounds=9)
        for (name, timing), spent in zip(found.items(), seconds, strict=True):
            ratio = timing.least / found[C].least
            each = timing.least / TIMES / 1e-9
            rows.append([f"{model.name}, {name}", f"{each:.3g}", f"{ratio:.3g}", spent])
    heads = ("mechanism, how", "ns a time", "beside C", "XLA compiles, s")
    print_table(f"{TIMES:,} times in one call, JAX on {jax.devices()[0]}", heads, rows)
    print(f"{machine.description()}. Load before {before}, after {machine.load()}.")


if __name__ == "__main__":
    main()

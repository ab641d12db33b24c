"""One fresh process: `python -m benchmarks.cold kincompile|sympy|sympy-warm` prints seconds.

The first number is for the four-bar, the second for another mechanism of the same joint types; it
is processor time, so that what else runs on the machine does not count.
Writing the mechanisms down and imports are not counted. But SymPy imports its printers when
`lambdify` is called first: `sympy` counts that, `sympy-warm` calls `lambdify` on a symbol before.
"""

from __future__ import annotations

import json
import sys
from time import process_time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable


def main(peer: str) -> None:
    """Time a peer in this process and print the times as JSON."""
    times = by_kincompile() if peer == "kincompile" else by_sympy(is_warm=peer == "sympy-warm")
    print(json.dumps(times))


def by_kincompile() -> list[float]:
    """Time `kc.compile`, from the mechanism to the loaded module."""
    import kincompile as kc
    from benchmarks import mechanisms

    models = [mechanisms.four_bar(), mechanisms.crank_rocker()]
    return _times(kc.compile, models)


def by_sympy(*, is_warm: bool) -> list[float]:
    """Time Jacobian, nu, gamma and `lambdify(cse=True)` of the four quantities."""
    import sympy

    from benchmarks import textbook

    if is_warm:
        x = sympy.Symbol("x")
        sympy.lambdify([x], [x], "numpy", cse=True)
    models = [textbook.four_bar(), textbook.crank_rocker()]
    return _times(lambda model: textbook.four_functions(textbook.derive(model)), models)


def _times(build: Callable[[Any], object], models: list[Any]) -> list[float]:
    times = []
    for model in models:
        start = process_time()
        build(model)
        times.append(process_time() - start)
    return times


if __name__ == "__main__":
    main(sys.argv[1])

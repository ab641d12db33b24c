"""How the tests of moving joints compare: columns of a motion with laws known from mechanics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import sympy

import kincompile as kc

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

TIMES = np.array([0.0, 0.3, 0.8])
"""The poses: every law below moves at all of them."""

Moving: TypeAlias = "tuple[Any, Mapping[str, Any]]"
"""A mechanism, and what some of its columns are as functions of t."""

Make: TypeAlias = "Callable[[], Moving]"


class Cases(dict[str, tuple[str, Make]]):
    """Mechanisms that move, by name, each with the type of constraint that it is a case of."""

    def of(self, kind: str) -> Callable[[Make], Make]:
        """Return what enters a function as a case of a type."""

        def enter(make: Make) -> Make:
            self[f"{kind} {make.__name__}"] = (kind, make)
            return make

        return enter


def assert_that_it_moves(kind: type[Any], make: Callable[[], Moving]) -> None:
    """Compare positions, velocities and accelerations of a case at a few poses with mechanics."""
    mechanism, known = make()
    assert kind.is_own or any(type(item) is kind for item in mechanism.constraints)
    solution = kc.solve(kc.compile(mechanism), TIMES, throw=True)
    for column, law in known.items():
        orders = ("", "_dot") if ".omega_" in column else ("", "_dot", "_ddot")
        for order, ending in enumerate(orders):
            rate = sympy.lambdify(kc.t, sympy.diff(law, kc.t, order))
            expected = [float(rate(time)) for time in TIMES]
            np.testing.assert_allclose(
                solution[column + ending], expected, rtol=1e-9, atol=1e-9, err_msg=column + ending
            )


def motor(start: float = 0.2) -> Any:
    """Return an angle that turns counterclockwise and speeds up."""
    return start + 1.3 * kc.t + 0.4 * kc.t**2

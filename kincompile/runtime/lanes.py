"""The code of an emitted module on its lanes: each coordinate a number or an array of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from types import ModuleType

Lane = Any
"""A float, or an array (N,) over a batch."""
Lanes = Sequence[Lane] | NDArray[np.float64]
"""One lane a coordinate or an equation; an array holds one a row."""


@dataclass(frozen=True, slots=True)
class Factored:
    """Phi at a position, with Phi_q factored.

    Attributes
    ----------
    Phi
        One lane an equation.
    factors
        What the planned solve keeps of Phi_q.
    determinants
        One lane a block; their product is det Phi_q up to a constant factor.
    """

    Phi: Lanes
    factors: Lanes
    determinants: Lanes


class LaneCode:
    """The functions of a module with parameters and kind of number set.

    Parameters
    ----------
    module
        An emitted module with a planned solve.
    functions
        ``module.FLOATS`` or ``module.ARRAYS``.
    p
        Parameters: floats, or arrays that broadcast with the lanes.
    """

    def __init__(self, module: ModuleType, functions: Any, p: Lanes) -> None:
        lanes = module.LANES
        self._functions, self._p, self._m = functions, p, module.N_EQUATIONS
        self._position, self._nu, self._gamma = lanes["position"], lanes["nu"], lanes["gamma"]
        self._factor, self._solve = lanes["factor"], lanes["solve"]

    def position(self, q: Lanes, t: Lane) -> Factored:
        """Evaluate Phi and Phi_q, and factor Phi_q."""
        values = self._position(self._functions, q, t, self._p)
        factors, determinants = self._factor(self._functions, values[self._m :])
        return Factored(values[: self._m], factors, determinants)

    def solve(self, at: Factored, right: Lanes) -> Lanes:
        """Return x of Phi_q x = right."""
        solution: Lanes = self._solve(self._functions, at.factors, right)
        return solution

    def rates(self, at: Factored, q: Lanes, t: Lane) -> tuple[Lanes, Lanes]:
        """Return velocity and acceleration at a position."""
        q_dot = self.solve(at, self._nu(self._functions, q, t, self._p))
        return q_dot, self.solve(at, self._gamma(self._functions, q, q_dot, t, self._p))


def has_planned_solve(module: ModuleType) -> bool:
    """Return whether a module can be run on its lanes."""
    return "solve" in getattr(module, "LANES", {})

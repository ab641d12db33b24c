"""The code of an emitted module on its lanes: each coordinate a number or an array of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from kincompile.runtime.engine.code import Code

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
    code
        A module with a planned solve.
    functions
        Its elementary functions, of floats or of arrays.
    p
        Parameters: floats, or arrays that broadcast with the lanes.
    """

    def __init__(self, code: Code, functions: Any, p: Lanes) -> None:
        assert code.lanes is not None
        own = code.lanes
        self._functions, self._p, self._m = functions, p, len(code.equations)
        self._position, self._nu, self._gamma = own.position, own.nu, own.gamma
        self._factor, self._solve = own.factor, own.solve

    def evaluate(self, q: Lanes, t: Lane) -> tuple[Lanes, Lanes]:
        """Evaluate Phi, and the entries of Phi_q that vary."""
        values = self._position(self._functions, q, t, self._p)
        return values[: self._m], values[self._m :]

    def factor(self, Phi: Lanes, entries: Lanes) -> Factored:
        """Factor Phi_q."""
        return Factored(Phi, *self._factor(self._functions, entries))

    def position(self, q: Lanes, t: Lane) -> Factored:
        """Evaluate Phi and Phi_q, and factor Phi_q."""
        values = self._position(self._functions, q, t, self._p)
        factors, determinants = self._factor(self._functions, values[self._m :])
        return Factored(values[: self._m], factors, determinants)

    def solve(self, at: Factored, right: Lanes) -> Lanes:
        """Return x of Phi_q x = right."""
        return self._solve(self._functions, at.factors, right)

    def rates(self, at: Factored, q: Lanes, t: Lane) -> tuple[Lanes, Lanes]:
        """Return velocity and acceleration at a position."""
        q_dot = self.solve(at, self._nu(self._functions, q, t, self._p))
        return q_dot, self.solve(at, self._gamma(self._functions, q, q_dot, t, self._p))

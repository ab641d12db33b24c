"""Integrators of libraries, step by step: SciPy's DOP853, Radau and BDF, and CVODE of SUNDIALS.

None is our own. After a step of a one-step method the state is led back to its constraints, and the
next step goes on from there. BDF and CVODE keep a history of states that must not be touched: their
states are led back where they are given out. Implicit methods get the derivatives of the rates.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.criteria import TINY
from kincompile.errors import InputError, package_of_extra

if TYPE_CHECKING:
    from collections.abc import Callable

    from kincompile.runtime.engine.code import Array

    Rate = Callable[[float, Array], Array]
    """The rate of a state at a time, or its derivatives by the state."""

METHODS = ("DOP853", "Radau", "BDF", "CVODE")
"""Integrators: explicit of order 8, implicit of order 5, and multistep for stiff systems."""

HISTORY = ("BDF", "CVODE")
"""Those that keep a history of states."""

FAILED = "the step that its tolerances ask for has become too small for floating point"


class Stepper(ABC):
    """An integrator that goes from step to step."""

    problem = ""  # why it can go no further; "" as long as it can
    # t, y: time and state after the last step
    t: float
    y: Array
    length: float  # how long the next step is meant to be

    @abstractmethod
    def step(self, longest: float) -> None:
        """Take a step, no longer than this and not beyond the last time."""

    @abstractmethod
    def between(self) -> Callable[[float], Array]:
        """Return the states within the last step."""

    def put(self, y: Array) -> None:
        """Go on from another state, where there is no history."""
        del y


def stepper(
    method: str,
    rates: tuple[Rate, Rate],
    t: tuple[float, float],
    y: Array,
    tolerance: tuple[float, Array],
    max_step: float,
    first: float | None = None,
) -> Stepper:
    """Return an integrator, one of `METHODS`, at its first state.

    The rates are that of a state at a time, and the derivatives of it by the state; `t` are the
    first and last time; the tolerance is relative, and absolute for each number; `first` is the
    length of the first step, where it is known.
    """
    if method not in METHODS:
        raise InputError(f"method is {method!r}: give one of {', '.join(METHODS)}.")
    make: type[_OneStep | _Multistep] = _Multistep if method == "CVODE" else _OneStep
    return make(method, rates, t, y, tolerance, max_step, first)


class _OneStep(Stepper):
    """A solver of SciPy."""

    def __init__(
        self, method: str, rates: tuple[Rate, Rate], t: tuple[float, float], y: Array,
        tolerance: tuple[float, Array], max_step: float, first: float | None,
    ) -> None:  # fmt: skip
        from scipy import integrate

        rtol, atol = tolerance
        self._rate, jacobian = rates
        self._has_history, self._longest = method in HISTORY, max_step
        given = {} if method == "DOP853" else {"jac": jacobian}
        solver = getattr(integrate, method)
        self._solver: Any = solver(
            self._rate, t[0], y, t[1], rtol=rtol, atol=atol, max_step=max_step,
            first_step=first, **given,
        )  # fmt: skip
        self._read()

    def _read(self) -> None:
        self.t, self.y = float(self._solver.t), np.asarray(self._solver.y)
        self.length = float(min(self._solver.h_abs, self._longest))

    def step(self, longest: float) -> None:
        self._solver.max_step = min(self._longest, longest)
        try:
            self._solver.step()
        except ValueError:  # numbers that are not finite, in the linear algebra of Radau
            self.problem = FAILED
        if self._solver.status == "failed":
            self.problem = FAILED
        self._read()

    def put(self, y: Array) -> None:
        if not self._has_history:
            self.y = self._solver.y = y
            self._solver.f = self._rate(self._solver.t, y)

    def between(self) -> Callable[[float], Array]:
        """Return SciPy's own interpolation."""
        found: Callable[[float], Array] = self._solver.dense_output()
        return found


class _Multistep(Stepper):
    """CVODE of SUNDIALS, from scikit-sundae."""

    def __init__(
        self, method: str, rates: tuple[Rate, Rate], t: tuple[float, float], y: Array,
        tolerance: tuple[float, Array], max_step: float, first: float | None,
    ) -> None:  # fmt: skip
        del method
        rate, jacobian = rates
        with package_of_extra("scikit-sundae", "stiff"):
            from sksundae.cvode import CVODE

        def into(t: float, y: Array, found: Array) -> int:
            found[:] = rate(t, y)
            return int(not np.isfinite(found).all())  # 1: try a smaller step

        def slopes_into(t: float, y: Array, _rate: Array, found: Array) -> int:
            found[:] = jacobian(t, y)
            return int(not np.isfinite(found).all())

        rtol, atol = (part * STRICTER / np.sqrt(y.size) for part in tolerance)
        longest = max_step if np.isfinite(max_step) else 0.0
        finite = np.where(np.isfinite(atol), atol, 1 / TINY)  # one that never counts
        self.t, self.y, self._end = t[0], y, t[1]
        self.length = first or 0.0
        self._solver = CVODE(
            into, rtol=float(rtol), atol=finite,
            first_step=math.copysign(self.length, t[1] - t[0]), max_step=longest,
            max_num_steps=MOST_STEPS, jacfn=slopes_into,
        )  # fmt: skip
        self._solver.init_step(self.t, y)

    def step(self, longest: float) -> None:
        left = self._end - self.t
        stop = self._end if longest >= abs(left) else self.t + math.copysign(longest, left)
        found = self._solver.step(self._end, "onestep", tstop=stop)
        if not found.success:
            self.problem = f"CVODE says: {found.message}"
            return
        self.length = abs(float(found.t) - self.t)
        self.t, self.y = float(found.t), np.asarray(found.y)

    def between(self) -> Callable[[float], Array]:
        """Return the interpolation of its history, which a request for a time behind it gives."""
        return lambda t: np.asarray(self._solver.step(t).y)


MOST_STEPS = 100_000
"""Steps of a method between two of the times that were asked for, after which it is given up."""

STRICTER = 0.1
"""Part of the tolerance that CVODE gets: Newton's method ends there at a tenth of it, with a matrix
up to 50 steps old, in SciPy's BDF at its root. And since it judges the mean of all numbers, with
those that never count, one of them may be wrong by the root of their number."""

r"""Derivatives of Phi that need Phi alone, for the verification of an emitted module.

A direction is :math:`(\dot q, \dot t)`; along the line :math:`q + s\,\dot q,\ t + s\,\dot t` the
first derivative of Phi by s is a column of Phi_q or Phi_t, and the second, with zero acceleration,
is -gamma.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kincompile.criteria import COMPLEX_STEP

Array = NDArray[Any]

SHORT = 1e-5
"""Step of the differences of complex steps. These are exact to rounding, so that it may be small;
it hardly ever reaches over a knot of a spline or from one piece to the next."""

DIFFERENCE = 1e-3
"""Step of the differences that judge where Phi cannot be continued to complex numbers."""

ROUGH = 1e-3
"""Change with half the step up to which differences mean anything."""

SAME = 1e-9
"""Largest difference between Phi of complex and of real numbers, relative to its terms."""

Function = Callable[[Array, Any], Array]
"""Phi of q (..., n) and t."""

Derivative = Callable[[Function, Array, float, Array, float], Array]
"""Gives derivatives of Phi, (k, m), at q (n,) and t along the directions (k, n) and of time."""


def value(Phi: Function, q: Array, t: float, along: Array, time: float) -> Array:
    """Return Phi itself, shape (1, m), whatever the direction."""
    return np.asarray(Phi(q, t)[np.newaxis])


def complex_step(Phi: Function, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the derivative of Phi along directions.

    It is NaN where Phi of complex numbers is not Phi: a compiled module takes the former from
    NumPy.
    """
    moved = Phi(q + 1j * COMPLEX_STEP * along, t + 1j * COMPLEX_STEP * time if time else t)
    here = Phi(q, t)
    is_same = np.abs(np.real(moved) - here) <= SAME * np.maximum(1.0, np.abs(here))
    return np.where(is_same, np.imag(moved) / COMPLEX_STEP, np.nan)


def second_complex_step(Phi: Function, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the second derivative of Phi along one line, by differences of complex steps."""

    def rate(h: float) -> Array:
        return complex_step(Phi, q + h * along[0], t + h * time, along, time)

    return slope(rate, SHORT)


def differences(Phi: Function, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the derivative of Phi along directions, by real numbers alone; NaN beside a pole."""

    def at(s: float) -> Array:
        return np.asarray(Phi(q + s * along, t + s * time))

    return _smooth(Phi(q, t), lambda h: slope(at, h))


def second_differences(Phi: Function, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the second derivative of Phi along lines, by real numbers alone; NaN beside a pole."""
    here = Phi(q, t)

    def at(s: float) -> Array:
        return np.asarray(Phi(q + s * along, t + s * time))

    def curvature(h: float) -> Array:
        near, far = (at(s) + at(-s) - 2 * here for s in (h, 2 * h))
        return np.asarray((16 * near - far) / (12 * h**2))

    return _smooth(here, curvature)


def _smooth(here: Array, difference: Callable[[float], Array]) -> Array:
    """Return differences of fourth order; NaN where half the step gives something else."""
    found, closer = difference(DIFFERENCE), difference(DIFFERENCE / 2)
    size = 1 + np.abs(here) + np.abs(closer)
    return np.where(np.abs(found - closer) <= ROUGH * size, found, np.nan)


def slope(function: Callable[[float], Array], h: float) -> Array:
    """Return the derivative of a function at 0 by central differences of fourth order."""
    near, far = function(h) - function(-h), function(2 * h) - function(-2 * h)
    return np.asarray((8 * near - far) / (12 * h))


@dataclass(frozen=True, slots=True)
class Oracle:
    """An independent way to a quantity: its name, its function and the error that it allows."""

    name: str
    derivative: Derivative
    limit: float


ORACLES: Mapping[str, tuple[Oracle, Oracle]] = {
    "Phi": (Oracle("Phi alone", value, 1e-12), Oracle("Phi alone", value, 1e-12)),
    "Phi_q": (
        Oracle("complex step", complex_step, 1e-8),
        Oracle("differences", differences, 1e-5),
    ),
    "nu": (
        Oracle("complex step in t", complex_step, 1e-8),
        Oracle("differences in t", differences, 1e-5),
    ),
    "gamma": (
        Oracle("line oracle, complex step", second_complex_step, 1e-8),
        Oracle("line oracle, differences", second_differences, 1e-5),
    ),
}
"""Two oracles for each quantity, the more exact one first. The second one uses real numbers alone,
and is right wherever Phi is smooth: the first is believed where the two agree."""

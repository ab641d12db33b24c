r"""Derivatives of Phi that need Phi alone, for the verification of an emitted module.

A direction is :math:`(\dot q, \dot t)`; along the line :math:`q + s\,\dot q,\ t + s\,\dot t` the
first derivative of Phi by s is a column of Phi_q or Phi_t, and the second, where no acceleration
acts, is minus gamma.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from types import ModuleType

Array = NDArray[Any]

STEP = 1e-30
"""Complex step: no difference is taken, so that it may be as small as one likes."""

SHORT = 1e-5
"""Step of the differences of complex steps: these are exact to rounding, so that it may be small,
and hardly ever reaches over a knot of a spline or from one piece to the next."""

DIFFERENCE = 1e-3
"""Step of the differences that judge where Phi cannot be continued to complex numbers."""

ROUGH = 1e-3
"""Change with half the step up to which differences mean anything."""

SAME = 1e-9
"""Part of an equation's terms by which Phi of complex numbers may be away from Phi of real ones."""


def value(module: ModuleType, q: Array, t: float, along: Array, time: float) -> Array:
    """Return Phi itself, shape (1, m), whatever the direction."""
    return np.asarray(module.Phi(q, t)[np.newaxis])


def complex_step(module: ModuleType, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the derivative of Phi along directions.

    Parameters
    ----------
    module
        An emitted module.
    q : ndarray, shape (n,)
        Where.
    t
        When.
    along : ndarray, shape (k, n)
        Directions of q.
    time
        Direction of t, of all of them.

    Returns
    -------
    ndarray, shape (k, m)
        NaN where Phi of complex numbers is not Phi: a compiled module takes the former from NumPy.
    """
    moved = module.Phi(q + 1j * STEP * along, t + 1j * STEP * time if time else t)
    here = module.Phi(q, t)
    is_same = np.abs(np.real(moved) - here) <= SAME * np.maximum(1.0, np.abs(here))
    return np.where(is_same, np.imag(moved) / STEP, np.nan)


def stepped(module: ModuleType, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the second derivative of Phi along a line, by differences of complex steps.

    Arguments are those of `complex_step`, with one direction: shape (1, n).
    """
    return _slope(
        lambda h: complex_step(module, q + h * along[0], t + h * time, along, time), SHORT
    )


def differences(module: ModuleType, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the derivative of Phi along directions, of real numbers alone; NaN beside a pole."""
    return _smooth(
        module.Phi(q, t),
        lambda h: _slope(lambda s: np.asarray(module.Phi(q + s * along, t + s * time)), h),
    )


def second_differences(module: ModuleType, q: Array, t: float, along: Array, time: float) -> Array:
    """Return the second derivative of Phi along lines, likewise."""
    here = module.Phi(q, t)

    def curvature(h: float) -> Array:
        near, far = (
            module.Phi(q + s * along, t + s * time)
            + module.Phi(q - s * along, t - s * time)
            - 2 * here
            for s in (h, 2 * h)
        )
        return np.asarray((16 * near - far) / (12 * h**2))

    return _smooth(here, curvature)


def _smooth(here: Array, difference: Callable[[float], Array]) -> Array:
    """Return differences of fourth order; NaN where half the step gives something else."""
    found, closer = difference(DIFFERENCE), difference(DIFFERENCE / 2)
    size = 1 + np.abs(here) + np.abs(closer)
    return np.where(np.abs(found - closer) <= ROUGH * size, found, np.nan)


def _slope(function: Callable[[float], Array], h: float) -> Array:
    """Return the derivative of a function at 0 by central differences of fourth order."""
    near, far = function(h) - function(-h), function(2 * h) - function(-2 * h)
    return np.asarray((8 * near - far) / (12 * h))


Oracle = tuple[str, "Callable[[ModuleType, Array, float, Array, float], Array]", float]
"""What it is called, what it gives, and the error up to which numbers agree with it."""

ORACLES: Mapping[str, tuple[Oracle, Oracle]] = {
    "Phi": (("Phi alone", value, 1e-12), ("Phi alone", value, 1e-12)),
    "Phi_q": (("complex step", complex_step, 1e-8), ("differences", differences, 1e-5)),
    "nu": (("complex step in t", complex_step, 1e-8), ("differences in t", differences, 1e-5)),
    "gamma": (
        ("line oracle, complex step", stepped, 1e-8),
        ("line oracle, differences", second_differences, 1e-5),
    ),
}
"""For each quantity two oracles, the more exact one first. The second one uses real numbers alone,
and is right wherever Phi is smooth: the first is believed where it agrees with it."""

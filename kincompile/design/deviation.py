r"""How a dimension deviates from its nominal value, and the vector of a joint's clearance.

A clearance is a massless link whose length is the radial clearance c, on body i of the joint: the
pin lies at the edge of its hole, in any direction alike. Its two components have the variance
:math:`c^2/2` each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats

from kincompile.errors import InputError
from kincompile.model.declared import declared_fields
from kincompile.model.tasks import Limits
from kincompile.names import listed, shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

MOST = 1e100
"""The largest deviation: its square is a number still."""

_LAWS: Any = stats
"""SciPy makes its distributions at run time, where a type checker does not see them."""


@dataclass(frozen=True)
class Deviation(Limits):
    """Limits of a dimension's deviation from its nominal value, and how it is distributed.

    Attributes
    ----------
    low, high : float
        Limit deviations, in the unit of the parameter, as -0.0001 and 0.0002.
    distribution : str or scipy.stats distribution
        ``"normal"``, whose limits are `sigmas` standard deviations away; ``"truncated"``, the same
        cut off at the limits; ``"uniform"``; or a frozen distribution of `scipy.stats`, of the
        deviation.
    sigmas : float
        Standard deviations from the middle to a limit.

    Raises
    ------
    InputError
        If the limits are not finite or in the wrong order, there is no such distribution, or it has
        no mean between them and no finite variance.
    """

    def __post_init__(self) -> None:
        """Check the values."""
        problems = []
        if not all(_is_number(value) for value in (self.low, self.high, self.sigmas)):
            problems.append(
                f"a deviation goes from {self.low!r} to {self.high!r} at {self.sigmas!r} standard "
                "deviations: give finite numbers"
            )
        elif not self.low < self.high:
            problems.append(
                f"a deviation goes from {self.low:g} to {self.high:g}: give the lower limit first, "
                "as Deviation(-1e-4, 2e-4), or one positive number for both"
            )
        elif not self.sigmas > 0:
            problems.append(f"sigmas is {self.sigmas:g}: give a positive number, such as 3")
        is_frozen = hasattr(self.distribution, "ppf") and hasattr(self.distribution, "std")
        known = declared_fields(Limits)["distribution"].schema["enum"]
        if not is_frozen and self.distribution not in known:
            problems.append(
                f"there is no distribution {shown(self.distribution)}; there are "
                f"{listed(known)}, and frozen ones of scipy.stats"
            )
        if not problems and not self._has_moments():
            problems.append(
                f"the distribution between {self.low:g} and {self.high:g} has no mean between "
                f"them, or no standard deviation up to {MOST:g}: give another"
            )
        if problems:
            raise InputError(problems)

    def _has_moments(self) -> bool:
        """Say whether mean and standard deviation are what may be computed with."""
        with np.errstate(all="ignore"):
            mean, sigma = self.law.mean(), self.law.std()
        return bool(self.low <= mean <= self.high and sigma <= MOST)

    @property
    def law(self) -> Any:
        """The distribution of the deviation, one of `scipy.stats`."""
        middle, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        if self.distribution == "normal":
            return _LAWS.norm(middle, half / self.sigmas)
        if self.distribution == "uniform":
            return _LAWS.uniform(self.low, self.high - self.low)
        if self.distribution == "truncated":
            return _LAWS.truncnorm(-self.sigmas, self.sigmas, middle, half / self.sigmas)
        return self.distribution

    def deviations(self, parts: Array) -> Array:
        """Return deviations, (1, B), from numbers of the unit interval, (B,)."""
        found: Array = np.asarray(self.law.ppf(parts), dtype=np.float64)[np.newaxis]
        return found

    def effects(self, gradients: Array) -> tuple[Array, Array]:
        """Return the least and greatest effect, for gradients of shape (..., 1)."""
        ends = gradients[..., 0] * self.low, gradients[..., 0] * self.high
        return np.minimum(*ends), np.maximum(*ends)

    def moments(self) -> tuple[Array, Array]:
        """Return the mean (1,) and the covariance (1, 1) of the deviation."""
        return np.array([float(self.law.mean())]), np.array([[float(self.law.var())]])


@dataclass(frozen=True, slots=True)
class Clearance:
    """The vector of a joint's clearance, of length `radius`, in any direction."""

    radius: float

    def deviations(self, parts: Array) -> Array:
        """Return deviations, (2, B), from numbers of the unit interval, (B,)."""
        angle = 2 * math.pi * parts
        return self.radius * np.stack((np.cos(angle), np.sin(angle)))

    def effects(self, gradients: Array) -> tuple[Array, Array]:
        """Return the least and greatest effect, for gradients of shape (..., 2)."""
        most = self.radius * np.hypot(gradients[..., 0], gradients[..., 1])
        return -most, most

    def moments(self) -> tuple[Array, Array]:
        """Return the mean (2,) and the covariance (2, 2) of the vector."""
        return np.zeros(2), self.radius**2 / 2 * np.eye(2)


def _is_number(value: object) -> bool:
    """Say whether a value is a finite number."""
    is_real = isinstance(value, int | float | np.integer | np.floating)
    return is_real and not isinstance(value, bool) and abs(float(str(value))) <= MOST


def read_deviation(given: Any, where: str) -> Deviation:
    """Return a deviation that is given as one, as a number for both limits, or as two limits.

    `where` begins the message of an error.
    """
    if isinstance(given, Deviation):
        return given
    try:
        match given:
            case [low, high]:
                return Deviation(low, high)
            case _ if _is_number(given) and given > 0:
                return Deviation(-given, given)
    except InputError as error:
        raise InputError([f"{where}: {problem}" for problem in error.problems]) from None
    raise InputError(
        f"{where} is {given!r}: give a positive number for plus and minus, or (low, high)"
    )


def read_clearance(given: Any, where: str) -> Clearance:
    """Return the clearance of a joint that is given as a number; `where` begins a message."""
    if _is_number(given) and given > 0:
        return Clearance(float(given))
    raise InputError(f"{where} is {given!r}: give the radial clearance, a positive length")

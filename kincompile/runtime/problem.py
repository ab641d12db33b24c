"""The equations at given parameters, and the scales by which their numbers are judged.

Nothing here compares a length with an angle, or a residual with a fixed number: a coordinate is
compared with its own scale (the size of the mechanism, or a radian), an equation with the sum of
what its terms contribute at those scales. So a mechanism in millimetres and the same one in metres
get the same verdicts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from kincompile.criteria import NO_SIZE, ROUNDING, STEEP, WILD, probe_of, size_of
from kincompile.runtime.staged import StagedSolver, is_staged

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

    Vector: TypeAlias = NDArray[np.float64]


@dataclass(slots=True, eq=False)
class Point:
    """A position at which the equations were evaluated.

    Attributes
    ----------
    q : ndarray, shape (n,)
        The position.
    Phi : ndarray, shape (m,)
        The constraint vector there; m > n where redundant equations agree.
    Phi_q : ndarray, shape (m, n)
        The Jacobian there.
    residual : float
        Euclidean norm of Phi.
    """

    q: Vector
    Phi: Vector
    Phi_q: Vector
    residual: float


@dataclass(slots=True, eq=False)
class Problem:
    """An emitted module with its parameters set.

    Attributes
    ----------
    module
        The emitted module.
    p : ndarray, shape (k,)
        Parameters.
    angular : ndarray of bool, shape (n,)
        Which coordinates are angles.
    reference : ndarray, shape (n,)
        Scale of each coordinate: 1 rad for angles, the size of the mechanism for the others.
    probe : ndarray, shape (m,)
        Numbers of size 1/2 to 1 and either sign without a pattern, which no null vector of a
        mechanism can be expected to be orthogonal to.
    magnitude : ndarray, shape (m,)
        What the terms of each equation contribute at a generic position.
    staged : StagedSolver or None
        The planned solve of a large mechanism.
    """

    module: ModuleType
    p: Vector
    angular: NDArray[np.bool_]
    reference: Vector
    probe: Vector
    magnitude: Vector
    staged: StagedSolver | None = None

    def at(self, q: Vector, t: float) -> Point | None:
        """Evaluate the equations, or give None where they have no finite value."""
        try:
            Phi, Phi_q = self.module.position(q, t, self.p)
        except (ArithmeticError, ValueError):  # of math.sqrt, log, or 1/0; NaN or infinity in q
            return None
        residual = norm(Phi)
        return Point(q, Phi, Phi_q, residual) if math.isfinite(residual) else None

    def scale(self, q: Vector) -> Vector:
        """Give the scale of each coordinate at a position."""
        return np.clip(np.abs(q), self.reference, WILD * self.reference)

    def spread(self, q: Vector) -> Vector:
        """Give the distance that is large for each coordinate: 1 rad, or the size of the mechanism.

        A mechanism that starts folded at the origin shows its size only later.
        """
        size = size_of(self.angular, q)
        return np.where(self.angular, 1.0, np.maximum(self.reference, size))

    def is_small(self, correction: Vector, q: Vector, tolerance: float) -> bool:
        """Say whether a correction that led to q is small, or all that floating point can give."""
        allowed = tolerance * self.reference + ROUNDING * np.abs(q)
        return bool(np.all(np.abs(correction) <= allowed))

    def terms(self, point: Point, scale: Vector) -> Vector:
        """Give what the terms of each equation contribute at the scales of the coordinates.

        At a dead point a whole row of Phi_q may vanish. What it contributes elsewhere keeps the
        equation from being measured by nothing.
        """
        limit = np.where(self.magnitude > 0, STEEP * self.magnitude, np.inf)
        return np.maximum(self.magnitude, np.minimum(np.abs(point.Phi_q) @ scale, limit))

    def holds(self, point: Point, tolerance: float) -> bool:
        """Say whether every equation holds, relative to what its terms contribute.

        The reference is the scale here: a wild iterate must not become a solution because its own
        coordinates are huge.
        """
        terms = self.terms(point, self.reference)
        return bool(np.all(np.abs(point.Phi) <= tolerance * terms))

    def holds_to_rounding(self, point: Point) -> bool:
        """Say whether every equation holds as well as floating point permits."""
        terms = self.terms(point, self.scale(point.q))
        return bool(np.all(np.abs(point.Phi) <= ROUNDING * terms))


def problem(
    module: ModuleType, p: Vector, q: Vector, t: float, guess: Vector | None = None
) -> Problem:
    """Set a module's parameters; a position and the guess give the size of the mechanism.

    The guess is the module's where none is given.
    """
    angular = np.array([module.UNITS[name] == "rad" for name in module.COORDINATES], dtype=bool)
    m: int = module.N_EQUATIONS
    equations = Problem(module, p, angular, np.ones(q.size), probe_of(m), np.zeros(m))
    equations.staged = StagedSolver(module) if is_staged(module) else None
    size = size_of(angular, q, module.GUESS if guess is None else guess)
    if not size and (point := equations.at(q, t)) is not None:
        size = _size_in_equations(point, angular)
    if size > NO_SIZE:
        equations.reference = np.where(angular, 1.0, size)
    generic = equations.at(q + equations.reference * equations.probe[: q.size], t)
    if generic is not None and np.isfinite(generic.Phi_q).all():
        equations.magnitude = equations.terms(generic, equations.reference)
    return equations


def _size_in_equations(point: Point, angular: NDArray[np.bool_]) -> float:
    """Give the largest length that the equations show where all coordinates are zero.

    Divided by the derivative with respect to a length, a residual is a distance still to go and
    the derivative with respect to an angle is a lever arm.
    """
    slopes = np.abs(point.Phi_q)
    along = np.max(slopes, axis=1, where=~angular, initial=0.0)
    shown = np.abs(point.Phi) + np.max(slopes, axis=1, where=angular, initial=0.0)
    rows = along > 0
    size = float(np.max(shown[rows] / along[rows], initial=0.0))
    return size if math.isfinite(size) else 0.0


def norm(vector: Vector) -> float:
    """Give the Euclidean norm; three times as fast as `numpy.linalg.norm`."""
    return math.sqrt(vector @ vector)

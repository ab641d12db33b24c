"""What spatial constraint types share."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from kincompile.model import arguments as argument
from kincompile.model.arguments import BodyLike, PlaceLike
from kincompile.model.constraint import Constraint, constraint_type
from kincompile.model.expressions import as_sympy, evaluate
from kincompile.space.bodies import SPATIAL
from kincompile.space.triads import with_triads

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.model.bodies import Body
    from kincompile.model.constraint import Numbers
    from kincompile.model.expressions import Scalar


class SpatialConstraint(Constraint):
    """A constraint of bodies in space; every type is a subclass."""

    bodies = SPATIAL
    right_angle: ClassVar[tuple[str, ...]] = ()
    """The directions of bodies i and j that it keeps at a right angle by one equation."""
    alike: ClassVar[tuple[str, ...]] = ()
    """The directions of bodies i and j of which both point along the shafts the same way."""

    @staticmethod
    def problem(numbers: Numbers) -> str | None:
        """Return the problem of a cross that lies along its axis."""
        for index in "ij":
            with suppress(KeyError):
                h, f = (np.array(numbers(f"{key}_{index}"), dtype=float) for key in "hf")
                if np.linalg.norm(np.cross(h, f)) <= PARALLEL * np.linalg.norm(h) * np.linalg.norm(
                    f
                ):
                    return (
                        f"cross_{index} lies along axis_{index}; give a direction at a right angle "
                        "to the axis, from which angles are counted"
                    )
        return None

    @classmethod
    def misplaced(
        cls,
        bodies: Sequence[Body],
        points: Mapping[str, tuple[Scalar, ...]],
        defaults: Mapping[str, float],
    ) -> str | None:
        """Return why its directions cannot be at a right angle, or alike, from the guess."""
        for symbols, are_wrong, text in (
            (cls.right_angle, _are_parallel, PARALLEL_AT_THE_GUESS),
            (cls.alike, _are_opposed, OPPOSED_AT_THE_GUESS),
        ):
            pairs = zip(bodies, symbols, strict=False)
            turned = (_turned(body, points[symbol], defaults) for body, symbol in pairs)
            found = [item for item in turned if item is not None]
            if len(found) == 2 and are_wrong(*found):
                names = [key for key, item in cls.arguments().items() if item.symbol in symbols]
                return text.format(*names, *(body.name for body in bodies))
        return None

    @staticmethod
    def completed(
        points: Mapping[str, tuple[Scalar, ...]], defaults: Mapping[str, float]
    ) -> Mapping[str, tuple[Scalar, ...]]:
        """Return the points and directions with the triads about the axes."""
        return with_triads(points, defaults)


PARALLEL = 1e-6
"""Sine of the angle between directions that count as parallel."""

PARALLEL_AT_THE_GUESS = (
    "{0} and {1} are parallel at the guess of {2} and {3}, and the joint keeps them at a right "
    "angle, which has no slope there; give directions that cross, or other orientations of the "
    "bodies"
)
OPPOSED_AT_THE_GUESS = (
    "{0} and {1} point against each other at the guess of {2} and {3}, and both should point along "
    "the shafts the same way; turn one of them round, or give other orientations of the bodies"
)


def _are_parallel(u: NDArray[np.float64], v: NDArray[np.float64]) -> bool:
    sizes = np.linalg.norm(u) * np.linalg.norm(v)
    return bool(np.linalg.norm(np.cross(u, v)) <= PARALLEL * sizes)


def _are_opposed(u: NDArray[np.float64], v: NDArray[np.float64]) -> bool:
    return bool(u @ v < 0)


def _turned(
    body: Body, vector: tuple[Scalar, ...], defaults: Mapping[str, float]
) -> NDArray[np.float64] | None:
    """Return a body-fixed vector in the ground's frame at the guess; None where it is no number."""
    guess = (evaluate(as_sympy(item), dict(defaults)) for item in (*body.guess[3:], *vector))
    numbers = np.array(tuple(guess), dtype=float)
    if numbers.shape != (7,) or not np.isfinite(numbers).all():
        return None
    e0, e, v = numbers[0], numbers[1:4], numbers[4:]
    return np.asarray((e0**2 - e @ e) * v + 2 * e * (e @ v) + 2 * e0 * np.cross(e, v))


@constraint_type
class SpatialPoints(SpatialConstraint):
    """A constraint of a point on body i and a point on body j; the types are its subclasses."""

    i: BodyLike = argument.body("i")
    point_i: PlaceLike = argument.point("s_i", on="i")
    j: BodyLike = argument.body("j")
    point_j: PlaceLike = argument.point("s_j", on="j")

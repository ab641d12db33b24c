"""Guesses of orientations: Euler parameters from what a person knows, with what is wrong.

They stand in emitted text. So their digits come from plain floats and mpmath: those of a library of
linear algebra, and of cosines, depend on the processor.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from kincompile.model.expressions import CALCULATED, as_sympy

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from kincompile.model.expressions import Scalars

IDENTITY = (1, 0, 0, 0)

ROUNDED = 1e-3
"""Up to which a length of p differs from one, or a matrix from a rotation, by rounded decimals."""


EXACT = 1e-15
"""Up to which a length is one: parameters that were written to a file are read as they were."""


class OrientationError(ValueError):
    """What was given is no orientation."""


def euler_parameters(
    given: Any, axis: Any, angle: Any, axes: Mapping[str, Any]
) -> tuple[Scalars, str]:
    """Return Euler parameters of length one, and a remark where what was given is not exactly one.

    Parameters
    ----------
    given
        Four Euler parameters, a rotation matrix (3, 3), a `scipy.spatial.transform.Rotation`, or
        None.
    axis, angle
        A direction, and the angle about it, which may be an expression of parameters; or None.
    axes
        Directions of two of the body's axes, by ``"x"``, ``"y"`` and ``"z"``.

    Raises
    ------
    OrientationError
        If that is no orientation, or more than one.
    """
    forms = (given is not None, axis is not None or angle is not None, bool(axes))
    if sum(forms) > 1:
        raise OrientationError(
            "it is given twice; give orientation, or axis and angle, or two of x, y and z"
        )
    if axes:
        return _of_matrix(_from_axes(axes))
    if forms[1]:
        return _about(axis, angle), ""
    return _given(given) if forms[0] else (IDENTITY, "")


def _given(given: Any) -> tuple[Scalars, str]:
    if hasattr(given, "as_matrix"):  # of SciPy, which need not be loaded
        given = given.as_matrix()
    elif np.shape(given) == (4,) and any(isinstance(item, sympy.Expr) for item in given):
        return tuple(given), ""
    numbers = _numbers(given, "orientation")
    if numbers.shape == (4,):
        exact = abs(math.hypot(*numbers.tolist()) - 1) < EXACT
        return (tuple(given), "") if exact else _normalised(numbers)
    if numbers.shape == (3, 3):
        return _of_matrix(numbers)
    raise OrientationError(
        f"orientation has the shape {numbers.shape}; give four Euler parameters (e0, e1, e2, e3), "
        "a rotation matrix of three rows, or a scipy Rotation"
    )


def _normalised(p: NDArray[np.float64]) -> tuple[Scalars, str]:
    if not p.any():
        raise OrientationError(
            "the Euler parameters have length zero, which is no orientation; (1, 0, 0, 0) is that "
            "of the ground"
        )
    length = math.hypot(*p.tolist())
    remark = f"the Euler parameters have length {length:.6g}, and were divided by it"
    return tuple(_unit(p).tolist()), remark if abs(length - 1) > ROUNDED else ""


def _about(axis: Any, angle: Any) -> Scalars:
    """Return cos(angle/2) and sin(angle/2) times the unit axis."""
    if axis is None or angle is None:
        raise OrientationError("give both axis and angle, as axis=(0, 0, 1), angle=0.5")
    u = _direction(axis, "axis")
    try:
        half = as_sympy(angle) / 2
    except (TypeError, ValueError, sympy.SympifyError):
        raise OrientationError(f"the angle {angle!r} is not a number") from None
    if half.is_number:
        c, s = (float(function(_finite(half))) for function in (CALCULATED.cos, CALCULATED.sin))
        return c, *(s * item for item in u.tolist())
    return sympy.cos(half), *(sympy.sin(half) * item for item in u.tolist())


def _from_axes(given: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the matrix of two axes: the first is taken as it is, the second beside it."""
    if len(given) != 2:
        raise OrientationError(
            f"{len(given)} of the body's axes {'is' if len(given) == 1 else 'are'} given; give two "
            "of x, y and z, the third follows"
        )
    (first, second), known = given, {key: _direction(item, key) for key, item in given.items()}
    u = known[first]
    beside = known[second] - sum((known[second] * u).tolist()) * u
    if math.hypot(*beside.tolist()) < ROUNDED:
        raise OrientationError(f"its axes {first} and {second} are parallel; give two that cross")
    columns = {first: u, second: _unit(beside)}
    order = "xyz"
    third = next(key for key in order if key not in columns)
    before, after = (order[(order.index(third) + k) % 3] for k in (1, 2))
    columns[third] = np.cross(columns[before], columns[after])
    return np.column_stack([columns[key] for key in order])


def _of_matrix(matrix: NDArray[np.float64]) -> tuple[Scalars, str]:
    off = float(np.abs(matrix.T @ matrix - np.eye(3)).max())
    if off > ROUNDED:
        raise OrientationError(
            f"the matrix is no rotation: its columns miss lengths of one and right angles by "
            f"{off:.3g}; the columns are the body's unit axes in the ground's frame"
        )
    determinant = float(np.linalg.det(matrix))
    if determinant < 0:
        raise OrientationError(
            f"the matrix is left-handed, its determinant is {determinant:.3g}; turn one axis "
            "round, so that z = x cross y"
        )
    # 4 p p^T by the entries of A; its column with the largest diagonal is p without loss of digits.
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    products = np.array(
        [
            [1 + a + e + i, h - f, c - g, d - b],
            [h - f, 1 + a - e - i, d + b, c + g],
            [c - g, d + b, 1 - a + e - i, h + f],
            [d - b, c + g, h + f, 1 - a - e + i],
        ]
    )
    p = _unit(products[int(np.argmax(np.diag(products)))])
    return tuple(((-p if p[0] < 0 else p) + 0.0).tolist()), ""  # no -0.0


def _finite(half: sympy.Expr) -> float:
    """Return a half angle as a number."""
    if not (half.is_real and half.is_finite):
        raise OrientationError(f"the angle {2 * half} is not a finite number")
    return float(half)


def _direction(given: Any, what: str) -> NDArray[np.float64]:
    numbers = _numbers(given, what)
    if numbers.shape != (3,) or not numbers.any():
        raise OrientationError(f"{what} is {given!r}; give three numbers, not all zero")
    return _unit(numbers)


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a vector at length one; the squares of its numbers may be out of range."""
    vector = vector / np.abs(vector).max()
    return np.asarray(vector / math.hypot(*vector.tolist()))


def _numbers(given: Any, what: str) -> NDArray[np.float64]:
    try:
        numbers = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.array(np.nan)
    if not np.isfinite(numbers).all():
        raise OrientationError(f"{what} is {given!r}, which is not made of finite numbers")
    return numbers

"""Dyads that lead a body through poses: Burmester's points, for two to five poses.

A point w of the body and a fixed point m belong to a dyad if |P_j + R_j w - m| is the same in all
poses. With a = w conj(m) that is linear in a, w and m for each pose after the first: four poses
more leave two unknowns, and Re a and Im a, which are products, are two conics in them.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.polynomial import Polynomial

from kincompile.criteria import SLIGHT, STILL
from kincompile.errors import InputError
from kincompile.names import listed

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

Item = TypeVar("Item")

TURNS = 360
"""Turns of the link at which the curves of four poses are sampled, without others."""

FARTHEST = 1e6
"""Sizes of the task beyond which a point is at infinity: the dyad is a slider."""

GENERIC = ((0.8, 0.6), (-0.6, 0.8))
"""A turn of two unknowns, so that no symmetry of the poses makes a coefficient zero."""

CORRECTIONS = 8
"""Steps of Newton's method that polish a root."""


class Found(tuple[Item, ...]):
    """What was found, a tuple; `reason` says why it is empty, or has less than there could be."""

    reason: str

    def __new__(cls, items: Iterable[Item], reason: str = "") -> Found[Item]:
        """Return the items with a reason."""
        found = super().__new__(cls, items)
        found.reason = reason
        return found


@dataclass(frozen=True, slots=True)
class Dyad:
    """A link from a fixed pivot to a pivot of the body, the coupler.

    Attributes
    ----------
    centre : tuple of float
        The fixed pivot (x, y): the centre point.
    circle : tuple of float
        The moving pivot (xi, eta) in the frame of the body: the circle point.
    length : float
        From one to the other.
    turn : float
        Angle by which the link turns from the first to the second pose, in (-pi, pi] [rad].
    """

    centre: tuple[float, float]
    circle: tuple[float, float]
    length: float
    turn: float


def dyads(
    poses: ArrayLike,
    *,
    circle: ArrayLike | None = None,
    centre: ArrayLike | None = None,
    turn: ArrayLike | None = None,
) -> Found[Dyad]:
    """Find the dyads that lead a body through two to five poses.

    Five poses have up to four dyads. Those of four poses are a curve, the centre points and circle
    points of Burmester, with the turn of the link from the first to the second pose as a parameter
    and up to two dyads for each. For three poses one of the two pivots is free, for two also the
    turn.

    Parameters
    ----------
    poses : array_like, shape (K, 3)
        Where the body is to be: (x, y, angle [rad]) of its frame, in order, K from 2 to 5.
    circle, centre : array_like, shape (2,) or (n, 2), optional
        Of two and three poses, points of the body, or fixed points, one of the two, to each of
        which the other is found.
    turn : array_like, shape () or (n,), optional
        Of two and four poses, turns of the link [rad], other than zero. For four poses 359 between
        0 and 2 pi by default.

    Returns
    -------
    Found of Dyad
        A tuple. Of four poses the first half of the curve by rising turn, then the second. `reason`
        says why there is none, or fewer than were asked for.

    Raises
    ------
    InputError
        If poses are equal or not of this shape, or what is given does not go with their number.

    Notes
    -----
    L. Burmester, Lehrbuch der Kinematik, 1888; J. M. McCarthy and G. S. Soh, Geometric Design of
    Linkages, 2011, chapter 5.
    """
    p, r, size, first = _relative(poses)
    given = {"circle": circle, "centre": centre, "turn": turn}
    _check_given(len(p) + 1, {name for name, item in given.items() if item is not None})
    if turn is None:
        turn = 2 * math.pi * np.arange(1, TURNS) / TURNS
    b = np.exp(1j * np.atleast_1d(read(turn, "turn")))
    if np.any(np.abs(b - 1) < SLIGHT):
        raise InputError("A turn of the link is zero, or whole turns. Leave it out.")
    origin, angle = complex(first[0], first[1]), cmath.exp(1j * first[2])
    with np.errstate(all="ignore"):
        if len(p) == 4:
            w, m = _five(p, r)
        elif len(p) == 3:
            w, m = _four(p, r, b)
        elif circle is not None:
            w = _places(circle, "circle") * angle / size
            ends = (p + r * w[:, None]).T
            m = ((b - r) * w - p) / (b - 1) if len(p) == 1 else _centre([w, *ends])
        else:
            m = (_places(centre, "centre") - origin) / size
            back = ((m[:, None] - p) / r).T
            w = (m * (b - 1) + p) / (b - r) if len(p) == 1 else _centre([m, *back])
    w, m = np.broadcast_arrays(w, m)
    far = np.maximum(np.abs(w), np.abs(m))
    kept = np.isfinite(far) & (far < FARTHEST) & (np.abs(w - m) > SLIGHT)
    pairs = zip(w[kept].tolist(), m[kept].tolist(), strict=True)
    made = [_dyad(*pair, complex(p[0]), complex(r[0]), size, first) for pair in pairs]
    wanted = 4 if len(p) == 4 else kept.size
    return Found(made, "" if len(made) == wanted else _reason(len(p) + 1, wanted - len(made)))


def read(given: ArrayLike, what: str) -> Array:
    """Return finite numbers; expressions such as 30*kc.deg are numbers."""
    try:
        found = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{what}: these are not numbers of one shape. Give an array.") from None
    if not np.isfinite(found).all():
        raise InputError(f"{what}: a number is not finite. Give finite ones.")
    return found


def _relative(poses: ArrayLike) -> tuple[Complex, Complex, float, Array]:
    """Return places and turns from the first pose, in sizes of the task; the size; that pose."""
    given = read(poses, "poses")
    if given.ndim != 2 or given.shape[1] != 3 or not 2 <= len(given) <= 5:
        raise InputError(
            f"The poses have the shape {given.shape}. Give two to five of (x, y, angle)."
        )
    places, turns = given[:, 0] + 1j * given[:, 1], np.exp(1j * given[:, 2])
    size = float(np.abs(places - places[0]).max()) or 1.0
    for i, j in combinations(range(len(given)), 2):
        if abs(places[i] - places[j]) < SLIGHT * size and abs(turns[i] - turns[j]) < SLIGHT:
            raise InputError(f"Poses {i + 1} and {j + 1} are equal. Leave one of them out.")
    return (places[1:] - places[0]) / size, turns[1:] / turns[0], size, given[0]


def _check_given(count: int, given: set[str]) -> None:
    """Refuse what does not go with the number of poses."""
    by_count: dict[int, list[set[str]]] = {
        2: [{"circle", "turn"}, {"centre", "turn"}], 3: [{"circle"}, {"centre"}],
        4: [set(), {"turn"}], 5: [set()],
    }  # fmt: skip
    allowed = by_count[count]
    if given not in allowed:
        words = " or ".join(listed(sorted(item)).replace(",", " and") for item in allowed if item)
        remedy = f"Give {words}" if words else "Leave that out"
        optional = ", or nothing" if count == 4 else ""
        wrong = f"do not go with: {listed(sorted(given))}" if given else "leave a choice open"
        raise InputError(f"{count} poses {wrong}. {remedy}{optional}.")


def _places(given: Any, what: str) -> Complex:
    """Return points as complex numbers (n,)."""
    found = np.atleast_2d(read(given, what))
    if found.ndim != 2 or found.shape[1] != 2:
        raise InputError(f"{what} has the shape {found.shape}. Give points (x, y).")
    return np.asarray(found[:, 0] + 1j * found[:, 1])


def _five(p: Complex, r: Complex) -> tuple[Complex, Complex]:
    """Return the moving and the fixed pivots of five poses: where two conics meet."""
    c, d = np.conj(p) * r, r - 1
    rows = np.column_stack((-d.real, d.imag, c.real, -c.imag, -p.real, -p.imag))
    left, sizes, right = np.linalg.svd(rows)
    if sizes[-1] < STILL * sizes[0]:
        raise InputError(
            "Some of the poses follow from the others, as for translations: a whole curve of dyads "
            "has them, or none. Take poses out, or move one."
        )
    base = right[:4].T @ ((left.T @ (-(np.abs(p) ** 2) / 2)) / sizes)
    basis = np.vstack((base, np.array(GENERIC) @ right[4:]))
    a, w, m = (basis[:, [0, 2, 4]] + 1j * basis[:, [1, 3, 5]]).T
    conic = np.outer(w, np.conj(m)) - np.outer(a, (1, 0, 0))
    found: list[Complex] = []
    for s, t in _meet(conic.real, conic.imag):
        point = _polished(p, r, w @ (1, s, t), m @ (1, s, t))
        if point is not None and all(abs(point - other).max() > SLIGHT for other in found):
            found.append(point)
    pairs = np.array(sorted(found, key=lambda x: x[0].real)).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


def _meet(first: Array, second: Array) -> list[tuple[float, float]]:
    """Return where h^T A h = 0 of two matrices, h = (1, s, t), from the resultant, a quartic."""
    (f0, f1, f2), (g0, g1, g2) = (
        (
            Polynomial([A[0, 0], A[0, 1] + A[1, 0], A[1, 1]]),
            Polynomial([A[0, 2] + A[2, 0], A[1, 2] + A[2, 1]]),
            A[2, 2],
        )
        for A in (first, second)
    )
    u, v = f2 * g0 - g2 * f0, f2 * g1 - g2 * f1
    roots = (u * u - v * (f1 * g0 - g1 * f0)).roots()
    real = [float(root.real) for root in roots if abs(root.imag) < SLIGHT * (1 + abs(root))]
    return [(s, -float(u(s) / v(s))) for s in real]


def _polished(p: Complex, r: Complex, w: complex, m: complex) -> Complex | None:
    """Return the pivots after Newton's method on the lengths of the link; None at no dyad."""

    def off(x: Array) -> Array:
        w, m = complex(x[0], x[1]), complex(x[2], x[3])
        return np.asarray(np.abs(p + r * w - m) ** 2 - abs(w - m) ** 2)

    x = np.array([w.real, w.imag, m.real, m.imag])
    for _ in range(CORRECTIONS):
        # What is quadratic has its differences over any step as derivatives.
        by = np.column_stack([off(x + step) - off(x - step) for step in np.eye(4)]) / 2
        x = x - np.linalg.lstsq(by, off(x))[0]
    is_dyad = np.abs(off(x)).max() < STILL * (1 + np.linalg.norm(x)) ** 2
    return np.array([complex(x[0], x[1]), complex(x[2], x[3])]) if is_dyad else None


def _four(p: Complex, r: Complex, b: Complex) -> tuple[Complex, Complex]:
    """Return the pivots of four poses by the turn of the link: where two circles meet."""
    d, c = (b - r[0]) / (b - 1), -p[0] / (b - 1)  # m = d w + c
    k, q, n = (  # of k |w|^2 + 2 Re(q w) + n = 0
        np.array([np.abs(r[j] - d) ** 2 - np.abs(1 - d) ** 2 for j in (1, 2)]),
        np.array([np.conj(p[j] - c) * (r[j] - d) + np.conj(c) * (1 - d) for j in (1, 2)]),
        np.array([np.abs(p[j] - c) ** 2 - np.abs(c) ** 2 for j in (1, 2)]),
    )
    line, off = q[0] * k[1] - q[1] * k[0], n[0] * k[1] - n[1] * k[0]
    nearest, along = -off / 2 * np.conj(line) / np.abs(line) ** 2, 1j * np.conj(line) / np.abs(line)
    which = (np.abs(k[1]) > np.abs(k[0])).astype(int)
    k, q, n = (np.choose(which, item) for item in (k, q, n))
    half = k * (np.conj(nearest) * along).real + (q * along).real
    rest = k * np.abs(nearest) ** 2 + 2 * (q * nearest).real + n
    root = np.sqrt(half**2 - k * rest)
    w = np.concatenate([nearest + along * (sign * root - half) / k for sign in (1, -1)])
    return w, np.tile(d, 2) * w + np.tile(c, 2)


def _centre(places: Sequence[Complex]) -> Complex:
    """Return the centre of the circle through three places; infinite on a line."""
    first, *others = places
    b, c = (other - first for other in others)
    across = 2 * (np.conj(b) * c).imag
    return np.asarray(first + 1j * (b * np.abs(c) ** 2 - c * np.abs(b) ** 2) / across)


def _dyad(w: complex, m: complex, p: complex, r: complex, size: float, first: Array) -> Dyad:
    """Return a dyad in the task's own size and frame."""
    at = complex(m * size + complex(first[0], first[1]))
    moving = complex(w * size * cmath.exp(-1j * first[2]))
    turn = cmath.phase((p + r * w - m) / (w - m))
    return Dyad((at.real, at.imag), (moving.real, moving.imag), abs(w - m) * size, turn)


def _reason(count: int, missing: int) -> str:
    """Say why there are fewer dyads than could be."""
    if count == 5:
        return f"{missing} of the four dyads of five poses are complex, or have a pivot at infinity"
    if count == 4:
        return f"there are no two real dyads at {(missing + 1) // 2} of the turns"
    return f"{missing} dyads have a pivot at infinity, as where the places lie on a line"

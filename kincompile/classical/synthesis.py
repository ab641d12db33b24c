"""Exact synthesis: dimensions from precision points, `kc.synthesis`.

kc.synthesis.dyads(poses)                       Burmester's dyads of two to five poses
kc.synthesis.four_bars(poses)                   all four-bars of five poses, those that work first
kc.synthesis.path(points, angles)               a point goes through five points at crank angles
kc.synthesis.freudenstein(inputs, outputs)      function generation, three to five precision points
kc.synthesis.chebyshev_spacing(1, 4, 3)         where precision points lie best
kc.synthesis.cognates(four_bar)                 the two others with the same coupler curve
"""

from __future__ import annotations

import math
from itertools import compress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import Polynomial

from kincompile.classical.dyads import GENERIC, Dyad, Found, dyads, read
from kincompile.classical.four_bars import (
    FourBar,
    Passage,
    by_merit,
    cognates,
    four_bar,
    four_bars,
)
from kincompile.criteria import SLIGHT
from kincompile.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = [
    "Dyad", "Found", "FourBar", "Passage", "chebyshev_spacing", "cognates", "dyads", "four_bar",
    "four_bars", "freudenstein", "path",
]  # fmt: skip


MOST_POINTS = 1000
"""Precision points."""

SAME = 1e-3
"""Part of the length of a link up to which two pivots are one that was found twice."""


def chebyshev_spacing(start: float, end: float, count: int) -> Array:
    """Return precision points at the zeros of Chebyshev's polynomial, (count,), from start to end.

    An error that is a polynomial of degree `count` is least between them.
    """
    ends = read([start, end], "start and end")
    if count != int(count) or not 1 <= count <= MOST_POINTS:
        raise InputError(f"count is {count!r}. Give how many precision points, such as 3.")
    start, end = ends.tolist()
    angles = np.pi * (2 * np.arange(count) + 1) / (2 * count)
    return np.asarray((start + end) / 2 - (end - start) / 2 * np.cos(angles))


def path(points: ArrayLike, angles: ArrayLike) -> Found[FourBar]:
    """Find the four-bars whose coupler point goes through five points at given crank angles.

    A point in the frame of the turning crank belongs to a dyad from the crank's pivot: so `dyads`
    gives the cranks, and from their five poses of the coupler the rockers.

    Parameters
    ----------
    points : array_like, shape (5, 2)
        Where P is to be (x, y), in order.
    angles : array_like, shape (5,)
        Angles of the crank there [rad]; what counts is by how much it turns.

    Returns
    -------
    Found of FourBar
        Up to twelve, those that work first.

    Raises
    ------
    InputError
        If there are not five points and angles, or two are equal.
    """
    given, turns = read(points, "points"), read(angles, "angles")
    if given.shape != (5, 2) or turns.shape != (5,):
        raise InputError(
            f"Points and angles have the shapes {given.shape} and {turns.shape}. Give five of both."
        )
    cranks = dyads(np.column_stack((given, turns)))
    P, found, reasons = given[:, 0] + 1j * given[:, 1], [], [cranks.reason]  # noqa: N806
    for crank in cranks:
        arm = complex(*crank.circle)
        A = complex(*crank.centre) - arm * np.exp(1j * turns)  # noqa: N806
        if abs(arm) < SLIGHT * crank.length:
            continue
        poses = np.column_stack((given, np.angle(P - A)))
        own = Dyad(crank.centre, (-crank.length, 0.0), abs(arm), 0.0)
        both = dyads(poses)  # among them the crank itself
        reasons.append(both.reason)
        away = [math.dist(item.circle, own.circle) > SAME * crank.length for item in both]
        found += [four_bar(own, item, poses) for item in compress(both, away)]
    return by_merit(found, next((item for item in reasons if item), ""))


def freudenstein(inputs: ArrayLike, outputs: ArrayLike, *, ground: float = 1.0) -> Found[FourBar]:
    """Find the four-bars whose rocker has given angles at given angles of the crank.

    K1 cos phi - K2 cos theta + K3 = cos(theta - phi), with K1 = d/a, K2 = d/c and
    K3 = (a^2 - b^2 + c^2 + d^2)/(2 a c) of crank a, coupler b, rocker c and ground d. Three
    precision points give the three numbers, linearly. With four the angle from which outputs are
    counted is found as well, with five also that of inputs.

    Parameters
    ----------
    inputs, outputs : array_like, shape (K,)
        Angles of crank and rocker [rad] from the ground O C, K from 3 to 5; of outputs with four
        points, and of both with five, only differences count.
    ground
        Length of the ground O C.

    Returns
    -------
    Found of FourBar
        Those that work first: one at most of three points, two of four, three of five. P is in A.

    Raises
    ------
    InputError
        If there are not three to five of both, or two pairs are equal.

    Notes
    -----
    F. Freudenstein, Approximate synthesis of four-bar linkages, Trans. ASME 77, 1955.
    """
    theta, phi = read(inputs, "inputs"), read(outputs, "outputs")
    if theta.ndim != 1 or theta.shape != phi.shape or not 3 <= theta.size <= 5:
        raise InputError(
            f"Inputs and outputs have the shapes {theta.shape} and {phi.shape}. Give three to five "
            "of both."
        )
    found, ground = [], float(read(ground, "ground"))
    for k1, k2, z in _constants(theta, phi):
        # Of angles theta + theta_0 and phi + phi_0: k1 = K1 e^(i phi_0), k2 = K2 e^(i theta_0).
        phi_0 = k1 / abs(k1)
        theta_0 = z / abs(z) * phi_0
        A = ground * abs(z / k1) * theta_0 * np.exp(1j * theta)  # noqa: N806
        c = ground * abs(z) / (k2 / theta_0).real
        B = ground + c * phi_0 * np.exp(1j * phi)  # noqa: N806
        poses = np.column_stack((A.real, A.imag, np.angle(B - A)))
        crank = Dyad((0.0, 0.0), (0.0, 0.0), float(abs(A[0])), 0.0)
        rocker = Dyad((ground, 0.0), (float(abs(B - A)[0]), 0.0), abs(c), 0.0)
        found.append(four_bar(crank, rocker, poses))
    return by_merit(found, "" if found else "Freudenstein's equation has no real solution")


def _constants(theta: Array, phi: Array) -> list[Complex]:
    """Return k1, k2 and z of Re(k1 e^(i phi) - k2 e^(i theta) - z e^(i(theta - phi))) + K3 = 0.

    z = e^(i (theta_0 - phi_0)) up to a factor. The equations leave a line of solutions, and that
    k1 z conj(k2) is real is a polynomial along it.
    """
    count, between = theta.size, theta - phi
    rows = np.column_stack((
        np.cos(phi), -np.cos(theta), -np.cos(between), np.ones_like(theta),
        -np.sin(phi), np.sin(between),
        np.sin(theta),
    ))[:, : {3: 4, 4: 6, 5: 7}[count]]  # fmt: skip
    _, sizes, right = np.linalg.svd(rows)
    if sizes[-1] < SLIGHT**2 * sizes[0]:
        raise InputError(
            "Some precision points follow from the others, as where two are equal or outputs are "
            "the inputs. Give others."
        )
    free = np.zeros((7, len(right) - count))
    free[: len(right)] = right[count:].T
    if count == 3:
        ends = [free[:, 0]]
    else:
        line = free @ np.array(GENERIC)
        k1, k2, z = _triple([Polynomial(row) for row in line])
        real = (k1[0] * z[1] + k1[1] * z[0]) * k2[0] - (k1[0] * z[0] - k1[1] * z[1]) * k2[1]
        roots = real.roots()
        ends = [
            line @ (1, root.real) for root in roots if abs(root.imag) < SLIGHT * (1 + abs(root))
        ]
    triples = [np.array(_triple(end)) @ (1, 1j) for end in ends]
    return [x for x in triples if np.abs(x).min() > SLIGHT * np.abs(x).max()]


def _triple(x: Any) -> tuple[tuple[Any, Any], ...]:
    """Return real and imaginary parts of k1, k2 and z, from unknowns in the order of the rows."""
    return (x[0], x[4]), (x[1], x[6]), (x[2], x[5])

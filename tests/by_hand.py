"""Phi of every constraint type by hand, with 100 digits, from the formulas of the documentation.

In the plane it is written in complex numbers (r = x + iy, A s = s e^(i phi), R = i), in space in
arrays of three numbers. Of `w` each takes what the joint's symbols are called: r_i, A_i, s_i, C.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from mpmath.ctx_mp import MPContext

mp = MPContext()
mp.dps = 100

# ---- in the plane --------------------------------------------------------------------------------


def inner(u: Any, v: Any) -> Any:
    """Return u^T v of two vectors in the complex plane."""
    return u.real * v.real + u.imag * v.imag


def gap(w: Any) -> Any:
    """Return d, from the point on body i to that on body j."""
    return w.r_j + w.A_j * w.s_j - w.r_i - w.A_i * w.s_i


def gear(w: Any) -> list[Any]:
    rolled = w.R_i * (w.phi_i + w.theta_i) + w.R_j * (w.phi_j + w.theta_j) - w.R_j * mp.pi
    return [inner(gap(w), 1j * mp.expj(rolled / (w.R_i + w.R_j)))]


def rack(w: Any) -> list[Any]:
    v = w.A_i * (w.s_Q - w.s_P)
    angle = w.phi_i + w.theta_i - w.phi_j - w.theta_j + 3 * mp.pi / 2
    from_q = w.r_j + w.A_j * w.s_j - w.r_i - w.A_i * w.s_Q
    from_p = w.r_j + w.A_j * w.s_j - w.r_i - w.A_i * w.s_P
    return [
        inner(from_q, v) - abs(v) * w.R_j * angle,
        inner(from_p, 1j * v) - abs(v) * w.R_j,
    ]


def pair(vector: Any) -> list[Any]:
    return [vector.real, vector.imag]


BY_HAND: dict[str, Callable[[Any], list[Any]]] = {
    "AbsoluteX": lambda w: [(w.r_i + w.A_i * w.s_i).real - w.C],
    "AbsoluteY": lambda w: [(w.r_i + w.A_i * w.s_i).imag - w.C],
    "AbsoluteAngle": lambda w: [w.phi_i - w.C],
    "AbsoluteDistance": lambda w: [abs(w.r_i + w.A_i * w.s_i - w.c) ** 2 - w.C**2],
    "RelativeX": lambda w: [gap(w).real - w.C],
    "RelativeY": lambda w: [gap(w).imag - w.C],
    "RelativeAngle": lambda w: [w.phi_j - w.phi_i - w.C],
    "Distance": lambda w: [abs(gap(w)) ** 2 - w.C**2],
    "Revolute": lambda w: pair(-gap(w)),
    "Translational": lambda w: [
        inner(1j * w.A_i * w.v_i, gap(w)),
        inner(1j * w.A_i * w.v_i, w.A_j * w.v_j),
    ],
    "RevoluteTranslational": lambda w: [inner(1j * w.A_i * w.v_i, gap(w)) / abs(w.v_i) - w.C],
    "TranslationalDistance": lambda w: [inner(w.A_i * w.v_i, gap(w)) / abs(w.v_i) - w.C],
    "Gear": gear,
    "RackAndPinion": rack,
    "CamFollower": lambda w: [
        *pair(w.r_i + w.A_i * (w.s_i + w.a_i) - w.r_j - w.A_j * (w.s_j + w.a_j)),
        inner(1j * w.A_i * w.g_i, w.A_j * w.g_j),
    ],
    "CamFlatFollower": lambda w: [
        inner(1j * w.A_j * w.v_j, w.r_j + w.A_j * w.s_j - w.r_i - w.A_i * (w.s_i + w.a_i)),
        inner(1j * w.A_j * w.v_j, w.A_i * w.g_i),
    ],
    "PointFollower": lambda w: pair(w.r_i + w.A_i * w.s_i - w.r_j - w.A_j * (w.s_j + w.a_j)),
    "Equation": lambda w: [
        w.r_i.real * mp.sin(w.phi_j) - w.C * w.r_j.imag**2,
        mp.exp(w.phi_i * w.r_j.real / 4) - w.C,
    ],
}


# ---- in space ------------------------------------------------------------------------------------


def vector(numbers: Sequence[Any]) -> Any:
    """Return numbers as a vector."""
    return np.array([mp.mpf(item) for item in numbers], dtype=object)


def product(u: Any, v: Any) -> Any:
    """Return u^T v."""
    return sum(a * b for a, b in zip(u, v, strict=True))


def cross(u: Any, v: Any) -> Any:
    """Return u x v."""
    return np.array([u[k - 2] * v[k - 1] - u[k - 1] * v[k - 2] for k in range(3)], dtype=object)


def rotated(p: Any, v: Any) -> Any:
    """Return A v of Euler parameters: (e0^2 - e^T e) v + 2 e e^T v + 2 e0 e x v.

    Arrays stand first: a number of mpmath looks at all of an array that follows it.
    """
    e0, e = p[0], p[1:]
    return v * (e0**2 - product(e, e)) + e * (2 * product(e, v)) + cross(e, v) * (2 * e0)


def unit(v: Any) -> Any:
    """Return a vector of length one."""
    return v / mp.sqrt(product(v, v))


def triad(axis: Any, beside: Any) -> tuple[Any, Any, Any]:
    """Return f, g, h about an axis, f beside it: what of it lies along the axis is left out."""
    h = unit(axis)
    f = unit(beside - h * product(beside, h))
    return f, cross(h, f), h


def way(w: Any) -> Any:
    """Return d, from the point on body i to that on body j."""
    return w.r_j + w.A_j(w.s_j) - w.r_i - w.A_i(w.s_i)


def rows(w: Any, left: str, right: str) -> list[Any]:
    """Return products of directions of both bodies; "d" is the way between the points."""
    found: dict[str, Any] = {"d": way(w)} if right == "d" else {}
    for index in "ij":
        for letter in "fgh":
            if hasattr(w, f"{letter}_{index}"):
                turned = getattr(w, f"A_{index}")(getattr(w, f"{letter}_{index}"))
                found[f"{letter}_{index}"] = turned
    return [product(found[name], found[right]) for name in left.split()]


def parallel(w: Any) -> list[Any]:
    return rows(w, "f_i g_i", "h_j")


def turn_from(w: Any, reference: Any) -> Any:
    """Return theta less a reference, of all angles theta the one nearest to it."""
    (c, s), whole = rows(w, "f_i g_i", "f_j"), 2 * mp.pi
    away = mp.atan2(s, c) - reference
    return away - whole * mp.nint(away / whole)


def on(w: Any) -> list[Any]:
    return rows(w, "f_i g_i", "d")


IN_SPACE: dict[str, Callable[[Any], list[Any]]] = {
    "Normalization": lambda w: [product(w.p_i, w.p_i) - 1],
    "Dot1": lambda w: [product(w.A_i(w.a_i), w.A_j(w.a_j)) - w.C],
    "Dot2": lambda w: [product(w.A_i(w.a_i), way(w)) - w.C],
    "AbsoluteX": lambda w: [(w.r_i + w.A_i(w.s_i))[0] - w.C],
    "AbsoluteY": lambda w: [(w.r_i + w.A_i(w.s_i))[1] - w.C],
    "AbsoluteZ": lambda w: [(w.r_i + w.A_i(w.s_i))[2] - w.C],
    "AbsoluteDistance": lambda w: [
        product(*[w.r_i + w.A_i(w.s_i) - w.c] * 2) - w.C**2
    ],
    "AbsoluteOrientation": lambda w: [*(w.p_i[1:] - w.u * w.C)],
    "RelativeX": lambda w: [way(w)[0] - w.C],
    "RelativeY": lambda w: [way(w)[1] - w.C],
    "RelativeZ": lambda w: [way(w)[2] - w.C],
    "Distance": lambda w: [product(way(w), way(w)) - w.C**2],
    "Parallel": parallel,
    "PointOnLine": on,
    "InPlane": lambda w: rows(w, "h_i", "d"),
    "Planar": lambda w: [*parallel(w), *rows(w, "h_i", "d")],
    "Spherical": lambda w: [*way(w)],
    "Revolute": lambda w: [*way(w), *parallel(w)],
    "Cylindrical": lambda w: [*parallel(w), *on(w)],
    "Translational": lambda w: [*parallel(w), *on(w), *rows(w, "f_i", "f_j")],
    "Universal": lambda w: [*way(w), *rows(w, "h_i", "h_j")],
    "ConstantVelocity": lambda w: [
        *way(w), rows(w, "g_i", "f_j")[0] - rows(w, "f_i", "g_j")[0]
    ],
    "Screw": lambda w: [
        *parallel(w), *on(w), turn_from(w, w.alpha_i),
        rows(w, "h_i", "d")[0] - w.pitch * w.alpha_i / (2 * mp.pi),
    ],
    "Fixed": lambda w: [*way(w), *parallel(w), *rows(w, "f_i", "g_j")],
    "RevoluteCylindrical": lambda w: [*rows(w, "h_i", "h_j"), *rows(w, "f_j g_j", "d")],
    "RevoluteSpherical": lambda w: [*rows(w, "h_i", "d"), product(way(w), way(w)) - w.C**2],
    "RelativeTranslation": lambda w: [rows(w, "h_i", "d")[0] - w.C],
    "RelativeRotation": lambda w: [turn_from(w, w.C)],
    "JointAngle": lambda w: [turn_from(w, w.alpha_i)],
}  # fmt: skip

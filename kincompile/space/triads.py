"""The triads (f, g, h) of unit vectors that joints have about their axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import sympy

from kincompile.model.expressions import as_sympy, evaluate

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.model.expressions import Scalar


def with_triads(
    points: Mapping[str, tuple[Scalar, ...]], defaults: Mapping[str, float]
) -> dict[str, tuple[Scalar, ...]]:
    """Return points and directions with the unit triads (f, g, h) about their axes h.

    Without a given f the triad begins with the coordinate axis that is farthest from h at the
    default parameters. It is right-handed: g = h x f.
    """
    found = {key: value for key, value in points.items() if key[0] not in "fh"}
    for key, given in points.items():
        if key[0] == "h":
            h = _unit([as_sympy(value) for value in given])
            cross = [as_sympy(value) for value in points.get(f"f{key[1:]}", ())]
            f = _unit(_beside(cross or _farthest(h, defaults), h))
            g = [h[k - 2] * f[k - 1] - h[k - 1] * f[k - 2] for k in range(3)]
            found |= {f"f{key[1:]}": _numbers(f), f"g{key[1:]}": _numbers(g), key: _numbers(h)}
    return found


def _unit(vector: Sequence[sympy.Expr]) -> list[sympy.Expr]:
    size = sympy.sqrt(sympy.Add(*(item**2 for item in vector)))
    return [item / size for item in vector]


def _beside(vector: Sequence[sympy.Expr], h: Sequence[sympy.Expr]) -> list[sympy.Expr]:
    """Return the part of a vector at a right angle to the unit vector h."""
    along = sympy.Add(*(a * b for a, b in zip(vector, h, strict=True)))
    return [a - along * b for a, b in zip(vector, h, strict=True)]


def _farthest(h: Sequence[sympy.Expr], defaults: Mapping[str, float]) -> list[sympy.Expr]:
    """Return the coordinate axis with the smallest component of h."""
    sizes = [abs(evaluate(item, dict(defaults)) or 0.0) for item in h]
    nearest = sizes.index(min(sizes))
    return [sympy.Integer(k == nearest) for k in range(3)]


def _numbers(vector: Sequence[sympy.Expr]) -> tuple[Scalar, ...]:
    return tuple(float(item) if item.is_number else item for item in vector)

"""The triads (f, g, h) of unit vectors that joints have about their axes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.model.expressions import as_sympy, evaluate

ROUNDING = 1e-15
"""Components of unit vectors up to which rounding leaves what is zero."""

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
            cross = _plain(points.get(f"f{key[1:]}", ()))
            h = _unit(_plain(given))
            f = _unit(_beside(cross or _farthest(h, defaults), h))
            g = [h[k - 2] * f[k - 1] - h[k - 1] * f[k - 2] for k in range(3)]
            found |= {f"f{key[1:]}": _tidy(f), f"g{key[1:]}": _tidy(g), key: _tidy(h)}
    return found


def _plain(vector: Sequence[Scalar]) -> list[Any]:
    """Return floats if all components are numbers, else expressions."""
    items = [as_sympy(value) for value in vector]
    # Nested roots of exact numbers take SymPy seconds.
    return [float(item) for item in items] if all(item.is_number for item in items) else items


def _unit(vector: Sequence[Any]) -> list[Any]:
    square = sum(item * item for item in vector)
    if not isinstance(square, float):
        size = sympy.sqrt(square)
    else:  # squares may be beyond the range of numbers where lengths are not
        size = math.sqrt(square) if 0 < square < math.inf else math.hypot(*vector)
    return [item / size for item in vector]


def _beside(vector: Sequence[Any], h: Sequence[Any]) -> list[Any]:
    """Return the part of a vector at a right angle to the unit vector h."""
    along = sum(a * b for a, b in zip(vector, h, strict=True))
    return [a - along * b for a, b in zip(vector, h, strict=True)]


def _farthest(h: Sequence[Any], defaults: Mapping[str, float]) -> list[Any]:
    sizes = [abs(evaluate(item, dict(defaults)) or 0.0) for item in h]
    nearest = sizes.index(min(sizes))
    return [int(k == nearest) for k in range(3)]


def _tidy(vector: Sequence[Any]) -> tuple[Scalar, ...]:
    """Return floats where there are numbers, and zero for what is left by rounding."""
    items = [float(item) if as_sympy(item).is_number else item for item in vector]
    return tuple(0.0 if isinstance(x, float) and abs(x) < ROUNDING else x for x in items)

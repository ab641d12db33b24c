"""The arguments of spatial constraint types: points, directions, and triads about an axis."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Any

import sympy

from kincompile.model.arguments import Argument, Kind
from kincompile.model.expressions import as_sympy, evaluate

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.expressions import Scalar

_PLACE = "(xi, eta, zeta) in the frame of {on}"


def _declared(kind: Kind, symbol: str, text: str, on: str, unit: str = "") -> Any:
    return field(metadata={"argument": Argument(kind, symbol, text, on, unit)})


def point(symbol: str, on: str) -> Any:
    """Declare a point in the frame of a body, or of the ground."""
    where = "(x, y, z) of the ground" if on == "ground" else _PLACE
    return _declared(Kind.POINT, symbol, f"Point {where} [length].", on, "length")


def direction(symbol: str, on: str) -> Any:
    """Declare a vector in the frame of a body, whose length counts."""
    return _declared(Kind.AXIS, symbol, f"Vector {_PLACE}, not zero.", on)


def axis(symbol: str, on: str) -> Any:
    """Declare the axis h of a joint in the frame of a body."""
    return _declared(Kind.AXIS, symbol, f"Axis {_PLACE}, of any length but zero.", on)


def cross(symbol: str, on: str) -> Any:
    """Declare the direction f at a right angle to the axis, from which the joint counts angles."""
    text = (
        f"Direction {_PLACE} at a right angle to the axis, of any length but zero; "
        "what is along the axis in it does not count."
    )
    return _declared(Kind.AXIS, symbol, text, on)


def with_triads(
    points: Mapping[str, tuple[Scalar, ...]], defaults: Mapping[str, float]
) -> dict[str, tuple[Scalar, ...]]:
    """Return points and directions with the unit triads (f, g, h) about their axes h.

    Without a given f the triad begins with the coordinate axis that is farthest from h at the
    default parameters. It is right-handed: g = h x f.
    """
    found: dict[str, tuple[Scalar, ...]] = {
        key: tuple(value) for key, value in points.items() if key[0] not in "fh"
    }
    for key, given in points.items():
        if key[0] == "h":
            h = _unit(sympy.Matrix([as_sympy(value) for value in given]))
            other = points.get(f"f{key[1:]}") or _farthest(h, defaults)
            cross = sympy.Matrix([as_sympy(value) for value in other])
            f = _unit(cross - h * cross.dot(h))
            found |= {f"f{key[1:]}": _numbers(f), f"g{key[1:]}": _numbers(h.cross(f))}
            found[key] = _numbers(h)
    return found


def _unit(vector: sympy.Matrix) -> sympy.Matrix:
    return vector / sympy.sqrt(vector.dot(vector))


def _farthest(h: sympy.Matrix, defaults: Mapping[str, float]) -> tuple[int, ...]:
    """Return the coordinate axis with the smallest component of h."""
    sizes = [abs(evaluate(item, defaults) or 0.0) for item in h]
    nearest = sizes.index(min(sizes))
    return tuple(int(k == nearest) for k in range(3))


def _numbers(vector: sympy.Matrix) -> tuple[Scalar, ...]:
    return tuple(float(item) if item.is_number else item for item in vector)

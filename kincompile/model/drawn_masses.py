"""Masses of links that are drawn: of a straight bar, or of a plate with joints as its corners."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

from kincompile.model.expressions import (
    NotAnExpressionError,
    Scalar,
    as_expression,
    as_sympy,
)
from kincompile.model.link_shape import FLAT, ShapeError, number
from kincompile.model.masses import plate

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from kincompile.model.scope import Point


def mass_of_link(
    places: Sequence[Point], given: Mapping[str, Any], values: dict[str, float]
) -> dict[str, Any]:
    """Return mass, inertia and centre of a link; nothing where nothing is said of its mass.

    Parameters
    ----------
    places
        Of its joints in its frame: on the line of a straight bar, or the corners of a plate.
    given
        The arguments of `Sketch.link` by name; None is what is left out.
    values
        The parameters at their defaults.

    Raises
    ------
    ShapeError
        Where too much is given, or too little.
    """
    line = sorted(places, key=lambda place: number(place[0], values))
    reach = number(line[-1][0], values) - number(line[0][0], values)
    is_bar = all(abs(number(eta, values)) <= FLAT * reach for _, eta in places)
    known = known_masses(given, values, "width" if is_bar else "thickness")
    if not known:
        return {}
    if is_bar:
        area, centre, square = _bar(line[0][0], line[-1][0], known)
    else:
        area, centre, square = _plate(places, known, values)
    mass = known.get("mass")
    if mass is None:
        # A number of kilograms by area, and no whole one: a length that it multiplies is no mass.
        mass = 1.0 * area * known["density"] * known.get("thickness", known.get("width"))
    own = {"mass": mass, "inertia": mass * square, "centre": centre}
    return own | {name: known[name] for name in own if name in known}


def known_masses(
    given: Mapping[str, Any], values: dict[str, float], section: str
) -> dict[str, Any]:
    """Return what is said of the mass of a link.

    Parameters
    ----------
    given
        The arguments by name; None is what is left out.
    values
        The parameters at their defaults.
    section
        What goes with a density: the width of a bar, the thickness of a plate.

    Raises
    ------
    ShapeError
        Where it is neither a mass nor a density with its section, or both, or no positive number.
    """
    known = {name: item for name, item in given.items() if item is not None}
    for name in known.keys() - {"inertia", "centre"}:
        try:
            known[name] = as_expression(known[name])
        except NotAnExpressionError as error:
            raise ShapeError(f"{name}: {error}; give a number, or an expression") from None
        size = number(known[name], values)
        if not size > 0:
            raise ShapeError(f"the {name} is {size:g}; give a positive one, of declared parameters")
    if known and ("mass" in known) == ("density" in known):
        raise ShapeError(f"give its mass, or its density and {section}: one of the two")
    if "density" in known and section not in known:
        raise ShapeError(f"a density needs a {section}; give {section}=...")
    return known


def _bar(start: Scalar, end: Scalar, known: Mapping[str, Any]) -> tuple[Any, Point, Any]:
    """Return area, centre and the square of the radius of gyration of a bar along the xi axis."""
    reach, width = as_sympy(end) - as_sympy(start), as_sympy(known.get("width", 0))
    return reach * width, (as_sympy(start) + reach / 2, 0), (reach**2 + width**2) / 12


def _plate(
    places: Sequence[Point], known: Mapping[str, Any], values: dict[str, float]
) -> tuple[Any, Point, Any]:
    """Return those of a plate with the joints as its corners."""
    if "width" in known:
        raise ShapeError("a width is that of a straight bar; a plate has a thickness")
    if _crosses([complex(*(number(part, values) for part in place)) for place in places]):
        raise ShapeError("its edges cross; name its joints in their order around the plate")
    area, centre, second = plate([(as_sympy(xi), as_sympy(eta)) for xi, eta in places])
    return (area if number(area, values) > 0 else -area), centre, second / area


def _crosses(corners: Sequence[complex]) -> bool:
    """Return whether two edges of a polygon cross that have no corner in common."""

    def side(a: complex, b: complex, c: complex) -> float:
        return ((b - a).conjugate() * (c - a)).imag

    edges = [*zip(corners, [*corners[1:], corners[0]], strict=True)]
    return any(
        side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0
        for (a, b), (c, d) in combinations(edges, 2)
    )

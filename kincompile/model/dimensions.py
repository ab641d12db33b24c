"""Units of masses and loads: whether those of parameters fit what they stand for.

What a unit means is known for the usual ones; nothing is said of another. Lengths are in the unit
of the mechanism, times in seconds, and one unit of mass must serve all: with metres that is the
kilogram where forces are in newtons, with millimetres the tonne.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy

from kincompile.model.expressions import as_sympy

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from kincompile.model.expressions import Scalar
    from kincompile.model.load import Load

    Values = Mapping[str, tuple[Scalar, ...]]

Dimension = tuple[int, int, int]
"""Powers of mass, length and time."""

MASS, FORCE, TORQUE = (1, 0, 0), (1, 1, -2), (1, 2, -2)
WORDS: Mapping[Dimension, str] = {
    MASS: "a mass", FORCE: "a force", TORQUE: "a torque", (1, 2, 0): "a moment of inertia",
    (1, 0, -2): "a force per length", (1, 0, -1): "a force per velocity",
    (1, 2, -1): "a torque per angular velocity", (0, 1, 0): "a length", (0, 0, 0): "an angle",
    (0, 1, -1): "a velocity", (0, 0, -1): "an angular velocity",
}  # fmt: skip

EXPECTED: Mapping[tuple[str, str], Dimension] = {
    ("Mass", "m"): MASS, **{("Mass", f"J{row}"): (1, 2, 0) for row in ("", "_1", "_2", "_3")},
    ("Torque", "F"): TORQUE, ("Torque", "f"): TORQUE, ("FollowerTorque", "f"): TORQUE,
    ("Spring", "k"): (1, 0, -2), ("Spring", "l_0"): (0, 1, 0), ("Spring", "c"): (1, 0, -1),
    ("Spring", "F"): FORCE, ("TorsionSpring", "k"): TORQUE, ("TorsionSpring", "phi_0"): (0, 0, 0),
    ("TorsionSpring", "c"): (1, 2, -1), ("TorsionSpring", "F"): TORQUE,
    ("HingeFriction", "F"): TORQUE, ("HingeFriction", "v_0"): (0, 0, -1),
    ("SliderFriction", "F"): FORCE, ("SliderFriction", "v_0"): (0, 1, -1),
    ("Force", "f"): FORCE, ("FollowerForce", "f"): FORCE,
}  # fmt: skip
"""Dimensions of attributes and values, by type and symbol."""

UNITS: Mapping[str, tuple[float, Dimension]] = {
    "m": (1.0, (0, 1, 0)), "mm": (1e-3, (0, 1, 0)), "cm": (1e-2, (0, 1, 0)),
    "in": (0.0254, (0, 1, 0)), "ft": (0.3048, (0, 1, 0)), "kg": (1.0, MASS), "g": (1e-3, MASS),
    "t": (1e3, MASS), "s": (1.0, (0, 0, 1)), "ms": (1e-3, (0, 0, 1)), "N": (1.0, FORCE),
    "kN": (1e3, FORCE), "mN": (1e-3, FORCE), "J": (1.0, TORQUE), "rad": (1.0, (0, 0, 0)),
    "Nm": (1.0, TORQUE),
}  # fmt: skip

_PART = re.compile(r"([*·/]?)\s*([A-Za-z]+)\s*(?:\^\s*(-?\d))?\s*")


@dataclass(frozen=True, slots=True)
class _Given:
    """A parameter as the value of an attribute: its name, its unit, and what that is."""

    where: str
    name: str
    unit: str
    factor: float
    dimension: Dimension
    expected: Dimension


def unit_problems(
    loads: Iterable[tuple[Load, Values]], units: Mapping[str, str], length_unit: str
) -> Iterator[str]:
    """Yield problems with the units of parameters that stand alone for attributes of loads."""
    found = [item for load, values in loads for item in _given(load, values, units)]
    length, _ = UNITS.get(length_unit, (math.nan, MASS))
    masses: dict[str, float] = {}
    for item in found:
        if item.dimension != item.expected:
            yield (
                f"{item.where}: the parameter {item.name!r} has the unit {item.unit}, and "
                f"{WORDS[item.expected]} is wanted; give another, or correct its unit"
            )
            continue
        of_mass, of_length, _ = item.dimension
        if of_mass:
            masses[f"{item.where} ({item.unit})"] = item.factor / length**of_length
        elif item.factor != 1 and not math.isclose(item.factor, length**of_length):
            yield (
                f"{item.where}: the parameter {item.name!r} has the unit {item.unit}, and the "
                f"mechanism is in {length_unit} and s; give its value in those"
            )
    first = next(iter(masses.items()), None)
    for where, mass in masses.items():
        if first is not None and not (math.isnan(mass) or math.isclose(mass, first[1])):
            yield (
                f"{where}: its unit does not go with that of {first[0]}: with lengths in "
                f"{length_unit} one has masses in {first[1]:g} kg, the other in {mass:g} kg; give "
                "all in units that belong together, as kg, m, N or t, mm, N"
            )
            return


def _given(load: Load, values: Values, units: Mapping[str, str]) -> Iterator[_Given]:
    """Yield the parameters that stand alone, or with a number, for attributes of a load."""
    kind = type(load).__name__
    for name, argument in load.arguments().items():
        expected = EXPECTED.get((kind, argument.symbol))
        for value in values.get(argument.symbol, ()):
            _, rest = as_sympy(value).as_coeff_Mul()
            if expected is None or not isinstance(rest, sympy.Symbol):
                continue
            unit = units.get(rest.name, "")
            if unit and (meant := _meaning(unit)) is not None:
                where = f"{kind} {load.name!r}, {name}"
                yield _Given(where, rest.name, unit, *meant, expected)


def _meaning(unit: str) -> tuple[float, Dimension] | None:
    """Return factor to kg, m and s and dimension of a unit, None where it is not known."""
    factor, powers, place = 1.0, [0, 0, 0], 0
    while place < len(unit):
        part = _PART.match(unit, place)
        if part is None or part[2] not in UNITS:
            return None
        power = int(part[3] or 1) * (-1 if part[1] == "/" else 1)
        of_part, dimension = UNITS[part[2]]
        factor *= of_part**power
        powers = [a + power * b for a, b in zip(powers, dimension, strict=True)]
        place = part.end()
    mass, length, time = powers
    return factor, (mass, length, time)

"""Units of masses and loads: whether those of parameters fit what they stand for.

What a unit means is known for the usual ones; nothing is said of another. Lengths and masses are in
the units of the mechanism, times in seconds, and forces in newtons. So a mass counts in the
equations by what it is in newtons: of a kilogram in a mechanism in millimetres a thousandth.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

import sympy

from kincompile.model.expressions import as_sympy
from kincompile.names import KILOGRAMS, METRES, listed

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from kincompile.model.expressions import Scalar
    from kincompile.model.load import Load

    Values = Mapping[str, tuple[Scalar, ...]]

Dimension = tuple[int, int, int]
"""Powers of mass, length and time."""

MASS, INERTIA, FORCE, TORQUE = (1, 0, 0), (1, 2, 0), (1, 1, -2), (1, 2, -2)
WORDS: Mapping[Dimension, tuple[str, str]] = {
    MASS: ("a mass", "{mass}"), FORCE: ("a force", "N"), TORQUE: ("a torque", "N*{length}"),
    INERTIA: ("a moment of inertia", "{mass}*{length}^2"),
    (1, 0, -2): ("a force per length", "N/{length}"),
    (1, 0, -1): ("a force per velocity", "N*s/{length}"),
    (1, 2, -1): ("a torque per angular velocity", "N*{length}*s"),
    (0, 1, 0): ("a length", "{length}"), (0, 0, 0): ("an angle", "rad"),
    (0, 1, -1): ("a velocity", "{length}/s"), (0, 0, -1): ("an angular velocity", "rad/s"),
}  # fmt: skip
"""What there is, and its unit in a mechanism."""

EXPECTED: Mapping[tuple[str, str], Dimension] = {
    ("Mass", "m"): MASS, **{("Mass", f"J{row}"): INERTIA for row in ("", "_1", "_2", "_3")},
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
    **{name: (factor, (0, 1, 0)) for name, factor in METRES.items()},
    **{name: (factor, MASS) for name, factor in KILOGRAMS.items()},
    "s": (1.0, (0, 0, 1)), "ms": (1e-3, (0, 0, 1)), "N": (1.0, FORCE), "kN": (1e3, FORCE),
    "mN": (1e-3, FORCE), "J": (1.0, TORQUE), "rad": (1.0, (0, 0, 0)), "Nm": (1.0, TORQUE),
}  # fmt: skip
"""Factors to kilograms, metres and seconds, and dimensions."""

INERT = frozenset(symbol for (_, symbol), x in EXPECTED.items() if x in {MASS, INERTIA})
"""Symbols of the masses and inertias of a body."""

ANGLES = {"rad": 1.0, "deg": math.pi / 180}
"""Units of angles, in radians; what stands for an angle in a load is in radians."""

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
    loads: Iterable[tuple[Load, Values]], units: Mapping[str, str], length: str, mass: str
) -> Iterator[str]:
    """Yield problems with the units of mass and of parameters that stand alone in loads."""
    if mass not in KILOGRAMS or (length not in METRES and mass != "kg"):
        known = listed(KILOGRAMS if length in METRES else METRES)
        of = "mass" if length in METRES else "length"
        yield (
            f"masses in {mass} and lengths in {length or 'no unit'} do not give newtons; the unit "
            f"of {of} can be: {known}"
        )
        return
    for item in chain.from_iterable(_given(load, values, units) for load, values in loads):
        words, template = WORDS[item.expected]
        unit = template.format(length=length, mass=mass)
        if item.dimension != item.expected:
            wrong = f"{words} is wanted; give another, or correct its unit"
        elif length in METRES and not math.isclose(item.factor, _factor(unit)):
            wrong = f"{words} is in {unit} here; give its value in that"
            wrong += ", or another mass_unit" if item.expected in {MASS, INERTIA} else ""
        else:
            continue
        yield f"{item.where}: the parameter {item.name!r} has the unit {item.unit}, and {wrong}"


def scaled(value: Scalar, factor: float, symbol: str) -> Scalar:
    """Return a mass or a moment of inertia times a factor, and what is neither as it is."""
    return as_sympy(value) * factor if symbol in INERT else value


def _given(load: Load, values: Values, units: Mapping[str, str]) -> Iterator[_Given]:
    """Yield the parameters that stand alone, or with a number, for attributes of a load."""
    kind = type(load).__name__
    for name, argument in load.arguments().items():
        expected = EXPECTED.get((kind, argument.symbol))
        for value in values.get(argument.symbol, ()):
            number, rest = as_sympy(value).as_coeff_Mul()
            # Other numbers than 2 or 1/3 may have a unit: a mass by length, times a length.
            if expected is None or not (number.is_Rational and isinstance(rest, sympy.Symbol)):
                continue
            unit = units.get(rest.name, "")
            if unit and (meant := _meaning(unit)) is not None:
                where = f"{kind} {load.name!r}, {name}"
                yield _Given(where, rest.name, unit, *meant, expected)


def _factor(unit: str) -> float:
    """Return the factor of a known unit to kg, m and s."""
    meant = _meaning(unit)
    return math.nan if meant is None else meant[0]


def base_unit(unit: str) -> tuple[float, dict[str, int]] | None:
    """Return factor to kg, m, s and rad and their powers, None of a unit that is not known."""
    plain = re.sub(r"\bdeg\b", "rad", unit)
    if (meant := _meaning(plain)) is None:
        return None
    lengths = dict(zip(("kg", "m", "s"), meant[1], strict=True))
    turns = {name: sum(x for given, x in _parts(unit) or () if given == name) for name in ANGLES}
    factor = meant[0] * math.prod(ANGLES[name] ** power for name, power in turns.items())
    return factor, {**lengths, "rad": sum(turns.values())}


def _parts(unit: str) -> list[tuple[str, int]] | None:
    """Return the units that one is a product of, with their powers; None of another text."""
    found, place = [], 0
    while place < len(unit):
        part = _PART.match(unit, place)
        if part is None:
            return None
        found.append((part[2], int(part[3] or 1) * (-1 if part[1] == "/" else 1)))
        place = part.end()
    return found


def _meaning(unit: str) -> tuple[float, Dimension] | None:
    """Return factor to kg, m and s and dimension of a unit, None where it is not known."""
    parts = _parts(unit)
    if parts is None or any(name not in UNITS for name, _ in parts):
        return None
    factor, powers = 1.0, [0, 0, 0]
    for name, power in parts:
        of_part, dimension = UNITS[name]
        factor *= of_part**power
        powers = [a + power * b for a, b in zip(powers, dimension, strict=True)]
    mass, length, time = powers
    return factor, (mass, length, time)

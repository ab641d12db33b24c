"""Names: what may be one, how coordinates and rates are called, how a message shows them."""

from __future__ import annotations

import re
from difflib import get_close_matches
from itertools import islice
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

RESERVED = frozenset({"t", "pi", "alpha", "deg"})
"""Names with a meaning of their own in every expression."""

SYMBOLS = frozenset({"a parameter", "a coordinate"})
"""Kinds of names that occur in expressions."""

COLUMNS = frozenset({"t", "status", "residual"})
"""Columns that every motion has besides its own, in tables and files."""

LONGEST = 60
"""Characters of a value that a message shows."""

_KINDS: dict[type, str] = {dict: "a table", bool: "a truth value", type(None): "null"}
LARGEST_SEED = 2**32 - 1
"""Largest seed of random numbers that every generator takes."""

MOST_CHARACTERS = 100
"""Length of a name: files are called by it, and an operating system has a limit."""

ROLES = ("double-crank", "crank-rocker", "double-rocker", "rocker-crank")
"""Types of Grashof linkages, with ground, crank, coupler or rocker as the shortest link."""

TRIPLE = "triple-rocker"
"""The type of a four-bar of which no link turns wholly."""

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_UNIT = re.compile(r"(?!.*\*/)[\w°%·*/^.()+ -]*")


def title_of(name: str) -> str:
    """Return a name as a heading: `problem_3_5_6` as Problem 3.5.6."""
    text = re.sub(r"(?<=\d) (?=\d)", ".", name.replace("_", " "))
    return text[:1].upper() + text[1:]


def name_problem(name: object, what: str) -> str | None:
    """Return a message about what is wrong with a name, or None.

    A name is a letter followed by letters, digits and underscores, so that it can appear in
    generated code of every target.
    """
    if not isinstance(name, str) or not _IDENTIFIER.fullmatch(name):
        return (
            f"{what} is named {_given(name)}: a name is an ASCII letter followed by letters, "
            "digits or underscores; rename it"
        )
    if len(name) > MOST_CHARACTERS:
        return (
            f"the name of {what} has {len(name)} characters; give one of at most {MOST_CHARACTERS}"
        )
    if name in RESERVED and what in SYMBOLS:
        return (
            f"{what} is named {name!r}, which is reserved (t is time, pi the number, deg a "
            "degree, alpha a cam's angle); rename it"
        )
    if name in COLUMNS and what in SYMBOLS | {"an output"}:
        return f"{what} is named {name!r}, which is a column of every motion; rename it"
    return None


def unit_problem(unit: object, what: str) -> str | None:
    """Return a message about what is wrong with a unit, or None.

    Units occur in comments and docstrings of generated code, so nothing may end those: no quotes,
    backslashes or line breaks, and no ``*/``.
    """
    if isinstance(unit, str) and _UNIT.fullmatch(unit):
        return None
    return (
        f"the unit of {what} is {_given(unit)}: a unit consists of letters, digits, spaces and "
        'the characters ° % · * / ^ . ( ) + -, as "m", "rad/s" or "kg*m^2"; write it so'
    )


def escaped(text: object) -> str:
    r"""Return a text of a user as a message shows it: on one line, nothing in it a command.

    Line breaks, control characters and marks that turn the direction of writing, which a terminal
    would obey, become ``\n``, ``\x1b``, ``\u202e``.
    """
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode("ascii")
        for character in str(text)
    )


def escaped_lines(text: str) -> str:
    """Return a whole message so that nothing in it is a command; its own line breaks stay."""
    return "\n".join(map(escaped, text.split("\n")))


def shown(value: object) -> str:
    """Return a value as a message shows it: kind or beginning of what is long, texts in quotes."""
    if isinstance(value, str):
        return repr(value if len(value) <= LONGEST else value[: LONGEST - 3] + "...")
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, dict | bool | None):
        return _KINDS[type(value)]
    is_huge = isinstance(value, int) and abs(value) >= 10**40
    text = "a huge number" if is_huge else escaped(repr(value))
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def _given(value: object) -> str:
    """Return what was given for a name, as Python writes it."""
    return shown(value) if isinstance(value, str) else escaped(repr(value))[:LONGEST]


def rate(name: str, order: int = 1) -> str:
    """Return the name of a coordinate's first or second time derivative; of order 0, its own."""
    return f"{name}_{'d' * order}ot" if order else name


def rate_unit(unit: str, order: int) -> str:
    """Return the unit of a time derivative: of m, m/s and m/s^2; of none, none."""
    return f"{unit}{('', '/s', '/s^2')[order]}" if unit else ""


def rate_of(
    given: str, known: Collection[str], orders: Sequence[int] = range(3)
) -> tuple[str, int] | None:
    """Return the known name whose rate of an order another is; None where there is no such one.

    ``"rod.phi_dot"`` means ``"phi_rod_dot"``, the rate of order 1 of ``"phi_rod"``. A name that is
    known itself comes before a rate.
    """
    wanted = column_name(given)
    stems = ((wanted.removesuffix(rate("", order)), order) for order in orders)
    return next((x for x in stems if rate(*x) == wanted and x[0] in known), None)


def column_name(name: str) -> str:
    """Return the column that is meant by ``"rod.phi_dot"``, here ``"phi_rod_dot"``, or as given."""
    name = str(name)
    owner, point, quantity = name.partition(".")
    if not point:
        return name
    ending = next((end for end in ("_ddot", "_dot") if quantity.endswith(end)), "")
    return f"{quantity.removesuffix(ending)}_{owner}{ending}"


def listed(names: Iterable[object], most: int = 12) -> str:
    """Write names as a short list for a message."""
    written = [str(name) for name in names]
    if not written:
        return "none"
    rest = len(written) - most
    return ", ".join(written[:most]) + (f" and {rest} more" if rest > 0 else "")


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return "; did you mean ...?" where a known name is close, else nothing.

    Of long names the beginning is compared, of many the first 1000, which takes a few milliseconds.
    """
    close = get_close_matches(str(name)[:40], list(islice(known, 1000)), n=1)
    return f"; did you mean {close[0]!r}?" if close else ""


def unknown(text: str, name: str, known: Collection[str], remedy: str = "") -> str:
    """Return a message about an unknown name: a text, which known one is close, and what to do."""
    return f"{text}{suggestion(name, known) or '.'} There are {listed(known)}{remedy}."


def sensitivity(name: str, parameter: str) -> str:
    """Return the name of the derivative of a coordinate, an equation or an output."""
    return f"{name}_by_{parameter}"


def quotient_unit(unit: str, per: str) -> str:
    """Return the unit of a derivative: of rad by m, rad/m; "" where both are the same."""
    if unit == per or not per:
        return "" if unit == per else unit
    return f"{unit or 1}/({per})" if "/" in per else f"{unit or 1}/{per}"


def parameters_problem(names: Sequence[str], known: Sequence[str], mechanism: str) -> str | None:
    """Return a message about names that are no parameters, are there twice or not at all, or None.

    A mechanism is to be differentiated by these parameters.
    """
    if not known:
        return f"{mechanism} has no parameters: declare the dimension with m.parameter, and use it."
    for name in names:
        if name not in known:
            near = suggestion(str(name), known) or "."
            return (
                f"{mechanism} has no parameter {name!r}{near} The parameters are {listed(known)}."
            )
    if names and len(set(names)) == len(names):
        return None
    return (
        f"sensitivities of {mechanism} are asked for by {listed(names)}: name each parameter once; "
        f"there are {listed(known)}."
    )


def multiplier(equation: str) -> str:
    """Return the name of the multiplier of an equation: ``lambda_A_x`` of ``A.x``."""
    return f"lambda_{equation.replace('.', '_')}"


def solved(name: str) -> str:
    """Return the name of what the equations of motion give of a coordinate."""
    return f"solved_{name}"


def correction(name: str, order: int) -> str:
    """Return the name of the change of a coordinate, or of its rate, that leads to constraints."""
    return f"{('correction', 'rate_correction')[order]}_{name}"


def without_loads(mechanism: str) -> str:
    """Return the message about a simulation of a mechanism without masses."""
    return (
        f"{mechanism} has no masses and no forces, so there is no dynamics to simulate. Give its "
        "bodies masses, m.body(..., mass=..., inertia=...), and set m.gravity."
    )


METRES = {
    "m": 1.0, "mm": 1e-3, "cm": 1e-2, "dm": 0.1, "km": 1e3, "um": 1e-6, "µm": 1e-6, "nm": 1e-9,
    "in": 0.0254, "inch": 0.0254, "ft": 0.3048, "yd": 0.9144,
}  # fmt: skip
"""Units of length, in metres."""

KILOGRAMS = {"kg": 1.0, "g": 1e-3, "t": 1e3, "lb": 0.45359237}
"""Units of mass, in kilograms."""


def newtons(mass: str, length: str) -> float:
    """Return what a unit of mass times a unit of length by s^2 is in newtons.

    Forces are in newtons where the unit of length is known; else in these very units, which is 1.
    """
    return KILOGRAMS[mass] * METRES[length] if length in METRES else 1.0


def force_units(length: str) -> tuple[str, str, str, str]:
    """Return the units of forces, torques, energies and power where lengths have a unit."""
    if length in METRES:
        return "N", f"N*{length}", "J", "W"
    if not length:
        return "", "", "", ""
    torque = f"kg*{length}^2/s^2"
    return f"kg*{length}/s^2", torque, torque, f"kg*{length}^2/s^3"


def transmission_ends(text: str) -> tuple[list[str], list[str]] | None:
    """Return the names in ``left,right:pitch,roll``, inputs and outputs; None of another form."""
    parts = [[name.strip() for name in part.split(",")] for part in text.split(":")]
    if len(parts) != 2 or not all(name for part in parts for name in part):
        return None
    return parts[0], parts[1]

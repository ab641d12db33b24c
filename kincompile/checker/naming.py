"""The names that formulas of a mechanism may use, and what to say of others."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.names import listed, rate

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from kincompile.model.system import ConstraintSystem


def mechanism_names(
    system: ConstraintSystem, coordinates: Sequence[str]
) -> tuple[tuple[str, str], ...]:
    """Return names of coordinates, each with the coordinate that it is.

    Courses number them: x1, y1, phi1, also x_1, are those of body 1, and q1 of all.
    """
    found = [(name, name) for name in coordinates]
    bodies = zip(system.bodies, system.body_columns, strict=True)
    for number, (body, columns) in enumerate(bodies, 1):
        for letter, column in zip(body.kind.letters, columns, strict=True):
            name = coordinates[column]
            found += [(f"{letter}{number}", name), (f"{letter}_{number}", name)]
    for number, name in enumerate(coordinates, 1):
        found += [(f"q{number}", name), (f"q_{number}", name)]
    return tuple(found)


def mechanism_help(
    system: ConstraintSystem, coordinates: Sequence[str], spins: Collection[str]
) -> str:
    """Return in words which names formulas may use."""
    names = [*coordinates, *(item.name for item in system.parameters), "t"]
    text = f"the names are: {listed(names, 60)}, and rates such as {rate(names[0])}"
    if spins:
        text += f", {listed(spins, 6)}"
    if system.bodies:
        numbers = listed(f"{k} {body.name}" for k, body in enumerate(system.bodies, 1))
        text += (
            f"; bodies are numbered: {numbers}, so that x1 is {coordinates[0]}; for a "
            "name of your own write a line 'name = formula'"
        )
    return text

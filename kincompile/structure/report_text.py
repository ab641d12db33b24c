"""What is found in a system, as plain text tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from kincompile.criteria import NEAR_MISS
from kincompile.names import listed
from kincompile.structure.remedies import advice
from kincompile.tables import counted, indented, pose, table

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from kincompile.model.bodies import Coordinate
    from kincompile.structure.findings import ConstraintEntry, Findings, Mobility

WIDEST_PATTERN = 45
"""Columns of Phi_q up to which the pattern is drawn; beyond, each row names its coordinates."""

MISSED = 8
"""How many equations that are missed, and bodies, are named."""

EXPLAINED = 10
"""How many redundant or conflicting constraints are explained; the rest are listed."""

IN_A_ROW = 9
"""How many equations and coordinates of a block are named: the coordinates of three bodies."""


def report_text(found: Findings) -> str:
    """Return everything as plain text tables; rows and columns count from 0."""
    sections = {
        "Bodies": _bodies(found),
        "Other coordinates": _others(found),
        "Parameters": _parameters(found),
        "Constraints": _constraints(found),
        "Limits": _limits(found),
        "Mobility": _mobility_lines(found),
        "Structure of Phi_q": list(_structure(found)),
        "What to do": list(_advice(found)),
        "Order of solution": _blocks(found),
        "Pattern of Phi_q": _pattern(found),
    }
    filled = [[title, *indented(lines)] for title, lines in sections.items() if lines]
    return "\n\n".join("\n".join(lines) for lines in [[_title(found)], *filled])


def _title(found: Findings) -> str:
    m, n = len(found.equations), len(found.coordinates)
    return f"{found.name}: {counted(n, 'coordinate')}, {counted(m, 'equation')}"


def _bodies(found: Findings) -> list[str]:
    rows = [
        [
            body.name,
            f"{columns[0]}-{columns[-1]}",
            *_names_and_guesses([found.coordinates[k] for k in columns]),
        ]
        for body, columns in zip(found.bodies, found.body_columns, strict=True)
    ]
    return table(("body", "columns", "coordinates", "guess"), rows) if rows else []


def _names_and_guesses(coordinates: Sequence[Coordinate]) -> tuple[str, str]:
    names = ", ".join(_with_unit(item.name, item.unit) for item in coordinates)
    return names, ", ".join(f"{item.guess:.6g}" for item in coordinates)


def _with_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _others(found: Findings) -> list[str]:
    first = sum(map(len, found.body_columns))
    rows = [
        [str(column), *_names_and_guesses([item])]
        for column, item in enumerate(found.coordinates[first:], first)
    ]
    return table(("column", "coordinate", "guess"), rows, right=("column",)) if rows else []


def _parameters(found: Findings) -> list[str]:
    rows = [[item.name, f"{item.default:.10g}", item.unit] for item in found.parameters]
    return table(("parameter", "default", "unit"), rows) if rows else []


def _constraints(found: Findings) -> list[str]:
    rows = [
        [_row_range(item), item.name, _kind(item), item.source, item.text]
        for item in found.constraints
    ]
    return table(("rows", "constraint", "type", "source", "between"), rows)


def _limits(found: Findings) -> list[str]:
    """Return limits as they are written; an end that is not limited is empty."""
    rows = [
        [item.joint, *("" if abs(x) == math.inf else str(x) for x in (item.least, item.greatest))]
        for item in found.limits
    ]
    return table(("joint", "least", "greatest"), rows) if rows else []


def _kind(item: ConstraintEntry) -> str:
    return f"{item.kind} (driver)" if item.is_driver else item.kind


def _row_range(item: ConstraintEntry) -> str:
    last = item.first_row + len(item.equations) - 1
    return str(last) if last == item.first_row else f"{item.first_row}-{last}"


def _mobility_lines(found: Findings) -> list[str]:
    count = found.mobility
    drivers = ", ".join(item.name for item in found.constraints if item.is_driver)
    terms = [
        (count.coordinates, "coordinates", _origin(count)),
        (-count.joint_equations, "joint equations", _held(found)),
        (count.degrees_of_freedom, "degrees of freedom", "by Gruebler's count"),
        (-count.driver_equations, "driver equations", drivers),
        (count.undriven, "left over", _meaning(found)),
    ]
    width = max(len(str(number)) for number, _, _ in terms)
    rows = [[f"{number:{width}d}", what, note] for number, what, note in terms]
    return table(("", "", ""), rows)[1:]


def _held(found: Findings) -> str:
    """Return which of the equations hold what nothing sees."""
    return f"with {counted(len(found.held), 'held freedom')}" if found.held else ""


def _meaning(found: Findings) -> str:
    """Return what the count means; the rank knows more where equations depend on others."""
    undriven, free = found.mobility.undriven, found.degrees_of_freedom
    if free and free != undriven:
        depend = counted(len(found.redundant) + len(found.conflicting), "dependent equation")
        return f"by rank {counted(free, 'degree')} of freedom: drivers are missing, {depend}"
    if not undriven:
        return ""
    return "drivers are missing" if undriven > 0 else "more equations than coordinates"


def _origin(count: Mobility) -> str:
    each = (count.coordinates - count.others) // (count.bodies or 1)
    bodies = f"{each} for each of {count.bodies} bodies" if count.bodies else ""
    others = f"{count.others} that belong to no body" if count.others else ""
    return ", ".join(part for part in (bodies, others) if part)


def _structure(found: Findings) -> Iterator[str]:
    m, n = len(found.equations), len(found.coordinates)
    yield f"{m} x {n}, {len(found.pattern)} of {m * n} entries are not identically zero"
    yield f"structural rank {found.structural_rank} of {min(m, n)}"
    yield from _parts(found)
    states = "generic assembled states" if found.is_assembled else "generic states"
    yield f"rank {found.rank} at {states}: {_left(found)}"
    if found.is_assembled and found.rank_at_start < found.rank:
        yield (
            f"rank {found.rank_at_start} at t = 0: no equation is redundant for that, but this "
            "position is singular"
        )


def _parts(found: Findings) -> Iterator[str]:
    """Yield what the pattern alone says, by bodies and constraints."""
    many, few = found.too_many, found.too_few
    surplus = len(many.equations) - len(many.coordinates)
    if surplus:
        yield (
            f"too many equations: {listed(found.constraints_of(many.equations))} have "
            f"{len(many.equations)} for the {len(many.coordinates)} coordinates of "
            f"{listed(found.owners_of(many.coordinates))}; {surplus} of them can never be "
            "independent"
        )
    if few.coordinates:
        held_by = found.constraints_of(few.equations)
        equations = counted(len(few.equations), "equation")
        yield (
            f"too few equations: {listed(found.owners_of(few.coordinates))} have "
            f"{len(few.coordinates)} coordinates, and {equations} for them"
            + (f" ({listed(held_by)})" if held_by else "")
        )


def _left(found: Findings) -> str:
    """Return what may still move."""
    if not found.degrees_of_freedom:
        return "nothing may move by itself"
    free = counted(found.degrees_of_freedom, "degree")
    return f"{free} of freedom left to {listed(found.free)}"


def _advice(found: Findings) -> Iterator[str]:
    """Yield what is wrong, and what to do."""
    for sentence in found.holds:
        yield f"{sentence}."
    if found.missing_drivers:
        yield f"{advice(found.missing_drivers)}."
    for item in found.surpluses[:EXPLAINED]:
        yield f"{item.text}. Remedy: {item.remedy}."
    if len(found.surpluses) > EXPLAINED:
        rest = listed(name for item in found.surpluses[EXPLAINED:] for name in item.equations)
        yield f"redundant or conflicting in the same way: {rest}."
    if not found.is_assembled:
        yield _unassembled(found)
    elif found.rank_at_start < found.rank:
        yield (
            "singular at t = 0, a dead point or a change point: velocities are not determined "
            "there. Let the drivers start from another position, or drive another body."
        )
    if found.problem:
        yield found.problem


def _unassembled(found: Findings) -> str:
    """Return the equations missed at the nearest position, by how much, and a remedy."""
    values = dict(zip(found.equations, found.residuals, strict=True))
    undefined = [name for name, value in values.items() if not math.isfinite(value)]
    if undefined:
        return (
            "cannot be assembled at t = 0, where these equations have no finite value: "
            f"{listed(undefined)}. Look for a division by zero, or a square root or logarithm of a "
            "negative number."
        )
    dependent = {*found.redundant, *found.conflicting}
    tried = ((abs(value), name) for name, value in values.items() if name not in dependent)
    sizes = sorted(tried, reverse=True)
    missed = [
        f"{name} by {size:.3g}" for size, name in sizes[:MISSED] if size > NEAR_MISS * sizes[0][0]
    ]
    touched = found.owners_of(_coordinates_of(found, [name for _, name in sizes[:MISSED]]))
    places = listed(_places(found, touched), MISSED)
    return (
        "cannot be assembled at t = 0, or not from this guess: at the nearest position found, "
        f"these equations are missed: {listed(missed)}. There: {places}. Change the lengths or "
        "the drivers so that the links reach each other, or give a guess nearer to the assembled "
        "mechanism."
    )


def _coordinates_of(found: Findings, equations: Collection[str]) -> list[str]:
    """Return the names of the coordinates in some equations."""
    rows = {row for row, name in enumerate(found.equations) if name in equations}
    return [found.coordinates[column].name for row, column in found.pattern if row in rows]


def _places(found: Findings, owners: Collection[str]) -> Iterator[str]:
    """Yield where some bodies are at the nearest position, and other coordinates' values."""
    for body, columns in zip(found.bodies, found.body_columns, strict=True):
        if body.name in owners:
            yield f"{body.name} {pose([found.nearest[k] for k in columns])}"
    for item, value in zip(found.coordinates, found.nearest, strict=True):
        if item.name in owners:
            yield f"{item.name} = {value:.4g}"


def _blocks(found: Findings) -> list[str]:
    rows = [
        [str(k), listed(block.coordinates, IN_A_ROW), listed(block.equations, IN_A_ROW)]
        for k, block in enumerate(found.blocks, 1)
    ]
    return table(("step", "coordinates", "by equations"), rows, right=("step",)) if rows else []


def _pattern(found: Findings) -> list[str]:
    if len(found.coordinates) > WIDEST_PATTERN:
        return _listed_pattern(found)
    filled = set(found.pattern)
    groups = list(_groups(found))
    rows = [["", *(" ".join(labels) for _, _, labels in groups)]] if found.bodies else []
    for row, name in enumerate(found.equations):
        marks = [
            " ".join(
                ("*" if (row, column) in filled else ".").ljust(len(label))
                for column, label in enumerate(labels, first)
            )
            for _, first, labels in groups
        ]
        rows.append([name, *marks])
    return table(("", *(title for title, _, _ in groups)), rows)


def _groups(found: Findings) -> Iterator[tuple[str, int, tuple[str, ...]]]:
    """Yield title, first column and labels of the columns that stand together."""
    for body, columns in zip(found.bodies, found.body_columns, strict=True):
        yield body.name, columns[0], body.kind.letters
    first = sum(map(len, found.body_columns))
    for column, item in enumerate(found.coordinates[first:], first):
        yield item.name, column, ("",)


def _listed_pattern(found: Findings) -> list[str]:
    names: dict[int, list[str]] = {row: [] for row in range(len(found.equations))}
    for row, column in found.pattern:
        names[row].append(found.coordinates[column].name)
    rows = [[equation, ", ".join(names[row])] for row, equation in enumerate(found.equations)]
    return table(("equation", "coordinates"), rows)

"""What a system is made of, counted: bodies, constraints, rows and columns, mobility, sparsity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kincompile.errors import StructuralError
from kincompile.model.resolve import Joint
from kincompile.structure.counting import require_square, unmatched
from kincompile.tables import counted, indented, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from kincompile.model.bodies import Body, Coordinate, Parameter
    from kincompile.model.resolve import FreeEquation
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.counting import Pattern

WIDEST_PATTERN = 45
"""Columns of Phi_q up to which the pattern is drawn; beyond, each row names its coordinates."""


@dataclass(frozen=True, slots=True)
class ConstraintEntry:
    """A constraint and the rows it has.

    Attributes
    ----------
    name
        Name of the constraint.
    kind
        Its type, for instance ``"Revolute"``; ``"Equation"`` for a free one.
    first_row
        Its first row, counted from 0.
    equations
        Names of its rows.
    is_driver
        Whether it is a function of time.
    text
        Bodies, points and values, or the equation.
    source
        Where the textbook has it.
    """

    name: str
    kind: str
    first_row: int
    equations: tuple[str, ...]
    is_driver: bool
    text: str
    source: str


@dataclass(frozen=True, slots=True)
class Mobility:
    """Gruebler's count. It counts and looks at no length: a special geometry may move nevertheless.

    Attributes
    ----------
    bodies
        Number of bodies, the ground not counted.
    others
        Coordinates that belong to no body: contact parameters of cams, and free ones.
    joint_equations
        Equations that do not depend on time.
    driver_equations
        Equations that do.
    """

    bodies: int
    others: int
    joint_equations: int
    driver_equations: int

    @property
    def coordinates(self) -> int:
        """Number of coordinates, three for each body and the others."""
        return 3 * self.bodies + self.others

    @property
    def degrees_of_freedom(self) -> int:
        """What the joints leave free: coordinates - joint equations."""
        return self.coordinates - self.joint_equations

    @property
    def undriven(self) -> int:
        """What the drivers leave free: 0 for a kinematic analysis, less if there are too many."""
        return self.degrees_of_freedom - self.driver_equations


@dataclass(frozen=True, slots=True)
class Inspection:
    """What `kc.inspect` finds.

    Attributes
    ----------
    name
        Name of the system.
    bodies, coordinates, parameters
        As in the system; the coordinates are the columns of Phi_q.
    constraints
        In the order of the rows of Phi_q.
    mobility
        Gruebler's count.
    pattern
        Row and column of each entry of Phi_q that is not identically zero, row by row.
    unmatched_equations, unmatched_coordinates
        What a maximum matching of equations with coordinates leaves over: equations that only
        repeat others, and coordinates that nothing determines.
    problem
        Why the system cannot be compiled as it is, "" where it can.
    """

    name: str
    bodies: tuple[Body, ...]
    coordinates: tuple[Coordinate, ...]
    parameters: tuple[Parameter, ...]
    constraints: tuple[ConstraintEntry, ...]
    mobility: Mobility
    pattern: tuple[tuple[int, int], ...]
    unmatched_equations: tuple[str, ...]
    unmatched_coordinates: tuple[str, ...]
    problem: str

    @property
    def equations(self) -> tuple[str, ...]:
        """Names of the rows of Phi_q."""
        return tuple(name for item in self.constraints for name in item.equations)

    @property
    def rank(self) -> int:
        """Structural rank of Phi_q: its rank for generic numbers in the pattern."""
        return len(self.equations) - len(self.unmatched_equations)

    def __str__(self) -> str:
        """Give everything as plain text tables; rows and columns count from 0."""
        sections = {
            "Bodies": _bodies(self),
            "Other coordinates": _others(self),
            "Parameters": _parameters(self),
            "Constraints": _constraints(self),
            "Mobility": _mobility_lines(self),
            "Structure of Phi_q": _structure(self),
            "Pattern of Phi_q": _pattern(self),
        }
        filled = [[title, *indented(lines)] for title, lines in sections.items() if lines]
        return "\n\n".join("\n".join(lines) for lines in [[_title(self)], *filled])


def inspect_system(system: ConstraintSystem, pattern: Pattern) -> Inspection:
    """Count what there is in a system.

    Parameters
    ----------
    system
        A checked system, with as many equations as it may have.
    pattern
        Row and column of each entry of Phi_q that is not identically zero, row by row.
    """
    equations, coordinates = unmatched(system, pattern)
    return Inspection(
        name=system.name,
        bodies=system.bodies,
        coordinates=system.coordinates,
        parameters=system.parameters,
        constraints=tuple(map(_entry, system.constraints, system.row_offsets)),
        mobility=_gruebler(system),
        pattern=tuple(pattern),
        unmatched_equations=tuple(equations),
        unmatched_coordinates=tuple(coordinates),
        problem=_problem(system, pattern),
    )


def _entry(item: Joint | FreeEquation, first_row: int) -> ConstraintEntry:
    kind = item.template.type_name if isinstance(item, Joint) else "Equation"
    return ConstraintEntry(
        item.name, kind, first_row, item.equation_names, item.is_driver, item.text, item.source
    )


def _gruebler(system: ConstraintSystem) -> Mobility:
    drivers = sum(len(item.equation_names) for item in system.constraints if item.is_driver)
    bodies = len(system.bodies)
    others = len(system.coordinates) - 3 * bodies
    return Mobility(bodies, others, len(system.equations) - drivers, drivers)


def _problem(system: ConstraintSystem, pattern: Pattern) -> str:
    try:
        require_square(system, pattern)
    except StructuralError as error:
        return str(error)
    return ""


def _title(found: Inspection) -> str:
    m, n = len(found.equations), len(found.coordinates)
    return f"{found.name}: {counted(n, 'coordinate')}, {counted(m, 'equation')}"


def _bodies(found: Inspection) -> list[str]:
    rows = [
        [
            body.name,
            f"{3 * k}-{3 * k + 2}",
            *_names_and_guesses(found.coordinates[3 * k : 3 * k + 3]),
        ]
        for k, body in enumerate(found.bodies)
    ]
    return table(("body", "columns", "coordinates", "guess"), rows) if rows else []


def _names_and_guesses(coordinates: Sequence[Coordinate]) -> tuple[str, str]:
    names = ", ".join(_with_unit(item.name, item.unit) for item in coordinates)
    return names, ", ".join(f"{item.guess:.6g}" for item in coordinates)


def _with_unit(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _others(found: Inspection) -> list[str]:
    first = 3 * len(found.bodies)
    rows = [
        [str(column), *_names_and_guesses([item])]
        for column, item in enumerate(found.coordinates[first:], first)
    ]
    return table(("column", "coordinate", "guess"), rows, right=("column",)) if rows else []


def _parameters(found: Inspection) -> list[str]:
    rows = [[item.name, f"{item.default:.10g}", item.unit] for item in found.parameters]
    return table(("parameter", "default", "unit"), rows) if rows else []


def _constraints(found: Inspection) -> list[str]:
    rows = [
        [_row_range(item), item.name, _kind(item), item.source, item.text]
        for item in found.constraints
    ]
    return table(("rows", "constraint", "type", "source", "between"), rows)


def _kind(item: ConstraintEntry) -> str:
    return f"{item.kind} (driver)" if item.is_driver else item.kind


def _row_range(item: ConstraintEntry) -> str:
    last = item.first_row + len(item.equations) - 1
    return str(last) if last == item.first_row else f"{item.first_row}-{last}"


def _mobility_lines(found: Inspection) -> list[str]:
    count = found.mobility
    drivers = ", ".join(item.name for item in found.constraints if item.is_driver)
    terms = [
        (count.coordinates, "coordinates", _origin(count)),
        (-count.joint_equations, "joint equations", ""),
        (count.degrees_of_freedom, "degrees of freedom", "by Gruebler's count"),
        (-count.driver_equations, "driver equations", drivers),
        (count.undriven, "left over", ""),
    ]
    width = max(len(str(number)) for number, _, _ in terms)
    rows = [[f"{number:{width}d}", what, note] for number, what, note in terms]
    return table(("", "", ""), rows)[1:]


def _origin(count: Mobility) -> str:
    bodies = f"3 for each of {count.bodies} bodies" if count.bodies else ""
    others = f"{count.others} that belong to no body" if count.others else ""
    return ", ".join(part for part in (bodies, others) if part)


def _structure(found: Inspection) -> list[str]:
    m, n = len(found.equations), len(found.coordinates)
    filled = len(found.pattern)
    lines = [
        f"{m} x {n}, {filled} of {m * n} entries are not identically zero",
        f"structural rank {found.rank} of {min(m, n)}",
    ]
    return [*lines, *found.problem.splitlines()]


def _pattern(found: Inspection) -> list[str]:
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


def _groups(found: Inspection) -> Iterator[tuple[str, int, tuple[str, ...]]]:
    """Yield title, first column and labels of the columns that stand together."""
    bodies = len(found.bodies)
    for k, body in enumerate(found.bodies):
        yield body.name, 3 * k, ("x", "y", "phi")
    for column, item in enumerate(found.coordinates[3 * bodies :], 3 * bodies):
        yield item.name, column, ("",)


def _listed_pattern(found: Inspection) -> list[str]:
    names: dict[int, list[str]] = {row: [] for row in range(len(found.equations))}
    for row, column in found.pattern:
        names[row].append(found.coordinates[column].name)
    rows = [[equation, ", ".join(names[row])] for row, equation in enumerate(found.equations)]
    return table(("equation", "coordinates"), rows)

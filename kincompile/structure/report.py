"""What a system is made of, counted: bodies, constraints, rows and columns, mobility, sparsity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from kincompile.errors import StructuralError
from kincompile.model.resolve import Joint
from kincompile.names import listed
from kincompile.structure.counting import require_square, unmatched
from kincompile.structure.parts import parts_of
from kincompile.tables import counted, indented, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.model.bodies import Body, Coordinate, Parameter
    from kincompile.model.resolve import FreeEquation
    from kincompile.model.system import ConstraintSystem
    from kincompile.structure.counting import Pattern
    from kincompile.structure.rank import RankReport

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


class Mobility(int):
    """Gruebler's count: a number, the coordinates less the equations of the joints.

    It counts and looks at no length: a special geometry may move nevertheless.

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

    def __new__(cls, bodies: int, others: int, joint_equations: int, driver_equations: int) -> Self:
        """Count."""
        self = super().__new__(cls, 3 * bodies + others - joint_equations)
        self.bodies, self.others = bodies, others
        self.joint_equations, self.driver_equations = joint_equations, driver_equations
        return self

    @property
    def coordinates(self) -> int:
        """Number of coordinates, three for each body and the others."""
        return 3 * self.bodies + self.others

    @property
    def degrees_of_freedom(self) -> int:
        """What the joints leave free: coordinates - joint equations."""
        return int(self)

    @property
    def undriven(self) -> int:
        """What the drivers leave free: 0 for a kinematic analysis, less if there are too many."""
        return int(self) - self.driver_equations


@dataclass(frozen=True, slots=True)
class NamedBlock:
    """Equations that must be solved together, and the coordinates that they determine."""

    equations: tuple[str, ...]
    coordinates: tuple[str, ...]


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
    rank
        Rank of Phi_q at generic states at which the joints are assembled.
    redundant
        Names of equations that depend on others at every such state, and agree with them.
    conflicting
        Names of equations that depend on others and cannot hold together with them.
    repeated
        For each redundant and conflicting equation, the constraints that it depends on.
    free
        Names of bodies, and of coordinates that belong to none, that may still move.
    blocks
        The well determined part of the pattern in the order of solution.
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
    rank: int
    redundant: tuple[str, ...]
    conflicting: tuple[str, ...]
    repeated: Mapping[str, tuple[str, ...]]
    free: tuple[str, ...]
    blocks: tuple[NamedBlock, ...]

    @property
    def degrees_of_freedom(self) -> int:
        """What all equations leave free: coordinates - rank."""
        return len(self.coordinates) - self.rank

    @property
    def equations(self) -> tuple[str, ...]:
        """Names of the rows of Phi_q."""
        return tuple(name for item in self.constraints for name in item.equations)

    @property
    def structural_rank(self) -> int:
        """Rank of Phi_q for generic numbers in the pattern."""
        return len(self.equations) - len(self.unmatched_equations)

    def __str__(self) -> str:
        """Give the text."""
        return self.to_text()

    def to_text(self) -> str:
        """Give everything as plain text tables; rows and columns count from 0."""
        sections = {
            "Bodies": _bodies(self),
            "Other coordinates": _others(self),
            "Parameters": _parameters(self),
            "Constraints": _constraints(self),
            "Mobility": _mobility_lines(self),
            "Structure of Phi_q": _structure(self),
            "Order of solution": _blocks(self),
            "Pattern of Phi_q": _pattern(self),
        }
        filled = [[title, *indented(lines)] for title, lines in sections.items() if lines]
        return "\n\n".join("\n".join(lines) for lines in [[_title(self)], *filled])


def inspect_system(system: ConstraintSystem, pattern: Pattern, ranks: RankReport) -> Inspection:
    """Count what there is in a system.

    Parameters
    ----------
    system
        A checked system, with as many equations as it may have.
    pattern
        Row and column of each entry of Phi_q that is not identically zero, row by row.
    ranks
        Its generic rank.
    """
    equations, coordinates = unmatched(system, pattern)
    names, columns = system.equations, [item.name for item in system.coordinates]
    entries = sorted((int(row), int(column)) for row, column in pattern)
    independent = [(row, column) for row, column in entries if row not in ranks.redundant]
    shape = len(names), len(columns)
    constraints = tuple(map(_entry, system.constraints, system.row_offsets))
    return Inspection(
        name=system.name,
        bodies=system.bodies,
        coordinates=system.coordinates,
        parameters=system.parameters,
        constraints=constraints,
        mobility=gruebler(system),
        pattern=tuple(entries),
        unmatched_equations=tuple(equations),
        unmatched_coordinates=tuple(coordinates),
        problem=_problem(system, pattern, ranks),
        rank=ranks.rank,
        redundant=tuple(names[row] for row in ranks.redundant),
        conflicting=tuple(names[row] for row in ranks.conflicting),
        repeated={
            names[row]: _constraints_of(constraints, {names[other] for other in others})
            for row, others in ranks.partners.items()
        },
        free=_owners(system, ranks.free),
        blocks=tuple(
            NamedBlock(
                tuple(names[row] for row in block.rows),
                tuple(columns[column] for column in block.columns),
            )
            for block in parts_of(independent, shape).blocks
        ),
    )


def _constraints_of(constraints: Sequence[ConstraintEntry], equations: set[str]) -> tuple[str, ...]:
    """Return the names of the constraints that have some of the equations."""
    return tuple(item.name for item in constraints if equations.intersection(item.equations))


def _owners(system: ConstraintSystem, columns: Sequence[int]) -> tuple[str, ...]:
    """Return the bodies that columns belong to, and the names of those that belong to none."""
    count = 3 * len(system.bodies)
    return tuple(
        dict.fromkeys(
            system.bodies[column // 3].name if column < count else system.coordinates[column].name
            for column in columns
        )
    )


def _entry(item: Joint | FreeEquation, first_row: int) -> ConstraintEntry:
    kind = item.template.type_name if isinstance(item, Joint) else "Equation"
    return ConstraintEntry(
        item.name, kind, first_row, item.equation_names, item.is_driver, item.text, item.source
    )


def gruebler(system: ConstraintSystem) -> Mobility:
    """Count coordinates and equations as Gruebler does."""
    drivers = sum(len(item.equation_names) for item in system.constraints if item.is_driver)
    bodies = len(system.bodies)
    others = len(system.coordinates) - 3 * bodies
    return Mobility(bodies, others, len(system.equations) - drivers, drivers)


def _problem(system: ConstraintSystem, pattern: Pattern, ranks: RankReport) -> str:
    n = len(system.coordinates)
    drivers = {
        name for item in system.constraints if item.is_driver for name in item.equation_names
    }
    extra = {system.equations[row] for row in ranks.redundant}
    surplus = len(system.equations) - n
    if (
        surplus > 0
        and len(extra) == surplus
        and ranks.rank == n
        and drivers
        and not drivers & extra
    ):
        return ""  # solved in the sense of least squares
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
        f"structural rank {found.structural_rank} of {min(m, n)}",
        f"rank {found.rank} at generic assembled states: {_left(found)}",
    ]
    return [*lines, *_dependent(found), *found.problem.splitlines()]


def _left(found: Inspection) -> str:
    """Say what may still move."""
    if not found.degrees_of_freedom:
        return "nothing may move by itself"
    free = counted(found.degrees_of_freedom, "degree")
    return f"{free} of freedom left to {listed(found.free)}"


def _dependent(found: Inspection) -> Iterator[str]:
    """Yield what is wrong with equations that depend on others, and what to do."""
    for verdict, names in (("redundant", found.redundant), ("conflicting", found.conflicting)):
        for name in names:
            others = listed(found.repeated[name])
            harm = (
                f"it repeats what {others} demand, harmless as long as the lengths are exact"
                if verdict == "redundant"
                else f"it contradicts {others}"
            )
            yield f"{verdict}: {name}; {harm}; {_remedy(found, name)}"


def _remedy(found: Inspection, name: str) -> str:
    """Return what would remove an equation that depends on others."""
    owner = next(item for item in found.constraints if name in item.equations)
    if owner.is_driver:
        return f"remove the driver {owner.name}"
    if owner.kind == "Revolute":
        return (
            f"replace the Revolute {owner.name} by a RevoluteTranslational (a point on a line) or "
            "a Distance"
        )
    return f"replace {owner.name} by a constraint with fewer equations, or remove it"


def _blocks(found: Inspection) -> list[str]:
    rows = [
        [str(k), ", ".join(block.coordinates), ", ".join(block.equations)]
        for k, block in enumerate(found.blocks, 1)
    ]
    return table(("step", "coordinates", "by equations"), rows, right=("step",)) if rows else []


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

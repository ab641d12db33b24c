"""What is found in a system: bodies, constraints, mobility, rank, parts, and what is wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from kincompile.model.bodies import body_columns

if TYPE_CHECKING:
    from collections.abc import Collection

    from kincompile.model.bodies import Body, Coordinate, Parameter
    from kincompile.model.limits import JointLimit
    from kincompile.structure.remedies import MissingDriver, Surplus


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
    coordinates
        Number of coordinates.
    others
        How many of them belong to no body: contact parameters of cams, and free ones.
    joint_equations
        Equations that do not depend on time.
    driver_equations
        Equations that do.
    """

    bodies: int
    coordinates: int
    others: int
    joint_equations: int
    driver_equations: int

    def __new__(
        cls, bodies: int, coordinates: int, others: int, joint_equations: int, driver_equations: int
    ) -> Self:
        """Count."""
        self = super().__new__(cls, coordinates - joint_equations)
        self.bodies, self.coordinates, self.others = bodies, coordinates, others
        self.joint_equations, self.driver_equations = joint_equations, driver_equations
        return self

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
    """Equations that belong together, and the coordinates in them, by name."""

    equations: tuple[str, ...]
    coordinates: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Findings:
    """What there is in a system, counted.

    Attributes
    ----------
    name
        Name of the system.
    bodies, coordinates, parameters
        As in the system; the coordinates are the columns of Phi_q.
    constraints
        In the order of the rows of Phi_q.
    limits
        Limits of joints, as in the system.
    mobility
        Gruebler's count.
    pattern
        Row and column of each entry of Phi_q that is not identically zero, row by row.
    unmatched_equations, unmatched_coordinates
        What a maximum matching of equations with coordinates leaves over: equations that only
        repeat others, and coordinates that nothing determines.
    problem
        Why the system cannot be solved as it is; "" where it can.
    rank
        Rank of Phi_q at generic states at which the joints are assembled.
    redundant
        Names of equations that depend on others at every such state, and agree with them.
    conflicting
        Names of equations that depend on others and cannot hold together with them.
    held
        Names of the freedoms that nothing sees and equations hold: ``"spin of rod"``, or a
        coordinate.
    holds
        For each of these equations what it holds, and how to hold that otherwise.
    surpluses
        The constraints that have redundant or conflicting equations, and what to do about each.
    free_coordinates
        Names of the coordinates that no equation determines.
    missing_drivers
        Drivers, as many as there are degrees of freedom, after which nothing may move.
    too_many, too_few
        The parts of the pattern, by Dulmage and Mendelsohn, with more equations than coordinates
        in them, and with more coordinates than equations for them.
    blocks
        The well determined part of the pattern in the order of solution, without the equations
        that are redundant or conflicting.
    is_assembled
        Whether joints and drivers could be assembled at the start.
    rank_at_start
        Rank of Phi_q at the start; less than `rank` at a singular position.
    nearest
        The coordinates at the start, or at the position nearest to it that was found.
    residuals
        Value of each equation there.
    """

    name: str
    bodies: tuple[Body, ...]
    coordinates: tuple[Coordinate, ...]
    parameters: tuple[Parameter, ...]
    constraints: tuple[ConstraintEntry, ...]
    limits: tuple[JointLimit, ...]
    mobility: Mobility
    pattern: tuple[tuple[int, int], ...]
    unmatched_equations: tuple[str, ...]
    unmatched_coordinates: tuple[str, ...]
    problem: str
    rank: int
    redundant: tuple[str, ...]
    conflicting: tuple[str, ...]
    held: tuple[str, ...]
    holds: tuple[str, ...]
    surpluses: tuple[Surplus, ...]
    free_coordinates: tuple[str, ...]
    missing_drivers: tuple[MissingDriver, ...]
    too_many: NamedBlock
    too_few: NamedBlock
    blocks: tuple[NamedBlock, ...]
    is_assembled: bool
    rank_at_start: int
    nearest: tuple[float, ...]
    residuals: tuple[float, ...]

    @property
    def degrees_of_freedom(self) -> int:
        """What all equations leave free: coordinates - rank."""
        return len(self.coordinates) - self.rank

    @property
    def free(self) -> tuple[str, ...]:
        """Names of bodies, and of coordinates that belong to none, that may still move."""
        return self.owners_of(self.free_coordinates)

    @property
    def equations(self) -> tuple[str, ...]:
        """Names of the rows of Phi_q."""
        return tuple(name for item in self.constraints for name in item.equations)

    @property
    def structural_rank(self) -> int:
        """Rank of Phi_q for generic numbers in the pattern."""
        return len(self.equations) - len(self.unmatched_equations)

    def constraints_of(self, equations: Collection[str]) -> tuple[str, ...]:
        """Return the names of the constraints that have some of the equations."""
        wanted = set(equations)
        return tuple(item.name for item in self.constraints if wanted & set(item.equations))

    @property
    def body_columns(self) -> tuple[range, ...]:
        """Columns of each body's coordinates."""
        return body_columns(self.bodies)

    def owners_of(self, coordinates: Collection[str]) -> tuple[str, ...]:
        """Return the bodies of coordinates, and the names of those that belong to none."""
        owner = {name: body.name for body in self.bodies for name in body.coordinates}
        return tuple(dict.fromkeys(owner.get(name, name) for name in coordinates))

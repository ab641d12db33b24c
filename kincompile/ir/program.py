"""The program of a mechanism: kernels (one a constraint type) and instances (one a constraint)."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING

from kincompile.model.points import Observed
from kincompile.model.resolve import FreeEquation, Joint, held_text
from kincompile.quantities import quantities_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.ir.graph import Node
    from kincompile.model.bodies import Body, Coordinate, Parameter
    from kincompile.model.outputs import ResolvedOutput
    from kincompile.model.points import OutputColumn, PlacedPoint
    from kincompile.model.resolve_loads import AppliedLoad
    from kincompile.model.spline import SplineTable
    from kincompile.quantities import Columns, Part, Quantity, Rows


@dataclass(frozen=True, slots=True)
class StateEntry:
    """A coordinate of an owner, a body or a contact of the type, or its rate (order 1)."""

    owner: int
    component: int
    order: int
    name: str = field(compare=False)


@dataclass(frozen=True, slots=True)
class FrameEntry:
    """A number that the frame of body i or j gives: the cosine or sine of its angle."""

    owner: int
    entry: int
    name: str = field(compare=False)


@dataclass(frozen=True, slots=True)
class Attribute:
    """A scalar attribute, or a component of a point or direction."""

    symbol: str
    component: int
    name: str = field(compare=False)


@dataclass(frozen=True, slots=True)
class Function:
    """The value C(t), or rho(alpha) of a body at the contact that is the owner, or a derivative."""

    symbol: str
    order: int
    owner: int | None = None
    body: int | None = None

    @property
    def name(self) -> str:
        """The symbol, with a prime for each derivative."""
        return self.symbol + "_prime" * self.order


Input = StateEntry | FrameEntry | Attribute | Function
"""What a kernel of a constraint type reads; `name` is for people, in the type's own symbols."""


@dataclass(frozen=True, slots=True)
class Hint:
    """What a node is in the textbook's formula: a component of A_i s_i, of d, of u(alpha_i)."""

    node: int
    owner: int | None  # number of the body that is named in it, None if none is
    stem: str  # its name, ``{}`` for that of the body
    name: str  # its name in the type's own symbols


@dataclass(frozen=True, slots=True)
class FrameKernel:
    """The code of a frame: cosine and sine of the angle in the plane."""

    nodes: tuple[Node, ...]  # the code, whose inputs are the numbers of the coordinates
    entries: tuple[int, ...]  # nodes of what it gives
    # letters, symbols: letters of the coordinates, and symbols of the entries: ``c`` and ``s``
    letters: tuple[str, ...]
    symbols: tuple[str, ...]
    formula: str  # the matrix A, for a comment


@dataclass(frozen=True, slots=True)
class BodyFrame:
    """A body: the frame kernel of its kind bound to its coordinates."""

    name: str
    kernel: FrameKernel
    columns: range
    # Nodes of `Program.values` that its frame gives: cosine and sine of its angle.
    entries: tuple[int, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the entries in emitted code: ``c_crank`` and ``s_crank``."""
        return tuple(f"{symbol}_{self.name}" for symbol in self.kernel.symbols)


@dataclass(frozen=True, repr=False)
class Kernel:
    """Straight-line code for the quantities of one constraint type."""

    name: str
    inputs: tuple[Input | str, ...]  # what it reads; of a free equation the names that occur
    nodes: tuple[Node, ...]
    # By quantity ``(row, column, node)`` of each entry: of a matrix those that can differ from
    # zero, of a vector all, with column 0. Rows and columns count the type's own equations and
    # coordinates; parameters are those of the mechanism.
    outputs: Mapping[str, tuple[tuple[int, int, int], ...]]
    hints: tuple[Hint, ...]  # what some nodes are in the textbook's formula, for speaking names

    def __repr__(self) -> str:
        return self._text

    @cached_property
    def _text(self) -> str:
        """All of it, for fingerprints: every mechanism with the type asks for that."""
        values = (f"{item.name}={getattr(self, item.name)!r}" for item in fields(self))
        return f"Kernel({', '.join(values)})"


@dataclass(frozen=True, slots=True)
class OutputDerivatives(Observed):
    """The derivatives of outputs by a parameter: what stands for them in names and comments."""

    name: str
    columns: tuple[str, ...]
    rows: tuple[OutputColumn, ...]
    bodies: tuple[Body, ...] = ()


@dataclass(frozen=True, slots=True)
class Instance:
    """One constraint, output or load: a kernel bound to rows, columns and attribute values."""

    kernel: Kernel
    # The constraint, output or load, for names and comments.
    constraint: (
        Joint | FreeEquation | ResolvedOutput | PlacedPoint | OutputDerivatives | AppliedLoad
    )
    first_row: int  # row offset in the system
    # Column of each of the kernel's coordinates, None on the ground.
    columns: tuple[int | None, ...]
    bindings: tuple[int, ...]  # node of `Program.values` for each of the kernel's inputs
    first_output: int = 0  # row offset in the outputs of the mechanism

    def place(self, quantity: Quantity, row: int, column: int) -> tuple[int, int] | None:
        """Return where an entry of the kernel stands in the system, None on the ground."""
        at: int | None = self.first_row + row
        if quantity.rows != "equations":
            at = self.columns[row] if quantity.rows == "coordinates" else self.first_output + row
        by = self.columns[column] if quantity.columns == "coordinates" else column
        return None if at is None or by is None else (at, by)

    @property
    def name(self) -> str:
        """The constraint's name."""
        return self.constraint.name

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of body i and body j, as far as the type has them."""
        return tuple(body.name for body in self.constraint.bodies)

    @property
    def is_own(self) -> bool:
        """Whether it is a body's own equation, as the length of its Euler parameters."""
        return isinstance(self.constraint, Joint) and self.constraint.written.is_own

    @property
    def is_load(self) -> bool:
        """Whether it is a mass or a force."""
        return "M" in self.kernel.outputs

    @property
    def is_motion(self) -> bool:
        """Whether it is the solved equations of motion."""
        return "accelerations" in self.kernel.outputs

    @property
    def rows(self) -> tuple[OutputColumn, ...]:
        """The outputs that it gives."""
        return self.constraint.rows if isinstance(self.constraint, Observed) else ()


@dataclass(frozen=True, slots=True)
class Program:
    """Everything an emitter needs."""

    name: str
    coordinates: tuple[Coordinate, ...]
    parameters: tuple[Parameter, ...]
    equations: tuple[str, ...]
    bodies: tuple[BodyFrame, ...]  # the bodies; what a frame gives is computed once a body
    # Shared code in coordinates, rates, parameters and t that feeds the instances: attributes,
    # drivers, profiles, frames.
    values: tuple[Node, ...]
    instances: tuple[Instance, ...]
    tables: Mapping[str, SplineTable]  # splines by name
    # Digest of all the above: two systems with the same code and data have the same.
    fingerprint: str
    # end, points: the mechanism's own time grid, for a target that solves too
    end: float
    points: int
    # Names of equations that repeat others at every assembled position, and agree with them.
    redundant: tuple[str, ...] = ()
    unsolvable: str = ""  # why the equations cannot determine the coordinates; "" where they can
    observers: tuple[Instance, ...] = ()  # the outputs, an instance each; those of a point are one
    loads: tuple[Instance, ...] = ()  # the masses of bodies and the loads, an instance each
    motion: tuple[Instance, ...] = ()  # the equations of motion, one, where they were asked for

    @property
    def parts(self) -> tuple[Instance, ...]:
        """Everything that gives entries of quantities."""
        return *self.instances, *self.observers, *self.loads, *self.motion

    @property
    def outputs(self) -> tuple[OutputColumn, ...]:
        """The outputs."""
        return tuple(row for item in self.observers for row in item.rows)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The quantities that there are: of outputs, loads and motion only where there are any."""
        parts: dict[Part, tuple[Instance, ...]] = {
            "outputs": self.observers,
            "loads": self.loads,
            "motion": self.motion,
        }
        return quantities_of([part for part, found in parts.items() if found])

    @property
    def held(self) -> dict[str, str]:
        """The freedoms in words that nothing sees, by the equation that holds each."""
        items = (instance.constraint for instance in self.instances)
        return {
            x.name: held_text(x.holds) for x in items if isinstance(x, FreeEquation) and x.holds
        }

    @property
    def corners(self) -> bool:
        """Whether drivers may have corners."""
        return any(instance.constraint.corners for instance in self.instances)

    def names_of(self, kind: Rows | Columns) -> tuple[str, ...]:
        """Return the names of what the rows or columns of a quantity belong to."""
        return tuple(item if isinstance(item, str) else item.name for item in self._owners(kind))

    def _owners(
        self, kind: Rows | Columns
    ) -> tuple[str | Coordinate | OutputColumn | Parameter, ...]:
        """Return what the rows or columns of a quantity belong to; a kind is named as they are."""
        found: tuple[str | Coordinate | OutputColumn | Parameter, ...] = getattr(self, kind, ())
        return found

    def shape_of(self, quantity: Quantity) -> tuple[int, ...]:
        """Return the shape of a quantity: (rows,) or (rows, columns)."""
        shape = (len(self._owners(quantity.rows)),)
        return (*shape, len(self._owners(quantity.columns))) if quantity.is_matrix else shape

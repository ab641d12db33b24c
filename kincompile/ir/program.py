"""The program of a mechanism: kernels (one a constraint type) and instances (one a constraint)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.ir.graph import Node
    from kincompile.model.bodies import Coordinate, Parameter
    from kincompile.model.resolve import FreeEquation, Joint
    from kincompile.model.spline import SplineTable
    from kincompile.quantities import Columns, Quantity, Rows


@dataclass(frozen=True, slots=True)
class Kernel:
    """Straight-line code for the quantities of one constraint type.

    Attributes
    ----------
    inputs
        Names of what it reads: coordinates, rates, cosine and sine of body angles, attributes,
        C(t), rho(alpha).
    nodes
        The code.
    outputs
        By quantity ``(row, column, node)`` of each entry: of a matrix those that can differ from
        zero, of a vector all, with column 0. Rows and columns count the type's own equations and
        coordinates; parameters are those of the mechanism.
    hints
        ``(node, stem)``: what a vector component is in the textbook's formula, for speaking names.
    """

    name: str
    inputs: tuple[str, ...]
    nodes: tuple[Node, ...]
    outputs: Mapping[str, tuple[tuple[int, int, int], ...]]
    hints: tuple[tuple[int, str], ...]


@dataclass(frozen=True, slots=True)
class Instance:
    """One constraint: a kernel bound to rows, columns and attribute values.

    Attributes
    ----------
    constraint
        The constraint, for names and comments.
    first_row
        Row offset in the system.
    columns
        Column of each of the kernel's coordinates, None on the ground.
    bindings
        Node of `Program.values` for each of the kernel's inputs.
    first_output
        Row offset in the outputs of the mechanism.
    """

    kernel: Kernel
    constraint: Joint | FreeEquation
    first_row: int
    columns: tuple[int | None, ...]
    bindings: tuple[int, ...]
    first_output: int = 0

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


@dataclass(frozen=True, slots=True)
class Program:
    """Everything an emitter needs.

    Attributes
    ----------
    frames
        ``(body, column of its angle)`` of each body: cosine and sine are computed once a body.
    values
        Shared code in coordinates, rates, parameters and t that feeds the instances: attributes,
        drivers, profiles, frames.
    tables
        Splines by name.
    fingerprint
        Digest of all the above: two systems with the same code and data have the same.
    redundant
        Names of equations that repeat others at every assembled position, and agree with them.
    outputs
        Names of the outputs.
    end, points
        The mechanism's own time grid, for a target that solves too.
    """

    name: str
    coordinates: tuple[Coordinate, ...]
    parameters: tuple[Parameter, ...]
    equations: tuple[str, ...]
    frames: tuple[tuple[str, int], ...]
    values: tuple[Node, ...]
    instances: tuple[Instance, ...]
    tables: Mapping[str, SplineTable]
    fingerprint: str
    end: float
    points: int
    redundant: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()

    def names_of(self, kind: Rows | Columns) -> tuple[str, ...]:
        """Return the names of what the rows or columns of a quantity belong to."""
        names: dict[str, tuple[str, ...]] = {
            "equations": self.equations,
            "coordinates": tuple(item.name for item in self.coordinates),
            "outputs": self.outputs,
            "parameters": tuple(item.name for item in self.parameters),
            "none": (),
        }
        return names[kind]

    def shape_of(self, quantity: Quantity) -> tuple[int, ...]:
        """Return the shape of a quantity: (rows,) or (rows, columns)."""
        shape = (len(self.names_of(quantity.rows)),)
        return (*shape, len(self.names_of(quantity.columns))) if quantity.is_matrix else shape

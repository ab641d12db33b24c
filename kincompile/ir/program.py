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


@dataclass(frozen=True, slots=True)
class Kernel:
    """Straight-line code for Phi, Phi_q, nu and gamma of one constraint type.

    Attributes
    ----------
    inputs
        Names of what it reads: coordinates, rates, cosine and sine of body angles, attributes,
        C(t), rho(alpha).
    nodes
        The code; outputs below are numbers of nodes.
    Phi, nu, gamma
        One node an equation.
    Phi_q
        ``(row, column, node)`` of each entry that can differ from zero; the column counts the
        type's own coordinates.
    hints
        ``(node, stem)``: what a vector component is in the textbook's formula, for speaking names.
    """

    name: str
    inputs: tuple[str, ...]
    nodes: tuple[Node, ...]
    Phi: tuple[int, ...]
    Phi_q: tuple[tuple[int, int, int], ...]
    nu: tuple[int, ...]
    gamma: tuple[int, ...]
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
    """

    kernel: Kernel
    constraint: Joint | FreeEquation
    first_row: int
    columns: tuple[int | None, ...]
    bindings: tuple[int, ...]

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

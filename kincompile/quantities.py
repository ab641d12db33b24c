"""The table of quantities: what a mechanism is compiled to, and what an emitted module gives.

Kernels, programs, the interpreter, the targets, the contract of an emitted module, its compiled
functions and its verification go through this table. A new quantity is one entry here and the code
that computes it: outputs of that name in the kernels. At the end it says which coordinates turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Mapping, Sequence

FORMAT = 3
"""The format of emitted modules, as docs/contract.md has it."""

Rows = Literal["equations", "coordinates", "outputs"]
Columns = Literal["none", "coordinates", "parameters"]
Part = Literal["", "outputs", "loads", "motion"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A vector or a matrix over the names of a mechanism.

    Attributes
    ----------
    name
        Its name in formulas and in emitted code.
    rows
        What its rows belong to.
    columns
        What its columns belong to; ``"none"`` for a vector.
    reads
        What it depends on: ``q``, ``q_dot``, ``q_ddot``, ``t`` and ``p``.
    adds
        Whether several constraints contribute to one entry, so that contributions are added;
        otherwise an entry belongs to one constraint.
    about
        A sentence for the comments of emitted code.
    of
        What a mechanism must have for it beside constraints: ``"outputs"``, ``"loads"``, masses or
        forces, or ``"motion"``, equations of motion that were asked for.
    """

    name: str
    rows: Rows
    columns: Columns
    reads: tuple[str, ...]
    adds: bool
    about: str
    of: Part = ""

    @property
    def is_matrix(self) -> bool:
        """Whether it has columns, and of its entries only those that can differ from zero count."""
        return self.columns != "none"

    @property
    def states(self) -> tuple[str, ...]:
        """What it reads of q, q_dot and q_ddot."""
        return self.reads[:-2]

    @property
    def is_by_constraint(self) -> bool:
        """Whether it is a vector whose rows are those of a constraint, under whose title it is."""
        return self.rows == "equations" and not self.is_matrix and not self.of


AT_POSITION = ("q", "t", "p")
MOVING = ("q", "q_dot", "t", "p")
ACCELERATED = ("q", "q_dot", "q_ddot", "t", "p")

QUANTITIES: tuple[Quantity, ...] = (
    Quantity("Phi", "equations", "none", AT_POSITION, False, "Constraint vector Phi(q, t)."),
    Quantity("Phi_q", "equations", "coordinates", AT_POSITION, False, "Jacobian of Phi by q."),
    Quantity(
        "nu", "equations", "none", AT_POSITION, False,
        "Right side of the velocity equation Phi_q q_dot = nu = -Phi_t.",
    ),
    Quantity(
        "gamma", "equations", "none", MOVING, False,
        "Right side of the acceleration equation Phi_q q_ddot = gamma.",
    ),
    Quantity("outputs", "outputs", "none", ACCELERATED, False, "Outputs y.", "outputs"),
    Quantity(
        "outputs_dot", "outputs", "none", ACCELERATED, False,
        "Time derivatives of the outputs, y_dot = y_q q_dot + y_t.", "outputs",
    ),
    Quantity(
        "outputs_ddot", "outputs", "none", ACCELERATED, False,
        "Second time derivatives of the outputs; NaN of those that depend on rates.", "outputs",
    ),
    Quantity(
        "outputs_q", "outputs", "coordinates", ACCELERATED, False,
        "Jacobian of the outputs by q.", "outputs",
    ),
    Quantity("M", "coordinates", "coordinates", AT_POSITION, True, "Mass matrix M(q).", "loads"),
    Quantity(
        "Q", "coordinates", "none", MOVING, True,
        "Generalised forces: M q_ddot + Phi_q^T lambda = Q(q, q_dot, t).", "loads",
    ),
    Quantity("Q_q", "coordinates", "coordinates", MOVING, True, "Jacobian of Q by q.", "loads"),
    Quantity(
        "Q_q_dot", "coordinates", "coordinates", MOVING, True, "Jacobian of Q by q_dot.", "loads"
    ),
    Quantity(
        "accelerations", "coordinates", "none", MOVING, False,
        "q_ddot of M q_ddot + Phi_q^T lambda = Q and Phi_q q_ddot = gamma.", "motion",
    ),
    Quantity(
        "multipliers", "equations", "none", MOVING, False,
        "lambda of M q_ddot + Phi_q^T lambda = Q and Phi_q q_ddot = gamma.", "motion",
    ),
)  # fmt: skip
"""All quantities, in the order in which they are computed."""

TOGETHER: Mapping[str, tuple[str, ...]] = {
    "position": ("Phi", "Phi_q"),
    "velocity": ("Phi_q", "nu"),
    "acceleration": ("Phi_q", "gamma"),
    "kinematics": ("Phi", "Phi_q", "nu", "gamma"),
    "observe": ("outputs", "outputs_dot", "outputs_ddot"),
    "forward_dynamics": ("accelerations", "multipliers"),
}
"""Functions that give several quantities at once: the steps of an analysis."""

WHOLE = ("position", "observe", "forward_dynamics")
"""Those of them that are code of their own, in place of code for each of their quantities."""


def quantities_of(parts: Container[Part]) -> tuple[Quantity, ...]:
    """Return the quantities of a mechanism that has these parts beside constraints, in order."""
    return tuple(item for item in QUANTITIES if not item.of or item.of in parts)


OF_EQUATIONS = quantities_of(())
"""Those whose rows are the equations, which a hand-derived formula is compared with."""


def quantity_named(name: str) -> Quantity:
    """Return the quantity of a name."""
    return next(item for item in QUANTITIES if item.name == name)


def singles(given: Sequence[Quantity]) -> dict[str, tuple[str, ...]]:
    """Return a function for each quantity."""
    return {item.name: (item.name,) for item in given}


def functions(given: Sequence[Quantity]) -> dict[str, tuple[str, ...]]:
    """Return the functions of an emitted module, and the quantities that each gives."""
    single = singles(given)
    return single | {name: own for name, own in TOGETHER.items() if set(own) <= single.keys()}


def kernels(given: Sequence[Quantity]) -> dict[str, tuple[str, ...]]:
    """Return the pieces of code that are emitted, and the quantities that each computes.

    They are ``position``, one for each quantity that is in none of the others, ``kinematics``,
    since most of the work of a batch is shared, and the others of `WHOLE` as far as they are there.
    """
    whole = {name: TOGETHER[name] for name in WHOLE if name in functions(given)}
    covered = {name for own in whole.values() for name in own}
    single = {name: own for name, own in singles(given).items() if name not in covered}
    position = {"position": whole.pop("position")}
    return {**position, **single, "kinematics": TOGETHER["kinematics"], **whole}


def kernels_apart(given: Sequence[Quantity]) -> dict[str, tuple[str, ...]]:
    """Return the kernels without ``kinematics``, where all of it at once is of no use."""
    found = kernels(given)
    del found["kinematics"]
    return found


def kernel_of(quantity: Quantity, found: Mapping[str, tuple[str, ...]]) -> str:
    """Return the first of some kernels that gives a quantity."""
    return next(name for name, own in found.items() if quantity.name in own)


def nonzeros_of(quantity: Quantity) -> str:
    """Return what compiled code calls the entries of a matrix in the order of its pattern."""
    return "nonzeros" if quantity.name == "Phi_q" else f"{quantity.name}_nonzeros"


def pattern_of(quantity: Quantity) -> str:
    """Return the constant of the rows and columns of a matrix's entries."""
    return "PATTERN" if quantity.name == "Phi_q" else f"PATTERN_{quantity.name}"


def states_of(names: Iterable[str]) -> tuple[str, ...]:
    """Return what quantities read of q, q_dot and q_ddot together."""
    return max((quantity_named(name).states for name in names), key=len)


SPATIAL_COORDINATES = 7
"""Coordinates of a body in space: three of its place, then its Euler parameters."""


def turning(units: Iterable[str], bodies: Iterable[Sequence[int] | range]) -> list[bool]:
    """Return which coordinates have the scale of angles, whatever the unit of lengths.

    They are the angles, and the Euler parameters, which are cosines and sines of half angles.

    Parameters
    ----------
    units
        The unit of each coordinate.
    bodies
        The columns of the coordinates of each body.
    """
    found = [unit == "rad" for unit in units]
    for cover in covers(bodies):
        for column in cover:
            found[column] = True
    return found


def covers(bodies: Iterable[Sequence[int] | range]) -> list[Sequence[int]]:
    """Return the columns of the Euler parameters of each body in space, of those of all bodies."""
    return [columns[3:] for columns in bodies if len(columns) == SPATIAL_COORDINATES]


def first_of_cover(n: int, bodies: Iterable[Sequence[int] | range]) -> list[int]:
    """Return of each of n coordinates the first Euler parameter of its body; n of all others."""
    found = [n] * n
    for cover in covers(bodies):
        for column in cover:
            found[column] = cover[0]
    return found


def may_turn(units: Iterable[str], bodies: Iterable[Sequence[int] | range]) -> list[bool]:
    """Return which coordinates are angles, or may be: free ones whose unit is not known."""
    owned = {column for columns in bodies for column in columns}
    return [unit == "rad" or not (unit or k in owned) for k, unit in enumerate(units)]

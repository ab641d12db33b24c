"""The table of quantities: what a mechanism is compiled to, and what an emitted module gives.

Kernels, programs, the interpreter, the targets, the contract of an emitted module, its compiled
functions and its verification go through this table. A new quantity is one entry here and the code
that computes it: outputs of that name in the kernels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Mapping

FORMAT = 2
"""The format of emitted modules, as docs/architecture.md has it."""

Rows = Literal["equations", "coordinates", "outputs"]
Columns = Literal["none", "coordinates", "parameters"]


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
        What it depends on: ``q``, ``q_dot``, ``t`` and ``p``.
    adds
        Whether several constraints contribute to one entry, so that contributions are added;
        otherwise an entry belongs to one constraint.
    about
        A sentence for the comments of emitted code.
    """

    name: str
    rows: Rows
    columns: Columns
    reads: tuple[str, ...]
    adds: bool
    about: str

    @property
    def is_matrix(self) -> bool:
        """Whether it has columns, and of its entries only those that can differ from zero count."""
        return self.columns != "none"

    @property
    def is_moving(self) -> bool:
        """Whether it depends on the rates q_dot."""
        return "q_dot" in self.reads

    @property
    def arguments(self) -> tuple[str, ...]:
        """The arguments of its function: the rates only where it depends on them."""
        return ("q", "q_dot", "t", "p") if self.is_moving else ("q", "t", "p")


AT_POSITION = ("q", "t", "p")

QUANTITIES: tuple[Quantity, ...] = (
    Quantity("Phi", "equations", "none", AT_POSITION, False, "Constraint vector Phi(q, t)."),
    Quantity("Phi_q", "equations", "coordinates", AT_POSITION, False, "Jacobian of Phi by q."),
    Quantity(
        "nu", "equations", "none", AT_POSITION, False,
        "Right side of the velocity equation Phi_q q_dot = nu = -Phi_t.",
    ),
    Quantity(
        "gamma", "equations", "none", ("q", "q_dot", "t", "p"), False,
        "Right side of the acceleration equation Phi_q q_ddot = gamma.",
    ),
)  # fmt: skip
"""All quantities, in the order in which they are computed."""

TOGETHER: Mapping[str, tuple[str, ...]] = {
    "position": ("Phi", "Phi_q"),
    "velocity": ("Phi_q", "nu"),
    "acceleration": ("Phi_q", "gamma"),
    "kinematics": ("Phi", "Phi_q", "nu", "gamma"),
}
"""Functions that give several quantities at once: the steps of an analysis."""


def quantity_named(name: str) -> Quantity:
    """Return the quantity of a name."""
    return next(item for item in QUANTITIES if item.name == name)


def singles() -> dict[str, tuple[str, ...]]:
    """Return a function for each quantity."""
    return {item.name: (item.name,) for item in QUANTITIES}


def functions() -> dict[str, tuple[str, ...]]:
    """Return the functions of an emitted module, and the quantities that each gives."""
    return {**singles(), **TOGETHER}


def kernels() -> dict[str, tuple[str, ...]]:
    """Return the pieces of code that are emitted, and the quantities that each computes.

    They are ``position``, one for each quantity that is not in it, and ``kinematics``, since most
    of the work of a batch is shared.
    """
    position = TOGETHER["position"]
    single = {name: given for name, given in singles().items() if name not in position}
    return {"position": position, **single, "kinematics": TOGETHER["kinematics"]}


def kernel_of(names: tuple[str, ...]) -> str:
    """Return the first kernel that computes all these quantities."""
    return next(kernel for kernel, given in kernels().items() if set(names) <= set(given))


def nonzeros_of(quantity: Quantity) -> str:
    """Return what compiled code calls the entries of a matrix in the order of its pattern."""
    return "nonzeros" if quantity.name == "Phi_q" else f"{quantity.name}_nonzeros"


def is_moving(names: tuple[str, ...]) -> bool:
    """Return whether any of the quantities depends on the rates q_dot."""
    return any(quantity_named(name).is_moving for name in names)

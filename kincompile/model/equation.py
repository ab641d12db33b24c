"""Free equations Phi(q, t) = 0 in SymPy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kincompile.model import declared as kinds
from kincompile.model.declared import declared, given

if TYPE_CHECKING:
    import sympy

    from kincompile.model.expressions import Scalar


@declared(init=False)
class Equation:
    """One or more free SymPy equations, each understood as ``expression = 0``.

    Parameters
    ----------
    name
        Name of the equation; of several, the rows are called ``name.1``, ``name.2``, ...
    *expressions
        SymPy expressions, or `sympy.Eq`, in coordinates, parameters and `t`.
    corners
        Whether their slope over time may jump: no acceleration is given there.
    """

    name: str = given(kinds.NAME, "Name of the equation.")
    expressions: tuple[Scalar | sympy.Eq, ...] = given(
        kinds.array(kinds.EXPRESSION, 1) | {"description": "a list of formulas"},
        "What is zero, in coordinates, parameters and t.",
    )
    corners: bool = given(kinds.FLAG, "Whether their slope over time may jump.", default=False)

    def __init__(self, name: str, *expressions: Scalar | sympy.Eq, corners: bool = False) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "corners", corners)
        object.__setattr__(self, "expressions", expressions)

    @property
    def equation_names(self) -> tuple[str, ...]:
        """Names of the rows."""
        if len(self.expressions) == 1:
            return (self.name,)
        return tuple(f"{self.name}.{k}" for k in range(1, len(self.expressions) + 1))

"""What a type of load is made of: its arguments, its virtual work and kinetic energy in vectors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, ClassVar

from kincompile.calculus.expressions import ZERO, Symbol, VectorSymbol
from kincompile.derive.loads import LoadTemplate
from kincompile.model.arguments import Kind
from kincompile.model.constraint import Element

if TYPE_CHECKING:
    from kincompile.calculus.expressions import Scalar
    from kincompile.derive.loads import Leaf, Work


@dataclass(frozen=True, repr=False)
class Load(Element):
    """A mass or a force: what stands on the right of the equations of motion.

    A subclass declares its attributes as fields, and its virtual work in vectors. Generalised
    forces, mass matrix and Jacobians follow by differentiation. `Mechanism.add` takes it.
    """

    is_load: ClassVar[bool] = True

    @staticmethod
    def work() -> tuple[Work, ...]:
        """Return forces and displacements, whose products are the virtual work."""
        return ()

    @staticmethod
    def kinetic_energy() -> Scalar:
        """Return the kinetic energy."""
        return ZERO

    @classmethod
    @cache
    def template(cls) -> LoadTemplate:
        """Return the template of this type, made once."""
        given = cls.arguments().values()
        values: tuple[Leaf, ...] = (
            *(Symbol(item.symbol) for item in given if item.kind is Kind.LOAD),
            *(
                VectorSymbol(item.symbol, len(cls.bodies.axes))
                for item in given
                if item.kind is Kind.LOADS
            ),
        )
        return LoadTemplate(
            cls.__name__, cls.frames(), (), (), cls.kinetic_energy(), cls.work(), values
        )

    @property
    def corners(self) -> bool:
        """Whether it is a driver with corners, as no load is."""
        return False

"""What a type of load is made of: its arguments, its virtual work and kinetic energy in vectors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, ClassVar, TypeVar

from kincompile.calculus.expressions import ZERO, Symbol, VectorSymbol
from kincompile.derive.loads import LoadTemplate
from kincompile.derive.rules import along
from kincompile.model.arguments import Kind
from kincompile.model.constraint import Element

if TYPE_CHECKING:
    from kincompile.calculus.expressions import Scalar, Vector
    from kincompile.derive.loads import Leaf, Work
    from kincompile.derive.rules import Direction

    Rated = TypeVar("Rated", Scalar, Vector)


@dataclass(frozen=True, repr=False)
class Load(Element):
    """A mass or a force: what stands on the right of the equations of motion.

    A subclass declares its attributes as fields, and its virtual work in vectors. Generalised
    forces, mass matrix and Jacobians follow by differentiation. `Mechanism.add` takes it.
    """

    is_load: ClassVar[bool] = True

    @classmethod
    def work(cls) -> tuple[Work, ...]:
        """Return forces and displacements, whose products are the virtual work."""
        return ()

    @classmethod
    def kinetic_energy(cls) -> Scalar:
        """Return the kinetic energy."""
        return ZERO

    @classmethod
    def vector(cls, name: str) -> VectorSymbol:
        """Return a vector of as many components as points of its bodies have."""
        return VectorSymbol(name, len(cls.bodies.axes))

    @classmethod
    def points(cls) -> tuple[Vector, ...]:
        """Return the points on its bodies: r_i + A_i s_i, and that of body j."""
        return tuple(frame.point(cls.vector(f"s_{frame.index}")) for frame in cls.frames())

    @classmethod
    def rate_of(cls, expression: Rated) -> Rated:
        """Return the rate of an expression of the coordinates of its bodies along the motion."""
        motion: Direction = {
            coordinate: rate
            for frame in cls.frames()
            for coordinate, rate in zip(frame.coordinates, frame.rates, strict=True)
        }
        return along(expression, motion)

    @classmethod
    @cache
    def template(cls) -> LoadTemplate:
        """Return the template of this type, made once."""
        given = cls.arguments().values()
        values: tuple[Leaf, ...] = (
            *(Symbol(item.symbol) for item in given if item.kind is Kind.LOAD),
            *(cls.vector(item.symbol) for item in given if item.kind is Kind.LOADS),
        )
        return LoadTemplate(
            cls.__name__, cls.frames(), (), (), cls.kinetic_energy(), cls.work(), values
        )

    @property
    def corners(self) -> bool:
        """Whether it is a driver with corners, as no load is."""
        return False

"""The symbols of the textbook: coordinates of bodies i and j, attributes, drivers, profiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from kincompile.calculus.expressions import (
    ONE,
    Basis,
    ProfileFunction,
    Scalar,
    Symbol,
    TimeFunction,
    Vector,
    VectorSymbol,
    rotated,
)
from kincompile.calculus.rotations import PlaneRotation, turned
from kincompile.names import rate

if TYPE_CHECKING:
    from kincompile.calculus.expressions import Expression, Rotation

CoordinateSymbol = VectorSymbol | Symbol

Change = tuple["Expression", "Expression"]
"""A leaf of formulas, and how it changes."""


class Owner:
    """What has coordinates: the frame of a body, or a contact."""

    __slots__ = ()

    def changed(self, coordinate: CoordinateSymbol, change: Expression) -> Change:
        """Return what a change of a coordinate changes in formulas: the coordinate itself."""
        return coordinate, change


@dataclass(frozen=True, slots=True)
class Frame(Owner):
    """The frame of a body: its position r, its orientation, and the rotation that belongs to it."""

    index: str
    letters: ClassVar[tuple[str, ...]]
    """Letters of the coordinates, one a component."""
    ground: ClassVar[tuple[int, ...]]
    """Values of the ground's."""
    size: ClassVar[int]
    """Number of components of a position."""

    @property
    def r(self) -> VectorSymbol:
        """The position of the body's origin."""
        return VectorSymbol(f"r_{self.index}", self.size)

    @property
    def coordinates(self) -> tuple[CoordinateSymbol, ...]:
        """Its generalised coordinates, in order."""
        return self.motion(0)

    @property
    def rates(self) -> tuple[CoordinateSymbol, ...]:
        """Their rates, in the same order."""
        return self.motion(1)

    @property
    def second_rates(self) -> tuple[CoordinateSymbol, ...]:
        """Their second rates, in the same order."""
        return self.motion(2)

    def motion(self, order: int) -> tuple[CoordinateSymbol, ...]:
        """Return the coordinates, or their time derivatives of the given order."""
        raise NotImplementedError

    @property
    def rotation(self) -> Rotation:
        """The rotation matrix A as a function of the coordinates."""
        raise NotImplementedError

    @property
    def turns(self) -> tuple[dict[Expression, Expression], ...]:
        """What its coordinates change by when it turns at unit rates, about its own axes."""
        raise NotImplementedError

    def turned_about(self, axis: Vector) -> Change:
        """Return what changes, and by what, in a turn at unit rate about an axis of its own."""
        raise NotImplementedError

    def along_fixed_axes(self, components: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return a moment along the fixed axes, of one along its own axes."""
        raise NotImplementedError

    def A(self, vector: Vector) -> Vector:  # noqa: N802 - the rotation matrix of the textbook
        """Turn a body-fixed vector into the global frame."""
        return rotated(self.rotation, vector)

    def point(self, fixed: Vector) -> Vector:
        """Return the global position of a body-fixed point, r + A s."""
        return self.r + self.A(fixed)


@dataclass(frozen=True, slots=True)
class PlaneFrame(Frame):
    """The frame of a body in the plane: position r, angle phi, and its rotation."""

    letters: ClassVar[tuple[str, ...]] = ("x", "y", "phi")
    ground: ClassVar[tuple[int, ...]] = (0, 0, 0)
    size: ClassVar[int] = 2

    @property
    def phi(self) -> Symbol:
        """The angle of the body."""
        return Symbol(f"phi_{self.index}")

    def motion(self, order: int) -> tuple[CoordinateSymbol, ...]:
        """Return r and phi, or their time derivatives of the given order."""
        r, phi = (rate(f"{letter}_{self.index}", order) for letter in ("r", "phi"))
        return VectorSymbol(r, self.size), Symbol(phi)

    @property
    def rotation(self) -> Rotation:
        """The rotation by phi."""
        return PlaneRotation(self.phi)

    @property
    def turns(self) -> tuple[dict[Expression, Expression], ...]:
        """A turn in the plane."""
        return ({self.phi: ONE},)

    def along_fixed_axes(self, components: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return them: the one axis, normal to the plane, is fixed."""
        return components


@dataclass(frozen=True, slots=True)
class Contact(Owner):
    """The contact parameter of a cam profile in polar form, a(alpha) = rho(alpha) u(alpha)."""

    index: str
    letters: ClassVar[tuple[str, ...]] = ("alpha",)
    ground: ClassVar[tuple[int, ...]] = (0,)

    @property
    def alpha(self) -> Symbol:
        """The polar angle of the contact point, a generalised coordinate."""
        return Symbol(f"alpha_{self.index}")

    @property
    def coordinates(self) -> tuple[CoordinateSymbol, ...]:
        """Its one generalised coordinate."""
        return (self.alpha,)

    @property
    def rates(self) -> tuple[CoordinateSymbol, ...]:
        """The rate of it."""
        return (Symbol(f"alpha_{self.index}_dot"),)

    @property
    def rotation(self) -> Rotation:
        """What turns e_x into the direction of the contact."""
        return PlaneRotation(self.alpha)

    def rho(self, order: int = 0) -> ProfileFunction:
        """Return the polar radius, or its derivative of the given order."""
        return ProfileFunction(f"rho_{self.index}", self.alpha, order)

    @property
    def a(self) -> Vector:
        """The contact point from the profile's centre, in the body's frame."""
        return self.rho() * unit(self.alpha)

    @property
    def g(self) -> Vector:
        """The tangent a'(alpha), in the body's frame."""
        return self.rho(1) * unit(self.alpha) + self.rho() * turned(self.alpha, Basis(), 1)


def unit(angle: Scalar) -> Vector:
    """Return u(angle) = (cos angle, sin angle)."""
    return turned(angle, Basis())


i, j = PlaneFrame("i"), PlaneFrame("j")
contact_i, contact_j = Contact("i"), Contact("j")
s_i, s_j, v_i, v_j = (VectorSymbol(name) for name in ("s_i", "s_j", "v_i", "v_j"))
s_P, s_Q, c = (VectorSymbol(name) for name in ("s_P", "s_Q", "c"))
R_i, R_j, theta_i, theta_j = (Symbol(name) for name in ("R_i", "R_j", "theta_i", "theta_j"))
C = TimeFunction("C")

"""The template of a constraint type: Phi of bodies i and j with every attribute symbolic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.calculus.expressions import Expression
    from kincompile.calculus.symbols import Contact, CoordinateSymbol, Frame


@dataclass(frozen=True, slots=True)
class Template:
    """Phi of a constraint type in vectors, with its generalised coordinates."""

    type_name: str  # name of the constraint type, for instance ``Revolute``
    frames: tuple[Frame, ...]
    contacts: tuple[Contact, ...]
    # One expression per row block: a vector is two equations, a scalar one.
    Phi: tuple[Expression, ...]

    def __hash__(self) -> int:
        # Templates are keys of the kernel cache; walking the whole expression each time is slow.
        return hash(self.type_name)

    @property
    def owners(self) -> tuple[Frame | Contact, ...]:
        """What has coordinates, in their order: the bodies, then the contacts."""
        return *self.frames, *self.contacts

    @property
    def dimension(self) -> int:
        """Number of components of a vector: 2 in the plane, 3 in space."""
        return self.frames[0].size if self.frames else 2

    @property
    def coordinates(self) -> tuple[CoordinateSymbol, ...]:
        """The generalised coordinates: r and phi of each body, then the contact parameters."""
        return tuple(item for owner in self.owners for item in owner.coordinates)

    def direction(
        self, changes: Mapping[CoordinateSymbol, Expression]
    ) -> dict[Expression, Expression]:
        """Return how the leaves of Phi change where some coordinates do."""
        return dict(
            owner.changed(item, changes[item])
            for owner in self.owners
            for item in owner.coordinates
            if item in changes
        )

    @property
    def motion(self) -> dict[Expression, Expression]:
        """How the leaves of Phi change with the rates of all coordinates."""
        return self.direction(dict(zip(self.coordinates, self.rates, strict=True)))

    @property
    def rates(self) -> tuple[CoordinateSymbol, ...]:
        """The rates of the generalised coordinates, in the same order."""
        return tuple(item for owner in self.owners for item in owner.rates)

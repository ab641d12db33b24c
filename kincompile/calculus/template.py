"""The template of a constraint type: Phi of bodies i and j with every attribute symbolic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kincompile.calculus.expressions import Expression, Symbol, VectorSymbol
    from kincompile.calculus.symbols import Contact, Frame


@dataclass(frozen=True, slots=True)
class Template:
    """Phi of a constraint type in vectors, with its generalised coordinates.

    Attributes
    ----------
    type_name
        Name of the constraint type, for instance ``Revolute``.
    frames
        Bodies i, or i and j.
    contacts
        Contact parameters of cam profiles.
    Phi
        One expression per row block: a vector is two equations, a scalar one.
    """

    type_name: str
    frames: tuple[Frame, ...]
    contacts: tuple[Contact, ...]
    Phi: tuple[Expression, ...]

    def __hash__(self) -> int:
        # Templates are keys of the kernel cache; walking the whole expression each time is slow.
        return hash(self.type_name)

    @property
    def coordinates(self) -> tuple[VectorSymbol | Symbol, ...]:
        """The generalised coordinates: r and phi of each body, then the contact parameters."""
        bodies = [leaf for frame in self.frames for leaf in (frame.r, frame.phi)]
        return (*bodies, *(contact.alpha for contact in self.contacts))

    @property
    def rates(self) -> tuple[VectorSymbol | Symbol, ...]:
        """The rates of the generalised coordinates, in the same order."""
        bodies = [leaf for frame in self.frames for leaf in (frame.r_dot, frame.phi_dot)]
        return (*bodies, *(contact.alpha_dot for contact in self.contacts))

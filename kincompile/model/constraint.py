"""What a constraint type is made of: its arguments, its Phi as a template, names of its rows."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import Enum
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

import sympy

from kincompile.calculus.symbols import Contact, Frame
from kincompile.calculus.template import Template

if TYPE_CHECKING:
    from kincompile.calculus.expressions import Expression


class Kind(Enum):
    """What an argument of a constraint is."""

    BODY = "a body"
    POINT = "a point (xi, eta) in the body's frame"
    AXIS = "a direction (xi, eta) in the body's frame, not zero"
    SCALAR = "a number or an expression of parameters"
    RADIUS = "a radius, not zero"
    VALUE = "a number or an expression of parameters and t"
    DISTANCE = "a positive distance, or an expression of parameters and t"
    PROFILE = "a radius rho(alpha) or a table (angles, radii)"


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument of a constraint type: its kind and its symbol in the textbook's formula."""

    kind: Kind
    symbol: str


def argument(kind: Kind, symbol: str) -> Any:
    """Declare a field of a constraint type."""
    return field(metadata={"argument": Argument(kind, symbol)})


@dataclass(frozen=True)
class Constraint:
    """A joint, or a driver where its value is a function of `t`. Every type is a subclass.

    A subclass declares its attributes as fields, in the book's order, and its Phi in vectors.
    Nothing else: Phi_q, nu and gamma follow by differentiation. Its arguments are checked together
    with the whole mechanism, by `Mechanism.system`.
    """

    name: str

    source: ClassVar[str] = ""
    """Where the textbook has it."""
    row_names: ClassVar[tuple[str, ...]] = ()
    """Names of the equations where there is more than one."""
    contacts: ClassVar[tuple[Contact, ...]] = ()
    """Contact parameters: coordinates that the constraint brings along."""

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return the constraint in vectors, with the attributes as symbols."""
        raise NotImplementedError

    @classmethod
    @cache
    def arguments(cls) -> dict[str, Argument]:
        """Return the arguments by field name, in order."""
        return {
            item.name: item.metadata["argument"]
            for item in fields(cls)
            if "argument" in item.metadata
        }

    @classmethod
    @cache
    def template(cls) -> Template:
        """Return the template of this type, made once."""
        frames = tuple(
            Frame(item.symbol) for item in cls.arguments().values() if item.kind is Kind.BODY
        )
        return Template(cls.__name__, frames, cls.contacts, cls.Phi())

    @property
    def equation_names(self) -> tuple[str, ...]:
        """Names of the constraint's equations: its own, or with the row appended."""
        if not self.row_names:
            return (self.name,)
        return tuple(f"{self.name}.{row}" for row in self.row_names)

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Names of the contact parameters, `alpha_<name>` or `alpha_i_<name>`, `alpha_j_<name>`."""
        if len(self.contacts) == 1:
            return (f"alpha_{self.name}",)
        return tuple(f"alpha_{contact.index}_{self.name}" for contact in self.contacts)


@dataclass(frozen=True)
class CamConstraint(Constraint):
    """A constraint with contact parameters, whose guess it carries."""

    guess: Any = field(default=None, kw_only=True)

    @property
    def alpha(self) -> sympy.Symbol:
        """Symbol of the contact parameter; of two, the one on body i."""
        return sympy.Symbol(self.contact_names[0])

    @property
    def alphas(self) -> tuple[sympy.Symbol, ...]:
        """Symbols of all contact parameters, body i first."""
        return tuple(sympy.Symbol(name) for name in self.contact_names)

"""What a constraint type is made of: its arguments, its Phi as a template, names of its rows."""

from __future__ import annotations

import inspect
import textwrap
from dataclasses import dataclass, field, fields
from functools import cache, wraps
from typing import TYPE_CHECKING, ClassVar, TypeVar, dataclass_transform

import sympy

from kincompile.calculus.symbols import Contact  # noqa: TC001 - type hints are there at run time
from kincompile.calculus.template import Template
from kincompile.html import Shown
from kincompile.model import arguments as argument
from kincompile.model import declared as kinds
from kincompile.model.arguments import Argument, Kind, ValueLike
from kincompile.model.bodies import GROUND, PLANAR, Body, BodyKind
from kincompile.model.declared import declared, declared_fields, given
from kincompile.model.points import BodyPoint

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.calculus.expressions import Expression
    from kincompile.calculus.symbols import Frame
    from kincompile.model.expressions import Scalar

    Numbers = Callable[[str], tuple[float | None, ...]]
    """Gives the numbers of a scalar or a point, by its symbol; None for one that is unknown."""

Type = TypeVar("Type", bound="Element")


@dataclass(frozen=True, repr=False)
class Element(Shown):
    """What has a name and arguments: a constraint, or a load.

    Its arguments are checked together with the whole mechanism, by `Mechanism.system`.
    """

    name: str

    source: ClassVar[str] = ""
    """Where the textbook has it."""
    known_as: ClassVar[str] = ""
    """What engineers call it, and search for, separated by commas."""
    positive: ClassVar[str] = ""
    """Which way its value counts, or what the guess decides."""
    use: ClassVar[tuple[str, str]] = ("", "")
    """How it is written, in two lines for a mechanism `m`: its bodies, and the constraint."""
    bodies: ClassVar[BodyKind] = PLANAR
    """The kind of bodies that it connects."""
    contacts: ClassVar[tuple[Contact, ...]] = ()
    """Contact parameters: coordinates that belong to the element."""
    contact_letter: ClassVar[str] = "alpha"
    """Letter of their names."""
    is_load: ClassVar[bool] = False
    """Whether it is a mass or a force, which adds no equation."""

    def to_text(self) -> str:
        """Return its name and arguments, bodies by name."""
        given = [(getattr(self, item.name), item.default) for item in fields(self)[1:]]
        kept = [value for value, default in given if value is not default]
        written = (str(getattr(item, "name", item)) for item in kept)
        return f"{self.name}: {', '.join(written)}"

    def __repr__(self) -> str:
        """Return type, name and arguments."""
        return f"<{type(self).__name__} {self.to_text()}>"

    @staticmethod
    def problem(numbers: Numbers) -> str | None:
        """Return what is wrong with several arguments together; each alone is good."""
        del numbers
        return None

    @classmethod
    def misplaced(
        cls,
        bodies: Sequence[Body],
        points: Mapping[str, tuple[Scalar, ...]],
        defaults: Mapping[str, float],
    ) -> str | None:
        """Return why it cannot hold its bodies as their guesses have them."""
        del bodies, points, defaults
        return None

    @staticmethod
    def completed(
        points: Mapping[str, tuple[Scalar, ...]], defaults: Mapping[str, float]
    ) -> Mapping[str, tuple[Scalar, ...]]:
        """Return points and directions as the template has them, from those that were given."""
        del defaults
        return points

    def with_own(self) -> tuple[Element, ...]:
        """Return what `Mechanism.add` adds: what it brings with it, then itself."""
        return (self,)

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
    def point_on(cls, body: str) -> str:
        """Return the argument that is the first point on the body that an argument names."""
        given = cls.arguments()
        points = (key for key, item in given.items() if item.kind is Kind.POINT)
        return next((key for key in points if given[key].on == given[body].symbol), body)

    @classmethod
    @cache
    def frames(cls) -> tuple[Frame, ...]:
        """Return the frames of the bodies that it connects."""
        bodies = [item.symbol for item in cls.arguments().values() if item.kind is Kind.BODY]
        return tuple(cls.bodies.frame(symbol) for symbol in bodies)

    @classmethod
    def further(cls) -> dict[str, str]:
        """Return the texts of a docstring for the name and other arguments of all types."""
        return {"name": "Name of the load."}


@declared(repr=False)
class Constraint(Element):
    """A joint, or a driver; see `Joint.is_driver`. Every type is a subclass.

    A subclass declares its attributes as fields, in the book's order, and its Phi in vectors.
    Phi_q, nu and gamma follow by differentiation. The types that come with the package are in
    `catalogue`.
    """

    corners: bool = given(
        kinds.FLAG,
        "Of a driver, whether its velocity may jump: no acceleration is given there.",
        default=False,
        kw_only=True,
    )

    sets_motion: ClassVar[bool] = False
    """Whether its value is an angle or a stroke that a motor sets: given by parameters alone, it is
    a driver too, where another value is a dimension."""
    driven_by: ClassVar[type[Constraint] | None] = None
    """A type of driver: beside one of the same bodies and directions `beside_driver` holds."""
    row_names: ClassVar[tuple[str, ...]] = ()
    """Names of the equations where there is more than one."""
    simpler: ClassVar[tuple[tuple[str, type[Constraint]], ...]] = ()
    """Pairs: where this one of two equations depends on others, the type that keeps the other."""
    is_own: ClassVar[bool] = False
    """Whether it is an equation of a body itself, which no joint makes superfluous."""
    replaced_by: ClassVar[str] = "a {simpler}, which keeps {kept}"
    """The advice to take the simpler type, in words."""

    @staticmethod
    def Phi() -> tuple[Expression, ...]:
        """Return the constraint in vectors, with the attributes as symbols."""
        raise NotImplementedError

    @classmethod
    @cache
    def owners(cls) -> dict[str, str]:
        """Return, by the symbol of each point and direction, that of the body it is fixed in."""
        return {item.symbol: item.on for item in cls.arguments().values() if item.on}

    @classmethod
    @cache
    def partners(cls) -> dict[str, str]:
        """Return, by the symbol of a point or an axis, the one that is easily taken for it.

        Of two on one body each is the other's; else those of one kind on two bodies are.
        """
        found: dict[str, str] = {}
        for kind in (Kind.POINT, Kind.AXIS):
            by_body: dict[str, list[str]] = {}
            for item in cls.arguments().values():
                if item.kind is kind and item.on != GROUND.name:
                    by_body.setdefault(item.on, []).append(item.symbol)
            alone = [symbols[0] for symbols in by_body.values() if len(symbols) == 1]
            for pair in (*by_body.values(), alone):
                if len(pair) == 2:
                    found |= {pair[0]: pair[1], pair[1]: pair[0]}
        return found

    @classmethod
    @cache
    def template(cls) -> Template:
        """Return the template of this type, made once."""
        return Template(cls.__name__, cls.frames(), cls.contacts, cls.Phi())

    @classmethod
    @cache
    def driven_template(cls) -> Template:
        """Return the template of this type beside a driver, made once."""
        return Template(cls.__name__, cls.frames(), cls.contacts, cls.beside_driver())

    @staticmethod
    def beside_driver() -> tuple[Expression, ...]:
        """Return the constraint in vectors beside a driver of type `driven_by`, with its C."""
        raise NotImplementedError

    @classmethod
    def keeping_others(cls, lost: Sequence[str]) -> type[Constraint] | None:
        """Return the type that keeps its equations but those rows, where there is one."""
        return next((other for row, other in cls.simpler if [row] == list(lost)), None)

    def drivers(self, points: Mapping[str, tuple[Scalar, ...]]) -> tuple[Constraint, ...]:
        """Return drivers of the freedoms that it leaves, of value 0, given its resolved points."""
        del points
        return ()

    def measured(self, points: Mapping[str, tuple[Scalar, ...]]) -> Constraint | None:
        """Return the driver of value 0 whose Phi is the value of the joint, where it has one."""
        own = self.drivers(points)
        return own[0] if len(own) == 1 else None

    @classmethod
    def equations_of(cls, name: str) -> tuple[str, ...]:
        """Return the names of its equations: its own, or with the row appended."""
        return tuple(f"{name}.{row}" for row in cls.row_names) or (name,)

    @classmethod
    def contacts_of(cls, name: str) -> tuple[str, ...]:
        """Return the names of contact parameters: ``alpha_<name>``; of two ``alpha_i_<name>``."""
        if len(cls.contacts) == 1:
            return (f"{cls.contact_letter}_{name}",)
        return tuple(f"{cls.contact_letter}_{contact.index}_{name}" for contact in cls.contacts)

    @property
    def equation_names(self) -> tuple[str, ...]:
        """Names of the constraint's equations."""
        return self.equations_of(self.name)

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Names of the contact parameters."""
        return self.contacts_of(self.name)

    @classmethod
    def further(cls) -> dict[str, str]:
        """Return what its docstring says of its name, of contacts and of corners."""
        equations = _listed("equation", cls.equations_of("name"))
        entries = {"name": f"Name of the constraint; its {equations}."}
        if cls.contacts:
            what = "contact parameter" if cls.contact_letter == "alpha" else "coordinate"
            contacts = _listed(what, cls.contacts_of("name"))
            start = "Where Newton's method begins [rad], 0 if not given"
            entries["guess"] = f"{start}; the {contacts}."
        return entries | {"corners": declared_fields(cls)["corners"].words}


@dataclass_transform(
    frozen_default=True,
    field_specifiers=(
        argument.angle, argument.attribute, argument.axis, argument.body, argument.cross,
        argument.distance, argument.load, argument.loads, argument.measured, argument.point,
        argument.profile, argument.radius, argument.value, argument.vector, field,
    ),
)  # fmt: skip
def constraint_type(cls: type[Type]) -> type[Type]:
    """Make a class a type of constraint or load: a dataclass whose docstring has its arguments."""
    made = dataclass(frozen=True, repr=False)(cls)
    made.__doc__ = _documentation(made)
    _take_points(made)
    return made


def _take_points(cls: type[Element]) -> None:
    """Let a named point stand where a type wants a body and a point on it."""
    init = cls.__init__

    @wraps(init)
    def taking_points(self: Element, *given: object, **named: object) -> None:
        flat: list[object] = []
        for item in given:
            flat += (item.body, item.local) if isinstance(item, BodyPoint) else (item,)
        for key, item in list(named.items()):
            if isinstance(item, BodyPoint):
                named |= {key: item.body, cls.point_on(key): item.local}
        init(self, *flat, **named)  # type: ignore[arg-type]

    cls.__init__ = taking_points  # type: ignore[method-assign]


def _documentation(cls: type[Element]) -> str:
    """Return the docstring of a type with its arguments, in NumPy's form."""
    given = cls.arguments()
    bodies = {item.symbol: name for name, item in given.items() if item.kind is Kind.BODY}
    ground = "; one of the two may be the ground" if len(bodies) > 1 else ""
    further = cls.further()
    entries = {"name": further.pop("name")}
    for name, item in given.items():
        on = bodies.get(item.on, "")
        place = _place(cls.bodies, item.on, on)
        entries[name] = item.text.format(on=on, ground=ground, place=place)
    entries |= further
    lines = [inspect.cleandoc(cls.__doc__ or ""), "", "Parameters", "----------"]
    for name, text in entries.items():
        lines += [name, textwrap.fill(text, 92, initial_indent="    ", subsequent_indent="    ")]
    return "\n".join(lines)


def _place(kind: BodyKind, on: str, body: str) -> str:
    """Return the coordinates of a point or a direction, and whose they are, in words."""
    if on == GROUND.name:
        return f"({', '.join('xyz'[: len(kind.axes)])}) of the ground"
    return f"({', '.join(kind.axes)}) in the frame of {body}"


def _listed(what: str, names: Sequence[str]) -> str:
    called = ", ".join(f"``{name}``" for name in names)
    return f"{what}s are {called}" if len(names) > 1 else f"{what} is {called}"


@dataclass(frozen=True, repr=False)
class CamConstraint(Constraint):
    """A constraint with contact parameters, whose guess it carries."""

    guess: ValueLike | tuple[ValueLike, ...] | None = field(default=None, kw_only=True)

    @property
    def alpha(self) -> sympy.Symbol:
        """Symbol of the contact parameter; of two, the one on body i."""
        return sympy.Symbol(self.contact_names[0])

    @property
    def alphas(self) -> tuple[sympy.Symbol, ...]:
        """Symbols of all contact parameters, body i first."""
        return tuple(sympy.Symbol(name) for name in self.contact_names)

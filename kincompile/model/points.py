"""Points of bodies: r + A s, whose coordinates and rates are expressions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, cast

import sympy
from sympy.printing.precedence import PRECEDENCE

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import VectorSymbol
from kincompile.calculus.symbols import i
from kincompile.calculus.template import Template
from kincompile.model import declared as kinds
from kincompile.model.declared import declared, given
from kincompile.model.expressions import as_sympy
from kincompile.model.symbolic import SymbolicEnvironment

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.calculus.symbols import Frame
    from kincompile.model.bodies import Body
    from kincompile.model.expressions import Scalar, Scalars


@cache
def point_template(frame: Frame) -> Template:
    """Return the global coordinates of a point of body i with such a frame, r + A s."""
    return Template("Point", (frame,), (), (frame.point(VectorSymbol("s_i", frame.size)),))


class rate(sympy.Function):  # noqa: N801 - a function for those who write expressions
    """The time derivative of an expression along the motion, in an output.

    ``kc.outputs.rate(foot.x)`` is the velocity of a point along x, the rate of that its
    acceleration.
    """

    nargs = 1


class WrittenOut(sympy.Function):
    """A function whose derivatives the compiler knows; everybody else sees elementary functions."""

    precedence: ClassVar[int] = PRECEDENCE["Atom"]
    brackets: ClassVar[str] = "({})"

    def written_out(self) -> sympy.Expr:
        """Return it in elementary functions."""
        raise NotImplementedError

    def _eval_derivative(self, symbol: sympy.Symbol) -> sympy.Expr:
        return cast("sympy.Expr", self.written_out().diff(symbol))

    def _eval_evalf(self, prec: int) -> Any:
        return self.written_out().evalf(max(15, int(prec / 3.33)))

    def doit(self, **hints: bool) -> sympy.Expr:
        """Return it in elementary functions."""
        return cast("sympy.Expr", self.written_out().doit(**hints))

    def _printed(self, printer: Any) -> str:
        return self.brackets.format(printer.doprint(self.written_out()))

    # In texts, and in what `lambdify` makes.
    _sympystr = _lambdacode = _numpycode = _mpmathcode = _pythoncode = _scipycode = _printed

    def _latex(self, printer: Any) -> str:
        return rf"\left({printer.doprint(self.written_out())}\right)"


class PointCoordinate(WrittenOut):
    """A global coordinate of a point, as a function of the body's, of its angle and of xi, eta.

    The compiler has its derivatives from the vectors. It is one of `point_x` and `point_y`. In
    space there are the Euler parameters in place of the angle, and zeta.
    """

    nargs = 4
    frame: ClassVar[Frame] = i
    row: ClassVar[int]

    @classmethod
    def eval(cls, *args: sympy.Expr) -> sympy.Expr | None:
        """Write out what is at no coordinates."""
        moving = args[: len(args) - cls.frame.size]
        is_free = all(isinstance(item, sympy.Symbol) for item in moving)
        return None if is_free else _entry(cls.frame, cls.row, args)

    @property
    def moving(self) -> dict[int, sympy.Symbol]:
        """What moves in it, by the number of the coordinate of its body."""
        size = self.frame.size
        symbols = cast("tuple[sympy.Symbol, ...]", self.args)
        return dict(zip((self.row, *range(size, len(self.frame.letters))), symbols, strict=False))

    @property
    def local(self) -> tuple[sympy.Basic, ...]:
        """Its place in the frame of its body."""
        return self.args[len(self.args) - self.frame.size :]

    def written_out(self) -> sympy.Expr:
        """Return it in cosine and sine."""
        return _entry(self.frame, self.row, self.args)


class point_x(PointCoordinate):  # noqa: N801
    """The x coordinate of a point (xi, eta) of a body at x that has turned by phi."""

    row = 0


class point_y(PointCoordinate):  # noqa: N801
    """The y coordinate of a point (xi, eta) of a body at y that has turned by phi."""

    row = 1


LOCAL = ("xi", "eta", "zeta")


def _entry(frame: Frame, row: int, args: tuple[sympy.Basic, ...]) -> sympy.Expr:
    """Return an entry of r + A s, written out."""
    names = frame.letters[row], *frame.letters[frame.size :], *LOCAL[: frame.size]
    given = dict(zip(sympy.symbols(names), args, strict=True))
    return cast("sympy.Expr", _written(frame, row).xreplace(given))


@cache
def _written(frame: Frame, row: int) -> sympy.Expr:
    """Return an entry of r + A s in symbols of the coordinates and of xi, eta, zeta."""
    local = sympy.symbols(LOCAL[: frame.size])
    return PlacedPoint("", frame.letters, local, frame=frame).expressions[row]


def written_out(value: sympy.Expr) -> sympy.Expr:
    """Return an expression in elementary functions."""
    found = value.atoms(WrittenOut)
    plain: sympy.Expr = value.xreplace({item: item.written_out() for item in found})
    return plain


@dataclass(frozen=True, slots=True)
class OutputColumn:
    """A row of the outputs: a column of a solution."""

    name: str
    unit: str


class Observed:
    """What is asked of a mechanism: it drives nothing, and a module says no more than its name."""

    __slots__ = ()
    text: ClassVar[str] = ""
    source: ClassVar[str] = "output"
    is_driver: ClassVar[bool] = False
    corners: ClassVar[bool] = False


@dataclass(frozen=True, slots=True)
class PlacedPoint(Observed):
    """A point that is known to be good: r + A s with the names of its body."""

    name: str
    columns: tuple[str | None, ...]  # names of the body's coordinates, None for those of the ground
    local: tuple[Scalar, ...]  # xi and eta
    bodies: tuple[Body, ...] = ()
    rows: tuple[OutputColumn, ...] = ()  # the outputs that its coordinates are
    frame: Frame = i

    scalars: ClassVar[Mapping[str, Scalar]] = {}
    profiles: ClassVar[Mapping[str, sympy.Expr]] = {}

    @property
    def template(self) -> Template:
        """The vectors."""
        return point_template(self.frame)

    @property
    def points(self) -> Mapping[str, tuple[Scalar, ...]]:
        """Its place by the symbol in the template."""
        return {"s_i": self.local}

    @property
    def expressions(self) -> tuple[sympy.Expr, ...]:
        """Its coordinates, written out."""
        expansion = Expansion(SymbolicEnvironment(self), self.frame.size)
        return expansion.components(self.template.Phi[0])


@declared(slots=True)
class BodyPoint:
    """A named point P of a body, at (xi, eta) in its frame [length]; made by `Mechanism.point`.

    It may stand where a joint wants a body and a point on it, ``Revolute("B", foot, rod, (0, 0))``.
    A solution has its columns ``x_foot`` and ``y_foot``, which are called ``foot.x`` and ``foot.y``
    too, and their rates.
    """

    name: str = given(kinds.NAME, "Name of the point.")
    body: Body = given(kinds.NAME, "Name of its body.")
    local: Scalars = given(
        kinds.components(2, words="[xi, eta]"), "Its place in the body's frame.", unit="length"
    )

    functions: ClassVar[tuple[type[PointCoordinate], ...]] = (point_x, point_y)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of its columns."""
        return tuple(f"{axis}_{self.name}" for axis in "xyz"[: len(self.body.kind.axes)])

    @property
    def coordinates(self) -> tuple[sympy.Expr, ...]:
        """Its global coordinates as expressions."""
        symbols, size = self.body.symbols, len(self.functions)
        try:
            local = [as_sympy(value) for value in self.local]
            found = tuple(
                kind(origin, *symbols[size:], *local)
                for kind, origin in zip(self.functions, symbols[:size], strict=True)
            )
        except (TypeError, ValueError, sympy.SympifyError):
            return (sympy.S.Zero,) * size  # the check of the mechanism says what is wrong with it
        return found

    @property
    def x(self) -> sympy.Expr:
        """Its global x coordinate as an expression."""
        return self.coordinates[0]

    @property
    def y(self) -> sympy.Expr:
        """Its global y coordinate as an expression."""
        return self.coordinates[1]

    @property
    def x_dot(self) -> sympy.Expr:
        """Its velocity along x, for outputs."""
        return cast("sympy.Expr", rate(self.x))

    @property
    def y_dot(self) -> sympy.Expr:
        """Its velocity along y, for outputs."""
        return cast("sympy.Expr", rate(self.y))

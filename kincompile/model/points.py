"""Points of bodies: r + A s, whose coordinates and rates are expressions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, cast

import sympy
from sympy.printing.precedence import PRECEDENCE

from kincompile.calculus.expand import Expansion
from kincompile.calculus.symbols import i, s_i
from kincompile.calculus.template import Template
from kincompile.model.expressions import as_sympy
from kincompile.model.symbolic import SymbolicEnvironment

if TYPE_CHECKING:
    from collections.abc import Mapping

    from kincompile.model.bodies import Body
    from kincompile.model.expressions import Scalar, Scalars

POINT = Template("Point", (i,), (), (i.point(s_i),))
"""The global coordinates of a point of a body, r + A s."""


class rate(sympy.Function):  # noqa: N801 - a function for those who write expressions
    """The time derivative of an expression along the motion, in an output.

    ``kc.outputs.rate(foot.x)`` is the velocity of a point along x, the rate of that its
    acceleration.
    """

    nargs = 1


class PointCoordinate(sympy.Function):
    """A global coordinate of a point, as a function of the body's, of its angle and of xi, eta.

    The compiler has its derivatives from the vectors, and so need not expand it; everybody else
    sees cosine and sine. It is one of `point_x` and `point_y`.
    """

    nargs = 4
    row: ClassVar[int]
    precedence: ClassVar[int] = PRECEDENCE["Atom"]

    @classmethod
    def eval(cls, *args: sympy.Expr) -> sympy.Expr | None:
        """Write out what is at no coordinates."""
        is_free = isinstance(args[0], sympy.Symbol) and isinstance(args[1], sympy.Symbol)
        return None if is_free else _entry(cls.row, args)

    def written_out(self) -> sympy.Expr:
        """Return it in cosine and sine."""
        return _entry(self.row, self.args)

    def _eval_derivative(self, symbol: sympy.Symbol) -> sympy.Expr:
        return cast("sympy.Expr", self.written_out().diff(symbol))

    def _eval_evalf(self, prec: int) -> Any:
        return self.written_out().evalf(max(15, int(prec / 3.33)))

    def doit(self, **hints: bool) -> sympy.Expr:
        """Return it in cosine and sine."""
        return cast("sympy.Expr", self.written_out().doit(**hints))

    def _printed(self, printer: Any) -> str:
        return f"({printer.doprint(self.written_out())})"

    # In texts, and in what `lambdify` makes.
    _sympystr = _lambdacode = _numpycode = _mpmathcode = _pythoncode = _scipycode = _printed

    def _latex(self, printer: Any) -> str:
        return rf"\left({printer.doprint(self.written_out())}\right)"


class point_x(PointCoordinate):  # noqa: N801
    """The x coordinate of a point (xi, eta) of a body at x that has turned by phi."""

    row = 0


class point_y(PointCoordinate):  # noqa: N801
    """The y coordinate of a point (xi, eta) of a body at y that has turned by phi."""

    row = 1


def _entry(row: int, args: tuple[sympy.Basic, ...]) -> sympy.Expr:
    """Return an entry of r + A s, written out."""
    origin, *others = sympy.symbols(("xy"[row], "phi", "xi", "eta"))
    given = dict(zip((origin, *others), args, strict=True))
    return cast("sympy.Expr", _written(row).xreplace(given))


@cache
def _written(row: int) -> sympy.Expr:
    """Return an entry of r + A s in symbols x, y, phi, xi, eta."""
    return PlacedPoint("", ("x", "y", "phi"), sympy.symbols("xi eta")).expressions[row]


def written_out(value: sympy.Expr) -> sympy.Expr:
    """Return an expression with the coordinates of points in cosine and sine."""
    found = value.atoms(PointCoordinate)
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
    """A point that is known to be good: r + A s with the names of its body.

    Attributes
    ----------
    name
        Name of the point.
    columns
        Names of the body's coordinates, None for those of the ground.
    local
        xi and eta.
    bodies
        The body.
    rows
        The outputs that its coordinates are.
    """

    name: str
    columns: tuple[str | None, ...]
    local: tuple[Scalar, ...]
    bodies: tuple[Body, ...] = ()
    rows: tuple[OutputColumn, ...] = ()

    template: ClassVar[Template] = POINT
    scalars: ClassVar[Mapping[str, Scalar]] = {}
    profiles: ClassVar[Mapping[str, sympy.Expr]] = {}

    @property
    def points(self) -> Mapping[str, tuple[Scalar, ...]]:
        """Its place by the symbol in the template."""
        return {s_i.name: self.local}

    @property
    def expressions(self) -> tuple[sympy.Expr, ...]:
        """Its coordinates, written out."""
        return Expansion(SymbolicEnvironment(self)).components(POINT.Phi[0])


@dataclass(frozen=True, slots=True)
class BodyPoint:
    """A named point P of a body, at (xi, eta) in its frame [length]; made by `Mechanism.point`.

    It may stand where a joint wants a body and a point on it, ``Revolute("B", foot, rod, (0, 0))``.
    A solution has its columns ``x_foot`` and ``y_foot``, which are called ``foot.x`` and ``foot.y``
    too, and their rates.
    """

    name: str
    body: Body
    local: Scalars

    @property
    def output_names(self) -> tuple[str, str]:
        """Names of its columns."""
        return f"x_{self.name}", f"y_{self.name}"

    def _coordinate(self, kind: type[PointCoordinate], origin: sympy.Expr) -> sympy.Expr:
        """Return an entry of r + A s."""
        try:
            xi, eta = (as_sympy(value) for value in self.local)
        except (TypeError, ValueError, sympy.SympifyError):
            return sympy.S.Zero  # the check of the mechanism says what is wrong with it
        return cast("sympy.Expr", kind(origin, self.body.phi, xi, eta))

    @property
    def x(self) -> sympy.Expr:
        """Its global x coordinate as an expression."""
        return self._coordinate(point_x, self.body.x)

    @property
    def y(self) -> sympy.Expr:
        """Its global y coordinate as an expression."""
        return self._coordinate(point_y, self.body.y)

    @property
    def x_dot(self) -> sympy.Expr:
        """Its velocity along x, for outputs."""
        return cast("sympy.Expr", rate(self.x))

    @property
    def y_dot(self) -> sympy.Expr:
        """Its velocity along y, for outputs."""
        return cast("sympy.Expr", rate(self.y))

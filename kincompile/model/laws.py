"""Motion laws as SymPy functions: normalised rises, and tables of values over time.

A normalised law s(u) is 0 up to u = 0, 1 from u = 1 on, and between them a rise of VDI 2143 and
Norton's *Cam Design and Manufacturing Handbook*. A motion is a sum of them:
``y_0 + h*modified_sine((t - t_0)/(t_1 - t_0))``.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import sympy

from kincompile.model.spline import PeriodicSpline, SplineTable

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import TypeAlias

    Piece: TypeAlias = tuple[sympy.Expr, sympy.Expr]

u, ramp = sympy.symbols("u ramp")
"""The symbols in which laws are written out: the argument, and the share of the ramps."""

_pi = sympy.pi


class MotionLaw(sympy.Function):
    """A function of one argument in pieces, with its derivatives; every law is a subclass."""

    title: ClassVar[str] = ""  # what people call the law; "" for the derivative of one
    order: ClassVar[int] = 0  # of a derivative its order
    continuity: ClassVar[int] = 2  # how many derivatives of the law itself are continuous

    @classmethod
    def pieces(cls) -> Sequence[Piece]:
        """Return the pieces in the symbols `u` and `ramp`, each with where it ends."""
        raise NotImplementedError

    @classmethod
    @lru_cache
    def derivative(cls) -> type[MotionLaw]:
        """Return the function that is the derivative by the first argument."""
        made: type[MotionLaw] = type(f"{cls.__name__}'", (cls,), {"order": cls.order + 1})
        return made

    @classmethod
    @lru_cache
    def written_out(cls) -> sympy.Expr:
        """Return the function as a Piecewise in the symbols `u` and `ramp`."""
        *pieces, (_, last) = cls.pieces()
        found = [(value.diff(u, cls.order), u < end) for end, value in pieces]
        # SymPy would solve the conditions for u again, which takes long and changes nothing.
        written: sympy.Expr = sympy.Piecewise(
            *found, (last.diff(u, cls.order), True), evaluate=False
        )
        return written

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        """Return the derivative by an argument."""
        if argindex == 1:
            slope: sympy.Expr = self.derivative()(*self.args)
            return slope
        by_ramp: sympy.Expr = self.in_pieces().diff(self.args[argindex - 1])
        return by_ramp

    def in_pieces(self) -> sympy.Expr:
        """Return the value as a Piecewise in the arguments."""
        given = dict(zip((u, ramp), self.args, strict=False))
        value: sympy.Expr = self.written_out().xreplace(given)
        return value

    def _eval_evalf(self, prec: int) -> sympy.Expr | None:
        if not all(argument.is_number for argument in self.args):
            return None
        value: sympy.Expr = self.in_pieces().evalf(max(15, int(prec / 3.33)))
        return value


class Rise(MotionLaw):
    """A normalised law: it rises from 0 at u = 0 to 1 at u = 1, and s(1 - u) = 1 - s(u)."""

    nargs = 1

    @classmethod
    def first_half(cls) -> Sequence[Piece]:
        """Return the pieces up to u = 1/2 or beyond, each with where it ends."""
        raise NotImplementedError

    @classmethod
    def pieces(cls) -> Sequence[Piece]:
        """Return rest, the first half, its mirror image, and rest again."""
        half = cls.first_half()
        starts = (sympy.S.Zero, *(end for end, _ in half))
        # The last piece given reaches over the middle: its mirror image is itself.
        mirrored = [
            (1 - start, 1 - value.xreplace({u: 1 - u}))
            for start, (_, value) in reversed(list(zip(starts, half[:-1], strict=False)))
        ]
        middle = (1 - starts[-2], half[-1][1])
        return (sympy.S.Zero, sympy.S.Zero), *half[:-1], middle, *mirrored, (sympy.oo, sympy.S.One)


class polynomial_345(Rise):  # noqa: N801 - laws are functions, and written like sin
    """10 u^3 - 15 u^4 + 6 u^5: velocity and acceleration begin and end at zero."""

    title = "polynomial 3-4-5"

    @classmethod
    def first_half(cls) -> Sequence[Piece]:
        """Return the polynomial."""
        return ((sympy.S.One, u**3 * (10 + u * (6 * u - 15))),)


class polynomial_4567(Rise):  # noqa: N801
    """35 u^4 - 84 u^5 + 70 u^6 - 20 u^7: the jerk begins and ends at zero too."""

    title = "polynomial 4-5-6-7"
    continuity = 3

    @classmethod
    def first_half(cls) -> Sequence[Piece]:
        """Return the polynomial."""
        return ((sympy.S.One, u**4 * (35 + u * (u * (70 - 20 * u) - 84))),)


class cycloidal(Rise):  # noqa: N801
    """The sloping sine of VDI 2143: its acceleration is one period of a sine."""

    title = "cycloidal"

    @classmethod
    def first_half(cls) -> Sequence[Piece]:
        """Return u - sin(2 pi u)/(2 pi)."""
        return ((sympy.S.One, u - sympy.sin(2 * _pi * u) / (2 * _pi)),)


class simple_harmonic(Rise):  # noqa: N801
    """Half a cosine; its acceleration jumps where the rise begins and ends."""

    title = "simple harmonic"
    continuity = 1

    @classmethod
    def first_half(cls) -> Sequence[Piece]:
        """Return (1 - cos(pi u))/2."""
        return ((sympy.S.One, (1 - sympy.cos(_pi * u)) / 2),)


class modified_sine(Rise):  # noqa: N801
    """Neklutin's: a sine of short period in the acceleration, one of long period in the middle."""

    title = "modified sine"

    @classmethod
    def first_half(cls) -> Sequence[Piece]:
        """Return the pieces up to 1/8 and 7/8."""
        short = _pi * u - sympy.sin(4 * _pi * u) / 4
        long = 2 + _pi * u - sympy.Rational(9, 4) * sympy.sin((_pi + 4 * _pi * u) / 3)
        eighth = sympy.Rational(1, 8)
        return (eighth, short / (4 + _pi)), (1 - eighth, long / (4 + _pi))


class modified_trapezoid(Rise):  # noqa: N801
    """Neklutin's: a trapezoid in the acceleration, with quarters of sines for its flanks."""

    title = "modified trapezoid"

    @classmethod
    def first_half(cls) -> Sequence[Piece]:
        """Return the pieces up to 1/8, 3/8 and 5/8."""
        peak, ripple = 8 * _pi / (2 + _pi), sympy.sin(4 * _pi * u) / (16 * _pi**2)
        level = (u - sympy.Rational(1, 8)) ** 2 / 2 - 1 / (16 * _pi**2)
        eighth = sympy.Rational(1, 8)
        return (
            (eighth, peak * (u / (4 * _pi) - ripple)),
            (3 * eighth, peak * (u / (4 * _pi) + level)),
            (5 * eighth, peak * ((1 + _pi) * u / (4 * _pi) - eighth / 2 + ripple)),
        )


class constant_velocity(Rise):  # noqa: N801
    """Constant velocity between two ramps whose acceleration is a trapezoid.

    Each ramp takes the share `ramp` of the duration, at most 1/2; the flanks of its trapezoid take
    a quarter of it each.
    """

    nargs = 2
    title = "constant velocity"

    @classmethod
    def first_half(cls) -> Sequence[Piece]:
        """Return the pieces of the first ramp, and the stretch of constant velocity."""
        flank, speed = ramp / 4, 1 / (1 - ramp)
        peak, rest = speed / (3 * flank), ramp - u
        return (
            (flank, peak * u**3 / (6 * flank)),
            (3 * flank, peak * ((u - flank / 2) ** 2 / 2 + flank**2 / 24)),
            (ramp, speed * (u - ramp / 2) + peak * rest**3 / (6 * flank)),
            (1 - ramp, speed * (u - ramp / 2)),
        )


class linear(Rise):  # noqa: N801
    """Constant velocity from end to end, with a corner at both."""

    title = "linear"
    continuity = 0

    @classmethod
    def first_half(cls) -> Sequence[Piece]:
        """Return u."""
        return ((sympy.S.One, u),)


RISES: dict[str, type[Rise]] = {
    law.title: law
    for law in (
        polynomial_345, polynomial_4567, cycloidal, simple_harmonic, modified_sine,
        modified_trapezoid, constant_velocity, linear,
    )
}  # fmt: skip
"""The normalised laws by their titles."""


class TableLaw(MotionLaw):
    """A spline through values over time, which goes on at constant velocity on both sides."""

    nargs = 1
    given: ClassVar[tuple[tuple[float, ...], ...]]  # times, values, velocities at both ends
    table: ClassVar[SplineTable]  # the pieces of the spline
    table_name: ClassVar[str]  # what the table is called in emitted code

    @classmethod
    @lru_cache
    def of(
        cls, given: tuple[tuple[float, ...], ...], table: SplineTable, table_name: str
    ) -> type[TableLaw]:
        """Return the function of a table; the same one for the same table."""
        contents = {"given": given, "table": table, "table_name": table_name}
        function: type[TableLaw] = type(table_name, (cls,), contents)
        return function

    @classmethod
    def called(cls, table_name: str) -> type[TableLaw]:
        """Return the same function under another name, or the same derivative of it."""
        function: type[Any] = TableLaw.of(cls.given, cls.table, table_name)
        for _ in range(cls.order):
            function = function.derivative()
        return function

    @classmethod
    def pieces(cls) -> Sequence[Piece]:
        """Return the line before the table, the spline, and the line after it."""
        times, values, velocities = cls.given
        before, after = (values[k] + velocities[k] * (u - times[k]) for k in (0, -1))
        spline = PeriodicSpline.of(cls.table_name, cls.table)(u)
        ends = sympy.Float(times[0]), sympy.Float(times[-1]), sympy.oo
        return tuple(zip(ends, (sympy.sympify(before), spline, sympy.sympify(after)), strict=True))

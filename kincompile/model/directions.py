"""Lengths of vectors and angles between them, as functions of the vectors' components."""

from __future__ import annotations

from typing import cast

import sympy

from kincompile.model.points import WrittenOut, written_out


class VectorFunction(WrittenOut):
    """A function of the components of one vector or two: of u, then of v."""

    brackets = "{}"

    @property
    def formula(self) -> sympy.Expr:
        """What it is in elementary functions of its components."""
        raise NotImplementedError

    @property
    def components(self) -> tuple[sympy.Expr, ...]:
        """All components."""
        return cast("tuple[sympy.Expr, ...]", self.args)

    @classmethod
    def eval(cls, *args: sympy.Expr) -> sympy.Expr | None:
        """Write out what does not move."""
        if any(item.free_symbols for item in args):
            return None
        found: sympy.Expr = super().__new__(cls, *args, evaluate=False).formula
        return found

    def written_out(self) -> sympy.Expr:
        """Return it in elementary functions, with the coordinates of points in cosine and sine."""
        return written_out(self.formula)


class length_of(VectorFunction):  # noqa: N801 - functions for those who read expressions
    """The length of a vector."""

    nargs = 2, 3

    @property
    def formula(self) -> sympy.Expr:
        """The root of u^T u."""
        return cast("sympy.Expr", sympy.sqrt(sympy.Add(*(item**2 for item in self.components))))


class turning(VectorFunction):  # noqa: N801
    """The angle from one vector in the plane to another, between -pi and pi.

    Its rate is the difference of the rates of the two directions.
    """

    nargs = 4
    is_signed = True

    @property
    def vectors(self) -> tuple[tuple[sympy.Expr, ...], tuple[sympy.Expr, ...]]:
        """The vectors u and v."""
        return self.components[:2], self.components[2:]

    @property
    def formula(self) -> sympy.Expr:
        """The angle of which u x v and u^T v are sine and cosine."""
        (a, b), (c, d) = self.vectors
        cross = a * d - b * c
        sine = cross if self.is_signed else sympy.sqrt(cross**2)
        return cast("sympy.Expr", sympy.atan2(sine, a * c + b * d))


class angle_between(turning):  # noqa: N801
    """The angle between two vectors, between 0 and pi; it has no rate at these."""

    nargs = 4
    is_signed = False

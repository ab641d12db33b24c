"""The assembled system as SymPy matrices: Phi, Phi_q, nu, gamma, in the names the user wrote."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import sympy

from kincompile.calculus.expand import Expansion, Pair, Value
from kincompile.calculus.expressions import Expression, Scalar, Vector
from kincompile.derive.derivation import derive
from kincompile.derive.equations import derive_equation
from kincompile.errors import ModelError
from kincompile.html import picture_html
from kincompile.model.display import constraints_html, equations_latex, problems_html
from kincompile.model.expressions import alpha, as_sympy, t
from kincompile.model.resolve import FreeEquation, Joint
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from fractions import Fraction

    from kincompile.model.bodies import Coordinate


class CheckedSystem(Protocol):
    """What the matrices are assembled from."""

    @property
    def coordinates(self) -> Sequence[Coordinate]:
        """The generalised coordinates, in order."""

    @property
    def constraints(self) -> Sequence[Joint | FreeEquation]:
        """The constraints, in order."""


class MatrixViews:
    """Matrix properties shared by `Mechanism` and `ConstraintSystem`, and their display."""

    name: str

    def system(self) -> CheckedSystem:
        """Return the checked system."""
        raise NotImplementedError

    @property
    def q(self) -> sympy.ImmutableDenseMatrix:
        """Symbols of the generalised coordinates, shape (n, 1)."""
        return _column([sympy.Symbol(item.name) for item in self.system().coordinates])

    @property
    def q_dot(self) -> sympy.ImmutableDenseMatrix:
        """Symbols of their rates, shape (n, 1)."""
        return _column([sympy.Symbol(rate(item.name)) for item in self.system().coordinates])

    @property
    def Phi(self) -> sympy.ImmutableDenseMatrix:
        """The constraint vector, shape (m, 1)."""
        return _column([row.Phi for row in assemble(self.system())])

    @property
    def Phi_q(self) -> sympy.ImmutableDenseMatrix:
        """The Jacobian, shape (m, n)."""
        system = self.system()
        names = [item.name for item in system.coordinates]
        rows = [
            [row.Phi_q.get(name, sympy.Integer(0)) for name in names] for row in assemble(system)
        ]
        return sympy.ImmutableDenseMatrix(
            len(rows), len(names), [entry for row in rows for entry in row]
        )

    @property
    def nu(self) -> sympy.ImmutableDenseMatrix:
        """The right side of the velocity equation, -Phi_t, shape (m, 1)."""
        return _column([row.nu for row in assemble(self.system())])

    @property
    def gamma(self) -> sympy.ImmutableDenseMatrix:
        """The right side of the acceleration equation, shape (m, 1)."""
        return _column([row.gamma for row in assemble(self.system())])

    def _repr_html_(self) -> str:
        try:
            system = self.system()
        except ModelError as error:
            return problems_html(self.name, str(error))
        table = constraints_html(self.name, len(system.coordinates), system.constraints)
        return table + picture_html(system)

    def _repr_latex_(self) -> str | None:
        try:
            return equations_latex(self.Phi)
        except ModelError:
            return None


def _column(entries: list[sympy.Expr]) -> sympy.ImmutableDenseMatrix:
    return sympy.ImmutableDenseMatrix(len(entries), 1, entries)


@dataclass(frozen=True, slots=True)
class Row:
    """One equation of the system: Phi, the entries of Phi_q by coordinate, nu and gamma."""

    Phi: sympy.Expr
    Phi_q: Mapping[str, sympy.Expr]
    nu: sympy.Expr
    gamma: sympy.Expr


def assemble(system: CheckedSystem) -> list[Row]:
    """Return the rows of the system in order."""
    rows: list[Row] = []
    for constraint in system.constraints:
        rows += (
            _free_rows(constraint)
            if isinstance(constraint, FreeEquation)
            else _joint_rows(constraint)
        )
    return rows


def _free_rows(equation: FreeEquation) -> list[Row]:
    rows = []
    for expression in equation.expressions:
        found = derive_equation(expression, equation.columns)
        entries = dict(zip(equation.columns, found.Phi_q, strict=True))
        rows.append(Row(found.Phi, entries, found.nu, found.gamma))
    return rows


def _joint_rows(joint: Joint) -> list[Row]:
    expansion = Expansion(SymbolicEnvironment(joint))
    rows = []
    for block in derive(joint.template):
        columns: list[tuple[sympy.Expr, ...]] = []
        is_vector = isinstance(block.Phi, Vector)
        for coordinate, entry in zip(joint.template.coordinates, block.Phi_q, strict=True):
            columns += entry_columns(entry, is_vector, isinstance(coordinate, Vector), expansion)
        parts = [expansion.components(item) for item in (block.Phi, block.nu, block.gamma)]
        for k, (Phi, nu, gamma) in enumerate(zip(*parts, strict=True)):
            entries = {
                name: column[k]
                for name, column in zip(joint.columns, columns, strict=True)
                if name is not None
            }
            rows.append(Row(Phi, entries, nu, gamma))
    return rows


def entry_columns(
    entry: Expression, is_vector_row: bool, is_position: bool, expansion: Expansion
) -> list[tuple[Value, ...]]:
    """Expand a block of Phi_q to its columns, each with one value a row.

    By a position r a vector constraint has the block k I, and a scalar one the row (d/dx, d/dy).
    """
    if is_vector_row and is_position:
        assert isinstance(entry, Scalar)
        k, zero = expansion.scalar(entry), expansion.scalar(entry * 0)
        return [(k, zero), (zero, k)]
    if is_position:
        assert isinstance(entry, Vector)
        x, y = expansion.vector(entry)
        return [(x,), (y,)]
    return [expansion.components(entry)]


class SymbolicEnvironment:
    """The leaves of a template as SymPy expressions of a joint's own names."""

    def __init__(self, joint: Joint) -> None:
        self._joint = joint
        self._symbols: dict[str, sympy.Expr] = {}
        self._vectors: dict[str, Pair] = {}
        for frame, body in zip(joint.template.frames, joint.bodies, strict=True):
            self._vectors[frame.r.name] = (body.x, body.y)
            self._vectors[frame.r_dot.name] = (body.x_dot, body.y_dot)
            self._symbols[frame.phi.name] = body.phi
            self._symbols[frame.phi_dot.name] = body.phi_dot
        names = joint.columns[3 * len(joint.bodies) :]
        for contact, name in zip(joint.template.contacts, names, strict=True):
            assert name is not None
            self._symbols[contact.alpha.name] = sympy.Symbol(name)
            self._symbols[contact.alpha_dot.name] = sympy.Symbol(rate(name))

    def number(self, value: Fraction) -> Value:
        """Return an exact number."""
        return sympy.Rational(value.numerator, value.denominator)

    def pi(self) -> Value:
        """Return pi."""
        return sympy.pi

    def symbol(self, name: str) -> Value:
        """Return a coordinate, a rate or a scalar attribute."""
        found = self._symbols.get(name)
        return as_sympy(self._joint.scalars[name]) if found is None else found

    def vector(self, name: str) -> Pair:
        """Return a position, a velocity or a body-fixed point."""
        found = self._vectors.get(name)
        if found is not None:
            return found
        x, y = self._joint.points[name]
        return as_sympy(x), as_sympy(y)

    def time_function(self, name: str, order: int) -> Value:
        """Return C(t) or one of its derivatives."""
        return as_sympy(self._joint.scalars[name]).diff(t, order)

    def profile(self, name: str, order: int) -> Value:
        """Return rho(alpha) or one of its derivatives at the contact parameter."""
        contact = self._symbols[name.replace("rho", "alpha")]
        return self._joint.profiles[name].diff(alpha, order).subs(alpha, contact)

    def cos_sin(self, angle: Scalar, expand: Expansion) -> Pair:
        """Return cosine and sine of an angle."""
        value = expand.scalar(angle)
        return sympy.cos(value), sympy.sin(value)

    def sqrt(self, value: Value) -> Value:
        """Return a square root."""
        return sympy.sqrt(value)

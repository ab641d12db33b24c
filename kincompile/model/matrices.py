"""The assembled system as SymPy matrices: Phi, Phi_q, nu, gamma, in the names the user wrote."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import sympy

from kincompile.calculus.expand import Expansion
from kincompile.derive.derivation import derive
from kincompile.derive.equations import derive_equation
from kincompile.errors import ModelError
from kincompile.html import picture_html
from kincompile.model.display import constraints_html, equations_latex, problems_html
from kincompile.model.resolve import FreeEquation, Joint
from kincompile.model.symbolic import SymbolicEnvironment
from kincompile.names import rate

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.model.bodies import Coordinate
    from kincompile.model.resolve_loads import AppliedLoad


class CheckedSystem(Protocol):
    """What the matrices are assembled from."""

    @property
    def coordinates(self) -> Sequence[Coordinate]:
        """The generalised coordinates, in order."""

    @property
    def constraints(self) -> Sequence[Joint | FreeEquation]:
        """The constraints, in order."""

    @property
    def loads(self) -> Sequence[AppliedLoad]:
        """The masses and the loads."""


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

    @property
    def M(self) -> sympy.ImmutableDenseMatrix:
        """The mass matrix, shape (n, n); without masses it is zero."""
        system = self.system()
        n = len(system.coordinates)
        entries: dict[tuple[int, int], sympy.Expr] = {}
        for row, column, value in _entries(system, "M"):
            entries[row, column] = entries.get((row, column), sympy.S.Zero) + value
        return sympy.ImmutableDenseMatrix(n, n, lambda i, j: entries.get((i, j), sympy.S.Zero))

    @property
    def Q(self) -> sympy.ImmutableDenseMatrix:
        """Generalised forces, those of weight and of inertia among them, shape (n, 1).

        The equations of motion are M q_ddot + Phi_q^T lambda = Q.
        """
        system = self.system()
        forces: list[sympy.Expr] = [sympy.S.Zero] * len(system.coordinates)
        for row, _, value in _entries(system, "Q"):
            forces[row] += value
        return _column(forces)

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
class EquationRow:
    """One equation of the system: Phi, the entries of Phi_q by coordinate, nu and gamma."""

    Phi: sympy.Expr
    Phi_q: Mapping[str, sympy.Expr]
    nu: sympy.Expr
    gamma: sympy.Expr


def assemble(system: CheckedSystem) -> list[EquationRow]:
    """Return the rows of the system in order."""
    rows: list[EquationRow] = []
    for constraint in system.constraints:
        rows += (
            _free_rows(constraint)
            if isinstance(constraint, FreeEquation)
            else joint_rows(constraint)
        )
    return rows


def _free_rows(equation: FreeEquation) -> list[EquationRow]:
    rows = []
    for expression in equation.expressions:
        found = derive_equation(expression, equation.columns)
        entries = dict(zip(equation.columns, found.Phi_q, strict=True))
        rows.append(EquationRow(found.Phi, entries, found.nu, found.gamma))
    return rows


def joint_rows(joint: Joint) -> list[EquationRow]:
    """Return the rows of a joint, by the columns of its template."""
    expansion = Expansion(SymbolicEnvironment(joint), joint.template.dimension)
    rows = []
    for block in derive(joint.template):
        columns = [expansion.components(column) for column in block.Phi_q]
        parts = [expansion.components(item) for item in (block.Phi, block.nu, block.gamma)]
        for Phi, nu, gamma, *entries in zip(*parts, *columns, strict=True):
            by_name = zip(joint.columns, entries, strict=True)
            known = {name: entry for name, entry in by_name if name is not None}
            rows.append(EquationRow(Phi, known, nu, gamma))
    return rows


def _entries(system: CheckedSystem, quantity: str) -> Iterator[tuple[int, int, sympy.Expr]]:
    for load in system.loads:
        yield from load_entries(system, load, quantity)


def load_entries(
    system: CheckedSystem, load: AppliedLoad, quantity: str
) -> Iterator[tuple[int, int, sympy.Expr]]:
    """Yield row, column and value of what a load adds to M or to Q."""
    places = {item.name: k for k, item in enumerate(system.coordinates)}
    expansion = Expansion(SymbolicEnvironment(load))
    columns = [None if name is None else places[name] for name in load.columns]
    for row, column, value in load.entries(quantity):
        at, by = columns[row], columns[column] if quantity == "M" else 0
        if at is not None and by is not None:
            yield at, by, expansion.scalar(value)

"""The steps of a joint in Haug's r-omega form: columns of r and of small rotations pi'.

The formulas are derived as in the r-p form, along other changes (`turned_joint`). The emitted
module computes by r and p, so what is written out here is the same derivation in components.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.derivations.joint_section import JointSteps
from kincompile.derivations.steps import QUANTITIES
from kincompile.derive.derivation import derive
from kincompile.model.expressions import evaluate
from kincompile.model.matrices import joint_rows
from kincompile.model.small_rotations import spin_names, turned_columns, turned_joint
from kincompile.report.document import Chapter, Display, Verbatim, table, text
from kincompile.report.document import Math as Formulas
from kincompile.report.formulas import Decimal, DerivativeSymbol, Equated

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from kincompile.derivations.figures import Figures
    from kincompile.ir.inline import ConstraintRows as Rows
    from kincompile.model.expressions import Scalar
    from kincompile.model.matrices import EquationRow
    from kincompile.model.resolve import Joint
    from kincompile.report.document import Block
    from kincompile.report.formulas import Formula


MOST_OPERATIONS = 120
"""Of a formula that is written out in components."""

R_OMEGA = text(
    "In the r-omega form (Haug, chapter 9) a body has the columns of r and of a small rotation "
    "pi' about its own axes, and the rates r_dot and omega'. With ",
    Verbatim("p_dot = G^T omega'/2"),
    " the rotation matrix changes by ",
    Verbatim("A_dot = A omega'~"),
    ", and so ",
    Verbatim("Phi_pi' = Phi_p G^T/2"),
    ". The norm rows vanish, for ",
    Verbatim("G p = 0"),
    ", and gamma belongs to (r_ddot, omega'_dot): with ",
    Verbatim("p_ddot = G^T omega'_dot/2 - (omega'^T omega') p/4"),
    " it is the gamma of r and p and a quarter of the sum of ",
    Verbatim("(omega'^T omega') Phi_p p"),
    " over the bodies. Free equations, and the assembled system at the end, stay by r and p, as "
    "the emitted module computes them.",
)
"""What the letters of the r-omega form mean."""


def turned_section(figures: Figures, joint: Joint, rows: Rows) -> Chapter:
    """Return the derivation of a joint by r and small rotations."""
    turned = turned_joint(joint)
    columns = [name for name in joint.columns if name is not None]
    blocks, evaluation = derive(turned.template), figures.evaluation
    steps = _TurnedSteps(evaluation, rows, joint.name, columns, blocks, "vector", turned)
    return steps.nine(figures.joint(joint))


@dataclass(frozen=True, slots=True)
class _TurnedSteps(JointSteps):
    @property
    def names(self) -> Sequence[str]:
        """Names of the columns of Phi_q: six a body, then the other coordinates."""
        system = self.evaluation.system
        of_bodies = sum(map(len, system.body_columns))
        turned = (name for body in system.bodies for name in turned_columns(body))
        return [*turned, *self.evaluation.coordinates[of_bodies:]]

    def column_numbers(self) -> list[int]:
        """Return the columns of Phi_q in which something can stand."""
        names = list(self.names)
        found = {name for row in self._rows() for name, entry in row.Phi_q.items() if entry != 0}
        return sorted(names.index(name) for name in found)

    def _rows(self) -> list[EquationRow]:
        return joint_rows(self.joint)

    def expansion(self) -> Chapter:
        """Return the step in which everything is written out in components."""
        note = text(
            "The emitted module computes by r and p. These are the same constraint by r and small "
            "rotations, written out; entries of the Jacobian that are not listed are zero. What "
            f"has more than {MOST_OPERATIONS} operations stays as it is in vectors."
        )
        lines: list[Block] = []
        for k, row in enumerate(self._rows(), self.rows.instance.first_row):
            symbols = {name: self.evaluation.symbol(name, k) for name in ("Phi", "nu", "gamma")}
            pairs: list[tuple[Formula, sympy.Expr]] = [(symbols["Phi"], row.Phi)]
            pairs += [
                (DerivativeSymbol(symbols["Phi"], sympy.Symbol(name)), entry)
                for name, entry in row.Phi_q.items()
                if entry != 0
            ]
            pairs += [(symbols["nu"], row.nu), (symbols["gamma"], row.gamma)]
            lines += [
                Display(Equated((left, sympy.sympify(right))))
                for left, right in pairs
                if sympy.count_ops(right) <= MOST_OPERATIONS
            ]
        return self.step(7, "Written out in components", note, *lines, level="expanded")

    def arrays(self, rows: slice, columns: Sequence[int]) -> Mapping[str, NDArray[np.float64]]:
        """Return Phi, nu, gamma and some columns of Phi_q in numbers."""
        del rows
        values = self._values()
        names = [self.names[k] for k in columns]
        found = self._rows()
        cells = [[_number(row.Phi_q.get(name, 0), values) for name in names] for row in found]
        vectors = {
            key: np.array([_number(getattr(row, key), values) for row in found])
            for key in QUANTITIES
            if key != "Phi_q"
        }
        return vectors | {"Phi_q": np.array(cells).reshape(len(found), len(names))}

    def _values(self) -> dict[str, float]:
        """Return the state by name, omega' of the bodies included."""
        values = self.evaluation.values
        spins = {
            name: _number(spin, values)
            for body in self.joint.bodies
            if not body.is_ground
            for name, spin, _ in body.on_request
        }
        return values | spins

    def numbers(self, *vectors: Block) -> Chapter:
        """Return the step in numbers, with omega' of the bodies."""
        values = self._values()
        names = [
            name for body in self.joint.bodies if not body.is_ground for name in spin_names(body)
        ]
        lines = [(Verbatim(name), Formulas(Decimal(values[name]))) for name in names]
        return JointSteps.numbers(self, table(("angular velocity", "value"), lines), *vectors)


def _number(expression: Scalar, values: Mapping[str, float]) -> float:
    found = evaluate(expression, dict(values))
    return float("nan") if found is None else found

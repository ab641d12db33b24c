"""The nine steps of a constraint, as far as joints and free equations have them in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Generic, TypeVar

from kincompile.report import document as doc
from kincompile.report import formulas as fm
from kincompile.tables import counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from kincompile.derivations.evaluation import Evaluation
    from kincompile.derive.derivation import RowBlock
    from kincompile.derive.equations import EquationDerivatives
    from kincompile.ir.inline import ConstraintRows as Rows

QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")


Derived = TypeVar("Derived", bound="RowBlock | EquationDerivatives")


@dataclass(frozen=True, slots=True)
class Steps(ABC, Generic[Derived]):
    """The steps of a constraint."""

    evaluation: Evaluation
    rows: Rows  # the rows of the constraint in the emitted program
    name: str
    columns: Sequence[str]
    # What follows from Phi, for each row block of a joint or each expression of an equation.
    derivatives: Sequence[Derived]
    level: str  # level of the steps that are derived: "vector" or "expanded"

    @abstractmethod
    def symbol(self, letter: str, k: int) -> fm.Glyph:
        """Return the symbol of the k-th Phi, nu or gamma."""

    def section(self, kind: str, is_driver: bool, *steps: doc.Chapter) -> doc.Chapter:
        """Return the steps under the kind and the name of the constraint."""
        title = f"{kind} (driver) " if is_driver else f"{kind} "
        names: doc.Runs = (title, doc.Verbatim(self.name))
        return doc.Chapter(f"constraint-{self.name}", names, (), steps, is_folded=self.is_trivial)

    @property
    def is_trivial(self) -> bool:
        """Whether the derivation needs no rule, so that it is folded away."""
        return False

    def step(
        self, number: int, title: str, *blocks: doc.Block, level: str | None = None
    ) -> doc.Chapter:
        """Return one step, of the level of the derived ones unless another is given."""
        level = self.level if level is None else level
        return doc.Chapter(f"{self.name}-step-{number}", (f"{number}. {title}",), blocks, (), level)

    def nu(self, *notes: doc.Block) -> doc.Chapter:
        """Return the step of the velocity equation, with notes below it."""
        lines = [
            doc.Display(fm.Equated((self.symbol("nu", k), fm.Joined(("-", fm.PHI_T)), item.nu)))
            for k, item in enumerate(self.derivatives)
        ]
        return self.step(5, "The right side of the velocity equation", *lines, *notes)

    def gamma_terms(self, k: int) -> list[doc.Block]:
        """Return the k-th gamma, term by term."""
        item = self.derivatives[k]
        terms: list[tuple[fm.Formula, fm.Formula]] = [(fm.VELOCITY_TERM, item.velocity)]
        terms += zip(fm.GAMMA_TERMS, item.gamma_terms, strict=True)
        terms.append((self.symbol("gamma", k), item.gamma))
        return [doc.Display(fm.Equated(pair)) for pair in terms]

    def gamma(self, *blocks: doc.Block) -> doc.Chapter:
        """Return the step of the acceleration equation."""
        title = "The right side of the acceleration equation, term by term"
        return self.step(6, title, *blocks)

    def expansion(self) -> doc.Chapter:
        """Return the step in which everything is written out: the emitted code."""
        note = doc.text(
            "This is what the emitted module computes, with its intermediate values written out. "
            "Entries of the Jacobian that are not listed are zero."
        )
        lines = self.evaluation.expansion(self.rows, QUANTITIES)
        title = f"Written out in {self.evaluation.system.ground.kind.written_in}"
        return self.step(7, title, note, *lines, level="expanded")

    def placement(self) -> doc.Chapter:
        """Return the step that gives the rows and columns of the constraint."""
        first, count = self.rows.instance.first_row, len(self.rows.entries["Phi"])
        note = doc.text(
            f"{counted(count, 'equation')}; the constraints before have {first}: that is the row "
            f"offset. {'Row' if count == 1 else 'Rows'} {doc.row_range(first, count)} counted from "
            f"0, {doc.row_range(first + 1, count)} counted from 1."
        )
        names = self.names
        lines = [(doc.Verbatim(names[k]), str(k), str(k + 1)) for k in self.column_numbers()]
        columns = doc.table(("coordinate", "column from 0", "from 1"), lines)
        title = "Placement by row and column offset"
        return self.step(8, title, note, columns, level="expanded")

    @property
    def names(self) -> Sequence[str]:
        """Names of the columns of Phi_q."""
        return self.evaluation.coordinates

    def column_numbers(self) -> list[int]:
        """Return the columns of Phi_q in which something can stand."""
        return sorted({entry.column for entry in self.rows.entries["Phi_q"]})

    def numbers(self, *vectors: doc.Block) -> doc.Chapter:
        """Return the step in numbers: the state, vectors, then Phi, Phi_q, nu and gamma."""
        blocks = (doc.text(f"At {self.evaluation.origin}:"), self._state(), *vectors)
        return self.step(9, "In numbers", *blocks, *self._results(), level="numeric")

    def _state(self) -> doc.Block:
        evaluation = self.evaluation
        rows: list[tuple[doc.Run | doc.Runs, ...]] = []
        for name in self.columns:
            k = evaluation.coordinates.index(name)
            numbers = (doc.Math(fm.Decimal(evaluation.shown[key][k])) for key in ("q", "q_dot"))
            rows.append((doc.Verbatim(name), *numbers))
        return doc.table(("coordinate", "value", "rate"), rows)

    def arrays(self, rows: slice, columns: Sequence[int]) -> Mapping[str, NDArray[np.float64]]:
        """Return Phi, nu, gamma and some columns of Phi_q in numbers."""
        shown = {key: self.evaluation.shown[key][rows] for key in QUANTITIES}
        return shown | {"Phi_q": shown["Phi_q"][:, columns]}

    def _results(self) -> Sequence[doc.Block]:
        first, count = self.rows.instance.first_row, len(self.rows.entries["Phi"])
        columns = self.column_numbers()
        names: list[doc.Run] = []
        for column in columns:
            names += [", " if names else "", doc.Verbatim(self.names[column])]
        shown = self.arrays(slice(first, first + count), columns)
        phi, phi_q, nu, gamma = (
            doc.Display(fm.Equated((replace(symbol, exponent=self.name), fm.decimals(shown[key]))))
            for key, symbol in zip(QUANTITIES, (fm.PHI, fm.PHI_Q, fm.NU, fm.GAMMA), strict=True)
        )
        code = f"rows = slice({first}, {first + count})  # {self.name}\nprint(Phi_q(q, t, p)[rows])"
        return (
            phi,
            doc.text("In the columns of ", *names, ":"),
            phi_q,
            nu,
            gamma,
            doc.NotebookCode(code),
        )

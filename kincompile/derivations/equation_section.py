"""The steps of a free equation: those of a joint without the level of vectors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy

from kincompile.derivations.steps import Steps
from kincompile.derive.equations import EquationDerivatives, derive_equation
from kincompile.model.resolve import held_text
from kincompile.report.document import Chapter, Display, Math, Verbatim, table, text
from kincompile.report.formulas import DerivativeSymbol, Equated

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.derivations.evaluation import Evaluation
    from kincompile.ir.inline import ConstraintRows as Rows
    from kincompile.model.resolve import FreeEquation
    from kincompile.report.document import Run, Runs
    from kincompile.report.formulas import Glyph


def equation_section(evaluation: Evaluation, equation: FreeEquation, rows: Rows) -> Chapter:
    """Return the derivation of a free equation."""
    found = [derive_equation(item, equation.columns) for item in equation.expressions]
    steps = _EquationSteps(
        evaluation, rows, equation.name, equation.columns, found, "expanded", equation
    )
    gammas = [block for k in range(len(found)) for block in steps.gamma_terms(k)]
    return steps.section(
        "Equation that holds" if equation.holds else "Free equation",
        equation.is_driver,
        steps.coordinates(),
        steps.constraint(),
        steps.rules(),
        steps.jacobian(),
        steps.nu(),
        steps.gamma(*gammas),
        steps.expansion(),
        steps.placement(),
        steps.numbers(),
    )


@dataclass(frozen=True, slots=True)
class _EquationSteps(Steps[EquationDerivatives]):
    """The steps of a free equation, which SymPy has differentiated."""

    equation: FreeEquation

    def symbol(self, letter: str, k: int) -> Glyph:
        return self.evaluation.symbol(letter, self.rows.instance.first_row + k)

    def _partial(self, k: int, name: str) -> DerivativeSymbol:
        return DerivativeSymbol(self.symbol("Phi", k), sympy.Symbol(name))

    def coordinates(self) -> Chapter:
        parameters = {item.name for item in self.evaluation.system.parameters}
        expressions = self.equation.expressions
        occurring = {str(symbol) for item in expressions for symbol in item.free_symbols}
        names: list[Run] = []
        for name in (*self.columns, *sorted(parameters & occurring)):
            names += [", " if names else "", Verbatim(name)]
        end = ", and in time." if self.equation.is_driver else "."
        notes = [text("An equation in ", *names, end)]
        if self.equation.holds:
            sentence = f"{held_text(self.equation.holds)}. Any numbers in it would do."
            notes.insert(0, text(sentence))
        return self.step(1, "The equation and what occurs in it", *notes, level="")

    def constraint(self) -> Chapter:
        lines = [
            Display(Equated((self.symbol("Phi", k), item.Phi, sympy.Integer(0))))
            for k, item in enumerate(self.derivatives)
        ]
        return self.step(2, "The constraint", *lines)

    def rules(self) -> Chapter:
        rows: list[tuple[Run | Runs, ...]] = []
        for k, item in enumerate(self.derivatives):
            for name in self.columns:
                label = Math(self._partial(k, name))
                rows += [(label, *line) for line in _term_lines(item.Phi, name)]
        note = text(
            "The sum rule first: each term by itself, with the product and chain rule in it."
        )
        header = ("derivative", "of the term", "gives")
        return self.step(3, "The rules used", note, table(header, rows))

    def jacobian(self) -> Chapter:
        lines = [
            Display(Equated((self._partial(k, name), entry)))
            for k, item in enumerate(self.derivatives)
            for name, entry in zip(self.columns, item.Phi_q, strict=True)
        ]
        return self.step(4, "The rows of the Jacobian", *lines)


def _term_lines(expression: sympy.Expr, name: str) -> Iterator[tuple[Run, Run]]:
    symbol = sympy.Symbol(name)
    for term in sympy.Add.make_args(expression):
        if term.has(symbol):
            yield Math(term), Math(term.diff(symbol))

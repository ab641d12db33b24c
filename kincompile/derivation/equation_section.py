"""The steps of a free equation: those of a joint without the level of vectors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import sympy

from kincompile.derivation.document import Display, Math, Section, Verbatim, table, text
from kincompile.derivation.formulas import GAMMA_TERMS, PHI_T, VELOCITY_TERM, Equated, Partial, Row
from kincompile.derivation.rows_steps import (
    expansion_step,
    placement_step,
    result_blocks,
    state_table,
    step,
)
from kincompile.derive.equations import derive_equation

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.derivation.document import Block, Run, Runs
    from kincompile.derivation.evaluation import Evaluation
    from kincompile.derivation.formulas import Formula
    from kincompile.derive.equations import EquationDerivatives
    from kincompile.ir.inline import Section as Rows
    from kincompile.model.resolve import FreeEquation


def equation_section(evaluation: Evaluation, equation: FreeEquation, rows: Rows) -> Section:
    """Return the derivation of a free equation."""
    name = equation.name
    found = [derive_equation(item, equation.columns) for item in equation.expressions]
    first = rows.instance.first_row
    kind = "Free equation (driver) " if equation.is_driver else "Free equation "
    return Section(
        f"constraint-{name}",
        (kind, Verbatim(name)),
        (),
        (
            _coordinates_step(evaluation, equation),
            _constraint_step(evaluation, name, found, first),
            _rules_step(evaluation, equation, found, first),
            _rows_step(evaluation, equation, found, first),
            _nu_step(evaluation, name, found, first),
            _gamma_step(evaluation, name, found, first),
            expansion_step(evaluation, name, rows),
            placement_step(evaluation, name, rows),
            _numbers_step(evaluation, equation, rows),
        ),
    )


def _coordinates_step(evaluation: Evaluation, equation: FreeEquation) -> Section:
    parameters = {item.name for item in evaluation.system.parameters}
    occurring = {str(symbol) for item in equation.expressions for symbol in item.free_symbols}
    names: list[Run] = []
    for name in (*equation.columns, *sorted(parameters & occurring)):
        names += [", " if names else "", Verbatim(name)]
    note = text("An equation in ", *names, ", and in time." if equation.is_driver else ".")
    return step(equation.name, 1, "The equation and what occurs in it", "", note)


def _constraint_step(
    evaluation: Evaluation, name: str, found: list[EquationDerivatives], first: int
) -> Section:
    lines = [
        Display(Equated((evaluation.symbol("Phi", first + k), item.Phi, sympy.Integer(0))))
        for k, item in enumerate(found)
    ]
    return step(name, 2, "The constraint", "expanded", *lines)


def _rules_step(
    evaluation: Evaluation, equation: FreeEquation, found: list[EquationDerivatives], first: int
) -> Section:
    rows: list[tuple[Run | Runs, ...]] = []
    for k, item in enumerate(found):
        for name in equation.columns:
            label = Math(Partial(evaluation.symbol("Phi", first + k), sympy.Symbol(name)))
            rows += [(label, *line) for line in _term_lines(item.Phi, name)]
    note = text("The sum rule first: each term by itself, with the product and chain rule in it.")
    header = ("derivative", "of the term", "gives")
    return step(equation.name, 3, "The rules used", "expanded", note, table(header, rows))


def _term_lines(expression: sympy.Expr, name: str) -> Iterator[tuple[Run, Run]]:
    symbol = sympy.Symbol(name)
    for term in sympy.Add.make_args(expression):
        if term.has(symbol):
            yield Math(term), Math(term.diff(symbol))


def _rows_step(
    evaluation: Evaluation, equation: FreeEquation, found: list[EquationDerivatives], first: int
) -> Section:
    blocks: list[Block] = []
    for k, item in enumerate(found):
        for name, entry in zip(equation.columns, item.Phi_q, strict=True):
            symbol = Partial(evaluation.symbol("Phi", first + k), sympy.Symbol(name))
            blocks.append(Display(Equated((symbol, entry))))
    return step(equation.name, 4, "The rows of the Jacobian", "expanded", *blocks)


def _nu_step(
    evaluation: Evaluation, name: str, found: list[EquationDerivatives], first: int
) -> Section:
    lines = [
        Display(Equated((evaluation.symbol("nu", first + k), Row(("-", PHI_T)), item.nu)))
        for k, item in enumerate(found)
    ]
    return step(name, 5, "The right side of the velocity equation", "expanded", *lines)


def _gamma_step(
    evaluation: Evaluation, name: str, found: list[EquationDerivatives], first: int
) -> Section:
    blocks: list[Block] = []
    for k, item in enumerate(found):
        terms: list[tuple[Formula, Formula]] = [(VELOCITY_TERM, item.velocity)]
        terms += zip(GAMMA_TERMS, item.gamma_terms, strict=True)
        terms.append((evaluation.symbol("gamma", first + k), item.gamma))
        blocks += [Display(Equated(pair)) for pair in terms]
    title = "The right side of the acceleration equation, term by term"
    return step(name, 6, title, "expanded", *blocks)


def _numbers_step(evaluation: Evaluation, equation: FreeEquation, rows: Rows) -> Section:
    return step(
        equation.name,
        9,
        "In numbers",
        "numeric",
        text(f"At {evaluation.origin}:"),
        state_table(evaluation, list(equation.columns)),
        *result_blocks(evaluation, equation.name, rows),
    )

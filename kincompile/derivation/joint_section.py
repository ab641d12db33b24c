"""The nine steps of a joint or a driver; the first six are in vectors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy

from kincompile.calculus.expressions import ZERO, TimeFunction, Vector, VectorSymbol
from kincompile.calculus.expressions import Symbol as Letter
from kincompile.derivation.derivation_page import table
from kincompile.derivation.document import Display, Math, Section, Text, Verbatim, text
from kincompile.derivation.formulas import (
    GAMMA_TERMS,
    PHI_T,
    VELOCITY_TERM,
    ZERO_BLOCK,
    Equated,
    Glyph,
    Matrix,
    Partial,
    Row,
    Sub,
)
from kincompile.derivation.joint_numbers import numbers_step, values_of
from kincompile.derivation.joint_terms import (
    RULES,
    abbreviations,
    block_columns,
    block_entry,
    block_rows,
    parts,
    telling,
)
from kincompile.derivation.rows_steps import expansion_step, placement_step, step
from kincompile.derive.derivation import derive
from kincompile.derive.partials import partials
from kincompile.model.arguments import Kind
from kincompile.model.expressions import depends_on

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from kincompile.calculus.expressions import Expression
    from kincompile.derivation.derivation_page import Page
    from kincompile.derivation.document import Block, Run, Runs
    from kincompile.derivation.formulas import Formula
    from kincompile.derive.derivation import RowBlock
    from kincompile.derive.rules import Step
    from kincompile.ir.inline import Section as Rows
    from kincompile.model.resolve import Joint


@dataclass(frozen=True, slots=True)
class _JointPage:
    """A joint, its derivation, and the page it is on."""

    page: Page
    joint: Joint
    rows: Rows
    blocks: tuple[RowBlock, ...]

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self.joint.name

    def symbol(self, letter: str, k: int) -> Glyph:
        """Return the symbol of a row block: Phi with the joint's name, and a number of several."""
        index = str(k + 1) if len(self.blocks) > 1 else ""
        return Glyph(letter, index, exponent=self.name)


def joint_section(page: Page, joint: Joint, rows: Rows) -> Section:
    """Return the derivation of a joint: nine steps, each in its place."""
    on_page = _JointPage(page, joint, rows, derive(joint.template))
    kind = f"{joint.template.type_name} (driver)" if joint.is_driver else joint.template.type_name
    return Section(
        f"constraint-{joint.name}",
        (f"{kind} ", Verbatim(joint.name)),
        (),
        (
            _attributes_step(on_page),
            _constraint_step(on_page),
            _rules_step(on_page),
            _blocks_step(on_page),
            _nu_step(on_page),
            _gamma_step(on_page),
            expansion_step(page, joint.name, rows),
            placement_step(page, joint.name, rows),
            numbers_step(page, joint, rows),
        ),
    )


def _attributes_step(on_page: _JointPage) -> Section:
    joint = on_page.joint
    written = type(joint.written)
    meaning = (written.__doc__ or "").strip().splitlines()[0]
    rows: list[tuple[Run | Runs, ...]] = []
    values = on_page.page.situation.values
    for name, argument in written.arguments().items():
        symbol = _attribute_symbol(argument.symbol, argument.kind)
        if argument.kind is Kind.BODY:
            body = joint.bodies["ij".index(argument.symbol)].name
            rows.append((Verbatim(name), Math(symbol), Verbatim(body), ""))
            continue
        written_as, number = (
            _attribute(joint, argument.symbol),
            values_of(joint, argument.symbol, values),
        )
        rows.append((Verbatim(name), Math(symbol), Math(written_as), number))
    source = f"{meaning} Source: {joint.source}."
    header = ("attribute", "symbol", "as written", "number")
    return step(
        on_page.name, 1, "The joint and its attributes", "", text(source), table(header, rows)
    )


def _attribute_symbol(symbol: str, kind: Kind) -> Formula:
    if kind is Kind.BODY:
        return Glyph(symbol, bold=False)
    if kind in (Kind.POINT, Kind.AXIS):
        return VectorSymbol(symbol)
    return TimeFunction(symbol) if symbol == "C" else Letter(symbol)


def _attribute(joint: Joint, symbol: str) -> Formula:
    """Return an attribute as the user wrote it."""
    if symbol in joint.points:
        return Matrix(tuple((sympy.sympify(value),) for value in joint.points[symbol]))
    if symbol in joint.profiles:
        return joint.profiles[symbol]
    written: sympy.Expr = sympy.sympify(joint.scalars[symbol])
    return written


def _constraint_step(on_page: _JointPage) -> Section:
    blocks: list[Block] = []
    for k, block in enumerate(on_page.blocks):
        zero = ZERO_BLOCK if isinstance(block.Phi, Vector) else ZERO
        blocks.append(Display(Equated((on_page.symbol("Phi", k), block.Phi, zero))))
    names = abbreviations(on_page.joint.template)
    if names:
        blocks.append(text("with"))
        blocks += [Display(Equated((glyph, item))) for item, glyph in names.items()]
    return step(on_page.name, 2, "The constraint in vectors", "vector", *blocks)


def _rules_step(on_page: _JointPage) -> Section:
    rows = []
    for k, row in enumerate(partials(on_page.joint.template)):
        for item in row:
            label = Math(Partial(on_page.symbol("Phi", k), item.coordinate))
            rows += [(label, *line) for line in _rule_lines(item.steps, item.coordinate)]
    note = text(
        "Every rule that fired while ", Math(_phi_q()), " was derived, from the inside out. "
        "Whatever the coordinate does not occur in is constant."
    )  # fmt: skip
    if not rows:
        note = text("Nothing but constants and coordinates themselves: no rule is needed.")
        return step(on_page.name, 3, "The rules used", "vector", note)
    header = ("derivative", "rule", "applied to", "gives")
    return step(on_page.name, 3, "The rules used", "vector", note, table(header, rows))


def _phi_q() -> Formula:
    return Glyph("Phi", "q")


def _rule_lines(
    steps: Sequence[Step], coordinate: Expression | None = None
) -> Iterator[tuple[Runs, Run, Run]]:
    for item in telling(steps):
        gives: Formula = item.derivative
        if coordinate is not None:
            gives = block_entry(item.derivative, coordinate, item.expression)
        yield RULES[item.rule], Math(item.expression), Math(gives)


def _blocks_step(on_page: _JointPage) -> Section:
    template = on_page.joint.template
    blocks: list[Block] = []
    for variable, columns in block_columns(template):
        shown = Matrix(block_rows(template, columns))
        symbol = Sub(Glyph("Phi", exponent=on_page.name), variable)
        blocks.append(Display(Equated((symbol, shown))))
    for frame, body in zip(template.frames, on_page.joint.bodies, strict=True):
        if body.is_ground:
            blocks.append(
                text(f"Body {frame.index} is the ground: its coordinates are zero and not unknown, "
                     "so this block has no columns.")
            )  # fmt: skip
    return step(on_page.name, 4, "The blocks of the Jacobian in vectors", "vector", *blocks)


def _nu_step(on_page: _JointPage) -> Section:
    blocks: list[Block] = [
        Display(Equated((on_page.symbol("nu", k), Row(("-", PHI_T)), block.nu)))
        for k, block in enumerate(on_page.blocks)
    ]
    blocks += _constant_note(on_page)
    lines: list[tuple[Run | Runs, ...]] = []
    for block in on_page.blocks:
        lines += [(Math(PHI_T), *line) for line in _rule_lines(block.Phi_t_steps)]
    blocks += _fired(lines)
    return step(on_page.name, 5, "The right side of the velocity equation", "vector", *blocks)


def _constant_note(on_page: _JointPage) -> list[Block]:
    """Say that the rates of a constant C vanish."""
    expressions = [item for block in on_page.blocks for item in parts(block.Phi)]
    if TimeFunction("C") not in expressions or depends_on(on_page.joint.scalars["C"], ("t",)):
        return []
    rates = [Math(TimeFunction("C", order)) for order in (1, 2)]
    return [
        text("Here ", Math(TimeFunction("C")), " is constant: ", rates[0], " = ", rates[1], " = 0.")
    ]


def _gamma_step(on_page: _JointPage) -> Section:
    blocks: list[Block] = []
    lines: list[tuple[Run | Runs, ...]] = []
    for k, block in enumerate(on_page.blocks):
        blocks += _gamma_lines(on_page, k, block)
        for symbol, steps in zip(GAMMA_TERMS, block.gamma_steps, strict=True):
            lines += [(Math(symbol), *line) for line in _rule_lines(steps)]
    blocks += _constant_note(on_page)
    blocks += _fired(lines)
    title = "The right side of the acceleration equation, term by term"
    return step(on_page.name, 6, title, "vector", *blocks)


def _fired(lines: list[tuple[Run | Runs, ...]]) -> list[Block]:
    """Return the rules that fired as a table that can be folded away."""
    header = ("for", "rule", "applied to", "gives")
    return [table(header, lines, "The rules that fired")] if lines else []


def _gamma_lines(on_page: _JointPage, k: int, block: RowBlock) -> Iterator[Block]:
    if len(on_page.blocks) > 1:
        yield Text(("For ", Math(on_page.symbol("Phi", k)), ":"))
    yield Display(Equated((VELOCITY_TERM, block.velocity)))
    for symbol, term in zip(GAMMA_TERMS, block.gamma_terms, strict=True):
        yield Display(Equated((symbol, term)))
    yield Display(Equated((on_page.symbol("gamma", k), block.gamma)))

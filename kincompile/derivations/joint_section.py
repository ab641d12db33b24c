"""The nine steps of a joint or a driver; the first six are in vectors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import ZERO, TimeFunction, Vector, VectorSymbol
from kincompile.calculus.expressions import Symbol as Letter
from kincompile.derivations.joint_terms import (
    RULES,
    abbreviations,
    block_columns,
    block_entry,
    block_rows,
    known_vectors,
    parts,
    telling,
)
from kincompile.derivations.steps import Steps
from kincompile.derive.collected import collected
from kincompile.derive.derivation import RowBlock, derive
from kincompile.derive.partials import partials
from kincompile.derive.rules import Rule
from kincompile.model.arguments import Kind
from kincompile.model.expressions import depends_on, evaluate
from kincompile.model.symbolic import SymbolicEnvironment
from kincompile.report import document as doc
from kincompile.report import formulas as fm

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.calculus.expressions import Expression
    from kincompile.derivations.figures import Figures
    from kincompile.derive.rules import Step
    from kincompile.ir.inline import ConstraintRows as Rows
    from kincompile.model.expressions import Scalar
    from kincompile.model.resolve import Joint
    from kincompile.model.resolve_loads import AppliedLoad
    from kincompile.report.picture import Picture


def joint_section(figures: Figures, joint: Joint, rows: Rows) -> doc.Chapter:
    """Return the derivation of a joint."""
    columns = [name for name in joint.columns if name is not None]
    blocks = derive(joint.template)
    evaluation = figures.evaluation
    steps = JointSteps(evaluation, rows, joint.name, columns, blocks, "vector", joint)
    return steps.nine(figures.joint(joint))


@dataclass(frozen=True, slots=True)
class JointSteps(Steps[RowBlock]):
    """The steps of a joint or a driver, derived in vectors."""

    joint: Joint

    def nine(self, picture: Picture | None) -> doc.Chapter:
        """Return all steps, the figure in the first."""
        return self.section(
            self.joint.type_name,
            self.joint.is_driver,
            self.attributes(picture),
            self.constraint(),
            self.rules(),
            self.jacobian(),
            self.nu(*self.nu_notes()),
            self.gamma(*self.gamma_blocks()),
            self.expansion(),
            self.placement(),
            self.numbers(*self.matrices(), *self.vectors()),
        )

    def symbol(self, letter: str, k: int) -> fm.Glyph:
        """Return the symbol of a row block, numbered where there are several."""
        index = str(k + 1) if len(self.derivatives) > 1 else ""
        return fm.Glyph(letter, index, exponent=self.name)

    @property
    def is_trivial(self) -> bool:
        """Whether the sum rule was enough: an angle is prescribed."""
        steps = [
            step for row in partials(self.joint.template) for item in row for step in item.steps
        ]
        return all(step.rule is Rule.SUM for step in telling(steps))

    def attributes(self, picture: Picture | None) -> doc.Chapter:
        """Return the step of the attributes, as written and in numbers."""
        written = type(self.joint.written)
        meaning = (written.__doc__ or "").strip().splitlines()[0]
        source = doc.text(f"{meaning} Source: {self.joint.source}.")
        attributes = attributes_table(self.joint, self.evaluation.values)
        figure = [] if picture is None else [doc.Figure(picture)]
        return self.step(1, "The joint and its attributes", source, *figure, attributes, level="")

    def constraint(self) -> doc.Chapter:
        """Return the step of Phi, with the abbreviations in it."""
        blocks: list[doc.Block] = []
        for k, block in enumerate(self.derivatives):
            zero = fm.ZERO_BLOCK if isinstance(block.Phi, Vector) else ZERO
            blocks.append(doc.Display(fm.Equated((self.symbol("Phi", k), block.Phi, zero))))
        names = abbreviations(self.joint.template)
        if names:
            blocks.append(doc.text("with"))
            blocks += [doc.Display(fm.Equated((glyph, item))) for item, glyph in names.items()]
        return self.step(2, "The constraint in vectors", *blocks)

    def rules(self) -> doc.Chapter:
        """Return the step of the rules that fired for Phi_q."""
        rows = []
        for k, row in enumerate(partials(self.joint.template)):
            for item in row:
                label = doc.Math(fm.DerivativeSymbol(self.symbol("Phi", k), item.coordinate))
                rows += [(label, *line) for line in _rule_lines(item.steps, item.coordinate)]
        note = doc.text(
            "The rules that give ", doc.Math(fm.PHI_Q), ", the innermost first. A term in which "
            "the coordinate does not occur is constant."
        )  # fmt: skip
        if not rows:
            note = doc.text("Nothing but constants and coordinates themselves: no rule is needed.")
            return self.step(3, "The rules used", note)
        header = ("derivative", "rule", "applied to", "gives")
        return self.step(3, "The rules used", note, doc.table(header, rows))

    def jacobian(self) -> doc.Chapter:
        """Return the step of the blocks of Phi_q."""
        template = self.joint.template
        blocks: list[doc.Block] = []
        for variable, columns in block_columns(template):
            shown = fm.Matrix(block_rows(template, columns))
            symbol = fm.Sub(fm.Glyph("Phi", exponent=self.name), variable)
            blocks.append(doc.Display(fm.Equated((symbol, shown))))
        blocks += [
            doc.text(f"Body {frame.index} is the ground: its coordinates are zero and not unknown, "
                     "so this block has no columns.")
            for frame, body in zip(template.frames, self.joint.bodies, strict=True)
            if body.is_ground
        ]  # fmt: skip
        return self.step(4, "The blocks of the Jacobian in vectors", *blocks)

    def nu_notes(self) -> list[doc.Block]:
        """Return what is said below nu: the rules used."""
        lines: list[tuple[doc.Run | doc.Runs, ...]] = []
        for block in self.derivatives:
            lines += [(doc.Math(fm.PHI_T), *line) for line in _rule_lines(block.Phi_t_steps)]
        return [*self._constant_note(), *_fired(lines)]

    def gamma_blocks(self) -> list[doc.Block]:
        """Return gamma term by term, collected, and the rules used."""
        blocks: list[doc.Block] = []
        lines: list[tuple[doc.Run | doc.Runs, ...]] = []
        for k, block in enumerate(self.derivatives):
            if len(self.derivatives) > 1:
                blocks.append(doc.text("For ", doc.Math(self.symbol("Phi", k)), ":"))
            blocks += [*self.gamma_terms(k), *self._gathered(k)]
            for symbol, steps in zip(fm.GAMMA_TERMS, block.gamma_steps, strict=True):
                lines += [(doc.Math(symbol), *line) for line in _rule_lines(steps)]
        return [*blocks, *self._constant_note(), *_fired(lines)]

    def _gathered(self, k: int) -> list[doc.Block]:
        """Return the k-th gamma with like terms joined, where that is shorter."""
        derived = self.derivatives[k].gamma
        found = collected(derived, abbreviations(self.joint.template))
        if found == derived or fm.size(found) >= fm.size(derived):
            return []
        note = doc.text("Multiplied out, like terms joined; equal in numbers to the line above:")
        return [note, doc.Display(fm.Equated((self.symbol("gamma", k), found)))]

    def _constant_note(self) -> list[doc.Block]:
        """Return the note that the rates of a constant C vanish."""
        expressions = [item for block in self.derivatives for item in parts(block.Phi)]
        if TimeFunction("C") not in expressions or depends_on(self.joint.scalars["C"], ("t",)):
            return []
        value, rate, second = (doc.Math(TimeFunction("C", order)) for order in range(3))
        return [doc.text("Here ", value, " is constant: ", rate, " = ", second, " = 0.")]

    def matrices(self) -> Iterator[doc.Block]:
        """Yield the rotation matrices in numbers."""
        template = self.joint.template
        if template.dimension == 3:
            yield from self._rotations()
            return
        for frame, body in zip(template.frames, self.joint.bodies, strict=True):
            angle = evaluate(body.phi, self.evaluation.values) or 0.0
            c, s = np.cos(angle), np.sin(angle)
            for letter, matrix in (("A", [[c, -s], [s, c]]), ("B", [[-s, -c], [c, -s]])):
                yield doc.Display(
                    fm.Equated((fm.Glyph(letter, frame.index), fm.decimals(np.array(matrix))))
                )

    def _rotations(self) -> Iterator[doc.Block]:
        expansion = Expansion(SymbolicEnvironment(self.joint), 3)
        for frame in self.joint.template.frames:
            entries = [
                _decimal(x, self.evaluation.values) for x in expansion.entries(frame.rotation)
            ]
            rows = tuple(tuple(entries[k : k + 3]) for k in range(0, 9, 3))
            yield doc.Display(fm.Equated((fm.Glyph("A", frame.index), fm.Matrix(rows))))

    def vectors(self) -> Iterator[doc.Block]:
        """Yield the turned vectors in numbers."""
        template, values = self.joint.template, self.evaluation.values
        expansion = Expansion(SymbolicEnvironment(self.joint), template.dimension)
        named: list[tuple[fm.Formula, Vector]] = [(item, item) for item in known_vectors(template)]
        for item, glyph in abbreviations(template).items():
            if isinstance(item, Vector):
                named.append((glyph, item))
        for symbol, vector in named:
            yield doc.Display(fm.Equated((symbol, _column(expansion.vector(vector), values))))


def attributes_table(element: Joint | AppliedLoad, values: Mapping[str, float]) -> doc.Table:
    """Return the attributes of a joint or a load: as written, and in numbers."""
    rows: list[tuple[doc.Run | doc.Runs, ...]] = []
    for name, argument in type(element.written).arguments().items():
        symbol = _attribute_symbol(argument.symbol, argument.kind)
        shown: tuple[doc.Run, doc.Run]
        if argument.kind is Kind.BODY:
            shown = doc.Verbatim(element.bodies["ij".index(argument.symbol)].name), ""
        else:
            number = _number(element, argument.symbol, values)
            shown = doc.Math(_attribute(element, argument.symbol)), number
        rows.append((doc.Verbatim(name), doc.Math(symbol), *shown))
    return doc.table(("attribute", "symbol", "as written", "number"), rows)


def _number(element: Joint | AppliedLoad, symbol: str, values: Mapping[str, float]) -> doc.Run:
    """Return an attribute in numbers; a profile has none."""
    if symbol in element.points:
        return doc.Math(_column(element.points[symbol], values))
    if symbol in element.scalars:
        return doc.Math(_decimal(element.scalars[symbol], values))
    return ""


def _attribute_symbol(symbol: str, kind: Kind) -> fm.Formula:
    if kind is Kind.BODY:
        return fm.Glyph(symbol, bold=False)
    if kind in (Kind.POINT, Kind.AXIS, Kind.LOADS):
        return VectorSymbol(symbol)
    return TimeFunction(symbol) if symbol == "C" else Letter(symbol)


def _attribute(joint: Joint | AppliedLoad, symbol: str) -> fm.Formula:
    if symbol in joint.points:
        return fm.column(tuple(_as_written(value) for value in joint.points[symbol]))
    if symbol in joint.profiles:
        return joint.profiles[symbol]
    return _as_written(joint.scalars[symbol])


def _as_written(value: Scalar) -> fm.Formula:
    """Return a number in its digits, or an expression."""
    expression: sympy.Expr = sympy.sympify(value)
    return fm.Decimal(float(expression), 12) if expression.is_Float else expression


def _rule_lines(
    steps: Sequence[Step], coordinate: Expression | None = None
) -> Iterator[tuple[doc.Runs, doc.Run, doc.Run]]:
    for item in telling(steps):
        gives: fm.Formula = item.derivative
        if coordinate is not None:
            gives = block_entry(item.derivative, coordinate, item.expression)
        yield RULES[item.rule], doc.Math(item.expression), doc.Math(gives)


def _fired(lines: list[tuple[doc.Run | doc.Runs, ...]]) -> list[doc.Block]:
    header = ("for", "rule", "applied to", "gives")
    return [doc.table(header, lines, "The rules used")] if lines else []


def _column(values: Sequence[Scalar], known: Mapping[str, float]) -> fm.Matrix:
    return fm.column(tuple(_decimal(value, known) for value in values))


def _decimal(value: Scalar, known: Mapping[str, float]) -> fm.Decimal:
    number = evaluate(value, dict(known))
    return fm.Decimal(float("nan") if number is None else number)

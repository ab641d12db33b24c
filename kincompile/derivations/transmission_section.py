r"""How the Jacobian of a transmission follows from Phi_q, step by step.

With inputs u and outputs x(q, u),

.. math:: \Phi_q\,dq + \Phi_u\,du = 0, \qquad J = x_q\,q_u + x_u, \qquad \tau_u = J^T \tau_x.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from kincompile.calculus.expressions import ONE, ZERO, Number, Product, Scalar, Sum, Symbol
from kincompile.derivations.elimination import Elimination
from kincompile.derivations.evaluation import is_number
from kincompile.derivations.expanded import MINUS_ONE, minus
from kincompile.ir.elimination import LARGEST_CLOSED_FORM
from kincompile.names import rate
from kincompile.report import formulas as fm
from kincompile.report.document import Chapter, Display, Math, NotebookCode, Verbatim, table, text
from kincompile.tables import counted

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    import sympy

    from kincompile.derivations.evaluation import Evaluation
    from kincompile.report.document import Block, Run, Runs
    from kincompile.structure.blocks import Block as Solved
    from kincompile.transmissions.loop import Loop

U, X, J = fm.Glyph("u"), fm.Glyph("x"), fm.Glyph("J")
PHI_U, Q_U, X_Q, X_U = (
    fm.Glyph(x, k) for x, k in (("Phi", "u"), ("q", "u"), ("x", "q"), ("x", "u"))
)
TAU_U, TAU_X = fm.Glyph("tau", "u"), fm.Glyph("tau", "x")
DET = fm.Glyph("det", bold=False)
RATES = fm.Glyph("u", dots=1), fm.Glyph("x", dots=1)


def transmission_section(chosen: Evaluation, loop: Loop) -> Chapter:
    """Return the part of a page that goes from Phi_q to J."""
    steps = _Steps(chosen, loop, Elimination(chosen, loop))
    sections = (
        steps.function(),
        steps.differentials(),
        steps.elimination(),
        steps.blocks(),
        steps.chain_rule(),
        steps.efforts(),
        steps.singular(),
    )
    return Chapter("transmission", ("From Phi_q to the Jacobian J",), (), sections)


@dataclass(frozen=True)
class _Steps:
    chosen: Evaluation
    loop: Loop
    found: Elimination

    def _step(self, number: int, title: str, blocks: Iterable[Block]) -> Chapter:
        return Chapter(f"transmission-{number}", (f"{number}. {title}",), tuple(blocks))

    @cached_property
    def _columns(self) -> Mapping[int, fm.Formula]:
        """The symbols of coordinates, and of the small rotations that replace Euler parameters."""
        names = dict(enumerate(map(Symbol, self.chosen.coordinates)))
        columns: dict[int, fm.Formula] = dict(names)
        for body in self.chosen.system.bodies:
            for column in self.found.plan.bases:
                if self.chosen.coordinates[column] in body.coordinates:
                    own = list(self.found.plan.bases[column])[1:]
                    columns |= {k: fm.Glyph("theta", f"{n},{body.name}", bold=False)
                                for n, k in enumerate(own, start=1)}  # fmt: skip
        return columns

    @cached_property
    def _inputs(self) -> list[Symbol]:
        return [Symbol(name) for name in self.loop.parameters]

    def _equation(self, row: int) -> Verbatim:
        return Verbatim(self.chosen.system.equations[row])

    def _shown(self, *formulas: fm.Formula) -> Iterator[Display]:
        """Yield a line, below those of the intermediate values that are new in it."""
        for name, formula in self.found.writer.introduced():
            yield Display(fm.Equated((name, formula)))
        yield Display(fm.Equated(formulas))

    def _linear(self, terms: Iterable[tuple[int, fm.Formula]]) -> Scalar:
        """Return a sum of differentials, each with a node as its factor."""
        return _sum(
            _times(self.found.writer.operand(node), fm.Differential(symbol))
            for node, symbol in terms
            if not self.found.is_zero(node)
        )

    def _right(self, nodes: Sequence[int]) -> Scalar:
        return self._linear(zip(nodes, self._inputs, strict=True))

    def function(self) -> Chapter:
        """Return what is a function of what."""
        return self._step(1, "Inputs and outputs", self._function())

    def _function(self) -> Iterator[Block]:
        found, values = self.found, self.chosen.values
        rows: list[tuple[Run | Runs, ...]] = [
            (Verbatim(name), "input", Math(Symbol(parameter)), _math(values[parameter]))
            for name, parameter in zip(self.loop.inputs, self.loop.parameters, strict=True)
        ]
        for name, node in zip(self.loop.outputs, found.outputs, strict=True):
            is_rate = name in self.loop.twists
            value = "" if is_rate else _math(found.value(node))
            kind = "velocity" if is_rate else "output"
            rows.append((Verbatim(name), kind, Math(Symbol(name)), value))
        yield text(f"The numbers are those at {self.chosen.origin}.")
        yield table(("name", "", "symbol", "value"), rows)
        for name, node in zip(self.loop.outputs, found.outputs, strict=True):
            if name not in self.chosen.coordinates:
                yield from self._shown(Symbol(name), found.writer.formula(node))
        if self.loop.twists:
            yield text(
                f"Velocities, linear in the rates of coordinates: {', '.join(self.loop.twists)}. "
                "They are the rates of no output; J maps the rates of the inputs to them."
            )
        if self.loop.held:
            yield text(f"No output sees, and held is: {', '.join(self.loop.held)}.")

    def differentials(self) -> Chapter:
        """Return the equations, and each as one in differentials."""
        return self._step(2, "The equations, and their differentials", self._differentials())

    def _differentials(self) -> Iterator[Block]:
        found, chosen = self.found, self.chosen
        yield text("The loop is closed where ", Math(_is_zero(_of(fm.PHI, fm.Q, U))), ":")
        for row, node in enumerate(found.rows):
            yield from self._shown(chosen.symbol("Phi", row), found.writer.formula(node), ZERO)
        yield text("A small change of the inputs keeps it closed:")
        both = fm.Joined((fm.PHI_Q, fm.Differential(fm.Q), "+", PHI_U, fm.Differential(U)))
        yield Display(_is_zero(both))
        entries: dict[int, dict[int, int]] = {}
        long: list[tuple[fm.DerivativeSymbol, int]] = []
        for entry in chosen.code.entries("Phi_q"):
            entries.setdefault(entry.row, {})[entry.column] = entry.node
            long += self._symbolized(chosen.partial(entry), entry.node)
        for row, own in enumerate(found.by_inputs):
            terms = [(node, self._columns[k]) for k, node in sorted(entries.get(row, {}).items())]
            yield from self._shown(
                self._linear([*terms, *zip(own, self._inputs, strict=True)]), ZERO
            )
        note = "Derivatives too long for a line; the page of the constraints derives them:"
        yield from self._numbered(long, note)

    def _symbolized(
        self, symbol: fm.DerivativeSymbol, node: int
    ) -> list[tuple[fm.DerivativeSymbol, int]]:
        """Let a derivative that is too long for a line stand as its symbol, from now on."""
        if not self.found.writer.is_long(node):
            return []
        self.found.writer.called(node, symbol)
        return [(symbol, node)]

    def _numbered(
        self, long: Sequence[tuple[fm.DerivativeSymbol, int]], note: str
    ) -> Iterator[Block]:
        """Yield the numbers of derivatives that stand as their symbols."""
        if long:
            rows = [(Math(symbol), _math(self.found.value(node))) for symbol, node in long]
            yield text(note)
            yield table(("derivative", "number"), rows)

    def elimination(self) -> Chapter:
        """Return what single equations give, in the order of the compiler's plan."""
        return self._step(3, "One coordinate from one equation", self._elimination())

    def _elimination(self) -> Iterator[Block]:
        plan, program = self.found.plan, self.chosen.code.program
        if program.redundant:
            names: list[Run] = [x for name in program.redundant for x in (", ", Verbatim(name))]
            yield text("Left out, because they repeat others: ", *names[1:], ".")
        yield text(
            "An equation in which a coordinate has a plain number as its factor gives that "
            "coordinate by the others, at every position. It is then put into the equations that "
            "are left. The compiler takes the one first that makes the fewest new terms."
            if plan.pivots
            else "No coordinate has a plain number as its factor."
        )
        for number, pivot in enumerate(plan.pivots, start=1):
            yield text(f"({number}) ", self._equation(pivot.row), " gives:")
            terms = self.found.row(pivot.row)
            divisor = self.found.writer.formula(terms.pop(pivot.column))
            others = self._linear((node, self._columns[k]) for k, node in terms.items())
            right = _less(self._right(self.found.side(pivot.row)), others)
            left = _times(divisor, fm.Differential(self._columns[pivot.column]))
            if divisor == MINUS_ONE:
                left, right = _negated(left), _less(ZERO, right)
            yield from self._shown(left, right)
        yield from self._turned()

    def _turned(self) -> Iterator[Block]:
        """Yield the small rotations that stand for Euler parameters."""
        if not self.found.plan.bases:
            return
        theta = fm.Differential(fm.Glyph("theta", bold=False))
        yield text(
            "The Euler parameters of a body change with a small rotation ", Math(theta), " about "
            "three directions fixed in it, and its own row keeps their length, so that three "
            "unknowns stand for four:",
        )  # fmt: skip
        for column in self.found.plan.bases:
            basis = self.found.basis(column)
            turned = self._linear((node, self._columns[k]) for k, node in basis.items())
            yield from self._shown(fm.Differential(self._columns[column]), turned)

    def blocks(self) -> Chapter:
        """Return what is left, block by block, and the rates of all coordinates."""
        return self._step(4, "What is left, solved together", self._blocks())

    @property
    def _is_short(self) -> bool:
        """Whether all blocks are solved by Cramer's rule, and can be written out."""
        return all(len(x.rows) <= LARGEST_CLOSED_FORM for x in self.found.plan.blocks)

    def _blocks(self) -> Iterator[Block]:
        found = self.found
        for number, block in enumerate(found.plan.blocks, start=1):
            yield from self._block(number, block)
        if not found.plan.blocks:
            yield text("Nothing is left: every coordinate has its equation.")
        if self._is_short:
            yield text("So every coordinate moves with the inputs by")
            for name, slopes in zip(self.chosen.coordinates, found.slopes, strict=True):
                for symbol, node in zip(self._inputs, slopes, strict=True):
                    formula = found.writer.formula(node)
                    known = self._known(formula, None, node)
                    yield from self._shown(_slope(Symbol(name), symbol), formula, *known)
            return
        rows: list[tuple[Run | Runs, ...]] = [
            (Verbatim(name), *(_math(found.value(node)) for node in slopes))
            for name, slopes in zip(self.chosen.coordinates, found.slopes, strict=True)
        ]
        yield text("So every coordinate moves with the inputs by")
        yield table(("coordinate", *(Math(_slope(fm.Q, x)) for x in self._inputs)), rows)

    def _block(self, number: int, block: Solved) -> Iterator[Block]:
        found, size = self.found, len(block.rows)
        names: list[Run] = [x for row in block.rows for x in (", ", self._equation(row))]
        yield text("With these, ", *names[1:], " become")
        for row in block.rows:
            terms = [(node, self._columns[k]) for k, node in found.row(row).items()
                     if k in self._columns]  # fmt: skip
            yield from self._shown(self._linear(terms), self._right(found.side(row)))
        nodes, symbol = found.determinants[number - 1], self._determinant(number)
        if size > LARGEST_CLOSED_FORM:
            yield text(
                f"{counted(size, 'equation')} together: the compiler eliminates them in "
                "straight-line code, which is too long for this page. Their determinant is"
            )
            yield Display(fm.Equated((symbol, fm.Decimal(self._product(nodes)))))
            return
        yield text("Cramer's rule solves them where their determinant is not zero:")
        formula, short = found.writer.formula(nodes[0]), found.shorter(nodes[0])
        lines = list(self._shown(symbol, formula, *self._known(formula, short, nodes[0])))
        yield from lines
        if not is_number(formula):
            found.writer.called(nodes[0], symbol.name)

    def _known(
        self, formula: Scalar, short: sympy.Expr | None, node: int
    ) -> tuple[fm.Formula, ...]:
        """Return the shorter form of a formula, and its number; nothing of a plain number."""
        shorter = () if short is None else (short,)
        return () if is_number(formula) else (*shorter, fm.Decimal(self.found.value(node)))

    def _determinant(self, number: int) -> Symbol:
        return Symbol(f"D_{number}")

    def _product(self, nodes: Sequence[int]) -> float:
        total = 1.0
        for node in nodes:
            total *= self.found.value(node)
        return total

    def chain_rule(self) -> Chapter:
        """Return J by the chain rule."""
        return self._step(5, "The chain rule", self._chain_rule())

    def _chain_rule(self) -> Iterator[Block]:
        found = self.found
        yield Display(fm.Equated((J, fm.Joined((X_Q, Q_U, "+", X_U)))))
        if self.loop.twists:
            yield text(
                "A velocity has its derivatives by the rates of coordinates in the place of ",
                Math(X_Q), ", since these are ", Math(fm.Joined((Q_U, RATES[0]))), ".",
            )  # fmt: skip
        long: list[tuple[fm.DerivativeSymbol, int]] = []
        for name, row, direct in zip(self.loop.outputs, found.x_q, found.x_u, strict=True):
            if name in self.chosen.coordinates:
                continue
            by = [*self.chosen.coordinates, *self.loop.parameters]
            for given, node in zip(by, (*row, *direct), strict=True):
                left = fm.DerivativeSymbol(Symbol(name), self._way(name, given))
                if is_long := self._symbolized(left, node):
                    long += is_long
                elif not found.is_zero(node):
                    yield from self._shown(left, found.writer.formula(node))
        yield from self._numbered(long, "Derivatives of the outputs too long for a line:")
        for name, row, direct, entries in zip(
            self.loop.outputs, found.x_q, found.x_u, found.J, strict=True
        ):
            for symbol, at_once, node in zip(self._inputs, direct, entries, strict=True):
                left = _slope(Symbol(name), self._way(name, symbol.name))
                parts = (
                    [] if name in self.chosen.coordinates else [self._chained(name, row, symbol)]
                )
                if parts and not found.is_zero(at_once):
                    own = fm.DerivativeSymbol(Symbol(name), symbol)
                    parts = [fm.Joined((*parts, "+", own))]
                if (short := found.shorter(node)) is not None:
                    parts.append(short)
                elif name in self.chosen.coordinates and self._is_short:
                    parts.append(found.writer.formula(node))
                yield from self._shown(left, *parts, fm.Decimal(found.value(node)))
        yield Display(fm.Equated((J, fm.decimals(found.array(found.J)))))
        yield self._again()

    def _way(self, output: str, name: str) -> Symbol:
        """Return by what an output is differentiated: a velocity by rates."""
        return Symbol(rate(name) if output in self.loop.twists else name)

    def _chained(self, name: str, row: Sequence[int], symbol: Symbol) -> fm.Formula:
        parts: list[fm.Formula | str] = []
        for given, node in zip(self.chosen.coordinates, row, strict=True):
            if not self.found.is_zero(node):
                own = fm.DerivativeSymbol(Symbol(name), self._way(name, given))
                parts += ["+", own, _slope(Symbol(given), symbol)]
        return fm.Joined(tuple(parts[1:])) if parts else ZERO

    def _again(self) -> NotebookCode:
        found = self.found
        arrays = (("Phi_u", found.by_inputs), ("x_q", found.x_q), ("x_u", found.x_u))
        lines = [f"{name} = np.array({found.array(nodes).tolist()})" for name, nodes in arrays]
        solved = "q_u = np.linalg.lstsq(Phi_q(q, t, p), -Phi_u, rcond=None)[0]"
        return NotebookCode("\n".join((*lines, solved, "print(x_q @ q_u + x_u)  # J")))

    def efforts(self) -> Chapter:
        """Return the torque map, from power."""
        return self._step(6, "Efforts, from power", self._efforts())

    def _efforts(self) -> Iterator[Block]:
        u_dot, x_dot = RATES
        row = fm.Glyph("tau", "x", exponent="T")
        yield text("What the inputs supply is what the outputs deliver, at all rates ", Math(u_dot))
        supplied = fm.Joined((fm.Glyph("tau", "u", exponent="T"), u_dot))
        yield Display(fm.Equated((supplied, fm.Joined((row, x_dot)), fm.Joined((row, J, u_dot)))))
        yield text("and therefore")
        product = fm.Joined((fm.Glyph("J", exponent="T"), TAU_X))
        numbers = fm.Joined((fm.decimals(self.found.array(self.found.J).T), TAU_X))
        yield Display(fm.Equated((TAU_U, product, numbers)))
        yield text("A load on an output is ", Math(fm.Joined(("-", TAU_X))), ".")

    def singular(self) -> Chapter:
        """Return where the outputs move with inputs at rest, and where an output stands still."""
        return self._step(7, "Singular positions", self._singular())

    def _singular(self) -> Iterator[Block]:
        found = self.found
        yield text(
            "Output singularity (type 2): ", Math(fm.PHI_Q), " is singular, the outputs move with "
            "the inputs locked, and two assemblies meet. It is where one of these is zero:",
        )  # fmt: skip
        for number, nodes in enumerate(found.determinants, start=1):
            short = found.shorter(nodes[0]) if len(nodes) == 1 else None
            parts = () if short is None else (short,)
            value = fm.Decimal(self._product(nodes))
            yield Display(fm.Equated((self._determinant(number), *parts, value)))
        if len(self.loop.inputs) != len(self.loop.outputs):
            yield text("There are not as many outputs as inputs, so that J has no determinant.")
            return
        yield text(
            "Input singularity (type 1): some direction of the outputs stands still, a dead point. "
            "It is where this is zero:"
        )
        short = found.short_determinant
        parts = () if short is None else (short,)
        value = fm.Decimal(float(np.linalg.det(found.array(found.J))))
        yield Display(fm.Equated((fm.Joined((DET, J)), *parts, value)))


def _math(value: float) -> Math:
    return Math(fm.Decimal(value))


def _is_zero(formula: fm.Formula) -> fm.Equated:
    return fm.Equated((formula, ZERO))


def _of(function: fm.Formula, *arguments: fm.Formula) -> fm.Joined:
    listed = [part for item in arguments for part in (",", item)]
    return fm.Joined((function, "(", *listed[1:], ")"))


def _slope(of: fm.Formula, by: fm.Formula) -> fm.DerivativeSymbol:
    return fm.DerivativeSymbol(of, by, "d")


def _times(factor: Scalar, differential: Scalar) -> Scalar:
    if factor == ONE:
        return differential
    factors = factor.factors if isinstance(factor, Product) else (factor,)
    return Product((*factors, differential))


def _sum(terms: Iterable[Scalar]) -> Scalar:
    found = tuple(terms)
    return found[0] if len(found) == 1 else Sum(found)


def _less(value: Scalar, other: Scalar) -> Scalar:
    """Return a sum less another one, term by term."""
    terms = [list(x.terms) if isinstance(x, Sum) else [x] for x in (value, other)]
    found = [x for x in (*terms[0], *map(_negated, terms[1])) if x != ZERO]
    return _sum(found) if found else ZERO


def _negated(term: Scalar) -> Scalar:
    """Return a term with the other sign; of two signs nothing is left."""
    match term:
        case Product((Number() as first, *rest)) if first == MINUS_ONE:
            return rest[0] if len(rest) == 1 else Product(tuple(rest))
    return minus(term)

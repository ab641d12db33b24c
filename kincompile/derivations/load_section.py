"""Masses and loads: virtual work in vectors, what follows from it, and the equations of motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import sympy

from kincompile.calculus import expressions as ex
from kincompile.derivations.joint_section import attributes_table
from kincompile.derivations.joint_terms import parts
from kincompile.derive.loads import derive_load
from kincompile.derive.rules import along
from kincompile.ir.interpret import interpret
from kincompile.model.expressions import evaluate
from kincompile.model.matrices import load_entries
from kincompile.report import formulas as fm
from kincompile.report.document import Chapter, Display, Math, Verbatim, table, text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from kincompile.calculus.symbols import Frame
    from kincompile.derivations.evaluation import Evaluation
    from kincompile.derive.loads import LoadTemplate
    from kincompile.derive.rules import Direction
    from kincompile.model.resolve_loads import AppliedLoad
    from kincompile.report.document import Block, Run, Runs

FORCES, DELTA = fm.Glyph("Q"), fm.Glyph("delta", bold=False)
PHI_Q_TRANSPOSED = fm.Glyph("Phi", "q", exponent="T")
WORK, ENERGY = fm.Joined((DELTA, fm.Glyph("W", bold=False))), fm.Glyph("T", bold=False)

LARGEST_SYSTEM = 9
"""Coordinates up to which M is written out in numbers."""


def loads_section(evaluation: Evaluation) -> Chapter:
    """Return the part of the page on masses and loads, and the equations of motion."""
    note = text(
        "A load is written down as the work that it does when what it acts on moves by a little, "
        "a mass also as its kinetic energy. ", Math(FORCES), " is that work for unit "
        "displacements, with ", Math(fm.Joined((fm.Sub(ENERGY, fm.Glyph("q")), ))),
        " less the rate of the momenta; ", Math(fm.MASS), " is the second derivative of the energy "
        "by the rates.",
    )  # fmt: skip
    sections = (*(_section(evaluation, load) for load in evaluation.system.loads),)
    return Chapter("loads", ("Masses and loads",), (note,), (*sections, _motion(evaluation)))


def load_abbreviations(template: LoadTemplate) -> dict[ex.Expression, fm.Glyph]:
    """Name the vector between the points of a load and its rate, torque and rate of a hinge."""
    q_dot: Direction = dict(zip(template.coordinates, template.rates, strict=True))
    found = (item for _, moved in template.work for item in parts(moved))
    names: dict[ex.Expression, fm.Glyph] = {}
    for item in found:
        if isinstance(item, ex.Norm) and isinstance(item.vector, ex.VectorSum):
            names[item.vector] = fm.Glyph("d")
            names[along(item.vector, q_dot)] = fm.Glyph("d", dots=1)
    if len(template.frames) > 1 and len(template.work) > 1:  # a couple about a hinge in space
        rates: list[ex.Scalar] = []
        for force, moved in template.work:
            assert isinstance(force, ex.Vector)
            assert isinstance(moved, ex.Vector)
            torque, way = ex.split_factor(force)
            rates.append(ex.dot(way, along(moved, q_dot)))
            if isinstance(torque, ex.Sum):
                names[torque] = fm.Glyph("tau", bold=False)
        names[ex.sum_of(tuple(rates))] = fm.Glyph("omega", bold=False)
    return names


def _section(evaluation: Evaluation, load: AppliedLoad) -> Chapter:
    name = load.name
    steps = (
        _step(load, 1, "What it is", attributes_table(load, evaluation.values), level=""),
        _step(load, 2, "Work and energy in vectors", *_works(load), level="vector"),
        _step(load, 3, "What follows for its coordinates", *_derived(load), level="vector"),
        _step(load, 4, "Expanded, and in numbers", *_expanded(evaluation, load), level="expanded"),
    )
    title: Runs = (f"{load.template.type_name} ", Verbatim(name))
    return Chapter(f"load-{name}", title, (), steps)


def _step(load: AppliedLoad, number: int, title: str, *blocks: Block, level: str) -> Chapter:
    anchor = f"{load.name}-load-{number}"
    return Chapter(anchor, (f"{number}. {title}",), blocks, (), level)


def _works(load: AppliedLoad) -> Iterator[Block]:
    """Yield kinetic energy and virtual work, as they were written down."""
    template = load.template
    if template.energy != ex.ZERO:
        yield Display(fm.Equated((ENERGY, template.energy)))
    for force, moved in template.work:
        first: fm.Formula = fm.Transposed(force) if isinstance(force, ex.Vector) else force
        opened = ("(", first, ")") if isinstance(force, ex.Scalar) else (first,)
        yield Display(fm.Equated((WORK, fm.Joined((*opened, DELTA, "(", moved, ")")))))
    if names := load_abbreviations(template):
        yield text("with")
        for item, glyph in names.items():
            yield Display(fm.Equated((glyph, item)))


def _derived(load: AppliedLoad) -> Iterator[Block]:
    """Yield Q by coordinate, and the entries of M on and above the diagonal."""
    found = derive_load(load.template, load.others, varies=load.varies)
    names = [name for frame in load.template.frames for name in _components(frame)]
    for coordinate, force in zip(names, found.Q, strict=True):
        if force != ex.ZERO:
            yield Display(fm.Equated((fm.Sub(FORCES, coordinate), force)))
    for row, entries in enumerate(found.M):
        for column, entry in enumerate(entries[row:], row):
            if entry != ex.ZERO:
                both = fm.Joined((names[row], ",", names[column]))
                yield Display(fm.Equated((fm.Sub(fm.MASS, both), entry)))


def _components(frame: Frame) -> Iterator[fm.Formula]:
    """Yield the symbols of the coordinates of a body, one by one."""
    for item in frame.coordinates:
        if item == frame.r:
            yield from (fm.Glyph(letter, frame.index, bold=False) for letter in "xyz"[: item.size])
        elif item.size > 1:
            yield from (fm.Glyph(f"e{k}", frame.index, bold=False) for k in range(item.size))
        else:
            yield item


def _expanded(evaluation: Evaluation, load: AppliedLoad) -> Iterator[Block]:
    names = evaluation.coordinates
    for quantity, symbol in (("Q", FORCES), ("M", fm.MASS)):
        rows: list[tuple[Run | Runs, ...]] = []
        for row, column, value in load_entries(evaluation.system, load, quantity):
            if value == 0 or (quantity == "M" and column < row):
                continue
            places: Runs = (Verbatim(names[row]),)
            if quantity == "M":
                places = (*places, ", ", Verbatim(names[column]))
            number = evaluate(value, dict(evaluation.values))
            shown = Math(fm.Decimal(float("nan") if number is None else number))
            rows.append((places, Math(sympy.sympify(value)), shown))
        if rows:
            yield table(("row", Math(symbol), "number"), rows)


def _motion(evaluation: Evaluation) -> Chapter:
    states = evaluation.q, evaluation.q_dot, evaluation.t, evaluation.p
    program = evaluation.code.program
    found = dict(
        zip((item.name for item in program.quantities), interpret(program, *states), strict=True)
    )
    whole = fm.Joined((fm.MASS, fm.Q_DDOT, "+", PHI_Q_TRANSPOSED, fm.LAMBDA))
    blocks: list[Block] = [Display(fm.Equated((whole, FORCES)))]
    if len(evaluation.coordinates) <= LARGEST_SYSTEM:
        blocks.append(text(f"At {evaluation.origin}:"))
        blocks += [Display(fm.Equated((fm.MASS, fm.decimals(found["M"]))))]
        blocks += [Display(fm.Equated((FORCES, fm.decimals(found["Q"]))))]
    sides = found["Q"] - found["M"] @ evaluation.q_ddot
    if evaluation.is_assembled and np.isfinite(sides).all():
        factors = np.linalg.lstsq(evaluation.Phi_q.T, sides, rcond=None)[0]
        equations = evaluation.system.equations
        rows: list[tuple[Run | Runs, ...]] = [
            (Verbatim(name), Math(fm.Decimal(float(value))))
            for name, value in zip(equations, factors, strict=True)
        ]
        moved = text("With the acceleration of the motion the multipliers follow, the reactions:")
        blocks += [moved, table(("equation", Math(fm.LAMBDA)), rows)]
    return Chapter("motion", ("The equations of motion",), tuple(blocks), (), "numeric")

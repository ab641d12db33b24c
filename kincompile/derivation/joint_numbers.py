"""The last step of a joint: its vectors and blocks in numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import Vector
from kincompile.derivation.document import Display, Math, Section, text
from kincompile.derivation.formulas import Decimal, Equated, Glyph, column, decimals
from kincompile.derivation.joint_terms import abbreviations, known_vectors
from kincompile.derivation.rows_steps import result_blocks, state_table, step
from kincompile.model.expressions import evaluate
from kincompile.model.matrices import SymbolicEnvironment

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from kincompile.derivation.derivation_page import Page
    from kincompile.derivation.document import Block, Run
    from kincompile.derivation.formulas import Formula
    from kincompile.ir.inline import Section as Rows
    from kincompile.model.resolve import Joint


def values_of(joint: Joint, symbol: str, values: Mapping[str, float]) -> Run:
    """Return an attribute in numbers, nothing for a profile."""
    known = dict(values)
    if symbol in joint.points:
        x, y = (evaluate(value, known) for value in joint.points[symbol])
        return Math(column((_decimal(x), _decimal(y))))
    if symbol in joint.scalars:
        return Math(_decimal(evaluate(joint.scalars[symbol], known)))
    return ""


def numbers_step(page: Page, joint: Joint, rows: Rows) -> Section:
    """Return the step in numbers, at the chosen state."""
    shown: list[Block] = [text(f"At {page.situation.origin}:")]
    shown.append(state_table(page, [name for name in joint.columns if name is not None]))
    shown += _matrices(page, joint)
    shown += _vectors(page, joint)
    shown += result_blocks(page, joint.name, rows)
    return step(joint.name, 9, "In numbers", "numeric", *shown)


def _matrices(page: Page, joint: Joint) -> Iterator[Block]:
    values = page.situation.values
    for frame, body in zip(joint.template.frames, joint.bodies, strict=True):
        angle = evaluate(body.phi, values) or 0.0
        c, s = np.cos(angle), np.sin(angle)
        turned = decimals(np.array([[c, -s], [s, c]]))
        derivative = decimals(np.array([[-s, -c], [c, -s]]))
        yield Display(Equated((Glyph("A", frame.index), turned)))
        yield Display(Equated((Glyph("B", frame.index), derivative)))


def _vectors(page: Page, joint: Joint) -> Iterator[Block]:
    expansion = Expansion(SymbolicEnvironment(joint))
    values = page.situation.values
    named: list[tuple[Formula, Vector]] = [(item, item) for item in known_vectors(joint.template)]
    for item, glyph in abbreviations(joint.template).items():
        if isinstance(item, Vector):
            named.append((glyph, item))
    for symbol, vector in named:
        x, y = (evaluate(item, values) for item in expansion.vector(vector))
        yield Display(Equated((symbol, column((_decimal(x), _decimal(y))))))


def _decimal(value: float | None) -> Decimal:
    return Decimal(float("nan") if value is None else value)

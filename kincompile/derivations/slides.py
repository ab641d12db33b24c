"""A derivation as slides: one constraint each, with its figure, Phi, Phi_q, nu and gamma."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from kincompile.report.document import Chapter, Display, Figure
from kincompile.report.formulas import Equated, Glyph

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from kincompile.report.document import Block, Manuscript

ATTRIBUTES, CONSTRAINT, JACOBIAN, NU, GAMMA = 1, 2, 4, 5, 6
"""Steps that a slide shows a part of."""


def slides_of(document: Manuscript) -> Manuscript:
    """Return a derivation as slides: the mechanism, then constraints or the steps to J."""
    unknowns, chapter, *_ = document.sections
    drawn = tuple(item for item in unknowns.blocks if isinstance(item, Figure))
    is_nine = chapter.anchor == "constraints"  # of a transmission each step is a slide as it is
    slides = map(_slide, chapter.sections) if is_nine else chapter.sections
    first = (Chapter("mechanism", ("The mechanism",), drawn),) if drawn else ()
    return replace(document, sections=(*first, *slides))


def _slide(chapter: Chapter) -> Chapter:
    name = chapter.anchor.removeprefix("constraint-")
    steps = {item.anchor: item.blocks for item in chapter.sections}

    def shown(number: int) -> tuple[Block, ...]:
        return steps.get(f"{name}-step-{number}", ())

    blocks = (
        *(item for item in shown(ATTRIBUTES) if isinstance(item, Figure)),
        *shown(CONSTRAINT),
        *_displays(shown(JACOBIAN)),
        *_displays(shown(NU)),
        *_last_of_each(_displays(shown(GAMMA))),
    )
    return Chapter(chapter.anchor, chapter.title, blocks)


def _displays(blocks: Iterable[Block]) -> Iterator[Display]:
    return (item for item in blocks if isinstance(item, Display))


def _last_of_each(displays: Iterable[Display]) -> list[Display]:
    """Return the last line of each gamma, the collected one where there is one."""
    found: dict[Glyph, Display] = {}
    for item in displays:
        match item.formula:
            case Equated((Glyph("gamma") as symbol, *_)):
                found[symbol] = item
    return list(found.values())

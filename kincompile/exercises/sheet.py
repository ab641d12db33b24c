"""The page of a student: the mechanism drawn, its constraints in vectors, blanks, hints."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import sympy

from kincompile.calculus.expressions import Symbol, VectorSymbol
from kincompile.calculus.space import EulerRotation
from kincompile.derivations.assembled import orientation_in_words
from kincompile.derivations.derivation import constraint_chapters
from kincompile.derivations.evaluation import evaluation
from kincompile.derivations.figures import Figures
from kincompile.exercises.blanks import DIGITS, PLACE
from kincompile.model.resolve import Joint
from kincompile.names import rate
from kincompile.report import document as doc
from kincompile.report import formulas as fm

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.exercises.blanks import Blank, State
    from kincompile.exercises.mistakes import Mistake
    from kincompile.model.system import ConstraintSystem

RULE_STEP, BLOCK_STEP, GAMMA_STEP = 2, 3, 5
"""Steps of a derivation, from 0, that hints are taken from."""

BOX, LINE = doc.Box(), doc.Box(is_wide=True)
"""Where a number and a formula are written on paper."""


def sheet(
    system: ConstraintSystem,
    blanks: Sequence[Blank],
    mistakes: Sequence[Mistake],
    student: str,
    state: State | None = None,
) -> doc.Manuscript:
    """Return the page of one student; with a state a sheet of an exam, to be filled on paper."""
    figures = Figures(evaluation(system, None))
    names, chapters = constraint_chapters(figures)
    given = tuple(
        doc.Chapter(item.anchor, item.title, (), item.sections[:2])
        for item, constraint in zip(chapters, system.constraints, strict=True)
        if isinstance(constraint, Joint) or mistakes
    )
    constraints = doc.Chapter("given", ("The constraints",), (), given)
    if state is not None:
        parts = (_taker(), _mechanism(figures), constraints, _form(system, blanks, state))
        summary = "Fill the boxes."
        return doc.Manuscript(system.name, summary, parts, names)
    parts = (
        _mechanism(figures),
        constraints,
        _to_be_found(system, mistakes) if mistakes else _tasks(system, blanks),
        _hints(system, blanks, chapters),
    )
    summary = f"Student {student}. Write the formulas into hand_in.txt, which has a line for each."
    return doc.Manuscript(system.name, summary, parts, names)


def together(name: str, sheets: Mapping[str, doc.Manuscript]) -> doc.Manuscript:
    """Return all sheets of an exam as one page, to be printed."""
    chapters = tuple(
        doc.Chapter(
            f"sheet-{student}",
            (f"Sheet {student}: ", doc.Verbatim(name)),
            (doc.text(page.summary),),
            tuple(_of_sheet(item, student) for item in page.sections),
        )
        for student, page in sheets.items()
    )
    names = {key: glyph for page in sheets.values() for key, glyph in page.abbreviations.items()}
    return doc.Manuscript(name, f"{len(sheets)} sheets.", chapters, names)


def _of_sheet(chapter: doc.Chapter, student: str) -> doc.Chapter:
    """Return a chapter whose anchors are those of one sheet."""
    blocks = tuple(
        replace(item, anchor="") if isinstance(item, doc.Display) else item
        for item in chapter.blocks
    )
    sections = tuple(_of_sheet(item, student) for item in chapter.sections)
    return replace(chapter, anchor=f"{student}-{chapter.anchor}", blocks=blocks, sections=sections)


def solutions(
    name: str,
    systems: Sequence[ConstraintSystem],
    blanks: Sequence[Sequence[Blank]],
    mistakes: Sequence[Sequence[Mistake]],
    students: Sequence[str],
    values: Sequence[Sequence[str]] = (),
) -> doc.Manuscript:
    """Return the page of the instructor: the right formula of every blank of every student.

    Of an exam `values` are the numbers, as they belong on each sheet.
    """
    chapters = []
    for k, (system, own, slips, student) in enumerate(
        zip(systems, blanks, mistakes, students, strict=True)
    ):
        numbers = dict(zip(own, values[k], strict=True)) if values else {}
        derived = system.Phi_q, system.gamma
        texts = {item.entry: item.text for item in slips}
        rows: list[tuple[doc.Run | doc.Runs, ...]] = [
            (
                item.name,
                doc.Math(_symbol(item, system)),
                doc.Math(item.answer(*derived)),
                *((texts[item],) if slips else ()),
                *((numbers[item],) if numbers else ()),
            )
            for item in own
            if item.quantity != PLACE
        ]
        header = ("blank", "entry", "formula", *(("the slip",) if slips else ()))
        header = (*header, f"value, {DIGITS} digits") if numbers else header
        shown = doc.table(header, rows)
        chapters.append(doc.Chapter(f"student-{student}", (f"Student {student}",), (shown,)))
    summary = f"{len(systems)} students, {len(blanks[0])} blanks each. Not for students."
    return doc.Manuscript(name, summary, tuple(chapters))


def _mechanism(figures: Figures) -> doc.Chapter:
    system = figures.evaluation.system
    blocks: list[doc.Block] = []
    if (shown := figures.mechanism()) is not None:
        blocks.append(doc.Figure(shown))
    if not system.bodies:
        rows_of_names: list[tuple[doc.Run | doc.Runs, ...]] = [
            (doc.Verbatim(item.name), item.unit) for item in system.coordinates
        ]
        names = doc.table(("coordinate", "unit"), rows_of_names)
        return doc.Chapter("mechanism", ("The coordinates",), (names,))
    kind = system.ground.kind
    blocks += orientation_in_words(system)
    blocks.append(
        doc.text(
            f"The coordinates of a body are {kind.placed_by}; points and directions of bodies "
            "are given in their frames. The ground is fixed."
        )
    )
    rows: list[tuple[doc.Run | doc.Runs, ...]] = [
        (doc.Verbatim(body.name), *(doc.Verbatim(name) for name in body.coordinates))
        for body in system.bodies
    ]
    blocks.append(doc.table(("body", *kind.letters), rows))
    return doc.Chapter("mechanism", ("The mechanism",), tuple(blocks))


def _symbol(blank: Blank, system: ConstraintSystem) -> fm.Formula:
    """Return the symbol of an entry: the derivative of its Phi, or its gamma."""
    equation = system.equations[blank.row]
    if blank.column is None:
        return fm.Glyph("gamma", equation, bold=False)
    name = system.coordinates[blank.column].name
    return fm.DerivativeSymbol(fm.Glyph("Phi", equation, bold=False), Symbol(name))


def _tasks(system: ConstraintSystem, blanks: Sequence[Blank]) -> doc.Chapter:
    last = system.bodies[0].coordinates[-1]
    way = system.ground.kind.written_in
    note = doc.text(
        f"Derive each entry in {way}, with the numbers of this page and the names of "
        "the coordinates; the rate of ", doc.Verbatim(last), " is ", doc.Verbatim(rate(last)),
        ". With ", doc.Math(fm.Equated((fm.Joined((fm.PHI_Q, fm.Q_DDOT)), fm.GAMMA))),
        ", gamma is what stands on the right side of the acceleration equation.",
    )  # fmt: skip
    rows: list[tuple[doc.Run | doc.Runs, ...]] = [
        (doc.Verbatim(item.name), doc.Math(_symbol(item, system)), LINE) for item in blanks
    ]
    shown = doc.table(("blank", "entry", "formula"), rows)
    return doc.Chapter("tasks", ("The blanks",), (note, shown))


def _taker() -> doc.Chapter:
    """Return the boxes for who takes the exam."""
    boxes = doc.table(("name", "number", "date"), [(BOX, BOX, BOX)])
    return doc.Chapter("taker", ("Who takes the exam",), (boxes,))


def _form(system: ConstraintSystem, blanks: Sequence[Blank], state: State) -> doc.Chapter:
    """Return the state at which numbers are asked for, and boxes for formulas and numbers."""
    given: list[tuple[doc.Run | doc.Runs, ...]] = [
        (doc.Verbatim(x.name), f"{state[x.name]:g}", doc.Verbatim(rate(x.name)), f"{own:g}")
        for x in system.coordinates
        for own in (state[rate(x.name)],)
    ]
    note = doc.text(
        "Derive each entry, and give its value at this state, at t = ", f"{state['t']:g}", " s, to "
        f"{DIGITS} significant digits. Angles are in radians. With ",
        doc.Math(fm.Equated((fm.Joined((fm.PHI_Q, fm.Q_DDOT)), fm.GAMMA))),
        ", gamma is what stands on the right side of the acceleration equation.",
    )  # fmt: skip
    rows: list[tuple[doc.Run | doc.Runs, ...]] = [
        (doc.Verbatim(item.name), doc.Math(_symbol(item, system)), LINE, BOX) for item in blanks
    ]
    blocks = (
        note,
        doc.table(("coordinate", "value", "rate", "value"), given),
        doc.table(("blank", "entry", "formula", "value"), rows),
    )
    return doc.Chapter("tasks", ("The boxes",), blocks)


def _to_be_found(system: ConstraintSystem, mistakes: Sequence[Mistake]) -> doc.Chapter:
    """Return the Jacobians with a slip each."""
    note = doc.text(
        "Each of these Jacobians was derived by hand, and one of its entries is wrong. Find it, "
        "and derive what belongs there. The constraints as given above are right. Entries that are "
        "not listed are zero, and are so rightly."
    )
    parts = []
    for item in mistakes:
        rows: list[tuple[doc.Run | doc.Runs, ...]] = [
            (doc.Verbatim(entry.label(system)), doc.Math(_symbol(entry, system)), doc.Math(formula))
            for (row, column), formula in item.rows.items()
            for entry in (replace(item.entry, row=row, column=column),)
        ]
        shown = doc.table(("entry", "derivative", "as derived by hand"), rows)
        asked = doc.text(
            doc.Verbatim(item.place.name), ": the wrong entry ", LINE, "   ",
            doc.Verbatim(item.entry.name), ": what belongs there ", LINE,
        )  # fmt: skip
        names: doc.Runs = (
            f"{item.place.name}, {item.entry.name}: ",
            doc.Verbatim(item.entry.constraint),
        )
        parts.append(doc.Chapter(f"mistake-{item.place.name}", names, (shown, asked)))
    return doc.Chapter("tasks", ("Find the mistake",), (note,), tuple(parts))


def _hints(
    system: ConstraintSystem, blanks: Sequence[Blank], chapters: Sequence[doc.Chapter]
) -> doc.Chapter:
    """Return three hints for each constraint and quantity that has a blank, folded away."""
    found: list[doc.Chapter] = []
    for chapter, constraint in zip(chapters, system.constraints, strict=True):
        for quantity in ("Phi_q", "gamma"):
            own = [x for x in blanks if (x.constraint, x.quantity) == (constraint.name, quantity)]
            if not own or not isinstance(constraint, Joint):
                continue
            steps = [*_three(quantity, constraint, chapter)]
            anchor = f"hints-{constraint.name}-{quantity}"
            hints = tuple(
                doc.Chapter(f"{anchor}-{k}", (f"Hint {k}: {title}",), blocks, is_folded=True)
                for k, (title, blocks) in enumerate(steps, 1)
            )
            names = ", ".join(item.name for item in own)
            title: doc.Runs = (f"{names}: {quantity} of ", doc.Verbatim(constraint.name))
            found.append(doc.Chapter(anchor, title, (), hints))
    note = doc.text("Each leads a little further. Try without them first.")
    return doc.Chapter("hints", ("Hints in three steps",), (note,), tuple(found))


def _three(
    quantity: str, joint: Joint, chapter: doc.Chapter
) -> Iterator[tuple[str, tuple[doc.Block, ...]]]:
    """Yield three hints: the way, the vectors, what is left to write out."""
    if quantity == "Phi_q":
        yield "the rules", chapter.sections[RULE_STEP].blocks
        yield "the blocks in vectors", chapter.sections[BLOCK_STEP].blocks
        yield "the matrices", tuple(_matrices(joint))
        return
    blocks = chapter.sections[GAMMA_STEP].blocks
    displays = [item for item in blocks if isinstance(item, doc.Display)]
    firsts = [item.formula.parts[0] for item in displays if isinstance(item.formula, fm.Equated)]
    way = tuple(
        item for item, left in zip(displays, firsts, strict=True) if left == fm.VELOCITY_TERM
    )
    yield "differentiate this along the motion, and change the sign", way
    found = {left: item for item, left in zip(displays, firsts, strict=True) if _is_gamma(left)}
    yield "the result in vectors", tuple(found.values())
    yield "the matrices", tuple(_matrices(joint))


def _is_gamma(formula: fm.Formula) -> bool:
    return isinstance(formula, fm.Glyph) and formula.letter == "gamma"


def _matrices(joint: Joint) -> Iterator[doc.Block]:
    """Yield A and B of each body that moves, in sines and cosines; in space A by entries."""
    for frame, body in zip(joint.template.frames, joint.bodies, strict=True):
        if body.is_ground:
            yield doc.text(
                f"Body {frame.index} is the ground: A is the identity, and its rates are 0."
            )
            continue
        if len(body.kind.axes) == len("xyz"):
            p = tuple(map(sympy.Symbol, body.coordinates[3:]))
            entries = EulerRotation(VectorSymbol("p", 4)).entries((p,), lambda _, value: value)
            turned = tuple(entries[k : k + 3] for k in (0, 3, 6))
            yield doc.Display(fm.Equated((fm.Glyph("A", frame.index), fm.Matrix(turned))))
            continue
        angle = Symbol(str(sympy.sympify(body.phi)))
        cosine, sine = (fm.Call(name, (angle,)) for name in ("cos", "sin"))
        minus_cosine, minus_sine = (_minus(item) for item in (cosine, sine))
        for letter, rows in (
            ("A", ((cosine, minus_sine), (sine, cosine))),
            ("B", ((minus_sine, minus_cosine), (cosine, minus_sine))),
        ):
            yield doc.Display(fm.Equated((fm.Glyph(letter, frame.index), fm.Matrix(rows))))


def _minus(formula: fm.Call) -> fm.Formula:
    return fm.Joined(("-", formula))

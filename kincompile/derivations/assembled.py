"""The assembled system: unknowns, offsets, pattern, mobility, the four arrays, the three solves."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from kincompile.derivations.evaluation import anchor, is_number
from kincompile.report import document as doc
from kincompile.report import formulas as fm
from kincompile.structure.report import gruebler
from kincompile.tables import counted

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from kincompile.derivations.evaluation import Evaluation
    from kincompile.derivations.figures import Figures
    from kincompile.ir.inline import Entry
    from kincompile.model.bodies import Body
    from kincompile.model.system import ConstraintSystem
    from kincompile.runtime.newton import NewtonResult

    Rows: TypeAlias = list[tuple[doc.Run | doc.Runs, ...]]

LARGEST_MATRIX = 9
"""Columns up to which a matrix of numbers is written out."""

WIDEST_TABLE = 30
"""Columns of Phi_q up to which it is a square table; the entries of a larger one are listed."""

MOST_COORDINATES = 12
"""Coordinates up to which every iterate of Newton's method is written out."""

ITERATE_DIGITS = 10


def assembled_section(evaluation: Evaluation) -> doc.Chapter:
    """Return the part of the page on the whole system."""
    parts = (
        _offsets(evaluation),
        _pattern(evaluation),
        _mobility(evaluation),
        _vectors(evaluation),
        _jacobian(evaluation),
        _newton(evaluation),
        _rates(evaluation),
    )
    return doc.Chapter("assembled", ("The assembled system",), (), parts)


EULER_PARAMETERS: doc.Runs = (
    "A body has the Euler parameters p = (e0, e), of length one. Its rotation matrix is ",
    doc.Verbatim("A = E G^T = (e0^2 - e^T e) I + 2 e e^T + 2 e0 e~"),
    ", where e~ is the skew matrix of e, E = [-e, e~ + e0 I] and G = [-e, -e~ + e0 I]. "
    "The derivative of A s by p is the matrix ",
    doc.Verbatim("B(p, s) = 2 [(e0 I + e~) s, e s^T - (e0 I + e~) s~]"),
    ", linear in p and in s. The angular velocity is 2 E p_dot in the global frame, 2 G p_dot in "
    "that of the body.",
)
"""What the letters of a derivation in space mean (Haug, chapter 9)."""

ORIENTATIONS: Mapping[str, doc.Runs] = {"Euler parameters": EULER_PARAMETERS}
"""What the letters of an orientation mean, by what formulas of bodies are written in."""

IDENTITIES = (
    "E p = 0", "G p = 0", "E E^T = I", "G G^T = I", "E^T E = I - p p^T", "G^T G = I - p p^T",
    "A = E G^T", "A^T A = I", "E p_dot = - E_dot p", "G p_dot = - G_dot p", "E_dot p_dot = 0",
    "G_dot p_dot = 0", "E G_dot^T = E_dot G^T", "A_dot = 2 E_dot G^T", "A_dot = 2 E G_dot^T",
    "A_dot = omega~ A", "A_dot = A omega'~", "omega = 2 E p_dot", "omega' = 2 G p_dot",
    "omega = A omega'", "p_dot = 1/2 E^T omega", "p_dot = 1/2 G^T omega'",
    "omega'~ = 2 G G_dot^T", "omega~ = 2 E_dot E^T", "omega_dot = 2 E p_ddot",
    "omega'_dot = 2 G p_ddot", "omega_dot = A omega'_dot",
    "p_ddot = 1/2 G^T omega'_dot - 1/4 p omega'^T omega'",
    "omega'^T omega' = 4 p_dot^T p_dot", "B(p,s) p = 2 A s", "B(p_dot,s) p = B(p,s) p_dot",
    "1/2 B(p,s) G^T = - A s~", "A_dot s = B(p,s) p_dot",
)  # fmt: skip
"""Identities where p^T p = 1 and p^T p_dot = 0, factors with a space between them."""


def orientation_in_words(system: ConstraintSystem) -> list[doc.Block]:
    """Return what the letters of an orientation mean; an angle needs no words."""
    words = ORIENTATIONS.get(system.ground.kind.written_in)
    return [doc.text(*words)] if words else []


def unknowns_section(figures: Figures) -> doc.Chapter:
    """Return the mechanism drawn, its coordinates and parameters, with the chosen state."""
    evaluation = figures.evaluation
    values, q = evaluation.values, evaluation.shown["q"]
    rows: Rows = [
        (str(k), doc.Verbatim(item.name), item.unit, _math(item.guess), _math(q[k]))
        for k, item in enumerate(evaluation.system.coordinates)
    ]
    blocks: list[doc.Block] = []
    if (shown := figures.mechanism()) is not None:
        blocks.append(doc.Figure(shown))
    blocks.append(doc.table(("column", "coordinate", "unit", "guess", "chosen state"), rows))
    letters = orientation_in_words(evaluation.system)
    blocks += letters
    if letters:
        rows_of_three = [IDENTITIES[k : k + 3] for k in range(0, len(IDENTITIES), 3)]
        lines = [tuple(doc.Verbatim(item) for item in row) for row in rows_of_three]
        blocks.append(
            doc.table(("", "", ""), lines, "Identities, where p^T p = 1 and p^T p_dot = 0")
        )
    if evaluation.system.parameters:
        known: Rows = [
            (doc.Verbatim(item.name), item.unit, _math(values[item.name]))
            for item in evaluation.system.parameters
        ]
        blocks.append(doc.table(("parameter", "unit", "value"), known))
    return doc.Chapter("unknowns", ("Coordinates and parameters",), tuple(blocks))


def _math(value: float, digits: int = 6) -> doc.Math:
    return doc.Math(fm.Decimal(value, digits))


def _column_rule(bodies: Sequence[Body]) -> str:
    """Return how the column offset of a body follows from the kinds of the bodies before it."""
    sizes = {len(body.coordinates) for body in bodies}
    if len(sizes) != 1:
        return "The column offset of a body is the number of coordinates of the bodies before it."
    (size,) = sizes
    times = {1: "", 2: "twice ", 3: "three times "}.get(size, f"{size} times ")
    return f"The column offset of a body is {times}the number of bodies before it."


def _offsets(evaluation: Evaluation) -> doc.Chapter:
    system = evaluation.system
    rows: Rows = []
    for item, first in zip(
        evaluation.system.constraints, evaluation.system.row_offsets, strict=True
    ):
        count = len(item.equation_names)
        name = doc.CrossReference(f"constraint-{item.name}", doc.Verbatim(item.name))
        rows.append((name, str(count), str(first), doc.row_range(first, count), str(first + 1)))
    note = doc.text(
        "The row offset of a constraint is the number of equations before it. "
        f"{_column_rule(system.bodies)}"
    )
    header = ("constraint", "equations", "row offset", "rows from 0", "first row from 1")
    columns: Rows = [
        (doc.Verbatim(body.name), str(own[0]), doc.row_range(own[0], len(own)))
        for body, own in zip(system.bodies, system.body_columns, strict=True)
    ]
    blocks: list[doc.Block] = [note, doc.table(header, rows)]
    if columns:
        blocks.append(doc.table(("body", "column offset", "columns from 0"), columns))
    return doc.Chapter("offsets", ("Row and column offsets",), tuple(blocks), (), "expanded")


def _pattern(evaluation: Evaluation) -> doc.Chapter:
    entries = {
        (entry.row, entry.column): anchor("Phi_q", entry)
        for section in evaluation.code.constraints
        for entry in section.entries["Phi_q"]
    }
    counts = (len(item.equation_names) for item in evaluation.system.constraints)
    bands = tuple(zip(evaluation.system.row_offsets, counts, strict=True))
    m, n = len(evaluation.system.equations), len(evaluation.coordinates)
    note = doc.text(
        f"{len(entries)} of the {m} \N{MULTIPLICATION SIGN} {n} entries of ", doc.Math(fm.PHI_Q),
        " can differ from zero.",
    )  # fmt: skip
    picture = doc.Pattern(
        evaluation.system.equations, tuple(evaluation.coordinates), entries, bands
    )
    title = ("The pattern of the Jacobian",)
    return doc.Chapter("pattern", title, (note, picture), (), "expanded")


def _mobility(evaluation: Evaluation) -> doc.Chapter:
    mobility = gruebler(evaluation.system)
    of_bodies = mobility.coordinates - mobility.others
    rows: Rows = [
        ("coordinates", f"{of_bodies} of bodies + {mobility.others} others",
         str(mobility.coordinates)),
        ("equations of joints", "", f"\N{MINUS SIGN}{mobility.joint_equations}"),
        ("degrees of freedom", "", str(mobility.degrees_of_freedom)),
        ("equations of drivers", "", f"\N{MINUS SIGN}{mobility.driver_equations}"),
        ("not driven", "", str(mobility.undriven)),
    ]  # fmt: skip
    blocks: list[doc.Block] = [doc.table(("what", "count", "number"), rows)]
    if evaluation.problem:
        blocks.append(doc.text(evaluation.problem))
    return doc.Chapter("mobility", ("Mobility",), tuple(blocks))


def _vectors(evaluation: Evaluation) -> doc.Chapter:
    rows: Rows = []
    for section in evaluation.code.constraints:
        quantities = (section.entries[name] for name in ("Phi", "nu", "gamma"))
        for Phi, nu, gamma in zip(*quantities, strict=True):
            row: list[doc.Run | doc.Runs] = [
                str(Phi.row),
                doc.Verbatim(evaluation.system.equations[Phi.row]),
            ]
            for quantity, entry in (("Phi", Phi), ("nu", nu), ("gamma", gamma)):
                shown = evaluation.brief(quantity, entry)
                row += [
                    doc.CrossReference(anchor(quantity, entry), shown),
                    _math(evaluation.value(quantity, entry)),
                ]
            rows.append(tuple(row))
    header: tuple[doc.Run, ...] = (
        "row", "equation", doc.Math(fm.PHI), "number", doc.Math(fm.NU), "number",
        doc.Math(fm.GAMMA), "number",
    )  # fmt: skip
    title = ("The arrays ", doc.Math(fm.PHI), ", ", doc.Math(fm.NU), " and ", doc.Math(fm.GAMMA))
    note = doc.text(f"Numbers at {evaluation.origin}. Each formula leads to its derivation.")
    return doc.Chapter("arrays", title, (note, doc.table(header, rows)), (), "expanded")


def _jacobian(evaluation: Evaluation) -> doc.Chapter:
    found = {
        (entry.row, entry.column): entry
        for section in evaluation.code.constraints
        for entry in section.entries["Phi_q"]
    }
    is_wide = len(evaluation.coordinates) > WIDEST_TABLE
    entries = _listed_entries(evaluation, found) if is_wide else _square_entries(evaluation, found)
    note = doc.text(
        "Each entry leads to its derivation, where its line in the emitted module stands. ",
        f"Numbers at {evaluation.origin}.",
    )
    check = doc.NotebookCode("print(np.round(Phi_q(q, t, p), 6))")
    title = ("The Jacobian ", doc.Math(fm.PHI_Q))
    return doc.Chapter("jacobian", title, (note, entries, check), (), "expanded")


def _square_entries(evaluation: Evaluation, found: Mapping[tuple[int, int], Entry]) -> doc.Block:
    rows: Rows = []
    for row, name in enumerate(evaluation.system.equations):
        line: list[doc.Run | doc.Runs] = [doc.Verbatim(name)]
        for column in range(len(evaluation.coordinates)):
            entry = found.get((row, column))
            line.append("" if entry is None else _cell(evaluation, entry))
        rows.append(tuple(line))
    return doc.table(("", *(doc.Verbatim(name) for name in evaluation.coordinates)), rows)


def _listed_entries(evaluation: Evaluation, found: Mapping[tuple[int, int], Entry]) -> doc.Block:
    rows: Rows = [
        (
            doc.Verbatim(evaluation.system.equations[row]),
            doc.Verbatim(evaluation.coordinates[column]),
            _cell(evaluation, entry),
        )
        for (row, column), entry in found.items()
    ]
    return doc.table(("row", "column", "entry"), rows)


def _cell(evaluation: Evaluation, entry: Entry) -> doc.Runs:
    shown, number = evaluation.brief("Phi_q", entry), _math(evaluation.value("Phi_q", entry))
    if is_number(evaluation.expanded(entry)):
        return (doc.CrossReference(anchor("Phi_q", entry), shown),)
    return (doc.CrossReference(anchor("Phi_q", entry), shown), " = ", number)


def _newton(evaluation: Evaluation) -> doc.Chapter:
    blocks: list[doc.Block] = [
        doc.text(
            f"{evaluation.start or 'From the guess'}, each step solves ",
            doc.Math(fm.Equated((fm.Joined((fm.PHI_Q, fm.DELTA_Q)), fm.Joined(("-", fm.PHI))))),
            " and adds the correction. It stops when the correction is small; that correction has "
            "been applied.",
        )
    ]
    result = evaluation.assembly
    if result is None:
        blocks.append(doc.text(evaluation.problem))
    else:
        blocks += _iterations(evaluation, result)
        blocks += _first_step(evaluation, result)
    return doc.Chapter("newton", ("Position: Newton's method",), tuple(blocks), (), "numeric")


def _iterations(evaluation: Evaluation, result: NewtonResult) -> Iterator[doc.Block]:
    names = evaluation.coordinates if len(evaluation.coordinates) <= MOST_COORDINATES else []
    rows: Rows = []
    for k, (q, residual) in enumerate(zip(result.iterates, result.residuals, strict=True)):
        correction = _math(result.corrections[k], 7) if k < len(result.corrections) else ""
        numbers = (_math(value, ITERATE_DIGITS) for value in q[: len(names)])
        rows.append((str(k), *numbers, _math(residual, 7), correction))
    norms = (doc.Math(fm.Joined(("|", fm.PHI, "|"))), doc.Math(fm.Joined(("|", fm.DELTA_Q, "|"))))
    yield doc.table(("step", *(doc.Verbatim(name) for name in names), *norms), rows)
    outcome = result.status.name.lower().replace("_", " ")
    yield doc.text(f"{counted(result.iterations, 'correction')}; the outcome: {outcome}.")


def _first_step(evaluation: Evaluation, result: NewtonResult) -> Iterator[doc.Block]:
    if result.iterations == 0:
        return
    guess = result.iterates[0] + 0.0
    Phi, Phi_q = evaluation.module.position(guess, evaluation.t, evaluation.p)
    correction = result.iterates[1] - guess
    yield doc.text("The first step in numbers:")
    if guess.size <= LARGEST_MATRIX:
        product = fm.Joined((fm.decimals(Phi_q, 4), fm.decimals(correction)))
        yield doc.Display(
            fm.Equated((fm.Joined((fm.PHI_Q, fm.DELTA_Q)), product, fm.decimals(-Phi)))
        )
    columns = zip(evaluation.coordinates, guess, correction, result.iterates[1], strict=True)
    rows: Rows = [
        (doc.Verbatim(name), *(_math(value, ITERATE_DIGITS) for value in values))
        for name, *values in columns
    ]
    yield doc.table(("coordinate", "before", doc.Math(fm.DELTA_Q), "after the step"), rows)
    yield doc.NotebookCode(
        f"start = np.array({guess.tolist()})\n"
        "correction = np.linalg.solve(Phi_q(start, t, p), -Phi(start, t, p))\n"
        "print(np.round(correction, 6))"
    )


def _rates(evaluation: Evaluation) -> doc.Chapter:
    shown = evaluation.shown
    title = ("Velocity and acceleration",)
    if not evaluation.is_assembled:
        note = doc.text(f"Not solved: the numbers on this page are those of {evaluation.origin}.")
        return doc.Chapter("rates", title, (note,), (), "numeric")
    velocity = fm.Equated((fm.Joined((fm.PHI_Q, fm.Q_DOT)), fm.NU))
    acceleration = fm.Equated((fm.Joined((fm.PHI_Q, fm.Q_DDOT)), fm.GAMMA))
    determinant = float(np.linalg.det(evaluation.Phi_q))
    rows: Rows = [
        (doc.Verbatim(name), *(_math(value, ITERATE_DIGITS) for value in values))
        for name, *values in zip(
            evaluation.coordinates, shown["q"], shown["q_dot"], shown["q_ddot"], strict=True
        )
    ]
    blocks: list[doc.Block] = [
        doc.text(
            "With ",
            doc.Math(fm.PHI_Q),
            f" at {evaluation.origin}, two linear solves give the rates:",
        ),
        doc.Display(velocity),
        doc.Display(acceleration),
    ]
    if evaluation.q.size <= LARGEST_MATRIX:
        blocks += [
            doc.Display(
                fm.Equated(
                    (
                        fm.Joined((fm.decimals(shown["Phi_q"], 4), fm.Q_DOT)),
                        fm.decimals(shown["nu"]),
                    )
                )
            ),
            doc.Display(fm.Equated((fm.Q_DOT, fm.decimals(shown["q_dot"])))),
            doc.Display(
                fm.Equated((fm.Joined((fm.PHI_Q, fm.Q_DDOT)), fm.decimals(shown["gamma"])))
            ),
            doc.Display(fm.Equated((fm.Q_DDOT, fm.decimals(shown["q_ddot"])))),
        ]
    det = fm.Joined((fm.Glyph("det", bold=False), fm.PHI_Q))
    blocks.append(doc.Display(fm.Equated((det, fm.Decimal(determinant, ITERATE_DIGITS)))))
    blocks.append(
        doc.table(("coordinate", doc.Math(fm.Q), doc.Math(fm.Q_DOT), doc.Math(fm.Q_DDOT)), rows)
    )
    blocks.append(
        doc.NotebookCode(
            "print(np.linalg.solve(Phi_q(q, t, p), nu(q, t, p)))\n"
            "print(np.linalg.solve(Phi_q(q, t, p), gamma(q, q_dot, t, p)))"
        )
    )
    return doc.Chapter("rates", title, tuple(blocks), (), "numeric")

"""Answers that hide: to every wrong answer of the corpora a zero is added; none may become right.

The zeros have terms of 1e3 to 1e15, so that their rounding, or half of the last digit of a number
in them, is larger than any slip. Those that vanish where the constraints hold are added as well.
"""

import os
from typing import Any

import pytest

from kincompile.checker.compare import compare
from kincompile.checker.comparer import Comparer
from kincompile.checker.given_forms import Subject
from kincompile.checker.matrix_text import split_matrix
from kincompile.checker.reference import Reference
from kincompile.checker.written import read_written, vocabulary
from kincompile.files.text_places import TextPlace
from tests.adversary.hidden import KINDS, SIZES, SMALL, zeros
from tests.unit.compare.conftest import mechanism
from tests.unit.compare.test_compare_corpora import QUANTITIES, answers

KEPT: dict[str, tuple[Reference, dict[str, Any]]] = {}
MANIFOLD = "vanishing on the manifold"
IS_WHOLE = "ADVERSARY_REPORT" in os.environ
"""Whether every zero is added to every second answer; else each second answer has one."""


def formulas(kind):
    """Return the reference of a joint type, and its right formulas as rows."""
    if kind not in KEPT:
        model = mechanism(kind)
        rows = {name: getattr(model, name).tolist() for name in QUANTITIES}
        KEPT[kind] = Reference(model), rows
    return KEPT[kind]


def with_zero(item, zero):
    """Return a wrong answer with a zero in each of its wrong entries, among right ones."""
    _, right = formulas(item["model"])
    rows = [list(row) for row in right[item["quantity"]]]
    for row, column, formula in item["entries"]:
        rows[row][column] = f"{formula} + {zero}"
    beside = "Phi_q" if item["quantity"] == "Phi" else "Phi"
    return {beside: right[beside], item["quantity"]: rows}


def judged(item, zero):
    """Return the comparison of a wrong answer with a zero, without what explains it."""
    reference, _ = formulas(item["model"])
    words = vocabulary(reference, {})
    written = {
        name: read_written(name, rows, words, reference, False, lambda *_: [])[0]
        for name, rows in with_zero(item, zero).items()
    }
    return Comparer(Subject(reference, None, reference.random), written, {}, strict=False)


def zero_of(item, kind, size):
    """Return a zero; one on the manifold is a multiple of the constraint itself."""
    if kind != MANIFOLD:
        return zeros(size)[kind]
    row = item["entries"][0][0]
    return f"{size:.0e}*({formulas(item['model'])[1]['Phi'][row][0]})"


def is_wrong(item):
    """Return whether an answer is wrong where the constraints hold too, as gamma has to be."""
    return judged(item, zero_of(item, MANIFOLD, 1.0)).wrong_count


def check_hidden(kinds, chosen, record):
    """Add zeros to wrong answers, each of another size than the last."""
    tried, wrong = 0, []
    for k, item in enumerate(answers("single_faults.toml", "answer")[chosen]):
        if item["quantity"] == "gamma" and not is_wrong(item):
            continue
        for j, kind in enumerate(kinds):
            size = SIZES[(k + j) % len(SIZES)]
            tried += 1
            if not judged(item, zero_of(item, kind, size)).wrong_count:
                wrong.append((kind, size, item))
    record(tried=tried, wrong=len(wrong))
    assert not wrong
    return tried


def check_right(kinds, step, record):
    """Add small zeros to an entry of each quantity of right answers."""
    tried, wrong = 0, []
    for k, item in enumerate(answers("right_answers.toml", "answer")[::step]):
        if "given_as" in item:
            continue
        reference, _ = formulas(item["model"])
        more: dict[str, Any] = {"conventions": item["conventions"]} if "conventions" in item else {}
        for j, kind in enumerate(kinds):
            if step == 1 and not IS_WHOLE and (k + j) % (3 * len(kinds)):
                continue
            zero = zeros(SMALL[(k + j) % len(SMALL)])[kind]
            given: dict[str, Any] = {}
            for name in (name for name in QUANTITIES if name in item):
                cells = split_matrix(item[name], TextPlace())
                given[name] = [[cell.text for cell in row] for row in cells]
                given[name][0][0] += f" + {zero}"
            tried += 1
            report = compare(reference, **given, **more)
            wrong += [] if report.equal else [(kind, item["model"], item["form"])]
    record(tried=tried, wrong=len(wrong))
    assert not wrong


def test_that_some_zeros_hide_no_wrong_answer(record):
    assert check_hidden(("double angle", "rounded numbers"), slice(0, None, 400), record) >= 6


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*KINDS, MANIFOLD])
def test_that_no_zero_hides_a_wrong_answer(kind, record):
    # Every wrong answer with one zero, or with every second one.
    first, step = [*KINDS, MANIFOLD].index(kind), 2 if IS_WHOLE else 2 * len(KINDS) + 2
    assert check_hidden((kind,), slice(first % step, None, step), record) > 1400 / step


def test_that_some_small_zeros_leave_right_answers_right(record):
    check_right(KINDS[:2], 120, record)


@pytest.mark.parametrize("size", [10.0, pytest.param(1e3, marks=pytest.mark.slow)])
def test_that_what_cancels_in_brackets_and_by_differentiation_is_rounding(size):
    """The other entries of Phi_q have only the residues of the author's Phi, differentiated."""
    zero, angle = zeros(size)["nested twice"], "(phi_j - phi_i - l*sin(omega*t) - reach)/2"
    reference, _ = formulas("RelativeAngle")
    Phi_q = [[zero, 0, f"-cos({angle})", 0, 0, f"cos({angle})"]]
    assert compare(reference, Phi=[f"2*sin({angle}) + {zero}"], Phi_q=Phi_q).equal
    Phi_q[0][1] = "1/1000"
    assert not compare(reference, Phi=[f"2*sin({angle}) + {zero}"], Phi_q=Phi_q).equal


@pytest.mark.slow
def test_that_small_zeros_leave_right_answers_right(record):
    check_right(KINDS, 1, record)

"""`kc.mark`: the hand-in files of an exercise checked, points and reasons for each student."""

from __future__ import annotations

import json
import math
import os
import re
import time
import traceback
import warnings
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from kincompile.checker.compare import compare
from kincompile.checker.comparison import Diagnosis
from kincompile.checker.judged import UNEXPLAINED
from kincompile.checker.reference import Reference
from kincompile.errors import InputError, InternalError, KincompileError
from kincompile.exercises.blanks import DIGITS, PLACE, Blank, State
from kincompile.exercises.exam import value_mark
from kincompile.exercises.gradebooks import read_roster
from kincompile.exercises.graded import EMPTY, RIGHT, ROUNDED, UNREAD, Mark
from kincompile.exercises.kit import ANSWERS, BLANKS, FORMAT, HAND_IN, INSTRUCTOR, MODELS, STUDENTS
from kincompile.exercises.marks import Marks
from kincompile.exercises.rounded import Leeway, meant
from kincompile.files.content import decoded, file_content
from kincompile.files.files import read
from kincompile.names import column_name, escaped, listed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from kincompile.checker.comparison import ComparedEntry
    from kincompile.model.system import ConstraintSystem

MOST_BYTES = 100_000
"""Size of a hand-in file above which it is not read."""

SECONDS, MOST_MEMORY = 60, 2_000_000_000
"""Processor time and bytes that marking one student may take."""

MOST_CHARACTERS = 300
"""Characters of a reason."""

EXACT = Leeway()
"""No number may be off."""

STOPPED, PLACE_MISSED = "stopped", "another entry named"
"""What marks are besides right, wrong, not filled and not read."""

_COMMENT = re.compile(r"[#%].*")
_LINE = re.compile(r"\s*([BP]\d+)\b\s*(=?)\s*(.*)", re.IGNORECASE)
_ENTRY = re.compile(r"(?:Phi_q\s*)?\[?\s*([^,\[\]]+?)\s*,\s*([^,\[\]]+?)\s*\]?", re.IGNORECASE)
"""An entry as it is named: ``A.x, phi_crank`` or ``Phi_q[A.x, crank.phi]``."""
_PLACE = re.compile(r"\w+, row \d+, column \d+: (line 1, )?")
"""Where a formula stands in a matrix, which no student has seen."""
_LISTED = re.compile(r"(?<=functions): sin, .*|; the functions are: .*", re.DOTALL)
"""All functions by name, too long for a cell."""


def mark(
    folder: str | os.PathLike[str], *, tolerance: float = 0.0, digits: int | None = None
) -> Marks:
    """Mark the hand-in files of an exercise that `exercise` wrote.

    An entry is right if it is equal to the derived one at random states, however it is written; of
    gamma, if it is equal wherever the constraints hold. Formulas are parsed, never run.

    Parameters
    ----------
    folder
        What `exercise` wrote, with the hand-in files filled.
    tolerance
        How much a number that was rounded may differ, relative to itself: with 0.01 the entry
        counts where 3.2 stands for 3.1875. With 0 it does not, and the reason names the number.
    digits
        Significant digits to which numbers must agree, 1 to 6, in the place of a tolerance: a
        number counts where it differs from the right one by half a unit of that digit at most.

    Raises
    ------
    InputError
        If the folder is no exercise, the tolerance is not from 0 to 0.1, or digits are not from 1
        to 6.
    """
    leeway = Leeway(tolerance, digits)
    target = Path(folder)
    key = read_key(target)
    typed = read_roster(target / ANSWERS, key.blanks) if (target / ANSWERS).exists() else {}
    if key.states and not tolerance and digits is None:
        leeway = Leeway(digits=DIGITS)
    found: dict[str, tuple[Mark, ...]] = {}
    for student in key.blanks:
        lines, problem = hand_in_lines(target / STUDENTS / student / HAND_IN)
        lines += [f"{name} = {text}" for name, text in typed.get(student, {}).items() if text]
        found[student] = marks_of(target, key, student, lines, problem, leeway)
    return Marks(target, key.name, found)


def marks_of(
    folder: Path,
    key: Key,
    student: str,
    lines: Sequence[str],
    problem: str = "",
    leeway: Leeway = EXACT,
) -> tuple[Mark, ...]:
    """Return the marks of the lines that a student handed in; the problem is of the whole file."""
    blanks = key.blanks[student]
    answers, unread = _answers(lines)
    marks = {
        item: Mark(item, 0, unread[item.name], UNREAD)
        if item.name in unread
        else Mark(item, 0, problem or EMPTY, EMPTY)
        for item in blanks
    }
    if answers:
        path = folder / INSTRUCTOR / MODELS / f"{student}.toml"
        work = partial(_student, path, blanks, answers, leeway, key.states.get(student))
        marks |= within_budget(work, blanks)
    return tuple(
        replace(
            item,
            answer=answers.get(item.blank.name, ""),
            question=key.questions[student].get(item.blank.name, ""),
        )
        for item in marks.values()
    )


def _student(
    path: Path,
    blanks: Sequence[Blank],
    answers: Mapping[str, str],
    leeway: Leeway,
    state: State | None,
) -> dict[Blank, Mark]:
    reference = Reference(read(path).system())
    found: dict[Blank, Mark] = {}
    for item in blanks if state is not None else ():
        answer = answers.get(item.name)
        value = answer and value_mark(reference, item, answer, state or {}, leeway)
        if value:
            found[item] = value
    marks = _marked(reference, [item for item in blanks if item not in found], answers)
    for item, own in marks.items():
        if not own.points and own.is_read and item.quantity != PLACE:
            marks[item] = _rounding(reference, own, answers[item.name], leeway)
    return found | marks


def _rounding(reference: Reference, found: Mark, answer: str, leeway: Leeway) -> Mark:
    """Return the mark of a wrong entry, which may be right but for numbers that were rounded."""
    blank = found.blank
    for exact, numbers in meant(reference, blank, answer, leeway):
        if not _alone(reference, blank, {blank.name: exact})[blank].points:
            continue
        if all(leeway.allows(float(text), x) for text, x in numbers.items()):
            stands = " and ".join(f"{text} stands for {x:g}" for text, x in numbers.items())
            return Mark(blank, 1, f"right {leeway.words}: {stands}", RIGHT)
        rounded = " and ".join(f"{x:g} was rounded to {text}" for text, x in numbers.items())
        return Mark(blank, 0, f"{rounded}; else the entry is right", ROUNDED)
    return found


def within_budget(
    work: Callable[[], dict[Blank, Mark]], blanks: Sequence[Blank]
) -> dict[Blank, Mark]:
    """Return what marks a student, done by a process of its own with a budget of time and memory.

    Where there are no such processes, as on Windows, it is done here, without a budget.

    Raises
    ------
    InputError
        If the model of the student cannot be read.
    InternalError
        If marking ends by a mistake of this program; a note has the traceback.
    """
    ended, found = _in_a_process(work) if hasattr(os, "fork") else _outcome(work)
    if ended == "marked":
        by_name = {item.name: item for item in blanks}
        return {by_name[name]: Mark(by_name[name], *rest) for name, *rest in found}
    if ended == "refused":
        raise InputError(found)
    if ended == "broken":
        text, trace = found
        bug = InternalError(f"marking ended by {text}.")
        bug.add_note(trace)
        raise bug
    return {item: Mark(item, 0, f"stopped: {found}", STOPPED) for item in blanks}


def _in_a_process(work: Callable[[], dict[Blank, Mark]]) -> Any:
    """Return the outcome of a student's work in a process that ends at its budget."""
    reader, writer = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the child starts no thread
        child = os.fork()
    if not child:
        _work_and_tell(work, writer)
    os.close(writer)
    with os.fdopen(reader, "rb") as stream:
        answer = stream.read()
    os.waitpid(child, 0)
    if answer:
        return json.loads(answer)
    took = f"marking it took more than {SECONDS} s or {MOST_MEMORY // 10**9} GB"
    return "stopped", f"{took}; write shorter formulas"


def _work_and_tell(work: Callable[[], dict[Blank, Mark]], writer: int) -> NoReturn:
    """Do a student's work in the child process, and end it whatever happens."""
    import resource

    try:
        used = math.ceil(time.process_time())
        resource.setrlimit(resource.RLIMIT_CPU, (used + SECONDS, used + SECONDS + 1))
        resource.setrlimit(resource.RLIMIT_AS, (_memory() + MOST_MEMORY,) * 2)
        answer = json.dumps(_outcome(work)).encode()
        with os.fdopen(writer, "wb") as stream:
            stream.write(answer)
    finally:
        os._exit(0)


def _outcome(work: Callable[[], dict[Blank, Mark]]) -> tuple[str, Any]:
    """Return how a student's work ended, in a word, and its marks or what is wrong."""
    try:
        rows = [(x.blank.name, x.points, x.reason, x.kind) for x in work().values()]
    except MemoryError:
        raise
    except RecursionError:
        return "stopped", "a formula is nested too deeply; write shorter formulas"
    except KincompileError as error:
        return "refused", str(error)
    except Exception as error:
        return "broken", (f"{type(error).__name__}: {error}", traceback.format_exc())
    return "marked", rows


def _memory() -> int:
    """Return the address space of this process in bytes, 0 where the system does not say."""
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[0]
    except OSError:
        return 0
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True, slots=True)
class Key:
    """What an exercise asks each student: blanks, their questions, the states of an exam."""

    name: str
    blanks: dict[str, list[Blank]]
    questions: dict[str, dict[str, str]]
    states: dict[str, State]


def read_key(folder: Path) -> Key:
    """Return what an exercise asks."""
    path = folder / INSTRUCTOR / BLANKS
    try:
        data: Any = json.loads(path.read_text(encoding="utf-8"))
        if data["format"] != FORMAT:
            raise InputError(
                f"{path} has the format {data['format']}, and this version reads {FORMAT}"
            )
        found = {
            str(student): [
                Blank(**{item.name: row[item.name] for item in fields(Blank)}) for row in rows
            ]
            for student, rows in data["blanks"].items()
        }
        questions = {
            str(student): {row["name"]: str(row.get("question", "")) for row in rows}
            for student, rows in data["blanks"].items()
        }
        name = str(data.get("name", folder.resolve().name))
        states = {
            str(student): {str(name): float(value) for name, value in own.items()}
            for student, own in data.get("states", {}).items()
        }
    except OSError as error:
        raise InputError(
            f"{folder} is no exercise: {path} cannot be read; give the folder that "
            "`kincompile exercise` wrote"
        ) from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(
            f"{path} is not the key of an exercise; write the exercise again with the same seed"
        ) from error
    students = sorted(item.stem for item in (folder / INSTRUCTOR / MODELS).glob("*.toml"))
    if not students:
        raise InputError(f"{folder / INSTRUCTOR / MODELS} has no models of students")
    if without := [student for student in students if not found.get(student)]:
        raise InputError(
            f"{path} has no blanks of {listed(without)}; write the exercise again with its seed"
        )
    blanks = {student: found[student] for student in students}
    return Key(name, blanks, questions, states)


def hand_in_lines(path: Path) -> tuple[list[str], str]:
    """Return the lines of a hand-in file, and what is wrong with the whole file."""
    if not os.path.lexists(path):
        return [], "nothing handed in"
    try:
        content = file_content(path, MOST_BYTES, follows_links=False)
        return decoded(path, content).splitlines(), ""
    except KincompileError as error:
        return [], _short(str(error).replace(str(path), path.name))


def _answers(lines: Sequence[str]) -> tuple[dict[str, str], dict[str, str]]:
    """Return formulas by blank, and the problems of lines that name one."""
    answers: dict[str, str] = {}
    unread: dict[str, str] = {}
    for line in lines:
        if (found := _LINE.fullmatch(_COMMENT.sub("", line).rstrip("; \t"))) is None:
            continue
        name, equals, formula = found[1].upper(), found[2], found[3]
        if not equals:
            unread[name] = _short(f"not read, for there is no = sign: {line}")
        elif formula and name in answers:
            unread[name] = "filled more than once"
        elif formula:
            answers[name] = formula
    return {name: text for name, text in answers.items() if name not in unread}, unread


def _marked(
    reference: Reference, blanks: Sequence[Blank], answers: Mapping[str, str]
) -> dict[Blank, Mark]:
    """Mark what is filled, of each constraint together; alone where something cannot be read."""
    found: dict[Blank, Mark] = {}
    filled = [item for item in blanks if item.name in answers]
    for item in filled:
        if item.quantity == PLACE:
            found[item] = _place_mark(reference.system, item, answers[item.name])
    filled = [item for item in filled if item.quantity != PLACE]
    for constraint in dict.fromkeys(item.constraint for item in filled):
        own = [item for item in filled if item.constraint == constraint]
        try:
            found |= _compared(reference, own, answers)
        except KincompileError:
            for item in own:
                found |= _alone(reference, item, answers)
    return found


def _alone(reference: Reference, blank: Blank, answers: Mapping[str, str]) -> dict[Blank, Mark]:
    try:
        return _compared(reference, [blank], answers)
    except KincompileError as error:
        why = _LISTED.sub("", _PLACE.sub("", str(error)))
        text = f"cannot be read: {answers[blank.name]} ({why})"
        return {blank: Mark(blank, 0, _short(text), UNREAD)}


def _compared(
    reference: Reference, blanks: Sequence[Blank], answers: Mapping[str, str]
) -> dict[Blank, Mark]:
    """Compare answers to blanks of one constraint, among entries that are right.

    Phi is given on the page, so it fixes the sign of every row.
    """
    system = reference.system
    Phi_q: list[list[Any]] = system.Phi_q.tolist()
    Phi, gamma = ([row[0] for row in item.tolist()] for item in (system.Phi, system.gamma))
    for item in blanks:
        if item.column is None:
            gamma[item.row] = answers[item.name]
        else:
            Phi_q[item.row][item.column] = answers[item.name]
    constraint = blanks[0].constraint
    own = slice(*_rows(system, constraint))
    report = compare(
        reference, Phi=Phi[own], Phi_q=Phi_q[own], gamma=gamma[own], constraint=constraint
    )
    entries = {entry.label: entry for entry in report.entries}
    return {item: _mark_of(item, entries[item.label(system)]) for item in blanks}


def _place_mark(system: ConstraintSystem, blank: Blank, answer: str) -> Mark:
    """Mark the place of a slip, by the names of its equation and coordinate."""
    first, last = _rows(system, blank.constraint)
    equations = system.equations[first:last]
    coordinates = [item.name for item in system.coordinates]
    named = _ENTRY.fullmatch(answer)
    row, column = (named[1], column_name(named[2])) if named else ("", "")
    if row not in equations or column not in coordinates:
        return Mark(blank, 0, _short(
            f"no entry of Phi_q of {blank.constraint}: {answer}. Write an equation and a "
            f"coordinate, as {equations[0]}, {coordinates[0]}"
        ), PLACE_MISSED)  # fmt: skip
    if (row, column) == (system.equations[blank.row], coordinates[blank.column or 0]):
        return Mark(blank, 1, RIGHT, RIGHT)
    return Mark(blank, 0, f"{row}, {column} is right as it stands", PLACE_MISSED)


def _mark_of(blank: Blank, entry: ComparedEntry) -> Mark:
    if entry.accepted:
        return Mark(blank, 1, RIGHT, RIGHT)
    unnamed = Diagnosis(UNEXPLAINED, "different from the derived entry")
    first = next(iter(entry.diagnoses), unnamed)
    return Mark(blank, 0, _short(first.text), first.kind)


def _rows(system: ConstraintSystem, constraint: str) -> tuple[int, int]:
    """Return the first row of a constraint, and the row after its last."""
    names = [item.name for item in system.constraints]
    k = names.index(constraint)
    first = system.row_offsets[k]
    return first, first + len(system.constraints[k].equation_names)


def _short(text: str) -> str:
    line = escaped(" ".join(text.split()))
    return line if len(line) <= MOST_CHARACTERS else f"{line[: MOST_CHARACTERS - 3]}..."

"""The table of docs/adversary.md: what the exhaustive tests of this folder tried, in counts."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs" / "adversary.md"
BEGIN, END = "<!-- table -->\n", "<!-- end of table -->\n"
HEADER = ("what is tried", "tried", "wrong", "gave up", "slowest")


@dataclass(frozen=True)
class Row:
    """A line of the table: what it says, and the tests whose counts it adds."""

    text: str
    tests: tuple[str, ...]


ROWS = (
    Row("random chains by grid and by march, all points against their closed form",
        ("test_many_random_chains[methods]",)),
    Row("random chains in four places: scaled 1e-9 to 1e9, turned, moved; equal statuses",
        ("test_many_random_chains[placements]",)),
    Row("random chains in the grouped form", ("test_many_random_chains[grouped]",)),
    Row("random chains as three variants of their parameters, at different rates",
        ("test_many_random_chains[variants]",)),
    Row("random chains in compiled C, against NumPy and their closed form",
        ("test_many_random_chains[c]",)),
    Row("random loops in space, all points against their closed form, derivatives by complex steps",
        ("test_many_random_loops_in_space",)),
    Row("bad starts of four chains, up to half a turn and two sizes off, in NumPy",
        ("test_many_bad_starts",)),
    Row("the same bad starts in JavaScript, against the runtime's",
        ("test_many_starts_in_javascript",)),
    Row("the same bad starts in Octave, against the runtime's",
        ("test_many_starts_in_octave",)),
    Row("starts of eleven mechanisms in plane and space, all turns: C against NumPy",
        tuple(f"test_many_starts_of_mechanisms_in_c[{part}]" for part in ("plane", "space"))),
    Row("starts of eleven mechanisms in plane and space, all turns: JavaScript against NumPy",
        tuple(
            f"test_many_starts_of_mechanisms_in_javascript[{part}]" for part in ("plane", "space")
        )),
    Row("starts of eleven mechanisms in plane and space, all turns: Octave against NumPy",
        tuple(f"test_many_starts_of_mechanisms_in_octave[{part}]" for part in ("plane", "space"))),
    Row("starts up to 30 degrees and a tenth of a length off an assembly that is alone there",
        ("test_that_near_starts_come_home",)),
    Row("bad starts, the iterates of the page's JavaScript against NumPy's",
        ("test_two_hundred_bad_starts_on_the_page",)),
    Row("words of Python, C, JavaScript and Octave as names, in NumPy", ("test_all_names[numpy]",)),
    Row("the same in C, as far as a compiler's warnings", ("test_all_names[c]",)),
    Row("the same in JavaScript", ("test_all_names[javascript]",)),
    Row("the same in Octave", ("test_all_names[octave]",)),
    Row("random files up to a megabyte, read within 10 s and 1.5 GB",
        ("test_many_random_files[2]", "test_many_random_files[3]")),
    Row("formulas of ^ * / in every bracketing, up to 30 characters, within 5 s and 1 GB a file",
        ("test_every_bracketing[4]", "test_every_bracketing[5]")),
    Row("towers of powers, sparse files, links without end, long runs of one character, likewise",
        ("test_formulas_that_grow_and_files_without_end", "test_runs_of_one_character")),
    Row("single signs of emitted code turned; those that `kc.verify` passes change no number",
        ("test_that_every_turned_sign_is_found",)),
    Row("entries of derivatives of random mechanisms, against complex steps of SymPy's Phi",
        ("test_the_derivatives_of_many_mechanisms",)),
    Row("the same in JavaScript", ("test_the_derivatives_in_javascript",)),
    Row("files of finished sweeps deleted, cut, emptied, overwritten, a bit turned; all mended",
        ("test_every_file_of_a_store_damaged_in_turn",)),
    Row("three such files at once; mended, or named in the error",
        ("test_several_files_damaged_at_once",)),
    Row("the mirror, plane: rows, masses, forces, motion of every joint and load, by hand",
        ("test_the_mirror_of_every_type[plane]",)),
    Row("the same in space", ("test_the_mirror_of_every_type[space]",)),
    Row("the mirror, equations of sensitivities of every joint, plane and space",
        ("test_the_mirror_of_sensitivities[plane]", "test_the_mirror_of_sensitivities[space]")),
    Row("wrong answers of the corpora with zeros of 1e3 to 1e15 in them, called right or not",
        ("test_that_no_zero_hides_a_wrong_answer",)),
)  # fmt: skip


def line(cells: tuple[str, ...]) -> str:
    """Return a line of a Markdown table."""
    return f"| {' | '.join(cells)} |\n"


def table_of(folder: Path) -> str:
    """Return the table of the counts that the tests have left in a folder."""
    counts = [
        json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))
    ]
    text = line(HEADER) + line(("---",) * len(HEADER))
    for row in ROWS:
        own = [item for item in counts if item["test"].startswith(row.tests)]
        if not own:
            raise LookupError(f"no counts of {', '.join(row.tests)}: did the tests fail?")
        sums = [f"{sum(item[name] for item in own):,}" for name in ("tried", "wrong", "gave_up")]
        text += line((row.text, *sums, seconds(max(item["slowest"] for item in own))))
    return text


def seconds(value: float) -> str:
    """Return a time with two digits."""
    return f"{value:.2g} s" if value >= 1e-3 else "under 1 ms"


def table_in(document: str) -> str:
    """Return the table that a document has."""
    return document.partition(BEGIN)[2].partition(END)[0]


def with_table(document: str, table: str) -> str:
    """Return a document with another table in the place of its own."""
    before, _, rest = document.partition(BEGIN)
    return before + BEGIN + table + END + rest.partition(END)[2]

"""The table of docs/adversary.md has the form that `python -m tests.adversary` writes."""

import json
import re

import pytest

from tests.adversary.table import DOCS, HEADER, ROWS, line, seconds, table_in, table_of, with_table

COUNTS = re.compile(r"[0-9,]+")


def test_that_the_page_has_a_line_for_each_part():
    lines = table_in(DOCS.read_text(encoding="utf-8")).splitlines(keepends=True)
    assert lines[:2] == [line(HEADER), line(("---",) * len(HEADER))]
    assert len(lines) == 2 + len(ROWS)
    for row, found in zip(ROWS, lines[2:], strict=True):
        text, tried, wrong, gave_up, slowest = (cell.strip() for cell in found[1:-2].split("|"))
        assert text == row.text
        assert COUNTS.fullmatch(tried)
        assert int(tried.replace(",", "")) >= 8
        assert wrong == "0"
        assert COUNTS.fullmatch(gave_up)
        assert re.fullmatch(r"(\d[\d.e+-]* s|under 1 ms)", slowest)


def test_that_every_test_of_a_row_exists():
    tests = "".join(path.read_text(encoding="utf-8") for path in DOCS.parents[1].glob(
        "tests/adversary/test_*.py"))  # fmt: skip
    names = {name.partition("[")[0] for row in ROWS for name in row.tests}
    assert all(f"def {name}(" in tests for name in names)


def test_that_counts_are_added_and_written(tmp_path):
    for number, row in enumerate(ROWS):
        for part, name in enumerate(row.tests):
            counts = {"test": name, "tried": 700, "wrong": 0, "gave_up": part, "slowest": 0.25}
            (tmp_path / f"{number}_{part}.json").write_text(json.dumps(counts))
    table = table_of(tmp_path)
    page = with_table(DOCS.read_text(encoding="utf-8"), table)
    assert table_in(page) == table
    assert page.count("<!-- table -->") == 1
    assert "| 1,400 | 0 | 1 | 0.25 s |" in table
    (tmp_path / "0_0.json").unlink()
    with pytest.raises(LookupError, match="did the tests fail"):
        table_of(tmp_path)


def test_how_a_time_is_written():
    assert [seconds(value) for value in (12.34, 0.0123, 1e-5)] == ["12 s", "0.012 s", "under 1 ms"]

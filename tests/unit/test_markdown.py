"""Pages have lines below 120 characters; tables, code and links are kept whole."""

import re

import pytest

from docs.builders.places import ROOT
from docs.builders.wrap import pages, wrapped

CODE = re.compile(r"^( *)(```|~~~|:::|\$\$).*?^\1\2[^\n]*$", re.MULTILINE | re.DOTALL)
WHOLE = re.compile(r" *(\||#|<|>|!\[|\[)|.*(\]\(|`|\$|    )")
"""A table, a heading, HTML or a link begins a long line, or it has a link, code or a formula."""


@pytest.mark.parametrize("page", [x.relative_to(ROOT).as_posix() for x in pages()])
def test_that_lines_are_short(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    if page == "CHANGELOG.md":  # lines that several people add are filled with the release
        text = text[text.index("\n## 0.") :]
    long = [line for line in CODE.sub("", text).split("\n") if len(line) >= 120]
    assert [line for line in long if not WHOLE.match(line)] == []
    assert wrapped(text) == text, "python -m docs.builders wrap"


def test_that_words_and_what_is_whole_are_kept():
    row = "| a | " + "word " * 40 + "|"
    link = "[" + "a link " * 20 + "](page.md)"
    code = "```text\n" + "x " * 100 + "\n```"
    text = "\n\n".join(["- " + "word " * 30 + link + " word" * 30, row, code])
    found = wrapped(text)
    assert found.split() == text.split()
    assert all(whole in found.split("\n") for whole in (row, "  " + link, *code.split("\n")))
    assert [line for line in found.split("\n") if line.startswith("  word")]

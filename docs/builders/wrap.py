"""Lines of Markdown pages below 120 characters: tables, code and links are kept whole."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from docs.builders.places import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

WIDTH = 119
GENERATED = ("docs/joints.md", "docs/adversary.md", "docs/api.md")
LEFT_OUT = {"made", "site", "data", "build", "node_modules", "course.egg-info"}
ITEM = re.compile(r"(\s*(?:[-*+]|\d+\.)\s+)(.*)")
FENCE = re.compile(r"\s*(```+|~~~+|:::+|\$\$(?!.*\$\$))")
KEPT = re.compile(r"\s*(\||#|<|>|\$\$|---|===|!\[|\+\+\+|%|\(\w+\)=|\[[^\]]+\]:)")
"""Lines that are no running text: tables, headings, HTML, formulas, pictures, marks."""
WHOLE = re.compile(
    r"(?:`+[^`]+`+|!?\[(?:[^\]\[]|\[[^\]]*\])*\]\([^)]*\)|\$[^$\n]+\$|\S)+"
    r"(?: (?:[-+*]|\d+[.)]|[#>|=:]\S*)(?!\S))*"
)
"""A word with its code, links and formulas, and what would begin something else in a new line."""


def pages() -> list[Path]:
    """Return the pages that a person writes."""
    found = [ROOT / ".github" / "pull_request_template.md", *ROOT.glob("*.md")]
    for folder in ("docs", "examples", "tests", "benchmarks", "paper"):
        found += (ROOT / folder).rglob("*.md")
    return sorted(
        page
        for page in found
        if LEFT_OUT.isdisjoint(page.relative_to(ROOT).parts)
        and page.relative_to(ROOT).as_posix() not in GENERATED
    )


def wrapped(text: str) -> str:
    """Return a page whose paragraphs and items with a long line are filled again."""
    lines: list[str] = []
    for block, is_text in _blocks(text.split("\n")):
        lines += _filled(block) if is_text else block
    return "\n".join(lines)


def _blocks(lines: list[str]) -> Iterator[tuple[list[str], bool]]:
    """Group the lines of each paragraph or item, and say which; any other line stands alone."""
    block: list[str] = []
    closing = "---" if lines[0] == "---" else ""
    for number, line in enumerate(lines):
        fence = FENCE.match(line)
        kept = bool(closing or fence or not line.strip() or KEPT.match(line))
        if closing and number > 0 and line.rstrip().endswith(closing):
            closing = ""
        elif fence and not closing:
            closing = fence[1]
        kept = kept or (line.startswith("    ") and not block)
        if block and (kept or ITEM.match(line)):
            yield block, True
            block = []
        if kept:
            yield [line], False
        else:
            block.append(line)
    if block:
        yield block, True


def _filled(block: list[str]) -> list[str]:
    is_short = all(len(line) <= WIDTH for line in block)
    if is_short or any(line.endswith(("  ", "\\")) for line in block):
        return block
    item = ITEM.match(block[0])
    first = item[1] if item else block[0][: -len(block[0].lstrip())] if block[0][0] == " " else ""
    words = WHOLE.findall(" ".join([block[0][len(first) :], *map(str.strip, block[1:])]))
    lines, rest = [first + words[0]], " " * len(first)
    for word in words[1:]:
        if len(lines[-1]) + 1 + len(word) > WIDTH:
            lines.append(rest + word)
        else:
            lines[-1] += " " + word
    return lines

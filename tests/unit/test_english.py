"""Plain English: phrases of a private dialect do not come back."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BANNED = {
    r"\bso many\b": "say how many, or of what",
    r"(?<!\bthere )\b(is|are|was|were) none\b": "say what it is, or what it lacks",
    r"\btold\b": "reported, known, distinguished",
    r"\b(go|goes|going|gone|went) on with\b": "continue, resume, build on",
    r"\b[Nn]obody\b": "name who, or use the passive",
    r"\bwhat there is\b": "name it",
    r"\b[Ww]hat [^.,;:\"'`()]{2,50} that\b": "begin with the noun of the field",
    r"\bbeyond all bounds\b": "unbounded",
}
"""By pattern, what to write instead."""

CONTINUED = re.compile(r"\s*\n[ \t]*(#|//|%|\*)?[ \t]*")
"""The end of a line, with the sign of a comment on the next."""


def texts() -> list[Path]:
    """Return the files that a user or a reader of the code meets."""
    found = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    found += [x for x in (ROOT / "docs").rglob("*.md") if "made" not in x.parts]
    for folder, ends in (("kincompile", (".py",)), ("templates", (".jinja", ".js", ".css"))):
        found += [x for x in (ROOT / folder).rglob("*.*") if x.suffix in ends]
    return sorted(found)


def phrases(text: str) -> list[str]:
    """Return the banned phrases of a text, with what is around them and what to write instead."""
    joined = CONTINUED.sub(" ", text)
    return [
        f"...{joined[max(0, x.start() - 30) : x.end() + 30]}...: {advice}"
        for pattern, advice in BANNED.items()
        for x in re.finditer(pattern, joined)
    ]


@pytest.mark.parametrize("folder", ["", "docs", "kincompile", "templates"])
def test_that_no_text_has_a_banned_phrase(folder):
    own = [x for x in texts() if (x.relative_to(ROOT).parts[:-1] or ("",))[0] == folder]
    assert own
    found = {x.relative_to(ROOT): phrases(x.read_text(encoding="utf-8")) for x in own}
    assert {str(path): lines for path, lines in found.items() if lines} == {}


def test_that_they_are_found_over_the_ends_of_lines():
    assert len(phrases("# It is\n    # none. And what is said of a start\n    # that folds.")) == 2
    assert phrases("None where there is none. What to do. It tells what a joint does.") == []

"""The site that `make docs` has made: links, widths, what it asks for, what its search finds."""

import re
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

import kincompile as kc
from kincompile.model.catalogue import CONSTRAINTS

SITE = Path(__file__).resolve().parents[2] / "site"
PAGES = [path for path in sorted(SITE.rglob("*.html")) if "_static" not in path.parts]
WRITTEN = [path for path in PAGES if path.parent != SITE / "live"]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not PAGES, reason="there is no site yet: make docs"),
]


class Reader(HTMLParser):
    """Collects what a page refers to, and what can be referred to."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given.get("id", ""), given.get("name", "")}
        self.links += [given[name] for name in ("href", "src") if given.get(name)]


@cache
def read(path: Path) -> Reader:
    reader = Reader()
    reader.feed(path.read_text(encoding="utf-8"))
    return reader


def has(target: Path, anchor: str) -> bool:
    """Return whether a file has the place that a link names."""
    return not anchor or target.suffix != ".html" or anchor in read(target).anchors


def broken(path: Path) -> Iterator[str]:
    """Yield the links of a page that lead nowhere in the site, and those that leave it."""
    for link in read(path).links:
        place, _, anchor = link.partition("#")
        if link.startswith(("data:", "mailto:")):
            continue
        target = path.parent / place.partition("?")[0] if place else path
        if re.match(r"[a-z]+:", link) or not target.is_file() or not has(target, anchor):
            yield link


def test_that_every_link_leads_to_something_in_the_site() -> None:
    found = {(str(path.relative_to(SITE)), link) for path in WRITTEN for link in broken(path)}
    elsewhere = {link for _, link in found if re.match(r"https://", link)}
    assert {pair for pair in found if pair[1] not in elsewhere} == set()
    # What Sphinx, its theme and the changelog name: to be read, not needed.
    hosts = {re.sub(r"https://([^/]+).*", r"\1", link) for link in elsewhere}
    assert hosts <= {"keepachangelog.com", "semver.org", "www.sphinx-doc.org", "docs.python.org"}


def test_that_every_public_name_and_joint_has_a_place() -> None:
    api = {path.stem for path in (SITE / "made" / "api").glob("*.html")}
    assert set(kc.__all__) - api == set()
    assert {name.lower() for name in CONSTRAINTS} <= read(SITE / "joints.html").anchors


@pytest.mark.browser
def test_that_no_page_is_wider_than_a_phone_or_asks_for_more(open_file: Any) -> None:
    page = open_file(SITE / "index.html", 390)
    wide, said = [], []
    for path in WRITTEN:
        page.said.clear()
        page.goto(path.as_uri(), wait_until="domcontentloaded")
        if page.evaluate("document.documentElement.scrollWidth") > 390:
            wide.append(str(path.relative_to(SITE)))
        said += [text for text in page.said if not text.startswith("[PST]")]  # its theme
    page.close()
    assert wide == []
    assert said == []
    assert [url for url in page.asked if not url.startswith(("file:", "data:", "about:"))] == []


@pytest.mark.browser
@pytest.mark.parametrize("word", ["slot", "weld", "hydraulic cylinder", "prismatic"])
def test_that_the_search_finds_the_words_of_engineers(open_file: Any, word: str) -> None:
    page = open_file(SITE / "search.html")
    page.goto(f"{(SITE / 'search.html').as_uri()}?q={word.replace(' ', '+')}")
    page.wait_for_selector("#search-results li a", timeout=10_000)
    found = page.eval_on_selector_all("#search-results li a", "all => all.map(a => a.href)")
    assert any("joints.html" in address for address in found)
    page.close()

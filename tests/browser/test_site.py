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
@pytest.mark.parametrize("size", [(1280, 900), (1366, 768)])
def test_that_the_first_screen_has_a_mechanism_to_pull(
    open_file: Any, size: tuple[int, int]
) -> None:
    page = open_file(SITE / "index.html", size[0])
    page.set_viewport_size({"width": size[0], "height": size[1]})
    frame = page.frame_locator("iframe.live")
    slider = frame.locator("#live input[type=range]").first
    for shown in (frame.locator("canvas#canvas"), slider):
        box = shown.bounding_box()
        assert box["y"] > 80
        assert box["y"] + box["height"] < size[1]
    before = frame.locator("body").evaluate("() => Array.from(player.data.arrays.q)")
    slider.press("ArrowRight")
    page.wait_for_timeout(500)  # the motion is solved again
    assert frame.locator("body").evaluate("() => Array.from(player.data.arrays.q)") != before
    assert page.locator("article math").count() == 1
    page.close()


def luminance(colour: str) -> float:
    """Return the relative luminance of a colour, by its definition in WCAG."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_that_every_drawing_of_the_site_has_colours_for_dark_paper() -> None:
    drawings = list((SITE / "_images").glob("*.svg"))
    assert len(drawings) > 90
    letters = re.compile(r'<text\b[^>]*? fill="(#\w{6})"')
    for path in drawings:
        text = path.read_text(encoding="utf-8")
        (dark,) = re.findall(r"@media ?\(prefers-color-scheme: ?dark\)\{(.*?)</style>", text, re.S)
        if "!important" not in dark:
            continue  # drawn with colours of the page, whose contrast test_contrast.py reads
        changed = dict(re.findall(r'\[fill="(#\w+)"\][^{]*\{fill:(#\w+)', dark))
        for colour in set(letters.findall(text)) - {"#ffffff"}:
            ratio = (luminance(changed[colour]) + 0.05) / (luminance("#14171e") + 0.05)
            assert ratio > 4.5, (path.name, colour)


@pytest.mark.browser
@pytest.mark.parametrize("word", ["slot", "weld", "hydraulic cylinder", "prismatic"])
def test_that_the_search_finds_the_words_of_engineers(open_file: Any, word: str) -> None:
    page = open_file(SITE / "search.html")
    page.goto(f"{(SITE / 'search.html').as_uri()}?q={word.replace(' ', '+')}")
    page.wait_for_selector("#search-results li a", timeout=10_000)
    found = page.eval_on_selector_all("#search-results li a", "all => all.map(a => a.href)")
    assert any("joints.html" in address for address in found)
    page.close()

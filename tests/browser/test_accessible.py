"""WCAG 2, A and AA, as axe-core reads it: pages are light on a screen and dark on a phone."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import kincompile as kc
from kincompile.design.page import fit_page
from kincompile.sweeps.page import sweep_page

ROOT = Path(__file__).resolve().parents[2]
AXE = ROOT / ".ci" / "page" / "node_modules" / "axe-core" / "axe.min.js"
SITE = ("index.html", "tutorials/linkage.html", "made/gallery.html", "made/api/fit.html")

pytestmark = [pytest.mark.browser, pytest.mark.slow]

VIOLATIONS = """async within => {
  const runOnly = ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa'];
  const options = { runOnly, iframes: false, resultTypes: ['violations'] };
  const { violations, passes } = await axe.run(within, options);
  if (passes.length < 5) return ['axe has looked at too little'];
  return violations.flatMap(({ id, nodes }) => nodes.map(({ target, html, failureSummary }) =>
    [id, target.join(' '), html.slice(0, 120), failureSummary].join(' | ')));
}"""


SCROLLED = "#drawn, .iterating { position: static !important; }"
"""A button half under what stays in sight would be too small; one scroll away it is whole."""


def crank() -> kc.Mechanism:
    """Return a crank with a length to sweep and to fit."""
    m = kc.Mechanism("crank", end=1.0, points=5)
    a = m.parameter("a", 1.0, "m")
    arm = m.body("arm", guess=(1.0, 0.0, 0.0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), arm, (-a, 0)))
    m.add(kc.AbsoluteAngle("turn", arm, kc.t))
    m.point("tip", arm, (a, 0))
    return m


def derivation(folder: Path, name: str) -> Path:
    """Write the derivation of a crank, or its slides."""
    return Path(kc.derivation(crank(), 0.5).write(folder / name))


def sweep(folder: Path) -> Path:
    """Write the report of a sweep."""
    found = kc.sweep(crank(), {"a": [0.5, 1.0, 2.0]}, measures=["tip.x.mean"], target="numpy")
    (folder / "sweep.html").write_text(sweep_page(found), encoding="utf-8")
    return folder / "sweep.html"


def fit(folder: Path) -> Path:
    """Write the report of a fit."""
    wanted = kc.targets.value("tip.x", [3.0, 2.6], [0.0, 0.5])
    found = kc.fit(crank(), wanted, bounds={"a": (1, 2)}, samples=4, starts=1)
    (folder / "fit.html").write_text(fit_page(found), encoding="utf-8")
    return folder / "fit.html"


def sheet(folder: Path) -> Path:
    """Write an exercise."""
    kit = kc.exercise(crank(), 1, 3, signs=True).write(folder / "kit")
    return Path(kit, "students/01/exercise.html")


def exam(folder: Path) -> Path:
    """Write the sheets of an exam."""
    kit = kc.exercise(crank(), 1, 3, exam=True).write(folder / "exam")
    return Path(kit, "students/sheets.html")


def editor(folder: Path) -> Path:
    """Write the editor with a mechanism in it."""
    return Path(kc.editor(ROOT / "examples/klann.toml").write(folder / "editor.html"))


def feedback(folder: Path) -> Path:
    """Write what a student is answered: one entry is wrong, one is not read, others are missing."""
    kit = kc.exercise(crank(), 1, 1).write(folder / "handed_in")
    (kit / "students/01/hand_in.txt").write_text("B1 = 3\nB2 = wobble(<b>)\n", encoding="utf-8")
    return Path(kc.mark(kit).write(folder / "marks")) / "feedback/01/feedback.html"


REPORTS: dict[str, Callable[[Path], Path]] = {
    "derivation": lambda folder: derivation(folder, "crank.html"),
    "slides": lambda folder: derivation(folder, "crank.slides.html"),
    "sweep": sweep, "fit": fit, "sheet": sheet, "exam": exam, "feedback": feedback,
    "editor": editor,
}  # fmt: skip


@pytest.fixture(scope="module")
def shown(open_file: Any) -> Callable[[Path], Iterator[Any]]:
    """Return what yields a file with axe-core, light on a screen, then dark on a phone."""

    def opened(path: Path) -> Iterator[Any]:
        page = open_file(path)
        page.add_script_tag(path=AXE)
        yield page
        page.emulate_media(color_scheme="dark")
        page.set_viewport_size({"width": 390, "height": 844})
        page.wait_for_timeout(400)  # then scripts have seen the width
        yield page
        page.close()

    return opened


def violations(page: Any, within: str = "html") -> list[str]:
    """Return what axe-core finds in a part of a page as it is shown."""
    found: list[str] = page.evaluate(VIOLATIONS, within)
    return found


@pytest.mark.parametrize("name", ["four_bar", "spatial_slider_crank"])
def test_that_each_tab_of_a_page_is_accessible(
    shown: Any, example_named: Any, tmp_path: Path, name: str
) -> None:
    for page in shown(kc.page(example_named(name).model).write(tmp_path / "page.html")):
        page.add_style_tag(content=SCROLLED)
        assert violations(page) == []
        for tab in page.locator("[role=tab]:visible").all():
            tab.click()
            assert violations(page, "#right") == [], tab.inner_text()


@pytest.mark.parametrize("name", REPORTS)
def test_that_a_report_is_accessible(shown: Any, tmp_path: Path, name: str) -> None:
    for page in shown(REPORTS[name](tmp_path)):
        assert violations(page) == []


@pytest.mark.parametrize("name", SITE)
def test_that_the_site_is_accessible(shown: Any, name: str) -> None:
    for page in shown(ROOT / "site" / name):
        assert violations(page) == []

"""`make lint` reads the scripts of each kind of page in the order in which the page has them."""

import json
import re
from pathlib import Path

import pytest

from kincompile.view.page import scripts_for

ROOT = Path(__file__).resolve().parents[3]
LINT = ROOT / ".ci" / "page"


def read_by_tsc(page):
    names = json.loads((LINT / f"tsconfig.{page}.json").read_text(encoding="utf-8"))["files"]
    assert all((LINT / name).exists() for name in names)
    return [Path(name).name for name in names if name.endswith(".js")]


@pytest.mark.parametrize(("page", "dimension"), [("plane", 2), ("space", 3)])
def test_that_tsc_reads_the_scripts_of_a_page_in_their_order(page, dimension):
    assert read_by_tsc(page) == scripts_for(dimension)


def test_that_every_script_is_read():
    (pages,) = re.findall(r"^PAGES := (.*)$", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    found = {name for page in pages.split() for name in read_by_tsc(page)}
    assert found == {path.name for path in (ROOT / "templates" / "view").glob("*.js")}

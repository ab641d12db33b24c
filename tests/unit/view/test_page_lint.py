"""Modules of a page: what `make lint` reads, and how they become one script."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from kincompile.errors import TemplateError
from kincompile.report.templates import template_root
from kincompile.view import modules
from kincompile.view.editor import MODULES
from kincompile.view.modules import WORLDS, joined, modules_of, without_imports

ROOT = Path(__file__).resolve().parents[3]
LINT = ROOT / ".ci" / "page"
VIEW = ROOT / "templates" / "view"
ENTRIES = ("start.js", "gallery.js", "editor.js")


def read_by_tsc(page):
    names = json.loads((LINT / f"tsconfig.{page}.json").read_text(encoding="utf-8"))["files"]
    assert all((LINT / name).exists() for name in names)
    return {Path(name).name for name in names if name.endswith(".js")}


def test_that_every_script_is_read_by_tsc():
    (pages,) = re.findall(r"^PAGES := (.*)$", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    entries = {page: read_by_tsc(page) for page in pages.split()}
    assert entries == {"plane": set(ENTRIES), "space": {"start.js"}, "watch": {"watch.js"}}
    imported = {name for world in WORLDS for entry in ENTRIES for name in modules_of(entry, world)}
    assert imported | {"watch.js"} == {path.name for path in VIEW.glob("*.js")}


@pytest.mark.parametrize("dimension", WORLDS)
def test_that_no_name_is_declared_by_two_modules(dimension):
    """They share one scope in a page."""
    pages = [*(modules_of(entry, dimension) for entry in ("start.js", "gallery.js")), MODULES]
    for names in pages:
        text = joined(names)
        found = re.findall(
            r"^(?:async function|function|class|const|let) (\w+)", text, re.MULTILINE
        )
        assert len(found) > 5
        assert sorted(found) == sorted(set(found))


def test_that_modules_come_after_what_they_import():
    for dimension, world in WORLDS.items():
        names = modules_of("start.js", dimension)
        assert names[-1] == "start.js"
        assert world in names
        assert sorted(names) == sorted(set(names))
    assert modules_of("gallery.js", 2) == ("player.js", "gallery.js")


@pytest.mark.parametrize(
    "text",
    ["import './a.js';", "import { a as b } from './a.js';", "import {a} from './a.js';",
     "export default 3;", "export { a };", "/* a */ export let a;",
     "export const a = 1;\nimport * as all from './a.js';"],
)  # fmt: skip
def test_that_imports_and_exports_of_another_form_are_refused(monkeypatch, text):
    monkeypatch.setattr(modules, "read", lambda name: f"{text}\n")
    with pytest.raises(TemplateError, match=r"odd\.js has .(im|ex)port.*on one line"):
        without_imports.__wrapped__("odd.js")


@pytest.mark.slow
def test_that_every_module_can_be_read_alone():
    """Without a document: what a page is made of is found when it is opened, by start.js."""
    node = shutil.which("node") or shutil.which("nodejs")
    assert node is not None
    names = [path.name for path in VIEW.glob("*.js") if path.name not in (*ENTRIES, "watch.js")]
    assert len(names) > 25
    for condition in ("plane", "space"):
        for name in names:
            command = [node, f"--conditions={condition}", name]
            done = subprocess.run(
                command,
                cwd=str(template_root() / "view"),
                capture_output=True,
                text=True,
                check=False,
            )
            assert (name, done.returncode, done.stderr) == (name, 0, "")

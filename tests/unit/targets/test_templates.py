"""Slots and data are compared both ways."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from kincompile.errors import TemplateError
from kincompile.report import templates
from kincompile.report.templates import fill


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of templates of one's own; what was read from others is forgotten."""
    monkeypatch.setattr(templates, "template_root", lambda: tmp_path)
    templates._template.cache_clear()  # noqa: SLF001 - the real templates are read afresh later
    yield tmp_path
    templates._template.cache_clear()  # noqa: SLF001


def test_that_slots_are_filled(folder: Path) -> None:
    (folder / "page.jinja").write_text("{{ a }} and {{ b }}\n", encoding="utf-8")
    assert fill("page.jinja", {"a": 1, "b": "<2>"}) == "1 and <2>\n"


def test_that_a_slot_without_data_is_an_error(folder: Path) -> None:
    (folder / "page.jinja").write_text("{{ a }}{{ b }}", encoding="utf-8")
    with pytest.raises(TemplateError, match=r"'page.jinja': slots without data \['b'\]"):
        fill("page.jinja", {"a": 1})


def test_that_data_without_a_slot_is_an_error(folder: Path) -> None:
    (folder / "page.jinja").write_text("{{ a }}", encoding="utf-8")
    with pytest.raises(TemplateError, match=r"data without slots \['b', 'c'\]"):
        fill("page.jinja", {"a": 1, "c": 2, "b": 3})


def test_that_a_slot_in_a_branch_not_taken_counts(folder: Path) -> None:
    (folder / "page.jinja").write_text("{% if a %}{{ b }}{% endif %}", encoding="utf-8")
    with pytest.raises(TemplateError, match=r"slots without data \['b'\]"):
        fill("page.jinja", {"a": False})


def test_that_a_malformed_template_is_named(folder: Path) -> None:
    (folder / "page.jinja").write_text("{% if a %}", encoding="utf-8")
    with pytest.raises(TemplateError, match=r"template 'page.jinja': .*endif"):
        fill("page.jinja", {"a": 1})


def test_that_an_attribute_that_is_missing_is_an_error(folder: Path) -> None:
    (folder / "page.jinja").write_text("{{ a.nothing }}", encoding="utf-8")
    with pytest.raises(TemplateError, match="nothing"):
        fill("page.jinja", {"a": 1})


def test_that_a_missing_template_is_named(folder: Path) -> None:
    del folder
    with pytest.raises(TemplateError, match=r"there is no template 'numpy/nothing.jinja'"):
        fill("numpy/nothing.jinja", {})

"""`kincompile derive`."""

from pathlib import Path
from typing import Any

import pytest

from kincompile.cli import derive
from kincompile.derivations.derivation import FORMATS
from kincompile.report.document import LEVELS


@pytest.mark.parametrize("ending", FORMATS)
def test_that_a_derivation_is_written(
    kincompile: Any, pendulum: Path, tmp_path: Path, ending: str
) -> None:
    path = tmp_path / f"page{ending}"
    result = kincompile("derive", pendulum, "-o", path)
    assert (result.exit_code, result.stdout) == (0, "")
    assert result.stderr == f"Wrote {path}\n"
    assert "pendulum" in path.read_text(encoding="utf-8")


def test_that_the_command_knows_every_format_and_level() -> None:
    assert tuple(FORMATS) == derive.DERIVATIONS
    assert derive.LEVELS == LEVELS


def test_that_the_time_of_the_numbers_can_be_chosen(
    kincompile: Any, pendulum: Path, tmp_path: Path
) -> None:
    path = tmp_path / "page.md"
    assert kincompile("derive", pendulum, "-o", path, "--time", 0.25).exit_code == 0
    assert "the assembled state at t = 0.25" in path.read_text(encoding="utf-8")


def test_that_a_state_can_be_set(kincompile: Any, pendulum: Path, tmp_path: Path) -> None:
    path = tmp_path / "page.md"
    result = kincompile("derive", pendulum, "-o", path, "--set", "phi_bob=0.75")
    assert result.exit_code == 0
    text = path.read_text(encoding="utf-8")
    assert "the state that was asked for" in text
    assert "0.75" in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("-o", "page.pdf"),
            "page.pdf: a derivation is written as .slides.html, .html, .tex, .md, .ipynb",
        ),
        (("-o", "nowhere/page.html"), "the folder nowhere does not exist"),
        (("-o", "page.html", "--set", "phi_bib=1"), "did you mean 'phi_bob'"),
        (("-o", "page.html", "--set", "phi_bob"), "give NAME=VALUE"),
        (("-o", "page.html", "--time", "inf"), "t: inf is not a finite number"),
        (("-o", "page.html", "--constraint", "moter"), "no constraint 'moter'"),
        (("-o", "page.html", "--levels", "vector,numbers"), "no level numbers"),
    ],
)
def test_that_wrong_use_is_a_message(
    kincompile: Any, pendulum: Path, tmp_path: Path, monkeypatch: Any,
    arguments: tuple[str, ...], message: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    result = kincompile("derive", pendulum, *arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert sorted(tmp_path.iterdir()) == before

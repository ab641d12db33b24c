"""`kincompile editor`: an empty page, a page with a model, and what is refused."""

from pathlib import Path

import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.cli import cli

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


def said(arguments):
    done = CliRunner().invoke(cli, ["editor", *map(str, arguments)])
    return done.exit_code, done.output


def test_that_a_page_is_written_empty_and_with_a_model(pendulum, tmp_path):
    empty, full = tmp_path / "empty.html", tmp_path / "full.html"
    assert said(["-o", empty]) == (0, f"Wrote {empty}\n")
    assert said([pendulum, "-o", full]) == (0, f"Wrote {full}\n")
    assert '"file":""' in empty.read_text(encoding="utf-8")
    assert "kincompile = 1" in full.read_text(encoding="utf-8")
    assert repr(kc.editor()).startswith("<Editor: 0.")


@pytest.mark.parametrize(
    ("name", "text"),
    [("page.txt", "end its name in .html"), ("missing/page.html", "missing")],
)
def test_that_another_file_is_refused(tmp_path, name, text):
    code, message = said(["-o", tmp_path / name])
    assert code == 2
    assert text in message
    assert not (tmp_path / name).exists()


def test_that_a_model_is_not_written_over(pendulum):
    before = pendulum.read_text(encoding="utf-8")
    assert said([pendulum, "-o", pendulum])[0] == 2
    assert pendulum.read_text(encoding="utf-8") == before


@pytest.mark.parametrize("name", ["space/rssr", "example_3_7_5"])
def test_that_what_is_not_in_the_plane_is_refused(name, tmp_path):
    code, message = said([EXAMPLES / f"{name}.toml", "-o", tmp_path / "page.html"])
    assert code == 2
    assert "is no mechanism in the plane" in message
    assert "kincompile view" in message
    assert not (tmp_path / "page.html").exists()

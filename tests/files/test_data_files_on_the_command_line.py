"""Data files as MODEL: every command, several files out, and bad files with exit code 2."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile.cli import cli

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
FOUR_BAR = EXAMPLES / "four_bar.toml"


def run(*arguments):
    return CliRunner().invoke(cli, [str(part) for part in arguments])


def test_that_a_data_file_runs_like_the_python_file():
    data = run("run", FOUR_BAR, "--points", 11)
    python = run("run", FOUR_BAR.with_suffix(".py"), "--points", 11)
    assert (data.exit_code, data.stdout) == (0, python.stdout)


def test_that_a_data_file_compiles_to_the_golden(tmp_path):
    golden = EXAMPLES.parent / "generated" / "numpy" / "four_bar.py"
    assert run("compile", FOUR_BAR, "-o", tmp_path / "out.py").exit_code == 0
    assert (tmp_path / "out.py").read_bytes() == golden.read_bytes()


def test_that_the_schema_is_shown():
    assert json.loads(run("schema").stdout)["title"] == "Mechanism for kincompile, format 1"


def test_that_all_files_of_a_target_are_written(tmp_path):
    assert run("compile", FOUR_BAR, "--target", "c", "-o", tmp_path / "bar.c").exit_code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bar.c", "four_bar.h"]
    assert run("compile", FOUR_BAR, "--target", "c", "-o", tmp_path / "new").exit_code == 0
    names = sorted(path.name for path in (tmp_path / "new").iterdir())
    assert names == ["four_bar.c", "four_bar.h"]
    done = run("compile", FOUR_BAR, "--target", "c", "-o", tmp_path / "four_bar.h")
    assert done.exit_code == 2
    assert "is the name of another file that is written" in done.stderr


def test_that_inspect_tells_all_problems_with_lines(tmp_path):
    path = tmp_path / "bad.toml"
    text = FOUR_BAR.read_text(encoding="utf-8")
    path.write_text(
        text.replace('"-a/2"', '"-e/2"').replace("10.0, u", "'10', u"), encoding="utf-8"
    )
    done = run("inspect", path)
    assert (done.exit_code, done.stdout) == (2, "")
    assert "2 problems:" in done.stderr
    lines = text.splitlines()
    for fragment in ('"-a/2"', "10.0, u"):
        number = next(k for k, line in enumerate(lines, 1) if fragment in line)
        assert f"bad.toml, line {number}: " in done.stderr


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\xff\xfe\x00", "line 1: this is not text in UTF-8"),
        (b"", "line 1: this is not a model for kincompile"),
        (b"kincompile = 1\nname = 'a'\nname = 'b'\n", "line 3: this is not TOML"),
        (b"x" * 17_000_000, "the file has more than 8,000,000 bytes"),
    ],
)
def test_that_a_bad_file_leaves_nothing_behind(tmp_path, content, message):
    path, output = tmp_path / "model.toml", tmp_path / "out.py"
    path.write_bytes(content)
    done = run("compile", path, "-o", output)
    assert (done.exit_code, output.exists()) == (2, False)
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_that_a_folder_and_a_file_without_permission_are_refused(tmp_path, monkeypatch):
    (tmp_path / "folder.toml").mkdir()
    assert "it is a folder; give a file in it" in run("run", tmp_path / "folder.toml").stderr

    def denied(path, flags):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("kincompile.files.content.os.open", denied)
    done = run("run", FOUR_BAR)
    assert (done.exit_code, "four_bar.toml: Permission denied; check" in done.stderr) == (2, True)


def test_that_a_written_file_is_read_again(tmp_path):
    m = kc.Mechanism("arm")
    m.add(kc.AbsoluteAngle("motor", m.body("arm"), kc.t))
    (tmp_path / "arm.json").write_text(m.to_json(), encoding="utf-8")
    assert run("inspect", tmp_path / "arm.json").exit_code == 0

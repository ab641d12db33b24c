"""The README is run from top to bottom: its programs, its commands, and what it says they print.

A block is what its fence says: `python` is run, `text` is what the program before it printed,
`console` is commands (`$ ...`) and their output, `sh` is make targets. A comment before a block
changes what is done with it: `file: NAME` also keeps it as a file, `excerpt: NAME` says that the
file has this text, `alone: NAME` runs it where kincompile and SymPy cannot be imported. In what is
printed, `...` stands for anything, and counts of iterations and sizes of residuals may differ.
"""

import contextlib
import doctest
import inspect
import io
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import pytest

import kincompile as kc
from kincompile.cli import cli
from kincompile.model.catalogue import CONSTRAINTS

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")

BLOCK = re.compile(
    r"(?:^<!-- (?P<action>\w+): (?P<name>\S+) -->\n)?^```(?P<language>\w*)\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
ALONE = (
    "import runpy, sys; sys.modules['kincompile'] = sys.modules['sympy'] = None; "
    "sys.path.insert(0, '.'); runpy.run_path(sys.argv[1])"
)
KINDS = {"python", "text", "console", "sh", ""}  # the last one is the picture


@dataclass
class Reader:
    """Someone who types in a README from top to bottom, in a folder of their own."""

    folder: Path
    names: dict[str, Any] = field(default_factory=dict)
    printed: str = ""

    def follow(self, block: re.Match[str]) -> None:
        """Do what a block says, and check what it says."""
        action, name, language = block["action"], block["name"], block["language"]
        if action == "excerpt":
            if block["text"] not in (self.folder / name).read_text(encoding="utf-8"):
                raise AssertionError(f"{name} does not have this text any more: excerpt it anew")
        elif action in ("file", "alone"):
            (self.folder / name).write_text(block["text"], encoding="utf-8")
        if action == "alone":
            self.printed = self.run([sys.executable, "-c", ALONE, name])
        elif language == "python" and action is None:
            self.printed = self.execute(block["text"])
        elif language == "python" and name == "slider_crank.py":
            self.execute(block["text"])
        elif language == "text" and action is None:
            require(block["text"], self.printed)
        elif language == "console":
            for command, output in commands(block["text"]):
                require(output, self.run(["sh", "-c", command]))

    def execute(self, program: str) -> str:
        """Run a program in the session, and return what it prints."""
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile(program, "README.md", "exec"), self.names)
        return printed.getvalue()

    def run(self, command: list[str]) -> str:
        """Run a command, and return what it writes to both streams."""
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        return subprocess.run(
            command,
            cwd=self.folder,
            env={**os.environ, "PATH": path},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        ).stdout


def commands(text: str) -> Iterator[tuple[str, str]]:
    """Yield the commands of a console and what each of them writes."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, output = part.partition("\n")
        yield command, output


def require(written: str, printed: str) -> None:
    """Check that a program prints what is written in the README."""
    checker = doctest.OutputChecker()
    if not checker.check_output(steady(written), steady(printed), doctest.ELLIPSIS):
        raise AssertionError(f"README:\n{written}\nprinted:\n{printed}")


def steady(text: str) -> str:
    """Return a text without the numbers that rounding may change."""
    text = re.sub(r"\d+ Newton iteration", "N Newton iteration", text)
    return re.sub(r"(largest residual (?:is )?)[\d.e-]+", r"\1small", text)


def failure_of(reader: Reader, block: re.Match[str]) -> str:
    """Let a reader follow a block, and return what goes wrong, with its line, or nothing."""
    try:
        reader.follow(block)
    except (Exception, SystemExit) as error:
        line = block.string[: block.start()].count("\n") + 1
        return f"line {line}: {type(error).__name__}: {error}"
    return ""


@pytest.mark.parametrize(("page", "least"), [("README.md", 15), ("docs/motion_laws.md", 8)])
def test_that_a_page_does_what_it_says(page, least, tmp_path):
    reader = Reader(tmp_path)
    blocks = list(BLOCK.finditer((ROOT / page).read_text(encoding="utf-8")))
    assert len(blocks) > least
    failures = [failure for block in blocks if (failure := failure_of(reader, block))]
    if failures:
        pytest.fail("\n\n".join(failures), pytrace=False)


@pytest.mark.parametrize("name", ["checker.md", "forces.md", "sensitivities.md"])
def test_that_a_page_of_a_feature_does_what_it_says(name, tmp_path):
    reader = Reader(tmp_path)
    page = (ROOT / "docs" / name).read_text(encoding="utf-8")
    failures = [found for block in BLOCK.finditer(page) if (found := failure_of(reader, block))]
    assert failures == []


def test_that_every_block_is_of_a_known_kind():
    assert README.count("\n```") == 2 * len(list(BLOCK.finditer(README)))
    assert {block["language"] for block in BLOCK.finditer(README)} == KINDS
    actions = {block["action"] for block in BLOCK.finditer(README)}
    assert actions == {None, "file", "excerpt", "alone"}


def test_that_the_make_targets_exist():
    targets = re.findall(r"^make (\S+)", README, flags=re.MULTILINE)
    assert targets == ["demo", "test"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert all(re.search(rf"^{target}:", makefile, flags=re.MULTILINE) for target in targets)


def test_that_links_lead_somewhere():
    links = re.findall(r"\]\(([^)]+)\)", README)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_that_every_public_name_is_mentioned():
    forces = (ROOT / "docs" / "forces.md").read_text(encoding="utf-8")
    mentioned = set(re.findall(r"`(?:kc\.)?(\w+)", README + forces))
    warnings = {name for name in kc.__all__ if name.endswith("Warning")}
    assert set(kc.__all__) - warnings - mentioned == set()


def test_that_every_command_and_option_is_mentioned():
    table = README[README.index("| Command |") :]
    context = click.Context(cli)
    for name in cli.list_commands(context):
        command = cli.get_command(context, name)
        assert command is not None
        line = next(line for line in table.splitlines() if f"`kincompile {name} " in line)
        for parameter in command.params:
            if isinstance(parameter, click.Option):
                assert set(parameter.opts) & set(re.split(r"[^\w-]+", line)), parameter.opts


def test_that_the_table_of_constraints_is_that_of_the_catalogue(request):
    for kind in CONSTRAINTS.values():
        arguments = list(kind.arguments())
        assert list(inspect.signature(kind).parameters)[1 : 1 + len(arguments)] == arguments
    begin = README.index("| `AbsoluteX` |")
    end = README.index("| `Equation` | one or more")
    table = "".join(
        f"| `{name}` | {', '.join(kind.arguments())} | {max(len(kind.row_names), 1)} |\n"
        for name, kind in CONSTRAINTS.items()
    )
    if request.config.getoption("--update-goldens"):
        (ROOT / "README.md").write_text(README[:begin] + table + README[end:], encoding="utf-8")
    assert README[begin:end] == table, "make update-goldens rewrites it, if it is meant"


@pytest.mark.parametrize(
    ("written", "printed"),
    [("a ... c\n", "a b\n"), ("x = 1.5\n", "x = 1.6\n"), ("one\n", "one\ntwo\n")],
)
def test_that_a_difference_would_be_found(written, printed):
    with pytest.raises(AssertionError, match="README"):
        require(written, printed)


def test_that_volatile_numbers_are_no_difference():
    require(
        "41 Newton iterations, largest residual 1.1e-16\n",
        "42 Newton iterations, largest residual 0\n",
    )

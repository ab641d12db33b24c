"""Pages are run from top to bottom: their programs, their commands, and what these print.

A block is what its fence says: `python` is run, `text` is what the program before it printed,
`console` is commands (`$ ...`) and their output, `sh` is make targets. A comment before a block
changes what is done with it: `file: NAME` also keeps it as a file, `excerpt: NAME` says that the
file has this text, `alone: NAME` runs it where kincompile and SymPy cannot be imported. Code of
another language is a file, which commands of a console compile and run. In what is printed, `...`
stands for anything, and counts of iterations and sizes of residuals may differ.
"""

import contextlib
import doctest
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

import kincompile as kc
from docs.builders import lessons
from kincompile.cli import cli
from kincompile.names import listed

ROOT = Path(__file__).resolve().parents[2]
RUN = {
    "README.md": 9, "docs/modelling.md": 9, "docs/emitted_modules.md": 10, "docs/errors.md": 3,
    "docs/command_line.md": 4, "docs/motion_laws.md": 8, "docs/checker.md": 7,
    "docs/forces.md": 5, "docs/dynamics.md": 7, "docs/sensitivities.md": 2,
    "docs/transmissions.md": 10, "docs/other_programs.md": 14, "docs/fmi.md": 8,
    "docs/on_a_controller.md": 4,
    "docs/tolerances.md": 4, "docs/space.md": 5, "docs/robots.md": 3, "docs/synthesis.md": 10,
    "docs/sweeps.md": 9, "docs/stepper.md": 3, "docs/in_c.md": 15, "docs/in_javascript.md": 13,
    "docs/in_rust.md": 6, "docs/in_octave.md": 9,
    "docs/course/museum.md": 19, "docs/course/project.md": 7,
    "docs/explanation/newton.md": 4, "docs/explanation/signs.md": 4,
    **{f"docs/course/{name}.md": 4 for name in lessons.NAMES},
}  # fmt: skip
"""Pages that are run, and how many blocks each has at least."""

README, COMMANDS, NAMES, JOINTS = (
    (ROOT / page).read_text(encoding="utf-8")
    for page in ("README.md", "docs/command_line.md", "docs/names.md", "docs/joints.md")
)
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES += [ROOT / "examples" / "README.md", *sorted((ROOT / "docs").glob("[!m]*/*.md"))]

BLOCK = re.compile(
    r"(?:^<!-- (?P<action>\w+): (?P<name>\S+) -->\n)?^```(?P<language>\w*)\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
ALONE = (
    "import runpy, sys; sys.modules['kincompile'] = sys.modules['sympy'] = None; "
    "sys.path.insert(0, '.'); runpy.run_path(sys.argv[1])"
)
KINDS = {"python", "text", "console", "sh"}
FOREIGN = {"c", "cpp", "cmake", "html", "javascript", "octave", "rust"}
"""Languages whose blocks are files."""
SEARCH_PATH = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"


@dataclass
class Reader:
    """Someone who types in a page from top to bottom, in a folder of their own."""

    folder: Path
    is_real: bool = False
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
        elif action == "file" and name == "slider_crank.py":
            self.execute(block["text"])
        elif language == "text" and action is None:
            require(block["text"], self.printed)
        elif language == "console":
            for command, output in commands(block["text"]):
                require(output, self.call(command))

    def execute(self, program: str) -> str:
        """Run a program in the session, and return what it prints."""
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile(program, "page", "exec"), self.names)
        return printed.getvalue()

    def call(self, command: str) -> str:
        """Return what a command of a console writes; a real one is a process of its own."""
        words = shlex.split(command)
        if self.is_real or words[0] != "kincompile" or set(command) & set("|<>;&$*"):
            return self.run(["sh", "-c", command])
        with contextlib.chdir(self.folder), warnings.catch_warnings():
            warnings.simplefilter("default")
            return CliRunner().invoke(cli, words[1:], prog_name="kincompile").output

    def run(self, command: list[str]) -> str:
        """Run a command, and return what it writes to both streams."""
        return subprocess.run(
            command,
            cwd=self.folder,
            env={**os.environ, "PATH": SEARCH_PATH},
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


def missing_programs(blocks: list[re.Match[str]]) -> list[str]:
    """Return the programs that commands of a page call, and this machine has not."""
    lines = (
        line
        for block in blocks
        if block["language"] == "console"
        for line, _ in commands(block["text"])
    )
    called = {part.split()[0] for line in lines for part in re.split(r"&&|\|", line)}
    return sorted(
        name for name in called if "/" not in name and not shutil.which(name, path=SEARCH_PATH)
    )


def require(written: str, printed: str) -> None:
    """Check that a program prints what is written on a page."""
    checker = doctest.OutputChecker()
    if not checker.check_output(steady(written), steady(printed), doctest.ELLIPSIS):
        raise AssertionError(f"written:\n{written}\nprinted:\n{printed}")


def steady(text: str) -> str:
    """Return a text without the numbers that rounding may change."""
    text = re.sub(r"^error: ignoring const exec.*\n", "", text, flags=re.M)  # Octave 7, at its end
    text = re.sub(r"\d+ Newton iteration", "N Newton iteration", text)
    text = re.sub(r"-(0\.0+)(?!\d)", r" \1", text)  # what rounds to zero, from below
    return re.sub(r"(largest residual (?:is )?)[\d.e-]+", r"\1small", text)


def failure_of(reader: Reader, block: re.Match[str]) -> str:
    """Let a reader follow a block, and return what goes wrong, with its line, or nothing."""
    try:
        reader.follow(block)
    except (Exception, SystemExit) as error:
        line = block.string[: block.start()].count("\n") + 1
        return f"line {line}: {type(error).__name__}: {error}"
    return ""


LONG = {
    "docs/course/museum.md", "docs/dynamics.md", "docs/in_c.md", "docs/in_javascript.md",
    "docs/in_octave.md", "docs/in_rust.md", "docs/other_programs.md", "docs/sweeps.md",
    "docs/synthesis.md", "docs/transmissions.md",
}  # fmt: skip
"""Pages that take more than a second."""
SHOWN = [
    pytest.param(page, least, False, marks=[pytest.mark.slow] * (page in LONG))
    for page, least in RUN.items()
]
REAL = pytest.param("README.md", RUN["README.md"], True, marks=pytest.mark.slow)


@pytest.mark.printed
@pytest.mark.parametrize(("page", "least", "is_real"), [*SHOWN, REAL])
def test_that_a_page_does_what_it_says(page, least, is_real, tmp_path):
    reader = Reader(tmp_path, is_real)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    blocks = list(BLOCK.finditer((ROOT / page).read_text(encoding="utf-8")))
    assert len(blocks) >= least
    if missing := missing_programs(blocks):
        pytest.skip(f"{page} needs {listed(missing)}")
    failures = [failure for block in blocks if (failure := failure_of(reader, block))]
    if failures:
        pytest.fail("\n\n".join(failures), pytrace=False)


def test_that_every_block_is_of_a_known_kind():
    assert README.count("\n```") == 2 * len(list(BLOCK.finditer(README)))
    assert {block["language"] for block in BLOCK.finditer(README)} == KINDS
    actions = {block["action"] for block in BLOCK.finditer(README)}
    assert actions == {None, "file", "excerpt"}


@pytest.mark.parametrize("page", RUN)
def test_that_code_of_another_language_is_kept_in_a_file(page):
    blocks = BLOCK.finditer((ROOT / page).read_text(encoding="utf-8"))
    foreign = [block for block in blocks if block["language"] in FOREIGN]
    assert [block["text"] for block in foreign if block["action"] not in ("file", "excerpt")] == []


def test_that_a_program_that_is_missing_is_named():
    page = "```console\n$ no_such_program -x && ./own | sort\n```\n"
    assert missing_programs(list(BLOCK.finditer(page))) == ["no_such_program"]


def test_that_the_readme_is_short():
    assert len(README.splitlines()) <= 170
    assert README.index("make test") < README.index("<img") < README.index("## ")


def test_that_an_extra_is_installed_without_a_copy_of_the_package():
    """`pip install '.[x]'` replaces an editable install by a copy; edits have no effect then."""
    pages = [*PAGES, ROOT / "examples" / "notebooks" / "README.md"]
    lines = [line for page in pages for line in page.read_text(encoding="utf-8").splitlines()]
    installs = [line for line in lines if re.search(r"pip install .*\.\[", line)]
    assert len(installs) > 5
    assert [line for line in installs if re.search(r"pip install '?\.\[", line)] == []


def test_that_the_make_targets_exist():
    targets = re.findall(r"^make (\S+)", README, flags=re.MULTILINE)
    assert targets == ["demo", "test"]
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert all(re.search(rf"^{target}:", makefile, flags=re.MULTILINE) for target in targets)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_that_links_lead_somewhere(page):
    text = re.sub(
        r"^ *```.*?^ *```$|`[^`\n]+`", "", page.read_text(encoding="utf-8"), flags=re.M | re.S
    )
    links = re.findall(r"\]\(([^)]+)\)|src=\"([^\"]+)\"", text)
    assert [link for pair in links for link in pair if link and not leads(page, link)] == []


def leads(page: Path, link: str) -> bool:
    """Return whether a link of a page leads to a file, and to a heading of it."""
    if link.startswith("https://"):
        return True
    place, _, anchor = link.partition("#")
    target = page.parent / place if place else page
    if not target.exists() or not anchor:
        return target.exists()
    headings = re.findall(r"^#+ (.+)$", target.read_text(encoding="utf-8"), re.MULTILINE)
    return anchor in {re.sub(r"[^\w -]", "", item.lower()).replace(" ", "-") for item in headings}


def test_that_every_public_name_is_mentioned():
    mentioned = set(re.findall(r"`(?:kc\.)?(\w+)", NAMES + JOINTS))
    assert set(kc.__all__) - mentioned == set()


def test_that_every_command_has_its_row():
    """`--help` prints the options, and the site has what it prints: no page repeats them."""
    rows = re.findall(r"^\| `kincompile (\w+)(.*?)` \|", COMMANDS, re.MULTILINE)
    assert sorted(name for name, _ in rows) == cli.list_commands(click.Context(cli))
    assert [words for _, words in rows if "--" in words] == []


@pytest.mark.parametrize(
    ("written", "printed"),
    [
        ("a ... c\n", "a b\n"),
        ("x = 1.5\n", "x = 1.6\n"),
        ("one\n", "one\ntwo\n"),
        ("x =  0.05\n", "x = -0.05\n"),
    ],
)
def test_that_a_difference_would_be_found(written, printed):
    with pytest.raises(AssertionError, match="written"):
        require(written, printed)


def test_that_volatile_numbers_are_no_difference():
    require(
        "41 Newton iterations, largest residual 1.1e-16, roll  0.00, -0.05\n",
        "42 Newton iterations, largest residual 0, roll -0.00, -0.05\n",
    )

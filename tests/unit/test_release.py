"""One version, extras that users expect, a citation, issue templates that ask for the model."""

import re
import tomllib
from pathlib import Path

import pytest

import kincompile as kc

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
FOR_DEVELOPERS = {"test", "pages", "oracles", "docs", "bench", "lint", "release"}


def text(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def test_that_there_is_one_version():
    assert re.fullmatch(r"\d+\.\d+\.\d+", kc.__version__)
    (cited,) = re.findall(r"^version: (.*)$", text("CITATION.cff"), re.MULTILINE)
    assert cited == kc.__version__
    assert 'version = { attr = "kincompile.__version__" }' in text("pyproject.toml")
    released = re.findall(r"^## \[?(\d+\.\d+\.\d+)", text("CHANGELOG.md"), re.MULTILINE)
    assert released[:1] == [kc.__version__]


def test_that_badges_say_what_is_tested():
    said = re.findall(r">([^<>]+)</text>", text("docs/images/badges.svg"))
    tested = re.findall(
        r'"(3\.\d+)"', text(".ci/matrix.py").partition("PYTHONS")[2].partition("\n")[0]
    )
    assert said == ["kincompile", kc.__version__, "Python", " | ".join(tested), "license", "MIT"]
    (shown,) = re.findall(r'badges.svg" alt="(.*?)"', text("README.md"))
    assert shown == f"Version {kc.__version__}; Python {', '.join(tested)}; license MIT"


def test_that_the_conda_recipe_has_the_version_and_the_dependencies():
    recipe = text("conda.recipe/recipe.yaml")
    assert f'version: "{kc.__version__}"' in recipe
    needed = recipe[recipe.index("  run:") : recipe.index("tests:")]
    listed = re.findall(r"^    - (\w+) (\S+)$", needed, re.MULTILINE)
    assert [name + bounds for name, bounds in listed if name != "python"] == PROJECT["dependencies"]


def test_that_the_changelog_has_a_section_on_generated_code():
    unreleased, newest = re.split(r"^## ", text("CHANGELOG.md"), flags=re.MULTILINE)[1:3]
    assert unreleased.startswith("Unreleased\n")
    assert len(unreleased.splitlines()) < 100, "a release is by feature"
    assert newest.startswith(kc.__version__)
    assert "\n### Generated code\n" in newest


def test_that_all_is_every_extra_for_users():
    (all_of,) = EXTRAS["all"]
    names = re.fullmatch(r"kincompile\[(.*)\]", all_of)
    assert names is not None
    # Graders of courses bring a hundred packages, and run where a course is.
    assert set(names[1].split(",")) == set(EXTRAS) - FOR_DEVELOPERS - {"all", "courses"}


@pytest.mark.parametrize("page", ["docs/install.md"])
def test_that_extras_for_users_are_explained(page):
    rows = set(re.findall(r"^\| `(\w+)` \|", text(page), re.MULTILINE))
    assert rows == set(EXTRAS) - FOR_DEVELOPERS


def test_that_extras_which_pages_name_exist():
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("**/*.md"), *ROOT.glob("kincompile/**/*.py")]
    named = {
        name
        for page in pages
        if "made" not in page.parts
        for names in re.findall(r"'(?:\.|kincompile)\[([\w,]+)\]'", page.read_text("utf-8"))
        for name in names.split(",")
    }
    assert named
    assert named - set(EXTRAS) == set()


def test_that_issue_templates_ask_for_the_model():
    for form in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("w*.yml"):
        assert "id: model" in form.read_text(encoding="utf-8")
    wrong = text(".github/ISSUE_TEMPLATE/wrong_result.yml")
    assert re.search(r"id: model.*?required: true", wrong, re.DOTALL)


def test_that_the_paper_cites_what_it_lists():
    paper, listed = text("paper/paper.md"), text("paper/paper.bib")
    keys = re.findall(r"^@\w+\{(\w+),$", listed, re.MULTILINE)
    assert len(keys) == len(set(keys)) == listed.count("\n}")
    assert set(re.findall(r"@(\w+)", paper.split("---", 2)[2])) == set(keys)


def test_that_the_paper_has_the_length_and_the_parts_that_its_journal_asks_for():
    body = text("paper/paper.md").split("---", 2)[2]
    assert 750 <= len(body.split()) <= 1750
    parts = re.findall(r"^# (.*)$", body, re.MULTILINE)
    assert {"Summary", "Statement of need", "State of the field", "References"} <= set(parts)


def test_that_the_comparison_has_the_numbers_of_the_benchmarks():
    columns = (
        "kincompile, C",
        "kincompile, NumPy",
        "CasADi fast_newton in mapaccum, generated C",
        "pylinkage dyads, Numba (joints only)",
    )
    measured, page = text("benchmarks/README.md"), text("docs/comparison.md")
    for title in ("four-bar", "six-bar", "RSSR linkage", "double wishbone"):
        (row,) = re.findall(rf"^\| {title} \|(( [\d.]* ?\|)+)$", page, re.MULTILINE)
        part = title.removesuffix(" linkage").lower().replace("-", "_").replace(" ", "_")
        table = measured.split(f"#### {part}, 10000 points")[1].split("\n\n")[1]
        found = dict(re.findall(r"^\| \**(.+?)\** \| .* \| (\S+) \|$", table, re.MULTILINE))
        for column, cell in zip(columns, row[0].split("|"), strict=False):
            decimals = len(cell.strip().partition(".")[2])
            if cell.strip():
                assert abs(float(found[column]) - float(cell)) <= 0.5001 * 10**-decimals


def test_that_times_in_words_are_those_of_the_benchmarks():
    table = text("benchmarks/README.md").split("#### four_bar, 10000 points")[1].split("\n\n")[1]
    times = {float(f"{float(x):.2g}") for x in re.findall(r"\| ([\d.e+]+) \(", table)}
    assert "takes 1.4 ms in C\nand 5.9 ms in NumPy" in text("paper/paper.md")
    assert {1.4, 5.9} <= times


def test_that_the_first_page_has_rows_of_the_table():
    lead, end = "<!-- python -m benchmarks.table --write -->\n", "<!-- end of the table -->"
    whole, shown = (
        text(page).split(lead)[1].split(end)[0].splitlines()
        for page in ("benchmarks/README.md", "README.md")
    )
    assert shown[:3] == whole[:3]
    assert len(shown[0].split("|")) == 8 + 3
    assert len(shown) > 6
    assert [row for row in whole if row in shown] == shown

"""`.ci/budget.py`, which holds the package to `.ci/budget.toml`, counts what it says."""

import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).resolve().parents[2]

MODULE = '''"""A docstring
of two lines."""

import numpy as np  # a comment

from .a import (
    b,
)

# a comment


def f(torque):
    """Say torsion."""
    return "torsion bar", b(
        torque, np
    )
'''


@pytest.fixture(scope="module")
def budget():
    return SimpleNamespace(**runpy.run_path(str(ROOT / ".ci" / "budget.py")))


@pytest.fixture
def module(tmp_path):
    path = tmp_path / "room" / "module.py"
    path.parent.mkdir()
    path.write_text(MODULE)
    return path


def test_that_lines_of_code_and_of_imports_are_counted(budget, module):
    assert budget.code_lines(module) == 8
    assert budget.import_lines(module) == 4
    assert budget.folder_of(module, module.parents[1]) == "room"
    assert budget.folder_of(module, module.parent) == "."


def test_that_a_word_counts_as_a_name_and_in_a_text_but_not_in_a_docstring(budget, module):
    assert budget.names_it(module, "torque")
    assert budget.names_it(module, "torsion")
    assert not budget.names_it(module, "tors")
    assert not budget.names_it(module, "Say")
    assert not budget.names_it(module, "comment")


def test_that_a_test_for_the_dimension_is_a_branch_on_space(budget, tmp_path):
    path = tmp_path / "module.py"
    path.write_text(
        "if len(body.kind.axes) == 3: pass\n"
        "found = 1 if shapes.is_spatial else 2\n"
        "rows = [x for x in y if x.frame.size > PLANE]\n"
        "axes = kind.axes[: frame.size]\n"
    )
    assert budget.branches_on_space(path) == 3


def test_that_numbers_by_which_something_is_judged_are_counted(budget, tmp_path):
    path = tmp_path / "judged.py"
    path.write_text(
        "from math import tau\n"
        "FIRST, SECOND = 1e-5, 3\n"  # one: the other is a count
        "ENDS = (0.1, 0.2)\n"  # one list
        "SMALL: float = 2.0**-20\n"
        "BASIS = array([1.5, 2.5])\n"  # data
        "UNITS = {'deg': 0.5}\n"
        "def f(x):\n"
        "    return x * 0.5 + 2.0 > 1e-9 * tau\n",
        encoding="utf-8",
    )
    assert budget.thresholds(path) == 4


def test_that_more_than_the_budget_is_named_and_so_is_a_folder_without_one(budget):
    most = {"code lines": {"model": 10, "view": 5}}
    lines, above = budget.compared({"code lines": {"model": 11, "view": 5, "new": 1}}, most)
    assert above == ["code lines, model: 11, at most 10", "code lines, new: 1, at most 0"]
    assert len([line for line in lines if line.endswith("ABOVE")]) == 2


def test_that_the_readme_of_the_tests_names_every_folder():
    page = (ROOT / "tests" / "README.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`(\w+)/`", page))
    folders = {path.name for path in (ROOT / "tests").iterdir() if path.is_dir()}
    assert named == folders - {"__pycache__"} | {"generated"}

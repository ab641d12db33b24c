"""The text of an emitted module: what it imports, where it runs, and that it never changes."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc

STANDALONE = """
import importlib.abc, runpy, sys
class Absent(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("kincompile", "sympy", "scipy", "jinja2"):
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Absent())
module = runpy.run_path(sys.argv[1])
Phi, Phi_q, nu, gamma = module["kinematics"](module["GUESS"], module["GUESS"], 0.3)
x = module["solve"](module["Phi_q_nonzeros"](module["GUESS"], 0.3), nu)
try:
    module["Phi"]([1.0], 0.0)
except module["InputError"] as error:
    print(repr(float(Phi.sum() + x.sum())), isinstance(error, ValueError))
"""

EMIT = """
import runpy, sys
import kincompile as kc
sys.stdout.write(kc.emit(runpy.run_path(sys.argv[1])["rich_mechanism"]()).source)
"""


@pytest.fixture(scope="session")
def source(rich_model: kc.Mechanism) -> str:
    return str(kc.emit(rich_model).source)


def test_that_nothing_but_math_and_numpy_is_imported(source: str) -> None:
    tree = ast.parse(source)
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [ast.unparse(node) for node in imports] == ["import math", "import numpy as np"]


def test_that_it_runs_where_kincompile_is_not_installed(
    source: str, rich: Any, tmp_path: Path
) -> None:
    file = tmp_path / "rich.py"
    file.write_text(source, encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, "-I", "-c", STANDALONE, str(file)],
        check=True, capture_output=True, encoding="utf-8", cwd=tmp_path,
    )  # fmt: skip
    number, is_value_error = ran.stdout.split()
    Phi, _, nu, _ = rich.kinematics(rich.GUESS, rich.GUESS, 0.3)
    x = rich.solve(rich.Phi_q_nonzeros(rich.GUESS, 0.3), nu)
    assert float(number) == pytest.approx(float(Phi.sum() + x.sum()), rel=1e-14)
    assert is_value_error == "True"


@pytest.mark.parametrize("seed", ["0", "1", "42"])
@pytest.mark.slow
def test_that_the_bytes_do_not_depend_on_the_hash_seed(source: str, seed: str) -> None:
    """This process has a seed of its own, or none."""
    model = Path(__file__).with_name("conftest.py")
    ran = subprocess.run(
        [sys.executable, "-c", EMIT, str(model)],
        check=True, capture_output=True, env={**os.environ, "PYTHONHASHSEED": seed},
    )  # fmt: skip
    assert ran.stdout.decode("utf-8") == source


def test_that_the_text_holds_nothing_volatile(source: str) -> None:
    assert not re.search(r"\b20\d\d-\d\d|\d\d:\d\d|0x[0-9a-f]{6}|<.* object at", source)
    assert not re.search(r"(^|[\s\"'(])(/[a-z]+/|[A-Z]:\\)", source)
    for word in (np.__version__, sympy.__version__, sys.platform, str(Path.home())):
        assert word not in source


def test_that_the_text_is_tidy(source: str) -> None:
    lines = source.split("\n")
    assert source.endswith("\n")
    assert not source.endswith("\n\n")
    assert "\r" not in source
    assert "\t" not in source
    assert not [line for line in lines if line != line.rstrip()]
    assert max(map(len, lines)) <= 120


def test_that_the_text_speaks_of_joints_and_the_book(source: str) -> None:
    header = ast.get_docstring(ast.parse(source)) or ""
    assert '"rich"' in header
    for text in (
        'Revolute "A"',
        "ground - crank",
        "Haug 3.3.10",
        "x_crank [m]",
        "a [m]",
        "(driver)",
    ):
        assert text in header
    assert "c_crank, s_crank = cos_sin(phi_crank)" in source
    assert "# A.x by phi_crank" in source


def test_that_every_public_function_says_its_shape(rich: Any) -> None:
    for name in ("Phi", "Phi_q", "nu", "gamma", "Phi_q_nonzeros", "solve"):
        assert "shape (..., " in getattr(rich, name).__doc__
    for name in ("position", "velocity", "acceleration", "kinematics", "kinematics_batch_last"):
        assert getattr(rich, name).__doc__


def test_that_the_files_are_written_whole(rich_model: kc.Mechanism, tmp_path: Path) -> None:
    emitted = kc.emit(rich_model)
    (path,) = emitted.write(tmp_path / "new" / "folder")
    assert path == tmp_path / "new" / "folder" / "rich.py"
    assert path.read_bytes().decode("utf-8") == emitted.source
    assert [item.name for item in path.parent.iterdir()] == ["rich.py"]
    assert kc.load(path).FINGERPRINT == kc.compile(rich_model).FINGERPRINT


@pytest.mark.parametrize("name", ["f", "q", "np", "lambda", "class", "b", "x", "math", "J"])
def test_that_bodies_and_joints_may_have_awkward_names(name: str) -> None:
    m = kc.Mechanism("named")
    body = m.body(name)
    m.add(kc.Revolute(name + "_", m.ground, (0, 0), body, (0.3, 0.1)))
    m.add(kc.AbsoluteAngle(name, body, kc.t))
    module = kc.compile(m)
    assert f"phi_{name}" in module.COORDINATES
    np.testing.assert_allclose(module.Phi(np.array([1.0, 2.0, 0.5]), 0.25)[2], 0.25)

"""Whatever is wrong, the command line says what and where, and ends with 2: no traceback."""

import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from kincompile.cli import cli

IMPORT = "import kincompile as kc\n"

GOOD = f"""{IMPORT}
m = kc.Mechanism("arm", points=3)
length = m.parameter("length", 1.0)
arm = m.body("arm")
m.add(kc.Revolute("pin", arm, (-length, 0), m.ground, (0, 0)))
m.add(kc.AbsoluteAngle("motor", arm, kc.t))
"""

MANY_PROBLEMS = f"""{IMPORT}
m = kc.Mechanism("bad name")
arm = m.body("arm", guess=(1, 2))
m.body("arm")
m.parameter("length")
m.add(kc.Revolute("pin", arm, (0, 0), arm, (1, 0)))
m.add(kc.Distance("rope", arm, (0, 0), "pillar", (1, 0), 2))
m.add(kc.AbsoluteAngle("motor", arm, kc.t * arm.x))
"""

TWO_MODELS = f"{IMPORT}first = kc.Mechanism('first')\nsecond = kc.Mechanism('second')\n"
UNDRIVEN = GOOD.replace("m.add(kc.AbsoluteAngle", "(kc.AbsoluteAngle")
RAISED_BELOW = "def half(x):\n    return x / 0\n\n\nhalf(1)\n"
NO_PYTHON = f"{IMPORT}m = kc.Mechanism('arm'\n"
REFUSED_AT_ONCE = f"{IMPORT}\ns = kc.ConstraintSystem('s', 'x y', [kc.t], guess=(1,))\n"

# what is in model.py; the arguments, M for the model; parts of the message
CASES = {
    "no command": (GOOD, "animate M", ["No such command 'animate'"]),
    "no model": (GOOD, "run", ["Missing argument 'MODEL'"]),
    "no output": (GOOD, "compile M", ["Missing option '-o'"]),
    "missing file": (GOOD, "run nowhere.py", ["nowhere.py: there is no such file; check"]),
    "missing suffix": (GOOD, "run model", ["there is no such file; did you mean model.py?"]),
    "a folder": (GOOD, "run .", ["it is a folder; give a file in it"]),
    "another suffix": (GOOD, "run notes.txt", ["notes.txt", "a Python file, ending in .py"]),
    "a data file": (GOOD, "run model.toml", ["line 1: this is not a model for kincompile"]),
    "not text": ("\x00\x01", "run M", ["model.py", "null bytes"]),
    "syntax error": (NO_PYTHON, "run M", ["model.py, line 2: this is not Python, '(' was never"]),
    "empty": ("", "run M", ["model.py has no Mechanism and no ConstraintSystem", "are: none"]),
    "no mechanism": ("size = 1\n", "run M", ["has no Mechanism", "Its names are: size"]),
    "two mechanisms": (TWO_MODELS, "run M", ["first (Mechanism), second (Mechanism)"]),
    "exception": (RAISED_BELOW, "run M", ["line 2: ZeroDivisionError: division by zero"]),
    "misspelt type": (f"{IMPORT}kc.Revolut\n", "run M", ["line 2: ", "did you mean 'Revolute'?"]),
    "math.sin": (
        f"{IMPORT}import math\nmath.sin(kc.t)\n",
        "run M",
        ["line 3: TypeError", "sympy.sin, not math.sin"],
    ),
    "numpy.sin": (
        f"{IMPORT}import numpy\nnumpy.sin(kc.t)\n",
        "run M",
        ["line 3: TypeError", "sympy.sin, not math.sin"],
    ),
    "if of t": (f"{IMPORT}1 if kc.t < 1 else 0\n", "run M", ["line 2: ", "a sympy.Piecewise"]),
    "import error": ("import no_such_module\n", "run M", ["line 1: ModuleNotFoundError: No mod"]),
    "bare exception": ("raise KeyError\n", "run M", ["model.py, line 1: KeyError\n"]),
    "exit": ("import sys\nsys.exit(7)\n", "run M", ["line 2: the file ends the program, sys.e"]),
    "problems at once": (
        REFUSED_AT_ONCE,
        "run M",
        ["model.py, line 3: 2 problems:", "- the guess"],
    ),
    "problems": (
        MANY_PROBLEMS,
        "compile M -o out.py",
        ["7 problems:", "'bad name'", "'length' has no", "'pin'", "no body 'pillar'", "'motor'"],
    ),
    "under-constrained": (
        UNDRIVEN,
        "run M -o out.csv",
        ["'arm' has 2 equations for 3 coordinates", "1 more equation is needed"],
    ),
    "under-constrained run": (UNDRIVEN, "run M", ["1 more equation is needed", "add a joint or"]),
    "target": (GOOD, "compile M -o out.py --target cobol", ["no target 'cobol'", "are: numpy"]),
    "output folder missing": (GOOD, "compile M -o no/out.py", ["the folder no does not exist"]),
    "result folder missing": (GOOD, "run M -o no/out.csv", ["the folder no does not exist"]),
    "a file as folder": (GOOD, "run M -o model.py/out.csv", ["model.py is a file, not a folder"]),
    "result is a folder": (GOOD, "run M -o folder.csv", ["folder.csv: it is a folder"]),
    "result suffix": (GOOD, "run M -o out.xlsx", ["end its name in .csv, .npz, .json"]),
    "no suffix": (GOOD, "run M -o out", ["cannot write out: end its name in .csv"]),
    "points zero": (GOOD, "run M --points 0", ["'--points': 0 is not in the range"]),
    "points text": (GOOD, "run M --points many", ["'--points': 'many' is not"]),
    "points fraction": (GOOD, "run M --points 2.5", ["'--points': '2.5' is not"]),
    "end nan": (GOOD, "run M --end nan", ["--end nan: give a finite time"]),
    "end infinite": (GOOD, "run M --end inf", ["--end inf: give a finite time"]),
    "end text": (
        GOOD,
        "run M --end late",
        ["--end late: give a time, such as 0.25 or 30deg: there is no 'late'"],
    ),
    "one point": (GOOD, "run M --end 2 --points 1", ["one point is the time 0 alone"]),
    "own points": (GOOD.replace("3)", "0)"), "run M", ["points = 0: give", "at least one point"]),
    "own end": (GOOD.replace("points=3", "end='x'"), "run M", ["end = 'x', points = 101: give"]),
    "set": (
        GOOD,
        "run M --set length --set length=long",
        ["2 problems:", "--set length: give NAME=VALUE", "--set length=long: give"],
    ),
    "set unknown": (GOOD, "run M --set lenght=1", ["no parameter 'lenght'; did you mean 'length'"]),
    "set nan": (GOOD, "run M --set length=nan", ["parameter 'length' is nan: give a finite"]),
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Go to a folder with some files that are no models."""
    (tmp_path / "notes.txt").write_text("notes")
    (tmp_path / "model.toml").write_text("name = 'arm'")
    (tmp_path / "folder.csv").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def prepared(folder: Path, case: str) -> tuple[list[str], list[str]]:
    """Write the model of a case, and return the arguments and what the message must have."""
    model, arguments, parts = CASES[case]
    (folder / "model.py").write_text(model)
    return ["model.py" if word == "M" else word for word in arguments.split()], parts


@pytest.mark.parametrize("case", CASES)
def test_that_wrong_input_is_a_message(folder, case):
    arguments, parts = prepared(folder, case)
    before = sorted(folder.iterdir())
    done = CliRunner().invoke(cli, arguments)
    assert (done.exit_code, done.stdout) == (2, "")
    assert isinstance(done.exception, SystemExit)
    for part in parts:
        assert part in done.stderr
    assert "Error: " in done.stderr
    assert "Traceback" not in done.stderr
    assert "bug" not in done.stderr
    assert sorted(folder.iterdir()) == before


@pytest.mark.every(4)
@pytest.mark.parametrize("case", ["missing file", "syntax error", "exception", "points zero"])
def test_that_a_process_says_the_same(folder, case):
    arguments, parts = prepared(folder, case)
    command = [sys.executable, "-m", "kincompile", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert all(part in done.stderr for part in parts)
    assert "Traceback" not in done.stderr


def test_that_a_compiled_module_is_no_model(folder):
    prepared(folder, "target")
    assert CliRunner().invoke(cli, ["compile", "model.py", "-o", "out.py"]).exit_code == 0
    done = CliRunner().invoke(cli, ["run", "out.py"])
    assert (done.exit_code, done.stdout) == (2, "")
    assert "out.py is a compiled module already, not a model" in done.stderr
    assert "kc.solve(kc.load('out.py'), t)" in done.stderr


def test_that_the_model_of_the_cases_is_good(folder):
    arguments, _ = prepared(folder, "target")
    assert CliRunner().invoke(cli, ["run", arguments[1]]).exit_code == 0

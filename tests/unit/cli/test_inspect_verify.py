"""`kincompile inspect` of models with something wrong, and `--verify`: messages and exit codes."""

import types

import numpy as np
import pytest

import kincompile as kc
from kincompile import compiler

FOUR_BAR = """
import kincompile as kc

m = kc.Mechanism("four_bar")
crank = m.body("crank", guess=(0.05, 0.08, 1.0))
coupler = m.body("coupler", guess=(0.34, 0.27, 0.4))
rocker = m.body("rocker", guess=(0.57, 0.19, 1.2))
m.add(kc.Revolute("A", m.ground, (0, 0), crank, (-0.1, 0)))
m.add(kc.Revolute("B", crank, (0.1, 0), coupler, (-0.25, 0)))
m.add(kc.Revolute("C", coupler, (0.25, 0), rocker, (0.2, 0)))
m.add(kc.Revolute("D", m.ground, (0.5, 0), rocker, (-0.2, 0)))
m.add(kc.AbsoluteAngle("motor", crank, 1 + kc.t))
"""


@pytest.fixture
def inspected(tmp_path, kincompile):
    """Return the command `inspect` of a model that is given as text."""

    def inspected(text, *options):
        path = tmp_path / "model.py"
        path.write_text(text)
        return kincompile("inspect", path, *options)

    return inspected


def test_that_a_good_model_is_verified(inspected):
    done = inspected(FOUR_BAR, "--verify")
    assert (done.exit_code, done.stderr) == (0, "")
    assert "Verification of four_bar" in done.stdout
    assert done.stdout.endswith("6 generic and 6 assembled states: all agree\n")


def test_that_a_wrong_module_is_an_exit_code_of_one(inspected, monkeypatch):
    """The compiler is right, so its result is spoiled on the way."""
    compiled = compiler.compile

    def spoiled(model):
        right = compiled(model)
        wrong = types.ModuleType(right.__name__)
        vars(wrong).update(vars(right))
        vars(wrong)["nu"] = lambda q, t, p=right.DEFAULTS: right.nu(q, t, p) * (1 + 1e-6)
        return wrong

    monkeypatch.setattr(compiler, "compile", spoiled)
    done = inspected(FOUR_BAR, "--verify")
    assert (done.exit_code, done.stderr) == (1, "")
    assert done.stdout.startswith("four_bar: 9 coordinates, 9 equations")
    assert done.stdout.endswith("DIFFERS: nu of motor\n")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "(0.5, 0), rocker",
            "(5, 0), rocker",
            ["cannot be assembled at t = 0", "B.x by ", "rocker at ("],
        ),
        (
            'm.add(kc.AbsoluteAngle("motor"',
            '(kc.AbsoluteAngle("motor"',
            [
                "1  left over           drivers are missing",
                "a driver is missing: add, for instance",
            ],
        ),
        (
            "m.add(kc.AbsoluteAngle",
            'm.add(kc.AbsoluteAngle("second", rocker, kc.t))\nm.add(kc.AbsoluteAngle',
            ["conflicting: motor contradicts A, B, C, D, second", "remove the driver motor"],
        ),
        (
            "m.add(kc.AbsoluteAngle",
            'm.body("idler")\nm.add(kc.AbsoluteAngle',
            ["too few equations: idler have 3 coordinates", "AbsoluteX of idler"],
        ),
        (
            "m.add(kc.AbsoluteAngle",
            'm.add(kc.Revolute("E", m.ground, (0, 0), crank, (-0.1, 0)))\nm.add(kc.AbsoluteAngle',
            ["redundant: E.x, E.y repeat what A demands", "remove the Revolute E"],
        ),
        (
            "1 + kc.t",
            "1 / kc.t",
            ["cannot be assembled at t = 0, where these equations have no finite value: motor"],
        ),
    ],
    ids=["too long", "undriven", "driven twice", "idle body", "joint twice", "no value"],
)
def test_that_what_is_wrong_is_said_by_name(inspected, old, new, said):
    done = inspected(FOUR_BAR.replace(old, new, 1))
    assert (done.exit_code, done.stderr) == (0, "")
    assert "What to do" in done.stdout
    for words in said:
        assert words in done.stdout


def test_that_an_incomplete_model_is_shown_before_it_is_refused(inspected):
    done = inspected(FOUR_BAR.replace("m.add(kc.Abs", "(kc.Abs", 1), "--verify")
    assert done.exit_code == 2
    assert "a driver is missing" in done.stdout
    assert "Error: 'four_bar' has 8 equations for 9 coordinates" in done.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import kincompile as kc\nm = kc.Mechanism('empty')\n", "has no constraints; add joints"),
        ("x = 1\n", "Mechanism"),
        ("import kincompile as kc\nm = kc.Mechanism('m'\n", "line"),
        (
            "import kincompile as kc\nimport sympy\nx = sympy.Symbol('x')\n"
            "s = kc.ConstraintSystem('s', [x], [sympy.sqrt(-1 - x**2)])\n",
            "these equations have no finite value near the guess: equation_1",
        ),
    ],
    ids=["empty", "no model", "not Python", "no value"],
)
@pytest.mark.parametrize("options", [(), ("--verify",)], ids=["plain", "verify"])
def test_that_what_cannot_be_inspected_is_an_error(inspected, text, said, options):
    done = inspected(text, *options)
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith("Error: ")
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_that_nothing_but_names_is_used(inspected):
    """No message has a bare row or column number, and none comes from NumPy."""
    wrong = FOUR_BAR.replace("(0.5, 0), rocker", "(5, 0), rocker").replace("1 + kc.t", "kc.t")
    text = inspected(wrong + 'm.body("idler")\n').stdout
    advice = text[text.index("What to do") : text.index("Pattern of")]
    for words in ("row ", "column ", "index", "array", "matrix", "None", "nan"):
        assert words not in advice


def test_that_verify_and_inspect_agree_with_the_api(inspected):
    m = kc.Mechanism("pendulum")
    rod = m.body("rod", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), rod, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, kc.t))
    found = kc.verify(m)
    assert found.passed
    assert str(found) == found.to_text()
    assert all(np.isfinite(check.error) for check in found.table)
    assert str(kc.inspect(m)) == kc.inspect(m).to_text()

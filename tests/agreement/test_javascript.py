"""The emitted .js files in node and in Chromium: every quantity, against the NumPy target."""

import json
import shutil
import subprocess

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.ir import from_sympy
from kincompile.targets.javascript.dialect import JAVASCRIPT
from kincompile.targets.printer import Printer

STATES = 3
QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")
CONSTANTS = (
    "NAME", "FORMAT", "FINGERPRINT", "N_COORDINATES", "N_EQUATIONS", "COORDINATES", "EQUATIONS",
    "PARAMETERS", "UNITS", "DEFAULTS", "GUESS", "PATTERN",
)  # fmt: skip
NODE = shutil.which("node") or shutil.which("nodejs")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

# Evaluates every quantity of an emitted file at states, as a script of a page and under node alike.
EVALUATE = """(function (model, states) {
  const quantities = states.map(([q, q_dot, t, p]) => ({
    Phi: model.Phi(q, t, p), Phi_q: model.Phi_q(q, t, p),
    nu: model.nu(q, t, p), gamma: model.gamma(q, q_dot, t, p),
  }));
  return { ...model, quantities };
})"""


def in_node(folder, source, variable, expression):
    """Return what an expression gives under node, the file's exports under their name."""
    (folder / "model.js").write_text(source, encoding="utf-8")
    text = f"const {variable} = require('./model.js'); console.log(JSON.stringify({expression}))"
    done = subprocess.run(
        [str(NODE), "-e", text], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def in_chromium(folder, source, variable, expression):
    """Return what an expression gives in a page that has the file as its script."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    (folder / "model.js").write_text(source, encoding="utf-8")
    (folder / "page.html").write_text("<!doctype html><script src=model.js></script>")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        page.goto((folder / "page.html").as_uri())
        result = page.evaluate(f"JSON.stringify({expression})")
        browser.close()
    assert variable in expression
    return json.loads(result)


@pytest.fixture(
    params=[
        pytest.param(
            in_node,
            id="node",
            marks=pytest.mark.skipif(NODE is None, reason="node is not installed (Debian: nodejs)"),
        ),
        pytest.param(
            in_chromium,
            id="chromium",
            marks=[
                pytest.mark.slow,
                pytest.mark.browser,
                pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed"),
            ],
        ),
    ]
)
def run(request, tmp_path):
    """Return a function that runs an emitted file, in node and in Chromium."""
    return lambda *arguments: request.param(tmp_path, *arguments)


def states(module):
    """Return seeded states: q, q_dot, t and p, all generic."""
    rng = np.random.default_rng(11)
    q, q_dot = rng.uniform(0.2, 1.2, (2, STATES, module.N_COORDINATES))
    p = module.DEFAULTS * rng.uniform(0.9, 1.1, (STATES, len(module.PARAMETERS)))
    return q, q_dot, rng.uniform(0.1, 0.9, STATES), p


def evaluated(run, source, variable, module):
    """Return the constants and the quantities of an emitted file."""
    points = [[value.tolist() for value in state] for state in zip(*states(module), strict=True)]
    return run(source, variable, f"{EVALUATE}({variable}, {json.dumps(points)})")


def agree(found, module):
    """Compare the quantities with those of the NumPy module."""
    for quantity, expected in zip(QUANTITIES, module.kinematics(*states(module)), strict=True):
        values = np.array([state[quantity] for state in found["quantities"]])
        assert values.shape == expected.shape
        assert np.max(np.abs(values - expected) / (1 + np.abs(expected))) < 1e-12, quantity


def test_that_constants_and_quantities_agree(run, example):
    module = example.module
    source = kc.emit(example.model, "javascript").source
    found = evaluated(run, source, module.NAME, module)
    agree(found, module)
    for constant in CONSTANTS:
        value = getattr(module, constant)
        expected = value.tolist() if isinstance(value, np.ndarray) else value
        assert found[constant] == json.loads(json.dumps(expected)), constant


def strange():
    """Return a mechanism with a table, a Piecewise, a root and names that JavaScript has itself."""
    m = kc.Mechanism("top")
    square = m.parameter("square", 0.3)
    sin = m.parameter("Math", 0.2)
    cam, pin = m.body("new"), m.body("var", guess=(1, 0, 0))
    angles = [k * 0.7 for k in range(9)]
    table = (angles, [1 + 0.1 * np.cos(x) for x in angles])
    ramp = sympy.Piecewise((kc.t**2, kc.t < 0.5), (kc.t - sympy.Rational(1, 4), True))
    m.add(kc.Revolute("shaft", cam, (square, 0), m.ground, (0, sin)))
    m.add(kc.PointFollower("slot", pin, (0, 0), cam, (0, 0), table, guess=0.1))
    m.add(kc.AbsoluteAngle("still", pin, sympy.sqrt(1 + kc.t) + sympy.log(kc.t + sin)))
    m.add(kc.AbsoluteY("level", pin, (0, 0), -(sympy.atan2(kc.t, 2) ** sympy.Rational(3, 2))))
    m.add(kc.AbsoluteAngle("motor", cam, ramp))
    return m


def test_that_tables_pieces_and_reserved_names_agree(run):
    m = strange()
    module = kc.compile(m)
    agree(evaluated(run, kc.emit(m, "javascript").source, "top_", module), module)


def test_that_a_table_has_the_same_period(run):
    m = strange()
    module = kc.compile(m)
    alphas = np.array([-20.0, -1e-17, 0.0, 0.7, 6.2, 6.3, 50.0])
    q = np.tile(states(module)[0][0], (len(alphas), 1))
    q[:, -1] = alphas
    text = f"{json.dumps(q.tolist())}.map(q => top_.Phi(q, 0.4))"
    found = run(kc.emit(m, "javascript").source, "top_", text)
    np.testing.assert_allclose(found, module.Phi(q, 0.4), rtol=1e-12, atol=1e-12)


def test_that_a_vector_of_another_length_is_refused(run, example_named):
    source = kc.emit(example_named("four_bar").model, "javascript").source
    catch = "(() => { try { %s } catch (error) { return four_bar.NAME && String(error) } })()"
    for call, message in (
        ("four_bar.Phi([1, 2], 0)", "q has 2 numbers, not 9"),
        ("four_bar.gamma(four_bar.GUESS, [1], 0)", "q_dot has 1 numbers, not 9"),
        ("four_bar.Phi_q(four_bar.GUESS, 0, [])", "p has 0 numbers, not 5"),
    ):
        assert run(source, "four_bar", catch % call) == f"RangeError: four_bar: {message}"


def test_that_outside_a_domain_there_is_no_number(run):
    m = kc.Mechanism("domain")
    m.add(kc.AbsoluteAngle("root", m.body("arm"), sympy.sqrt(kc.t)))
    m.add(kc.AbsoluteX("x", "arm", (0, 0), 0))
    m.add(kc.AbsoluteY("y", "arm", (0, 0), 0))
    source = kc.emit(m, "javascript").source
    assert run(source, "domain", "domain.Phi([0, 0, 0], -1).map(String)") == ["NaN", "0", "0"]


def test_that_javascript_is_not_loaded_into_python():
    with pytest.raises(kc.UnsupportedError, match=r"only modules of the targets numpy, c can be"):
        kc.compile(strange(), target="javascript")


def test_that_every_function_and_every_condition_agrees(run):
    x, y = sympy.symbols("x y")
    conditions = (
        x < y,
        x >= y,
        sympy.Ne(x, y),
        sympy.Eq(x, y),
        (x < 1) & (y > 0),
        (x > 1) | (y < 0),
    )
    pieces = [sympy.Piecewise((x**2 - y, condition), (x * y, True)) for condition in conditions]
    functions = [
        sympy.sin(x), sympy.cos(x), sympy.tan(x), sympy.asin(x / 2), sympy.acos(x / 2),
        sympy.atan(x), sympy.atan2(x, y), sympy.sinh(x), sympy.cosh(x), sympy.tanh(x),
        sympy.asinh(x), sympy.acosh(1 + x), sympy.atanh(x / 2), sympy.exp(x), sympy.log(x),
        sympy.sqrt(x), x**y, -(x**2), (-x) ** 2, -(x + y) / (x * y), sympy.pi * x,
    ]  # fmt: skip
    names = [f"u{k}" for k in range(len(functions) + len(pieces))]
    left = [f - sympy.Symbol(name) for f, name in zip([*functions, *pieces], names, strict=True)]
    m = kc.ConstraintSystem("functions", ["x", "y", *names], [*left, x - kc.t, y - kc.t])
    module = kc.compile(m)
    agree(evaluated(run, kc.emit(m, "javascript").source, "functions", module), module)


def test_that_no_function_of_the_compiler_is_forgotten():
    assert set(from_sympy.FUNCTIONS.values()) | {"sqrt", "pow"} <= JAVASCRIPT.functions.keys()


def test_that_a_function_javascript_does_not_have_is_named():
    printer = Printer(JAVASCRIPT, [("input", "x"), ("call", "erf", 0)], {0: "x"})
    with pytest.raises(kc.UnsupportedError, match="the JavaScript target has no function 'erf'"):
        printer.text(1)

"""Names that the emitted code uses itself go to nothing else: collected from the code."""

import builtins
import re
import shutil
import subprocess
import symtable
from pathlib import Path

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.emitters.c import target as c
from kincompile.emitters.javascript import target as javascript
from kincompile.emitters.numpy import target as numpy
from kincompile.emitters.octave import target as octave
from kincompile.solver.reader import solver, start

from .conftest import run_rust

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ("four_bar", "cam_flat_follower", "cam_by_table", "slider_crank")
WORD = re.compile(r"(?<![\w.'\"$])[A-Za-z_]\w*(?!')")


@pytest.fixture(scope="module", params=EXAMPLES)
def model(request: pytest.FixtureRequest) -> object:
    """Return an example; among them are splines and all elementary functions."""
    return kc.read_model(ROOT / "examples" / f"{request.param}.py")


def functions(table: symtable.SymbolTable) -> list[symtable.Function]:
    """Return the functions in a table of symbols, and those in them."""
    inner = [item for item in table.get_children() if isinstance(item, symtable.Function)]
    return inner + [other for item in inner for other in functions(item)]


def test_that_names_of_numpys_kernels_are_reserved(model):
    source = kc.emit(model).source
    kernels = [item for item in functions(symtable.symtable(source, "m.py", "exec"))
               if "f" in item.get_parameters()]  # fmt: skip
    used = {symbol.get_name() for item in kernels for symbol in item.get_symbols()
            if symbol.is_global()}  # fmt: skip
    tables = {name for name in used if name.endswith(("_contact", "_profile"))}
    assert len(kernels) >= 4
    assert used - tables <= {*numpy.RESERVED, *dir(builtins)}


def test_that_functions_that_cs_kernels_call_are_reserved(model):
    source = kc.emit(model, target="c").source
    lines = re.findall(r"(?m)^ +const double \w+ = ([^;]*);", source)
    called = {name for line in lines for name in re.findall(r"(?<![\w.>])([A-Za-z_]\w*)\(", line)}
    tables = {name for name in called if name.endswith("_contact")}
    of_solver = {*start().functions, *solver().functions, "single", "sqrt", "floor"}
    assert len(lines) > 10
    assert called - tables - of_solver <= {*c.RESERVED}


def test_that_functions_that_octaves_files_call_are_reserved(model):
    emitted = kc.emit(model, target="octave")
    for name, source in emitted.files.items():
        text = re.sub(r"'[^'\n]*'|%[^\n]*", "", source)
        words = set(WORD.findall(text))
        given = set(re.findall(r"(?m)(?:^|[ ;])(\w+)(?:\([^=\n]*\))? = ", text))
        given |= set(re.findall(r"\w+", " ".join(re.findall(r"function [^\n]*", text))))
        given |= set(re.findall(r"\w+", " ".join(re.findall(r"\[([\w, ~]*)\] = ", text))))
        own = {word for word in words if word.startswith(f"{emitted.name}_")}
        known = {*octave.CALLED, *octave.KEYWORDS}
        assert words - given - own <= known, name


def test_that_globals_that_javascript_uses_are_reserved(model):
    text = kc.emit(model, target="javascript").source
    # The solver has a scope of its own, and no name of a mechanism in it.
    text = re.sub(r"const solver = .*?\n    }\)\(\);\n", "const solver = 0;", text, flags=re.DOTALL)
    text = re.sub(r"/\*.*?\*/|//[^\n]*|`[^`]*`|\"[^\"\n]*\"", "", text, flags=re.DOTALL)
    words = set(WORD.findall(re.sub(r"\b\w+: ", "", text)))
    given = set(re.findall(r"(?:const|let|function) (\w+)", text))
    given |= set(re.findall(r"\w+", " ".join(re.findall(r"\(([\w, =]*)\) (?:=>|{)", text))))
    given |= set(re.findall(r"(\w+) =>", text))
    taken_apart = re.findall(r"const [{[]([\w, ]*)[}\]] =|\((\[[\w, \]]*)\) =>", text)
    given |= set(re.findall(r"\w+", " ".join(first + second for first, second in taken_apart)))
    known = {*javascript.KEYWORDS, *javascript.TAKEN_BY_ENVIRONMENT, *javascript.RESERVED}
    assert words - given <= known


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_that_all_that_javascript_brings_along_is_reserved():
    command = "console.log(Object.getOwnPropertyNames(globalThis).join(' '))"
    done = subprocess.run(
        ["node", "-e", f"const vm = require('vm'); vm.runInNewContext({command!r}, {{console}})"],
        capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    assert set(done.stdout.split()) <= {*javascript.TAKEN_BY_ENVIRONMENT}


def arm(name: str) -> kc.Mechanism:
    m = kc.Mechanism(name)
    body = m.body("arm", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", body, (-1, 0), m.ground, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", body, kc.t))
    return m


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
@pytest.mark.parametrize("name", ["Math", "Array", "Number", "document", "undefined", "cos"])
def test_that_a_mechanism_of_any_name_runs_in_javascript(tmp_path, name):
    kc.emit(arm(name), target="javascript").write(tmp_path)
    show = f"const m = require('./{name}.js'); console.log(m.Phi([1, 2, 0.25], 0.5).join(' '))"
    done = subprocess.run(
        ["node", "-e", show], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60
    )
    expected = [1 - np.cos(0.25), 2 - np.sin(0.25), -0.25]
    np.testing.assert_allclose([float(x) for x in done.stdout.split()], expected, atol=1e-15)


@pytest.mark.parametrize("name", ["cos", "sin", "zeros", "either", "linspace", "end", "T"])
def test_that_no_motion_of_octave_takes_the_place_of_a_function(tmp_path, name):
    files = kc.emit(arm(name), target="octave").files
    assert f"{name}.m" not in files
    assert next(iter(files)) == f"{name}_.m"
    assert f"{name}_Phi.m" in files


def words_of_templates() -> list[str]:
    """Return all words that the text of targets has."""
    folders = [ROOT / folder / name for name in ("c", "numpy", "javascript", "octave", "rust")
               for folder in ("templates", "kincompile/emitters")]  # fmt: skip
    texts = [path.read_text() for folder in folders for path in sorted(folder.iterdir())
             if path.is_file()]  # fmt: skip
    words = {word for text in texts for word in re.findall(r"\b[A-Za-z]\w*\b", text)}
    return sorted(word for word in words if len(word) < 40)


def sum_of(names: list[str]) -> kc.ConstraintSystem:
    """Return x = the sum of k a_k for parameters a_k of these names."""
    terms = [(k + 1) * sympy.Symbol(name) for k, name in enumerate(names)]
    x = sympy.Symbol("x_of_it")
    values = {name: 1.0 + k / 7 for k, name in enumerate(names)}
    return kc.ConstraintSystem("sum_of_it", [x], [x - sympy.Add(*terms)], parameters=values)


@pytest.fixture(scope="module")
def every_name() -> kc.ConstraintSystem:
    refused = {"t", "pi", "deg"}
    names = [word for word in words_of_templates() if word not in refused]
    while True:
        try:
            kc.emit(sum_of(names))
        except kc.KincompileError as problem:
            named = [name for name in names if f"'{name}'" in str(problem)]
            if not named:
                raise
            names = [name for name in names if name not in named]
        else:
            return sum_of(names)


def expected_sum(system: kc.ConstraintSystem) -> float:
    values = kc.compile(system).DEFAULTS
    return float(2.5 - np.arange(1, values.size + 1) @ values)


@pytest.mark.slow
@pytest.mark.parametrize("target", ["numpy", "c"])
def test_that_a_parameter_of_any_name_is_a_parameter(every_name, target, quick_compiler):
    assert len(every_name.parameters) > 500
    module = kc.compile(every_name, target)
    assert module.Phi(np.array([[2.5]]), 0.0)[0, 0] == pytest.approx(expected_sum(every_name))


@pytest.mark.slow
def test_that_a_parameter_of_any_name_is_one_in_a_march(every_name, tmp_path):
    kc.emit(every_name).write(tmp_path)
    module = kc.load(tmp_path / "sum_of_it.py")
    expected = 2.5 - expected_sum(every_name)
    q, *_, status = module.march([1.001 * expected], [0.0, 0.1])
    assert not status.any()
    np.testing.assert_allclose(q, expected, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_that_a_parameter_of_any_name_is_one_in_javascript(every_name, tmp_path):
    kc.emit(every_name, target="javascript").write(tmp_path)
    show = "console.log(require('./sum_of_it.js').Phi([2.5], 0)[0])"
    done = subprocess.run(
        ["node", "-e", show], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60
    )
    assert float(done.stdout) == pytest.approx(expected_sum(every_name))


@pytest.mark.slow
def test_that_a_parameter_of_any_name_is_one_in_octave(every_name, tmp_path, octave):
    kc.emit(every_name, target="octave").write(tmp_path)
    found = octave(["show('Phi', sum_of_it_Phi(2.5, 0));"])
    assert np.ravel(found["Phi"])[0] == pytest.approx(expected_sum(every_name))


@pytest.mark.slow
def test_that_a_parameter_of_any_name_is_one_in_rust(every_name, tmp_path):
    kc.emit(every_name, target="rust").write(tmp_path)
    lines = run_rust(
        tmp_path,
        "mod sum_of_it;\nfn main() {\n"
        'println!("{:?}", sum_of_it::Phi(&[2.5], 0.0, &sum_of_it::DEFAULTS)[0]);\n}',
    )
    assert float(lines[0]) == pytest.approx(expected_sum(every_name))


@pytest.mark.slow
def test_that_a_mechanism_of_any_name_is_a_module_of_rust(tmp_path):
    modules = []
    for name in ("fn", "self", "Self", "crate", "main", "std"):
        m = kc.Mechanism(name)
        arm = m.body("arm")
        m.add(kc.Revolute("pin", arm, (0, 0), m.ground, (0, 0)))
        m.add(kc.AbsoluteAngle("motor", arm, kc.t))
        (path,) = kc.emit(m, target="rust").write(tmp_path)
        assert f"`mod {path.stem};`" in path.read_text()
        modules.append(path.stem)
    calls = [f'println!("{{:?}}", {x}::Phi_q(&[0.0; 3], 0.0, &[])[2]);' for x in modules]
    main = [f"mod {x};" for x in modules] + ["fn main() {", *calls, "}"]
    assert run_rust(tmp_path, "\n".join(main)) == 6 * ["[0.0, 0.0, 1.0]"]


def test_that_bodies_and_joints_may_have_any_name_of_c(quick_compiler):
    m = kc.Mechanism("named")
    before, offset = m.ground, m.parameter("INLINE", 0.3)
    for k, name in enumerate(["PI", "LANES", "strip", "F", "look", "NAN", "SIZE_MAX"]):
        body = m.body(name, guess=(k, 0, 0))
        m.add(kc.Revolute(f"{name}_pin", before, (1, offset), body, (0, 0)))
        m.add(kc.RelativeAngle(f"{name}_drive", before, body, kc.t + 1))
        before = body
    q = kc.compile(m).GUESS
    np.testing.assert_allclose(kc.compile(m, "c").Phi(q, 0.2), kc.compile(m).Phi(q, 0.2))


def test_that_macros_of_headers_are_reserved(model):
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        pytest.skip("there is no C compiler")
    source = kc.emit(model, target="c").source
    own = "\n".join(re.findall(r"(?m)^#include <.*", source))
    done = subprocess.run(
        [compiler, "-std=c99", "-dM", "-E", "-"], input=own, capture_output=True, text=True,
        check=True, timeout=60,
    )  # fmt: skip
    macros = set(re.findall(r"(?m)^#define ([A-Za-z]\w*) ", done.stdout))
    assert {"NAN", "SIZE_MAX"} <= macros
    assert macros <= {*c.RESERVED}
    ours = re.findall(r"(?m)^ *#define (\w+)", source)
    assert ours
    assert all(name.startswith("_") for name in ours)

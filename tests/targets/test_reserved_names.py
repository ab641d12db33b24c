"""Names that the emitted code uses itself go to nothing else: collected from the code."""

import builtins
import re
import shutil
import subprocess
import symtable
from pathlib import Path

import numpy as np
import pytest

import kincompile as kc
from kincompile.targets.c import target as c
from kincompile.targets.javascript import target as javascript
from kincompile.targets.numpy import target as numpy
from kincompile.targets.octave import target as octave

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
    assert len(lines) > 10
    assert called - tables <= {*c.RESERVED}


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


@pytest.mark.parametrize("name", ["cos", "sin", "zeros", "either", "linspace", "end"])
def test_that_no_script_of_octave_takes_the_place_of_a_function(tmp_path, name):
    files = kc.emit(arm(name), target="octave").files
    assert f"{name}.m" not in files
    assert next(iter(files)) == f"{name}_.m"
    assert f"{name}_Phi.m" in files

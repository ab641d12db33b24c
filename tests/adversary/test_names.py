"""Words of four languages, and odd names, as names of a mechanism, a body and a parameter.

Each name is refused with a sentence, or the pendulum of that name computes what any pendulum does,
in every target. Of n words the k-th names the mechanism and the body, the next one the parameter.
The words of C, JavaScript and Octave are in words.txt, those of Python are asked for.
"""

import builtins
import json
import keyword
import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import kincompile as kc

OF_LANGUAGES = Path(__file__).with_name("words.txt").read_text(encoding="utf-8").split()
PYTHON = [*keyword.kwlist, *keyword.softkwlist, *dir(builtins)]
ODD = [
    "x", "y", "phi", "L", "F", "b", "J", "f", "k_1", "a_2", "x_x", "phi_phi", "x_phi", "ground",
    "Ground", "a__b", "A1", "l" * 60, "_", "_x", "x_", "1x", "a b", "a-b", "", "é", "\u03c6",
    "\u0430", "a.b", "q[0]", "x\n", "'", '"', "*/", "//", "%", "#", "</script>", "..", "../up",
    "con", "nul", "\u202egnp", "cos_sin", "kinematics", "position", "NAME", "GUESS", "DEFAULTS",
    "UNITS", "PATTERN", "InputError", "solve", "c_x", "s_x", "determinant", "t_1", "omega",
    "d_dot", "Phi_1", "values", "result", "out", "name", "main",
]  # fmt: skip
WORDS = list(dict.fromkeys([*PYTHON, *OF_LANGUAGES, *ODD]))
Q, TIME = np.array([0.3, -0.2, 0.7]), 0.4
KNOWN = [0.8 * math.cos(0.7) - 0.3, 0.8 * math.sin(0.7) + 0.2, 0.7 - 0.8 * 0.4**2]


def pendulum(word, other):
    """Return a pendulum of these names, with a parameter 0.8 as length and as acceleration."""
    m = kc.Mechanism(word)
    rod = m.body(word, guess=(0.8, 0, 0))
    length = m.parameter(other, 0.8)
    m.add(kc.Revolute("pin", m.ground, (0, 0), rod, (-length, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, length * kc.t**2))
    return m


def models(every):
    """Return the pendulums of every so manieth word, and how many words are refused."""
    found, refused = [], 0
    for word, other in zip(WORDS, [*WORDS[1:], WORDS[0]], strict=True):
        for names in ((word, "length"), ("plain", other), (word, other)):
            try:
                model = pendulum(*names)
                model.system()
            except kc.ModelError:
                refused += 1
            else:
                found.append(model)
    return found[::every], refused


def emitted(chosen, target):
    """Yield the models that a target takes, with their files."""
    for number, model in enumerate(chosen):
        try:
            yield number, model, kc.emit(model, target)
        except kc.UnsupportedError:  # a name that the target refuses
            continue


def check_numpy(chosen):
    for _, model, _ in emitted(chosen, "numpy"):
        np.testing.assert_allclose(kc.compile(model).Phi(Q, TIME), KNOWN, atol=1e-15)
    return len(chosen)


def check_c(chosen, folder):
    """Let the compiler read all of them, with all warnings as errors."""
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        pytest.skip("there is no C compiler")
    files = []
    for number, _, text in emitted(chosen, "c"):
        text.write(folder / f"c{number}")
        files += sorted((folder / f"c{number}").glob("*.c"))
    command = [
        compiler,
        "-std=c99",
        "-fsyntax-only",
        "-Wall",
        "-Wextra",
        "-Werror",
        *map(str, files),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]
    return len(files)


def check_javascript(chosen, folder):
    """Run all of them in node, each in a context of its own."""
    node = shutil.which("node") or shutil.which("nodejs")
    if node is None:
        pytest.skip("node is not installed (Debian: nodejs)")
    texts = [(text.source, model.name) for _, model, text in emitted(chosen, "javascript")]
    (folder / "all.json").write_text(json.dumps([text for text, _ in texts]))
    script = """
    const vm = require("vm"), texts = JSON.parse(require("fs").readFileSync("all.json"));
    console.log(JSON.stringify(texts.map(text => {
        const sandbox = { module: { exports: {} } };
        vm.runInNewContext(text, sandbox);
        return Array.from(sandbox.module.exports.Phi([0.3, -0.2, 0.7], 0.4));
    })))"""
    run = [node, "-e", script]
    done = subprocess.run(run, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]
    for values, (_, name) in zip(json.loads(done.stdout), texts, strict=True):
        np.testing.assert_allclose(values, KNOWN, atol=1e-14, err_msg=name)
    return len(texts)


def check_octave(chosen, folder):
    """Run all of them in one Octave, each with its own folder first on the path."""
    octave = shutil.which("octave-cli") or shutil.which("octave")
    if octave is None:
        pytest.skip("octave is not installed")
    lines, count = [], 0
    for number, model, text in emitted(chosen, "octave"):
        text.write(folder / f"m{number}")
        call = f"{model.name}_Phi([0.3; -0.2; 0.7], 0.4)"
        lines += [f"addpath('m{number}'); v = {call}; rmpath('m{number}');"]
        lines += [f"printf('%s %.17g %.17g %.17g\\n', '{model.name}', v);"]
        count += 1
    (folder / "run_all_of_them.m").write_text("\n".join(lines))
    run = [octave, "--no-gui", "--norc", "--quiet", "run_all_of_them.m"]
    done = subprocess.run(run, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]
    found = [line.split() for line in done.stdout.splitlines()]
    assert len(found) == count
    for name, *values in found:
        np.testing.assert_allclose([float(x) for x in values], KNOWN, atol=1e-14, err_msg=name)
    return count


EVERY = {"numpy": 4, "javascript": 2, "octave": 5, "c": 10}
CHECKS = {"c": check_c, "javascript": check_javascript, "octave": check_octave}


@pytest.mark.parametrize("target", ["numpy", *CHECKS])
@pytest.mark.slow
def test_a_few_names(target, tmp_path, record):
    check_names(target, 80, tmp_path, record)


@pytest.mark.slow
@pytest.mark.parametrize("target", ["numpy", *CHECKS])
def test_all_names(target, tmp_path, record):
    check_names(target, EVERY[target], tmp_path, record)


def check_names(target, every, folder, record):
    """Check one target with every so manieth name that the model takes."""
    chosen, refused = models(every)
    tried = CHECKS[target](chosen, folder) if target in CHECKS else check_numpy(chosen)
    assert tried > 0.8 * len(chosen) > 5
    record(tried=tried, wrong=0, gave_up=refused // every)

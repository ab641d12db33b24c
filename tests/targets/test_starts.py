"""The start of emitted code: from rough guesses it leads where the runtime does."""

import ctypes
import json
import subprocess

import numpy as np
import pytest

import kincompile as kc
from kincompile.criteria import MAX_ITERATIONS, TOLERANCE
from kincompile.runtime.status import Status
from tests.adversary.test_starts import in_octave
from tests.targets.conftest import NEEDED, NODE, OCTAVE, in_node, run_rust
from tests.unit.solver.conftest import rough_guesses, size_around

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::kincompile.errors.AssemblyWarning"),
]

STARTS = ("four_bar", "slider_crank", "cam_flat_follower", "rssr", "spatial_slider_crank")
COUNT = 60


@pytest.fixture(scope="module")
def starts(example_named):
    """Guesses of each example, the size of the mechanism there, and where the runtime ends.

    Turned by whole turns, and so rough that the nearer branch is not the first that is found.
    """
    known = {}
    for name in STARTS:
        module = example_named(name).module
        guesses = rough_guesses(module, COUNT)
        sizes = [size_around(module, guess) for guess in guesses]
        ends = [kc.solve(module, [0.0], guess=guess).q[0] for guess in guesses]
        assert len({tuple(np.round(q, 3)) for q in ends}) > 3
        known[name] = guesses, sizes, ends
    return known


# ---------------------------------------------------------------- JavaScript


@pytest.mark.skipif(NODE is None, reason="node is not installed (Debian: nodejs)")
@pytest.mark.parametrize("name", STARTS)
def test_that_javascript_ends_where_the_runtime_does(starts, example_named, tmp_path, name):
    guesses, _, ends = starts[name]
    kc.emit(example_named(name).model, "javascript").write(tmp_path)
    started = f"g => Array.from({name}.solver.solve({name}, [0], {name}.DEFAULTS, g).q)"
    given = json.dumps([guess.tolist() for guess in guesses])
    found = json.loads(in_node(tmp_path, {name: name}, f"JSON.stringify({given}.map({started}))"))
    np.testing.assert_allclose(found, ends, rtol=0, atol=1e-8)


# ---------------------------------------------------------------- Rust

ASSEMBLED = """macro_rules! assembled {
    ($m:ident, $line:expr) => {
        let numbers: Vec<f64> = $line.split(" ").map(|x| x.parse().unwrap()).collect();
        let guess = numbers[1..].try_into().unwrap();
        println!("{:?}", $m::assembled(0.0, &$m::DEFAULTS, guess, numbers[0]).unwrap());
    };
}
"""


def test_that_rust_ends_where_the_runtime_does(starts, example_named, tmp_path):
    lines, calls, given, known = [], [], [], []
    for name, (guesses, sizes, ends) in starts.items():
        kc.emit(example_named(name).model, "rust").write(tmp_path)
        lines.append(f"mod {name};")
        numbers = ([size, *guess] for size, guess in zip(sizes, guesses, strict=True))
        given += [" ".join(repr(float(x)) for x in row) for row in numbers]
        known += ends
        calls.append(f"for _ in 0..{COUNT} {{ assembled!({name}, lines.next().unwrap()); }}")
    read = "let mut text = String::new(); std::io::stdin().read_to_string(&mut text).unwrap();"
    main = ["use std::io::Read;", "fn main() {", read, "let mut lines = text.lines();", *calls, "}"]
    rows = run_rust(tmp_path, "\n".join([*lines, ASSEMBLED, *main]), "\n".join(given))
    for line, q in zip(rows, known, strict=True):
        found = [float(x) for x in line.strip("[]").split(", ")]
        np.testing.assert_allclose(found, q, rtol=0, atol=1e-8)


# ---------------------------------------------------------------- Octave


@pytest.mark.skipif(OCTAVE is None, reason=NEEDED["octave"][1])
@pytest.mark.parametrize("name", STARTS)
def test_that_octave_ends_where_the_runtime_does(starts, example_named, tmp_path, name):
    guesses, _, ends = starts[name]
    found = in_octave(tmp_path, example_named(name).model, guesses)
    for (is_found, q), known in zip(found, ends, strict=True):
        assert is_found
        np.testing.assert_allclose(q, known, rtol=0, atol=1e-8)


# ---------------------------------------------------------------- C

NUMBERS = ctypes.POINTER(ctypes.c_double)


class Guess(ctypes.Structure):
    """A guess, as the header has it."""

    _fields_ = (
        ("t", ctypes.c_double), ("p", NUMBERS), ("q", NUMBERS), ("size", ctypes.c_double),
        ("tolerance", ctypes.c_double), ("max_iterations", ctypes.c_int),
    )  # fmt: skip


@pytest.fixture(scope="module")
def in_c(example_named, tmp_path_factory, quick_compiler):
    """The function that assembles an example in C: its status and its position."""

    def assembled(name):
        folder = tmp_path_factory.mktemp(name)
        kc.emit(example_named(name).model, "c").write(folder)
        command = (quick_compiler, "-O1", "-shared", "-fPIC", f"{name}.c", "-lm", "-o", "own")
        subprocess.run(command, cwd=folder, check=True)
        function = ctypes.CDLL(folder / "own")[f"{name}_assemble"]

        def call(p, guess, size):
            p, guess, q = np.array(p), np.array(guess), np.full(len(guess), np.nan)
            places = [x.ctypes.data_as(NUMBERS) for x in (p, guess, q)]
            own = Guess(0.0, *places[:2], size, TOLERANCE, MAX_ITERATIONS)
            return function(ctypes.byref(own), places[2]), q

        return call

    return assembled


@pytest.mark.parametrize("name", STARTS)
def test_that_c_ends_where_the_runtime_does(starts, example_named, in_c, name):
    module, assembled = example_named(name).module, in_c(name)
    for guess, size, known in zip(*starts[name], strict=True):
        status, q = assembled(module.DEFAULTS, guess, size)
        assert status == Status.CONVERGED
        np.testing.assert_allclose(q, known, rtol=0, atol=1e-8)


def test_that_c_says_why_there_is_no_position(example_named, in_c):
    module, assembled = example_named("four_bar").module, in_c("four_bar")
    too_short = module.DEFAULTS * [1, 0.1, 1, 1, 1]
    assert assembled(too_short, module.GUESS, 1.0)[0] == Status.NOT_CONVERGED
    assert assembled(module.DEFAULTS, np.full(9, np.nan), 1.0)[0] == Status.NOT_FINITE

"""The committed files of generated/ are what some examples emit today; what all emit runs alone.

Of the other examples `generated/digests.txt` has a line for each target: a review sees which of
them a change reaches. `pytest -k golden --update-goldens` rewrites all this and fails the run, so
that nothing passes by updating. The bytes are those of the pinned SymPy; on another one the numbers
must agree.
"""

import hashlib
import json
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
from kincompile.emitters.registry import TARGETS
from kincompile.ir.interpret import interpret
from kincompile.ir.lower import lower
from kincompile.model.mechanism import system_of

ROOT = Path(__file__).resolve().parents[2]
GENERATED = ROOT / "generated"
NUMPY = GENERATED / "numpy"
DIGESTS = "digests.txt"
EXAMPLES = sorted(path.stem for path in (ROOT / "examples").glob("*.py"))
PINNED = re.search(
    r"^sympy==(\S+)$", (ROOT / ".ci" / "constraints.txt").read_text(encoding="utf-8"), re.MULTILINE
)
QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")
GOLDEN = ("cam_by_table", "four_bar", "problem_3_5_6", "slider_crank")
"""Few enough for a review: bodies and joints, a slider, a cam by table, free equations."""
IN_SPACE = tuple(sorted(path.stem for path in (ROOT / "examples" / "space").glob("*.py")))
WRITTEN = (*GOLDEN, "spatial_slider_crank")
"""Whose files are committed, of every target: those of the plane and the smallest in space."""
TRANSMISSIONS = {
    "four_bar": (["motor"], ["phi_rocker"]),
    "stewart_gough": (
        [f"leg_{k}" for k in range(1, 7)],
        [f"{k}_platform" for k in ("x", "y", "z", "e0", "e1", "e2", "e3")],
    ),
}
"""Mechanisms as functions: of the first the files are committed, of the other the digests."""
FILES = [(target, name) for target in TARGETS for name in WRITTEN]
OTHERS = sorted({*EXAMPLES, *IN_SPACE} - {*WRITTEN})

pytestmark = pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")

# Runs a golden in an interpreter in which neither kincompile nor SymPy can be imported.
ALONE = """
import json, runpy, sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("kincompile", "sympy", "scipy", "jinja2"):
            raise ImportError(f"an emitted module must not import {name}")

sys.meta_path.insert(0, Blocked())
import numpy as np

results = {}
for path in sys.argv[1:]:
    module = runpy.run_path(path)
    rng = np.random.default_rng(7)
    q, q_dot = rng.uniform(-1, 1, (2, module["N_COORDINATES"]))
    values = module["kinematics"](q, q_dot, 0.4)
    module["march"](module["GUESS"], [0.0, 0.1])
    results[module["NAME"]] = [value.tolist() for value in values]
print(json.dumps(results))
"""

# Emits every example and prints the digest of each.
EMIT = """
import hashlib, runpy, sys
import kincompile as kc

for path in sys.argv[1:]:
    names = runpy.run_path(path)
    model = names["mechanism"] if "mechanism" in names else names["system"]
    for target in ("numpy", "c", "octave", "javascript", "rust"):
        text = "".join(kc.emit(model, target).files.values())
        print(target, path, hashlib.sha256(text.encode()).hexdigest())
"""


def is_pinned() -> bool:
    """Return whether this SymPy is the one whose bytes are committed."""
    assert PINNED is not None
    return PINNED[1] == sympy.__version__


def read_text(path: Path) -> str:
    """Return a file's text as it is: line ends count."""
    return path.read_bytes().decode("utf-8")


def run(*arguments: str, **environment: str) -> str:
    """Run Python and return what it prints."""
    result = subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **environment},
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.fixture(scope="module", autouse=True)
def rewritten(request, example_named):
    """With --update-goldens rewrite them first, and return what was changed."""
    if not request.config.getoption("--update-goldens"):
        return []
    wanted = {
        f"{target}/{file}": text
        for target, name in FILES
        for file, text in example_named(name).files(target).items()
    }
    model = example_named("four_bar").model
    wanted |= {
        f"{target}/{file}": text
        for target in TARGETS
        for file, text in transmission(model, target).items()
    }
    lines = [digest(example_named(name), target) for name in OTHERS for target in TARGETS]
    lines += [transmission_digest(example_named, target) for target in TARGETS]
    return update(GENERATED, wanted | {DIGESTS: "".join(lines)})


def digest(example: Any, target: str) -> str:
    """Return the line of digests.txt about what an example emits for a target."""
    text = "".join(example.files(target).values())
    return f"{hashlib.sha256(text.encode()).hexdigest()} {target} {example.path.stem}\n"


def transmission(model: Any, target: str) -> Any:
    """Return the files of a mechanism as a function of its inputs."""
    return kc.emit(model, target, transmission=TRANSMISSIONS[system_of(model).name]).files


def transmission_digest(example_named: Any, target: str) -> str:
    """Return the line of digests.txt about the transmission in space."""
    text = "".join(transmission(example_named("stewart_gough").model, target).values())
    return f"{hashlib.sha256(text.encode()).hexdigest()} {target} stewart_gough_transmission\n"


def update(folder: Path, files: dict[str, str]) -> list[str]:
    """Bring a folder of goldens up to date; return what was changed."""
    wanted = {folder / name: text for name, text in files.items()}
    changes = []
    for path in sorted(file for file in folder.rglob("*") if file.is_file()):
        if path not in wanted:
            path.unlink()
            changes.append(f"removed {path.relative_to(folder)}")
    for path, source in wanted.items():
        if not path.exists() or read_text(path) != source:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(source.encode())
            changes.append(f"wrote {path.relative_to(folder)}")
    return changes or ["nothing had changed"]


def test_that_this_run_does_not_rewrite_them(rewritten):
    assert not rewritten, "--update-goldens fails by design: " + "; ".join(rewritten)


def test_that_nothing_is_missing_and_nothing_extra(example_named):
    assert sorted(path.name for path in GENERATED.iterdir()) == sorted([*TARGETS, DIGESTS])
    for target in TARGETS:
        found = [path for path in (GENERATED / target).iterdir() if path.name != "__pycache__"]
        wanted = [file for name in WRITTEN for file in example_named(name).files(target)]
        wanted += transmission(example_named("four_bar").model, target)
        assert sorted(path.name for path in found) == sorted(wanted)
    about = [line.split()[1:] for line in read_text(GENERATED / DIGESTS).splitlines()]
    listed = [[target, name] for name in OTHERS for target in TARGETS]
    assert about == listed + [[target, "stewart_gough_transmission"] for target in TARGETS]


@pytest.mark.skipif(not is_pinned(), reason="the bytes are those of the pinned SymPy")
@pytest.mark.parametrize(("target", "golden_name"), FILES)
def test_that_the_text_is_what_is_emitted_today(example_named, golden_name, target):
    for name, text in example_named(golden_name).files(target).items():
        golden = read_text(GENERATED / target / name)
        assert golden == text, "make update-goldens rewrites it, if it is meant"


@pytest.mark.skipif(not is_pinned(), reason="the bytes are those of the pinned SymPy")
@pytest.mark.parametrize(
    "other", [pytest.param(name, marks=[pytest.mark.slow] * (name in IN_SPACE)) for name in OTHERS]
)
def test_that_the_digests_are_those_of_what_is_emitted_today(example_named, other):
    lines = read_text(GENERATED / DIGESTS)
    missing = [x for x in TARGETS if digest(example_named(other), x) not in lines]
    assert not missing, f"what {other} emits for them has changed; make update-goldens, if meant"


@pytest.mark.skipif(not is_pinned(), reason="the bytes are those of the pinned SymPy")
@pytest.mark.parametrize("target", TARGETS)
def test_that_transmissions_are_what_is_emitted_today(example_named, target):
    for name, text in transmission(example_named("four_bar").model, target).items():
        golden = read_text(GENERATED / target / name)
        assert golden == text, "make update-goldens rewrites it, if it is meant"


@pytest.mark.skipif(not is_pinned(), reason="the bytes are those of the pinned SymPy")
@pytest.mark.slow
def test_that_the_digests_of_transmissions_are_those_of_today(example_named):
    lines = read_text(GENERATED / DIGESTS)
    missing = [x for x in TARGETS if transmission_digest(example_named, x) not in lines]
    assert not missing, "what stewart_gough emits as a transmission has changed"


@pytest.mark.parametrize("golden_name", WRITTEN)
def test_that_the_numbers_are_those_of_today(example_named, golden_name):
    golden = kc.load(NUMPY / f"{golden_name}.py")
    module = example_named(golden_name).module
    for constant in ("COORDINATES", "EQUATIONS", "PARAMETERS", "UNITS"):
        assert getattr(golden, constant) == getattr(module, constant)
    np.testing.assert_array_equal(golden.PATTERN, module.PATTERN)
    rng = np.random.default_rng(7)
    q, q_dot = rng.uniform(-1, 1, (2, 5, module.N_COORDINATES))
    for here, there in zip(
        module.kinematics(q, q_dot, 0.4), golden.kinematics(q, q_dot, 0.4), strict=True
    ):
        np.testing.assert_allclose(there, here, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    "name", [*EXAMPLES, *(pytest.param(name, marks=pytest.mark.slow) for name in IN_SPACE)]
)
def test_that_every_example_has_the_numbers_of_the_interpreter(example_named, name):
    example = example_named(name)
    program, module = lower(system_of(example.model)), example.module
    rng = np.random.default_rng(7)
    q, q_dot = rng.uniform(-1, 1, (2, 5, module.N_COORDINATES))
    found = module.kinematics(q, q_dot, 0.4)
    with np.errstate(invalid="ignore"):  # of outputs, such as an angle from its cosine
        constraints = interpret(program, q, q_dot, 0.4)[:4]
    for here, there in zip(constraints, found, strict=True):
        np.testing.assert_allclose(there, here, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    "names", [EXAMPLES, pytest.param([*IN_SPACE], marks=pytest.mark.slow)], ids=["plane", "space"]
)
def test_that_modules_run_where_kincompile_and_sympy_cannot_be_imported(
    example_named, tmp_path, names
):
    for name in names:
        kc.emit(example_named(name).model).write(tmp_path)
    paths = [str(tmp_path / f"{name}.py") for name in names]
    results = json.loads(run("-I", "-c", ALONE, *paths))
    assert sorted(results) == names
    for name, values in results.items():
        module = example_named(name).module
        q, q_dot = np.random.default_rng(7).uniform(-1, 1, (2, module.N_COORDINATES))
        expected = module.kinematics(q, q_dot, 0.4)
        for quantity, here, there in zip(QUANTITIES, expected, values, strict=True):
            np.testing.assert_allclose(there, here, rtol=1e-12, atol=1e-12, err_msg=quantity)


def test_that_the_block_on_imports_does_block():
    code = ALONE.replace("import numpy as np", "import sympy", 1)
    with pytest.raises(AssertionError, match="must not import sympy"):
        run("-I", "-c", code)


# The processes of the other tests have a random seed each, and compare with what is committed.
@pytest.mark.slow
def test_that_the_bytes_do_not_depend_on_the_hash_seed(example_named):
    paths = [str(example_named(name).path) for name in (*EXAMPLES, *IN_SPACE)]
    first, other = (run("-c", EMIT, *paths, PYTHONHASHSEED=seed).splitlines() for seed in "01")
    assert len(first) == len(TARGETS) * len(paths)
    assert first == other


def test_that_updating_rewrites_and_removes(tmp_path):
    folder = tmp_path / "numpy"
    folder.mkdir()
    (folder / "kept.py").write_bytes(b"same\n")
    (folder / "old.py").write_bytes(b"old\n")
    (folder / "stray.py").write_bytes(b"stray\n")
    files = {"kept.py": "same\n", "old.py": "new\n", "added.py": "added\n"}
    changes = update(folder, files)
    assert changes == ["removed stray.py", "wrote old.py", "wrote added.py"]
    assert {path.name: read_text(path) for path in folder.iterdir()} == files
    assert update(folder, files) == ["nothing had changed"]


@pytest.mark.parametrize(
    "volatile", [r"/work|/home|/tmp", r"\b20\d\d-\d\d-\d\d\b", r"0x[0-9a-f]{6}"]
)
def test_that_they_hold_nothing_volatile(volatile):
    for path in [path for path in GENERATED.rglob("*.*") if path.suffix in (".py", ".c", ".h")]:
        assert not re.search(volatile, read_text(path)), path.name

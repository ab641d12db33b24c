import inspect
import linecache
import os
import sys
import traceback
from pathlib import Path

import numpy as np
import pytest

from kincompile.errors import ContractError, InputError
from kincompile.runtime.engine.code import functions
from kincompile.runtime.load import from_source, load

MODULES = Path(__file__).parent / "modules"
SOURCE = (MODULES / "pendulum.py").read_text(encoding="utf-8")


def test_loading_leaves_no_trace(tmp_path):
    path = tmp_path / "pendulum.py"
    path.write_text(SOURCE)
    before = list(sys.path), set(sys.modules)
    module = load(path)
    assert module.NAME == "pendulum"
    assert (list(sys.path), set(sys.modules)) == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_emitted_again_is_read_afresh(tmp_path):
    path = tmp_path / "m.py"
    path.write_text(SOURCE)
    load(path)
    stamp = path.stat()
    path.write_text(SOURCE.replace('FINGERPRINT = "321"', 'FINGERPRINT = "abc"'))
    os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    assert load(path).FINGERPRINT == "abc"


def test_two_files_of_one_name_do_not_disturb_each_other(tmp_path):
    for folder, omega in (("a", "1.0"), ("b", "2.0")):
        (tmp_path / folder).mkdir()
        text = SOURCE.replace("np.array([2 * math.pi, math.pi / 2])", f"np.array([{omega}, 0.0])")
        (tmp_path / folder / "m.py").write_text(text)
    a, b = load(tmp_path / "a" / "m.py"), load(str(tmp_path / "b" / "m.py"))
    assert (a.DEFAULTS[0], b.DEFAULTS[0]) == (1, 2)


def test_a_loaded_module_raises_the_error_of_the_package():
    module = load(MODULES / "problem_3_5_6.py")
    with pytest.raises(InputError, match="q is not finite"):
        module.Phi(np.array([np.nan, 0.0, 0.0]), 0.0)


def test_source_in_memory_can_be_read_back_and_shows_in_tracebacks():
    module = from_source(SOURCE, "pendulum")
    assert inspect.getsource(module.nu) == "def nu(q, t, p=DEFAULTS):\n" + (
        "    return np.array([0.0, 0.0, p[0]])\n"
    )
    linecache.checkcache()
    with pytest.raises(TypeError) as caught:
        module.nu(None, 0.0, None)
    assert "return np.array([0.0, 0.0, p[0]])" in "".join(traceback.format_tb(caught.tb))


def test_two_sources_of_one_name_keep_their_own_lines():
    first = from_source(SOURCE, "m")
    second = from_source("# another\n" + SOURCE, "m")
    assert inspect.getsource(first.nu) == inspect.getsource(second.nu)


def test_the_same_source_is_remembered_once():
    from_source(SOURCE, "again")
    size = len(linecache.cache)
    from_source(SOURCE, "again")
    assert len(linecache.cache) == size


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('NAME = "pendulum"\n', "", "NAME is missing"),
        ("N_EQUATIONS = 3", "N_EQUATIONS = 3.0", "N_EQUATIONS is of type float, not int"),
        ("def gamma(", "def gamma_(", "the function gamma is missing"),
        ('"phi_rod")', '"phi_rod", "z")', "COORDINATES has 4 names, and N_COORDINATES is 3"),
        ('("pin.x", "pin.y", "motor")', '("A", "A", "B")', "EQUATIONS has a name twice"),
        ('("omega", "phi_0")', "(1, 2)", "PARAMETERS holds something else than names"),
        ("[2 * math.pi, math.pi / 2]", "[1.0]", r"DEFAULTS has shape \(1,\), and there are 2"),
        ("[1.0, 0.0, math.pi / 2]", "[1.0]", r"GUESS has shape \(1,\), and there are 3 COORD"),
        ('"omega": "rad/s", ', "", "UNITS does not say the unit of omega"),
        ("[[0, 0], [0, 2]", "[[0, 3], [0, 2]", "PATTERN points outside the 3 x 3 matrix Phi_q"),
        ("[[0, 0], [0, 2]", "[[0, 2], [0, 0]", "PATTERN does not go row by row"),
        ("[[0, 0], [0, 2]", "[[0, 0.5], [0, 2]", "PATTERN holds float64, not integers"),
        (
            "PATTERN = np.array([[0",
            "PATTERN = np.array([[[0",
            "is not a Python module: .* in line 18",
        ),
        ("[1.0, 0.0, math.pi / 2]", "[1.0, 0.0, math.nan]", "GUESS does not hold finite"),
        ("[1.0, 0.0, math.pi / 2]", "[1, 0, 2]", "GUESS does not hold finite floating-point"),
        ("FORMAT = 1", "FORMAT = 4", "its FORMAT is 4 and this version reads 1, 2, 3"),
        ("import math", "import maths_that_is_not_there", "ModuleNotFoundError"),
    ],
)
def test_a_broken_contract_is_named_with_the_remedy(old, new, message):
    assert old in SOURCE
    with pytest.raises(ContractError, match=message) as caught:
        from_source(SOURCE.replace(old, new), "pendulum")
    assert "pendulum" in str(caught.value)
    assert "Emit it again with `kincompile compile MODEL -o FILE`" in str(caught.value)


def test_a_pattern_of_the_wrong_shape_is_named():
    source = SOURCE + "\nPATTERN = PATTERN.ravel()\n"
    with pytest.raises(ContractError, match=r"PATTERN has shape \(10,\), not \(nonzeros, 2\)"):
        from_source(source, "pendulum")


def test_all_that_is_missing_is_said_at_once():
    with pytest.raises(ContractError) as caught:
        from_source("FORMAT = 1\n", "empty")
    assert len(caught.value.problems) == 11 + len(functions(()))


def test_a_file_that_is_a_model_is_told_how_to_read_it(tmp_path):
    (tmp_path / "m.py").write_text("import math\n")
    with pytest.raises(
        ContractError, match=r"FORMAT is missing; a model is read by kc\.read_model"
    ):
        load(tmp_path / "m.py")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"cannot load .*m\.py: there is no such file\. Check"):
        load(tmp_path / "m.py")


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"it is a folder\. Give the \.py file in it"):
        load(tmp_path)


def test_a_file_that_cannot_be_opened_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"cannot load .*m\.py: Not a directory\. Check the file"):
        load(tmp_path / "file" / "m.py")


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"def f(:\n", b"a = 1\x00"])
def test_a_file_that_is_not_python_is_refused(tmp_path, content):
    path = tmp_path / "m.py"
    path.write_bytes(content)
    with pytest.raises(ContractError, match=r"m\.py .*Emit it again"):
        load(path)

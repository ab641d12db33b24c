import subprocess
import sys

import numpy as np
import pytest

import kincompile as kc
from kincompile.cli.compile import ENDINGS
from kincompile.emitters.registry import PACKAGES, TARGETS


def test_that_the_module_written_is_the_one_that_emit_gives(kincompile, pendulum, tmp_path):
    done = kincompile("compile", pendulum, "-o", tmp_path / "out.py")
    assert (done.exit_code, done.stdout) == (0, "")
    assert done.stderr == f"Wrote {tmp_path / 'out.py'}\n"
    assert (tmp_path / "out.py").read_text() == kc.emit(kc.read_model(pendulum)).source


def test_that_a_folder_gets_a_file_with_the_name_of_the_mechanism(kincompile, pendulum, tmp_path):
    (tmp_path / "out").mkdir()
    assert kincompile("compile", pendulum, "-o", tmp_path / "out").exit_code == 0
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["pendulum.py"]


@pytest.mark.parametrize("target", TARGETS)
def test_that_a_name_without_an_ending_is_a_folder(kincompile, pendulum, tmp_path, target):
    """A file without an ending can be imported, required and compiled by nobody."""
    assert (
        kincompile("compile", pendulum, "--target", target, "-o", tmp_path / "src").exit_code == 0
    )
    written = {path.name for path in (tmp_path / "src").iterdir()}
    assert written == {*kc.emit(kc.read_model(pendulum), target).files}


def test_that_a_header_is_no_name_for_the_source(kincompile, pendulum, tmp_path):
    done = kincompile("compile", pendulum, "--target", "c", "-o", tmp_path / "other.h")
    assert done.exit_code == 2
    assert "the name of another file that is written; end it as pendulum.c" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == [pendulum.name]


@pytest.mark.parametrize("transmission", [None, (["motor"], ["phi_bob"])])
def test_that_javascript_in_mjs_has_an_export(pendulum, tmp_path, transmission):
    emitted = kc.emit(kc.read_model(pendulum), "javascript", transmission=transmission)
    script, module = emitted.write(tmp_path)[0], emitted.write(tmp_path, "m.mjs")[0]
    exported = f"\nexport default {script.stem};\n"
    assert module.read_text() == script.read_text() + exported


@pytest.mark.parametrize("target", TARGETS)
def test_that_a_model_without_its_driver_is_written_with_a_warning(
    kincompile, pendulum, tmp_path, target
):
    pendulum.write_text(pendulum.read_text().replace("mechanism.add(kc.Abs", "(kc.Abs"))
    (tmp_path / "out").mkdir()
    done = kincompile("compile", pendulum, "--target", target, "-o", tmp_path / "out")
    assert (done.exit_code, done.stdout) == (0, "")
    warning, *written = done.stderr.splitlines()
    assert warning.startswith("Warning: 'pendulum' has 2 equations for 3 coordinates (drivers: n")
    assert "1 more equation is needed" in warning
    assert all(line.startswith("Wrote ") for line in written)
    if target == "numpy":
        module = kc.load(tmp_path / "out" / "pendulum.py")
        with pytest.raises(kc.StructuralError) as caught:
            kc.solve(module, 0.0)
        assert warning == f"Warning: {caught.value}"


def test_that_a_dash_is_stdout(kincompile, pendulum, tmp_path):
    done = kincompile("compile", pendulum, "-o", "-")
    assert done.stdout == kc.emit(kc.read_model(pendulum)).source
    assert done.stderr == ""


def test_that_the_target_may_be_named(kincompile, pendulum):
    done = kincompile("compile", pendulum, "--target", "numpy", "-o", "-")
    assert done.exit_code == 0
    assert "def Phi(" in done.stdout


def test_that_the_model_is_never_overwritten(kincompile, pendulum, tmp_path):
    text = pendulum.read_text()
    link = tmp_path / "link.py"
    link.symlink_to(pendulum)
    for output in (pendulum, tmp_path, link):
        done = kincompile("compile", pendulum, "-o", output)
        assert done.exit_code == 2
        assert "is the model itself; give another name to write to" in done.stderr
        assert pendulum.read_text() == text


@pytest.mark.parametrize(
    ("target", "ending", "other"),
    [("numpy", ".c", "c"), ("c", ".py", "numpy"), ("octave", ".js", "javascript")],
)
def test_that_the_ending_of_another_target_is_refused(
    kincompile, pendulum, tmp_path, target, ending, other
):
    done = kincompile("compile", pendulum, "--target", target, "-o", tmp_path / f"out{ending}")
    assert done.exit_code == 2
    assert f"give --target {other}, or end the name as pendulum." in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == [pendulum.name]


def test_that_every_target_has_an_ending_and_a_place_in_the_help(kincompile):
    text = " ".join(kincompile("compile", "--help").stdout.split())
    for name in (*TARGETS, *PACKAGES):
        assert name in set(ENDINGS.values())
        assert name in text


def test_that_a_failure_leaves_an_existing_file_alone(kincompile, tmp_path):
    (tmp_path / "model.py").write_text("1 / 0")
    (tmp_path / "out.py").write_text("precious")
    assert kincompile("compile", tmp_path / "model.py", "-o", tmp_path / "out.py").exit_code == 2
    assert (tmp_path / "out.py").read_text() == "precious"
    assert len(list(tmp_path.iterdir())) == 2


def test_that_nothing_but_the_output_is_written(kincompile, pendulum, tmp_path):
    kincompile("compile", pendulum, "-o", tmp_path / "out.py")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.py", "pendulum.py"]


def test_that_a_compiled_module_runs_without_kincompile(process, pendulum, tmp_path):
    process("compile", pendulum, "-o", tmp_path / "out.py")
    program = (
        "import sys; sys.modules['kincompile'] = sys.modules['sympy'] = None\n"
        "import out\n"
        "print(*out.Phi(out.GUESS, 0.0))"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    # The bob at (1, 0), angle 0.5: the pin is off by (1 - cos 0.5, -sin 0.5), the motor holds.
    expected = [1 - np.cos(0.5), -np.sin(0.5), 0]
    np.testing.assert_allclose([float(part) for part in done.stdout.split()], expected, atol=1e-15)


def test_that_a_transmission_is_written_as_a_file_of_its_own(kincompile, pendulum, tmp_path):
    system = kc.read_model(pendulum).system()
    ends = f"{system.constraints[-1].name}:{system.coordinates[0].name}"
    (tmp_path / "out").mkdir()
    given = ("--transmission", ends, "--target", "c", "-o", tmp_path / "out")
    done = kincompile("compile", pendulum, *given)
    assert (done.exit_code, done.stdout) == (0, "")
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["pendulum_transmission.c", "pendulum_transmission.h"]


@pytest.mark.parametrize("ends", ["motor", "motor:", ":x", "a:b:c", "a,,b:c"])
def test_that_a_transmission_without_two_ends_is_refused(kincompile, pendulum, ends):
    done = kincompile("compile", pendulum, "--transmission", ends, "-o", "-")
    assert done.exit_code != 0
    assert f"--transmission {ends} is not of the form INPUTS:OUTPUTS" in done.stderr

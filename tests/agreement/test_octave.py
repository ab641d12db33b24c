"""The .m files in a real Octave: every quantity and the whole motion, against the NumPy target."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sympy

import kincompile as kc

ROOT = Path(__file__).resolve().parents[2]
NAMES = sorted(path.stem for path in (ROOT / "examples").glob("*.py"))
STATES = 3
QUANTITIES = ("Phi", "Phi_q", "nu", "gamma")

octave = pytest.mark.skipif(
    shutil.which("octave-cli") is None, reason="octave-cli is not installed (Debian: octave)"
)


def states(module):
    """Return seeded states: q, q_dot and t, all generic."""
    rng = np.random.default_rng(11)
    q, q_dot = rng.uniform(0.2, 1.2, (2, STATES, module.N_COORDINATES))
    return q, q_dot, rng.uniform(0.1, 0.9, STATES)


def vector(values):
    return "[" + "; ".join(repr(float(value)) for value in values) + "]"


def driver(name, module):
    """Return Octave code that prints every quantity at every state."""
    lines = []
    for q, q_dot, t in zip(*states(module), strict=True):
        lines += [f"q = {vector(q)}; q_dot = {vector(q_dot)}; t = {float(t)!r};"]
        for quantity in QUANTITIES:
            arguments = "q, q_dot, t" if quantity == "gamma" else "q, t"
            lines.append(f"show('{name}.{quantity}', {name}_{quantity}({arguments})');")
    return lines


def run_octave(folder, lines):
    """Run code in a folder and return what `show` printed, as lists of numbers by name."""
    (folder / "show.m").write_text(
        "function show(name, values)\nprintf('%s', name);\nprintf(' %.17g', values);\n"
        "printf('\\n');\nend\n",
        encoding="utf-8",
    )
    (folder / "all_of_it.m").write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = subprocess.run(
        ["octave-cli", "--norc", "--no-history", "--no-window-system", "--quiet", "all_of_it.m"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, list[list[float]]] = {}
    for line in done.stdout.splitlines():
        name, *numbers = line.split()
        found.setdefault(name, []).append([float(number) for number in numbers])
    return found


@pytest.fixture(scope="module")
def of_all_examples(example_named, tmp_path_factory):
    """Run every example in one Octave: a process takes half a second to start."""
    folder = tmp_path_factory.mktemp("octave")
    lines = []
    for name in NAMES:
        example = example_named(name)
        kc.emit(example.model, "octave").write(folder)
        lines += [*driver(name, example.module), name]
        lines += [f"show('{name}.{value}', {value});" for value in ("T", "Q", "Q_dot", "Q_ddot")]
    return run_octave(folder, lines)


def close(found, expected, tolerance=1e-12):
    scale = 1 + np.abs(expected)
    assert np.shape(found) == np.shape(expected)
    assert np.max(np.abs(found - expected) / scale) < tolerance


@octave
@pytest.mark.parametrize("name", NAMES)
def test_that_every_quantity_agrees(name, of_all_examples, example_named):
    module = example_named(name).module
    q, q_dot, t = states(module)
    for quantity, expected in zip(QUANTITIES, module.kinematics(q, q_dot, t), strict=True):
        found = np.array(of_all_examples[f"{name}.{quantity}"])
        close(found.reshape(expected.shape), expected)


@octave
@pytest.mark.parametrize("name", NAMES)
def test_that_the_script_finds_the_same_motion(name, of_all_examples, example_named):
    solution = example_named(name).solution
    close(np.array(of_all_examples[f"{name}.T"][0]), solution.t)
    for quantity, expected in (
        ("Q", solution.q), ("Q_dot", solution.q_dot), ("Q_ddot", solution.q_ddot),
    ):  # fmt: skip
        found = np.array(of_all_examples[f"{name}.{quantity}"][0]).reshape(expected.shape)
        # Two solvers stop at two points within the tolerance; Phi_q magnifies the difference.
        close(found, expected, 1e-10)


def strange():
    """Return a mechanism with a table, a Piecewise, a root and names that Octave has itself."""
    m = kc.Mechanism("strange")
    end = m.parameter("end", 0.3)
    sin = m.parameter("sin", 0.2)
    cam, pin = m.body("cam"), m.body("pin", guess=(1, 0, 0))
    angles = [k * 0.7 for k in range(9)]
    table = (angles, [1 + 0.1 * np.cos(x) for x in angles])
    ramp = sympy.Piecewise((kc.t**2, kc.t < 0.5), (kc.t - sympy.Rational(1, 4), True))
    m.add(kc.Revolute("shaft", cam, (end, 0), m.ground, (0, sin)))
    m.add(kc.PointFollower("slot", pin, (0, 0), cam, (0, 0), table, guess=0.1))
    m.add(kc.AbsoluteAngle("still", pin, sympy.sqrt(1 + kc.t) + sympy.log(kc.t + sin)))
    m.add(kc.AbsoluteY("level", pin, (0, 0), sympy.atan2(kc.t, 2) ** sympy.Rational(3, 2)))
    m.add(kc.AbsoluteAngle("motor", cam, ramp))
    return m


@octave
def test_that_tables_pieces_and_reserved_names_agree(tmp_path):
    m = strange()
    module = kc.compile(m)
    emitted = kc.emit(m, "octave")
    assert "strange_rho_j_slot.m" in emitted.files
    emitted.write(tmp_path)
    found = run_octave(tmp_path, driver("strange", module))
    for quantity, expected in zip(QUANTITIES, module.kinematics(*states(module)), strict=True):
        close(np.array(found[f"strange.{quantity}"]).reshape(expected.shape), expected)


@octave
def test_that_outside_a_domain_there_is_no_complex_number(tmp_path):
    m = kc.Mechanism("domain")
    m.add(kc.AbsoluteAngle("root", m.body("arm"), sympy.sqrt(kc.t)))
    m.add(kc.AbsoluteX("x", "arm", (0, 0), 0))
    m.add(kc.AbsoluteY("y", "arm", (0, 0), 0))
    kc.emit(m, "octave").write(tmp_path)
    found = run_octave(tmp_path, ["show('Phi', domain_Phi([0; 0; 0], -1));"])
    assert json.dumps(found["Phi"][0]) == "[NaN, 0.0, 0.0]"


@octave
def test_that_a_guess_at_which_phi_q_is_singular_gives_no_motion(tmp_path):
    """Newton goes 1e14 rad away, where corrections are small beside q and Phi is not zero."""
    m = kc.Mechanism("stuck")
    cam, follower = m.body("cam"), m.body("follower", guess=(0, 0.06, 0))
    angles = [2 * np.pi * k / 36 for k in range(36)]
    table = (angles, [0.05 + 0.01 * np.cos(angle) for angle in angles])
    m.add(kc.Revolute("axle", m.ground, (0, 0), cam, (0, 0)))
    m.add(kc.Translational("guide", m.ground, (0, 0), (0, 1), follower, (0, 0), (0, 1)))
    m.add(kc.PointFollower("contact", follower, (0, 0), cam, (0, 0), table))
    m.add(kc.AbsoluteAngle("motor", cam, 2 * kc.pi * kc.t))
    kc.emit(m, "octave").write(tmp_path)
    refused = "show('refused', strfind(problem.message, 'no position found at t = 0;'));"
    found = run_octave(
        tmp_path, ["try", "stuck", "show('found', 1);", "catch problem", refused, "end"]
    )
    assert found == {"refused": [[8.0]]}


def test_that_a_name_beyond_matlab_is_refused():
    m = kc.Mechanism("long")
    m.add(kc.AbsoluteAngle("motor", m.body("b" * 70), kc.t))
    m.add(kc.AbsoluteX("x", "b" * 70, (0, 0), 0))
    m.add(kc.AbsoluteY("y", "b" * 70, (0, 0), 0))
    with pytest.raises(kc.UnsupportedError, match="MATLAB reads 63 characters of a name"):
        kc.emit(m, "octave")


def test_that_octave_files_are_not_loaded_into_python():
    with pytest.raises(kc.UnsupportedError, match=r"only modules of the targets numpy, c can be"):
        kc.compile(strange(), target="octave")

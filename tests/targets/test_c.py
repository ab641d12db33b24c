"""The C target: text that strict compilers accept, and the numbers of every kind of expression."""

import re
import subprocess

import mpmath
import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.runtime.status import Status
from tests import transmission_models as models

STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror")
x, y = sympy.symbols("x y")

# what the compiler itself brings, for one processor, is no library
ALLOWED = re.compile(r'#include (<(stddef|stdint|string|math|emmintrin)\.h>|"\w+\.h")')


def compare(model, q, t=0.0, tolerance=1e-13):
    """Compare all four quantities of the C module and the NumPy module."""
    native, module = kc.compile(model, target="c"), kc.compile(model)
    q = np.asarray(q, dtype=float)
    found, expected = native.kinematics(q, 1 + q**2, t), module.kinematics(q, 1 + q**2, t)
    for here, there in zip(found, expected, strict=True):
        np.testing.assert_allclose(here, there, rtol=tolerance, atol=tolerance)


# ---------------------------------------------------------------- the text


@pytest.mark.parametrize(
    "level", [("-O0",), ("-O2", "-D_WHOLE_REGISTERS", "-march=native")], ids=["plain", "optimized"]
)
@pytest.mark.slow
def test_strict_compilers_have_nothing_to_say(example, quick_compiler, tmp_path, level):
    for name, text in example.files("c").items():
        (tmp_path / name).write_text(text)
    source = next(iter(example.files("c")))
    command = (quick_compiler, *STRICT, *level, "-c", source, "-o", "out.o")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.every(5)
def test_a_header_can_be_included_alone_and_twice(example, quick_compiler, tmp_path):
    source, header = example.files("c")
    (tmp_path / header).write_text(example.files("c")[header])
    (tmp_path / "user.c").write_text(
        f'#include "{header}"\n#include "{header}"\nint main(void){{return 0;}}\n'
    )
    command = (quick_compiler, *STRICT, "user.c", "-o", "user")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert source.removesuffix(".c") == header.removesuffix(".h")


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["mechanism", "transmission"])
def test_a_mechanism_and_its_transmission_go_into_one_program(order, tmp_path, quick_compiler):
    """Whichever header comes first; in C and in C++."""
    model, ends = models.crank_rocker(), (["motor"], ["rocker.phi"])
    for emitted in (kc.emit(model, "c"), kc.emit(model, "c", transmission=ends)):
        emitted.write(tmp_path)
    name = model.name
    headers = [f"{name}.h", f"{name}_transmission.h"]
    lines = [f'#include "{headers[k]}"' for k in order]
    body = (
        f"static {name}_state s;\nint main(void)\n{{\n    double x[1], u[1] = {{1.6}};\n"
        f"    int all = {name.upper()}_CONVERGED + {name.upper()}_NOT_REACHED"
        f" + {name.upper()}_LOCK_UP;\n    return all == 11 && {name}_defaults[0] > 0 && "
        f"{name}_start(&s) == {name.upper()}_CONVERGED && "
        f"{name}_transmission(&s, u, x, NULL) == {name.upper()}_CONVERGED ? 0 : 1;\n}}\n"
    )
    text = "\n".join((*lines, "#include <stddef.h>", body))
    (tmp_path / "user.c").write_text(text)
    (tmp_path / "user.cpp").write_text(text)
    objects = [f"{name}.o", f"{name}_transmission.o"]
    commands = [
        (quick_compiler, *STRICT, "-c", f"{name}.c", f"{name}_transmission.c"),
        (quick_compiler, *STRICT, "user.c", *objects, "-lm", "-o", "in_c"),
        ("g++", "-Wall", "-Wextra", "-Werror", "user.cpp", *objects, "-lm", "-o", "in_cpp"),
        ("./in_c",),
        ("./in_cpp",),
    ]
    for command in commands:
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, ""), command


def test_nothing_but_libm_is_used_and_nothing_from_the_heap(example):
    for text in example.files("c").values():
        for line in text.splitlines():
            assert not line.startswith("#include") or ALLOWED.fullmatch(line)
        assert not re.search(r"\b(malloc|calloc|realloc|alloca|free|printf|exit|abort)\b *\(", text)


def test_the_text_says_what_the_numpy_module_says(example):
    source = next(iter(example.files("c").values()))
    for section in re.findall(r"^ *# (\d[-\d]*  .*)$", example.source, re.MULTILINE):
        assert f"// {section}" in source


def test_the_statuses_are_those_of_the_runtime(example_named):
    header = list(example_named("four_bar").files("c").values())[1]
    found = dict(re.findall(r"FOUR_BAR_(\w+) = (\d),  +//", header))
    assert {name: int(value) for name, value in found.items()} == {
        status.name: int(status)
        for status in Status
        if status not in (Status.CORNER, Status.NOT_ASSEMBLED)  # C's plain start cannot tell
    }


@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
def test_tables_of_a_march_are_as_long_as_they_are_read():
    equations = [x + y - kc.t, x - y, 2 * x - 2 * y, 3 * x - 3 * y]  # more than coordinates
    source = kc.emit(kc.ConstraintSystem("repeated", "x y", equations), "c").source
    tables = dict(re.findall(r"static const \w+ ([A-Z_]+)\[\] = {(.*?)};", source, re.DOTALL))
    names = ("ANGULAR", "PROBE", "IS_REDUNDANT")
    counts = {name: tables[name].count(",") for name in names}
    assert counts == {"ANGULAR": 2, "PROBE": 4, "IS_REDUNDANT": 4}


# ---------------------------------------------------------------- cosine and sine


@pytest.fixture(scope="module")
def angles(quick_compiler):
    """A module with cos(theta) - x and sin(theta) - y."""
    theta = sympy.Symbol("theta")
    equations = [sympy.cos(theta) - x, sympy.sin(theta) - y, theta - kc.t]
    return kc.compile(kc.ConstraintSystem("angles", "x y theta", equations), target="c")


@pytest.mark.parametrize("reach", [1e-9, 1.0, 10.0, 1e3, 9.9e4, 1e7, 1e15])
def test_cosine_and_sine_are_right_to_an_ulp(angles, reach):
    rng = np.random.default_rng(int(reach) + 1)
    theta = rng.uniform(-reach, reach, 1500)
    quarters = np.round(theta / (np.pi / 2)) * (np.pi / 2)  # where one of them nearly vanishes
    theta = np.concatenate((theta, quarters, [0.0, reach, -reach]))
    q = np.zeros((theta.size, 3))
    q[:, 2] = theta
    found = angles.Phi(q, 0.0)
    with mpmath.workdps(50):
        for column, function in enumerate((mpmath.cos, mpmath.sin)):
            exact = [function(mpmath.mpf(angle)) for angle in theta.tolist()]
            rounded = np.array([float(value) for value in exact])
            error = [float(f - e) for f, e in zip(found[:, column].tolist(), exact, strict=True)]
            assert np.max(np.abs(error) / np.spacing(np.abs(rounded))) < 1.0


def test_a_far_angle_does_not_spoil_its_neighbours(angles):
    theta = np.tile([0.5, 1e9, -2.0], 30)
    q = np.zeros((90, 3))
    q[:, 2] = theta
    np.testing.assert_allclose(angles.Phi(q, 0.0)[:, 0], np.cos(theta), rtol=0, atol=2e-16)


@pytest.mark.slow
def test_that_a_point_is_the_same_in_any_company(monkeypatch, tmp_path, quick_compiler):
    # Optimized, points that fill no register are computed with what lies beyond them.
    monkeypatch.setenv("CC", quick_compiler)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    names = "x y theta"
    equations = [x**2 + y**2 - 1, y - sympy.sin(sympy.Symbol("theta")), sympy.Symbol("theta") - 9]
    module = kc.compile(kc.ConstraintSystem("company", names, equations), target="c")
    q = np.random.default_rng(8).uniform(-3, 3, (70, 3))
    q[[33, 66], 2] = 1e9  # libm's turn, for its strip alone
    rates, times = np.cos(q), np.linspace(0, 1, 70)
    everything = module.kinematics(q, rates, times)
    for n in (1, 2, 3, 4, 5, 31, 33, 34, 35, 67):
        for found, expected in zip(
            module.kinematics(q[:n], rates[:n], times[:n]), everything, strict=True
        ):
            near = 4e-16 * np.maximum(1, np.abs(expected[:n]))
            assert np.all(np.abs(found - expected[:n]) <= near)
        motion = kc.solve(module, np.linspace(8, 9, n), guess=[-0.9, 0.4, 9])
        np.testing.assert_allclose(motion.q[:, 2], 9, rtol=1e-15)
        np.testing.assert_allclose(motion.q[:, 1], np.sin(9), rtol=1e-14)
        assert motion.status.max() == Status.CONVERGED


# ---------------------------------------------------------------- the planned solve


def coupled(n: int) -> kc.ConstraintSystem:
    """Return equations that leave one block of size n: each is in all coordinates."""
    names = [f"u{k}" for k in range(n)]
    u = sympy.symbols(names)
    equations = [
        sum(sympy.sin((1 + i * k % 3) * u[k]) * (1 + (i == k) * 4) / 5 for k in range(n))
        - sympy.Rational(i + 1, 10) * kc.t
        for i in range(n)
    ]
    return kc.ConstraintSystem(f"coupled_{n}", " ".join(names), equations)


@pytest.mark.usefixtures("quick_compiler")
@pytest.mark.parametrize("n", [1, 2, 3, 4, 7])
@pytest.mark.slow
def test_blocks_of_every_size(n):
    native, module = kc.compile(coupled(n), target="c"), kc.compile(coupled(n))
    rng = np.random.default_rng(n)
    q, b = rng.uniform(-0.5, 0.5, (2, 50, n))
    nonzeros = module.Phi_q_nonzeros(q, 0.1)
    expected = np.linalg.solve(module.Phi_q(q, 0.1), b[..., np.newaxis])[..., 0]
    np.testing.assert_allclose(native.solve(nonzeros, b), expected, rtol=1e-9, atol=1e-9)
    times = np.linspace(0, 0.5, 40)
    found, there = kc.solve(native, times), kc.solve(module, times, method="march")
    assert found.statistics["compiled"] == 40
    np.testing.assert_allclose(found.q_ddot, there.q_ddot, rtol=1e-10, atol=1e-10)


@pytest.mark.usefixtures("quick_compiler")
def test_large_blocks_change_rows_where_a_pivot_vanishes():
    native = kc.compile(coupled(5), target="c")
    matrix = np.array(
        [[0, 2, 0, 0, 1], [1, 0, 3, 0, 0], [0, 0, 0, 4, 2], [0, 1, 1, 0, 0], [5, 0, 0, 1, 0]],
        dtype=float,
    )
    assert len(native.PATTERN) == 25
    expected = np.linalg.solve(matrix, np.arange(5.0))
    np.testing.assert_allclose(native.solve(matrix.ravel(), np.arange(5.0)), expected, rtol=1e-13)


@pytest.mark.usefixtures("quick_compiler")
def test_a_singular_block_is_not_finite():
    native = kc.compile(coupled(4), target="c")
    assert not np.isfinite(native.solve(np.ones(16), np.arange(4.0))).all()


@pytest.mark.usefixtures("quick_compiler")
def test_equations_that_always_depend_on_each_other_have_no_march():
    m = kc.ConstraintSystem("twice", "x y", [x + y - kc.t, 2 * x + 2 * y - 2 * kc.t])
    native = kc.compile(m, target="c")
    assert not hasattr(native, "compiled_march")
    compare(m, [0.3, 0.4], 0.1)
    assert not kc.solve(native, [0.0, 1.0]).success

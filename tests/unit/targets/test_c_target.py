"""The C target: text that strict compilers accept, and the numbers of every kind of expression."""

import re
import subprocess
from itertools import pairwise

import mpmath
import numpy as np
import pytest
import sympy
from sympy import Piecewise

import kincompile as kc
from kincompile.ir import from_sympy
from kincompile.runtime.status import Status
from kincompile.targets.naming import NameTable
from kincompile.targets.printers import C_ANGLE_FUNCTIONS, C_FUNCTIONS, CPrinter

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


@pytest.mark.parametrize("level", ["-O0", "-O2"])
def test_strict_compilers_have_nothing_to_say(example, quick_compiler, tmp_path, level):
    for name, text in example.files("c").items():
        (tmp_path / name).write_text(text)
    source = next(iter(example.files("c")))
    command = (quick_compiler, *STRICT, level, "-c", source, "-o", "out.o")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


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
        status.name: int(status) for status in Status
    }


# ---------------------------------------------------------------- expressions


SMOOTH = [
    sympy.tan(x), sympy.asin(x / 3), sympy.acos(x / 3), sympy.atan(x), sympy.atan2(y, x),
    sympy.sinh(x), sympy.cosh(x), sympy.tanh(x), sympy.asinh(x), sympy.acosh(2 + x**2),
    sympy.atanh(x / 3), sympy.exp(x), sympy.log(3 + x), sympy.sqrt(3 + x), (3 + x) ** y,
    (3 + x) ** sympy.Rational(3, 2), (3 + x) ** sympy.Rational(1, 3), x**7 - x**-2,
    sympy.cot(x), sympy.sec(x), sympy.csc(x), sympy.sin(x) * sympy.cos(2 * y), sympy.E**y,
    x / 3 + sympy.Rational(22, 7) * y, sympy.pi * x - 2 * sympy.pi / 3, -(x - y) / (-y),
]  # fmt: skip


@pytest.mark.usefixtures("quick_compiler")
def test_every_function_gives_the_numbers_of_numpy():
    names = [f"u{k}" for k in range(len(SMOOTH))]
    equations = [f - sympy.Symbol(name) for f, name in zip(SMOOTH, names, strict=True)]
    m = kc.ConstraintSystem("functions", ["x", "y", *names], [*equations, x - kc.t, y - kc.t])
    rest = np.random.default_rng(3).uniform(-1, 1, (3, len(SMOOTH)))
    compare(m, np.hstack(([[0.7, 1.2], [-1.3, 0.4], [2.1, -0.9]], rest)))


def test_no_function_of_the_compiler_is_forgotten():
    supported = C_FUNCTIONS | C_ANGLE_FUNCTIONS.keys()
    called = set(from_sympy.FUNCTIONS.values()) | {"sqrt", "pow"}
    assert called <= supported


def test_a_function_that_c_does_not_have_is_named():
    printer = CPrinter([("input", "x"), ("call", "erf", 0)], {0: "x"})
    with pytest.raises(kc.UnsupportedError, match="the C target has no function 'erf'"):
        printer.text(1)


@pytest.mark.usefixtures("quick_compiler")
def test_pieces_and_their_conditions():
    piece = Piecewise((x**2, (x < 1) & (y > 0)), (2 * x - 1, (x >= 2) | (y <= -1)), (x * y, True))
    m = kc.ConstraintSystem("pieces", "x y", [piece - y, x + y - kc.t])
    q = np.array([[0.5, 1], [0.5, -0.5], [2.5, 3], [1.5, -2], [1.5, 0.5], [1, 1], [2, -1]])
    compare(m, q)


@pytest.mark.usefixtures("quick_compiler")
def test_numbers_are_divided_as_fractions_not_as_integers():
    m = kc.ConstraintSystem("halves", "x", [x / 2 - sympy.Rational(1, 3) * kc.t])
    assert kc.compile(m, target="c").Phi(np.array([1.0]), 1.0)[0] == 0.5 - 1 / 3


@pytest.mark.usefixtures("quick_compiler")
def test_tables_on_all_their_pieces_and_beyond_a_turn(tabled_model):
    rng = np.random.default_rng(8)
    q = np.array([0.3, -0.2, 0.1, 0.0]) + rng.uniform(-1, 1, (200, 4))
    q[:, 3] = np.r_[np.linspace(-15, 15, 180), 2 * np.pi * np.arange(20) / 20]
    compare(tabled_model, q, tolerance=1e-11)


@pytest.mark.usefixtures("quick_compiler")
def test_names_that_mean_something_in_c():
    names = "double int lane at far exact F right to PI LANES N M K block square gamma y1 NULL unix"
    symbols = sympy.symbols(names)
    equations = [a + 2 * sympy.sin(b) - kc.t for a, b in pairwise(symbols)]
    m = kc.ConstraintSystem("struct", names, [*equations, symbols[-1] ** 2 - 2])
    compare(m, np.random.default_rng(2).uniform(1, 2, (40, len(symbols))), 0.3)
    assert NameTable(("double",)).take("double") == "double_"


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
    assert not hasattr(native, "march")
    compare(m, [0.3, 0.4], 0.1)
    assert not kc.solve(native, [0.0, 1.0]).success

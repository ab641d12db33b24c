"""The C form of large mechanisms: by block types, and the same motion as the NumPy module."""

import itertools
import re
import subprocess
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import criteria

STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O1")
LINKS = ("angle", "equation", "gear", "rocker")
TIMES = np.linspace(0.0, 0.3, 16)
CLOSE: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-12}


def add_loop(m, name, x, size):
    """Add a four-bar linkage, and return crank and rocker."""
    crank = m.body(f"crank{name}", (x + 0.5 * size, 0, 0))
    coupler = m.body(f"coupler{name}", (x + 2.13 * size, 0.643 * size, 0.517))
    rocker = m.body(f"rocker{name}", (x + 2.63 * size, 0.643 * size, 3.937))
    m.add(kc.Revolute(f"A{name}", m.ground, (x, 0), crank, (-0.5 * size, 0)))
    m.add(kc.Revolute(f"B{name}", crank, (0.5 * size, 0), coupler, (-1.3 * size, 0)))
    m.add(kc.Revolute(f"C{name}", coupler, (1.3 * size, 0), rocker, (-0.9 * size, 0)))
    m.add(kc.Revolute(f"D{name}", rocker, (0.9 * size, 0), m.ground, (x + 2 * size, 0)))
    return crank, rocker


def add_slider(m, name, x, size):
    """Add a slider-crank, and return its crank twice."""
    crank, rod = m.body(f"crank{name}", (x + 0.5 * size, 0, 0)), m.body(f"rod{name}", (x + 2, 0, 0))
    slider = m.body(f"slider{name}", (x + 4 * size, 0, 0))
    m.add(kc.Revolute(f"A{name}", m.ground, (x, 0), crank, (-0.5 * size, 0)))
    m.add(kc.Revolute(f"B{name}", crank, (0.5 * size, 0), rod, (-1.5 * size, 0)))
    m.add(kc.Revolute(f"C{name}", rod, (1.5 * size, 0), slider, (0, 0)))
    m.add(kc.Translational(f"D{name}", m.ground, (0, 0), (1, 0), slider, (0, 0), (1, 0)))
    return crank, crank


def loops(count, link, is_mixed=False, rate=1.5, name="loops"):
    """Return linkages with lengths of their own, each crank linked to the linkage before it."""
    m = kc.Mechanism(name)
    ratio, before = m.parameter("ratio", 1.1), None
    for k in range(count):
        add = add_slider if is_mixed and k % 3 == 2 else add_loop
        crank, last = add(m, str(k), 5.0 * k, 1 + 0.01 * k)
        if before is None:
            m.add(kc.AbsoluteAngle("motor", crank, rate * kc.t + 0.1 * sympy.sin(ratio * kc.t)))
        elif link == "angle":
            m.add(kc.RelativeAngle(f"G{k}", before[0], crank, 0.1 * ratio))
        elif link == "equation":
            m.add(kc.Equation(f"G{k}", crank.phi - ratio * before[0].phi))
        elif link == "gear":
            at, other_at = (-0.5 * (1 + 0.01 * (k - 1)), 0), (-0.5 * (1 + 0.01 * k), 0)
            m.add(kc.Gear(f"G{k}", before[0], at, 2, 0, crank, other_at, 3, sympy.pi))
        else:
            offset = -3.937 if before[1] is not before[0] else 0
            m.add(kc.RelativeAngle(f"G{k}", before[1], crank, offset))
        before = crank, last
    return m


def ring(count):
    """Return equations each of which needs its neighbours: one block."""
    names = [f"x{k}" for k in range(count)]
    x = sympy.symbols(names)
    equations = [
        x[k] + 0.1 * x[k - 1] * x[(k + 1) % count] - 1 - 0.01 * k * kc.t for k in range(count)
    ]
    return kc.ConstraintSystem("ring", names, equations)


def both(model):
    """Return the C module and the NumPy module of a large mechanism."""
    return kc.compile(model, target="c", form="grouped"), kc.compile(model, form="grouped")


def assert_same_motion(native, module, t=TIMES, **given):
    """Solve with both and compare; return the solution of the C module."""
    # At the standard tolerance the NumPy march may solve for the rates with a Phi_q that is one
    # correction old.
    ours, theirs = (kc.solve(item, t, tolerance=1e-13, **given) for item in (native, module))
    np.testing.assert_array_equal(ours.status, theirs.status)
    for name in ("q", "q_dot", "q_ddot"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), **CLOSE)
    return ours


# ---------------------------------------------------------------- the motion


@pytest.mark.parametrize("link", LINKS)
def test_the_compiled_march_gives_the_motion_of_the_numpy_module(link, quick_compiler):
    solution = assert_same_motion(*both(loops(8, link)))
    assert solution.success, solution.message
    assert solution.statistics["compiled"] == TIMES.size - 1


@pytest.mark.parametrize(
    ("count", "link"), [(40, "angle"), (40, "gear"), (12, "equation"), (9, "rocker")]
)
def test_a_tile_that_is_not_full_and_mixed_types_do_no_harm(count, link, quick_compiler):
    solution = assert_same_motion(*both(loops(count, link, is_mixed=True, rate=0.2)))
    assert solution.statistics["compiled"] == TIMES.size - 1


@pytest.mark.parametrize("chains", [3, 6])
def test_parallel_chains_run_side_by_side_where_that_is_worth_it(chains, quick_compiler):
    m = kc.Mechanism("parallel")
    cranks: dict[int, Any] = {}
    for chain, k in itertools.product(range(chains), range(4)):
        crank, _ = add_loop(m, f"{chain}_{k}", 5.0 * k, 1 + 0.03 * chain + 0.01 * k)
        if k == 0:
            m.add(kc.AbsoluteAngle(f"motor{chain}", crank, (1 + 0.1 * chain) * kc.t))
        else:
            m.add(kc.RelativeAngle(f"G{chain}_{k}", cranks[chain], crank, 0.05))
        cranks[chain] = crank
    solution = assert_same_motion(*both(m))
    assert solution.statistics["compiled"] == TIMES.size - 1


def test_the_inline_form_agrees_too(quick_compiler):
    model = loops(5, "gear")
    ours = kc.solve(kc.compile(model, target="c", form="grouped"), TIMES)
    theirs = kc.solve(kc.compile(model, form="inline"), TIMES, method="march")
    for name in ("q", "q_dot", "q_ddot"):
        np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=1e-9, atol=1e-9)


def test_velocity_and_acceleration_are_the_derivatives_of_the_position(quick_compiler):
    module, h = kc.compile(loops(6, "rocker"), target="c", form="grouped"), 2e-4
    solution = kc.solve(module, 0.1 + h * np.arange(-2, 3), tolerance=1e-13)
    q, q_dot = solution.q, solution.q_dot
    difference = (q[0] - 8 * q[1] + 8 * q[3] - q[4]) / (12 * h)
    np.testing.assert_allclose(solution.q_dot[2], difference, rtol=1e-8, atol=1e-8)
    difference = (q_dot[0] - 8 * q_dot[1] + 8 * q_dot[3] - q_dot[4]) / (12 * h)
    np.testing.assert_allclose(solution.q_ddot[2], difference, rtol=1e-8, atol=1e-8)


def test_time_may_run_backwards_and_parameters_may_change(quick_compiler):
    native, module = both(loops(6, "equation"))
    assert_same_motion(native, module, TIMES[::-1], p={"ratio": 0.9})


def test_the_method_can_be_forced(quick_compiler):
    module = kc.compile(loops(6, "angle"), target="c", form="grouped")
    solution = kc.solve(module, TIMES, method="march")
    assert solution.success
    assert "compiled" not in solution.statistics


# ---------------------------------------------------------------- what is left to NumPy


def test_steps_that_are_too_long_are_divided_by_the_careful_march(quick_compiler):
    native, module = both(loops(6, "angle"))
    solution = assert_same_motion(native, module, np.linspace(0, 4, 5))
    assert solution.success, solution.message
    assert solution.statistics["marched"] > 0


def test_a_lock_up_has_the_status_of_the_numpy_module(quick_compiler):
    m = loops(6, "angle")
    arm = m.body("arm", (0, -5, 1.23))
    m.add(kc.Revolute("pin", m.ground, (0, -5), arm, (0, 0)))
    # The arm is stretched at t = 2.
    m.add(kc.Distance("tie", m.ground, (1.5, -5), arm, (1, 0), 1.5 + 0.5 * kc.t))
    native, module = both(m)
    t = np.linspace(0, 3, 121)
    ours, theirs = kc.solve(native, t), kc.solve(module, t)
    np.testing.assert_array_equal(ours.status, theirs.status)
    assert not ours.success
    assert ours.statistics["compiled"] > 0
    np.testing.assert_array_equal(np.isnan(ours.q), np.isnan(theirs.q))


def test_a_singular_configuration_within_a_step_is_not_passed(quick_compiler):
    x = sympy.symbols("x0:8")
    equations = [item**2 - (k + 1) * kc.t**2 for k, item in enumerate(x)]
    guess = {str(item): 0.5 * (k + 1) ** 0.5 for k, item in enumerate(x)}
    native, module = both(kc.ConstraintSystem("crossing", [*map(str, x)], equations, guess=guess))
    t = [-0.5, -0.4, 0.4]
    ours, theirs = kc.solve(native, t), kc.solve(module, t)
    np.testing.assert_array_equal(ours.status, theirs.status)
    assert ours.status.tolist()[:2] == [0, 0]
    assert ours.status[2] != kc.Status.CONVERGED
    assert ours.statistics["compiled"] == 1


def test_equations_that_do_not_split_stay_with_numpy(quick_compiler, caplog):
    with caplog.at_level("INFO", logger="kincompile"):
        module = kc.compile(ring(45), target="c", form="grouped")
    assert "ring does not split into equal blocks" in caplog.text
    assert not hasattr(module, "march")
    assert kc.solve(module, [0.0, 0.1]).success
    with pytest.raises(kc.UnsupportedError, match=r"'ring' do not split .* use target='numpy'"):
        kc.emit(ring(45), target="c", form="grouped")


def test_profiles_at_contacts_stay_with_numpy(rich_model, quick_compiler):
    assert not hasattr(kc.compile(rich_model, target="c", form="grouped"), "march")


def test_without_a_compiler_it_is_said_what_to_install(monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(kc.UnsupportedError, match="no-such-compiler, which CC names, is not there"):
        kc.compile(loops(6, "angle", name="uncompiled"), target="c", form="grouped")


# ---------------------------------------------------------------- the text


@pytest.mark.parametrize("link", LINKS)
def test_strict_compilers_have_nothing_to_say(link, quick_compiler, tmp_path):
    kc.emit(loops(8, link, is_mixed=True), target="c", form="grouped").write(tmp_path)
    command = (quick_compiler, *STRICT, "-c", "loops.c", "-o", "out.o")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_nothing_but_libm_is_used_and_nothing_from_the_heap():
    emitted = kc.emit(loops(8, "gear"), target="c", form="grouped")
    for text in emitted.files.values():
        included = set(re.findall(r"#include (\S+)", text))
        assert included <= {'"loops.h"', "<math.h>", "<stddef.h>", "<stdint.h>", "<string.h>"}
        assert not re.search(r"\b(malloc|calloc|realloc|alloca|free|printf|exit|abort)\b *\(", text)


def test_the_text_does_not_grow_with_the_mechanism():
    small, large = (kc.emit(loops(n, "angle"), "c", "grouped").source for n in (20, 200))
    assert len(large) < 1.01 * len(small)


def test_the_files_do_not_disturb_those_of_the_numpy_module(tmp_path):
    model = loops(8, "angle")
    names = {path.name for path in kc.emit(model, "c", "grouped").write(tmp_path)}
    assert names == {"loops.c", "loops.h", "loops_c.npz"}
    assert names.isdisjoint(path.name for path in kc.emit(model, form="grouped").write(tmp_path))


def test_size_chooses_the_form(quick_compiler):
    assert kc.compile(loops(40, "angle"), target="c").FORM == "grouped"
    assert "FORM" not in vars(kc.compile(loops(2, "angle"), target="c"))


def test_the_march_judges_by_the_numbers_of_the_runtime():
    source = kc.emit(loops(8, "angle"), target="c", form="grouped").source
    wanted = {
        "ALLOWED_PART": criteria.ALLOWED_PART,
        "SMALL_ERROR": criteria.SMALL_ERROR,
        "LARGE_ERROR": criteria.LARGE_ERROR,
        "KINK": criteria.KINK,
        "SMOOTH": criteria.SMOOTH,
        "SMALLEST_DETERMINANT": criteria.SMALLEST_DETERMINANT,
        "RESIDUAL_FACTOR": criteria.RESIDUAL_FACTOR,
        "ROUNDING": criteria.ROUNDING,
    }
    for name, value in wanted.items():
        (text,) = re.findall(rf"\b{name} = ([^,;]+)[,;]", source)
        assert eval(text) == value, name


def test_angles_and_lengths_are_judged_by_scales_of_their_own():
    m = kc.Mechanism("kinds")
    for k in range(4):
        body = m.body(f"b{k}")
        for name, item in zip(("x", "y", "phi"), (body.x, body.y, body.phi), strict=True):
            m.add(kc.Equation(f"{name}{k}", item - (k + 2) * kc.t))
    source = kc.emit(m, target="c", form="grouped").source
    assert sorted(re.findall(r"_is_angle\[\] = \{ (\d) \}", source)) == ["0", "1"]

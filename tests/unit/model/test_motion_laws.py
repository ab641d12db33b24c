"""Motion laws: published figures, continuity, sequences, tables, and what is refused."""

import math
from itertools import pairwise

import numpy as np
import pytest
import sympy
from scipy.integrate import cumulative_simpson

import kincompile as kc
from kincompile.model.laws import RISES, constant_velocity, ramp, u

SHARE = sympy.Rational(3, 10)

PEAKS = {
    "polynomial 3-4-5": (1.875, 5.774),
    "polynomial 4-5-6-7": (2.1875, 7.513),
    "cycloidal": (2.000, 6.283),
    "simple harmonic": (1.571, 4.935),
    "modified sine": (1.760, 5.528),
    "modified trapezoid": (2.000, 4.888),
}
"""Largest velocity and acceleration for unit lift and duration, as handbooks print them."""


def written_out(title: str, order: int = 0) -> sympy.Expr:
    """Return a law, or a derivative of it, as a Piecewise in u."""
    value: sympy.Expr = RISES[title].written_out().xreplace({ramp: SHARE}).diff(u, order)
    return value


def values(title: str, order: int, at: np.ndarray) -> np.ndarray:
    """Return a derivative of a law at many places."""
    function = sympy.lambdify(u, written_out(title, order), "numpy")
    return np.broadcast_to(function(at), at.shape).astype(float)


def sines(title: str, at: np.ndarray) -> np.ndarray:
    """Return the shape of an acceleration as the handbooks draw it, up to a factor."""
    half = np.where(at > 0.5, 1 - at, at)
    if title == "modified sine":
        shape = np.where(
            half < 1 / 8, np.sin(4 * np.pi * half), np.cos(4 * np.pi / 3 * (half - 1 / 8))
        )
    elif title == "modified trapezoid":
        flank = np.where(half < 1 / 4, np.sin(4 * np.pi * half), np.cos(4 * np.pi * (half - 3 / 8)))
        shape = np.where((half > 1 / 8) & (half < 3 / 8), 1.0, flank)
    elif title == "constant velocity":
        share = float(SHARE)
        shape = np.interp(half, [0, share / 4, 3 * share / 4, share, 1], [0, 1, 1, 0, 0])
    else:
        shape = np.sin(2 * np.pi * half)
    return np.where(at > 0.5, -shape, shape)


@pytest.mark.parametrize("target", ["numpy", "c"])
@pytest.mark.parametrize("title", PEAKS)
@pytest.mark.slow
def test_the_published_peaks(title, target):
    """A motion of lift 0.4 rad in 2 s; each number is right to the digits that are printed."""
    m = kc.Mechanism("cam")
    m.add(kc.Revolute("pin", m.ground, (0, 0), m.body("arm", (1, 0, 0)), (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", "arm", kc.motion.sequence([(1, 0.1), (3, 0.5)], law=title)))
    # No grid point is a peak, but each is within 1e-8 of one.
    solution = kc.solve(kc.compile(m, target=target), np.linspace(0, 4, 40001))
    assert solution.success
    velocity = solution["phi_arm_dot"].max() * 2 / 0.4
    acceleration = solution["phi_arm_ddot"].max() * 4 / 0.4
    assert (velocity, acceleration) == pytest.approx(PEAKS[title], abs=5.01e-4)
    assert solution["phi_arm"][[0, 10000, 20000, 30000, -1]] == pytest.approx(
        [0.1, 0.1, 0.3, 0.5, 0.5], abs=1e-15
    )


@pytest.mark.parametrize(
    "title", ["modified sine", "modified trapezoid", "constant velocity", "cycloidal"]
)
@pytest.mark.slow
def test_that_a_law_is_the_integral_of_its_published_acceleration(title):
    at = np.linspace(0, 1, 80001)
    velocity = cumulative_simpson(sines(title, at), x=at, initial=0)
    position = cumulative_simpson(velocity, x=at, initial=0)
    assert values(title, 0, at) == pytest.approx(position / position[-1], abs=1e-8)
    assert values(title, 1, at) == pytest.approx(velocity / position[-1], abs=1e-7)


@pytest.mark.parametrize("title", RISES)
def test_that_a_law_is_as_smooth_as_it_says_and_no_smoother(title):
    law = RISES[title]
    pieces = [piece.xreplace({ramp: SHARE}) for piece in law.written_out().args]
    assert len(pieces) >= 3

    def jumps(order: int) -> list[float]:
        return [
            abs(float((after.diff(u, order) - before.diff(u, order)).subs(u, condition.rhs)))
            for (before, condition), (after, _) in pairwise(
                (pair.expr, pair.cond) for pair in pieces
            )
        ]

    for order in range(law.continuity + 1):
        assert max(jumps(order)) < 1e-13, order
    assert max(jumps(law.continuity + 1)) > 0.1


@pytest.mark.parametrize("title", RISES)
def test_that_a_law_rises_from_0_to_1_and_is_its_own_mirror_image(title):
    at = np.linspace(-0.5, 1.5, 2001)
    rise = values(title, 0, at)
    assert rise[at <= 0].tolist() == [0.0] * 501
    assert rise[at >= 1].tolist() == [1.0] * 501
    assert rise + rise[::-1] == pytest.approx(np.ones(at.size), abs=2e-14)
    assert (np.diff(rise) >= -1e-13).all()


def test_that_sympy_differentiates_and_evaluates_a_law():
    law = kc.motion.law("cycloidal")
    x, share = sympy.symbols("x share")
    value = 3 * law(x / share)
    slope = value.diff(x).subs({x: 0.3, share: 1.0})
    assert float(slope) == pytest.approx(3 * (1 - math.cos(0.6 * math.pi)), abs=1e-14)
    by_ramp = constant_velocity(x, share).diff(share).subs({x: 0.2, share: 0.3})
    step = 1e-6
    ends = (constant_velocity(0.2, 0.3 + side * step).evalf() for side in (1, -1))
    assert float(by_ramp.evalf()) == pytest.approx(
        float(next(ends) - next(ends)) / 2 / step, rel=1e-6
    )


def test_a_sequence_with_dwells_laws_of_its_steps_and_parameters():
    begin, h = sympy.symbols("T h")
    laws = ["modified sine", "linear", "constant velocity"]
    motion = kc.motion.sequence(
        [(0, h), (begin, 60 * kc.deg), (2, 60 * kc.deg), (3, 0)], laws, ramp=SHARE
    )
    numbers = {begin: 0.8, h: 0.2, kc.deg: math.pi / 180}

    def at(t: float) -> float:
        return float(motion.subs(numbers).subs(kc.t, t).evalf())

    assert [at(t) for t in (-1, 0, 0.4, 0.8, 1.7, 2, 2.5, 3, 9)] == pytest.approx(
        [0.2, 0.2, 0.1 + math.pi / 6, *[math.pi / 3] * 3, math.pi / 6, 0, 0], abs=1e-15
    )
    speed = motion.diff(kc.t).subs(numbers).subs(kc.t, 2.4).evalf()
    assert float(speed) == pytest.approx(-math.pi / 3 / 0.7, rel=1e-14)


def test_a_table_goes_through_its_rows_and_on_at_its_last_velocity():
    times, rows = [0, 0.3, 1, 2.5, 3], [0, 1, 0.5, -1, 2]
    motion = kc.motion.table(times, rows, velocities=(0.3, -1))
    m = kc.Mechanism("table")
    m.add(kc.AbsoluteX("x", m.body("cart"), (0, 0), motion))
    m.add(kc.AbsoluteY("y", "cart", (0, 0), 0))
    m.add(kc.AbsoluteAngle("phi", "cart", 0))
    grid = np.linspace(-1, 5, 60001)
    solution = kc.solve(kc.compile(m), grid)
    x, speed, acceleration = (solution[f"x_cart{end}"] for end in ("", "_dot", "_ddot"))
    nodes = np.searchsorted(grid, np.array(times) - 1e-9)
    assert x[nodes] == pytest.approx(rows, abs=1e-14)
    assert speed[nodes[[0, -1]]] == pytest.approx([0.3, -1], abs=1e-12)
    assert x[grid <= 0] == pytest.approx(0.3 * grid[grid <= 0], abs=1e-14)
    assert x[grid >= 3] == pytest.approx(2 - (grid[grid >= 3] - 3), abs=1e-14)
    # The derivatives are those of x, and the acceleration has no jump.
    assert np.diff(x) / 1e-4 == pytest.approx((speed[1:] + speed[:-1]) / 2, abs=1e-5)
    assert np.diff(speed) / 1e-4 == pytest.approx(
        (acceleration[1:] + acceleration[:-1]) / 2, abs=1e-3
    )
    assert abs(np.diff(acceleration)).max() < 0.1


def problems(call) -> str:
    with pytest.raises(kc.ModelError) as caught:
        call()
    return str(caught.value)


sequence, table = kc.motion.sequence, kc.motion.table
WRONG = {
    "falls": (lambda: sequence([(0, 0), (2, 1), (1, 0)]), "times must rise, but 1 follows 2"),
    "stands": (lambda: table([0, 1, 1], [0, 1, 2]), "times must rise, but 1 follows 1"),
    "law": (lambda: sequence([(0, 0), (1, 1)], "modified sin"), "did you mean 'modified sine'"),
    "laws": (lambda: sequence([(0, 0), (1, 1)], ["linear"] * 2), "2 laws for 1 steps"),
    "one": (lambda: sequence([(0, 0)]), "needs two points"),
    "text": (lambda: sequence([(0, "1"), (1, 1)]), "point 1: '1' is not a number"),
    "triple": (lambda: sequence([(0, 1, 2), (1, 1)]), "point 1, (0, 1, 2), is not a pair"),
    "ramp": (lambda: sequence([(0, 0), (1, 1)], ramp=0.7), "ramp is 0.7"),
    "two rows": (lambda: table([0, 1], [0, 1]), "a table of 2 rows is no curve"),
    "lengths": (lambda: table([0, 1, 2], [0, 1]), "3 times and 2 values"),
    "law as a number": (lambda: sequence([(0, 0), (1, 1)], [3]), "there is no law 3"),
    "no points": (lambda: sequence(None), "points: None is not a list"),
    "no times": (lambda: table(3, [0, 1, 2]), "times: 3 is not a list"),
    "symbol": (lambda: table([0, 1, 2], [0, 1, kc.t]), "values, entry 3: t is not a number"),
    "velocities": (lambda: table([0, 1, 2], [0, 1, 2], velocities=[0]), "velocities are two"),
    "unknown": (lambda: kc.motion.law("cycloid"), "no law 'cycloid'; did you mean 'cycloidal'"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_that_what_is_wrong_is_said(name):
    call, message = WRONG[name]
    assert message in problems(call)


def test_that_all_that_is_wrong_with_a_law_is_said_at_once():
    text = problems(lambda: kc.motion.sequence([(0, 0), (2, 1), (1, 0)], "sine", ramp=2))
    assert text.startswith("3 problems:")


def driven(angle, **options) -> kc.Mechanism:
    m = kc.Mechanism("arm")
    m.parameter("T", -1.0)
    m.add(kc.Revolute("pin", m.ground, (0, 0), m.body("arm"), (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", "arm", angle, **options))
    return m


def test_that_times_which_fall_at_the_default_parameters_are_refused():
    motion = kc.motion.sequence([(0, 0), (sympy.Symbol("T"), 1)])
    assert "the times of modified_sine(t/T) must rise" in problems(driven(motion).system)


def test_that_corners_need_a_permission_which_the_message_names():
    motion = kc.motion.sequence([(0, 0), (0.5, 1), (2, 1), (3.25, 0)], "linear")
    text = problems(driven(motion).system)
    assert "the law linear has corners at t = 0, 0.5, 2, 3.25" in text
    assert "corners=True" in text
    assert driven(motion, corners=True).system().constraints[-1].corners
    assert "has jumps at t = 0" in problems(driven(motion.diff(kc.t), corners=True).system)


def test_that_a_joint_that_drives_nothing_has_no_corners():
    m = driven(kc.t)
    m.add(kc.Revolute("other", m.ground, (0, 0), "arm", (0, 0), corners=True))
    assert "Revolute 'other': it drives nothing" in problems(m.system)


def test_that_two_tables_of_one_mechanism_are_two():
    m = driven(kc.motion.table([0, 1, 2], [0, 1, 0]) - kc.motion.table([0, 1, 2], [0, 0.5, 0]))
    solution = kc.solve(kc.compile(m), [0.0, 1.0])
    assert solution["phi_arm"] == pytest.approx([0, 0.5], abs=1e-15)
    assert kc.verify(m).passed


def test_that_a_law_that_is_taken_for_a_function_is_named_as_it_is_called():
    assert dir(kc.motion) == sorted(kc.motion.__all__)
    with pytest.raises(AttributeError, match=r"write kc\.motion\.law\('cycloidal'\)"):
        _ = kc.motion.cycloidal
    with pytest.raises(AttributeError, match="has no 'sequnce'; did you mean 'sequence'"):
        _ = kc.motion.sequnce

"""Pieces that do not meet are found, and what meets is let through."""

import pytest
import sympy

import kincompile as kc
from kincompile.model.expressions import smoothness_problem
from kincompile.model.piecewise import gap_problem

t, x, h, T = sympy.symbols("t x h T")
P = sympy.Piecewise


@pytest.mark.parametrize(
    "meeting",
    [
        P((0, t < 1), ((t - 1) ** 2, True)),
        P((0, t < 1), ((t - 1) ** 2, t < 2), (2 * t - 3, True)),
        P((t**2, 2 * t < 3), (3 * t - sympy.Rational(9, 4), True)),
        P((0, t <= 0.1), (100 * (t - 0.1) ** 2, True)) + 3,
        P((1, t < sympy.pi), (1 + sympy.sin(t) ** 2, True)),
        P((h * t**2, t < 1), (2 * h * t - h, True)),
        P((0, t < 1), (5, sympy.Eq(t, 1)), (0, True)),
        P((1, t < 1), (2, True)) + P((1, t < 1), (0, True)),
        P((P((0, t < 1), (5, True)), t < 0.5), (0, True)),
        P((0, t < 0), ((t - sympy.sin(t)), t < 2 * sympy.pi), (2 * sympy.pi, True)),
        P((x**2, x < 0), (0, True)),
    ],
    ids=str,
)
def test_that_pieces_that_meet_are_let_through(meeting: sympy.Expr) -> None:
    assert smoothness_problem(meeting) is None


@pytest.mark.parametrize(
    ("gap", "message"),
    [
        (P((0, t < 1), (1, True)), "do not meet at t = 1: 0 before, 1 after; let the pieces"),
        (P((0, t < 1), (t - 1, True)), "corner at t = 1: the slope is 0 before, 1 after"),
        (P((0, (t >= 0) & (t < 1)), (1, True)), "do not meet at t = 0: 1 before, 0 after"),
        (P((t**2, 2 * t < 3), (3 * t, True)), "t = 3/2: 2.25 before, 4.5 after"),
        (2 * P((1, t < sympy.pi), (1 + sympy.sin(t), True)), "corner at t = pi"),
        (P((0, t < 1), ((t - 1) ** 2, t < 2), (t, True)), "t = 2: 1 before, 2 after"),
        (sympy.sin(P((0, t > 0.25), (0.5, True))), "t = 0.25"),
        (P((x**2, x < 0), (x, True)), "corner at x = 0"),
        (P((0, t < 1), (P((0, t < 2), (1, True)), True)), "do not meet at t = 2"),
    ],
    ids=str,
)
def test_that_pieces_that_do_not_meet_are_found(gap: sympy.Expr, message: str) -> None:
    assert message in (smoothness_problem(gap) or "")


@pytest.mark.parametrize(
    "unseen",
    [
        P((t, t < T), (0, True)),  # where it is depends on a parameter
        P((h, t < 1), (0, True)),  # how far it jumps depends on a parameter
        P((t, t**2 < 1), (1, True)),  # not a comparison with a number
        P((t, (t < 1) & (x < 1)), (1, True)),
        P((sympy.sin(t) / t, sympy.Ne(t, 0)), (1, True)),  # 0/0 at the breakpoint
    ],
    ids=str,
)
def test_that_what_cannot_be_decided_is_let_through(unseen: sympy.Expr) -> None:
    assert gap_problem(unseen) is None


@pytest.mark.parametrize(
    "open_ended", [P((t, t < 1)), P((t, t < 1), (1, t > 1)), P((0, t < 0), (t, t < 1))], ids=str
)
def test_that_a_gap_between_conditions_is_found(open_ended: sympy.Expr) -> None:
    problem = smoothness_problem(open_ended)
    assert problem is not None
    assert "end it with a piece (expression, True)" in problem


def test_that_a_driver_that_jumps_is_a_problem_of_its_joint() -> None:
    m = kc.Mechanism("m")
    m.add(kc.AbsoluteAngle("motor", m.body("crank"), P((0, kc.t < 2), (1, True))))
    message = r"AbsoluteAngle 'motor', angle: the pieces do not meet at t = 2: 0 before, 1 after"
    with pytest.raises(kc.ModelError, match=message):
        m.system()


def test_that_a_smooth_rise_can_be_driven() -> None:
    m = kc.Mechanism("m")
    crank = m.body("crank")
    rise = P(
        (0, kc.t < 1), (kc.t - 1 - sympy.sin(2 * sympy.pi * (kc.t - 1)) / (2 * sympy.pi), True)
    )
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, rise))
    module = kc.compile(m)
    at = [module.Phi([0.0, 0.0, 0.0], time)[2] for time in (0.5, 1.0, 1.25, 2.0)]
    assert at == pytest.approx([0, 0, -(0.25 - 1 / (2 * 3.141592653589793)), -1])

"""`Solution.plot`: the curves are the closed form's, the labels have units, gaps are said."""

import dataclasses
import math
import sys

import numpy as np
import pytest
import sympy

import kincompile as kc

pytest.importorskip("matplotlib", reason="matplotlib is not installed")
from matplotlib import pyplot as plt

T = np.linspace(0.1, 1.0, 40)


@pytest.fixture(scope="module")
def arm():
    """A bar of 2 m about its end, turned by t^2: phi = t^2, x = cos(t^2)."""
    m = kc.Mechanism("arm")
    bar = m.body("bar", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, kc.t**2))
    return kc.solve(kc.compile(m), T)


@pytest.fixture(scope="module")
def stops():
    """x^2 = 1 - t: a lock-up at t = 1, and nothing after it."""
    x = sympy.Symbol("x")
    s = kc.ConstraintSystem("stops", [x], [x**2 - 1 + kc.t], guess=(1,))
    return kc.solve(kc.compile(s), np.linspace(0, 2, 41))


def legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def data(line):
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata())


@pytest.mark.parametrize(
    ("name", "values", "label"),
    [
        ("phi_bar", T**2, "phi_bar [rad]"),
        ("bar.phi", T**2, "phi_bar [rad]"),
        ("bar.phi_dot", 2 * T, "phi_bar_dot [rad/s]"),
        ("phi_bar_ddot", 2 + 0 * T, "phi_bar_ddot [rad/s^2]"),
        ("bar.x", np.cos(T**2), "x_bar [m]"),
        ("bar.y_dot", 2 * T * np.cos(T**2), "y_bar_dot [m/s]"),
    ],
)
def test_that_a_curve_is_the_closed_form(arm, name, values, label):
    ax = arm.plot(name)
    (line,) = ax.lines
    np.testing.assert_allclose(data(line), (T, values), rtol=1e-9)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("t [s]", label)
    assert ax.get_legend() is None
    assert ax.figure.get_suptitle() == "arm"


def test_that_there_is_a_panel_for_each_unit(arm):
    ax = arm.plot("bar.phi", "x_bar", "bar.phi_dot", "y_bar")
    panels = ax.figure.axes
    assert panels[0] is ax
    assert [panel.get_ylabel() for panel in panels] == ["phi_bar [rad]", "m", "phi_bar_dot [rad/s]"]
    assert legend(panels[1]) == ["x_bar", "y_bar"]
    assert panels[0].get_shared_x_axes().joined(panels[0], panels[2])
    assert [panel.get_xlabel() for panel in panels] == ["", "", "t [s]"]


def test_that_no_name_means_all_that_moves(arm):
    panels = arm.plot().figure.axes
    assert [[line.get_label() for line in panel.lines] for panel in panels] == [
        ["x_bar", "y_bar"],
        ["phi_bar"],
    ]


def test_that_axes_are_taken_and_given_back(arm):
    _, ax = plt.subplots()
    assert arm.plot("phi_bar", "x_bar", ax=ax) is ax
    assert len(ax.lines) == 2
    assert legend(ax) == ["phi_bar [rad]", "x_bar [m]"]
    assert ax.get_ylabel() == "rad, m"


def test_that_failed_points_are_a_shaded_gap_and_an_event_is_marked(stops):
    ax = stops.plot("x")
    curve, lock_up = ax.lines
    t, x = data(curve)
    good = t < 1
    np.testing.assert_allclose(x[good], np.sqrt(1 - t[good]), rtol=1e-9)
    assert np.isnan(x[~good]).all()
    np.testing.assert_allclose(lock_up.get_xdata(), 1, rtol=1e-8)
    assert legend(ax) == ["x", "no solution: 21 of 41 points", "lock-up at t = 1"]
    (span,) = ax.patches
    np.testing.assert_allclose(span.get_extents().transformed(ax.transData.inverted()).x0, 0.95)
    assert ax.get_xlim()[1] >= 2


def test_that_a_failed_point_is_a_gap_even_if_it_has_a_position(arm):
    status = np.zeros(T.size, dtype=int)
    status[10:13] = kc.Status.SINGULAR
    ax = dataclasses.replace(arm, status=status).plot("phi_bar")
    assert np.flatnonzero(np.isnan(data(ax.lines[0])[1])).tolist() == [10, 11, 12]
    assert legend(ax) == ["phi_bar", f"no solution: 3 of {T.size} points"]


@pytest.fixture(scope="module")
def arms():
    """A point at the end of a bar of length L, which turns by 2 pi t, and a bar that stands."""
    m = kc.Mechanism("arms")
    length = m.parameter("L", 1.0, unit="m")
    bar, post = m.body("bar"), m.body("post")
    tip = m.point("tip", bar, (length, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, 2 * kc.pi * kc.t))
    m.add(kc.Revolute("hold", m.ground, (1, 2), post, (0, 0)))
    m.add(kc.AbsoluteAngle("stand", post, 1))
    return m, tip


def swept(arms, count):
    module = kc.compile(arms[0])
    return kc.solve(module, np.linspace(0, 1, 49), {"L": np.linspace(1, 2, count)})


def test_that_variants_are_told_apart_by_their_parameters(arms):
    solution = swept(arms, 3)
    ax = solution.plot("tip.x")
    for line, length in zip(ax.lines, (1, 1.5, 2), strict=True):
        np.testing.assert_allclose(
            data(line)[1], length * np.cos(math.tau * solution.t), atol=1e-12
        )
    assert legend(ax) == ["x_tip, L = 1 m", "x_tip, L = 1.5 m", "x_tip, L = 2 m"]
    assert len({line.get_color() for line in ax.lines}) == 3


def test_that_many_variants_have_a_colour_bar(arms):
    ax = swept(arms, 12).plot("tip.x")
    bar = ax.figure.axes[-1]
    assert bar.get_ylabel() == "L [m]"
    assert bar.get_ylim() == (1, 2)
    assert len(ax.lines) == 12
    assert ax.get_legend() is None


def test_that_a_path_has_equal_scales_and_dots_at_equal_times(arms):
    solution = swept(arms, 1).variant(0)
    ax = solution.plot("tip.y", x="tip.x")
    (line,) = ax.lines
    angle = math.tau * solution.t
    np.testing.assert_allclose(data(line), (np.cos(angle), np.sin(angle)), atol=1e-12)
    assert ax.get_aspect() == 1
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x_tip [m]", "y_tip [m]")
    assert (line.get_marker(), line.get_markevery()) == (".", 2)


def test_that_a_column_is_drawn_over_another(arms):
    solution = swept(arms, 1).variant(0)
    ax = solution.plot("tip.y_dot", x="bar.phi")
    t, rate = data(ax.lines[0])
    np.testing.assert_allclose(rate, math.tau * np.cos(t), atol=1e-9)
    assert ax.get_xlabel() == "phi_bar [rad]"
    assert ax.get_aspect() == "auto"
    with pytest.raises(kc.InputError, match=r"no column 'bar\.fi'"):
        solution.plot("tip.y", x="bar.fi")


def test_that_outputs_are_shown_first_and_nothing_that_never_moves(arms):
    solution = swept(arms, 1).variant(0)
    labels = [line.get_label() for panel in solution.plot().figure.axes for line in panel.lines]
    assert labels == ["x_tip", "y_tip"]
    m = kc.Mechanism("without")
    bar, post = m.body("bar"), m.body("post")
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, kc.t))
    m.add(kc.Revolute("hold", m.ground, (1, 2), post, (0, 0)))
    m.add(kc.AbsoluteAngle("stand", post, 1))
    ax = kc.solve(kc.compile(m), T).plot()
    assert [line.get_label() for line in ax.lines] == ["phi_bar"]
    assert "bar" in kc.solve(kc.compile(m), 0.0).plot().lines[0].get_label()


def test_that_one_point_can_be_seen(arm):
    solution = kc.solve(arm.module, [0.5])
    (line,) = solution.plot("phi_bar").lines
    assert line.get_marker() == "o"


def test_that_many_columns_are_counted_not_named():
    u = sympy.symbols("u:40")
    s = kc.ConstraintSystem("many", u, [u[k] - (k + 1) * kc.t for k in range(40)])
    ax = kc.solve(kc.compile(s), T).plot()
    assert len(ax.lines) == 40
    assert len({(line.get_color(), line.get_linestyle()) for line in ax.lines}) == 40
    assert ax.get_legend() is None
    assert ax.get_ylabel() == "40 columns"


def test_that_a_wrong_name_is_refused_with_the_nearest(arm):
    with pytest.raises(kc.InputError, match=r"no column 'bar.phy'; did you mean 'phi_bar'\?"):
        arm.plot("bar.phy")
    assert plt.get_fignums() == []


def test_that_columns_are_indexed_by_the_same_names(arm):
    np.testing.assert_array_equal(arm["bar.phi_ddot"], arm["phi_bar_ddot"])


def test_that_missing_matplotlib_is_named(arm, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(kc.UnsupportedError, match=r"matplotlib is not .*'\.\[plot\]'"):
        arm.plot("phi_bar")

import dataclasses

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.runtime.results.forces import force_measures
from kincompile.runtime.results.write import summary
from kincompile.tables import counted, indented, pose, table

NAN = float("nan")


@pytest.fixture(scope="module")
def solution():
    """Return a function that gives a solution of one coordinate with made-up numbers."""
    x = sympy.Symbol("x")
    module = kc.compile(kc.ConstraintSystem("made_up", [x], [x - kc.t], guess=(0,)))

    def made_up(q, q_dot, q_ddot, status):
        motion = {"q": q, "q_dot": q_dot, "q_ddot": q_ddot}
        return dataclasses.replace(
            kc.solve(module, np.arange(len(q))),
            **{name: np.array([values], dtype=float).T for name, values in motion.items()},
            status=np.array(status),
            residual=np.array([1e-12] + [1e-3] * (len(q) - 1)),
            iterations=np.full(len(q), 2),
            success=not any(status),
            units={"x": "m"},
        )

    return made_up


def test_the_extremes_with_their_times_and_the_largest_absolute_rates(solution):
    text = summary(solution([1, -2, 3], [-4, 1, 2], [0, 5, -6], [0, 0, 0]))
    assert text.splitlines()[1].split() == ["x", "m", "-2", "1", "3", "2", "4", "6"]


def test_that_of_equal_extremes_the_first_counts_whatever_the_rounding(solution):
    text = summary(solution([1, 2, 1 - 1e-14, 2 + 1e-14], [1] * 4, [1] * 4, [0] * 4))
    assert text.splitlines()[1].split()[:6] == ["x", "m", "1", "0", "2", "1"]


def test_that_points_that_were_not_found_do_not_count(solution):
    text = summary(solution([1, 2, NAN], [3, NAN, NAN], [4, NAN, NAN], [0, 1, 4]))
    assert text.splitlines()[1].split() == ["x", "m", "1", "0", "2", "1", "3", "4"]
    assert "3 points from t = 0 to 2: 1 CONVERGED, 1 NOT_CONVERGED, 1 NOT_REACHED" in text
    assert text.endswith("6 Newton iterations, largest residual 1.0e-12")


def test_that_a_motion_of_which_nothing_was_found_has_dashes(solution):
    text = summary(solution([NAN, NAN], [NAN, NAN], [NAN, NAN], [1, 4]))
    assert text.splitlines()[1].split() == ["x", "m", "-", "-", "-", "-", "-", "-"]
    assert text.endswith("largest residual -")


def test_that_what_never_moves_is_one_line(solution):
    text = summary(solution([3, 3, 3], [0, 0, 0], [0, 0, 0], [0, 0, 0]))
    assert text.splitlines()[0] == "at rest: x = 3 m"
    assert "max" not in text
    assert "at rest" not in summary(solution([3, 3], [0, 1e-6], [0, 0], [0, 0]))


@pytest.mark.parametrize(("small", "shown"), [(1e-15, "0"), (1e-9, "1e-09")])
def test_that_rounding_errors_are_shown_as_zero_and_small_numbers_as_they_are(
    solution, small, shown
):
    text = summary(solution([small, 1.0], [1.0, 1.0], [1.0, 1.0], [0, 0]))
    assert text.splitlines()[1].split()[2] == shown


def test_that_a_table_is_aligned_and_has_no_blanks_at_the_end():
    lines = table(("name", "value"), [["a", "1"], ["bcdef", "22"]], right=("value",))
    assert lines == ["name   value", "a          1", "bcdef     22"]
    assert table(("name", "note"), [["a", ""]]) == ["name  note", "a"]


def test_that_a_table_without_rows_is_its_titles():
    assert table(("name", "value"), []) == ["name  value"]


def test_that_empty_lines_stay_empty_where_lines_are_indented():
    assert indented(["a", ""]) == ["  a", ""]


def test_that_a_noun_follows_its_number():
    assert (counted(1, "row"), counted(0, "row"), counted(2, "row")) == (
        "1 row",
        "0 rows",
        "2 rows",
    )


def test_that_rounding_errors_beside_large_numbers_are_zero(kincompile, tmp_path):
    """In a position of a message, in the mean of a force, and in that of a sweep."""
    assert pose([3.0, 1e-20, -3.58e-63]) == "at (3, 0), angle 0 rad"
    t = np.linspace(0, 2 * np.pi, 33)
    force = 3e8 * np.sin(t) + 4e-8
    assert force_measures("press", t, {"drive": (force, "N*m")}).rows()[0][4] == "0"
    path = tmp_path / "crank.py"
    path.write_text(CRANK, encoding="utf-8")
    swept = "--sweep", "r=1:2:2", "--target", "numpy", "--processes", 1
    rows = kincompile("sweep", path, *swept).stdout.splitlines()
    assert [row.split()[-1] for row in rows if row.startswith("y_tip")] == ["0"]


CRANK = """
import kincompile as kc
m = kc.Mechanism("crank", end=1.0, points=4)
r = m.parameter("r", 1.0, unit="m")
crank = m.body("crank")
m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
m.add(kc.AbsoluteAngle("motor", crank, 2 * kc.pi * kc.t))
m.point("tip", crank, (r, 0))
"""

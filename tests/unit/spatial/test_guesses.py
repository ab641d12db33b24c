"""Guesses of orientations in all their forms, and what is refused."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from kincompile.errors import KincompileWarning
from tests.unit.spatial.test_motions import X, Y, Z

TURN = Rotation.from_rotvec(0.7 * np.array([2, -1, 2]) / 3)
COLUMNS = TURN.as_matrix().T
P = (np.cos(0.35), *(np.sin(0.35) * np.array([2, -1, 2]) / 3))

FORMS: dict[str, dict[str, Any]] = {
    "parameters": {"orientation": P},
    "matrix": {"orientation": TURN.as_matrix()},
    "rows": {"orientation": TURN.as_matrix().tolist()},
    "scipy": {"orientation": TURN},
    "axis_and_angle": {"axis": (4, -2, 4), "angle": 0.7},
    "degrees": {"axis": (2, -1, 2), "angle": 0.7 * 180 / np.pi * kc.deg},
    "x_and_y": {"x": COLUMNS[0], "y": COLUMNS[1]},
    "z_and_x": {"x": COLUMNS[0], "z": COLUMNS[2]},
    "skew": {"y": COLUMNS[1], "z": 3 * COLUMNS[2]},
}


def guess_of(*given: Any, **named: Any) -> Any:
    m = spatial.Mechanism("one")
    body = m.body("rod", (1, 2, 3), *given, **named)
    m.add(spatial.Fixed("all", m.ground, (0, 0, 0), X, Y, body, (0, 0, 0), X, Y))
    return np.array([item.guess for item in m.system().coordinates])


@pytest.mark.parametrize("form", FORMS)
def test_forms(form: str) -> None:
    np.testing.assert_allclose(guess_of(**FORMS[form]), (1, 2, 3, *P), rtol=0, atol=1e-15)


def test_that_of_two_skew_axes_the_first_is_kept() -> None:
    found = guess_of(y=(0, 2, 0), z=(0, 1, 5))
    np.testing.assert_allclose(found[3:], (1, 0, 0, 0), atol=1e-15)


def test_that_an_angle_may_be_a_parameter() -> None:
    m = spatial.Mechanism("one")
    a = m.parameter("a", 90 * kc.deg, "rad")
    body = m.body("rod", (a, 0, 0), axis=Z, angle=a)
    m.add(spatial.Fixed("all", m.ground, (0, 0, 0), X, Y, body, (0, 0, 0), X, Y))
    found = [item.guess for item in m.system().coordinates]
    np.testing.assert_allclose(
        found, (np.pi / 2, 0, 0, np.sqrt(0.5), 0, 0, np.sqrt(0.5)), atol=1e-15
    )


def test_that_another_length_is_divided_out_and_said() -> None:
    with pytest.warns(KincompileWarning, match="body 'rod': the Euler parameters have length 2,"):
        found = guess_of((2 * np.array(P)).tolist())
    np.testing.assert_allclose(found[3:], P, atol=1e-15)
    np.testing.assert_allclose(guess_of((0.7071, 0, 0.7071, 0))[3:], (0.5**0.5, 0, 0.5**0.5, 0))


LEFT = TURN.as_matrix() @ np.diag([1, 1, -1])
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "zero": ({"orientation": (0, 0, 0, 0)}, "length zero, which is no orientation"),
    "left": ({"orientation": LEFT}, "left-handed, its determinant is -1; turn one axis round"),
    "skew": ({"orientation": [[1, 0.2, 0], [0, 1, 0], [0, 0, 1]]}, "no rotation: .* by 0.2;"),
    "shape": ({"orientation": (1, 0, 0)}, r"the shape \(3,\); give four Euler parameters"),
    "words": ({"orientation": "upright"}, "'upright', which is not made of finite numbers"),
    "infinite": ({"orientation": (1, 0, 0, np.inf)}, "not made of finite numbers"),
    "no_axis": ({"axis": (0, 0, 0), "angle": 1}, r"axis is \(0, 0, 0\); give three numbers"),
    "half": ({"axis": (0, 0, 1)}, "give both axis and angle"),
    "angle": ({"axis": (0, 0, 1), "angle": np.nan}, "angle nan is not a finite number"),
    "one": ({"x": (0, 0, 1)}, "1 of the body's axes is given; give two"),
    "parallel": ({"x": (0, 0, 1), "y": (0, 0, -2)}, "axes x and y are parallel"),
    "twice": ({"axis": (0, 0, 1), "angle": 1, "orientation": P}, "it is given twice"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_orientation(case: str) -> None:
    given, message = WRONG[case]
    with pytest.raises(kc.ModelError, match=f"body 'rod': .*{message}"):
        guess_of(**given)


def test_what_is_no_position() -> None:
    m = spatial.Mechanism("one")
    m.body("rod", (1, 2))
    m.body("arm", 5)  # type: ignore[arg-type]
    with pytest.raises(kc.ModelError, match=r"body 'rod': the guess .* is not") as caught:
        m.system()
    assert "body 'arm': the guess" in str(caught.value)

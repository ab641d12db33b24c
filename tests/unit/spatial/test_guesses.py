"""Guesses of orientations in all their forms, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from kincompile.errors import KincompileWarning
from tests.adversary.test_starts import in_javascript, in_octave
from tests.targets.conftest import NODE, OCTAVE
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


@pytest.mark.parametrize("size", [1e200, 1e-200, 1e308])
def test_that_any_length_is_divided_out(size: float) -> None:
    with pytest.warns(KincompileWarning, match="and were divided by it"):
        found = guess_of(orientation=(size, size, 0, 0))
    np.testing.assert_allclose(found[3:], (np.sqrt(0.5), np.sqrt(0.5), 0, 0), atol=1e-15)
    found = guess_of(axis=(0, size, size), angle=np.pi)
    np.testing.assert_allclose(found[3:], (0, 0, np.sqrt(0.5), np.sqrt(0.5)), atol=1e-15)


def test_that_every_rotation_matrix_is_read() -> None:
    """Against SciPy's; half turns, and turns close to them, among them."""
    rng = np.random.default_rng(4)
    axes = [*np.eye(3), *rng.normal(size=(20, 3))]
    for axis in axes:
        for angle in (0, 1e-9, 1, np.pi - 1e-9, np.pi, 4, *rng.uniform(0, 7, 3)):
            turn = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
            found = guess_of(orientation=turn.as_matrix())[3:]
            expected = turn.as_quat()[[3, 0, 1, 2]]
            assert found[0] >= 0
            assert abs(found @ expected) == pytest.approx(1, abs=1e-15)
            np.testing.assert_allclose(found * np.sign(found @ expected), expected, atol=4e-16)


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


def crank() -> spatial.Mechanism:
    m = spatial.Mechanism("crank")
    body = m.body("rod")
    m.add(spatial.Revolute("O", m.ground, (0, 0, 0), Z, body, (0, 0, 0), Z))
    m.add(spatial.RelativeRotation("motor", m.ground, Z, X, body, Z, X, 0.3 + kc.t))
    return m


@pytest.mark.parametrize("guess", [[0] * 7, {"rod.e0": 0}])
def test_that_zeros_are_no_orientation_to_start_from(guess: Any) -> None:
    with pytest.raises(kc.InputError, match=r"the guess of 'rod' has Euler parameters of length"):
        kc.solve(kc.compile(crank()), 0.0, guess=guess)


LONG = [1e-200, 1e-6, 5.0, 1e16, 1e155, 1e300]


@pytest.mark.parametrize("options", [{}, pytest.param({"target": "c"}, marks=pytest.mark.slow)])
def test_that_an_orientation_to_start_from_may_have_any_length(options: Any) -> None:
    module = kc.compile(crank(), **options)
    near = kc.solve(module, 0.0, guess=[0, 0, 0, 0.8, 0, 0, 0.6])
    for size in LONG:
        guess = [0, 0, 0, 0.8 * size, 0, 0, 0.6 * size]
        np.testing.assert_allclose(kc.solve(module, 0.0, guess=guess).q, near.q, atol=1e-14)
    for name, value in {"e0": 1e300, "x": 1e155, "z": -1e300}.items():
        assert kc.solve(module, 0.0, guess={f"rod.{name}": value}).success


@pytest.mark.slow
@pytest.mark.skipif(OCTAVE is None or NODE is None, reason="needs octave-cli and node")
def test_that_it_may_in_octave_and_javascript(tmp_path: Path) -> None:
    guesses = np.array([[0, 0, 0, 0.8 * size, 0, 0, 0.6 * size] for size in [1.0, *LONG, 1.0]])
    guesses[-1, 0] = 1e300
    near = kc.solve(kc.compile(crank()), 0.0, guess=guesses[0]).q[0]
    for is_found, q in in_octave(tmp_path, crank(), guesses):
        assert is_found
        np.testing.assert_allclose(q, near, atol=1e-14)
    for status, q, *_ in in_javascript(tmp_path, crank(), 0.0, guesses):
        assert status.tolist() == [kc.Status.CONVERGED]
        np.testing.assert_allclose(q[0], near, atol=1e-14)


@pytest.mark.filterwarnings("ignore::kincompile.AssemblyWarning")
@pytest.mark.parametrize("p", [(np.sqrt(0.5), 0, np.sqrt(0.5), 0), (0.5, -0.5, 0.5, 0.5)])
def test_that_a_cross_may_lie_along_the_axis_at_a_guess(p: Any) -> None:
    """No angle is defined there."""
    found = kc.solve(kc.compile(crank()), 0.0, guess=[0, 0, 0, *p])
    assert found.success
    turn = spatial.orientation(found, "rod").apply(X)
    np.testing.assert_allclose(turn[..., :2], [[np.cos(0.3), np.sin(0.3)]], atol=1e-12)


def test_that_a_guess_that_is_no_number_is_said_as_such_and_nothing_else() -> None:
    m = spatial.Mechanism("door")
    door = m.body("door")
    m.add(spatial.Revolute("H", m.ground, (0, 0, 0), Z, door, (0, 0, 0), Z))
    m.add(spatial.RelativeRotation("motor", m.ground, Z, X, door, Z, X, kc.t))
    with pytest.raises(kc.InputError) as caught:
        kc.solve(kc.compile(m), 0.0, guess={"door.e0": np.nan})
    assert caught.value.problems == ("coordinate 'e0_door' is nan: give a finite number.",)

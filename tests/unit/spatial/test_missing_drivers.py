"""What is said of mechanisms in space that lack drivers, where hinges are redundant."""

import warnings
from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
import sympy
from numpy.typing import NDArray

import kincompile as kc
from kincompile import spatial
from kincompile.model.bodies import Body

X, Y, Z = np.eye(3)
TIMES = np.linspace(0, 1, 11)


def four_bar() -> spatial.Mechanism:
    """Return a four-bar of four parallel hinges: 23 equations, 21 coordinates, one freedom."""
    m = spatial.Mechanism("four_bar")
    crank = m.body("crank", (0, 0, 0), axis=Z, angle=np.pi / 2)
    rod, rocker = m.body("rod", (0, 1, 0)), m.body("rocker", (4, 0, 0))
    m.add(spatial.Revolute("A", m.ground, (0, 0, 0), Z, crank, (0, 0, 0), Z))
    m.add(spatial.Revolute("B", crank, (1, 0, 0), Z, rod, (0, 0, 0), Z))
    m.add(spatial.Revolute("C", rod, (4, 0, 0), Z, rocker, (0, 2, 0), Z))
    m.add(spatial.Revolute("D", m.ground, (4, 0, 0), Z, rocker, (0, 0, 0), Z))
    return m


def bricard() -> spatial.Mechanism:
    """Return Bricard's orthogonal six hinges on the edges of a cube: 35 equations, rank 34."""
    m = spatial.Mechanism("bricard")
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 0, 1)])
    edges = np.roll(corners, -1, axis=0) - corners
    links = [m.ground, *(m.body(f"link_{k}", tuple(corners[k])) for k in range(1, 6))]
    for k in range(1, 7):
        place, axis = corners[k % 6], np.cross(edges[k - 1], edges[k % 6])
        i, j = links[k - 1], links[k % 6]
        points = place - corners[k - 1], place - corners[k % 6]
        m.add(spatial.Revolute(f"H{k}", i, points[0], axis, j, points[1], axis))
    return m


def motor(m: spatial.Mechanism, joint: str, angle: sympy.Expr) -> spatial.RelativeRotation:
    """Return a motor of a hinge, counted from where the bodies stand at their guesses."""
    hinge = next(item for item in m.constraints if item.name == joint)
    assert isinstance(hinge, spatial.Revolute)
    assert isinstance(hinge.i, Body)
    assert isinstance(hinge.j, Body)
    frames = [rotation(body) for body in (hinge.i, hinge.j)]
    axis = frames[0] @ np.array(hinge.axis_i, dtype=float)
    cross = X if abs(axis @ X) < 0.5 * np.linalg.norm(axis) else Y
    cross_i, cross_j = (frame.T @ cross for frame in frames)
    return spatial.RelativeRotation(
        "motor", hinge.i, hinge.axis_i, cross_i, hinge.j, hinge.axis_j, cross_j, angle
    )


def rotation(body: Body) -> NDArray[np.float64]:
    """Return A of a body at its guess, by the textbook's (2 e0^2 - 1) I + 2 (e e^T + e0 e~)."""
    e0, *e = (float(x) for x in body.guess[3:])
    skew = np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
    return np.asarray((2 * e0**2 - 1) * np.eye(3) + 2 * (np.outer(e, e) + e0 * skew))


@pytest.mark.parametrize("make", [four_bar, bricard])
def test_that_a_missing_motor_is_said_at_a_hinge_and_is_right(
    make: Callable[[], spatial.Mechanism],
) -> None:
    m = make()
    found = kc.inspect(m)
    (driver,) = found.missing_drivers
    assert driver.kind == "RelativeRotation"
    assert found.degrees_of_freedom == 1
    text = found.to_text()
    first = text[text.index("What to do") :].splitlines()[1]
    assert first.strip().startswith(f"a driver is missing: add, for instance, {driver.text}")
    assert "too many. Candidates" not in text
    m.add(motor(m, driver.joint, 0.5 * kc.t))
    with pytest.warns(kc.RedundantConstraintWarning):
        solution = kc.solve(kc.compile(m), TIMES)
    assert solution.success
    assert not solution.events
    assert kc.inspect(m).missing_drivers == ()


@pytest.mark.parametrize("target", ["numpy", pytest.param("c", marks=pytest.mark.slow)])
def test_that_a_free_loop_is_no_bifurcation(target: str) -> None:
    solution = kc.solve(kc.compile(bricard(), target=target), TIMES)
    assert not solution.success
    assert not solution.events
    assert "a driver is missing: add, for instance, RelativeRotation of" in solution.message
    assert "Bifurcation" not in solution.message


def test_that_a_real_bifurcation_at_the_start_is_still_one() -> None:
    m = kc.Mechanism("parallelogram")
    crank, coupler, rocker = m.body("crank"), m.body("coupler", guess=(1, 0, 0)), m.body("rocker")
    m.add(kc.Revolute("A", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("B", crank, (1, 0), coupler, (0, 0)))
    m.add(kc.Revolute("C", coupler, (2, 0), rocker, (1, 0)))
    m.add(kc.Revolute("D", m.ground, (2, 0), rocker, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, kc.t))
    solution = kc.solve(kc.compile(m), TIMES, guess={"rocker.x": 2})
    assert [event.kind for event in solution.events] == ["bifurcation"]
    assert "driver is missing" not in solution.message


def test_that_compiling_names_the_motor_before_the_surplus() -> None:
    module = kc.compile(four_bar())
    message = r"a driver is missing: add, for instance, RelativeRotation of crank at A, as a func"
    with pytest.raises(kc.StructuralError, match=message) as caught:
        kc.solve(module, TIMES)
    text = str(caught.value)
    assert text.index("a driver is missing") < text.index("redundant")
    assert "only 20 of them are independent" in text
    assert "too many" not in text


def test_that_a_slide_is_driven_along_its_axis() -> None:
    m = spatial.Mechanism("press")
    ram = m.body("ram", (0, 0, 1))
    m.add(spatial.Translational("guide", m.ground, (0, 0, 0), Z, X, ram, (0, 0, 0), Z, Y))
    (driver,) = kc.inspect(m).missing_drivers
    assert driver.text == "RelativeTranslation of ram at guide"


def test_that_a_piston_wants_both_of_its_freedoms_driven() -> None:
    m = spatial.Mechanism("piston")
    piston = m.body("piston", (0, 0, 1))
    m.add(spatial.Cylindrical("bore", m.ground, (0, 0, 0), Z, piston, (0, 0, 0), Z))
    kinds = [driver.kind for driver in kc.inspect(m).missing_drivers]
    assert sorted(kinds) == ["RelativeRotation", "RelativeTranslation"]


def test_that_the_spin_between_two_balls_wants_a_universal() -> None:
    m = spatial.Mechanism("rssr")
    crank, rod, rocker = m.body("crank"), m.body("rod", (1, 0, 0)), m.body("rocker", (3, 0, 0))
    m.add(spatial.Revolute("A", m.ground, (0, 0, 0), Z, crank, (0, 0, 0), Z))
    m.add(spatial.Spherical("B", crank, (1, 0, 0), rod, (0, 0, 0)))
    m.add(spatial.Spherical("C", rod, (3, 0, 0), rocker, (0, 2, 1)))
    m.add(spatial.Revolute("D", m.ground, (4, 0, 0), Y, rocker, (0, 0, 0), Y))
    m.point("beside", rod, (0, 1, 0))  # without it nothing sees the spin, and it is held
    texts = [driver.text for driver in kc.inspect(m).missing_drivers]
    assert texts[0] in ("RelativeRotation of crank at A", "RelativeRotation of rocker at D")
    assert (
        texts[1]
        == "RelativeRotation of rod about the x axis (or a Universal in place of the Spherical B)"
    )


def test_that_a_universal_wants_two_drivers_about_its_axes() -> None:
    m = spatial.Mechanism("cross")
    body = m.body("shaft")
    m.add(spatial.Universal("U", m.ground, (0, 0, 0), X, body, (0, 0, 0), Y))
    said = "RelativeRotation of shaft about the x axis, RelativeRotation of shaft about the y axis"
    assert f"2 drivers are missing: add, for instance, {said}, as" in kc.inspect(m).to_text()


def platform(without: tuple[int, ...], turned: float) -> spatial.Mechanism:
    """Return a Stewart platform without some of its six legs, turned about an axis aslant."""
    m = spatial.Mechanism("platform")
    axis = (1, 2, 3) if turned < np.pi else Y
    top = m.body("top", (0.02, 0.01, 0.7), axis=axis, angle=turned)
    turn, stand = rotation(top), np.array((0.02, 0.01, 0.7))
    for k in set(range(6)) - set(without):
        side = 1 - 2 * (k % 2)
        below = 2 * np.pi / 3 * (k // 2) + side * 0.2
        above = np.pi / 3 * (2 * (k // 2) + side) - side * 0.2
        foot = 0.6 * np.array([np.cos(below), np.sin(below), 0])
        ball = 0.35 * np.array([np.cos(above), np.sin(above), 0])
        length = float(np.linalg.norm(stand + ball - foot))
        m.add(spatial.Distance(f"leg_{k}", m.ground, foot, top, turn.T @ ball, length))
    return m


def with_advice(m: spatial.Mechanism) -> spatial.Mechanism:
    """Return a mechanism of one body with the drivers that are missing, from where it stands."""
    (top,) = m.bodies
    turn, drivers = rotation(top), kc.inspect(m).missing_drivers
    axes = {"x": (X, Y), "y": (Y, Z), "z": (Z, X)}
    for item in dict.fromkeys(drivers):
        small = 0.1 * sympy.sin(kc.t)
        if item.kind == "RelativeRotation":
            h, f = axes[item.axis]
            m.add(
                spatial.RelativeRotation(
                    item.axis, m.ground, h, f, top, turn.T @ h, turn.T @ f, small
                )
            )
        elif item.kind == "AbsoluteOrientation":
            whole = float(np.linalg.norm([float(x) for x in top.guess[4:]]))
            vector = [float(x) / whole for x in top.guess[4:]] if whole else X
            m.add(spatial.AbsoluteOrientation("turn", top, vector, whole - small / 5))
        else:
            place = dict(zip(("AbsoluteX", "AbsoluteY", "AbsoluteZ"), top.guess, strict=False))
            driver = getattr(spatial, item.kind)
            m.add(driver(item.kind, top, (0, 0, 0), place[item.kind] + small / 5))
    return m


LEGS = [legs for k in (1, 2, 3, 4) for legs in combinations(range(6), k)]


@pytest.mark.parametrize(
    "legs",
    [(0, 1), *(pytest.param(x, marks=pytest.mark.slow) for x in LEGS if x != (0, 1))],
    ids=str,
)
@pytest.mark.parametrize(
    "turned", [0.0, *(pytest.param(x, marks=pytest.mark.slow) for x in (1.0, np.pi))]
)
def test_that_drivers_in_the_place_of_legs_work_as_advised(
    legs: tuple[int, ...], turned: float
) -> None:
    m = with_advice(platform(legs, turned))
    assert kc.inspect(m).missing_drivers == ()
    solution = kc.solve(kc.compile(m), TIMES)
    assert solution.success, solution.message


def test_that_a_free_body_wants_its_place_and_its_orientation() -> None:
    m = spatial.Mechanism("free")
    body = m.body("box")
    m.add(spatial.AbsoluteX("x", body, (0, 0, 0), 0))
    kinds = [driver.kind for driver in kc.inspect(m).missing_drivers]
    assert kinds == ["AbsoluteY", "AbsoluteZ", *["AbsoluteOrientation"] * 3]


def test_that_a_driver_by_a_parameter_alone_is_one() -> None:
    m = four_bar()
    m.add(motor(m, "A", m.parameter("theta", 0.1)))
    found = kc.inspect(m)
    assert [item.name for item in found.constraints if item.is_driver] == ["motor"]
    assert found.mobility.driver_equations == 1
    assert found.missing_drivers == ()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", kc.RedundantConstraintWarning)
        solution = kc.solve(kc.compile(m), 0.0, {"theta": 0.7})
    crank = m.bodies[0]
    e0, e3 = (solution[f"crank.{name}"][0] for name in ("e0", "e3"))
    assert solution.success
    turned = 2 * np.arctan2(e3, e0) - 2 * np.arctan2(float(crank.guess[6]), float(crank.guess[3]))
    assert turned == pytest.approx(0.7)


def test_that_a_parameter_is_a_dimension_where_no_motor_sets_it() -> None:
    m = kc.Mechanism("offset")
    e, s = m.parameter("e", 0.1, unit="m"), m.parameter("s", 1.0, unit="m")
    crank, slider = m.body("crank"), m.body("slider", guess=(2, 0.1, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.AbsoluteY("rail", slider, (0, 0), e))
    m.add(kc.AbsoluteAngle("level", slider, 0))
    m.add(kc.Distance("rod", crank, (1, 0), slider, (0, 0), s + 0.5))
    m.add(kc.TranslationalDistance("stroke", m.ground, (0, 0), (1, 0), slider, (0, 0), 1 + s))
    found = kc.inspect(m)
    assert [item.name for item in found.constraints if item.is_driver] == ["stroke"]

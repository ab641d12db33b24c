"""Mechanisms in space that move although the count of equations forbids it."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial

X, Y, Z = np.eye(3)
TARGETS = ["numpy", pytest.param("c", marks=pytest.mark.slow)]  # gcc takes seconds
quiet = pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")


def link(theta: float, length: float, twist: float) -> tuple[Any, Any]:
    """Return place and turn of the next frame: about z by theta, along x, about x by the twist."""
    turn = Rotation.from_rotvec(theta * Z)
    return turn.apply(length * X), turn * Rotation.from_rotvec(twist * X)


def bennett(theta_2: float = 2.94580363520431) -> spatial.Mechanism:
    """Return the linkage of four hinges whose axes are neither parallel nor meet."""
    m = spatial.Mechanism("bennett")
    alpha, beta = np.arcsin(0.6), np.arcsin(0.96)
    shapes = [(0.25, alpha), (0.4, beta), (0.25, alpha), (0.4, beta)]
    angles = [0.5, theta_2, -0.5]
    place, turn = np.zeros(3), Rotation.identity()
    bodies: list[Any] = [m.ground]
    for number, (theta, (length, twist)) in enumerate(zip(angles, shapes, strict=False), 1):
        # the body's frame is that of its first hinge, turned by theta
        own = turn * Rotation.from_rotvec(theta * Z)
        bodies.append(m.body(f"link_{number}", place, own))
        step, change = link(theta, length, twist)
        place, turn = place + turn.apply(step), turn * change
    for k in range(3):
        (length, twist), i = shapes[k - 1], bodies[k]
        axis = Rotation.from_rotvec(twist * X).apply(Z)
        point = length * X
        at, along = (np.zeros(3), Z) if k == 0 else (point, axis)
        m.add(spatial.Revolute(f"hinge_{k + 1}", i, at, along, bodies[k + 1], (0, 0, 0), Z))
    # the last hinge is on the ground, at the end of the third link
    (length, twist), last = shapes[2], bodies[3]
    m.add(
        spatial.Revolute(
            "hinge_4",
            last,
            length * X,
            Rotation.from_rotvec(twist * X).apply(Z),
            m.ground,
            place,
            turn.apply(Z),
        )
    )
    m.add(spatial.RelativeRotation("motor", m.ground, Z, X, bodies[1], Z, X, 0.5 + 1.2 * kc.t))
    return m


# t: origin of the third frame, where link 3 begins
BENNETT = {
    0.0: (-0.154776380292185, -0.0136178377451016, 0.046689729411777),
    0.3: (-0.165087746585764, -0.0239497950420103, 0.0821135830011781),
    0.8: (-0.202961934406592, -0.0430836216611964, 0.147715274266959),
    1.5: (-0.362413279545312, -0.0692043314693824, 0.237271993609311),
    2.5: (-0.559224202750142, 0.0539664341556194, -0.185027774247838),
    4.0: (-0.170342266158864, 0.0276581688203901, -0.0948280073841945),
}


@quiet
@pytest.mark.parametrize("target", TARGETS)
def test_bennett(target: str) -> None:
    m = bennett()
    found = kc.inspect(m)
    assert (len(found.equations), found.rank) == (24, 21)
    module = kc.compile(m, target=target)
    t = np.union1d(list(BENNETT), np.linspace(0, 4, 101))
    solution = kc.solve(module, t)
    assert solution.success, solution.message
    rows = np.searchsorted(t, list(BENNETT))
    place = np.column_stack([solution[f"{axis}_link_3"] for axis in "xyz"])[rows]
    np.testing.assert_allclose(place, list(BENNETT.values()), rtol=0, atol=1e-12)


@quiet
def test_that_the_rows_that_are_solved_are_independent_along_the_motion() -> None:
    """Without z, f and g of the last hinge they are, but for a position on the way."""
    m = bennett()
    m.end = 4.0
    module = kc.compile(m)
    rows = [k for k, name in enumerate(module.EQUATIONS) if name not in module.REDUNDANT]
    solution = kc.solve(module, np.linspace(0, 4, 401))
    Phi_q = module.Phi_q(solution.q, solution.t)
    kept, whole = (np.linalg.svd(x, compute_uv=False)[:, -1] for x in (Phi_q[:, rows], Phi_q))
    assert (kept > 0.03 * whole).all()


def test_that_a_bennett_of_wrong_dimensions_is_a_structure() -> None:
    """With a hinge moved along its axis the loop still closes, in single positions."""
    m = bennett()
    hinge: Any = m.constraints[3]
    x, y, z = hinge.point_j
    place = (x, y, z + 1e-4)
    m.constraints[3] = spatial.Revolute(
        "hinge_4", hinge.i, hinge.point_i, hinge.axis_i, hinge.j, place, hinge.axis_j
    )
    with pytest.raises(kc.StructuralError, match="motor contradicts"):
        kc.solve(kc.compile(m), np.linspace(0, 1, 11))


def four_bar(offset: float = 0.0) -> spatial.Mechanism:
    """Return a planar four-bar drawn with four hinges: three equations repeat others."""
    m = spatial.Mechanism("four_bar")
    joint = np.array([np.cos(1.0), np.sin(1.0), 0])
    way = np.array([3.0, 0, 0]) - joint
    reach = np.linalg.norm(way)
    opening = np.arccos((2.5**2 + reach**2 - 4) / (2 * 2.5 * reach))
    coupler_angle = np.arctan2(way[1], way[0]) + opening
    end = joint + 2.5 * np.array([np.cos(coupler_angle), np.sin(coupler_angle), 0])
    follower_angle = np.arctan2(end[1], end[0] - 3)
    crank = m.body("crank", (0, 0, 0), Rotation.from_rotvec(1.0 * Z))
    coupler = m.body("coupler", joint, Rotation.from_rotvec(coupler_angle * Z))
    follower = m.body("follower", 3 * X, Rotation.from_rotvec(follower_angle * Z))
    o = (0, 0, 0)
    m.add(spatial.Revolute("O", m.ground, o, Z, crank, o, Z))
    m.add(spatial.Revolute("A", crank, (1, 0, 0), Z, coupler, o, Z))
    m.add(spatial.Revolute("B", coupler, (2.5, 0, 0), Z, follower, (2, 0, 0), Z))
    m.add(spatial.Revolute("C", m.ground, (3, 0, offset), Z, follower, o, Z))
    m.add(spatial.RelativeRotation("motor", m.ground, Z, X, crank, Z, X, 1 + kc.t))
    return m


def test_that_a_repeating_joint_is_named_with_the_joint_that_avoids_it() -> None:
    text = kc.inspect(four_bar()).to_text()
    assert "redundant: C.z, C.f, C.g repeat what O, A, B demand" in text
    assert "replace the Revolute C by a PointOnLine" in text


def test_that_a_conflict_is_told_with_its_size() -> None:
    module = kc.compile(four_bar(0.001))
    with pytest.raises(kc.StructuralError, match=r"conflicting: C\.z contradicts .*, by 0\.001 "):
        kc.solve(module, 0.0)


@quiet
@pytest.mark.parametrize("target", TARGETS)
def test_that_the_four_bar_moves_as_in_the_plane(target: str) -> None:
    t = np.linspace(0, 2 * np.pi, 201)
    solution = kc.solve(kc.compile(four_bar(), target=target), t)
    assert solution.success
    end = np.column_stack([solution["x_follower"], solution["y_follower"]])
    np.testing.assert_allclose(end, np.tile((3.0, 0.0), (t.size, 1)), atol=1e-14)
    angle = 2 * np.arctan2(solution["e3_follower"], solution["e0_follower"])
    joint = np.column_stack([np.cos(1 + t), np.sin(1 + t)])
    end = np.column_stack([3 + 2 * np.cos(angle), 2 * np.sin(angle)])
    np.testing.assert_allclose(np.linalg.norm(end - joint, axis=1), 2.5, atol=1e-13)


def double_joint(crossed: bool) -> spatial.Mechanism:
    """Return three shafts with two universal joints, the last parallel to the first."""
    m = spatial.Mechanism("double_universal_joint")
    beta = np.radians(35)
    along = np.array([np.cos(beta), np.sin(beta), 0])
    side = np.array([-np.sin(beta), np.cos(beta), 0])
    end = 0.5 * along
    first = m.body("first", (0, 0, 0))
    middle = m.body("middle", (0, 0, 0), np.column_stack([along, side, Z]))
    last = m.body("last", end)
    # the yoke of the first shaft carries the arm along y, that of the middle one the arm along z
    m.add(spatial.Revolute("bearing", m.ground, (0, 0, 0), X, first, (0, 0, 0), X))
    m.add(spatial.Universal("joint_1", first, (0, 0, 0), Y, middle, (0, 0, 0), Z))
    own, other = (Y, Z) if crossed else (Z, Y)
    m.add(spatial.Universal("joint_2", middle, (0.5, 0, 0), own, last, (0, 0, 0), other))
    m.add(spatial.Cylindrical("end", m.ground, end, X, last, (0, 0, 0), X))
    m.add(spatial.RelativeRotation("motor", m.ground, X, Y, first, X, Y, 3 * kc.t))
    return m


# t: angle of the middle shaft, and of the last with the yokes at 90 degrees
SHAFTS = {
    0.0: (0.0, 0.0),
    0.2: (0.695825256024247, 0.795084438985684),
    0.35: (1.13153230075074, 1.20337057722877),
    0.7: (2.01756772067577, 1.94476745421389),
    1.0: (2.9693007445548, 2.93226871376554),
    2.0: (5.94183847378593, 5.87398246309727),
}


@quiet
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("crossed", [False, True])
def test_double_universal_joint(target: str, crossed: bool) -> None:
    t = np.union1d(list(SHAFTS), np.linspace(0, 2, 101))
    solution = kc.solve(kc.compile(double_joint(crossed), target=target), t)
    assert solution.success, solution.message
    angle = np.unwrap(2 * np.arctan2(solution["e1_last"], solution["e0_last"]))
    expected = [both[1] for both in SHAFTS.values()] if crossed else 3 * np.array(list(SHAFTS))
    np.testing.assert_allclose(angle[np.searchsorted(t, list(SHAFTS))], expected, atol=1e-12)

"""Points, outputs and hinge angles in space, against SciPy's rotations and differences."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from kincompile.spatial import outputs
from tests.unit.spatial.test_motions import X, Y, Z, slider_crank

H = 1e-4
TIMES = [0.1, 0.3, 0.8, 1.7]
LOCAL, FIXED = (0.15, 0.02, 0.03), (0.1, 0.2, 0.3)


def watched() -> spatial.Mechanism:
    m = slider_crank()
    crank, rod, _ = m.bodies
    foot = m.point("P", rod, LOCAL)
    along = rod.direction((1, 0, 0))
    m.output("way", outputs.distance(foot, FIXED), "m")
    m.output("speed", outputs.speed(foot), "m/s")
    m.output("acceleration", outputs.acceleration(foot), "m/s^2")
    m.output("free", outputs.angle(along, outputs.way(FIXED, foot)), "rad")
    m.output("seen", outputs.angle(along, X, about=(0.1, 0.2, 2)), "rad")
    m.output("above", outputs.inclination(along, 3 * Z), "rad")
    m.output("alpha_x", outputs.rate(rod.omega[0]), "rad/s^2")
    m.add(spatial.JointAngle("turn", m.ground, X, Z, crank, X, Z))
    return m


@pytest.fixture(scope="module", params=["numpy", "c"])
def motion(request: Any) -> tuple[kc.Solution, Any]:
    module = kc.compile(watched(), target=request.param)
    found = kc.solve(module, np.sort([t + k * H for t in TIMES for k in (-1, 0, 1)]))
    assert found.success
    return found, module


def differences(values: Any) -> tuple[Any, Any, Any]:
    """Return values, rates and second rates at `TIMES`, by central differences."""
    before, here, after = values.reshape(len(TIMES), 3).T
    return here, (after - before) / (2 * H), (after - 2 * here + before) / H**2


NAMES = ["P.x", "P.y", "P.z", "way", "free", "seen", "above", "A.x", "A.y", "A.z"]


@pytest.mark.parametrize("name", NAMES)
def test_rates_against_differences(motion: Any, name: str) -> None:
    _, rates, seconds = differences(motion[0][name])
    for found, expected, tolerance in (("_dot", rates, 1e-6), ("_ddot", seconds, 1e-5)):
        own = motion[0][name + found].reshape(-1, 3)[:, 1]
        np.testing.assert_allclose(own, expected, rtol=0, atol=tolerance * (1 + abs(own).max()))


def test_places_against_scipy(motion: Any) -> None:
    found = motion[0]
    turned = spatial.orientation(found, "rod")
    place = found.q[:, 7:10] + turned.apply(LOCAL)
    point = np.column_stack([found[f"P.{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(point, place, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found["way"], np.linalg.norm(place - FIXED, axis=1), atol=1e-14)
    velocity = np.column_stack([found[f"P.{axis}_dot"] for axis in "xyz"])
    np.testing.assert_allclose(found["speed"], np.linalg.norm(velocity, axis=1), atol=1e-14)
    second = np.column_stack([found[f"P.{axis}_ddot"] for axis in "xyz"])
    np.testing.assert_allclose(found["acceleration"], np.linalg.norm(second, axis=1), rtol=1e-13)
    along = turned.apply(X)
    cosine = np.sum(along * (place - FIXED), axis=1) / found["way"]
    np.testing.assert_allclose(np.cos(found["free"]), cosine, atol=1e-14)
    np.testing.assert_allclose(np.sin(found["above"]), along[:, 2], atol=1e-14)
    # turned about the axis by the angle, what is seen of one direction is what is seen of the other
    w = np.array([0.1, 0.2, 2]) / np.linalg.norm([0.1, 0.2, 2])
    here = [v - w * (v @ w) for v in along]
    back = Rotation.from_rotvec(np.outer(found["seen"], w)).apply(here)
    seen = X - w * (X @ w)
    np.testing.assert_allclose(
        back / np.linalg.norm(back, axis=1)[:, None],
        np.tile(seen / np.linalg.norm(seen), (len(back), 1)),
        atol=1e-13,
    )


def test_angular_velocity(motion: Any) -> None:
    """The figures are those of spatial_cases.md, section 1, at 0.1, 0.3 and 0.8 s."""
    found, _ = motion
    at = slice(1, 9, 3)
    omega = np.column_stack([found[f"rod.omega_{axis}"] for axis in "xyz"])
    expected = [
        (1.56429426217022, -1.55885349847972, 0.459448507650822),
        (-1.97413555999444, -1.50656235228866, 0.326871030412256),
        (1.88472644527091, 0.684042110378828, -0.967856480737653),
    ]
    np.testing.assert_allclose(omega[at], expected, rtol=0, atol=2e-13)
    alpha = np.column_stack([found[f"rod.omega_{axis}_dot"] for axis in "xyz"])
    expected = [
        (-5.50732025855635, -4.21164050347458, -1.4090178958972),
        (-41.4089148493257, 7.2031983786624, 1.55132240477283),
        (2.44985440405645, -2.13162150223464, 6.88627650334304),
    ]
    np.testing.assert_allclose(alpha[at], expected, rtol=0, atol=2e-12)
    np.testing.assert_allclose(found["alpha_x"], alpha[:, 0], rtol=0, atol=1e-12)
    fixed = np.column_stack([found[f"rod.omega_{axis}"] for axis in ("xi", "eta", "zeta")])
    turned = spatial.orientation(found, "rod").apply(fixed)
    np.testing.assert_allclose(turned, omega, rtol=0, atol=1e-13)
    assert found.column("rod.omega_x").unit == "rad/s"


def test_that_a_hinge_angle_counts_turns_and_euler_parameters_stay_continuous(motion: Any) -> None:
    t = np.linspace(0, 3, 301)
    found = kc.solve(motion[1], t)
    np.testing.assert_allclose(found["turn.theta"], 6 * t, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found["turn.theta_dot"], 6, rtol=0, atol=1e-12)
    # the crank's p has turned by 9 rad: half the angle, and no jump to -p
    np.testing.assert_allclose(found["crank.e0"], np.cos(3 * t), rtol=0, atol=1e-13)
    np.testing.assert_allclose(found["crank.e1"], np.sin(3 * t), rtol=0, atol=1e-13)


def test_that_orientation_says_what_it_wants(motion: Any) -> None:
    with pytest.raises(kc.InputError, match="no body 'ram' in space; such bodies are: crank, rod"):
        spatial.orientation(motion[0], "ram")


def test_columns_of_a_point_have_units_and_places_need_three_numbers() -> None:
    m = watched()
    assert {name: item.unit for item in m.system().outputs for name in [item.name]}["z_P"] == "m"
    m.point("flat", "rod", (1, 2))
    m.point("lost", "nobody", (1, 2, 3))
    with pytest.raises(kc.ModelError, match="not a triple") as caught:
        m.system()
    assert "no body 'nobody'" in str(caught.value)


def test_pattern_and_slopes_of_outputs() -> None:
    """outputs_q against differences."""
    module = kc.compile(watched())
    q, count = module.GUESS.copy(), module.N_COORDINATES
    q += 0.01 * np.cos(np.arange(count))
    q_dot = np.sin(np.arange(count))
    slopes = module.outputs_q(q, q_dot, 0 * q, 0.0)
    step = 1e-6 * np.eye(count)
    after, before = (module.outputs(q + side * step, q_dot, 0 * q, 0.0).T for side in (1, -1))
    found = (after - before) / 2e-6
    names = [name for name in module.OUTPUTS if name not in ("acceleration", "alpha_x")]
    rows = [module.OUTPUTS.index(name) for name in names]
    np.testing.assert_allclose(slopes[rows], found[rows], rtol=0, atol=1e-8)


def test_axis_of_the_golden_state_does_not_matter() -> None:
    """A mechanism turned as a whole has the same distances, angles and hinge angles."""
    turn = Rotation.from_rotvec([0.4, -0.7, 0.2])
    m = spatial.Mechanism("turned")
    u, v = turn.apply(X), turn.apply(Y)
    arm = m.body("arm", (0, 0, 0), turn)
    m.add(spatial.Revolute("O", m.ground, (0, 0, 0), u, arm, (0, 0, 0), X))
    m.add(spatial.RelativeRotation("motor", m.ground, u, v, arm, X, Y, 2 * kc.t))
    m.add(spatial.JointAngle("angle", m.ground, u, v, arm, X, Y))
    m.output("seen", outputs.angle(v, arm.direction(Y), about=u), "rad")
    found = kc.solve(kc.compile(m), [0, 0.5, 1, 4])
    np.testing.assert_allclose(found["angle.theta"], [0, 1, 2, 8], atol=1e-14)
    np.testing.assert_allclose(found["seen"], [0, 1, 2, 8 - 2 * np.pi], atol=1e-14)

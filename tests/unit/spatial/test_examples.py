"""Examples in space against closed forms, and the same examples turned as a whole.

Figures are those of spatial cases worked out with 40 digits; where there is none, a reduced
formulation is solved here.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from tests.unit.spatial.test_motions import SLIDER
from tests.unit.spatial.turning import turned_copy

FOLDER = Path(__file__).parents[3] / "examples" / "space"
NAMES = sorted(path.stem for path in FOLDER.glob("*.py"))
REDUNDANT = {"bennett"}


@cache
def model(name: str) -> Any:
    return kc.read_model(FOLDER / f"{name}.py")


@cache
def compiled(name: str) -> Any:
    if name in REDUNDANT:
        with pytest.warns(kc.RedundantConstraintWarning):
            return kc.compile(model(name))
    return kc.compile(model(name))


def solved(name: str, t: Any, parameters: Any = None) -> Any:
    found = kc.solve(compiled(name), t, parameters)
    assert found.success, found.message
    return found


def columns(found: Any, *names: str) -> Any:
    """Return columns with their first and second derivatives, shape (N, 3 names)."""
    ends = ("", "_dot", "_ddot")
    return np.column_stack([found[f"{name}{end}"] for name in names for end in ends])


def test_that_every_example_is_here() -> None:
    assert {path.stem for path in FOLDER.glob("*.toml")} == set(NAMES)
    assert {name.removeprefix("test_") for name in globals()} >= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_that_the_data_file_is_the_same_mechanism(name: str) -> None:
    assert kc.read(FOLDER / f"{name}.toml").to_toml() == model(name).to_toml()


def test_spatial_slider_crank() -> None:
    found = columns(solved("spatial_slider_crank", list(SLIDER)), "x_slider")
    np.testing.assert_allclose(found, list(SLIDER.values()), rtol=0, atol=2e-13)


def test_rssr() -> None:
    """The rocker's angle from A cos psi + B sin psi = C, its rates by complex steps."""
    t = np.linspace(0, 2, 41)
    found = solved("rssr", t)

    def swing(t: Any) -> Any:
        pin = 0.1 * np.array([np.cos(np.pi * t), np.sin(np.pi * t), 0 * t])
        x, y, z = pin - np.array([[0.3], [0.05], [-0.12]])
        # end - place = 0.25 (sin psi, 0, cos psi)
        rest = (x * x + y * y + z * z + 0.25**2 - 0.32**2) / 0.5
        # x sin psi + z cos psi = rest; u = tan(psi/2)
        return 2 * np.arctan((x + np.sqrt(x * x + z * z - rest * rest)) / (rest + z))

    psi = swing(t)
    step = 1e-20j
    np.testing.assert_allclose(found["theta_swing"], psi, rtol=0, atol=1e-13)
    rate = np.imag(swing(t + step)) / 1e-20
    np.testing.assert_allclose(found["theta_swing_dot"], rate, rtol=0, atol=1e-12)


CARDAN = {
    0.0: (0.0, 3.66232376628437, 0.0, 0.0, 4.47087178969711, 0.0),
    0.2: (0.695825256024247, 3.16723710330615, -3.75502957073689,
          0.795084438985684, 3.21814516060165, -7.90820677893332),
    0.35: (1.13153230075074, 2.67536551639926, -2.48142113844837,
           1.20337057722877, 2.33017739949887, -3.83996041156592),
    0.7: (2.01756772067577, 2.6823717367208, 2.51861138154748,
          1.94476745421389, 2.34104151439274, 3.91341595522233),
    1.0: (2.9693007445548, 3.6269103705696, 1.47618987111132,
          2.93226871376554, 4.36474151051905, 4.36114152647473),
    2.0: (5.94183847378593, 3.52730397445784, 2.68122097276378,
          5.87398246309727, 4.08177828097847, 7.32420010946383),
}  # fmt: skip


def test_double_universal_joint() -> None:
    t = np.array(list(CARDAN))
    even = columns(solved("double_universal_joint", t), "theta_middle", "theta_last")
    figures = np.array(list(CARDAN.values()))
    np.testing.assert_allclose(even[:, :3], figures[:, :3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(even[:, 3:], np.stack([3 * t, 0 * t + 3, 0 * t], 1), atol=1e-12)
    uneven = solved("double_universal_joint", t, {"phase": np.pi / 2})
    found = columns(uneven, "theta_middle", "theta_last")
    np.testing.assert_allclose(found, figures, rtol=0, atol=1e-12)


def pose(t: float) -> Any:
    """Return place and rotation vector of the platform on its six legs, and of nothing else."""
    k = np.arange(6)
    side, pair = 1 - 2 * (k % 2), 2 * (k // 2)
    below = np.pi / 3 * pair + side * np.pi / 15
    above = np.pi / 3 * (pair + side) - side * np.pi / 15
    feet = 0.6 * np.column_stack([np.cos(below), np.sin(below), 0 * below])
    balls = 0.35 * np.column_stack([np.cos(above), np.sin(above), 0 * above])
    rest = np.linalg.norm(balls + np.array([0, 0, 0.7]) - feet, axis=1)
    wanted = rest + 0.04 * (np.sin(np.pi * t + k) - np.sin(k))

    def missing(given: Any) -> Any:
        ends = given[:3] + Rotation.from_rotvec(given[3:]).apply(balls)
        return np.linalg.norm(ends - feet, axis=1) - wanted

    return fsolve(missing, [0, 0, 0.7, 0, 0, 0], xtol=1e-12)


def test_stewart_gough() -> None:
    t = np.linspace(0, 2, 21)
    found = solved("stewart_gough", t)
    poses = np.array([pose(time) for time in t])
    place = np.column_stack([found[f"{axis}_platform"] for axis in "xyz"])
    np.testing.assert_allclose(place, poses[:, :3], rtol=0, atol=1e-12)
    turn = spatial.orientation(found, "platform").as_rotvec()
    np.testing.assert_allclose(turn, poses[:, 3:], rtol=0, atol=1e-12)


DELTA = {
    0.0: (0.633315904885318, -0.571967825888228, -0.140611213199815,
          0.506013061764799, 0.117291701211429, 1.21593440613891,
          0.753212986778527, 0.108094682298556, -1.01112645993628),
    0.25: (0.491780665734474, -0.534552624430647, 0.469486316806809,
           0.569587960245139, 0.370616011875476, 0.72043035931818,
           0.748853599978883, -0.136067243823187, -0.851668783389207),
    0.5: (0.378986444104148, -0.346847076625317, 0.964348797288483,
          0.67572669997115, 0.438651460224094, -0.228461284056654,
          0.692961953482782, -0.290629685768335, -0.36798104515874),
    1.0: (0.327337996064384, 0.116739624866481, 0.753442683094788,
          0.78604851481671, -0.121512003715551, -1.64829439788131,
          0.539696276302702, -0.252536286943617, 0.483405989131516),
    1.7: (0.575666499372555, 0.527010277229816, 0.0496528600525719,
          0.429335949880553, -0.56977081852297, 0.917906658070777,
          0.532227717466182, 0.194919821034536, 0.0931341780886448),
}  # fmt: skip


def test_delta_robot() -> None:
    found = solved("delta_robot", list(DELTA))
    angles = columns(found, "theta_motor_1", "theta_motor_2", "theta_motor_3")
    np.testing.assert_allclose(angles, list(DELTA.values()), rtol=0, atol=1e-12)
    assert spatial.orientation(found, "platform").magnitude().max() < 1e-13


BENNETT = {
    0.0: (2.94580363520431, -0.48693410813814, -0.125915935848008),
    0.3: (2.79239932679861, -0.541758849539076, -0.246382672199537),
    0.8: (2.4785974199918, -0.743132992783359, -0.607968519761465),
    1.5: (1.7217154602693, -1.59092352939784, -2.09066730923181),
    2.5: (-0.880329941214941, -2.63735206877614, 2.70267719922598),
    4.0: (-2.7353977719241, -0.569696725915438, 0.29920544491492),
}
THIRD = {
    0.0: (-0.154776380292185, -0.0136178377451016, 0.046689729411777),
    1.5: (-0.362413279545312, -0.0692043314693824, 0.237271993609311),
    4.0: (-0.170342266158864, 0.0276581688203901, -0.0948280073841945),
}


def test_bennett() -> None:
    found = solved("bennett", list(BENNETT))
    figures = columns(found, "theta_second")
    np.testing.assert_allclose(figures, list(BENNETT.values()), rtol=0, atol=2e-12)
    place = np.column_stack([found[f"{axis}_link_2"] for axis in "xyz"])[[0, 3, 5]]
    np.testing.assert_allclose(place, list(THIRD.values()), rtol=0, atol=1e-13)


JACK = {
    0.0: (0.12, 0.0261936620731892, 0.0,
          0.980333744519575, 0.100048605782462, -0.00705158259048742),
    0.1: (0.122617583754184, 0.026140348934203, -0.00105825378765804,
          0.990296219482593, 0.0991307290291686, -0.0112553624640971),
    0.33: (0.128582644167619, 0.0256549502765197, -0.00299379750856902,
           1.01272437476707, 0.0956128989650971, -0.0186052401196992),
    0.75: (0.13905958548843, 0.024250172971178, -0.00278626939587059,
           1.05112729030146, 0.0873482619099243, -0.0173963675578859),
    1.0: (0.14505614986713, 0.0238182835040661, -0.00050534880416766,
          1.07249774986318, 0.0839584340437695, -0.00924844105061119),
    1.6: (0.159603638695926, 0.0251044442179743, 0.00356725173666214,
          1.12233221771873, 0.0834189863657781, 0.00266272509267227),
}  # fmt: skip


@pytest.mark.parametrize("count", [0, 1, 16, 160])
def test_screw_jack(count: int) -> None:
    """Whatever the grid: between two times may be several turns."""
    t = np.unique(np.concatenate([list(JACK), np.linspace(0, 1.6, count)]))
    found = columns(solved("screw_jack", t), "z_carriage", "theta_psi")[np.isin(t, list(JACK))]
    np.testing.assert_allclose(found, list(JACK.values()), rtol=0, atol=5e-11)


POINTS = {
    "A": (0.15, 0.35, 0.16), "B": (-0.2, 0.35, 0.17), "C": (0, 0.7, 0.15), "D": (0.1, 0.42, 0.46),
    "E": (-0.15, 0.42, 0.45), "F": (-0.02, 0.66, 0.44), "G": (-0.12, 0.38, 0.2),
    "H": (-0.13, 0.68, 0.2), "W": (0, 0.75, 0.3), "P": (0, 0.77, 0),
}  # fmt: skip


def suspension(height: float, rack: float) -> tuple[Any, Any]:
    """Return C, F, P and the wheel's axis for a height of W, by spheres and circles alone.

    Unknown are the angles of the two arms and the place of H.
    """
    p = {name: np.array(place, dtype=float) for name, place in POINTS.items()}

    def swung(hinge: str, end: str, angle: float) -> Any:
        start, axis = p[hinge[0]], p[hinge[1]] - p[hinge[0]]
        turn = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
        return start + turn.apply(p[end] - start)

    def wheel(given: Any) -> Any:
        return swung("AB", "C", given[0]), swung("DE", "F", given[1]), given[2:]

    def frame(c: Any, f: Any, h: Any) -> Any:
        return np.column_stack([f - c, h - c, np.cross(f - c, h - c)])

    rest = np.linalg.inv(frame(p["C"], p["F"], p["H"]))

    def carried(given: Any, vector: Any) -> Any:
        return frame(*wheel(given)) @ rest @ vector

    push = p["G"] + [0, rack, 0]

    def missing(given: Any) -> Any:
        c, f, h = wheel(given)
        lengths = ((c, f, "CF"), (c, h, "CH"), (f, h, "FH"), (push, h, "GH"))
        rows = [np.linalg.norm(a - b) - np.linalg.norm(p[e[0]] - p[e[1]]) for a, b, e in lengths]
        return [*rows, (c + carried(given, p["W"] - p["C"]))[2] - height]

    found = fsolve(missing, [0, 0, *p["H"]], xtol=1e-13)
    c, f, _ = wheel(found)
    return (c, f, c + carried(found, p["P"] - p["C"])), carried(found, np.array([0, 1.0, 0]))


@pytest.mark.parametrize("rack", [0.0, 0.015])
def test_double_wishbone_with_steering(rack: float) -> None:
    t = np.array([0.0, 0.5, 1.0, 1.75])
    found = solved("double_wishbone_with_steering", t, {"rack": rack})
    for k, time in enumerate(t):
        height = 0.3 + 0.06 * (time - 1)
        (c, f, foot), spin = suspension(height, rack)
        up = f - c
        ground = c + (foot[2] - c[2]) / up[2] * up  # where the steering axis meets the road
        expected = {
            "camber": -np.arcsin(spin[2]),
            "toe": np.arctan2(spin[0], spin[1]),
            "caster": np.arctan2(c[0] - f[0], f[2] - c[2]),
            "kingpin": np.arctan2(c[1] - f[1], f[2] - c[2]),
            "scrub": foot[1] - ground[1],
            "trail": ground[0] - foot[0],
            "track": 2 * foot[1],
        }
        for name, value in expected.items():
            assert found[name][k] == pytest.approx(value, abs=1e-10), name
        step, strut = 1e-5, np.array([0.02, 0.5, 0.62])
        (c_high, _, high), _ = suspension(height + step, rack)
        (c_low, _, low), _ = suspension(height - step, rack)
        slope = (high[1] - low[1]) / (high[2] - low[2])
        assert found["roll_centre"][k] == pytest.approx(foot[1] * slope, abs=1e-7)
        shorter = np.linalg.norm(strut - c_low) - np.linalg.norm(strut - c_high)
        assert found["motion_ratio"][k] == pytest.approx(shorter / (2 * step), abs=1e-7)


def position(found: Any, body: str) -> Any:
    return np.column_stack([found[f"{axis}_{body}"] for axis in "xyz"])


@pytest.mark.every(4)
@pytest.mark.parametrize("name", NAMES)
def test_that_a_turned_copy_moves_alike(name: str) -> None:
    rng = np.random.default_rng(sum(map(ord, name)))
    turn, shift = Rotation.random(random_state=rng.integers(1 << 30)), rng.normal(size=3)
    m = model(name)
    copy = turned_copy(m, turn, shift)
    t = np.linspace(0, m.end, 12)
    expected = solved(name, t)
    if name in REDUNDANT:
        with pytest.warns(kc.RedundantConstraintWarning):
            module = kc.compile(copy)
    else:
        module = kc.compile(copy)
    found = kc.solve(module, t)
    assert found.success, found.message
    for body in (item.name for item in m.bodies):
        place = turn.apply(position(expected, body)) + shift
        np.testing.assert_allclose(position(found, body), place, rtol=0, atol=1e-10)
        rotation = turn * spatial.orientation(expected, body)
        off = (spatial.orientation(found, body) * rotation.inv()).magnitude()
        np.testing.assert_allclose(off, 0, rtol=0, atol=1e-9)
        spin = np.column_stack([expected[f"{body}.omega_{axis}"] for axis in "xyz"])
        turned = np.column_stack([found[f"{body}.omega_{axis}"] for axis in "xyz"])
        np.testing.assert_allclose(turned, turn.apply(spin), rtol=0, atol=1e-8)

"""Robots from their files, against the frames of Pinocchio and MuJoCo (tests/data/robots)."""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from kincompile.cli import cli
from kincompile.errors import KincompileWarning
from kincompile.files.robots.closing import Tree, led
from kincompile.files.robots.urdf import read_urdf
from kincompile.files.robots.xml_text import read_xml
from kincompile.model.mechanism import changed
from kincompile.view.drawing import drawing
from kincompile.view.marks import GROUND_FRAME, Hull, shape_of
from tests.unit.files.robot_files import GOOD, MJCF, TREE, model

DATA = Path(__file__).parents[2] / "data" / "robots"
SMALL, LARGE = ["5bar_linkage_iso3d", "welded_four_bar"], [
    "5bar_linkage", "battobot_6d", "cassie_like", "digit_like", "wl16_like", "robotiq_2f85",
]  # fmt: skip
WARNED = "ignore::kincompile.RedundantConstraintWarning"
BEYOND = "ignore:.* leaves its limit of"


def oracle(name: str) -> dict[str, Any]:
    """Return motors, idle hinges, a rough pose, and frames at values of the motors."""
    found: dict[str, Any] = json.loads((DATA / f"{name}.json").read_text())
    return found


@pytest.mark.filterwarnings(WARNED, BEYOND)
@pytest.mark.parametrize(
    "name", [*SMALL, *(pytest.param(name, marks=pytest.mark.slow) for name in LARGE)]
)
def test_that_frames_are_those_of_the_oracle(name: str) -> None:
    known = oracle(name)
    path = next(x for x in (DATA / f"{name}.urdf", DATA / f"{name}.xml") if x.is_file())
    # An idle hinge moves nothing that is compared: it is driven, so that it stays.
    m = kc.read(path, motors=known["motors"] + known["idle"], pose=known["guess"])
    code = kc.compile(m)
    by_joint = dict(zip(known["motors"], (x.name for x in m.parameters), strict=False))
    for pose in known["poses"]:
        values = {by_joint[joint]: value for joint, value in pose["motors"].items()}
        solution = kc.solve(code, [0.0], values)
        assert solution.residual.max() < 1e-12
        for link, place in pose["frames"].items():
            origin, turn = spatial.frame(solution, link)
            if "r" in place:
                assert np.abs(origin[0] - place["r"]).max() < 1e-9, link
            if "p" in place:
                expected = Rotation.from_quat(np.roll(place["p"], -1))
                assert (turn[0] * expected.inv()).magnitude() < 1e-9, link


def drawn_frames(m: spatial.Mechanism) -> dict[str, Any]:
    """Return the placement (4, 4) of each link in the guess of a mechanism."""
    places = {"ground": np.eye(4)}
    for body in m.bodies:
        place = places[body.name] = np.eye(4)
        place[:3, 3] = [float(value) for value in body.guess[:3]]
        place[:3, :3] = Rotation.from_quat(
            np.roll([float(p) for p in body.guess[3:]], -1)
        ).as_matrix()
    return {link: places[body] @ place for link, (body, place) in m.links.items()}


def about(axis: Any, angle: float) -> Any:
    """Return the matrix of a turn, by the formula of Rodrigues."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def random_tree(seed: int) -> tuple[str, list[dict[str, Any]]]:
    """Return a tree as a URDF, and its joints in an order from the root."""
    rng = np.random.default_rng(seed)
    joints, texts = list[dict[str, Any]](), list[str]()
    for k in range(int(rng.integers(2, 9))):
        axis = rng.standard_normal(3) * rng.uniform(0.1, 10)
        r, angles = rng.uniform(-1, 1, 3), rng.uniform(-4, 4, 3)
        kind = str(rng.choice(["revolute", "continuous", "prismatic", "fixed"]))
        parent = f"link {rng.integers(k + 1)}"
        roll, pitch, yaw = map(about, np.eye(3), angles)
        joints.append({
            "name": f"joint-{k}", "kind": kind, "parent": parent, "child": f"link {k + 1}",
            "r": r, "turn": yaw @ pitch @ roll, "axis": axis / np.linalg.norm(axis),
        })  # fmt: skip
        xyz, rpy, direction = (" ".join(map(repr, x.tolist())) for x in (r, angles, axis))
        texts.append(
            f'<link name="link {k + 1}"/><joint name="joint-{k}" type="{kind}">'
            f'<parent link="{parent}"/><child link="link {k + 1}"/><axis xyz="{direction}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><limit lower="-9" upper="9"/></joint>'
        )
    order = rng.permutation(len(texts))
    return (
        f'<robot name="t"><link name="link 0"/>{"".join(texts[k] for k in order)}</robot>',
        joints,
    )


def forward(joints: list[dict[str, Any]], values: dict[str, float]) -> dict[str, Any]:
    """Return the placement (4, 4) of each link, by matrices."""
    found = {"link 0": np.eye(4)}
    for joint in joints:
        at, motion = np.eye(4), np.eye(4)
        at[:3, :3], at[:3, 3] = joint["turn"], joint["r"]
        value = values.get(joint["name"], 0.0)
        if joint["kind"] == "prismatic":
            motion[:3, 3] = value * joint["axis"]
        else:
            motion[:3, :3] = about(joint["axis"], value)
        found[joint["child"]] = found[joint["parent"]] @ at @ motion
    return found


@pytest.mark.parametrize("seed", range(20))
def test_that_random_trees_stand_where_their_matrices_say(tmp_path: Path, seed: int) -> None:
    text, joints = random_tree(seed)
    rng = np.random.default_rng(seed)
    moving = [x["name"] for x in joints if x["kind"] != "fixed"]
    values = dict(zip(moving, rng.uniform(-3, 3, len(moving)), strict=True))
    m = model(tmp_path, text, pose=values)
    drawn = drawn_frames(m)
    for link, place in forward(joints, values).items():
        np.testing.assert_allclose(drawn[link], place, rtol=0, atol=1e-12)
    if seed % 5 or not moving:
        return
    others = {name: value + 0.2 for name, value in values.items()}
    given = {name.replace("-", "_"): value for name, value in others.items()}
    solution = kc.solve(kc.compile(m), [0.0], given)
    for link, place in forward(joints, others).items():
        origin, turn = spatial.frame(solution, link)
        np.testing.assert_allclose(origin[0], place[:3, 3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(turn[0].as_matrix(), place[:3, :3], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "name", [SMALL[0], *(pytest.param(name, marks=pytest.mark.slow) for name in LARGE[:-1])]
)
def test_that_the_loops_are_closed_from_the_zero_pose(name: str) -> None:
    """The frames of each pair of the sidecar coincide, though the file's own pose is open."""
    frames = drawn_frames(kc.read(DATA / f"{name}.urdf"))
    text = (DATA / f"{name}.urdf").read_text()
    child = dict(re.findall(r'<joint name="([^"]+)".*?<child link="([^"]+)"', text, re.DOTALL))
    sidecar = yaml.safe_load((DATA / f"{name}.yaml").read_text())
    assert oracle(name)["zero_pose_residual"] > 1e-3
    for pair, kind in zip(sidecar["closed_loop"], sidecar["type"], strict=True):
        a, b = (frames[end if end in frames else child[end]] for end in pair)
        count = 3 if kind.lower() == "6d" else 0
        assert np.abs(a[:3, 3] - b[:3, 3]).max() < 1e-12
        assert np.abs(a[:3, :count] - b[:3, :count]).max(initial=0) < 1e-12


def test_that_packages_that_are_missing_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    monkeypatch.setattr("kincompile.files.robots.sidecar.yaml", None)
    for name in ("welded_four_bar.xml", "5bar_linkage_iso3d.urdf"):
        with pytest.raises(kc.InputError, match=r"pip install 'kincompile\[robots\]'"):
            kc.read(DATA / name)


LOOPS = {
    "URDF+": '<loop name="c" type="{}"><predecessor link="{}"><origin xyz="0 0 0"/></predecessor>'
    '<successor link="{}"/></loop>',
    "the parser of URDF+": '<constraint name="c" type="{}"><predecessor link="{}"/>'
    '<successor link="{}"/></constraint>',
    "older files of URDF+": '<loop_constraint name="c" type="{}"><parent link="{}"/>'
    '<parent_origin rpy="0 0 0"/><child link="{}"/></loop_constraint>',
    "urdfdom": '<constraint name="c" type="{}"><parent link="{}"/><parent_origin xyz="0 0 0"/>'
    '<child link="{}"/></constraint>',
}


@pytest.mark.parametrize("dialect", LOOPS)
@pytest.mark.parametrize(
    ("name", "kind", "links"),
    [("5bar_linkage_iso3d", "spherical", ("closedloop3D_1A", "closedloop3D_1B")),
     ("5bar_linkage", "fixed", ("sphere", "sphere_2"))],
)  # fmt: skip
def test_that_loops_in_the_file_are_those_of_the_sidecar(
    tmp_path: Path, dialect: str, name: str, kind: str, links: tuple[str, str]
) -> None:
    text = (DATA / f"{name}.urdf").read_text()
    path = tmp_path / "robot.urdf"
    loop = LOOPS[dialect].format(kind, *links)
    path.write_text(text.replace("</robot>", f"{loop}</robot>"))
    motors = oracle(name)["motors"]
    by_sidecar, by_loop = (
        kc.read(DATA / f"{name}.urdf", motors=motors),
        kc.read(path, motors=motors),
    )
    assert [x.default for x in by_loop.parameters] == [x.default for x in by_sidecar.parameters]
    assert by_loop.system().equations != by_sidecar.system().equations  # c, not closure_1
    assert len(by_loop.system().equations) == len(by_sidecar.system().equations)


BELT = (
    '<coupling name="belt"><predecessor link="a"/><successor link="b"/><ratio value="0.5"/>'
    "</coupling></robot>"
)


@pytest.mark.parametrize("first", [0.25, -0.8])
def test_that_a_mimic_joint_follows(tmp_path: Path, first: float) -> None:
    mimic = '<mimic joint="first" multiplier="-2" offset="0.1"/>'
    m = model(tmp_path, TREE.format("continuous", mimic))
    assert [x.name for x in m.parameters] == ["first"]
    solution = kc.solve(kc.compile(m), [0.0], {"first": first})
    _, turn = spatial.frame(solution, "b")
    assert turn[0].as_rotvec() == pytest.approx([0, 0, 0.5 - 2 * first + 0.1], abs=1e-12)


@pytest.mark.filterwarnings(BEYOND)
def test_that_a_coupling_drives_backwards_over_turns(tmp_path: Path) -> None:
    text = TREE.format("continuous", "").replace("</robot>", BELT)
    m = model(tmp_path, text, motors=["second"], pose={"second": 7.5, "first": 15})
    assert len(m.parameters) == 1
    solution = kc.solve(kc.compile(m), [0.0], {"second": 7.6})
    _, turn = spatial.frame(solution, "a")
    assert turn[0].as_rotvec()[2] == pytest.approx(15.2 - 4 * np.pi, abs=1e-12)


def test_that_a_coupling_follows_the_joints_from_the_common_ancestor(tmp_path: Path) -> None:
    text = TREE.format("prismatic", '<limit lower="-1" upper="1"/>').replace("</robot>", BELT)
    solution = kc.solve(kc.compile(model(tmp_path, text, motors=["first"])), [0.0], {"first": 0.6})
    origin, _ = spatial.frame(solution, "b")
    assert origin[0] == pytest.approx([1, 0, 0.3], abs=1e-12)


FOUR_BAR = """<robot name="4 bar">
<link name="base"/><link name="crank"/><link name="rod/1"/><link name="rocker"/>
<joint name="crank" type="revolute"><parent link="base"/><child link="crank"/><axis xyz="0 0 1"/>
<limit lower="{}" upper="{}"/></joint>
<joint name="knee" type="continuous"><parent link="crank"/><child link="rod/1"/>
<origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>
<joint name="rocker" type="revolute"><parent link="base"/><child link="rocker"/>
<origin xyz="4 0 0"/><axis xyz="0 0 1"/><limit lower="{}" upper="{}"/></joint>
<loop name="pin" type="revolute"><predecessor link="rod/1"><origin xyz="3.5 0 0"/></predecessor>
<successor link="rocker"><origin xyz="3 0 0"/></successor><axis xyz="0 0 1"/></loop></robot>"""


def rocker_angles(crank: float) -> list[float]:
    """Return both angles of the rocker of the four-bar 1, 3.5, 3, 4, by the law of cosines."""
    d = 4 - np.exp(1j * crank)
    beside = np.arccos((9 + abs(d) ** 2 - 3.5**2) / (2 * 3 * abs(d)))
    return [float(np.angle(-d * np.exp(sign * 1j * beside))) for sign in (1, -1)]


def drawn_angle(m: spatial.Mechanism, link: str) -> float:
    """Return the angle about z of a link in the guess of a mechanism."""
    body = next(x for x in m.bodies if x.name == m.links[link][0])
    turn = Rotation.from_quat(np.roll([float(x) for x in body.guess[3:]], -1))
    return float(turn.as_rotvec()[2])


@pytest.mark.filterwarnings(WARNED)
@pytest.mark.parametrize(("limits", "which"), [((0.1, 3), 1), ((-3, -0.6), 0)])
def test_that_limits_choose_among_assemblies(
    tmp_path: Path, limits: tuple[float, float], which: int
) -> None:
    """The rocker is turned by 0.4 at zero, so that the nearest assembly is that above."""
    text = FOUR_BAR.format(-2, 2, *limits).replace('"4 0 0"', '"4 0 0" rpy="0 0 0.4"')
    m = model(tmp_path, text, motors=["crank"])
    expected = rocker_angles(m.parameters[0].default)[which]
    assert drawn_angle(m, "rocker") == pytest.approx(expected, abs=1e-9)
    assert limits[0] < expected - 0.4 < limits[1]


@pytest.mark.filterwarnings(WARNED)
def test_that_motors_are_led_to_the_pose_without_a_jump(tmp_path: Path) -> None:
    text = FOUR_BAR.format(-9, 9, -4, 4)
    m = model(tmp_path, text, motors=["crank"], pose={"crank": 2.9})
    assert m.parameters[0].default == pytest.approx(2.9, abs=1e-12)
    first = drawn_angle(m, "rocker")
    branch = int(np.argmin(np.abs(np.array(rocker_angles(2.9)) - first)))
    assert first == pytest.approx(rocker_angles(2.9)[branch], abs=1e-9)
    solution = kc.solve(kc.compile(m), [0.0], {"crank": 3.6})
    _, turn = spatial.frame(solution, "rocker")
    assert turn[0].as_rotvec()[2] == pytest.approx(rocker_angles(3.6)[branch], abs=1e-9)
    with pytest.raises(kc.ModelError, match="its motors cannot be led to the values of the pose"):
        model(tmp_path, text, motors=["rocker"], pose={"rocker": 0.0, "knee": 1.0})


@pytest.mark.parametrize("goal", [-2.8, -0.5, 1.5, 3.4, 6.0])
def test_that_the_way_of_the_motors_stays_on_its_branch(tmp_path: Path, goal: float) -> None:
    path = tmp_path / "robot.urdf"
    tree = Tree(read_urdf(path, read_xml(path, FOUR_BAR.format(-9, 9, -4, 4).encode())))
    for branch in (0, 1):
        rocker = rocker_angles(0.3)[branch]
        pin = 4 + 3 * np.exp(1j * rocker) - np.exp(0.3j)
        begin = {"crank": 0.3, "knee": np.angle(pin) - 0.3, "rocker": rocker}
        x = np.array([begin[name] for name in tree.names()])
        assert tree.missed(x) < 1e-12
        found, done = led(tree, x, {"crank": goal})
        assert done == 1
        turned = found[tree.places["rocker"]][0] - rocker_angles(goal)[branch]
        assert np.exp(1j * turned) == pytest.approx(1, abs=1e-9)


def test_that_axes_that_point_the_other_way_do_not_close_a_hinge(tmp_path: Path) -> None:
    """A link that is turned over about x by half a turn, and is to lie as at first."""
    loop = '<loop type="revolute"><predecessor link="base"/><successor link="a"/>'
    text = GOOD.replace('axis xyz="0 0 2"', 'axis xyz="1 0 0"')
    text = text.replace("</robot>", f'{loop}<axis xyz="0 0 1"/></loop></robot>')
    m = model(tmp_path, text, motors=["second"], pose={"first": np.pi})
    assert abs(float(m.bodies[0].guess[3])) == pytest.approx(1, abs=1e-12)


def test_that_limits_that_are_left_and_changed_names_are_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    m = model(tmp_path, FOUR_BAR.format(-0.1, 0.1, 0.1, 0.2), motors=["crank"])
    assert "beyond their limits are the joints" in caplog.text
    assert "'rod/1' is rod_1" in caplog.text
    assert "the joints were moved, most" in caplog.text
    assert m.name == "n_4_bar"
    assert {"rod/1", "base", "crank", "rocker"} == {*m.links}
    assert m.parameters[0].range is None  # it begins beyond them


def test_masses_of_links_that_a_fixed_joint_joins(tmp_path: Path) -> None:
    """Two of 1 kg, their centres at 0.5 and at 1.5: each adds 0.25 kg m^2 about the centre at 1."""
    half = (
        '<inertial><origin xyz="0.5 0 0"/><mass value="1"/>'
        '<inertia ixx="1e-3" iyy="2e-3" izz="2e-3"/></inertial></link>'
    )
    text = TREE.format("fixed", "").replace('<parent link="base"/><child link="b"/>',
        '<parent link="a"/><child link="b"/>').replace(' rpy="0 0 0.5"', "").replace(
        '<link name="a"/><link name="b"/>',
        f'<link name="a">{half}<link name="b">{half}')  # fmt: skip
    (body,) = model(tmp_path, text).bodies
    assert body.mass == 2
    assert body.centre == pytest.approx([1, 0, 0])
    assert np.diag(body.inertia) == pytest.approx([2e-3, 0.504, 0.504])


def test_what_is_said_of_motors(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    mimic = TREE.format("continuous", '<mimic joint="first"/>')
    m = model(tmp_path, mimic, "name_mot: [second, first]\nclosed_loop: []\n")
    assert [x.name for x in m.parameters] == ["first"]
    assert "joints that mimic others are no motors: second are left out" in caplog.text
    with pytest.raises(kc.InputError, match=r"motor 'thrd' is no joint of .* It has first, second"):
        model(tmp_path, GOOD, motors=["thrd"])
    with pytest.raises(kc.InputError, match=r"pose has 'firs', .* did you mean 'first'"):
        model(tmp_path, GOOD, pose={"firs": 1})
    with pytest.raises(kc.InputError, match="loops: only a robot"):
        kc.read("m.toml", loops="a.yaml")
    model(tmp_path, FOUR_BAR.format(-2, 2, -3, 3), motors=["crank", "rocker"])
    assert "motors that follow from the others are left out: rocker" in caplog.text


def test_that_a_robot_becomes_a_model_file(tmp_path: Path) -> None:
    """And that the fixed end of a chain is a point, which a column is called by."""
    tip = '<link name="tool-tip"/><joint name="f" type="fixed"><parent link="b"/>'
    tip += '<child link="tool-tip"/><origin xyz="0 0.5 0"/></joint></robot>'
    path, written = tmp_path / "robot.urdf", tmp_path / "robot.toml"
    path.write_text(GOOD.replace("</robot>", tip))
    done = CliRunner().invoke(cli, ["convert", str(path), "-o", str(written)])
    assert done.exit_code == 0, done.output
    solution = kc.solve(kc.compile(kc.read(written)), [0.0], {"second": 0.2})
    place = [1 - 0.5 * np.sin(0.7), 0.5 * np.cos(0.7), 0]
    assert [solution[f"tool_tip.{x}"][0] for x in "xyz"] == pytest.approx(place, abs=1e-12)
    with pytest.raises(kc.InputError, match="r has no link 'tool-tip'; links are those of a file"):
        spatial.frame(solution, "tool-tip")


def test_that_mjcf_counts_values_from_its_references(tmp_path: Path) -> None:
    """A hinge that stands at 30 degrees as drawn, and a slide at 0.2 that follows it."""
    path = tmp_path / "robot.xml"
    path.write_text(
        '<mujoco><worldbody><body name="a"><joint name="turn" axis="0 0 1" ref="30" '
        'range="-40 60"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
        '<body name="b" pos="1 0 0"><joint name="way" type="slide" axis="0 1 0" ref="0.2"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody><equality>'
        '<joint joint1="way" joint2="turn" polycoef="0 2 3"/></equality>'
        '<actuator><motor joint="turn"/></actuator></mujoco>'
    )
    m = kc.read(path)
    assert m.parameters[0].default == pytest.approx(np.pi / 6)
    assert m.parameters[0].range == pytest.approx(np.deg2rad([-40, 60]))
    solution = kc.solve(kc.compile(m), [0.0], {"turn": 0.7})
    turned = 0.7 - np.pi / 6
    assert spatial.frame(solution, "a")[1][0].as_rotvec()[2] == pytest.approx(turned, abs=1e-12)
    way = 2 * turned + 3 * turned**2
    assert spatial.frame(solution, "b")[0][0] == pytest.approx([1, way, 0], abs=1e-12)


SHAPES = (
    '<visual><origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/><geometry>'
    '<box size="0.4 0.2 0.1"/></geometry></visual><visual><geometry>'
    '<cylinder radius="0.05" length="0.3"/></geometry></visual><visual><geometry>'
    '<sphere radius="0.02"/></geometry></visual><visual><geometry>'
    '<mesh filename="package://arm.stl"/></geometry></visual>'
)


def assert_shapes(body: Any) -> None:
    box, cylinder, ball = (np.array(x) for x in body.outline)
    np.testing.assert_allclose(np.ptp(box, axis=0), [0.2, 0.4, 0.1], atol=1e-8)
    np.testing.assert_allclose(box.mean(axis=0), [0.1, 0, 0], atol=1e-8)
    np.testing.assert_allclose(np.hypot(*cylinder[:, :2].T), 0.05, atol=1e-8)
    assert {*cylinder[:, 2]} == {-0.15, 0.15}
    np.testing.assert_allclose(np.linalg.norm(ball, axis=1), 0.02, atol=1e-8)


def test_that_shapes_of_links_are_drawn_and_meshes_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    text = TREE.format("continuous", "").replace(
        '<link name="a"/>', f'<link name="a">{SHAPES}</link>'
    )
    m = model(tmp_path, text)
    assert "meshes are not read: package://arm.stl" in caplog.text
    (written := tmp_path / "robot.toml").write_text(m.to_toml())
    for found in (m, kc.read(written)):
        assert_shapes(found.bodies[0])
        assert len(found.bodies[1].outline) == 0
    drawn = drawing(m)
    shells = [x for x in drawn.marks if isinstance(x, Hull) and x.style == "shell"]
    assert [len(x.points) for x in shells] == [50, 24, 8]
    assert "stub" in {shape_of(x) for x in drawn.marks}  # b, by its joint


def test_that_shapes_of_the_root_stand_still_in_every_picture(tmp_path: Path) -> None:
    text = TREE.format("continuous", "").replace(
        '<link name="base"/>', f'<link name="base">{SHAPES}</link>'
    )
    m = model(tmp_path, text)
    (written := tmp_path / "robot.toml").write_text(m.to_toml())
    for found in (m, kc.read(written)):
        assert_shapes(found.system().ground)
        drawn = drawing(found)
        shells = [x for x in drawn.marks if isinstance(x, Hull) and x.style == "shell"]
        assert [(x.frame, len(x.points)) for x in shells] == [
            (GROUND_FRAME, 50), (GROUND_FRAME, 24), (GROUND_FRAME, 8),
        ]  # fmt: skip
    m.outline = [m.outline[0][:3]]
    with pytest.raises(kc.ModelError, match="outline of ground, solid 1: it has 3 corners"):
        m.system()


def test_that_shapes_of_mjcf_are_drawn_and_have_no_mass(tmp_path: Path) -> None:
    geoms = (
        '<geom type="box" pos="0.1 0 0" euler="0 0 90" size="0.2 0.1 0.05"/>'
        '<geom type="cylinder" size="0.05 0.15" mass="7"/><geom size="0.02"/>'
        '<geom type="mesh" mesh="arm"/>'
    )
    path = tmp_path / "robot.xml"
    (tmp_path / "good.xml").write_text("<m/>")
    path.write_text(MJCF.format("good.xml", "0 0 1", geoms))
    (body,) = kc.read(path).bodies
    assert_shapes(body)
    assert body.mass == 2


def test_that_outlines_in_space_are_checked() -> None:
    m = spatial.Mechanism("m")
    corners = [(0, 0, 0), (1, 0, 0), (0, 1)]
    m.add(spatial.Spherical("A", m.ground, (0, 0, 0), m.body("a", outline=[corners]), (0, 0, 0)))
    with pytest.raises(
        kc.ModelError, match=r"outline of a, solid 1: it has 3 corners; a solid has 4"
    ):
        m.system()
    with pytest.raises(
        kc.ModelError, match=r"corner 3, \(0, 1\), is not \(xi, eta, zeta\); give three"
    ):
        m.system()


@pytest.mark.filterwarnings(WARNED)
def test_that_limits_that_a_motion_leaves_are_named_with_time_and_value(tmp_path: Path) -> None:
    """The crank turns by 1 rad in 1 s from 0.3; the rocker by the law of cosines."""
    t = np.linspace(0, 1, 101)
    rocker = np.array([rocker_angles(0.3 + x)[0] for x in t])
    middle = (rocker.min() + rocker.max()) / 2
    text = FOUR_BAR.format(-9, 1.1, -4, middle)
    m = model(tmp_path, text, motors=["crank"], pose={"crank": 0.3, "rocker": rocker[0]})
    m = changed(m, constraints=list(m.constraints))
    k = next(k for k, item in enumerate(m.constraints) if item.name == "crank")
    m.constraints[k] = replace(m.constraints[k], angle=m.constraints[k].angle + kc.t)
    (written := tmp_path / "robot.toml").write_text(m.to_toml())
    first, worst = int(np.argmax(rocker > middle)), int(np.argmax(rocker))
    for item in (m, kc.read(written)):
        module = kc.compile(item)
        with pytest.warns(KincompileWarning, match=r"Joint crank leaves its limit of 1\.1") as seen:
            said = kc.solve(module, t).message
        assert str(seen[0].message).removeprefix("n_4_bar: ") in said
        assert (
            "Joint crank leaves its limit of 1.1 rad at t = 0.81; it is 1.3 rad at t = 1." in said
        )
        assert (
            f"Joint rocker leaves its limit of {middle:.6g} rad at t = {t[first]:.10g}; it is "
            f"{rocker[worst]:.6g} rad at t = {t[worst]:.10g}."
        ) in said

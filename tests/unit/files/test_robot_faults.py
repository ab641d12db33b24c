"""Faults of robots' files, and hostile ones: named with file and line, and within bounds."""

from pathlib import Path

import pytest

import kincompile as kc
from tests.unit.files.robot_files import GOOD, MJCF, TREE, model

TWICE = GOOD.replace('name="second"', 'name="first"')
REFUSED = {
    "bomb": ('<!DOCTYPE r [<!ENTITY a "b">]>' + GOOD, r"line 1: a document type"),
    "external": ('<!DOCTYPE r SYSTEM "file:///etc/passwd"><r/>', r"line 1: a document type"),
    "not XML": (GOOD.replace("</robot>", ""), r"line 4: this is not XML"),
    "other root": ("<sdf/>", r"line 1: this is no URDF: it begins with <sdf>"),
    "zero axis": (GOOD.replace("0 0 2", "0 0 0"), r"line 2: the axis is zero; give a direction"),
    "NaN": (GOOD.replace("1 0 0", "nan 0 0"), r"line 3: xyz of <origin> .* is not a number"),
    "huge": (GOOD.replace("1 0 0", "1e300 0 0"), r"line 3: xyz .* not a number of at most 1e\+09"),
    "two numbers": (GOOD.replace("0 0 2", "0 2"), r"line 2: xyz of <axis> is '0 2': give 3 num"),
    "two parents": (GOOD.replace('child link="b"', 'child link="a"'),
                    r"line 3: link 'a' has two parents, by the joints 'first' and 'second'"),
    "cycle": (GOOD.replace('parent link="base"', 'parent link="b"', 1).replace(
        '<parent link="base"/><child link="b"/>', '<parent link="a"/><child link="b"/>'),
        r"line \d: joint 'first' is part of a cycle"),
    "no parent": (GOOD.replace('<link name="a"/>', '<link name="a"/><link name="c"/>'),
                  r"the links 'base', 'c' have no parent"),
    "missing link": (GOOD.replace('child link="a"', 'child link="bass"'),
                     r"line 2: <joint> names the link 'bass', which is nowhere; .* 'base'"),
    "twice": (TWICE, r"line 3: there are two joints 'first'; rename one"),
    "floating": (TREE.format("floating", ""), r"line 3: joint 'second' has the type 'floating'"),
    "limits": (GOOD.replace('lower="-1"', 'lower="2"'), r"line 2: .* its lower limit 2 is above"),
    "mimic": (TREE.format("continuous", '<mimic joint="fist"/>'),
              r"line 3: joint 'fist' is nowhere; did you mean 'first'"),
    "loop": (GOOD.replace("</robot>", '<loop type="sphere"/></robot>'),
             r"line 4: <loop> has the type 'sphere': .*did you mean 'spherical'"),
    "xacro": (GOOD.replace("<link", "<xacro:macro/><link", 1),
              r"line 1: this is a xacro file; expand it"),
    "long name": (GOOD.replace('"first"', f'"{"x" * 201}"'), r"line 2: a name has more than 200"),
    "mimic cycle": (
        TREE.format("continuous", '<mimic joint="first"/>').replace(
            "<limit", '<mimic joint="second"/><limit', 1),
        r"line 3: joint 'second' mimics itself; name another one"),
    "nothing moves": (GOOD.replace('"revolute"', '"fixed"').replace('"continuous"', '"fixed"'),
                      r"no joint of it moves; give one that turns or slides"),
    "open": (GOOD.replace("</robot>", '<loop type="spherical"><predecessor link="a">'
             '<origin xyz="9 0 0"/></predecessor><successor link="b"/></loop></robot>'),
             r"its loops cannot be closed; from where it begins they miss by 8 \[m or rad\]"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_that_a_fault_is_named_with_its_line(tmp_path: Path, case: str) -> None:
    text, message = REFUSED[case]
    with pytest.raises(kc.ModelError, match=message) as caught:
        model(tmp_path, text)
    assert all("robot.urdf" in problem for problem in caught.value.problems)


SIDECARS = {
    "bomb": ("a: &a [x]\nb: [*a, *a]\n", r"line 2: aliases \(\*\) are not read"),
    "code": ("closed_loop: !!python/object/apply:os.system [[a, b]]\ntype: [7d]\n",
             r"line 2: type '7d' is no type of a loop: write 6d or 3d"),
    "deep": ("closed_loop: " + "[" * 1000, r"line 1: the lists are nested too deeply"),
    "types": ("closed_loop: [[a, b]]\ntype: [6d, 3d]\n", r"line 2: type has 2 entries for 1 pairs"),
    "frame": ("closed_loop:\n- [a, secont]\ntype: [6d]\n",
              r"line 2: frame 'secont' is nowhere in .*robot.urdf; did you mean 'second'"),
    "motor": ("name_mot:\n- first\n- secnd\n", r"line 3: joint 'secnd' is nowhere .* 'second'"),
    "itself": ("closed_loop: [[b, second]]\ntype: [6d]\n", r"line 1: .* joins 'b' to itself"),
    "kind": ("joint_name: [first]\njoint_type: [UJOINT_XX]\n", r"line 2: joint 'first' has"),
    "kinds": ("joint_name: [first]\n", r"line 1: joint_name has 1 names, joint_type 0 types"),
    "text": ("closed_loop: a\n", r"line 1: closed_loop is no list"),
    "not YAML": ("a: [", r"line 1: this is not YAML"),
    "twice": ("name_mot: [first]\nname_mot: [second]\n", r"line 2: 'name_mot' is there twice"),
    "key": ("[a, b]: c\n", r"line 1: a key is no text; keys are closed_loop, type"),
    "no table": ("- a\n", r"line 1: a sidecar has the keys closed_loop"),
}  # fmt: skip


@pytest.mark.parametrize("case", SIDECARS)
def test_that_a_fault_of_a_sidecar_is_named_with_its_line(tmp_path: Path, case: str) -> None:
    sidecar, message = SIDECARS[case]
    with pytest.raises(kc.ModelError, match=f"robot.yaml, {message}"):
        model(tmp_path, GOOD, sidecar)


def test_mjcf_that_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    (tmp_path / "part.xml").write_text('<m><include file="other.xml"/></m>')
    (tmp_path / "other.xml").write_text('<m><include file="part.xml"/></m>')
    (tmp_path / "good.xml").write_text('<m><compiler angle="radian"/></m>')
    bomb = '<replicate count="1000000000"><site/></replicate>'
    for given, message in (
        (("../secret.xml", "0 0 1", ""), r"line 1: the include '../secret.xml' is outside"),
        (("part.xml", "0 0 1", ""), r"line 1: the include 'part.xml' includes itself"),
        (("good.xml", "0 0 1", bomb), r"line 1: <replicate> is not read"),
        (("good.xml", "0 0 NaN", ""), r"line 1: axis of <joint> has 'NaN': give numbers up to"),
        (("good.xml", "0 0 1e99", ""), r"line 1: axis of <joint> has '1e99': give numbers up to"),
        (("good.xml", "0 0", ""), r"robot.xml, line 1: MuJoCo refuses this file: .*axis.*line 1"),
    ):
        path.write_text(MJCF.format(*given))
        with pytest.raises(kc.ModelError, match=message):
            kc.read(path)
    path.write_text(MJCF.format("good.xml", "0 0 1", ""))
    assert kc.read(path).bodies[0].mass == 2
    with pytest.raises(kc.InputError, match="loops are in <equality>"):
        kc.read(path, loops="a.yaml")


def test_that_bodies_and_joints_without_names_may_stand_on_one_line(tmp_path: Path) -> None:
    path, inner = tmp_path / "robot.xml", "<joint/><joint axis='0 1 0'/><geom size='1'/>"
    bodies = f"<body>{inner}<body pos='1 0 0'>{inner}</body></body>"
    path.write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    m = kc.read(path)
    assert len({x.name for x in m.parameters}) == 4
    assert {"body_1", "body_1_2"} <= {*m.links}


def test_that_names_that_formulas_keep_are_changed(tmp_path: Path) -> None:
    """A model file reads no formula with such a name."""
    m = model(tmp_path, GOOD.replace('"first"', '"or"').replace('"second"', '"lambda"'))
    (written := tmp_path / "robot.toml").write_text(m.to_toml())
    assert [x.name for x in kc.read(written).parameters] == ["or_2", "lambda"]


def test_that_shapes_which_are_no_solids_or_too_many_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    ball = "<visual><geometry><sphere radius='{}'/></geometry></visual>"
    flat = "<visual><geometry><box size='1 1 0'/><box size='1 -1 1'/></geometry></visual>"
    thin = GOOD.replace('<link name="a"/>', f'<link name="a">{ball.format(1e-12)}{flat}</link>')
    assert all(len(x.outline) == 0 for x in model(tmp_path, thin).bodies)
    many = GOOD.replace('<link name="a"/>', f'<link name="a">{ball.format(1) * 600}</link>')
    assert len(model(tmp_path, many).bodies[0].outline) == 500
    assert "shapes beyond the first 500 are not drawn" in caplog.text

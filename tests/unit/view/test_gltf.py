"""glTF of a motion in space: read back by trimesh, and keyframe by keyframe."""

import json
import struct
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from kincompile.errors import InputError
from kincompile.view.gltf import _continuous, _turns_to
from tests.spatial_models import slider_crank

X, Y, Z = np.eye(3)
TURNS = 3.0


def arm() -> spatial.Mechanism:
    """Return an arm that turns three times about a leaning axis, and a ram that holds its tip."""
    m = spatial.Mechanism("arm", end=TURNS, points=61, length_unit="mm")
    axis = np.array((0, 3, 4)) / 5
    bar = m.body("bar", (0, 0, 10), x=X, z=axis)
    m.add(spatial.Revolute("pin", m.ground, (0, 0, 10), axis, bar, (0, 0, 0), Z))
    m.add(spatial.RelativeRotation("motor", m.ground, axis, X, bar, Z, X, 2 * kc.pi * kc.t))
    m.point("tip", bar, (100, 0, 0))
    weight = m.body("weight", (0, 0, 200))
    m.add(spatial.AbsoluteDistance("ram", weight, (0, 0, 0), (0, 0, 300), 80 + 10 * kc.t))
    m.add(spatial.AbsoluteX("x", weight, (0, 0, 0), 20))
    m.add(spatial.AbsoluteY("y", weight, (0, 0, 0), 30))
    m.add(spatial.AbsoluteOrientation("straight", weight, (1, 0, 0), 0))
    return m


def parts_of(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the document and the binary part of a file."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    rest, name = struct.unpack_from("<I4s", data, 20 + size)
    assert (name, 28 + size + rest) == (b"BIN\0", length)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def numbers(document: dict[str, Any], binary: bytes, index: int) -> np.ndarray:
    item = document["accessors"][index]
    view = document["bufferViews"][item["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[item["type"]]
    kind = {5126: "<f4", 5125: "<u4"}[item["componentType"]]
    found = np.frombuffer(binary, kind, item["count"] * width, view["byteOffset"])
    return found.reshape(item["count"], width)


def keyframes(data: bytes) -> tuple[np.ndarray, dict[str, list[dict[str, np.ndarray]]]]:
    """Return times, and the values of what moves of the nodes of each name."""
    document, binary = parts_of(data)
    (animation,) = document["animations"]
    nodes: dict[int, dict[str, np.ndarray]] = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        target = channel["target"]
        values = numbers(document, binary, sampler["output"])
        nodes.setdefault(target["node"], {})[target["path"]] = values
    found: dict[str, list[dict[str, np.ndarray]]] = {}
    for node, moving in nodes.items():
        found.setdefault(document["nodes"][node]["name"], []).append(moving)
    return numbers(document, binary, animation["samplers"][0]["input"])[:, 0], found


@pytest.fixture(scope="module")
def motion() -> kc.Solution:
    return kc.solve(kc.compile(arm()), np.linspace(0, TURNS, 61))


def test_that_every_keyframe_is_the_position_of_the_bodies(motion, tmp_path):
    times, nodes = keyframes(kc.animate(motion, tmp_path / "arm.glb").read_bytes())
    np.testing.assert_allclose(times, motion.t, rtol=1e-7)
    (bar,) = nodes["bar"]
    turn = Rotation.from_quat(bar["rotation"])
    tip = bar["translation"] + turn.apply((100, 0, 0))
    known = np.stack([motion[f"{axis}_tip"] for axis in "xyz"], axis=-1)
    np.testing.assert_allclose(tip, known, atol=1e-4)
    # Over whole turns, where p becomes -p, no quaternion jumps.
    products = np.sum(bar["rotation"][1:] * bar["rotation"][:-1], axis=1)
    assert products.min() == pytest.approx(np.cos(np.pi * TURNS / 60), abs=1e-6)
    np.testing.assert_allclose(np.linalg.norm(bar["rotation"], axis=1), 1, atol=1e-6)


def test_that_a_driven_rod_ends_at_its_points(motion, tmp_path):
    data = kc.animate(motion, tmp_path / "arm.glb").read_bytes()
    _, nodes = keyframes(data)
    stretched = [item for item in nodes["ram"] if "scale" in item]
    assert (len(nodes["ram"]), len(stretched)) == (2, 1)  # rod and barrel
    (rod,) = stretched
    way = Rotation.from_quat(rod["rotation"]).apply(Z) * rod["scale"][:, 2:] * 110
    weight = np.stack([motion[f"{axis}_weight"] for axis in "xyz"], axis=-1)
    np.testing.assert_allclose(rod["translation"], np.tile((0, 0, 300), (61, 1)))
    np.testing.assert_allclose(rod["translation"] + way, weight, atol=1e-4)


def test_that_trimesh_reads_it_upright_and_in_metres(motion, tmp_path):
    path = kc.animate(motion, tmp_path / "arm.glb")
    scene = trimesh.load_scene(path)
    bar = [
        trimesh.transform_points(scene.geometry[mesh].vertices, scene.graph.get(node)[0])
        for node in scene.graph.nodes_geometry
        for mesh in [scene.graph.get(node)[1]]
        if node.startswith("bar")
    ]
    found = np.concatenate(bar)
    # The bar lies along x at the start: from the pin to the tip, and a size or two of marks more.
    assert found[:, 0].max() == pytest.approx(0.1, abs=0.005)
    assert np.abs(found[:, 1] - 0.01).max() < 0.022  # z upwards is y in glTF
    tip = scene.graph.get("tip")[0][:3, 3]
    np.testing.assert_allclose(tip, (0.1, 0.01, 0), atol=1e-7)
    root = scene.graph.get("arm")[0][:3, :3]
    np.testing.assert_allclose(root @ Z, (0, 0.001, 0), atol=1e-10)
    for mesh in scene.geometry.values():
        if isinstance(mesh, trimesh.Trimesh):
            assert mesh.volume > 0  # so that triangles are seen from outside
            np.testing.assert_allclose(np.linalg.norm(mesh.vertex_normals, axis=1), 1)


def test_that_accessors_say_their_range_and_lie_in_the_buffer(tmp_path):
    model = slider_crank()
    solution = kc.solve(kc.compile(model), np.linspace(0, 1, 41))
    document, binary = parts_of(kc.animate(solution, tmp_path / "a.glb").read_bytes())
    assert document["buffers"] == [{"byteLength": len(binary)}]
    assert "uri" not in json.dumps(document)
    for index, item in enumerate(document["accessors"]):
        values = numbers(document, binary, index)
        assert np.isfinite(values).all()
        if "min" in item:
            np.testing.assert_array_equal(values.min(axis=0), np.float32(item["min"]))
            np.testing.assert_array_equal(values.max(axis=0), np.float32(item["max"]))
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            assert "min" in document["accessors"][primitive["attributes"]["POSITION"]]
    (path,) = [mesh for mesh in document["meshes"] if mesh["name"] == "path"]
    traced = numbers(document, binary, path["primitives"][0]["attributes"]["POSITION"])
    tip = np.stack([solution[f"{axis}_tip"] for axis in "xyz"], axis=-1)
    np.testing.assert_allclose(traced, tip, atol=1e-7)


def test_the_turns_of_a_rod_reach_every_direction():
    axes = np.random.default_rng(2).normal(size=(50, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    axes[10] = -axes[9]
    found = Rotation.from_quat(_turns_to(axes)).apply(Z)
    np.testing.assert_allclose(found[:10], axes[:10], atol=1e-12)
    turned = _continuous(np.array([(0, 0, 0, 2.0), (0, 0, 0, -3.0), (0, 0, 1.0, -1.0)]))
    np.testing.assert_allclose(turned[:2], np.tile((0, 0, 0, 1), (2, 1)))


def directions() -> np.ndarray:
    """Return directions, along axes and any, each with those nearly and exactly opposite to it."""
    rng = np.random.default_rng(7)
    found = [Z]
    for axis in (*np.eye(3), *-np.eye(3), *rng.normal(size=(40, 3))):
        along = axis / np.linalg.norm(axis)
        across = np.cross(along, rng.normal(size=3))
        for angle in (0.0, 1e-15, 1e-13, 1e-11, 1e-9, 1e-7, 1e-3):
            found += [along, -(along + angle * across / np.linalg.norm(across))]
    return np.array([axis / np.linalg.norm(axis) for axis in found])


def test_that_a_rod_turns_right_about_whatever_its_direction():
    axes = directions()
    for order in (axes, axes[::-1], np.random.default_rng(1).permutation(axes)):
        turns = _turns_to(order)
        assert np.abs(Rotation.from_quat(turns).apply(Z) - order).max() < 1e-10
        # The shortest turn: what it is about is across both, so half a turn at most.
        steps = Rotation.from_quat(turns[1:]) * Rotation.from_quat(turns[:-1]).inv()
        between = np.arccos(np.clip(np.sum(order[1:] * order[:-1], axis=1), -1, 1))
        np.testing.assert_allclose(steps.magnitude(), between, atol=1e-6)
    assert np.abs(Rotation.from_quat(_turns_to(3.0 * axes)).apply(Z) - axes).max() < 1e-10


def test_that_a_rod_without_a_length_keeps_its_direction():
    turns = _turns_to(np.array([2 * X, 0 * X, -X, 0 * X]))
    assert np.abs(Rotation.from_quat(turns).apply(Z) - [X, X, -X, -X]).max() < 1e-12


def test_times_and_what_is_refused(motion, tmp_path):
    times, _ = keyframes(kc.animate(motion, tmp_path / "a.glb", seconds=6).read_bytes())
    np.testing.assert_allclose(times[[0, -1]], (0, 6))
    still = kc.solve(kc.compile(arm()), [0.5])
    document, _ = parts_of(kc.animate(still, tmp_path / "b.glb").read_bytes())
    assert "animations" not in document
    plane = kc.Mechanism("plane")
    body = plane.body("link")
    plane.add(kc.Revolute("pin", plane.ground, (0, 0), body, (0, 0)))
    plane.add(kc.AbsoluteAngle("motor", body, kc.t))
    flat = kc.solve(kc.compile(plane), [0, 1])
    with pytest.raises(
        InputError, match=r"plane moves in a plane, and .glb is for motions in space"
    ):
        kc.animate(flat, tmp_path / "c.glb")
    assert not (tmp_path / "c.glb").exists()

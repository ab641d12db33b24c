"""A motion in space as glTF 2.0, in one binary file (.glb): meshes of bodies, with keyframes.

A body is a node that moves, a rod between two bodies a node of its own. glTF has y upwards, metres
and quaternions (x, y, z, w); the node above all turns z upwards into that, and scales.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kincompile.names import METRES
from kincompile.view.marks import GROUND_FRAME, FramePoint, Span, moves_with, shape_of
from kincompile.view.picture import colour_of
from kincompile.view.shapes import HUES, mixed
from kincompile.view.solid_picture import PLATE
from kincompile.view.solids import InFrame, beside, facets_of, solids

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from kincompile.view.drawing import Drawing
    from kincompile.view.marks import Array, BodyFrame
    from kincompile.view.solids import Solid

MAGIC, JSON, BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
"""What a binary file and its two parts begin with."""

FLOAT, INDEX = 5126, 5125
"""Types of numbers: float32 and uint32."""

VERTICES, CORNERS = 34962, 34963
"""What numbers of a mesh are for."""

LINE_STRIP = 3
"""How a path is drawn."""

UPRIGHT = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
"""The turn about x that puts z where glTF has y."""

LEFT_OUT = ("turn", "push", "dimension", "gap")
"""Shapes that are notes on a drawing, and no bodies."""

CONSTANT = 1e-9
"""Part of a length by which the length of a rod may vary."""

OPPOSITE = 1e-12
"""Angle [rad] short of half a turn at which any axis across will do: a better one is rounding."""


def as_glb(
    drawn: Drawing,
    t: Array,
    q: Array,
    length_unit: str,
    paths: Sequence[Array] = (),
) -> bytes:
    """Return a motion as a binary glTF file.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Times of the keyframes [s]; they rise, from any start.
    q : ndarray, shape (N, n)
        Positions.
    length_unit
        The unit of length; one that is not known counts as a metre.
    paths
        Lines on the ground, each of shape (k, 3).
    """
    file = _File((t - t[0]).astype(np.float32))
    groups = _groups(drawn)
    nodes = [_ground(file, groups.pop(GROUND_FRAME, []), paths)]
    for name, frame in zip(drawn.bodies, drawn.frames, strict=True):
        node = file.node(name, file.mesh(name, groups.get(frame, [])))
        _add_points(file, node, drawn, frame)
        file.animate(node, q[:, frame.columns[:3]], _turned(q, frame))
        nodes.append(node)
    for mark in drawn.marks:
        if isinstance(mark, Span) and mark.style not in LEFT_OUT:
            nodes += _rod(file, drawn, mark, q)
    metres = METRES.get(length_unit, 1.0)
    root = file.node(drawn.name)
    file.nodes[root] |= {"rotation": UPRIGHT, "scale": [metres] * 3, "children": nodes}
    return file.written(root)


def _groups(drawn: Drawing) -> dict[BodyFrame, list[Solid]]:
    found: dict[BodyFrame, list[Solid]] = {}
    for solid in solids(drawn):
        mark = solid.mark
        if not isinstance(mark, Span) and shape_of(mark) not in LEFT_OUT:
            (frame,) = moves_with(mark)
            found.setdefault(frame, []).append(solid)
    return found


def _ground(file: _File, fixed: list[Solid], paths: Sequence[Array]) -> int:
    node = file.node("ground", file.mesh("ground", fixed))
    hues = HUES["light"]
    found = [file.lines("path", path, hues[(k + 4) % len(hues)]) for k, path in enumerate(paths)]
    if found:
        file.nodes[node]["children"] = [file.node("path", mesh) for mesh in found]
    return node


def _add_points(file: _File, node: int, drawn: Drawing, frame: BodyFrame) -> None:
    children = []
    for dot in drawn.dots:
        if dot.place.frame == frame:
            child = file.node(dot.name)
            file.nodes[child]["translation"] = list(map(float, dot.place.point))
            children.append(child)
    if children:
        file.nodes[node]["children"] = children


def _rod(file: _File, drawn: Drawing, mark: Span, q: Array) -> list[int]:
    """Add what is between two points: along its own z axis, longer and shorter as it is driven."""
    start, end = mark.first.at(q), mark.second.at(q)
    way = end - start
    lengths = np.linalg.norm(way, axis=1)
    longest = float(lengths.max())
    upright = replace(
        mark,
        first=FramePoint(GROUND_FRAME, (0.0, 0.0, 0.0)),
        second=FramePoint(GROUND_FRAME, (0.0, 0.0, longest)),
    )
    turns = _turns_to(way)
    nodes = []
    for solid in solids(replace(drawn, marks=(mark,))):
        node = file.node(mark.joint, file.mesh(mark.joint, [solid], replace(solid, mark=upright)))
        is_driven = solid.piece.on != "barrel" and np.ptp(lengths) > CONSTANT * longest
        scales = np.stack((lengths * 0 + 1, lengths * 0 + 1, lengths / (longest or 1.0)), axis=-1)
        file.animate(node, start, turns, scales if is_driven else None)
        nodes.append(node)
    return nodes


# ---- how nodes move ----


def _turned(q: Array, frame: BodyFrame) -> Array:
    """Return the orientation of a body as quaternions (x, y, z, w), shape (N, 4)."""
    e0, e1, e2, e3 = q[:, frame.columns[3:]].T
    return _continuous(np.stack((e1, e2, e3, e0), axis=-1))


def _turns_to(ways: Array) -> Array:
    """Return quaternions of the shortest turns from each direction to the next, the first from z.

    Where there is no direction, at a length of zero, the one before stays.
    """
    found, here = [], np.array((0.0, 0.0, 0.0, 1.0))
    before = np.array((0.0, 0.0, 1.0))
    for way in ways:
        length = np.linalg.norm(way)
        axis = way / length if length else before
        if before @ axis < 0:  # right about, and back from there: what is left is small
            across = np.cross(before, axis)
            across -= across @ before * before
            size = np.linalg.norm(across)
            about = beside(before) if size < OPPOSITE else across / size
            here, before = _after(np.append(about, 0.0), here), -before
        turn = np.append(np.cross(before, axis), 1 + before @ axis)
        here = _after(turn / np.linalg.norm(turn), here)
        found.append(here)
        before = axis
    return _continuous(np.array(found))


def _after(second: Array, first: Array) -> Array:
    """Return the quaternion of a first turn and a second one."""
    (v, w), (u, s) = (second[:3], second[3]), (first[:3], first[3])
    return np.append(w * u + s * v + np.cross(v, u), w * s - v @ u)


def _continuous(turns: Array) -> Array:
    """Return unit quaternions of which neighbours are near each other, as p and -p are one turn."""
    units = np.asarray(turns / np.linalg.norm(turns, axis=1)[:, None], dtype=np.float64)
    products = np.sum(units[1:] * units[:-1], axis=1)
    units[1:] *= np.cumprod(np.where(products < 0, -1.0, 1.0))[:, None]
    return units


# ---- the file ----


@dataclass
class _File:
    """The parts of a glTF file, as it grows."""

    times: Any
    nodes: list[dict[str, Any]] = field(default_factory=list)
    meshes: list[dict[str, Any]] = field(default_factory=list)
    materials: list[dict[str, Any]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)
    views: list[dict[str, Any]] = field(default_factory=list)
    channels: list[dict[str, Any]] = field(default_factory=list)
    samplers: list[dict[str, Any]] = field(default_factory=list)
    binary: bytearray = field(default_factory=bytearray)
    input: int | None = None

    def node(self, name: str, mesh: int | None = None) -> int:
        """Add a node and return its number."""
        self.nodes.append({"name": name} | ({} if mesh is None else {"mesh": mesh}))
        return len(self.nodes) - 1

    def mesh(self, name: str, shown: Sequence[Solid], placed: Solid | None = None) -> int | None:
        """Add the facets of solids in their frames, one primitive for each material."""
        by_material: dict[int, list[tuple[Array, Array]]] = {}
        for solid in shown:
            for part in (placed or solid).parts(InFrame()):
                for item in facets_of(part):
                    if item.normal is not None:
                        found = by_material.setdefault(self._material_of(solid), [])
                        found.append((item.points, item.normal))
        if not by_material:
            return None
        primitives = [
            {**self._triangles(facets), "material": material}
            for material, facets in by_material.items()
        ]
        self.meshes.append({"name": name, "primitives": primitives})
        return len(self.meshes) - 1

    def lines(self, name: str, points: Array, colour: str) -> int:
        """Add a path and return its mesh."""
        primitive = {
            "attributes": {"POSITION": self._accessor(points, "VEC3", VERTICES, has_range=True)},
            "mode": LINE_STRIP,
            "material": self._material(colour, 1.0),
        }
        self.meshes.append({"name": name, "primitives": [primitive]})
        return len(self.meshes) - 1

    def animate(self, node: int, moved: Array, turned: Array, scaled: Array | None = None) -> None:
        """Put a node where it is first, and give it the keyframes of its motion."""
        found = {"translation": moved, "rotation": turned, "scale": scaled}
        for path, values in found.items():
            if values is None:
                continue
            self.nodes[node][path] = values[0].tolist()
            if len(self.times) < 2:
                continue
            if self.input is None:
                self.input = self._accessor(self.times, "SCALAR", has_range=True)
            kind = "VEC4" if path == "rotation" else "VEC3"
            self.channels.append(
                {"sampler": len(self.samplers), "target": {"node": node, "path": path}}
            )
            self.samplers.append({"input": self.input, "output": self._accessor(values, kind)})

    def written(self, root: int) -> bytes:
        """Return the file, whose scene has a root."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "kincompile"},
            "scene": 0,
            "scenes": [{"name": self.nodes[root]["name"], "nodes": [root]}],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.binary)}],
        }
        if self.channels:
            document["animations"] = [
                {"name": "motion", "channels": self.channels, "samplers": self.samplers}
            ]
        text = json.dumps(document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        parts = ((JSON, text), (BIN, bytes(self.binary)))
        body = b"".join(struct.pack("<II", len(part), kind) + part for kind, part in parts)
        return struct.pack("<III", MAGIC, 2, 12 + len(body)) + body

    def _triangles(self, facets: Iterable[tuple[Array, Array]]) -> dict[str, Any]:
        """Add facets as triangles, each corner with the normal of its facet."""
        places: list[list[float]] = []
        normals: list[list[float]] = []
        corners: list[tuple[int, int, int]] = []
        for points, normal in facets:
            first = len(places)
            places += points.tolist()
            normals += [normal.tolist()] * len(points)
            corners += [
                (first, first + k, first + k + 1)
                for k in range(1, len(points) - 1)
                if np.linalg.norm(np.cross(points[k] - points[0], points[k + 1] - points[0])) > 0
            ]
        attributes = {
            "POSITION": self._accessor(places, "VEC3", VERTICES, has_range=True),
            "NORMAL": self._accessor(normals, "VEC3", VERTICES),
        }
        indices = self._accessor(np.array(corners).ravel(), "SCALAR", CORNERS)
        return {"attributes": attributes, "indices": indices}

    def _accessor(
        self, values: Any, kind: str, target: int | None = None, *, has_range: bool = False
    ) -> int:
        """Add numbers to the buffer and return their accessor; of corners `target` says so."""
        number, written = (INDEX, "<u4") if target == CORNERS else (FLOAT, "<f4")
        array = np.asarray(values, dtype=written)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": array.nbytes}
        self.views.append(view | ({} if target is None else {"target": target}))
        self.binary += array.tobytes()
        accessor = {
            "bufferView": len(self.views) - 1, "componentType": number, "count": len(array),
            "type": kind,
        }  # fmt: skip
        if has_range:
            columns = array.reshape(len(array), -1)
            accessor |= {"min": columns.min(axis=0).tolist(), "max": columns.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def _material_of(self, solid: Solid) -> int:
        """Return the material of a solid: the colour of its body, or of its look."""
        colour = solid.look.colour or colour_of(solid.frame)
        if solid.piece.look == "plate":
            return self._material(colour, PLATE)
        return self._material(mixed(colour, 0.8), 1.0)

    def _material(self, colour: str, opacity: float) -> int:
        """Return the material of a colour, which is made where there is none yet."""
        # glTF has the colour of light, of which #rrggbb is about the power 1/2.2.
        light = [(int(colour[k : k + 2], 16) / 255) ** 2.2 for k in (1, 3, 5)]
        surface = {
            "baseColorFactor": [*(round(x, 6) for x in light), opacity],
            "metallicFactor": 0.1, "roughnessFactor": 0.6,
        }  # fmt: skip
        material: dict[str, Any] = {"name": colour, "pbrMetallicRoughness": surface}
        if opacity < 1:
            material |= {"alphaMode": "BLEND"}
        if material not in self.materials:
            self.materials.append(material)
        return self.materials.index(material)

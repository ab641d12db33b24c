"""Solids of marks in space: closed, where the page puts them, and the same in every file."""

import itertools
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile.errors import InputError
from kincompile.view.drawing import drawing
from kincompile.view.marks import GROUND_FRAME, FramePoint, Span, Symbol
from kincompile.view.solid_picture import Camera
from kincompile.view.solid_shapes import SOLIDS
from kincompile.view.solids import InFrame, Position, Solid, facets_of, solids, wires
from tests.page_modules import in_node
from tests.spatial_models import slider_crank

SVG = "{http://www.w3.org/2000/svg}"
CUBE = [(x, y, z) for x in (0.0, 2.0) for y in (0.0, 1.0) for z in (0.0, 3.0)]

PROGRAM = """
import { partsOf } from './space.js';
const { drawing, positions } = given;
const partsAt = q => drawing.marks.flatMap(mark => drawing.shapes[mark.shape].map(
  piece => partsOf(q, mark, piece, drawing.size)));
tell(positions.map(partsAt));
"""


@pytest.fixture(scope="module")
def motion():
    model = slider_crank()
    return kc.solve(kc.compile(model), np.linspace(0, 1, 41))


@pytest.fixture(scope="module")
def drawn(motion):
    return drawing(slider_crank(), q=motion.q)


def volume(parts):
    """Return the volume that facets enclose, by the divergence theorem."""
    found = 0.0
    for part in parts:
        first, *others = part.points
        for b, c in itertools.pairwise(others):
            found += first @ np.cross(b, c) / 6
    return found


def solid(shape, piece, **given):
    symbol = Symbol(
        "j",
        shape,
        FramePoint(GROUND_FRAME, (1.0, 2.0, 3.0)),
        (0.6, 0.0, 0.8),
        (0.0, 1.0, 0.0),
        **given,
    )
    return Solid(SOLIDS[shape][piece], symbol, 0.1).parts(InFrame())


def test_that_solids_are_closed_and_have_their_volume():
    def prism(sides, radius, length):
        return sides / 2 * np.sin(2 * np.pi / sides) * radius**2 * length

    assert volume(solid("knuckles", 0)) == pytest.approx(prism(12, 0.1, 0.14))
    assert volume(solid("block", 0)) == pytest.approx(2 * 0.2**2 * 0.36)
    assert volume(solid("nut", 0)) == pytest.approx(prism(6, 0.17, 0.2))
    assert volume(solid("rail", 0, reach=(-1.0, 2.0))) == pytest.approx(prism(8, 0.05, 3))
    for shape in SOLIDS:
        for piece in SOLIDS[shape]:
            if piece.is_area and piece.on in ("axis", "reach", "line") and not piece.every:
                outs = np.array(piece.corners, dtype=float)[:, 2]
                assert outs[0] == outs[-1] == 0  # so that it is closed


def test_that_normals_point_outwards():
    for shape in ("hinge", "block", "push", "nut"):
        for part in solid(shape, 0):
            a, b, c = part.points[:3]
            across = np.cross(b - a, c - a)
            if np.linalg.norm(across) > 1e-12:
                assert across @ part.normal > 0
    (ball,) = solid("ball", 0)
    facets = facets_of(ball)
    assert all((facet.points.mean(axis=0) - ball.points[0]) @ facet.normal > 0 for facet in facets)
    assert 0.9 < volume(facets) / (4 / 3 * np.pi * 0.1**3) < 1


def test_the_hull_of_a_box_of_a_plate_and_of_a_line():
    faces, edges = wires((*CUBE, (1.0, 0.5, 1.0), (1.0, 1.0, 1.5)))
    assert (len(faces), len(edges)) == (6, 12)
    assert all(len(points) == 4 for points, _ in faces)
    for points, normal in faces:
        a, b, c, _ = np.array(points)
        assert np.cross(b - a, c - a) @ normal > 0
        assert (np.array(CUBE) @ normal <= a @ normal + 1e-12).all()
    plate = ((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (0.0, 1.0, 1.0), (0.2, 0.2, 1.0))
    faces, edges = wires(plate)
    assert sorted(normal for _, normal in faces) == [(0, 0, -1), (0, 0, 1)]
    assert (len(edges), {len(points) for points, _ in faces}) == (3, {3})
    assert wires(((0.0, 0.0, 0.0), (2.0, 2.0, 2.0), (1.0, 1.0, 1.0))) == (
        [], [((0.0, 0.0, 0.0), (2.0, 2.0, 2.0))],
    )  # fmt: skip
    assert wires(((1.0, 0.0, 0.0),)) == ([], [])


def turned(points: Any) -> Any:
    """Return points in generic directions."""
    return np.array(points, dtype=float) @ Rotation.from_rotvec((0.3, -1.1, 0.7)).as_matrix()


def sets_of_points() -> dict[str, np.ndarray]:
    """Return points as bodies may have them: on a box, in a plane, on a line, at one place."""
    rng = np.random.default_rng(8)
    grid = np.array(list(itertools.product((0.0, 1.0, 2.0), repeat=3)))
    ring = np.array([(np.cos(x), np.sin(x), z) for z in (0, 1) for x in np.arange(8) * np.pi / 4])
    found = {
        "box": np.array(CUBE), "turned box": turned(CUBE), "grid": grid,
        "turned grid": turned(grid),
        "far away": 1e4 + turned(grid), "small": 1e-7 * turned(CUBE), "prism": turned(ring),
        "plate": turned(grid[grid[:, 2] == 0]), "line": turned(grid[grid[:, :2].sum(1) == 0]),
        "one place": np.ones((4, 3)), "one point": np.ones((1, 3)),
        "twice": turned(np.repeat(CUBE, 2, axis=0)), "nearly twice": np.vstack((CUBE, CUBE)),
        "tetrahedron": rng.normal(size=(4, 3)), "random": rng.normal(size=(14, 3)),
        "ball": np.array([x / np.linalg.norm(x) for x in rng.normal(size=(16, 3))]),
        "nearly flat": turned(grid) * (1, 1, 1e-12),
    }  # fmt: skip
    found["nearly twice"][8:] += 1e-9 * rng.normal(size=(8, 3))
    return found


def faces_by_all_triples(places: np.ndarray) -> list[tuple[frozenset[int], np.ndarray]]:
    """Return faces by their definition: planes through three points with no point outside."""
    near = 1e-6 * np.max(np.linalg.norm(places - places[0], axis=1), initial=0.0)
    own = [
        k for k, x in enumerate(places)
        if all(np.linalg.norm(x - other) > near for other in places[:k])
    ]  # fmt: skip
    found: list[tuple[frozenset[int], np.ndarray]] = []
    triples = np.array(list(itertools.combinations(own, 3)), dtype=int).reshape(-1, 3)
    first, second, third = np.moveaxis(places[triples], 1, 0)
    normals = np.cross(second - first, third - first)
    sizes, sides = (np.linalg.norm(x, axis=1) for x in (normals, second - first))
    is_plane = sizes > 1e-6 * sides * np.linalg.norm(third - first, axis=1)
    normals = normals[is_plane] / sizes[is_plane, None]
    ways = np.einsum("tnk,tk->tn", places[own] - first[is_plane][:, None], normals)
    for sign in (1, -1):
        is_face = (sign * ways <= near).all(axis=1)
        for way, normal in zip(ways[is_face], sign * normals[is_face], strict=True):
            on = frozenset(np.array(own)[np.abs(way) <= near].tolist())
            if not any(on == other and normal @ out > 0 for other, out in found):
                found.append((on, normal))
    return found


HULLS = """
import { wiresAround } from './space.js';
tell(given.map(wiresAround));
"""


def test_that_hulls_have_the_faces_of_their_definition_in_python_and_on_the_page():
    known = sets_of_points()
    on_page = in_node(HULLS, [points.tolist() for points in known.values()])
    for (name, points), page in zip(known.items(), on_page, strict=True):
        places = tuple(map(tuple, points.tolist()))
        expected = faces_by_all_triples(points)
        for faces, edges in (wires(places), ([x.values() for x in page["faces"]], page["edges"])):
            assert len(faces) == len(expected), name
            for corners, normal in faces:
                own = frozenset(places.index(tuple(corner)) for corner in corners)
                alike = [out for on, out in expected if own <= on and out @ np.array(normal) > 0.5]
                assert len(alike) >= 1, name
                np.testing.assert_allclose(normal, max(alike, key=lambda n: n @ normal), atol=1e-6)
                loop = np.array(list(corners))
                area = sum(np.cross(a, b) for a, b in itertools.pairwise((loop - loop[0])[1:]))
                assert area @ np.array(normal) > 0, name
            if name in ("box", "turned box", "grid", "prism", "tetrahedron", "random", "ball"):
                vertices = {tuple(corner) for corners, _ in faces for corner in corners}
                assert len(vertices) - len(edges) + len(faces) == 2, name  # Euler


COUNTED = """
import { wiresAround } from './space.js';
let reads = 0;
const get = (...all) => { reads += 1; return Reflect.get(...all); };
const counted = point => new Proxy(point, { get });
tell(given.map(points => {
  reads = 0;
  wiresAround(points.map(counted));
  return reads;
}));
"""


def test_that_the_work_for_a_hull_grows_with_the_square_of_its_points():
    ball = np.random.default_rng(3).normal(size=(240, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    counts = in_node(COUNTED, [ball[:n].tolist() for n in (60, 120, 240)])
    assert counts[1] < 5 * counts[0]
    assert counts[2] < 5 * counts[1]
    faces, edges = wires(tuple(map(tuple, ball.tolist())))
    assert (len(faces), len(edges)) == (2 * 240 - 4, 3 * 240 - 6)


def test_that_the_page_has_the_parts_that_python_has(drawn, motion):
    positions = motion.q[::13]
    shown = in_node(PROGRAM, {"drawing": drawn.to_json(), "positions": positions.tolist()})
    for q, on_page in zip(positions, shown, strict=True):
        for item, known in zip(solids(drawn), on_page, strict=True):
            parts = item.parts(Position(q))
            assert len(parts) == len(known)
            for part, other in zip(parts, known, strict=True):
                points = other.get("points") or other.get("line") or [other["centre"]]
                np.testing.assert_allclose(part.points, points, atol=1e-13)
                assert other.get("radius", 0) == pytest.approx(part.radius)
                if part.normal is None:
                    assert "normal" not in other
                else:
                    np.testing.assert_allclose(part.normal, other["normal"], atol=1e-13)


def test_that_a_rod_ends_at_its_points(motion):
    span = Span(
        "rod",
        FramePoint(GROUND_FRAME, (0.0, 0.0, 0.0)),
        FramePoint(GROUND_FRAME, (1.0, 2.0, 2.0)),
        "rod",
    )
    parts = Solid(SOLIDS["rod"][0], span, 0.1).parts(InFrame())
    ends = [part for part in parts if part.is_rim]
    np.testing.assert_allclose(
        [part.points.mean(axis=0) for part in ends], [(0, 0, 0), (1, 2, 2)], atol=1e-14
    )
    normals = np.array([part.normal for part in ends], dtype=float)
    np.testing.assert_allclose(normals, np.array([(-1, -2, -2), (1, 2, 2)]) / 3)


@pytest.mark.parametrize(("view", "axes"), [("front", [0, 2]), ("side", [1, 2]), ("top", [0, 1])])
def test_that_a_drawing_has_its_true_size_in_a_standard_view(motion, drawn, tmp_path, view, axes):
    path = kc.draw(motion, tmp_path / "drawing.svg", view=view, true_size=True, trace=["tip"])
    root: Any = ET.parse(path).getroot()
    left, top, wide, tall = map(float, root.get("viewBox").split())
    pixel = float(root.get("width").removesuffix("mm")) / wide / 1000
    assert [name.text for name in root.findall(f"{SVG}text")] == ["tip"]
    (traced,) = (path for path in root.iter(f"{SVG}path") if path.get("stroke-width") == "1.5")
    x, y = map(float, traced.get("d").strip("M").split("L")[0].split())
    tip = np.array([motion[f"{axis}_tip"][0] for axis in "xyz"])[axes]
    block = motion.q[0, 14:17][axes]
    corners = [
        np.array([pair.split() for pair in path.get("d").strip("MZ").split("L")], dtype=float)
        for path in root.findall(f"{SVG}path")
        if path.get("stroke", "").startswith("#") and "Z" in path.get("d")
    ]
    assert (left, top) == (0, 0)
    assert tall > 0
    # The block: a square or a rectangle about the slider, with sides of 2 sqrt(2) and 3.6 sizes.
    wanted = (np.subtract(block, tip)) * (1, -1) / pixel + (x, y)
    middles = [(corner.min(axis=0) + corner.max(axis=0)) / 2 for corner in corners]
    assert min(np.linalg.norm(middle - wanted) for middle in middles) < 0.3


def test_what_cannot_be_seen_or_written_is_said(motion, tmp_path):
    with pytest.raises(InputError, match="no view 'back'; views are isometric, front, side, top"):
        kc.draw(motion, tmp_path / "a.svg", view="back")
    plane = kc.Mechanism("plane")
    plane.add(kc.AbsoluteAngle("motor", plane.body("link"), kc.t))
    plane.add(kc.Revolute("pin", plane.ground, (0, 0), plane.bodies[0], (0, 0)))
    flat = kc.solve(kc.compile(plane), [0, 1])
    with pytest.raises(InputError, match="moves in a plane, which has one view"):
        kc.draw(flat, tmp_path / "a.svg", view="top")
    assert list(tmp_path.iterdir()) == []


def test_that_an_svg_shows_one_frame_at_a_time(motion, tmp_path):
    root: Any = ET.parse(kc.animate(motion, tmp_path / "a.svg", seconds=4)).getroot()
    still, moving = root.findall(f"{SVG}g")
    assert (still.get("class"), moving.get("class")) == ("still", "moving")
    shown = []
    for group in moving:
        animate = group.find(f"{SVG}animate")
        assert animate.get("values") == "none;inline;none"
        assert animate.get("dur") == "4s"
        shown.append([float(part) for part in animate.get("keyTimes").split(";")][1:])
    assert shown[0][0] == 0
    assert shown[-1][1] == 1
    assert [end for _, end in shown[:-1]] == [start for start, _ in shown[1:]]
    # The name of the point goes where the point goes.
    scale = [
        (float(group.find(f"{SVG}text").get("x")), float(group.find(f"{SVG}text").get("y")))
        for group in moving
    ]
    tip = np.stack([motion[f"{axis}_tip"] for axis in "xyz"], axis=-1)
    seen = Camera.named("isometric").seen(tip)[:, :2] * (1, -1)
    ways = np.diff(seen, axis=0)
    factor = np.linalg.norm(np.diff(scale, axis=0)) / np.linalg.norm(ways)
    np.testing.assert_allclose(np.diff(scale, axis=0), factor * ways, atol=0.11)


def test_the_standard_views_are_right_handed():
    for view in ("isometric", "front", "side", "top"):
        axes = Camera.named(view).axes
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
        assert np.linalg.det(axes) == pytest.approx(1)


def test_a_dxf_of_faces_on_layers(motion, tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.readfile(kc.draw(motion, tmp_path / "a.dxf"))
    assert document.audit().errors == []
    faces = [item for item in document.modelspace() if item.dxftype() == "3DFACE"]
    assert {item.dxf.layer for item in faces} == {"crank", "rod", "slider", "ground", "joints"}
    crank = np.array(
        [vertex for item in faces if item.dxf.layer == "crank" for vertex in item.wcs_vertices()]
    )
    assert np.abs(crank - (0, 0.1, 0.12)).max() < 0.1
    (path,) = document.modelspace().query("POLYLINE[layer=='paths']")
    tip = np.stack([motion[f"{axis}_tip"] for axis in "xyz"], axis=-1)
    np.testing.assert_allclose([tuple(point) for point in path.points()], tip, atol=1e-12)


def test_matplotlib_in_three_dimensions(motion, tmp_path):
    pytest.importorskip("matplotlib")
    from matplotlib import pyplot as plt

    model = slider_crank()
    ax = kc.plot_mechanism(model, motion.q[5], names=True)
    assert ax.name == "3d"
    texts = {text.get_text().strip(): text.get_position_3d() for text in ax.texts}
    np.testing.assert_allclose(
        texts["tip"], [motion[f"{axis}_tip"][5] for axis in "xyz"], atol=1e-5
    )
    ax.figure.canvas.draw()
    for text in ax.texts:  # beside its place, since nothing leads there
        box = np.array(text.get_window_extent().get_points())
        place = ax.transData.transform(text.get_position())
        assert np.hypot(*(place - np.clip(place, *box))) < 20
    assert kc.animate(motion, tmp_path / "a.gif", seconds=0.2).stat().st_size > 5000
    _, flat = plt.subplots()
    with pytest.raises(InputError, match='give axes made with projection="3d"'):
        kc.plot_mechanism(model, ax=flat)

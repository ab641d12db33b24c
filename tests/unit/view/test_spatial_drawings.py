"""Drawings in space: frames, marks, and the scripts of the page that evaluate them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from kincompile.space.catalogue import CONSTRAINTS
from kincompile.view.drawing import drawing
from kincompile.view.marks import BodyFrame, Symbol, in_ground
from kincompile.view.solid_joints import DRAWINGS
from kincompile.view.solid_shapes import SOLID_LOOKS, SOLIDS
from tests.page_modules import in_node
from tests.spatial_models import slider_crank

FRAME = BodyFrame(0, tuple(range(7)))


@pytest.fixture(scope="module")
def motion():
    model = slider_crank()
    return model, kc.solve(kc.compile(model), np.linspace(0, 1, 41))


def states(count, seed=3):
    return np.random.default_rng(seed).normal(size=(count, 7))


def test_that_a_point_of_a_body_is_where_its_rotation_puts_it():
    q, point = states(20), (0.3, -0.7, 1.1)
    found = in_ground(q, FRAME, point)
    turn = Rotation.from_quat(q[:, [4, 5, 6, 3]])  # of any length
    np.testing.assert_allclose(found, q[:, :3] + turn.apply(point), atol=1e-14)


def test_that_the_page_puts_points_where_python_does():
    q, point = states(20), (0.3, -0.7, 1.1)
    program = """
    import { inFrame, inWorld } from './space.js';
    const frame = { index: 0, columns: [0, 1, 2, 3, 4, 5, 6] };
    const there = given.q.map(q => inWorld(q, frame, given.point));
    const back = given.q.map((q, k) => inFrame(q, frame, there[k]));
    tell({ there, back });"""
    found = in_node(program, {"q": q.tolist(), "point": point})
    np.testing.assert_allclose(found["there"], in_ground(q, FRAME, point), atol=1e-14)
    np.testing.assert_allclose(found["back"], np.tile(point, (20, 1)), atol=1e-13)


def test_that_the_page_has_the_rates_of_a_point(motion):
    _, solution = motion
    frame = BodyFrame(1, tuple(range(7, 14)))
    program = """
    import { ratesInWorld } from './space.js';
    const frame = { index: 1, columns: [7, 8, 9, 10, 11, 12, 13] };
    const rates = given.states.map(state => ratesInWorld(state, frame, given.point));
    tell(rates);"""
    orders = ("q", "q_dot", "q_ddot")
    rows = [
        {order: getattr(solution, order)[k].tolist() for order in orders}
        for k in range(solution.t.size)
    ]
    found = in_node(program, {"states": rows, "point": (0, 0.05, 0)})
    for kind, rate in (("velocity", "_dot"), ("acceleration", "_ddot")):
        known = np.stack([solution[f"{axis}_tip{rate}"] for axis in "xyz"], axis=-1)
        np.testing.assert_allclose([row[kind] for row in found], known, atol=1e-12)
    tip = np.stack([solution[f"{axis}_tip"] for axis in "xyz"], axis=-1)
    np.testing.assert_allclose(in_ground(solution.q, frame, (0, 0.05, 0)), tip, atol=1e-14)


def test_that_every_type_has_a_drawing_and_every_shape_a_look():
    assert set(CONSTRAINTS.values()) == set(DRAWINGS)
    assert {piece.look for pieces in SOLIDS.values() for piece in pieces} <= set(SOLID_LOOKS)


def test_that_marks_have_the_shapes_of_their_joints(motion):
    model, solution = motion
    drawn = drawing(model, q=solution.q)
    assert drawn.dimension == 3
    shapes = {mark["shape"] for mark in drawn.to_json()["marks"]}
    wanted = {"knuckles", "hinge", "ball", "yoke", "track", "block", "turn", "hull", "dot", "gap"}
    assert shapes == wanted
    (rail,) = (m for m in drawn.marks if isinstance(m, Symbol) and m.shape == "track")
    x = solution["x_slider"]
    reach = (min(x.min(), 0) - 3 * drawn.size, x.max() + 3 * drawn.size)
    np.testing.assert_allclose(rail.reach, reach, atol=1e-12)
    extent = drawn.extent(solution.q)
    assert len(extent) == 6
    assert extent[1] - rail.reach[1] == pytest.approx(2 * drawn.size)


def test_that_a_page_in_space_is_one_small_file_and_one_of_the_plane_has_nothing_of_it(motion):
    html = kc.page(*motion).html
    assert len(html) < 1.5e6
    assert "http" not in html.replace("http://www.w3.org/2000/svg", "")
    assert "const orbit = {" in html
    plane = kc.Mechanism("plane")
    plane.add(kc.AbsoluteAngle("motor", plane.body("link"), kc.t))
    assert "const orbit = {" not in kc.page(plane).html


def test_that_a_body_whose_only_point_is_its_origin_is_a_stub_of_a_shaft():
    m = spatial.Mechanism("fan")
    fan, arm = m.body("fan"), m.body("arm", (1, 0, 0))
    m.add(spatial.Revolute("hub", m.ground, (0, 0, 0), (0, 0, 2), fan, (0, 0, 0), (0, 0, 1)))
    m.add(spatial.Revolute("hinge", m.ground, (1, 1, 0), (0, 0, 1), arm, (0, 1, 0), (0, 0, 1)))
    symbols = [mark for mark in drawing(m).marks if isinstance(mark, Symbol)]
    stubs = [mark for mark in symbols if mark.shape == "stub"]
    assert [(mark.place.frame.index, mark.axis) for mark in stubs] == [(0, (0, 0, 1))]

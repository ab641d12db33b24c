"""Strokes of marks: the page's script puts every point where Python puts it."""

import math

import numpy as np
import pytest

from kincompile.view.drawing import drawing
from kincompile.view.marks import BodyFrame, Hull, Rail, Span
from kincompile.view.polylines import of_mark, polylines
from kincompile.view.shapes import LOOKS, SHAPES
from tests.page_modules import in_node

PROGRAM = """
import { fitMarks, ownerOf, Pen } from './draw.js';
import { pointsOfStroke } from './plane.js';
const { drawing, positions } = given;
const pens = positions.map(q => Object.assign(Object.create(Pen.prototype), {
  q, size: drawing.size, unit: drawing.size, view: { scale: 1, toScreen: point => point },
}));
const drawn = pens.map(pen => drawing.marks.flatMap(
  mark => drawing.shapes[mark.shape].map(stroke => pointsOfStroke(pen, mark, stroke))));
const owners = drawing.marks.flatMap(
  mark => drawing.shapes[mark.shape].map(stroke => ownerOf(mark, stroke.on).index));
for (const mark of drawing.marks) Object.assign(mark, { barrel: 0, reach: [0, 0] });
fitMarks({ data: { drawing }, seen: positions.map(q => ({ q })) });
const fitted = drawing.marks.map(({ barrel, reach }) => [barrel, reach]);
tell({ drawn, owners, fitted });
"""


def in_the_page(drawn, positions):
    """Return what the page's modules make of a drawing."""
    return in_node(PROGRAM, {"drawing": drawn.to_json(), "positions": positions.tolist()})


def as_array(points):
    return np.array([point or (math.nan, math.nan) for point in points], dtype=float)


@pytest.mark.every(5)
def test_that_the_page_draws_the_points_that_python_draws(example):
    q = example.solution.q[example.solution.good]
    drawn = drawing(example.model, q=q)
    if not drawn.bodies:
        return
    found = in_the_page(drawn, q[::30])
    for position, strokes in zip(q[::30], found["drawn"], strict=True):
        for line, points in zip(polylines(drawn), strokes, strict=True):
            expected = line.at(position)
            np.testing.assert_allclose(as_array(points), expected, atol=1e-9 * drawn.size)
    assert found["owners"] == [line.frame.index for line in polylines(drawn)]


@pytest.mark.slow
def test_that_rails_and_barrels_are_fitted_to_a_motion_as_python_fits_them(example):
    q = example.solution.q[example.solution.good]
    drawn = drawing(example.model, q=q)
    if not drawn.bodies:
        return
    fitted = in_the_page(drawn, q)["fitted"]
    for mark, (barrel, reach) in zip(drawn.marks, fitted, strict=True):
        if isinstance(mark, Rail):
            np.testing.assert_allclose(reach, mark.reach, atol=1e-9 * drawn.size)
        if isinstance(mark, Span) and mark.style == "cylinder":
            assert barrel == pytest.approx(mark.barrel, rel=1e-9)


def test_that_every_stroke_has_a_look():
    assert {stroke.look for strokes in SHAPES.values() for stroke in strokes} == set(LOOKS)


def test_that_a_link_is_wider_than_the_hull_of_its_joints_by_a_size():
    triangle = Hull(BodyFrame(0, (0, 1, 2)), ((0.0, 0.0), (4.0, 0.0), (0.0, 3.0)))
    (line,) = of_mark(triangle, 0.5)
    points = line.at(np.zeros(3))
    assert line.is_area
    sides = [((0, -1), 0.0), ((-1, 0), 0.0), ((0.6, 0.8), 2.4)]  # outward normals and distances
    beyond = np.max([points @ np.array(normal) - far for normal, far in sides], axis=0)
    assert beyond.max() == pytest.approx(0.5, abs=1e-12)
    corners = np.array(triangle.points)
    to_corner = np.hypot(*(points[:, None] - corners).transpose(2, 0, 1)).min(axis=1)
    np.testing.assert_allclose(to_corner, 0.5, rtol=1e-12)

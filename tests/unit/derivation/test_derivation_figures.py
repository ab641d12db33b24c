"""Figures of a derivation: vectors begin and end where the equation says."""

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kincompile as kc
from kincompile import spatial
from kincompile.derivations.evaluation import evaluation
from kincompile.derivations.figures import Figures
from kincompile.model.constraint import Constraint
from kincompile.report.document import Figure
from kincompile.report.figure import as_svg
from kincompile.space.catalogue import CONSTRAINTS
from kincompile.view.picture import Arrow
from kincompile.view.solid_picture import ISOMETRIC
from tests.unit.spatial import test_golden_rows as golden


def offset_slider() -> kc.Mechanism:
    """Return one body on a slanted guide, with a driven distance to a point of the ground."""
    m = kc.Mechanism("offset")
    body = m.body("block", guess=(3.0, 1.0, 0.5))
    m.add(kc.Translational("guide", m.ground, (0.5, 1.0), (3, 1), body, (0.2, -0.1), (3, 1)))
    m.add(kc.Distance("rod", m.ground, (-1, 2), body, (0.4, 0.3), 3 + kc.t))
    return m


STATE = {"x_block": 2.0, "y_block": 1.5, "phi_block": 0.4}


def arrows_of(name: str) -> dict[str, Arrow]:
    """Return the vectors of a constraint at the state, by name."""
    figures = Figures(evaluation(offset_slider().system(), STATE))
    joint = next(item for item in figures.evaluation.system.constraints if item.name == name)
    return {arrow.name: arrow for arrow in figures.vectors(joint)}  # type: ignore[arg-type]


def turned(x: float, y: float) -> Any:
    c, s = np.cos(0.4), np.sin(0.4)
    return np.array((c * x - s * y, s * x + c * y))


def test_that_vectors_begin_and_end_where_the_equation_says() -> None:
    arrows = arrows_of("guide")
    origin = np.array((2.0, 1.5))
    assert set(arrows) == {"r_j", "s_i", "s_j", "v_i", "v_j", "d"}
    for name, start, end in (
        ("r_j", (0, 0), origin),
        ("s_i", (0, 0), (0.5, 1.0)),
        ("s_j", origin, origin + turned(0.2, -0.1)),
        ("d", (0.5, 1.0), origin + turned(0.2, -0.1)),
    ):
        np.testing.assert_allclose(arrows[name].start, start, atol=1e-12)
        np.testing.assert_allclose(arrows[name].end, end, atol=1e-12)
    way = arrows["v_j"].end - arrows["v_j"].start
    np.testing.assert_allclose(way / np.hypot(*way), turned(3, 1) / np.sqrt(10), atol=1e-12)
    np.testing.assert_allclose(arrows["v_j"].start, origin + turned(0.2, -0.1), atol=1e-12)


def test_that_a_vector_of_no_length_is_not_drawn() -> None:
    m = kc.Mechanism("pinned")
    body = m.body("arm", guess=(0, 0, 0.3))
    m.add(kc.Revolute("A", m.ground, (0, 0), body, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", body, kc.t))
    figures = Figures(evaluation(m.system(), 0.3))
    joint = figures.evaluation.system.constraints[0]
    assert list(figures.vectors(joint)) == []  # type: ignore[arg-type]


def test_that_a_figure_is_an_image_with_its_symbols() -> None:
    figures = Figures(evaluation(offset_slider().system(), STATE))
    joint = figures.evaluation.system.constraints[0]
    element = ET.fromstring(as_svg(figures.joint(joint)))  # type: ignore[arg-type]
    labels = {"".join(item.itertext()) for item in element.iter("text")}
    bold_d, bold_s = "\N{MATHEMATICAL BOLD SMALL D}", "\N{MATHEMATICAL BOLD SMALL S}"
    assert {bold_d, f"{bold_s}\N{MATHEMATICAL ITALIC SMALL I}\N{PRIME}"} <= labels
    width, height = float(element.get("width", 0)), float(element.get("height", 0))
    for item in element.iter("text"):
        assert 0 < float(item.get("x", -1)) < width
        assert 0 < float(item.get("y", -1)) < height


@pytest.mark.slow
def test_that_each_joint_has_a_figure_and_the_mechanism_one(gallery: Any, sections_of: Any) -> None:
    derivation = kc.derivation(gallery)
    count = sum(
        isinstance(block, Figure) for section in sections_of(derivation) for block in section.blocks
    )
    joints = [item for item in gallery.system().constraints if item.name not in ("free", "pieces")]
    assert count == len(joints) + 1
    assert derivation.to_html().count('<svg class="figure"') == count
    assert derivation.to_latex().count(r"\begin{picture}") == count
    assert derivation.to_notebook().count("data:image/svg+xml") == count


def test_that_equations_without_bodies_have_no_figure(example_named: Any) -> None:
    assert "<figure>" not in kc.derivation(example_named("problem_3_5_6").model).to_html()


@pytest.mark.parametrize("name", ["wrecker_boom", "gear_train", "cam_flat_follower"])
def test_that_nothing_of_a_picture_is_outside_it(name: str, example_named: Any) -> None:
    figures = Figures(evaluation(example_named(name).model.system(), 0.2))
    shown = figures.mechanism()
    assert shown is not None
    for path in shown.paths:
        x, y = np.asarray(path.points).T
        assert -1 < x.min() <= x.max() < shown.width + 1
        assert -1 < y.min() <= y.max() < shown.height + 1


def centre_of_ring(path: Any) -> Any:
    """Return the centre of a path that is a small circle, as the eye of a pin is; else None."""
    points = np.asarray(path.points)
    centre = points[:-1].mean(axis=0)
    radii = np.hypot(*(points - centre).T)
    is_ring = len(points) > 8 and np.ptp(radii) < 0.1 * radii.max() and radii.max() < 6
    return centre if is_ring else None


@pytest.mark.parametrize("name", ["four_bar", "inverted_slider_crank", "wrecker_boom"])
def test_that_no_label_of_an_axis_lies_on_a_pin(name: str, example_named: Any) -> None:
    shown = Figures(evaluation(example_named(name).model.system(), 0.0)).mechanism()
    assert shown is not None
    centres = (centre_of_ring(path) for path in shown.paths)
    pins = np.array([centre for centre in centres if centre is not None])
    assert len(pins) > 2
    places = np.array([(label.x, label.y) for label in shown.labels])
    distances = np.hypot(*(places[:, None] - pins).T)
    assert distances.min() >= 17


@pytest.fixture(scope="module")
def in_space() -> Figures:
    """Return the figures of one constraint of each type in space, at the golden state."""
    found = {}
    for case, make in golden.CASES.items():
        for item in make():
            if isinstance(item, Constraint) and case != "dot2_reversed":
                kind = CONSTRAINTS[
                    next(x.__name__ for x in type(item).__mro__ if x.__name__ in CONSTRAINTS)
                ]
                values = {name: getattr(item, name) for name in kind.arguments()}
                found[kind.__name__] = kind(name=kind.__name__, **values)
    turning = found["RelativeRotation"]
    values = {name: getattr(turning, name) for name in CONSTRAINTS["JointAngle"].arguments()}
    found["JointAngle"] = CONSTRAINTS["JointAngle"](name="JointAngle", **values)
    assert found.keys() == CONSTRAINTS.keys() - {"Normalization"}
    m = golden.mechanism(list(found.values()))
    names = [item.name for item in m.system().coordinates]
    numbers = [*golden.Q, *(0.3 for _ in names[len(golden.Q) :])]
    return Figures(evaluation(m.system(), dict(zip(names, numbers, strict=True))))


def joint_of(figures: Figures, name: str) -> Any:
    return next(item for item in figures.evaluation.system.constraints if item.name == name)


@pytest.mark.every(5)
@pytest.mark.parametrize("name", sorted(CONSTRAINTS.keys() - {"Normalization"}))
def test_that_each_type_in_space_has_the_vectors_of_its_equation(
    name: str, in_space: Figures
) -> None:
    joint, given = joint_of(in_space, name), golden.GIVEN
    turns = {key: Rotation.from_quat(given[f"p_{key}"], scalar_first=True) for key in "ij"}
    arrows = {arrow.name: arrow for arrow in in_space.vectors(joint)}
    for key, arrow in arrows.items():
        letter, _, index = key.partition("_")
        if letter == "r":
            np.testing.assert_allclose(arrow.end, given[key], atol=1e-12)
        elif letter == "s" and not joint.bodies["ij".index(index)].is_ground:
            np.testing.assert_allclose(arrow.start, given[f"r_{index}"], atol=1e-12)
            way = turns[index].apply(given[key])
            np.testing.assert_allclose(arrow.end - arrow.start, way, atol=1e-12)
        elif letter in ("h", "f", "g") and len(joint.bodies) > 1:
            local = np.array(joint.points[key], dtype=float)
            way, drawn = turns[index].apply(local), arrow.end - arrow.start
            np.testing.assert_allclose(drawn / np.linalg.norm(drawn), way, atol=1e-12)
    ways = {key: arrow.end - arrow.start for key, arrow in arrows.items()}
    if {"d", "s_j", "r_j"} <= arrows.keys():
        reach = [ways[f"r_{key}"] + ways[f"s_{key}"] for key in "ij"]
        np.testing.assert_allclose(ways["d"], reach[1] - reach[0], atol=1e-12)
    picture = in_space.joint(joint)
    assert picture is not None
    shown = {label.name for label in picture.labels}
    assert shown >= arrows.keys() | {"x_i", "y_i", "z_i"}


def test_that_a_figure_in_space_is_seen_from_one_side(in_space: Figures) -> None:
    """Vectors of the picture are those of space, to the right and up, by one scale."""
    joint = joint_of(in_space, "Revolute")
    picture = in_space.joint(joint)
    assert picture is not None
    arrows = [*in_space.vectors(joint)]
    drawn = [np.asarray(path.points) for path in picture.paths if not path.stroke][: len(arrows)]
    tips = np.array([points[0] for points in drawn])
    ends = np.array([ISOMETRIC.seen(arrow.end)[:2] for arrow in arrows])
    scale = (tips[1] - tips[0]) / (ends[1] - ends[0])
    np.testing.assert_allclose(scale[0], scale[1], rtol=1e-9)
    np.testing.assert_allclose(tips - tips[0], scale * (ends - ends[0]), atol=1e-9)


def test_that_a_direction_on_another_is_shorter_and_others_are_left_out() -> None:
    m = spatial.Mechanism("pair")
    arm, hand = m.body("arm", (0.2, 0, 0)), m.body("hand", (0.5, 0, 0))
    far = m.body("far", (0, 9, 0))
    z, end = (0, 0, 1), (0.1, 0, 0)
    m.add(spatial.Revolute("elbow", arm, end, z, hand, (-0.2, 0, 0), z))
    m.add(spatial.Spherical("away", arm, end, far, (0, -9, 0)))
    state = {item.name: item.guess for item in m.system().coordinates}
    figures = Figures(evaluation(m.system(), state))
    joint = joint_of(figures, "elbow")
    lengths = {x.name: np.linalg.norm(x.end - x.start) for x in figures.vectors(joint)}
    assert lengths["h_j"] < lengths["h_i"] == pytest.approx(lengths["g_i"])
    picture, whole = figures.joint(joint), figures.mechanism()
    assert picture is not None
    assert whole is not None
    assert len(picture.paths) < len(whole.paths)
    assert figures.joint(joint_of(figures, "norm_arm")) is None


def test_that_an_axis_along_the_view_has_its_name_and_no_warning() -> None:
    m = spatial.Mechanism("seen")
    towards = ISOMETRIC.axes[2]
    wheel = m.body("wheel", (0.2, 0, 0))
    m.add(spatial.Revolute("hub", m.ground, (0, 0, 0), towards, wheel, (-0.2, 0, 0), towards))
    m.add(spatial.JointAngle("turn", m.ground, towards, (1, 1, 0), wheel, towards, (1, 1, 0)))
    figures = Figures(evaluation(m.system(), {x.name: x.guess for x in m.system().coordinates}))
    picture = figures.joint(joint_of(figures, "hub"))
    assert picture is not None
    label = next(item for item in picture.labels if item.name == "h_i")
    assert np.isfinite((label.x, label.y)).all()
    for path in picture.paths:
        assert np.isfinite(path.points).all()

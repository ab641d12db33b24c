"""Pictures as SVG, at a time and in motion: read as XML, frame by frame, against closed forms."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import kincompile as kc
from kincompile.view.drawing import drawing
from kincompile.view.svg import as_svg

EXAMPLES = Path(__file__).parents[3] / "examples"
SVG = "{http://www.w3.org/2000/svg}"
NUMBER = r"-?\d+(?:\.\d+)?"
PIXELS = 0.02
"""Rounding of a coordinate, a shift and a turn, together."""


@pytest.fixture(scope="module")
def arm():
    """An arm of 2 m about the origin, turned by t^2, and a ram that holds its end."""
    m = kc.Mechanism("arm", length_unit="cm")
    bar = m.body("bar", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, 0.3 + kc.t**2))
    m.point("tip", bar, (1, 0))
    m.point("side", bar, (0, 0.5))
    m.point("heel", bar, (-1, -0.25))
    return m


@pytest.fixture(scope="module")
def motion(arm):
    return kc.solve(kc.compile(arm), np.linspace(0, 2, 41))


def expected(t):
    """Return where tip, side and heel are at a time, shape (3, 2)."""
    turn = np.exp(1j * (0.3 + t**2))
    places = turn * (1 + np.array((1, 0.5j, -1 - 0.25j)))
    return np.stack((places.real, places.imag), axis=-1)


def points_of(data):
    """Return the corners in the data of a path."""
    return np.array(re.findall(rf"[ML]({NUMBER}) ({NUMBER})", data), dtype=float)


def frame_of(element, part, frame):
    """Return the transform that an animation has at one of its frames, as an affine map."""
    matrix = np.eye(3)
    for change in element.findall(f"{SVG}animateTransform"):
        numbers = [float(x) for x in re.split("[ ;]", change.get("values"))]
        step = np.eye(3)
        if change.get("type") == "translate":
            assert change.get("additive") == "replace"
            step[:2, 2] = np.reshape(numbers, (-1, 2))[frame]
        else:
            assert (change.get("type"), change.get("additive")) == ("rotate", "sum")
            angle = np.radians(numbers[frame])
            step[:2, :2] = ((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle)))
        matrix = matrix @ step
    return part @ matrix


def shown(root, kind, frame=0):
    """Return the corners [px] of each path whose class is `kind`, at a frame of the motion."""
    found = []

    def visit(element, outer):
        if element.get("class") == "still":
            return
        if element.tag == f"{SVG}g":
            outer = frame_of(element, outer, frame)
        if element.tag == f"{SVG}path" and element.get("class") == kind:
            moving = element.find(f"{SVG}animate")
            data = element.get("d") if moving is None else moving.get("values").split(";")[frame]
            found.append(points_of(data) @ outer[:2, :2].T + outer[:2, 2])
        for child in element:
            visit(child, outer)

    visit(root, np.eye(3))
    return found


def dots(root, frame=0):
    """Return the centres [px] of named points, as complex numbers with y upwards."""
    x, y = np.array([corners.mean(axis=0) for corners in shown(root, "s-ink f-ink", frame)]).T
    return x - 1j * y


def scale_of(places, pixels):
    """Return pixels a unit of length, by the first two points, as a complex number."""
    (x0, y0), (x1, y1) = places[:2]
    return (pixels[1] - pixels[0]) / complex(x1 - x0, y1 - y0)


def written(call, tmp_path, *arguments, **options):
    path = call(*arguments[:1], tmp_path / "picture.svg", *arguments[1:], **options)
    text = path.read_text(encoding="utf-8")
    assert "<script" not in text
    assert "href" not in text
    return ET.fromstring(text)


def test_that_a_picture_has_the_positions_of_the_solution(motion, tmp_path):
    root = written(kc.draw, tmp_path, motion, 1.5)
    places, pixels = expected(1.5), dots(root)
    scale = scale_of(places, pixels)
    assert abs(scale.imag) < 1e-3 * scale.real  # upright, and not mirrored
    apart = pixels - pixels[0] - scale * ((places - places[0]) @ (1, 1j))
    assert np.abs(apart).max() < PIXELS


@pytest.mark.parametrize("times", [np.linspace(0, 2, 41), np.linspace(0, 2, 401) ** 2 / 2])
def test_that_every_frame_is_a_position_of_the_solution(arm, tmp_path, times):
    root = written(kc.animate, tmp_path, kc.solve(kc.compile(arm), times))
    moving = next(root.iter(f"{SVG}animateTransform"))
    count = moving.get("values").count(";") + 1
    given = moving.get("keyTimes")
    parts = np.array(given.split(";"), dtype=float) if given else np.linspace(0, 1, count)
    assert (parts[0], parts[-1], len(parts)) == (0, 1, count)
    shots = [dots(root, frame) for frame in range(count)]
    scale = scale_of(expected(2 * parts[0]), shots[0])
    fixed = shots[0][0] - scale * (expected(0.0)[0] @ (1, 1j))
    # keyTimes have five digits, and nothing is faster than 9 units a second
    allowed = 0.1 + 20 * 1e-5 * abs(scale)
    for part, pixels in zip(parts, shots, strict=True):
        places = fixed + scale * (expected(2 * part) @ (1, 1j))
        assert np.abs(pixels - places).max() < allowed
    hulls = [shown(root, "s-body0 f-pale-body0", frame)[0] @ (1, -1j) for frame in range(count)]
    for part, hull in zip(parts, hulls, strict=True):
        turned = fixed + np.exp(4j * part**2) * (hulls[0] - fixed)
        assert np.abs(hull - turned).max() < allowed


def test_that_what_does_not_change_its_shape_is_written_once(motion, tmp_path):
    root = written(kc.animate, tmp_path, motion)
    assert next(root.iter(f"{SVG}animate"), None) is None
    moving = next(item for item in root.iter(f"{SVG}g") if item.get("class") == "moving")
    still = next(item for item in root.iter(f"{SVG}g") if item.get("class") == "still")
    assert len(list(moving.iter(f"{SVG}path"))) == len(list(still.iter(f"{SVG}path")))


def test_that_the_playing_time_is_that_of_the_motion_or_as_given(motion, tmp_path):
    for options, seconds in (({}, "2s"), ({"seconds": 7.5}, "7.5s")):
        root = written(kc.animate, tmp_path, motion, **options)
        durations = {item.get("dur") for item in root.iter(f"{SVG}animateTransform")}
        assert durations == {seconds}


def test_that_a_cylinder_changes_its_length(tmp_path):
    m = kc.Mechanism("ram")
    bar = m.body("bar", guess=(0, 3, np.pi / 2))
    m.add(kc.Translational("guide", m.ground, (0, 0), (0, 1), bar, (0, 0), (1, 0)))
    m.add(kc.AbsoluteDistance("ram", bar, (0, 0), (0, 0), 3 + kc.t))
    m.point("end", bar, (0, 0))
    m.point("beside", bar, (0, 1))
    root = written(kc.animate, tmp_path, kc.solve(kc.compile(m), np.linspace(0, 2, 11)))
    animated = [item.find(f"{SVG}animate") for item in root.iter(f"{SVG}path")]
    (changing,) = [item for item in animated if item is not None]
    lengths = [np.ptp(points_of(data)[:, 1]) for data in changing.get("values").split(";")]
    first, last = dots(root, 0), dots(root, 10)
    unit = abs(first[1] - first[0])
    assert abs(last[0] - first[0]) == pytest.approx(2 * unit, abs=PIXELS)
    np.testing.assert_allclose(np.diff(lengths), 0.2 * unit, atol=PIXELS)


def test_that_a_path_goes_through_the_positions(motion, tmp_path):
    root = written(kc.draw, tmp_path, motion, 1.5, trace=["tip"])
    places, pixels = expected(1.5), dots(root)
    scale = scale_of(places, pixels)
    (path,) = shown(root, "s-body4")
    along = path[:, 0] - 1j * path[:, 1]
    wanted = np.array([expected(t)[0] for t in motion.t]) @ (1, 1j)
    apart = along - pixels[0] - scale * (wanted - places[0] @ (1, 1j))
    assert np.abs(apart).max() < PIXELS


def test_that_a_picture_has_words_for_those_who_cannot_see_it(motion, tmp_path):
    root = written(kc.draw, tmp_path, motion, 0.5)
    named = root.get("aria-labelledby").split()
    texts = [item.text for item in root if item.get("id") in named]
    assert texts == ["arm", "arm at t = 0.5 s: 1 body, bar; constraints pin, motor."]
    assert [item.text for item in root.iter(f"{SVG}text")] == ["tip", "side", "heel"]


def test_that_those_who_do_not_want_motion_have_the_first_frame(motion, tmp_path):
    root = written(kc.animate, tmp_path, motion)
    still = next(item for item in root.iter(f"{SVG}g") if item.get("class") == "still")
    assert still.get("display") == "none"
    assert "prefers-reduced-motion:reduce){.moving{display:none}.still{display:inline}}" in "".join(
        item.text for item in root.iter(f"{SVG}style")
    )
    assert not list(still.iter(f"{SVG}animateTransform"))


def test_that_the_true_size_is_that_of_the_mechanism(motion, tmp_path):
    root = written(kc.draw, tmp_path, motion, 0.5, true_size=True)
    wide = float(root.get("width").removesuffix("mm"))
    pixels = float(root.get("viewBox").split()[2])
    scale = scale_of(expected(0.5), dots(root)).real
    assert wide / pixels * scale == pytest.approx(10, rel=1e-4)  # a unit is a centimetre


def test_that_what_stops_is_shown_as_far_as_it_goes(tmp_path):
    m = kc.Mechanism("stops")
    bar = m.body("bar", guess=(0.5, 0.8, 1))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (-1, 0)))
    m.add(kc.AbsoluteX("pull", bar, (1, 0), 1 + kc.t))
    solution = kc.solve(kc.compile(m), np.linspace(0, 2, 21))
    assert not solution.success
    root = written(kc.animate, tmp_path, solution, trace=["bar"])
    moving = next(root.iter(f"{SVG}animateTransform"))
    assert moving.get("values").count(";") + 1 == np.count_nonzero(solution.good)
    with pytest.raises(kc.InputError, match=r"stops has no position at t = 2\. stops failed"):
        kc.draw(solution, tmp_path / "picture.svg", 2.0)


def test_that_an_open_joint_is_drawn_as_such(arm):
    drawn = drawing(arm)
    closed = ET.fromstring(as_svg(drawn, np.array([[1, 0, 0.0]]), ""))
    apart = ET.fromstring(as_svg(drawn, np.array([[2, 0, 0.0]]), ""))
    assert (len(shown(closed, "s-bad")), len(shown(apart, "s-bad"))) == (0, 1)


@pytest.mark.parametrize(
    "name", ["jansen", "gear_train", "wrecker_boom", "slot_follower", "shaper"]
)
def test_that_a_picture_in_motion_begins_as_the_still_one(name, tmp_path):
    model = kc.read_model(EXAMPLES / f"{name}.toml")
    solution = kc.solve(kc.compile(model), np.linspace(0, model.system().end, 9))
    root = written(kc.animate, tmp_path, solution)
    still = next(item for item in root.iter(f"{SVG}g") if item.get("class") == "still")
    kinds = {item.get("class") for item in still.iter(f"{SVG}path")}
    assert len(kinds) > 5
    for kind in kinds:
        moving = shown(root, kind)
        fixed = [
            points_of(item.get("d"))
            for item in still.iter(f"{SVG}path")
            if item.get("class") == kind
        ]
        assert len(moving) == len(fixed)
        for one, other in zip(moving, fixed, strict=True):
            np.testing.assert_allclose(one, other, rtol=0, atol=0.1)  # turns have two digits


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("a.png",), r"cannot write a\.png: end its name in \.svg or \.dxf"),
        (("no/such/a.svg",), "the folder .*such does not exist"),
        (("a.svg", 0.51), r"t = 0\.51 is not among its 41 times; the nearest is 0\.5:"),
        (("a.svg", 3.0), "solved from t = 0 to 2, and t = 3 is not among"),
        (("a.svg", float("nan")), "t = nan is not among"),
    ],
)
def test_that_what_cannot_be_drawn_is_told(motion, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(kc.InputError, match=message):
        kc.draw(motion, *arguments)
    assert list(tmp_path.iterdir()) == []


def test_that_a_unit_without_a_size_and_a_name_without_a_place_are_told(tmp_path):
    m = kc.Mechanism("arm", length_unit="cubits")
    bar = m.body("bar", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, kc.t))
    solution = kc.solve(kc.compile(m), [0.0, 1.0])
    with pytest.raises(kc.InputError, match="unit of length of arm is 'cubits': a true size needs"):
        kc.draw(solution, tmp_path / "a.svg", true_size=True)
    with pytest.raises(kc.InputError, match="nothing called 'bat' to trace; did you mean 'bar'"):
        kc.draw(solution, tmp_path / "a.svg", trace=["bat"])
    with pytest.raises(kc.InputError, match=r"seconds is 0: give the length"):
        kc.animate(solution, tmp_path / "a.svg", seconds=0)

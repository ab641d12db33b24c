"""Outlines of bodies: checked with the model, kept in files, without a trace in what is emitted."""

import numpy as np
import pytest

import kincompile as kc

CORNERS = ((0, 0), (1, 0), (0, 0.5))


def arm(outline):
    m = kc.Mechanism("arm")
    a = m.parameter("a", 2.0)
    body = m.body("arm", guess=(1, 0, 0.5), outline=outline(a) if callable(outline) else outline)
    m.add(kc.Revolute("pin", body, (-1, 0), m.ground, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", body, kc.t))
    return m


def test_that_an_outline_changes_nothing_that_is_emitted():
    assert kc.emit(arm(CORNERS)).source == kc.emit(arm(())).source


@pytest.mark.parametrize("form", ["toml", "json"])
def test_that_an_outline_is_kept_in_a_file(form, tmp_path):
    m = arm(lambda a: [(0, 0), (a, 0), (0, a / 2)])
    path = tmp_path / f"arm.{form}"
    path.write_text(m.to_toml() if form == "toml" else m.to_json())
    (body,) = kc.read(path).bodies
    a = kc.Mechanism("names").parameter("a")
    assert body.outline == ((0, 0), (a, 0), (0, a / 2))


def test_that_example_and_data_file_have_the_same_outlines(example):
    written, read = (
        np.array([corner for body in model.system().bodies for corner in body.outline], dtype=float)
        for model in (example.model, kc.read(example.path.with_suffix(".toml")))
    )
    np.testing.assert_array_equal(written, read)


def test_that_an_array_is_an_outline():
    m = arm(np.array(CORNERS))
    assert "outline = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.5]]" in m.to_toml()


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        (5, r"outline of arm: 5 is not a list of corners \(xi, eta\)"),
        (
            [(0, 0), 3, (1, 0)],
            r"outline of arm: \[\(0, 0\), 3, \(1, 0\)\] is not a list of corners",
        ),
        ([(0, 0), (1, 0)], "outline of arm: it has 2 corners; a polygon has 3 or more"),
        ([(0, 0), (1, 0), (1, 2, 3)], r"corner 3, \(1, 2, 3\), is not a pair"),
        ([(0, 0), (1, 0), (0, "b")], "outline of arm, corner 3: 'b' is not a number"),
        ([(0, 0), (1, 0), (0, kc.t)], "outline of arm, corner 3: t is not a number at the default"),
    ],
)
def test_that_a_wrong_outline_is_told(outline, message):
    with pytest.raises(kc.ModelError, match=message):
        arm(outline).system()


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        ("3", "line 9: body 'arm', outline: expected a list of corners"),
        ("[[0, 0], [1], [0, 1]]", r"line 9: body 'arm', outline, entry 2: expected \[xi, eta\]"),
        (
            "[[0, 0], [1, 1]]",
            r"line 9: body 'arm', outline: expected .* corners .*, 3 or more, not a list of 2",
        ),
    ],
)
def test_that_a_wrong_outline_in_a_file_is_told_with_its_line(tmp_path, outline, message):
    path = tmp_path / "arm.toml"
    text = arm(CORNERS).to_toml()
    old = "[[0, 0], [1, 0], [0, 0.5]]"
    assert old in text
    path.write_text(text.replace(old, outline))
    with pytest.raises(kc.ModelError, match=message):
        kc.read(path)

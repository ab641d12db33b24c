"""docs/joints.md: it is that of the catalogue, and its senses are those of the equations."""

import re

import numpy as np
import pytest

import kincompile as kc
from docs.builders import joints
from docs.builders.places import DOCS
from kincompile.model.catalogue import CONSTRAINTS

TYPES = [pytest.param(kind, id=name) for name, kind in CONSTRAINTS.items()]


def test_that_the_page_follows_from_the_catalogue(request):
    page = joints.page()
    if request.config.getoption("--update-goldens"):
        (DOCS / "joints.md").write_text(page, encoding="utf-8")
    kept = (DOCS / "joints.md").read_text(encoding="utf-8")
    assert kept == page, "make pictures writes it anew, if it is meant"


@pytest.mark.parametrize("kind", TYPES)
def test_that_a_type_says_what_it_is(kind):
    assert all((kind.known_as, kind.positive, *kind.use))
    assert f"kc.{kind.__name__}(" in kind.use[1]
    assert len(joints.assembled(joints.mechanism_of(kind))) >= 3
    assert (DOCS / "images" / f"joint_{kind.__name__}.svg").exists()


@pytest.mark.parametrize("name", joints.PICTURED)
def test_that_a_type_in_space_has_its_picture(name):
    text = (DOCS / "images" / f"space_{name}.svg").read_text(encoding="utf-8")
    assert "<title>joint: the vectors of its equation" in text


def moved(name, way):
    """Return how Phi of a type changes, to first order, when its bodies are moved."""
    m = joints.mechanism_of(CONSTRAINTS[name])
    module = kc.compile(m)
    q = np.array(list(joints.assembled(m).values()))
    step = 1e-6 * np.array(way(q))
    return (module.Phi(q + step, 0.0) - module.Phi(q - step, 0.0)) / 2e-6


def left_of_the_axis(q):
    return [0, 0, 0, -np.sin(q[2]), np.cos(q[2]), 0]


def along_the_axis(q):
    return [0, 0, 0, np.cos(q[2]), np.sin(q[2]), 0]


@pytest.mark.parametrize(
    ("name", "way"),
    [
        ("AbsoluteX", lambda q: [1, 0, 0]),
        ("AbsoluteY", lambda q: [0, 1, 0]),
        ("AbsoluteAngle", lambda q: [0, 0, 1]),
        ("RelativeX", lambda q: [0, 0, 0, 1, 0, 0]),
        ("RelativeY", lambda q: [0, 0, 0, 0, 1, 0]),
        ("RelativeAngle", lambda q: [0, 0, 0, 0, 0, 1]),
        ("RevoluteTranslational", left_of_the_axis),
        ("TranslationalDistance", along_the_axis),
    ],
)
def test_that_a_value_grows_in_the_direction_that_is_said(name, way):
    """Phi is what is measured minus C: it grows as what is measured does, as fast."""
    np.testing.assert_allclose(moved(name, way), [1], rtol=1e-6)


def test_that_a_pinion_turns_clockwise_from_p_to_q():
    """On a rack along x, a way s to Q turns the pinion by -s / R."""

    def rolled(q):
        x, y = np.cos(q[2]), np.sin(q[2])
        return [0, 0, 0, x, y, -1 / 0.6]

    np.testing.assert_allclose(moved("RackAndPinion", rolled), [0, 0], atol=1e-6)


@pytest.mark.parametrize(("radius", "ratio"), [(1.0, -0.5), (-1.0, 0.5)])
def test_that_external_gears_turn_opposite_ways_and_internal_ones_alike(radius, ratio):
    m = kc.Mechanism("gears")
    small, large = m.body("small", guess=(0, 0, 0)), m.body("large", guess=(0.5 + radius, 0, 0))
    m.add(kc.Gear("mesh", small, (0, 0), 0.5, 0, large, (0, 0), radius, kc.pi))
    Phi_q = kc.compile(m).Phi_q(np.array([0, 0, 0, 0.5 + radius, 0, 0]), 0.0)[0]
    assert Phi_q[5] != 0
    np.testing.assert_allclose(-Phi_q[2] / Phi_q[5], ratio, rtol=1e-12)


@pytest.mark.slow
def test_that_the_pictures_are_those_of_the_catalogue():
    for name, drawn in joints.pictures().items():
        kept = (DOCS / "images" / name).read_text(encoding="utf-8")
        assert re.sub(r"[\d.]+", "", kept) == re.sub(r"[\d.]+", "", drawn)
        before, now = (np.array(re.findall(r"\d+\.?\d*", text), float) for text in (kept, drawn))
        np.testing.assert_allclose(before, now, atol=0.15)

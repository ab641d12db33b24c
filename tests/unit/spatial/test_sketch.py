"""Drawings in space: links from hardpoints, hinges and balls by what links share."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import kincompile as kc
from kincompile import spatial

EXAMPLE = Path(__file__).parents[3] / "examples" / "space" / "double_wishbone_with_steering.py"


def four_bar() -> spatial.Sketch:
    """Return a crank on a drawn hinge, a coupler of two balls and a rocker on two points."""
    s = spatial.Sketch("spatial_four_bar", end=2.0)
    r = s.length("r", 0.1)
    s.ground(O=(0, 0, 0), P=(0.3, -0.05, -0.12), Q=(0.3, 0.05, -0.12))
    s.joints(A=(r, 0, 0), B=(0.3, 0, 0.13))
    s.hinges(O=(0, 0, 2))
    s.link("crank", "O A")
    s.link("rocker", "P Q B")
    s.rod("rod", "A B", 0.32)
    s.drive("crank", kc.pi * kc.t)
    return s


def test_that_hinges_and_balls_follow_from_what_links_share() -> None:
    s = four_bar()
    kinds = {item.name: type(item).__name__ for item in s.mechanism().constraints}
    assert kinds == {
        "O": "Revolute", "P_Q": "Revolute", "rod": "Distance", "drive_crank": "RelativeRotation",
    }  # fmt: skip
    for r in (0.1, 0.07):
        found = kc.solve(kc.compile(s.mechanism()), np.linspace(0, 2, 25), {"r": r})
        assert found.success
        pin = np.array([r * np.cos(np.pi * found.t), r * np.sin(np.pi * found.t), 0 * found.t])
        end = np.array([found[f"B.{axis}"] for axis in "xyz"])
        np.testing.assert_allclose(np.linalg.norm(end - pin, axis=0), 0.32, rtol=1e-12)
        np.testing.assert_allclose(end[1], 0, rtol=0, atol=1e-13)
        reach = np.hypot(end[0] - 0.3, end[2] + 0.12)
        np.testing.assert_allclose(reach, 0.25, rtol=1e-12)


def test_that_a_double_wishbone_takes_twenty_lines() -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    drawn = text[text.index("s = spatial") : text.index("spin, foot")]
    assert len([line for line in drawn.splitlines() if line.strip()]) <= 20
    m = kc.read_model(EXAMPLE)
    points = {item.name for item in m.outputs if hasattr(item, "body")}
    assert points == {"W", "P", "C", "F"}  # of one link alone, or asked for; no ends of rods


def test_that_drivers_have_the_senses_of_the_drawing() -> None:
    s = spatial.Sketch("drawer")
    s.ground(O=(1, 2, 3))
    s.joints(A=(1, 2, 3), B=(1, 2.5, 3))
    s.slider("box", "A B", along=(0, 2, 0))
    s.drive("box", 0.25 + kc.t)
    found = kc.solve(kc.compile(s.mechanism()), [0.0, 1.0])
    np.testing.assert_allclose(found["y_box"], [2.25, 3.25], rtol=0, atol=1e-13)
    s = spatial.Sketch("door")
    s.ground(A=(0, 0, 0), B=(0, 0, 2))
    s.joints(H=(1, 0, 1))
    s.link("door", "A B H")
    s.drive("door", kc.t)
    found = kc.solve(kc.compile(s.mechanism()), [0.0, 0.5])
    np.testing.assert_allclose(found["H.y"], [0, np.sin(0.5)], rtol=0, atol=1e-13)


def fork(s: spatial.Sketch) -> None:
    s.joints(C=(1, 1, 1), D=(1, 0, 1), E=(1, 1, 0))
    s.link("arm", "C D E")
    s.link("twin", "C D E")


def lonely(s: spatial.Sketch) -> None:
    s.joints(C=(1, 1, 1))
    s.rod("r", "A C")


WRONG: dict[str, tuple[Callable[[spatial.Sketch], object], str]] = {
    "pair": (lambda s: s.joints(C=(1, 2)), "joint 'C': (1, 2) is not a place (x, y, z)"),
    "unknown": (lambda s: s.link("arm", "A X"), "link 'arm': unknown joints X"),
    "axis": (lambda s: s.hinges(A=(0, 0, 0)), "hinge 'A': the direction (0, 0, 0) has zero length"),
    "no hinge": (lambda s: s.hinges(X=(0, 0, 1)), "hinge 'X': unknown joints X"),
    "fast": (
        fork,
        "link 'twin' shares C, D, E with 'arm', and three shared joints lock the two links",
    ),
    "twice": (lambda s: (s.link("arm", "A B"), s.link("arm", "A B")), "a link 'arm' already"),
    "drive": (lambda s: s.drive("ground", 1), "drive of 'ground': it neither slides nor hangs"),
    "far": (lambda s: s.drive("arm", 1), "drive of 'arm': drive a link, a slider"),
    "rod": (lonely, "no link has the joint 'C' yet"),
    "line": (
        lambda s: s.slider("box", "A", along="A B C"),
        "slider 'box': unknown joints C",
    ),
    "none": (
        lambda s: s.slider("box", "A", along=(0, 0, 0)),
        "slider 'box': the direction (0, 0, 0) has zero length; two joints of one link, "
        "along='C D', or a direction, along=(1, 0, 0)",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_messages(case: str) -> None:
    draw, message = WRONG[case]
    s = spatial.Sketch("wrong")
    s.ground(A=(0, 0, 0), B=(0, 1, 0))
    draw(s)
    with pytest.raises(kc.ModelError, match=re.escape(message)):
        s.mechanism()

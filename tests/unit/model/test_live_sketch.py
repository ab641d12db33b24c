"""Live drawings: set to other places of its joints, one moves as if it had been drawn there."""

import math
import random
import re

import numpy as np
import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile import spatial
from kincompile.cli import cli
from kincompile.model.live_drawings import live_drawings

T = np.linspace(0, 1, 21)

FOUR_BAR = {"O": (0, 0), "C": (4, 0), "A": (1.1, 0.2), "B": (3, 2.9), "P": (1.5, 3)}


def four_bar(at, live=False):
    s = kc.Sketch("four_bar", length_unit="cm", live=live)
    s.ground(O=at["O"], C=at["C"])
    s.joints(A=at["A"], B=at["B"], P=at["P"])
    s.link("crank", "O A")
    s.link("coupler", "A B P")
    s.link("rocker", "C B", mass=2.0)
    s.drive("crank", 0.2 + 2 * kc.pi * kc.t)
    return s.mechanism()


EXCAVATOR = {
    "O": (0, 1.8), "Q": (0.6, 1.2), "R": (1.6, 3.0), "S": (1.9, 3.6), "T": (4.5, 3.2),
    "U": (4.0, 4.0), "Tip": (5.4, 0.1),
}  # fmt: skip


def excavator(at, live=False):
    s = kc.Sketch("excavator", live=live)
    s.ground(O=at["O"], Q=at["Q"])
    s.joints(**{joint: at[joint] for joint in ("R", "S", "T", "U", "Tip")})
    s.link("boom", "O R S T")
    s.link("stick", "U T Tip")
    s.drive("Q R", 2.06 + 0.1 * kc.t)
    s.drive("S U", 2.138 + 0.1 * kc.t)
    return s.mechanism()


GUIDED = {
    "O": (0, 0), "G": (-0.5, 0.5), "H": (3, 0.4), "A": (0.6, 0.5), "B": (2.1, 0.43),
    "W": (0.9, 1.6), "E": (1.5, 0.46),
}  # fmt: skip


def guided(at, live=False):
    """Return a crank with a slider on a drawn guide, a block on the rod, and two gears."""
    s = kc.Sketch("guided", live=live)
    s.ground(**{joint: at[joint] for joint in "OGHW"})
    s.joints(A=at["A"], B=at["B"], E=at["E"])
    s.link("crank", "O A")
    s.link("rod", "A B")
    s.slider("block", "B", along="G H")
    s.link("lever", "W E")
    s.slider("shoe", "E", along="A B")
    s.wheel("pinion", "W")
    s.gear("teeth", "crank", "O", 1.0, "pinion", "W", math.hypot(0.9, 1.6) - 1.0)
    s.drive("crank", 0.7 + kc.t)
    return s.mechanism()


SWING = {
    "A": (0, 0, 1),
    "B": (0, 0.5, 1.1),
    "C": (1, 0.3, 0.9),
    "E": (1.1, 0.9, 0.4),
}


def swing(at, live=False):
    """Return an arm in a hinge, a rod that is a body, and a slider that it pulls."""
    s = spatial.Sketch("swing", live=live)
    s.ground(A=at["A"], B=at["B"])
    s.joints(C=at["C"], E=at["E"])
    s.hinges(E=(1, 0, 0.2))
    s.link("arm", "A B C")
    s.slider("block", "E", along=(0, 1, 0))
    s.rod("rod", "C E")
    s.drive("arm", 0.3 * kc.t)
    return s.mechanism()


DRAWN = [(four_bar, FOUR_BAR), (excavator, EXCAVATOR), (guided, GUIDED), (swing, SWING)]


def coordinates(at):
    return {
        f"{joint}_{letter}": value
        for joint, place in at.items()
        for letter, value in zip("xyz", place, strict=False)
    }


@pytest.mark.parametrize(("draw", "at"), DRAWN)
def test_that_it_moves_as_one_that_is_drawn_where_it_is_pulled(draw, at):
    live = draw(at, live=True)
    assert {item.name: item.default for item in live.parameters} == coordinates(at)
    assert {item.unit for item in live.parameters} == {live.length_unit}
    module, rng = kc.compile(live), random.Random(3)
    for joint in at:
        moved = at | {joint: tuple(x + rng.uniform(-0.05, 0.05) for x in at[joint])}
        found = kc.solve(module, T, coordinates(moved))
        known = kc.solve(kc.compile(draw(moved)), T)
        assert found.success
        for name in ("q", "q_dot", "q_ddot"):
            np.testing.assert_allclose(getattr(found, name), getattr(known, name), atol=1e-12)
        np.testing.assert_allclose(found.observed.y, known.observed.y, atol=1e-12)
        seen, still = (np.hstack((x.q, x.observed.y)) for x in (found, kc.solve(module, T)))
        assert np.abs(seen - still).max() > 1e-3  # so that it was pulled at all


def test_that_a_file_of_it_starts_where_it_is_drawn_wherever_that_is(tmp_path):
    far = FOUR_BAR | {"C": (-3.0, 2.0), "B": (-2.0, -1.0)}
    own, path = coordinates(FOUR_BAR), tmp_path / "far.toml"
    text = re.sub(r", range = [^}]+(?= })", "", four_bar(FOUR_BAR, live=True).to_toml())
    for name, value in coordinates(far).items():
        was = f'"{name}", default = {float(own[name])}'
        assert was in text
        text = text.replace(was, f'"{name}", default = {value}')
    path.write_text(text)
    again, drawn = kc.read(path), four_bar(far)
    found, known = ([item.guess for item in model.system().coordinates] for model in (again, drawn))
    np.testing.assert_allclose(found, known, atol=1e-14)


def test_that_what_is_on_a_line_in_the_drawing_need_not_stay_on_it():
    at = FOUR_BAR | {"P": tuple((a + b) / 2 for a, b in zip((1.1, 0.2), (3, 2.9), strict=True))}
    module = kc.compile(four_bar(at, live=True))
    moved = at | {"P": (1.5, 3)}
    found = kc.solve(module, T, {"P_x": 1.5, "P_y": 3.0})
    known = kc.solve(kc.compile(four_bar(moved)), T)
    np.testing.assert_allclose(found["x_P"], known["x_P"], atol=1e-12)


def test_that_ranges_are_as_wide_as_the_drawing():
    live = four_bar(FOUR_BAR, live=True)
    ranges = {item.name: item.range for item in live.parameters}
    assert ranges["C_x"] == (-1.0, 9.0)  # 4 by 3: 5 either way
    assert ranges["A_y"] == pytest.approx((-4.8, 5.2))


def test_that_places_with_parameters_stay_as_they_are():
    s = kc.Sketch("arm", live=True)
    h = s.length("h", 2.0)
    s.ground(O=(0, 0), C=(0, h))
    s.joints(A=(1, 0))
    s.link("arm", "O A")
    s.link("stay", "C A")
    assert [item.name for item in s.mechanism().parameters] == [
        "h", "O_x", "O_y", "C_x", "A_x", "A_y",
    ]  # fmt: skip


FILE = """
kincompile = 1
name = "arm"

[sketch]
{live}
ground = {{ O = [0, 0], C = [2, 0.5] }}
joints = {{ A = [1, 1], B = [2.5, 2] }}
parts = [
    {{ link = "crank", joints = "O A" }},
    {{ link = "rod", joints = "A B" }},
    {{ link = "rocker", joints = "C B" }},
    {{ drive = "crank", value = "t + atan2({y}, 1)" }},
]
"""


def test_that_a_file_says_whether_it_is_live(tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(FILE.format(live="live = true", y="A_y"))
    live = kc.read(path)
    assert {item.name for item in live.system().parameters} == {
        f"{joint}_{letter}" for joint in "OCAB" for letter in "xy"
    }
    for text, count in (("", 8), ("live = false", 0), ("live = true", 8)):
        path.write_text(FILE.format(live=text, y="1"))
        with live_drawings():
            assert len(kc.read(path).system().parameters) == count
    path.write_text(FILE.format(live="", y="1"))
    assert not kc.read(path).system().parameters
    path.write_text(FILE.format(live="live = 1", y="1"))
    with pytest.raises(kc.ModelError, match="sketch, live: expected true or false, not 1"):
        kc.read(path)


MODEL = """
import kincompile as kc

s = kc.Sketch("arm", points=5)
s.ground(O=(0, 0), C=(2, 0.5))
s.joints(A=(1, 1), B=(2.5, 2))
s.link("crank", "O A"{length})
s.link("rod", "A B")
s.link("rocker", "C B")
s.drive("crank", kc.t + kc.pi / 4)
{more}
mechanism = s.mechanism()
"""


def run(*arguments):
    return CliRunner().invoke(cli, list(map(str, arguments)))


def test_that_commands_take_drawn_joints_by_name(tmp_path):
    path, page = tmp_path / "arm.py", tmp_path / "arm.html"
    path.write_text(MODEL.format(length="", more=""))
    found = run("run", path, "--set", "C_x=2.2", "-o", tmp_path / "a.csv")
    assert found.exit_code == 0, found.output
    path.write_text(MODEL.format(length="", more="").replace("C=(2,", "C=(2.2,"))
    assert run("run", path, "-o", tmp_path / "b.csv").exit_code == 0
    found, known = (
        np.loadtxt(tmp_path / name, delimiter=",", skiprows=1) for name in ("a.csv", "b.csv")
    )
    np.testing.assert_allclose(found, known, atol=1e-12)
    wrong = run("run", path, "--set", "D_x=2.2")
    assert "D_x" in wrong.output
    assert wrong.exit_code == 2
    for length, more, count in (
        ("", "", 8),
        (', s.length("a", 1.4)', "", 1),  # its author says what is to be pulled
        ("", "import math; math.hypot(*s.place('rod', 'B'))", 0),  # calculates with numbers
    ):
        path.write_text(MODEL.format(length=length, more=more))
        assert run("view", path, "-o", page).exit_code == 0
        assert page.read_text().count('"default":') == count

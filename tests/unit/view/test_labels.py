"""Names in drawings stand beside what they name: on no other name, and on no joint.

Their boxes are those of the SVG, measured with the letters of DejaVu, which are wide.
"""

import itertools
import re
import unicodedata
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import kincompile as kc
from kincompile.derivations.figures import Figures
from kincompile.model.resolve import Joint
from kincompile.report.figure import as_svg as figure_svg
from kincompile.view.drawing import drawing
from kincompile.view.labels import Name, around, leader, placed
from kincompile.view.svg import as_svg

TextPath = pytest.importorskip("matplotlib.textpath", reason="matplotlib is not installed").TextPath

SVG = "{http://www.w3.org/2000/svg}"
EXAMPLES = Path(__file__).parents[3] / "examples"
FILES = sorted(path for path in (*EXAMPLES.glob("*.toml"), *EXAMPLES.glob("space/*.toml")))


@cache
def extent(text: str, size: float) -> tuple[float, float, float, float]:
    """Return left, right, lowest and highest of a text that begins at the origin [px]."""
    plain = unicodedata.normalize("NFKC", text)  # it has no slanted letters
    box = TextPath((0, 0), plain, size=size).get_extents()
    return box.x0, box.x1, -box.y1, -box.y0


def boxes(svg: str) -> list[tuple[str, Any]]:
    """Return the texts of a picture, each with its left, right, top and bottom [px]."""
    root = ET.fromstring(svg)
    found: list[tuple[str, Any]] = []

    def visit(element: Any, shift: Any, font: float) -> None:
        moved = re.match(r"translate\(([-\d.]+) ([-\d.]+)\)", element.get("transform", ""))
        shift = shift + (np.array([float(x) for x in moved.groups()]) if moved else 0.0)
        font = float(element.get("font-size", font))
        if element.tag.removeprefix(SVG) == "text":
            runs = [(element.text or "", font)]
            runs += [(x.text or "", float(x.get("font-size", font))) for x in element]
            ends = [extent(*run) for run in runs if run[0].strip()]
            width = sum(right for _, right, *_ in ends)
            x, y = shift + np.array([float(element.get("x")), float(element.get("y"))])
            x -= {"middle": width / 2, "end": width}.get(element.get("text-anchor", ""), 0.0)
            top, bottom = min(item[2] for item in ends), max(item[3] for item in ends)
            found.append(("".join(element.itertext()), (x, x + width, y + top, y + bottom)))
        for child in element:
            visit(child, shift, font)

    visit(root, np.zeros(2), float(root.get("font-size", 16)))
    return found


def collisions(named: list[tuple[str, Any]], pins: Any = ()) -> list[tuple[str, str]]:
    """Return the pairs of names that overlap, and names with the joints inside them."""
    found = [
        (one, other)
        for (one, a), (other, b) in itertools.combinations(named, 2)
        if min(a[1], b[1]) > max(a[0], b[0]) and min(a[3], b[3]) > max(a[2], b[2])
    ]
    return found + [
        (name, f"pin at {x:.0f}, {y:.0f}")
        for name, (left, right, top, bottom) in named
        for x, y in pins
        if left < x < right and top < y < bottom
    ]


def figures_of(path: Path) -> Figures:
    """Return the figures of an example at its guess, for which nothing is solved."""
    system = kc.read_model(path).system()
    values = {item.name: float(item.guess) for item in system.coordinates}
    parameters = {item.name: float(item.default or 0.0) for item in system.parameters}
    return Figures(
        SimpleNamespace(  # type: ignore[arg-type]
            system=system,
            q=np.array([*values.values()]),
            p=np.array([*parameters.values()]),
            values={"t": 0.0} | parameters | values,
            origin="the guess",
        )
    )


def pins_of(svg: str) -> list[Any]:
    """Return where pins are on a picture: the centres of small rings."""
    found = []
    for path in ET.fromstring(svg).iter():
        if path.tag.endswith("path"):
            points = np.array(re.findall(r"-?[\d.]+", path.get("d", "")), dtype=float)
            points = points.reshape(-1, 2)
            centre = points.mean(axis=0)
            radii = np.hypot(*(points - centre).T)
            if len(points) > 8 and np.ptp(radii) < 0.1 * radii.max() < 0.8:
                found.append(centre)
    return found


def svgs_of(path: Path) -> list[str]:
    """Return all figures of an example, and its drawing."""
    figures = figures_of(path)
    system, q = figures.evaluation.system, figures.evaluation.q
    if not system.bodies:
        return []
    joints = [item for item in system.constraints if isinstance(item, Joint)]
    shown = [figures.mechanism(), *map(figures.joint, joints)]
    return [*map(figure_svg, filter(None, shown)), as_svg(drawing(system), q[None], "")]


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_that_no_name_of_an_example_is_on_another_one_or_on_a_joint(path: Path) -> None:
    found = [collisions(boxes(svg), pins_of(svg)) for svg in svgs_of(path)]
    assert list(filter(None, found)) == []


PAGE = np.array(((0.0, 0.0), (200.0, 200.0)))
SIZE = np.array((40.0, 10.0))


def middles(places: Any, joints: Any = ()) -> Any:
    """Return the middles of names at places, shape (n, F, 2), in each frame."""
    places = np.asarray(places, dtype=float)
    names = [Name(place, SIZE, around(SIZE, 2)) for place in places]
    found = np.reshape(np.asarray(joints, dtype=float), (places.shape[1], -1, 2))
    return places + placed(names, found, 3.0, PAGE)[:, None]


def test_that_names_of_one_place_stand_apart_and_those_that_are_far_have_a_line() -> None:
    found = middles(np.full((14, 1, 2), 100.0))[:, 0]
    for one, other in itertools.combinations(found, 2):
        assert (np.abs(one - other) >= SIZE - 1e-9).any()
    place, lines = np.array((100.0, 100.0)), 0
    for middle in found:
        away = np.hypot(*np.clip(np.abs(middle - place) - SIZE / 2, 0, None))
        line = leader(place, middle, SIZE)
        assert (line is not None) == (away > 9)
        if line is not None:
            lines += 1
            np.testing.assert_allclose(line[1], place)
            assert np.hypot(*(line[0] - line[1])) == pytest.approx(away)
    assert 0 < lines < 14


@pytest.mark.parametrize("corner", list(itertools.product((1.0, 199.0), repeat=2)))
def test_that_a_name_in_a_corner_stays_on_the_page(corner: Any) -> None:
    ((middle,),) = middles([[corner]])
    assert ((middle >= SIZE / 2) & (middle <= 200 - SIZE / 2)).all()


def test_that_a_name_in_motion_keeps_its_way_and_frees_what_comes_later() -> None:
    """A joint goes where the name would stand, in the last frames alone."""
    places = np.array([[(100.0, 100.0 + k) for k in range(10)]])
    joints = np.array([[(20.0, 20.0)]] * 7 + [[(120.0, 107.0 + k)] for k in (7, 8, 9)])
    alone, beside = middles(places)[0], middles(places, joints)[0]
    assert np.ptp(beside - places[0], axis=0).max() < 1e-9
    np.testing.assert_allclose((alone - places[0])[0], (22, 7))
    apart = np.abs(beside - joints[:, 0])
    assert (apart >= SIZE / 2 + 3 - 1e-9).any(axis=1).all()

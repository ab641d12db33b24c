"""The drawing of a page for other parameters, in node: any values, then the first ones again."""

import json
from pathlib import Path

import pytest

import kincompile as kc
from kincompile.model.mechanism import system_of
from kincompile.view.drawing import drawing
from kincompile.view.page_scripts import geometry_script, solver_script
from kincompile.view.worlds import PLANE, SPACE
from tests.conftest import EXAMPLES, load_example
from tests.page_modules import in_node

IN_SPACE = sorted((EXAMPLES[0].parent / "space").glob("*.py"))

PROGRAM = """
import { setNumbers } from './live.js';
const written = drawing => JSON.stringify(drawing.marks);
tell(scenes.map(({ drawing, geometry: own, given, others }) => {
  globalThis.geometry = own;
  setNumbers(drawing, given);
  const first = written(drawing);
  return { first: JSON.parse(first), returns: others.map(values => {
    setNumbers(drawing, values);
    const there = drawing.marks.map(mark => structuredClone(mark));
    setNumbers(drawing, given);
    return { there, isFirst: written(drawing) === first };
  }) };
}));
"""


def others_than(given):
    """Return other values: each half and double and zero, all of them, and all negative."""
    found = [
        [*given[:k], factor * value, *given[k + 1 :]]
        for k, value in enumerate(given)
        for factor in (0.5, 2, 0)
    ]
    return found + [[factor * value for value in given] for factor in (0.5, 2, -1, 0)]


def scene(model):
    """Return the text of a model's drawing, of what computes it again, and of values."""
    system = system_of(model)
    names = [item.name for item in system.parameters]
    given = [item.default or 0.0 for item in system.parameters]
    others, data = others_than(given), drawing(system).to_json()
    script = geometry_script(system, data)
    if "emitted.tables ??" in script:
        script = solver_script(system) + script
    text = (
        f"{{ drawing: {json.dumps(data)}, geometry: (() => {{ {script} return geometry; }})(), "
        f"given: {json.dumps(given)}, others: {json.dumps(others)} }}"
    )
    return names, others, text


def drawn_again(models, dimension):
    """Return for each model its other values by name, and what a page makes of its drawing."""
    scenes = [scene(model) for model in models]
    text = ",\n".join(own for _, _, own in scenes)
    found = in_node(f"const scenes = [{text}];\n{PROGRAM}", dimension=dimension)
    return [
        ([dict(zip(names, values, strict=True)) for values in others], own)
        for (names, others, _), own in zip(scenes, found, strict=True)
    ]


def with_parameters(paths: list[Path]):
    models = [load_example(path).model for path in paths]
    return [model for model in models if system_of(model).parameters]


def triangle() -> kc.Mechanism:
    """Return a four-bar whose coupler has its corners in another order where `side` is negative."""
    m = kc.Mechanism("triangle", end=1.0, points=3)
    side = m.parameter("side", 1.0)
    crank = m.parameter("crank", 1.0)
    one, plate, other = (m.body(name) for name in ("one", "plate", "other"))
    m.add(kc.Revolute("O", m.ground, (0, 0), one, (0, 0)))
    m.add(kc.Revolute("A", one, (crank, 0), plate, (0, 0)))
    m.add(kc.Revolute("B", plate, (3, side), other, (0, 0)))
    m.add(kc.Revolute("C", other, (2, 0), m.ground, (4, 0)))
    m.add(kc.AbsoluteAngle("motor", one, kc.t))
    m.point("P", plate, (2, 1 - side))
    return m


@pytest.mark.parametrize(
    ("dimension", "names"),
    [
        (PLANE, ["jansen", "cam_flat_follower"]),
        (SPACE, ["rssr"]),
        pytest.param(PLANE, None, marks=pytest.mark.slow),
        pytest.param(SPACE, None, marks=pytest.mark.slow),
    ],
)
def test_that_the_first_values_again_give_the_first_drawing(dimension, names):
    paths = EXAMPLES if dimension == PLANE else IN_SPACE
    models = with_parameters([path for path in paths if names is None or path.stem in names])
    assert len(models) == len(names) if names else len(models) > 5
    models += [triangle()] if dimension == PLANE else []
    for model, (_, own) in zip(models, drawn_again(models, dimension), strict=True):
        assert all(item["isFirst"] for item in own["returns"]), model.name


def test_that_links_have_the_corners_that_python_gives_them():
    model = triangle()
    ((others, own),) = drawn_again([model], PLANE)
    for values, item in zip(others, own["returns"], strict=True):
        marks = item["there"], drawing(model, values).to_json()["marks"]
        found, known = (
            {mark["frame"]["index"]: mark for mark in own if mark["kind"] == "hull"}
            for own in marks
        )
        # Python draws no link without a length.
        assert known.keys() <= found.keys()
        for body, link in known.items():
            corners = [[float(x) for x in point] for point in link["points"]]
            assert found[body]["points"] == corners, values

"""Mechanisms in space as data: read, written, refused with line and field."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import kincompile as kc
from kincompile import spatial
from kincompile.cli import cli
from kincompile.files.model_file import read_data_model
from kincompile.ir.lower import lower
from kincompile.space.catalogue import CONSTRAINTS
from kincompile.spatial import outputs
from tests.unit.spatial.test_double_cover import crossed_cranks
from tests.unit.spatial.test_motions import Z, slider_crank

O = (0, 0, 0)  # noqa: E741


def read(text: str, form: str = "toml") -> Any:
    return read_data_model(Path(f"model.{form}"), text.encode())


def problems(text: str) -> list[str]:
    with pytest.raises(kc.ModelError) as caught:
        read(text)
    return list(caught.value.problems)


def everything() -> spatial.Mechanism:
    """Return a mechanism with every constraint type, parameters, points and outputs."""
    m = spatial.Mechanism("all", length_unit="mm", end=2.0, points=5)
    a, tilt = m.parameter("a", 0.5, "mm"), m.parameter("tilt", 0.2, "rad")
    one = m.body("one", (1, a, -2), axis=(1, 2, 2), angle=tilt)
    two = m.body("two", (0.1, 0.2, 0.3), x=(1, 1, 0), z=(0, 0.1, 3))
    point = m.point("tip", two, (a, 0, 1))
    given = {
        "i": one, "j": two, "body": one, "point_i": (a, 0.1, 1), "point_j": point.local,
        "point": (1, 2, a), "ground_point": (1, 2, 3), "axis_i": (1, 2, 3),
        "axis_j": (0, a, 1), "normal_i": (1, 2, 7), "cross_i": (3, 0, -1), "cross_j": (1, 1, 0),
        "vector_i": (1, 0, a),
        "vector_j": (2, 1, 0), "vector": (1, 2, 3), "value": 0.3 + kc.t, "distance": 2 + a,
        "angle": 3 * kc.t, "pitch": a / 3,
    }  # fmt: skip
    for k, (name, kind) in enumerate(CONSTRAINTS.items()):
        if not kind.is_own:
            m.add(kind(f"c{k}_{name}", **{key: given[key] for key in kind.arguments()}))
    m.add(kc.Equation("free", one.z - two.p[3] * a, point.z - kc.t))
    spin = two.direction((0, 1, 0))
    m.output("lean", spin[2] ** 2, "")
    m.output("rise", outputs.rate(point.z) - one.omega[2])
    return m


@pytest.mark.parametrize("form", ["toml", pytest.param("json", marks=pytest.mark.slow)])
def test_that_every_constraint_can_be_written_and_read(form: str) -> None:
    m = everything()
    again = read(m.to_toml() if form == "toml" else m.to_json(), form)
    assert isinstance(again, spatial.Mechanism)
    assert again.to_toml() == m.to_toml()
    assert lower(again.system()).fingerprint == lower(m.system()).fingerprint


def test_that_the_schema_agrees() -> None:
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    schema = kc.model_schema()
    validator = jsonschema.validators.validator_for(schema)(schema)
    for model in (everything(), slider_crank()):
        data = json.loads(model.to_json())
        validator.validate(data)
        for key, wrong in (("space", 2), ("space", 4), ("bodies", [{"name": "a", "guess": O}])):
            assert not validator.is_valid({**data, key: wrong})


def test_that_free_coordinates_stand_beside_bodies() -> None:
    text = (
        crossed_cranks(1.0).to_toml().replace("[[con", 'coordinates = [{ name = "w" }]\n[[con', 1)
    )
    text += '[[constraints]]\ntype = "Equation"\nname = "copy"\n'
    text += 'expressions = ["w - 2*e1_rocker"]\n'
    system = read(text)
    assert isinstance(system, kc.ConstraintSystem)
    found = kc.solve(kc.compile(system), [0.0, 0.5])
    np.testing.assert_allclose(found["w"], 2 * found["e1_rocker"], rtol=0, atol=1e-14)
    assert system.to_toml() == read(system.to_toml()).to_toml()


ORIENTATIONS = {
    "orientation = [0.6, 0, 0, 0.8]": [0.6, 0, 0, 0.8],
    "orientation = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]": [0.5**0.5, 0, 0, 0.5**0.5],
    'axis = [0, 0, 2], angle = "90*deg"': [0.5**0.5, 0, 0, 0.5**0.5],
    "x = [0, 3, 0], z = [0, 0, 1]": [0.5**0.5, 0, 0, 0.5**0.5],
}


@pytest.mark.parametrize("given", ORIENTATIONS)
def test_orientations(given: str) -> None:
    text = crossed_cranks(1.0).to_toml()
    (line,) = (line for line in text.splitlines() if 'name = "crank"' in line)
    start, _, _ = line.partition("orientation")
    system = read(text.replace(line, f"{start}{given} }},")).system()
    found = [item.guess for item in system.coordinates[3:7]]
    np.testing.assert_allclose(found, ORIENTATIONS[given], rtol=0, atol=1e-15)


CRANK = "orientation = [1, 0, 0, 0] }"
WRONG = {
    "space": ("space = 3", "space = 4", 3, "space: it is 2 or 3, not 4"),
    "plane": ("space = 3", "space = 2", 7, "body 'crank', position: there is no such field"),
    "guess": (f"position = [0, 0, 0], {CRANK}", "guess = [0, 0, 0] }", 7, "no such field"),
    "pair": ("point_i = [0, 0, 0]", "point_i = [0, 0]", 15, "expected [xi, eta, zeta], not"),
    "length": (CRANK, "orientation = [0, 0, 0, 0] }", 7, "Euler parameters have length zero"),
    "matrix": (CRANK, "orientation = [[1, 0, 0], [0, 2, 0], [0, 0, 1]] }", 7, "is no rotation"),
    "left": (CRANK, "orientation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]] }", 7, "is left-handed"),
    "three": (CRANK, "orientation = [1, 0] }", 7, "expected [e0, e1, e2, e3], not a list of 2"),
    "axis": (CRANK, "axis = [0, 0, 0], angle = 1 }", 7, "give three numbers, not all zero"),
    "type": ('type = "Revolute"', 'type = "AbsoluteAngle"', 12, "there is no type 'AbsoluteAngle'"),
    "own": ('type = "Revolute"', 'type = "Normalization"', 12, "there is no type 'Normalization'"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_that_a_problem_has_line_and_field(name: str) -> None:
    old, new, line, message = WRONG[name]
    text = crossed_cranks(1.0).to_toml()
    assert old in text
    found = problems(text.replace(old, new, 1))
    assert any(
        item.startswith(f"model.toml, line {line}: ") and message in item for item in found
    ), found


def test_that_rates_of_points_and_spins_have_names() -> None:
    text = crossed_cranks(1.0).to_toml()
    rows = (
        'points = [{ name = "end", body = "rocker", local = [0, 0, 2] }]\n'
        'outputs = [{ name = "wheel", expression = "omega_y_rocker * z_end - rate(x_end)" }]\n'
    )
    found = kc.solve(kc.compile(read(text.replace("[[", rows + "[[", 1))), [0.0, 0.4])
    np.testing.assert_allclose(found["wheel"], 0, rtol=0, atol=1e-13)
    assert np.abs(found["end.x_dot"]).min() > 0.1


@pytest.mark.slow
def test_that_a_planar_file_loads_no_spatial_code() -> None:
    import subprocess
    import sys

    program = (
        "import sys, kincompile as kc; kc.compile(kc.read('examples/four_bar.toml')); "
        "print([name for name in sys.modules if name.startswith('kincompile.space')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_axes_of_slider() -> None:
    """What was written is what was given: axes are not made units."""
    m = crossed_cranks(1.0)
    m.constraints[0] = spatial.Revolute("O", m.ground, O, 2 * Z, m.bodies[0], O, 3 * Z)
    assert "axis_i = [0.0, 0.0, 2.0]" in m.to_toml()


COMMANDS = {
    "run": ("--points", "5"),
    "inspect": (),
    "assemblies": (),
    "compile": ("-o", "{}/module.py"),
    "derive": ("-o", "{}/page.html"),
    "draw": ("-o", "{}/drawing.svg"),
    "view": ("-o", "{}/view.html"),
}


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["py", "toml"])
@pytest.mark.parametrize("command", COMMANDS)
def test_that_commands_take_a_file_in_space(command: str, ending: str, tmp_path: Path) -> None:
    file = Path(__file__).parents[3] / "examples" / "space" / f"rssr.{ending}"
    options = [item.format(tmp_path) for item in COMMANDS[command]]
    done = CliRunner().invoke(cli, [command, str(file), *options])
    assert done.exit_code == 0, done.output
    for option in options:
        if option.startswith(str(tmp_path)):
            assert Path(option).stat().st_size > 1000

"""docs/model_files.md: its example runs, and its tables are those of the code."""

import re
from pathlib import Path

import numpy as np

import kincompile as kc
from docs.builders import fields as tables
from docs.builders.places import DOCS
from kincompile.files.dimensions import PLANE, SPACE
from kincompile.files.file_format import equation_fields, fields_of
from kincompile.files.safe_expressions import FUNCTIONS

PAGE = (Path(__file__).parents[2] / "docs" / "model_files.md").read_text(encoding="utf-8")


def test_that_the_example_swings(tmp_path):
    file = tmp_path / "swing.toml"
    file.write_text(re.findall(r"^```toml\n(.*?)^```", PAGE, re.M | re.S)[0], encoding="utf-8")
    solution = kc.solve(kc.compile(kc.read(file)), [0.25])
    phi = -np.pi / 2 + 0.6
    np.testing.assert_allclose(solution["x_arm"], 0.25 * np.cos(phi), rtol=1e-12)
    np.testing.assert_allclose(solution["y_arm"], 0.25 * np.sin(phi), rtol=1e-12)


def test_that_the_drawing_is_a_shaper(tmp_path):
    """Its strokes take as long as the closed form says, (pi + 2 asin(r/d)) : (pi - 2 asin(r/d))."""
    file = tmp_path / "shaper.toml"
    file.write_text(re.findall(r"^```toml\n(.*?)^```", PAGE, re.M | re.S)[1], encoding="utf-8")
    module = kc.compile(kc.read(file))
    feed = kc.solve(module, np.linspace(0, 1, 181)).measures()["feed"]
    swing = 2 * np.arcsin(0.1 / 0.45)
    np.testing.assert_allclose(feed.time_ratio, (np.pi + swing) / (np.pi - swing), rtol=1e-6)


def test_that_the_file_in_space_moves(tmp_path):
    file = tmp_path / "crossed_cranks.toml"
    file.write_text(re.findall(r"^```toml\n(.*?)^```", PAGE, re.M | re.S)[2], encoding="utf-8")
    found = kc.solve(kc.compile(kc.read(file)), np.linspace(0, 1, 11))
    start = np.array([np.cos(0.3 + 2 * found.t), np.sin(0.3 + 2 * found.t), 0 * found.t])
    end = np.array([found[f"end.{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(np.linalg.norm(end - start, axis=0), 3, rtol=1e-13)
    rate = found["end.x_dot"]  # omega x (end - P) along x
    np.testing.assert_allclose(found["spin"] * end[2], rate, rtol=1e-11)


def test_that_the_page_names_the_fields_of_the_file_and_of_equations():
    """Those of its tables follow from their declarations."""
    for fields in (fields_of("model", PLANE), fields_of("model", SPACE), equation_fields()):
        for field in fields:
            assert f"`{field}`" in PAGE or f"`{field} = true`" in PAGE


def test_that_the_tables_of_commands_follow_from_their_declarations(request):
    if request.config.getoption("--update-goldens"):
        (DOCS / tables.PAGE).write_text(tables.page(), encoding="utf-8")
    assert tables.page() == PAGE, "python -m docs.builders fields writes it anew"


def test_that_all_functions_are_named():
    assert set(FUNCTIONS) <= set(re.findall(r"\w+", PAGE))

"""docs/model_files.md: its example runs, and its tables are those of the code."""

import re
from pathlib import Path

import numpy as np

import kincompile as kc
from kincompile.files.file_format import FIELDS
from kincompile.files.safe_expressions import FUNCTIONS

PAGE = (Path(__file__).parents[2] / "docs" / "model_files.md").read_text(encoding="utf-8")


def test_that_the_example_swings(tmp_path):
    file = tmp_path / "swing.toml"
    file.write_text(re.findall(r"^```toml\n(.*?)^```", PAGE, re.M | re.S)[0], encoding="utf-8")
    solution = kc.solve(kc.compile(kc.read(file)), [0.25])
    phi = -np.pi / 2 + 0.6
    np.testing.assert_allclose(solution["x_arm"], 0.25 * np.cos(phi), rtol=1e-12)
    np.testing.assert_allclose(solution["y_arm"], 0.25 * np.sin(phi), rtol=1e-12)


def test_that_each_table_has_its_fields():
    for table in ("model", "analysis", "parameter", "body", "coordinate", "point", "output"):
        for field in FIELDS[table]:
            assert f"`{field}`" in PAGE


def test_that_all_functions_are_named():
    assert set(FUNCTIONS) <= set(re.findall(r"\w+", PAGE))

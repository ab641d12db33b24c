"""Points and outputs of a model file: read, used in formulas, written and read back."""

import numpy as np
import pytest

import kincompile as kc

MODEL = """
kincompile = 1
name = "crank"
bodies = [{ name = "crank", guess = [0, 0, 0] }, { name = "rod", guess = [1, 0, 0] }]
parameters = [{ name = "L", default = 3.0, unit = "m" }]
points = [{ name = "pin", body = "crank", local = [1, 0] },
          { name = "end", body = "rod", local = ["L", 0] }]
outputs = [
    { name = "stroke", expression = "x_end - x_pin", unit = "m" },
    { name = "speed", expression = "sqrt(rate(x_end)^2 + rate(y_end)^2)", unit = "m/s" },
    { name = "turn", expression = "phi_crank_dot*180/pi" },
]

[[constraints]]
type = "Revolute"
name = "O"
i = "ground"
point_i = [0, 0]
j = "crank"
point_j = [0, 0]

[[constraints]]
type = "Equation"
name = "A"
expressions = ["x_rod - x_pin", "y_rod - y_pin"]

[[constraints]]
type = "Equation"
name = "guide"
expressions = ["y_end"]

[[constraints]]
type = "AbsoluteAngle"
name = "motor"
body = "crank"
angle = "2*t"
"""


def read(folder, text, suffix=".toml"):
    path = folder / f"model{suffix}"
    path.write_text(text, encoding="utf-8")
    return kc.read_model(path)


def test_that_points_stand_in_formulas_and_outputs_are_columns(tmp_path):
    found = kc.solve(kc.compile(read(tmp_path, MODEL)), np.linspace(0, 3, 50))
    angle = 2 * found.t
    x = np.cos(angle) + np.sqrt(9 - np.sin(angle) ** 2)
    np.testing.assert_allclose(found["end.x"], x, atol=1e-12)
    np.testing.assert_allclose(found["stroke"], x - np.cos(angle), atol=1e-12)
    np.testing.assert_allclose(found["speed"], np.abs(found["end.x_dot"]), atol=1e-9)
    np.testing.assert_allclose(found["turn"], 360 / np.pi, atol=1e-12)


@pytest.mark.parametrize("suffix", [".toml", ".json"])
def test_that_they_are_written_and_read_back(suffix, tmp_path):
    model = read(tmp_path, MODEL)
    text = model.to_toml() if suffix == ".toml" else model.to_json()
    assert 'expression = "sqrt(rate(x_end)**2 + rate(y_end)**2)"' in model.to_toml()
    again = read(tmp_path, text, suffix)
    assert (again.to_toml(), again.to_json()) == (model.to_toml(), model.to_json())
    first, second = (kc.solve(kc.compile(item), np.linspace(0, 1, 5)) for item in (model, again))
    for name in first.names:
        np.testing.assert_array_equal(first[name], second[name])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('body = "rod", local', 'body = "road", local', "there is no body 'road'; did you mean"),
        ("local = [1, 0]", "local = [1]", r"point 'pin', local: expected \[xi, eta\]"),
        ('name = "turn"', 'name = "speed"', "'speed' is the name in line 10 already"),
        ("phi_crank_dot*180", "phi_crank_dott*180", "phi_crank_dott"),
        ('unit = "m/s"', 'unit = "m/s\\""', "the unit of output 'speed' is"),
        ('expression = "x_end - x_pin", ', "", "no expression; fields are: name, expression, unit"),
        ("rate(x_end)^2", "rate(rate(rate(x_end)))^2", "would be a third derivative"),
    ],
)
def test_that_what_is_wrong_with_them_is_said_with_line_and_field(old, new, message, tmp_path):
    assert old in MODEL
    with pytest.raises(kc.ModelError, match=message):
        read(tmp_path, MODEL.replace(old, new))

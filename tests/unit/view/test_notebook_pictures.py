"""What notebooks show of models and motions besides tables: pictures, and the player in a frame."""

import base64
import io
import pickle
import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.view import notebook

pytest.importorskip("matplotlib", reason="matplotlib is not installed")
from PIL import Image


def parts(shown):
    """Return the elements of what is shown, which is well-formed."""
    return ET.fromstring(f"<div>{shown._repr_html_()}</div>")


def image_of(shown):
    (image,) = parts(shown).iter("img")
    head, data = image.attrib["src"].split(",")
    assert head == "data:image/png;base64"
    return image.attrib["alt"], Image.open(io.BytesIO(base64.b64decode(data)))


def test_that_a_mechanism_shows_its_guess_and_its_constraints(example_named):
    model = example_named("four_bar").model
    title, image = image_of(model)
    assert title == "four_bar at its start guess"
    assert image.size == (500, 360)
    assert len(list(parts(model).iter("tr"))) == 6


def test_that_a_motion_is_played_on_its_page(example_named):
    example = example_named("four_bar")
    (frame,) = parts(example.solution).iter("iframe")
    page = kc.page(example.model, example.solution).html
    assert frame.attrib["srcdoc"] == page.replace("\n", " ")  # as XML reads an attribute
    assert [row[0].text for row in parts(example.solution).iter("tr")][1:4] == [
        "x_crank", "y_crank", "phi_crank",
    ]  # fmt: skip


def test_that_a_large_motion_is_plotted(example_named, monkeypatch):
    monkeypatch.setattr(notebook, "MOST_PLAYED", 100)
    title, _ = image_of(example_named("four_bar").solution)
    assert title == "the coordinates of four_bar over time"


def test_that_a_motion_without_its_model_is_plotted(example_named):
    assert (
        "over time" in image_of(pickle.loads(pickle.dumps(example_named("four_bar").solution)))[0]
    )


def test_that_variants_are_plotted_with_their_extremes(example_named):
    module = example_named("simple_pendulum").module
    p = np.stack([module.DEFAULTS, module.DEFAULTS])[:, None]
    solution = kc.solve(module, [0.0, 0.1], p)
    image_of(solution)
    rows = [[cell.text for cell in row] for row in parts(solution).iter("tr")]
    assert rows[0] == ["coordinate", "unit", "smallest", "largest"]
    assert float(rows[1][2]) == pytest.approx(solution.q[..., 0].min(), rel=1e-5)


def test_that_free_equations_have_no_drawing():
    x = sympy.Symbol("x")
    system = kc.ConstraintSystem("free", [x], [x - kc.t])
    assert "<img" not in system._repr_html_()


def test_that_names_are_escaped():
    m = kc.Mechanism("pendulum")
    bar = m.body("bar", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (-1, 0)))
    m.add(
        kc.AbsoluteAngle("motor", bar, sympy.Piecewise((kc.t**2, kc.t < 1), (2 * kc.t - 1, True)))
    )
    assert "t &lt; 1" in m._repr_html_()
    image_of(m)


def test_that_without_matplotlib_there_are_tables(example_named, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    example = example_named("four_bar")
    model = example.model._repr_html_()
    alone = pickle.loads(pickle.dumps(example.solution))._repr_html_()
    assert "<img" not in model + alone
    assert "<table>" in model
    assert "<table>" in alone


@pytest.mark.parametrize(("before", "loaded"), [("import IPython", True), ("pass", False)])
def test_that_only_a_notebook_pays_for_its_pictures(before, loaded):
    if loaded:
        pytest.importorskip("IPython", reason="IPython is not installed")
    code = (
        f"{before}; import sys, kincompile as kc; kc.Mechanism; print("
        "'kincompile.view.notebook' in sys.modules, 'matplotlib' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split()[0] == str(loaded)
    assert loaded or found.stdout.split()[1] == "False"

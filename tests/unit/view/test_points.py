"""Named points in pictures: drawn, labelled, and traced without being asked."""

import math

import numpy as np
import pytest

import kincompile as kc
from kincompile.view.drawing import drawing
from kincompile.view.marks import Dot, Hull

T = np.linspace(0, 1, 41)
L = 1.5


@pytest.fixture(scope="module")
def model():
    """A bar about the origin with the point P at (L, 0.5), which turns by 2 pi t."""
    m = kc.Mechanism("pointed", points=T.size)
    length = m.parameter("L", L, unit="m")
    bar = m.body("bar")
    point = m.point("P", bar, (length, 0.5))
    m.add(kc.Revolute("O", m.ground, (0, 0), bar, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, 2 * kc.pi * kc.t))
    m.output("height", point.y + 1, "m")
    m.output("still", 2, "m")
    return m


@pytest.fixture(scope="module")
def solution(model):
    return kc.solve(kc.compile(model), T)


def path():
    angle = math.tau * T + math.atan2(0.5, L)
    return math.hypot(L, 0.5) * np.array([np.cos(angle), np.sin(angle)])


def test_that_a_point_is_a_mark_on_its_body_and_a_corner_of_it(model):
    drawn = drawing(model, {"L": 2.0})
    (dot,) = drawn.dots
    assert (dot.name, dot.place.point, dot.place.frame) == ("P", (2.0, 0.5), drawn.frames[0])
    (link,) = (mark for mark in drawn.marks if isinstance(mark, Hull))
    assert (2.0, 0.5) in link.points
    assert isinstance(drawn.marks[-1], Dot)
    assert drawn.to_json()["marks"][-1]["kind"] == "dot"


def test_that_a_plot_names_points_and_no_joints_unless_asked(model):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    (text,) = kc.plot_mechanism(model).texts
    assert text.get_text() == "P"
    np.testing.assert_allclose(text.xy, (L, 0.5), atol=1e-2)
    ax = kc.plot_mechanism(model, names=True)
    assert {text.get_text() for text in ax.texts} == {"P", "O, motor"}


@pytest.mark.slow
def test_that_an_animation_traces_points_and_their_names_go_with_them(solution):
    plt = pytest.importorskip("matplotlib.pyplot", reason="matplotlib is not installed")
    from matplotlib.animation import AbstractMovieWriter
    from matplotlib.text import Annotation

    class Labels(AbstractMovieWriter):
        """Keeps where the names stand in each frame."""

        def __init__(self):
            super().__init__()
            self.places = []

        def setup(self, fig, outfile, dpi=None):
            self.fig = fig

        def grab_frame(self, **savefig_kwargs):
            shown = self.fig.axes[0].texts
            self.places += [text.xy for text in shown if isinstance(text, Annotation)]

        def finish(self):
            """Nothing was begun."""

    animation = kc.animate(solution, seconds=10)
    paths = [np.array(line.get_data()) for line in plt.gca().lines]
    assert any(x.shape == (2, T.size) and np.allclose(x, path(), atol=1e-9) for x in paths)
    labels = Labels()
    animation.save("unused", writer=labels)
    np.testing.assert_allclose(labels.places, path().T, atol=1e-9)
    plt.close("all")
    bare = kc.animate(solution, trace=())
    assert not any(len(line.get_xdata()) == T.size for line in plt.gca().lines)
    bare.save("unused", writer=Labels())
    plt.close("all")


def test_that_a_page_has_the_columns_of_points_and_outputs(model, solution):
    data = kc.page(model, solution).data
    assert data["outputs"] == [
        {"name": name, "unit": "m"} for name in ("x_P", "y_P", "height", "still")
    ]
    np.testing.assert_allclose(data["arrays"]["y"][:, :2].T, path(), atol=1e-12)
    np.testing.assert_array_equal(data["arrays"]["y_dot"][:, 2], solution["height_dot"])


def test_that_redundant_mechanisms_have_points_and_pages_too():
    """Two bars of a parallelogram and a third: a redundant joint."""
    m = kc.Mechanism("parallel", points=5)
    a, b, rod = (m.body(name) for name in ("a", "b", "rod"))
    m.point("P", rod, (0, 1))
    for k, bar in enumerate((a, b)):
        m.add(kc.Revolute(f"O{k}", m.ground, (2 * k, 0), bar, (0, 0)))
        m.add(kc.Revolute(f"A{k}", bar, (0, 1), rod, (2 * k, 0)))
    m.add(kc.AbsoluteAngle("level", rod, 0))
    m.add(kc.AbsoluteAngle("motor", a, kc.t / 5))
    with pytest.warns(kc.RedundantConstraintWarning):
        module = kc.compile(m)
    solution = kc.solve(module, [0.0, 1.0])
    np.testing.assert_allclose(solution["P.y"], 1 + np.cos(np.array([0, 0.2])), atol=1e-9)

"""`kc.plot_sparsity`: every entry at its names, blocks on the diagonal and nothing above them."""

import sys

import numpy as np
import pytest

import kincompile as kc

pytest.importorskip("matplotlib", reason="matplotlib is not installed")


def named_entries(ax):
    """Return the entries that are drawn, as names of row and column, by the collection's label."""
    rows = [label.get_text() for label in ax.get_yticklabels()]
    columns = [label.get_text() for label in ax.get_xticklabels()]
    found = {}
    for collection in ax.collections:
        centres = [path.vertices[:4].mean(axis=0) for path in collection.get_paths()]
        found[collection.get_label()] = {
            (rows[round(float(y))], columns[round(float(x))]) for x, y in centres
        }
    return found


def nonzeros(system):
    return {
        (system.equations[row], system.coordinates[column].name)
        for row in range(len(system.equations))
        for column in range(len(system.coordinates))
        if system.Phi_q[row, column] != 0
    }


@pytest.mark.parametrize("order", ["solution", "written"])
def test_that_the_entries_are_those_that_sympy_finds(example_named, order):
    model = example_named("gear_train").model
    ax = kc.plot_sparsity(model, order=order)
    drawn = named_entries(ax)
    assert set().union(*drawn.values()) == nonzeros(model.system())
    assert "9 x 9, 20 entries" in ax.get_title()


def test_that_blocks_are_on_the_diagonal_and_nothing_is_above_them(example_named):
    ax = kc.plot_sparsity(example_named("four_bar").model)
    sizes, end = [], -0.5
    for line in ax.lines:
        x, y = line.get_xdata(), line.get_ydata()
        assert min(x) == min(y) == end
        assert max(x) == max(y)
        sizes.append(max(x) - end)
        end = max(x)
    assert sizes == [1, 1, 1, 6]  # crank angle, crank position, the closed chain
    for collection in ax.collections:
        for path in collection.get_paths():
            x, y = path.vertices[:4].mean(axis=0)
            block = next(line for line in ax.lines if max(line.get_ydata()) > y)
            assert x < max(block.get_xdata())
            inside = x > min(block.get_xdata())
            assert inside == (collection.get_label() == "solved for in its step")


def test_that_the_written_order_is_that_of_the_model(example_named):
    model = example_named("four_bar").model
    ax = kc.plot_sparsity(model, order="written")
    labels = [label.get_text() for label in ax.get_yticklabels()]
    assert labels == list(model.system().equations)
    assert not ax.lines


def test_that_300_columns_have_few_labels_that_are_right():
    m = kc.Mechanism("chain")
    before, point = m.ground, (0.0, 0)
    for k in range(100):
        body = m.body(f"b{k}", guess=(k + 0.5, 0, 0))
        m.add(kc.Revolute(f"J{k}", before, point, body, (-0.5, 0)))
        m.add(kc.AbsoluteAngle(f"d{k}", body, kc.t))
        before, point = body, (0.5, 0)
    ax = kc.plot_sparsity(m, order="written")
    coordinates = m.system().coordinates
    assert len(ax.get_xticks()) <= 60
    for place, label in zip(ax.get_xticks(), ax.get_xticklabels(), strict=True):
        assert label.get_text() == coordinates[int(place)].name
    assert sum(len(collection.get_paths()) for collection in ax.collections) == 896


def test_that_a_dependent_equation_is_last_and_red(example_named):
    m = kc.Mechanism("twice")
    bar = m.body("bar", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", m.ground, (0, 0), bar, (-1, 0)))
    m.add(kc.AbsoluteAngle("motor", bar, kc.t))
    m.add(kc.AbsoluteAngle("again", bar, kc.t))
    labels = kc.plot_sparsity(m).get_yticklabels()
    (dependent,) = kc.inspect(m).redundant
    assert [label.get_text() for label in labels if label.get_color() == "red"] == [dependent]
    assert labels[-1].get_text() == dependent


def test_that_axes_are_taken_and_given_back(example_named):
    from matplotlib import pyplot as plt

    _, ax = plt.subplots()
    assert kc.plot_sparsity(example_named("four_bar").model, ax) is ax
    assert np.isclose(ax.get_aspect(), 1)


def test_that_an_unknown_order_is_refused(example_named):
    with pytest.raises(kc.InputError, match="orders are: solution, written"):
        kc.plot_sparsity(example_named("four_bar").model, order="random")


def test_that_missing_matplotlib_is_named(example_named, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(kc.UnsupportedError, match=r"matplotlib is not .*'\.\[plot\]'"):
        kc.plot_sparsity(example_named("four_bar").model)

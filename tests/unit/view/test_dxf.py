"""Drawings for CAD, read back by ezdxf: in the model's unit, on layers, with the exact places."""

import numpy as np
import pytest

import kincompile as kc

ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed")

EXACT = 1e-12


def read(path):
    """Return the model space of a file without faults, and its document."""
    document = ezdxf.readfile(path)
    assert not document.audit().has_errors
    return document.modelspace(), document


def four_bar(unit="mm", name="crank"):
    m = kc.Mechanism("four_bar", length_unit=unit)
    crank = m.body(name, guess=(0.5, 0.2, 0.3))
    coupler = m.body("coupler", guess=(2, 2, 0.5))
    rocker = m.body("rocker", guess=(4, 1.5, 1.2))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (-0.5, 0)))
    m.add(kc.Revolute("A", crank, (0.5, 0), coupler, (-1.75, 0)))
    m.add(kc.Revolute("B", coupler, (1.75, 0), rocker, (1.5, 0)))
    m.add(kc.Revolute("C", m.ground, (4, 0), rocker, (-1.5, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 2 * kc.pi * kc.t))
    m.point("P", coupler, (0, 1))
    return m


def solved(model, end=1.0, points=21):
    return kc.solve(kc.compile(model), np.linspace(0, end, points))


def centres(space, layer):
    return [np.array(item.dxf.center)[:2] for item in space.query(f'CIRCLE[layer=="{layer}"]')]


def test_that_joints_are_circles_where_the_solution_has_them(tmp_path):
    solution = solved(four_bar())
    space, _ = read(kc.draw(solution, tmp_path / "a.dxf", solution.t[7]))
    row = solution.t[7]
    joints = [(0, 0), (np.cos(2 * np.pi * row), np.sin(2 * np.pi * row))]
    joints += [(solution[f"{name}.x"][7], solution[f"{name}.y"][7]) for name in "BCP"]
    found = np.array(centres(space, "joints"))
    assert len(found) == 5
    for place in joints:
        assert np.abs(found - place).max(axis=1).min() < EXACT


def test_that_a_path_has_the_points_of_the_solution(tmp_path):
    solution = solved(four_bar())
    space, _ = read(kc.draw(solution, tmp_path / "a.dxf"))
    (path,) = space.query('LWPOLYLINE[layer=="paths"]')
    found = np.array([(x, y) for x, y, *_ in path.get_points("xyb")])
    wanted = np.stack((solution["P.x"], solution["P.y"]), axis=-1)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=EXACT)
    assert all(bulge == 0 for *_, bulge in path.get_points("xyb"))


def test_that_the_ends_of_links_are_true_arcs_about_their_joints(tmp_path):
    solution = solved(four_bar())
    space, _ = read(kc.draw(solution, tmp_path / "a.dxf", solution.t[3]))
    (link,) = space.query('LWPOLYLINE[layer=="crank"]')
    corners = link.get_points("xyb")
    assert link.closed
    bulges = [bulge for *_, bulge in corners]
    np.testing.assert_allclose(bulges, [1, 0, 1, 0], atol=1e-12)  # half circles, then sides
    angle = 2 * np.pi * solution.t[3]
    ends = np.array(((0, 0), (np.cos(angle), np.sin(angle))))
    nearest, radii = [], []
    for start, end in zip(corners[::2], corners[1::2], strict=True):
        (x0, y0, bulge), (x1, y1, _) = start, end
        apart = np.hypot(*(ends - np.array(ezdxf.math.bulge_center((x0, y0), (x1, y1), bulge))).T)
        nearest.append(int(apart.argmin()))
        assert apart.min() < EXACT
        radii.append(ezdxf.math.bulge_radius((x0, y0), (x1, y1), bulge))
    assert sorted(nearest) == [0, 1]
    assert radii[0] == pytest.approx(radii[1], rel=1e-12)


def test_that_a_pitch_circle_is_a_circle_of_its_body(tmp_path):
    m = kc.Mechanism("pair", length_unit="in")
    first, second = m.body("first"), m.body("second", guess=(3, 0, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), first, (0, 0)))
    m.add(kc.Revolute("C", m.ground, (3, 0), second, (0, 0)))
    m.add(kc.Gear("mesh", first, (0, 0), 1, 0, second, (0, 0), 2, np.pi))
    m.add(kc.AbsoluteAngle("motor", first, kc.t))
    space, document = read(kc.draw(solved(m), tmp_path / "a.dxf", 0.5))
    assert document.header["$INSUNITS"] == 1
    for name, place, radius in (("first", (0, 0), 1), ("second", (3, 0), 2)):
        (circle,) = space.query(f'CIRCLE[layer=="{name}"]')
        found = (*circle.dxf.center, circle.dxf.radius)
        np.testing.assert_allclose(found, (*place, 0, radius), atol=EXACT)


def test_that_a_given_outline_stays_as_it_is(tmp_path):
    angles = np.arange(24) * np.pi / 12
    outline = [(float(np.cos(a)), float(np.sin(a))) for a in angles]
    m = kc.Mechanism("disc")
    disc = m.body("disc", outline=outline)
    m.add(kc.Revolute("O", m.ground, (0, 0), disc, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", disc, kc.t))
    space, _ = read(kc.draw(solved(m), tmp_path / "a.dxf", 1.0))
    (found,) = space.query('LWPOLYLINE[layer=="disc"]')
    turned = np.stack((np.cos(angles + 1), np.sin(angles + 1)), axis=-1)
    np.testing.assert_allclose(found.get_points("xy"), turned, atol=EXACT)


@pytest.mark.parametrize(
    ("unit", "number"), [("m", 6), ("mm", 4), ("cm", 5), ("ft", 2), ("cubits", 0)]
)
def test_that_the_unit_is_that_of_the_model(tmp_path, unit, number):
    _, document = read(kc.draw(solved(four_bar(unit), 0.1, 2), tmp_path / "a.dxf"))
    assert document.header["$INSUNITS"] == number


def test_that_each_body_the_ground_joints_and_paths_have_a_layer(tmp_path):
    space, document = read(kc.draw(solved(four_bar()), tmp_path / "a.dxf"))
    own = {layer.dxf.name for layer in document.layers} - {"0", "Defpoints"}
    assert own == {"crank", "coupler", "rocker", "ground", "joints", "paths"}
    assert {item.dxf.layer for item in space} == own
    assert len({document.layers.get(name).rgb for name in ("crank", "coupler", "rocker")}) == 3


def test_that_a_body_called_as_a_layer_keeps_its_own(tmp_path):
    space, document = read(kc.draw(solved(four_bar(name="Joints")), tmp_path / "a.dxf"))
    names = {layer.dxf.name for layer in document.layers}
    assert {"Joints", "joints_"} <= names
    assert len(centres(space, "joints_")) == 5


def test_that_its_absence_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "ezdxf", None)
    with pytest.raises(kc.UnsupportedError, match=r"ezdxf is not installed; .*'\.\[dxf\]'"):
        kc.draw(solved(four_bar()), tmp_path / "a.dxf")
    assert list(tmp_path.iterdir()) == []

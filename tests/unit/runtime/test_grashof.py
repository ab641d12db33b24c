"""Grashof types against which links turn, by the positions of a four-bar with each angle."""

import itertools
import json
import math

import numpy as np
import pytest

import kincompile as kc
from kincompile.design.task_tables import read_fit
from kincompile.names import ROLES
from kincompile.runtime.results.grashof import margin_of, non_grashof

TYPES = {
    "crank-rocker": (4, 1, 3, 3.5), "rocker-crank": (4, 3, 3.5, 1), "double-crank": (1, 3, 3.5, 3),
    "double-rocker": (4, 3, 1, 3.5), "triple-rocker": (4, 2, 2.5, 3), "change point": (4, 2, 3, 3),
}  # fmt: skip
"""Lengths of ground, crank, coupler and rocker."""


def four_bar(lengths, driven="crank"):
    """Return a four-bar with its links where the crank is at an angle that they reach."""
    ground, crank, coupler, rocker = lengths
    for angle in np.linspace(0.1, 3, 60):
        a = crank * np.exp(1j * angle)
        way = ground - a
        size = abs(way)
        if abs(coupler - rocker) < size < coupler + rocker:
            break
    along = (coupler**2 - rocker**2 + size**2) / (2 * size)
    b = a + way / size * (along + 1j * math.sqrt(coupler**2 - along**2))
    s = kc.Sketch("bars", length_unit="mm", end=0.01)
    s.ground(O=(0, 0), C=(s.length("g", ground), 0))
    s.joints(A=(a.real, a.imag), B=(b.real, b.imag))
    s.link("crank", "O A", s.length("a", crank))
    s.link("coupler", "A B", s.length("b", coupler))
    s.link("rocker", "C B", s.length("c", rocker))
    at = {"crank": a, "coupler": b - a, "rocker": b - ground}[driven]
    s.drive(driven, float(np.angle(at)) + kc.t)
    return s.mechanism()


def measured(lengths, **options):
    m = four_bar(lengths, **options)
    (found,) = kc.solve(kc.compile(m), [0, 0.01]).measures().four_bars
    return found


def turning(lengths):
    """Return the links that have a position at every angle against the ground."""
    ground, crank, coupler, rocker = lengths
    z = np.exp(1j * np.linspace(0, 2 * np.pi, 721))

    def reaches(way, one, other):
        return bool(np.all((abs(one - other) < np.abs(way)) & (np.abs(way) < one + other)))

    found = {
        "crank": reaches(ground - crank * z, coupler, rocker),
        "coupler": reaches(ground + coupler * z, crank, rocker),
        "rocker": reaches(ground + rocker * z, coupler, crank),
    }
    return {name for name, turns in found.items() if turns}


@pytest.mark.parametrize("kind", TYPES)
def test_the_types_and_the_links_that_turn(kind):
    found = measured(TYPES[kind])
    assert found.type == kind
    assert found.lengths == pytest.approx(TYPES[kind], rel=1e-12)
    assert found.joints == ("O", "A", "B", "C")
    if kind != "change point":
        assert set(found.full) == turning(TYPES[kind])
        can = "can" if "crank" in found.full else "cannot"
        assert f"drive_crank {can} make a turn" in str(found)
    assert f"{kind}, {found.shortest} is the shortest" in str(found)
    s, p, q, l = sorted(TYPES[kind])  # noqa: E741
    assert found.margin == pytest.approx(p + q - s - l, abs=1e-12)


def test_that_the_rule_is_that_of_positions():
    """For random lengths: the sign of the margin, and that of the smooth number."""
    rng = np.random.default_rng(5)
    count = 0
    for lengths in rng.uniform(0.5, 4, (400, 4)).tolist():
        margin = margin_of(lengths)
        if max(lengths) > sum(lengths) / 2 - 0.05 or abs(margin) < 0.02:
            continue
        count += 1
        assert (margin > 0) == bool(turning(lengths) or _turns_inside(lengths))
        assert (margin > 0) == (non_grashof(lengths) < 0)
    assert count > 200


def _turns_inside(lengths):
    """Say whether any link turns when another one is the ground."""
    return any(turning(order) for order in itertools.islice(_inversions(lengths), 1, None))


def _inversions(lengths):
    for k in range(4):
        yield (*lengths[k:], *lengths[:k])


def test_that_the_driven_link_is_the_crank():
    found = measured(TYPES["rocker-crank"], driven="rocker")
    assert found.type == "crank-rocker"
    assert found.links == ("ground", "rocker", "coupler", "crank")
    assert "drive_rocker can make a turn" in str(found)


def test_pins_of_three_links_and_loops_on_the_ground():
    """Jansen's leg has two four-bars on the crank; D F and the legs make none with the ground."""
    m = kc.linkages.jansen().mechanism()
    found = kc.solve(kc.compile(m), [0, 0.01]).measures()
    assert [item.links for item in found.four_bars] == [
        ("ground", "crank", "upper_rod", "plate"), ("ground", "crank", "lower_rod", "rocker"),
    ]  # fmt: skip
    upper = found.four_bars[0]
    assert upper.lengths == pytest.approx((math.hypot(38, 7.8), 15, 50, 41.5), rel=1e-12)
    assert "O A C B   crank-rocker  crank" in str(found)


def test_that_it_is_written(tmp_path):
    solution = kc.solve(kc.compile(four_bar(TYPES["double-rocker"])), [0, 0.01])
    kc.write(solution, tmp_path / "motion.json")
    (item,) = json.loads((tmp_path / "motion.json").read_text())["four_bars"]
    assert (item["type"], item["shortest"], item["turns"]) == (
        "double-rocker", "coupler", ["coupler"],
    )  # fmt: skip
    assert item["margin"] == pytest.approx(1.5)
    assert item["links"]["rocker"] == pytest.approx(3.5)


@pytest.mark.every(5)
@pytest.mark.parametrize("kind", [*ROLES, "triple-rocker"])
def test_that_a_fit_keeps_the_type(kind):
    """A margin beyond that of the model, which the same angle of the rocker allows: it is met."""
    m = four_bar(TYPES[kind])
    (angle,) = kc.solve(kc.compile(m), 0.0)["rocker.phi"]
    at = kc.targets.value("rocker.phi", [angle], [0.0], within=1e-3)
    rule = non_grashof if kind == "triple-rocker" else margin_of
    least = 1.2 * rule(TYPES[kind])
    assert least > 0.01
    bounds = dict.fromkeys("abcg", (0.8, 6.0))
    target = kc.targets.grashof(kind, margin=least)
    found = kc.fit(m, [at, target], bounds=bounds, samples=128, starts=4)
    assert found.success, found.message
    lengths = [found.parameters[name] for name in "gabc"]
    assert rule(lengths) >= least - 1e-6
    shortest = lengths.index(min(lengths))
    assert kind == "triple-rocker" or shortest == ROLES.index(kind)
    assert f"{kind} of O A B C" in str(found)


def test_what_cannot_be_asked_for():
    with pytest.raises(kc.InputError, match="did you mean 'crank-rocker'"):
        kc.targets.grashof("crank-rockr")
    with pytest.raises(kc.InputError, match="give zero or more"):
        kc.targets.grashof("crank-rocker", margin=-1)
    m = kc.linkages.jansen().mechanism()
    value = kc.targets.value("plate.phi", [1.0], [0.0])
    with pytest.raises(kc.InputError, match=r"There are 2 four-bars\. Name a link"):
        kc.fit(m, [value, kc.targets.grashof("crank-rocker")], bounds={"b": (30, 50)})


def test_that_a_file_can_ask_for_it(tmp_path):
    model = kc.linkages.hoeken().mechanism()
    table = """
[fit]
parameters = { OA = [0.5, 2] }
targets = [{ grashof = "crank-rocker", link = "rocker", margin = 0.5 }]
"""
    (tmp_path / "hoeken.toml").write_text(model.to_toml() + table, encoding="utf-8")
    (target,) = read_fit(tmp_path / "hoeken.toml", model)["targets"]
    assert target == kc.targets.grashof("crank-rocker", "rocker", margin=0.5)
    limits = target.limits(model.system())
    values = {"OC": 2.0, "OA": 1.0, "AB": 2.5, "CB": 2.5}
    # 1 is the shortest: 8 - 2 (1 + l), with each other link as l
    rooms = [float(item.what.subs(values)) for item in limits]
    assert rooms == pytest.approx([2.0, 1.0, 1.0])
    assert limits[0].title == "crank-rocker of O A B C, with ground as l"


def test_that_bodies_with_outlines_have_measures(example_named):
    """Outlines are lists, so bodies go by their names."""
    solution = kc.solve(example_named("wrecker_boom").module, [0.0, 1.0])
    assert solution.measures().four_bars is not None

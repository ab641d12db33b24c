"""All equilibria at one time, against roots of the potential's slope over every assembly."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import brentq

import kincompile as kc

G = 9.81


def roots(potential):
    """Return the angles of a turn at which the slope of a potential is zero."""
    angles = np.linspace(0, 2 * np.pi, 2001)

    def slope(angle):
        return potential(angle + 1e-30j).imag / 1e-30

    slopes = [slope(angle) for angle in angles]
    signs = zip(angles[:-1], angles[1:], slopes[:-1], slopes[1:], strict=True)
    return [brentq(slope, a, b, xtol=1e-14) for a, b, first, last in signs if first * last < 0]


def found_angles(found, name):
    return np.sort([item[name][0] % (2 * np.pi) for item in found])


def slider_crank(k):
    """Return a slider-crank whose slider may stand turned round, held by a spring."""
    m = kc.Mechanism("slider_crank")
    m.gravity = (0, -G)
    crank = m.body("crank", (0, 0, 0.7), mass=2, inertia=0.1, centre=(0.25, 0))
    rod = m.body("rod", (0.4, 0.3, -0.3), mass=3, inertia=0.2, centre=(0.6, 0))
    slider = m.body("slider", (1.5, 0, 0), mass=1, inertia=0.05)
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (0.5, 0), rod, (0, 0)))
    m.add(kc.Revolute("B", rod, (1.2, 0), slider, (0, 0)))
    m.add(kc.Translational("T", m.ground, (0, 0), (1, 0), slider, (0, 0), (1, 0)))
    m.add(kc.Spring("s", m.ground, (0.8, 0.3), slider, (0, 0), k, 0.1))
    return m


def slider_crank_potential(side, k):
    def potential(angle):
        x = 0.5 * np.cos(angle) + side * np.sqrt(1.44 - (0.5 * np.sin(angle)) ** 2)
        stretch = np.sqrt((x - 0.8) ** 2 + 0.09) - 0.1
        return G * (2 * 0.25 + 3 * 0.25) * np.sin(angle) + k / 2 * stretch**2

    return potential


def four_bar(k):
    m = kc.Mechanism("four_bar")
    m.gravity = (0, -G)
    a = m.body("a", (0, 0, 1.0), mass=2, inertia=0.1, centre=(0.25, 0))
    b = m.body("b", (0.3, 0.4, 0.3), mass=3, inertia=0.2, centre=(0.6, 0))
    c = m.body("c", (1, 0, 1.3), mass=1, inertia=0.05, centre=(0.4, 0))
    m.add(kc.Revolute("O", m.ground, (0, 0), a, (0, 0)))
    m.add(kc.Revolute("A", a, (0.5, 0), b, (0, 0)))
    m.add(kc.Revolute("B", b, (1.2, 0), c, (0.8, 0)))
    m.add(kc.Revolute("C", m.ground, (1, 0), c, (0, 0)))
    m.add(kc.Spring("s", m.ground, (0.2, 1.0), b, (0.6, 0.3), k, 0.2))
    return m


def four_bar_potential(side, k):
    def potential(angle):
        x, y = 0.5 * np.cos(angle), 0.5 * np.sin(angle)
        away = np.sqrt((1 - x) ** 2 + y**2)
        along = (1.44 - 0.64 + away**2) / (2 * away)
        aside = side * np.sqrt(1.44 - along**2)
        cos = (along * (1 - x) + aside * y) / away / 1.2
        sin = (-along * y + aside * (1 - x)) / away / 1.2
        weights = 2 * y / 2 + 3 * (y + 0.6 * sin) + 0.4 * (y + 1.2 * sin) / 0.8
        foot = x + 0.6 * cos - 0.3 * sin - 0.2, y + 0.6 * sin + 0.3 * cos - 1.0
        return G * weights + k / 2 * (np.sqrt(foot[0] ** 2 + foot[1] ** 2) - 0.2) ** 2

    return potential


@pytest.mark.slow
@pytest.mark.parametrize("k", [100, *(pytest.param(k, marks=pytest.mark.slow) for k in (20, 400))])
def test_that_both_ways_of_the_slider_are_found(k):
    found = kc.equilibria(kc.compile(slider_crank(k)))
    wanted = sorted(x for side in (1, -1) for x in roots(slider_crank_potential(side, k)))
    np.testing.assert_allclose(found_angles(found, "crank.phi"), np.repeat(wanted, 2), atol=1e-9)
    turned = [round(item["slider.phi"][0] / np.pi) % 2 for item in found]
    assert sum(turned) == len(wanted)
    # Along each of the two ways round, peaks and valleys of the potential alternate.
    assert [item.stability[0] for item in found].count("stable") == len(wanted)


@pytest.mark.slow
@pytest.mark.parametrize("k", [60, 100, 300, 3000])
def test_that_both_assemblies_of_a_four_bar_are_searched(k):
    found = kc.equilibria(kc.compile(four_bar(k)))
    wanted = sorted(x for side in (1, -1) for x in roots(four_bar_potential(side, k)))
    np.testing.assert_allclose(found_angles(found, "a.phi"), wanted, atol=1e-9)
    assert [item.stability[0] for item in found].count("stable") == len(wanted) / 2


@pytest.mark.slow
@pytest.mark.parametrize("rods", [3, 4])
def test_that_every_kind_of_saddle_of_a_chain_is_found(rods):
    """Each rod stands along what pulls at it, or against it."""
    m = kc.Mechanism("chain")
    m.gravity = (0, -G)
    last = m.ground
    at: tuple[float, float] = (0, 0)
    for k in range(rods):
        rod = m.body(f"rod{k}", (0, -k, -1.5), mass=1 + k, inertia=0.1, centre=(0.4, 0))
        m.add(kc.Revolute(f"pin{k}", last, at, rod, (0, 0)))
        last, at = rod, (0.8, 0)
    m.add(kc.Force("pull", last, at, (5, 0)))
    found = kc.equilibria(kc.compile(m))
    # About its upper pin: half of its own weight and all that hangs below it, against the pull.
    weights = [sum(range(k + 2, rods + 1)) for k in range(rods)]
    hanging = [np.arctan2(-G * (below + (1 + k) / 2), 5) for k, below in enumerate(weights)]
    ways = list(product((0, np.pi), repeat=rods))
    seen = np.array([[item[f"rod{k}.phi"][0] for k in range(rods)] for item in found])
    wanted = np.array(hanging) + np.array(ways)
    apart = np.abs(np.exp(1j * seen[:, np.newaxis]) - np.exp(1j * wanted)).max(axis=2)
    assert apart.shape == (2**rods, 2**rods)
    np.testing.assert_allclose(apart.min(axis=0), 0, atol=1e-9)
    kinds = [int((item.eigenvalues[0] < 0).sum()) for item in found]
    assert sorted(kinds) == sorted(sum(angle > 0 for angle in way) for way in ways)

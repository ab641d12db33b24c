"""The rank where every position near the guess is singular, and where bars really are redundant.

Four-bars in a chain with all links equal lie flat in one line. Near that pose the manifold has
components on which some of the rhombi stay flat: there Phi_q has a lower rank throughout, and still
every equation is needed. N + 1 cranks and N couplers have 6 N + 3 coordinates and one freedom.
"""

import math

import numpy as np
import pytest
import sympy

import kincompile as kc


def four_bars(count, width, angle):
    """Return a chain of parallelograms: cranks of length 1, couplers and ground of another one."""
    m = kc.Mechanism("chain")
    c, s = math.cos(angle), math.sin(angle)
    cranks = [
        m.body(f"crank{k}", guess=(k * width + c / 2, s / 2, angle)) for k in range(count + 1)
    ]
    for k, crank in enumerate(cranks):
        m.add(kc.Revolute(f"A{k}", m.ground, (k * width, 0), crank, (-0.5, 0)))
    for k in range(count):
        coupler = m.body(f"coupler{k}", guess=((k + 0.5) * width + c, s, 0))
        m.add(kc.Revolute(f"B{k}", cranks[k], (0.5, 0), coupler, (-width / 2, 0)))
        m.add(kc.Revolute(f"C{k}", coupler, (width / 2, 0), cranks[k + 1], (0.5, 0)))
    return m


@pytest.mark.every(5)
@pytest.mark.parametrize("angle", [0.0, 0.7])
@pytest.mark.parametrize("width", [1.0, 1.5])
@pytest.mark.parametrize("count", [1, 2, 3, 5, 8, 12])
def test_that_a_chain_of_four_bars_has_one_freedom_and_no_redundancy(count, width, angle):
    found = kc.inspect(four_bars(count, width, angle))
    assert (found.rank, found.degrees_of_freedom) == (6 * count + 2, 1)
    assert (found.redundant, found.conflicting) == ((), ())
    assert len(found.missing_drivers) == 1


@pytest.mark.parametrize("angle", [0.0, 0.4])
@pytest.mark.parametrize(("count", "width"), [(2, 1.0), (5, 1.0), (5, 1.5)])
def test_that_one_more_parallel_bar_is_redundant_all_the_same(count, width, angle):
    m = four_bars(count, width, angle)
    c, s = math.cos(angle), math.sin(angle)
    bar = m.body("bar", guess=(1.3 * width + c / 2, s / 2, angle))
    m.add(kc.Revolute("E", m.ground, (1.3 * width, 0), bar, (-0.5, 0)))
    m.add(kc.Revolute("F", bar, (0.5, 0), "coupler1", (-0.2 * width, 0)))
    found = kc.inspect(m)
    assert (found.degrees_of_freedom, len(found.redundant), found.conflicting) == (1, 1, ())


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_that_a_bearing_written_twice_is_the_one_that_is_redundant(angle):
    m = four_bars(5, 1.0, angle)
    m.add(kc.Revolute("twice", m.ground, (1, 0), "crank1", (-0.5, 0)))
    assert kc.inspect(m).redundant == ("twice.x", "twice.y")


@pytest.mark.parametrize("driven", [False, True])
@pytest.mark.parametrize("angle", [0.0, 1e-4, 1e-2, 0.3, math.pi / 2, 3.0, math.pi])
@pytest.mark.parametrize("count", [3, 4, 6])
def test_that_parallel_bars_are_redundant_from_every_guess(count, angle, driven):
    """Flat in one line, too, where a driver may lead to another branch."""
    m = kc.Mechanism("bars")
    c, s = math.cos(angle), math.sin(angle)
    coupler = m.body("coupler", guess=(c, s, 0))
    for k in range(count):
        bar = m.body(f"bar{k}", guess=(2 * k + c / 2, s / 2, angle))
        m.add(kc.Revolute(f"foot{k}", m.ground, (2 * k, 0), bar, (-0.5, 0)))
        m.add(kc.Revolute(f"head{k}", bar, (0.5, 0), coupler, (2 * k, 0)))
    if driven:
        m.add(kc.AbsoluteAngle("motor", "bar0", angle + kc.t))
    found = kc.inspect(m)
    assert found.degrees_of_freedom == (0 if driven else 1)
    assert (len(found.redundant), found.conflicting) == (count - 2, ())


def dixon(excess):
    """Return nine bars between three points of the x axis and three of the y axis (Dixon, 1899).

    With the lengths that these places give the bars move; one bar longer, and nothing does.
    """
    across, along = [0.7, -1.1, 1.6], [0.9, -0.6, 1.9]
    symbols = [sympy.symbols(f"u{k} v{k}") for k in range(6)]
    guess = [*((value, 0) for value in across), *((0, value) for value in along)]
    equations = []
    for i, (u, v) in enumerate(symbols[:3]):
        for j, (x, y) in enumerate(symbols[3:]):
            length = across[i] ** 2 + along[j] ** 2 + (excess if i == j == 0 else 0)
            equations.append((u - x) ** 2 + (v - y) ** 2 - length)
    names = " ".join(str(symbol) for pair in symbols for symbol in pair)
    return kc.ConstraintSystem("dixon", names, equations, guess=np.ravel(guess).tolist())


@pytest.mark.parametrize(("excess", "redundant"), [(0.0, ("equation_9",)), (0.05, ())])
def test_that_what_moves_by_its_dimensions_alone_is_redundant(excess, redundant):
    """Nine equations: with three freedoms of the plane they leave 12 - 9, of Dixon's bars one more.

    The difference is not seen in the pattern, nor at the guess.
    """
    found = kc.inspect(dixon(excess))
    assert (found.rank, found.redundant, found.conflicting) == (9 - len(redundant), redundant, ())


def test_that_a_truss_at_its_limit_repeats_nothing():
    """Two bars as long together as their feet are apart: one position, and it is singular."""
    x, y = sympy.symbols("x y")
    equations = [x**2 + y**2 - 1, (x - 3) ** 2 + y**2 - 4]
    found = kc.inspect(kc.ConstraintSystem("flat", "x y", equations, guess=(1, 0.1)))
    assert (found.rank, found.rank_at_start, found.redundant) == (2, 1, ())

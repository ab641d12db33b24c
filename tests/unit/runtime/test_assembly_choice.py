"""Which way a mechanism is assembled: said where nothing chooses, taken by its number."""

import warnings

import numpy as np
import pytest

import kincompile as kc

from .conftest import nearly_dead_slider

A, B, C, D = 10.0, 26.0, 18.0, 20.0
ANGLES = {  # of coupler and rocker at a crank angle of 0, by the law of cosines
    sign: (
        sign * np.arccos(((D - A) ** 2 + B**2 - C**2) / (2 * (D - A) * B)) % (2 * np.pi),
        (np.pi - sign * np.arccos(((D - A) ** 2 + C**2 - B**2) / (2 * (D - A) * C))) % (2 * np.pi),
    )
    for sign in (1, -1)
}


def four_bar(target="numpy", turned=0.0, **guesses):
    """Return a compiled four-bar; guesses by body, its rocker's frame turned by an angle."""
    m = kc.Mechanism("four_bar", end=4.0)
    d = m.parameter("d", D)
    end = (C * np.cos(turned), C * np.sin(turned))
    crank, coupler, rocker = (
        m.body(name, guess=guesses.get(name, (0, 0, 0))) for name in ("crank", "coupler", "rocker")
    )
    m.add(kc.Revolute("O", crank, (0, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("A", crank, (A, 0), coupler, (0, 0)))
    m.add(kc.Revolute("B", coupler, (B, 0), rocker, end))
    m.add(kc.Revolute("C", rocker, (0, 0), m.ground, (d, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 1.5 * kc.t))
    return kc.compile(m, target=target)


TIMES = np.linspace(0, 4, 60)


@pytest.mark.parametrize("target", ["numpy", "c"])
@pytest.mark.parametrize("turned", [0.0, 0.2])
def test_that_a_mechanism_without_a_guess_says_first_that_nothing_chooses(
    target, turned, quick_compiler
):
    module = four_bar(target, turned=turned)
    with pytest.warns(kc.AssemblyWarning, match="no guess of coupler, rocker") as caught:
        solution = kc.solve(module, TIMES)
    assert solution.success
    text = str(caught[0].message)
    assert "2 assemblies at t = 0, which differ in coupler, rocker; this is number" in text
    assert "assembly=" in text
    assert solution.message.startswith(text)
    assert caught[0].filename == __file__


def test_that_the_number_it_says_is_that_of_the_assembly_it_took():
    module = four_bar()
    with pytest.warns(kc.AssemblyWarning) as caught:
        solution = kc.solve(module, TIMES)
    number = int(str(caught[0].message).split("this is number ")[1][0])
    np.testing.assert_allclose(solution.q[0], kc.assemblies(module)[number - 1], atol=1e-9)


def test_that_each_assembly_is_taken_by_its_number_and_says_nothing():
    module, signs = four_bar(), set()
    for number in (1, 2):
        solution = kc.solve(module, TIMES, assembly=number)
        assert solution.success
        np.testing.assert_allclose(solution.q[0], kc.assemblies(module)[number - 1], atol=1e-12)
        found = solution["coupler.phi"][0], solution["rocker.phi"][0]
        sign = 1 if found[0] > 0 else -1
        assert np.remainder(found, 2 * np.pi) == pytest.approx(ANGLES[sign], abs=1e-9)
        assert solution.message.startswith("four_bar: all 60 points")
        signs.add(sign)
    assert signs == {1, -1}


def test_that_an_assembly_is_that_of_the_first_time_and_of_the_parameters():
    module, p = four_bar(), {"d": 22.0}
    expected = kc.assemblies(module, 1.0, p)[1]
    solution = kc.solve(module, TIMES[TIMES >= 1] - TIMES[TIMES >= 1][0] + 1, p, assembly=2)
    np.testing.assert_allclose(solution.q[0], expected, atol=1e-12)
    sets = np.array([22.0, 21.0]).reshape(2, 1, 1)
    variants = kc.solve(module, 1 + TIMES / 10, sets, assembly=2)
    np.testing.assert_allclose(variants.q[0, 0], expected, atol=1e-9)
    assert variants.success


def test_that_variants_say_it_too():
    with pytest.warns(kc.AssemblyWarning, match="no guess of coupler, rocker"):
        solution = kc.solve(four_bar(), TIMES, np.array([20.0, 21.0]).reshape(2, 1, 1))
    assert "2 assemblies" in solution.message


@pytest.mark.parametrize(
    "guesses",
    [
        {"coupler": (0, 0, 0.5), "rocker": (0, 0, 1.5)},
        {"coupler": (10, 0, 0.5), "rocker": (20, 0, -2.3)},
        {"coupler": (10, 0, -1)},
    ],
)
def test_that_a_guess_that_chooses_is_not_remarked_on(guesses):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert kc.solve(four_bar(**guesses), TIMES).success


def test_that_a_guess_given_to_solve_chooses_by_the_names_of_a_solution():
    module = four_bar()
    for sign in (1, -1):
        guess = {"coupler.phi": sign * 0.5, "rocker.phi": sign * 1.5}
        solution = kc.solve(module, TIMES, guess=guess)
        assert np.sign(solution["coupler.phi"][0]) == sign
        assert solution.q[0] == pytest.approx(
            kc.solve(module, TIMES, guess={k.split(".")[1] + "_" + k.split(".")[0]: v
                                           for k, v in guess.items()}).q[0]
        )  # fmt: skip


def test_that_a_folded_guess_of_ones_own_is_remarked_on():
    with pytest.warns(
        kc.AssemblyWarning, match="the guess lies folded, and there are 2 assemblies"
    ):
        kc.solve(four_bar(), 0.0, guess={"coupler.phi": 0.1, "rocker.phi": 0.1})


def test_that_a_slider_without_a_guess_is_not_remarked_on(example_named):
    m = kc.Mechanism("slider_crank")
    crank, rod, slider = (m.body(name) for name in ("crank", "rod", "slider"))
    m.add(kc.Revolute("O", m.ground, (0, 0), crank, (0, 0)))
    m.add(kc.Revolute("A", crank, (0.1, 0), rod, (0, 0)))
    m.add(kc.Revolute("B", rod, (0.3, 0), slider, (0, 0)))
    m.add(kc.Translational("guide", m.ground, (0, 0), (1, 0), slider, (0, 0), (1, 0)))
    m.add(kc.AbsoluteAngle("motor", crank, 1 + kc.t))
    solution = kc.solve(kc.compile(m), TIMES)  # a warning would be an error here
    assert solution["slider.x"][0] > 0  # the way that one means


@pytest.mark.parametrize("number", [0, 3, -1, "1", True, 1.0])
def test_that_a_number_without_an_assembly_is_refused(number):
    with pytest.raises(kc.InputError, match=rf"assembly is {number!r}: .* count from 1"):
        kc.solve(four_bar(), TIMES, assembly=number)


def test_that_a_guess_and_an_assembly_are_not_both_taken():
    with pytest.raises(kc.InputError, match="guess and assembly are both given"):
        kc.solve(four_bar(), TIMES, guess={"coupler.phi": 1}, assembly=1)


@pytest.mark.parametrize("target", ["numpy", "c"])
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_that_a_slider_is_found_on_its_nearer_side(target, unit, quick_compiler):
    model, sides, beyond = nearly_dead_slider(unit)
    module = kc.compile(model, target=target)
    lengths = np.array([unit, unit, 1, unit, unit, 1])
    for guess in beyond:
        solution = kc.solve(module, 0.0, guess=guess)
        np.testing.assert_allclose(solution.q[0], sides[0], rtol=0, atol=1e-9 * unit)
        assert "on another branch than the guess" in solution.message
    # Half way between both, either will do, but it is said.
    between = sides.mean(axis=0) + 0.09 * np.array([0, 1, 1, 0, 1, 1]) * lengths
    solution = kc.solve(module, 0.0, guess=between)
    assert "rod, block elsewhere, is as near to the guess" in solution.message

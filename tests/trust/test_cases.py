"""Mechanisms that cannot be analysed, or not assembled, or look as if they could not."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import kincompile as kc
from kincompile.runtime.status import Status

TARGETS = ("numpy", "c", "grouped")


@cache
def compiled(model, target):
    options = {"grouped": {"form": "grouped"}}.get(target, {"target": target})
    return kc.compile(model, **options)


@pytest.fixture(params=TARGETS)
def compiled_for(request):
    """Return a function that compiles for a target, or in grouped form, each model once."""
    request.getfixturevalue("quick_compiler")
    return lambda model: compiled(model, request.param)


def the_event(solution):
    (event,) = solution.events
    assert event.message in solution.message
    return event


LOCK_UP, BIFURCATION = "End the motion before this time", "through='smooth'"


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("name", "p", "kind", "time", "bodies", "next_step"),
    [
        ("problem_3_5_6", None, "lock-up", 4.5, ("y2", "phi3"), LOCK_UP),
        ("example_3_7_5", {"l": 0.5}, "lock-up", 2.0, ("x2", "phi2"), LOCK_UP),
        ("example_3_7_5", {"l": 1.0}, "bifurcation", 6.0, ("x2", "phi2"), BIFURCATION),
        ("example_3_7_5", {"l": 1.5}, None, None, None, None),
    ],
)
@pytest.mark.parametrize("points", [23, pytest.param(400, marks=pytest.mark.slow)])
def test_the_cases_of_the_textbook(
    example_named, compiled_for, points, name, p, kind, time, bodies, next_step
):
    module = compiled_for(example_named(name).model)
    solution = kc.solve(module, np.linspace(0, 7, points), p=p)
    if kind is None:
        assert solution.success
        assert not solution.events
        return
    event = the_event(solution)
    assert (event.kind, event.bodies) == (kind, bodies)
    assert abs(event.t - time) < 1e-6
    assert next_step in event.message
    before = solution.t < time - 1e-9
    assert np.all(solution.status[before] == Status.CONVERGED)
    assert np.all(solution.status[~before] != Status.CONVERGED)


@pytest.mark.slow
def test_that_a_variant_ends_where_it_does_alone(example_named, compiled_for):
    module = compiled_for(example_named("example_3_7_5").model)
    rods = np.array([0.5, 0.8, 1.0, 1.5])
    t = np.linspace(0, 7, 100)
    together = kc.solve(module, t, p=rods.reshape(-1, 1, 1))
    ends = [2.0, 12 / np.pi * np.arcsin(0.8), 6.0, np.inf]
    for rod, end, status in zip(rods, ends, together.status, strict=True):
        np.testing.assert_array_equal(status == Status.CONVERGED, t < end)
        np.testing.assert_array_equal(status, kc.solve(module, t, p=[rod]).status)


def test_a_five_bar_with_a_driver_missing(build):
    with pytest.raises(kc.StructuralError, match="1 more equation is needed") as caught:
        kc.solve(kc.compile(build["five_bar"](drivers=1)), 0)
    assert re.search(r"Nothing determines, for instance, phi_(left_rod|right_rod|right)",
                     str(caught.value))  # fmt: skip
    assert "add a joint or a driver" in str(caught.value)


def test_a_five_bar_with_two_drivers_too_many(build):
    with pytest.raises(kc.StructuralError, match="2 equations are too many") as caught:
        kc.solve(kc.compile(build["five_bar"](drivers=4)), 0)
    assert "Candidates to remove: motor3, motor4" in str(caught.value)


def test_that_a_five_bar_with_its_two_drivers_moves(build):
    assert kc.solve(kc.compile(build["five_bar"]()), np.linspace(0, 1, 5)).success


def test_a_four_bar_whose_links_are_too_short(build, compiled_for):
    a, b, c, d = lengths = (0.2, 0.5, 0.4, 2.0)
    solution = kc.solve(compiled_for(build["four_bar"](lengths)), np.linspace(0, 1, 5))
    assert solution.status.tolist() == [Status.NOT_ASSEMBLED] + 4 * [Status.NOT_REACHED]
    message = solution.message
    found = re.findall(r"(?:[A-D]\.[xy]|motor) = (-?\d[\d.e-]*\d)", message)
    largest = max(abs(float(value)) for value in found)
    # Somewhere along the loop a gap must stay, at least a fourth of what is missing.
    missing = abs(d - a * np.exp(1j)) - (b + c)
    assert largest >= 0.9 * missing / 4
    assert solution.residual[0] == pytest.approx(largest, rel=1e-2)
    places = re.findall(r"(crank|coupler|rocker) at \((\S+), (\S+)\), angle", message)
    assert [name for name, _, _ in places] == ["crank", "coupler", "rocker"]
    # The rods lie as far out as they reach: the coupler's middle is near the line from A to D.
    (_, x, y) = places[1]
    assert abs(float(y)) < 0.25
    assert 0.2 < float(x) < 1.5
    assert "Change lengths" in message
    assert kc.assemblies(kc.compile(build["four_bar"](lengths))).shape == (0, 9)


def test_that_millimetres_are_no_false_alarm(build, compiled_for):
    """The plain condition number is near 4e5 by the unit alone, the scaled one is 13."""
    module = compiled_for(build["four_bar"]((380.0, 950.0, 760.0, 950.0), unit="mm"))
    solution = kc.solve(module, np.linspace(0, 6, 100))
    assert solution.success
    assert not solution.events
    assert 3e5 < np.max(np.linalg.cond(module.Phi_q(solution.q, solution.t))) < 5e5
    assert np.max(solution.condition) < 15
    metres = kc.compile(build["four_bar"]((0.38, 0.95, 0.76, 0.95)))
    alike = kc.solve(metres, np.linspace(0, 6, 100))
    np.testing.assert_allclose(solution["phi_rocker_ddot"], alike["phi_rocker_ddot"], atol=1e-8)
    np.testing.assert_allclose(solution.condition, alike.condition, rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "t", "away"),
    [
        ("four_bar", 10 / 11 * 10, (0, 1, 0)),
        ("four_bar", 10 / 11 * 10, (1, 1, 0)),
        ("inverted_slider_crank", 0.0, (0, -1, 1)),
        ("inverted_slider_crank", 0.0, (1, 1, -1)),
    ],
)
def test_that_a_guess_36_degrees_away_keeps_its_branch(example_named, compiled_for, name, t, away):
    """Newton's own steps lead from each of these to the other way to assemble the mechanism."""
    example = example_named(name)
    motion = kc.solve(example.module, np.linspace(0, t, 200) if t else 0.0)
    there = motion.q[-1]
    guess = there.copy()
    guess[2::3] += np.radians(36) * np.array(away)
    q, taken = guess.copy(), 0
    while taken < 25:  # plain Newton, by hand
        Phi, Phi_q = example.module.position(q, t)
        q, taken = q - np.linalg.solve(Phi_q, Phi), taken + 1
    assert np.max(np.abs(example.module.Phi(q, t))) < 1e-9
    turned = np.remainder(q - there + np.pi, 2 * np.pi) - np.pi
    assert np.max(np.abs(turned[2::3])) > 0.5  # the other way
    solution = kc.solve(compiled_for(example.model), t, guess=guess)
    assert solution.success
    np.testing.assert_allclose(solution.q[0], there, atol=1e-8)


@pytest.mark.parametrize(
    ("name", "t", "count"),
    [("four_bar", 1.0, 2), ("slider_crank", 1.0, 2), ("problem_3_5_6", 1, 2)],
)
def test_the_assemblies_of_the_examples(example_named, compiled_for, name, t, count):
    module = compiled_for(example_named(name).model)
    found = kc.assemblies(module, t)
    assert found.shape == (count, module.N_COORDINATES)
    np.testing.assert_allclose(found[0], kc.solve(module, np.linspace(0, t, 40)).q[-1], atol=1e-8)


def test_that_assemblies_take_parameters(example_named):
    module = example_named("example_3_7_5").module
    two = kc.assemblies(module, 3.0, {"l": 1.5})
    assert two.shape == (2, 3)
    angle = np.arccos(np.sin(np.pi / 4) / 1.5)  # sin(phi1) = l cos(phi2)
    np.testing.assert_allclose(sorted(two[:, 2]), [-angle, angle], atol=1e-9)
    assert kc.assemblies(module, 3.0, [0.5]).shape == (0, 3)
    with pytest.raises(kc.InputError, match="assemblies are those of one time"):
        kc.assemblies(module, [0.0, 1.0])


@pytest.mark.slow
def test_that_another_branch_than_the_guess_is_told(example_named, compiled_for):
    """Where det Phi_q of the guess and of the position differ in sign, and no small steps help."""
    example = example_named("four_bar")
    module = compiled_for(example.model)
    random = np.random.default_rng(0)
    told = 0
    for _ in range(40):
        guess = random.uniform(-20, 20, 9)
        solution = kc.solve(module, 0.0, guess=guess)
        if solution.success:
            of_guess, found = (
                np.sign(np.linalg.det(module.Phi_q(q, 0.0))) for q in (guess, solution.q[0])
            )
            says = "is on another branch than the guess" in solution.message
            assert says == (of_guess != found)
            told += says
    assert told > 0


def test_that_the_page_on_singular_configurations_tells_the_truth():
    text = (Path(__file__).resolve().parents[2] / "docs" / "singular.md").read_text("utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    calls = re.findall(r"^(kc\.solve\(.*\)\.\w+)  # (.*)$", code, re.MULTILINE)
    assert len(calls) == 3
    names: dict[str, object] = {}
    exec(code.split("kc.solve", maxsplit=1)[0], names)
    for call, comment in calls[:2]:
        assert repr(eval(call, names)) == comment
    with pytest.warns(kc.BranchSwitchWarning):
        assert eval(calls[2][0], names) is True

"""Emitted transmissions in every language, beside tables of 60 digits and closed forms.

The tables of `transmission_golden.json` have two derivations each: by legs, and by loop equations.
"""

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import kincompile as kc
from kincompile.emitters.registry import TARGETS
from tests import transmission_models as models
from tests.targets.transmission_calls import called, go, start

GOLDEN = json.loads(
    (Path(__file__).resolve().parents[1] / "data" / "transmission_golden.json").read_text()
)
CASES = {
    "T1a": (models.crank_rocker, ["motor"], ["phi_rocker"]),
    "T3-SPU": (models.ankle, ["left", "right"], ["pitch", "roll"]),
    "T6": (models.five_bar, ["motor_1", "motor_2"], ["end"]),
}
CONVERGED, NOT_CONVERGED, SINGULAR, NOT_FINITE = range(4)
LONG = pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")


@cache
def emitted(case, target):
    """Return the files of a case."""
    build, inputs, outputs = CASES[case]
    return kc.emit(build(), target, transmission=(inputs, outputs))


@pytest.fixture(params=list(TARGETS))
def target(request):
    """Each target in turn."""
    return request.param


@pytest.fixture
def run(target, tmp_path, quick_compiler):
    """Return what calls give in a target."""

    def calls_of(case, calls, tau):
        return called(target, emitted(case, target), calls, tau, tmp_path, quick_compiler)

    return calls_of


def joined(case):
    """Return the poses of the assembly that a model begins at."""
    poses = GOLDEN[case]["poses"]
    return [x for x in poses if x.get("branch") == poses[0].get("branch")]


@pytest.mark.parametrize("case", ["T1a", "T3-SPU"])
def test_outputs_slopes_and_torques_are_those_of_the_table(run, case):
    poses = joined(case)
    began, *found = run(case, [start(), *(go(*x["u"]) for x in poses)], poses[0]["tau_x"])
    assert began == CONVERGED
    for here, pose in zip(found, poses, strict=True):
        assert here.status == CONVERGED
        np.testing.assert_allclose(here.x, pose["x"], rtol=0, atol=1e-13)
        size = np.abs(pose["J"]).max()
        np.testing.assert_allclose(here.J, pose["J"], rtol=0, atol=1e-10 * size)
        np.testing.assert_allclose(here.effort, pose["tau_u"], rtol=1e-9)


def test_points_are_outputs_one_by_one(run):
    poses = joined("T6")[:2]
    began, *found = run("T6", [start(), *(go(*x["u"]) for x in poses)], poses[0]["tau_x"])
    assert began == CONVERGED
    for here, pose in zip(found, poses, strict=True):
        np.testing.assert_allclose(here.x, pose["x"], rtol=0, atol=1e-14)
        np.testing.assert_allclose(here.J, pose["J"], rtol=0, atol=1e-11)


def test_a_path_that_goes_round_comes_back(run):
    turns = [start(), *(go(1.5 + 2 * math.pi * k / 40) for k in range(1, 41)), go(1.5)]
    _, *found = run("T1a", turns, [1.0])
    x = np.array([here.x[0] for here in found])
    assert {here.status for here in found} == {CONVERGED}
    assert abs(x[-1] - GOLDEN["T1a"]["poses"][1]["x"][0]) < 1e-13
    assert np.ptp(x) > 1.0  # the rocker swings by 61 degrees


def test_a_far_input_is_followed_on_the_same_branch(run):
    """A whole turn in one call: Newton from the last position alone ends on the other assembly."""
    for far in (1.5 + math.pi, 1.5 + 2 * math.pi, 1.5 - 20 * math.pi):
        _, here = run("T1a", [start(), go(far)], [1.0])
        assert here.status == CONVERGED
        a, b, c, d = (GOLDEN["T1a"]["parameters"][x] for x in "abcd")
        at = a * np.exp(1j * far)  # the crank's end, and from there the rocker's
        coupler = d + c * np.exp(1j * here.x[0]) - at
        assert abs(abs(coupler) - b) < 1e-14
        assert (coupler * np.conj(d - at)).imag > 0  # left of the line from B to D


def test_beyond_a_singular_position_there_is_a_status_and_no_number(run):
    (singular, *_) = (x for x in GOLDEN["T3-SPU"]["singular"] if x["type"] == 2)
    beyond = [0.35, 0.35]
    calls = [start(), go(*singular["u"]), go(*beyond), go(0.2251, 0.2251)]
    began, near, over, back = run("T3-SPU", calls, [1.0, 1.0])
    assert began == CONVERGED
    for here in (near, over):
        assert here.status == SINGULAR
        assert np.isnan([*here.x, *here.J.ravel()]).all()
    # the state stayed on its branch
    assert back.status == CONVERGED
    assert np.abs(back.x).max() < 1e-3


def test_a_singular_position_is_left_again_on_the_same_branch(target, tmp_path, quick_compiler):
    """T1b ends at both sides; demands beyond, and back again, never change the assembly."""
    lengths = [GOLDEN["T1b"]["parameters"][x] for x in "abcd"]
    model = models.crank_rocker(*lengths, psi=0.99, motor=1.0)
    files = kc.emit(model, target, transmission=(["motor"], ["phi_rocker"]))
    pose = GOLDEN["T1b"]["poses"][1]
    ends = sorted(x["u"][0] for x in GOLDEN["T1b"]["singular"] if x["type"] == 2 and "u" in x)
    calls = [start()]
    for far in (3.0, 0.2, 2.7, ends[1], ends[0], -0.4):
        calls += [go(far), go(*pose["u"])]
    _, *found = called(target, files, calls, pose["tau_x"], tmp_path, quick_compiler)
    for over, back in zip(found[::2], found[1::2], strict=True):
        assert over.status == SINGULAR
        assert back.status == CONVERGED
        np.testing.assert_allclose(back.x, pose["x"], rtol=0, atol=1e-13)
        np.testing.assert_allclose(back.J, pose["J"], rtol=1e-9)


def test_a_wrong_start_says_so(run):
    pose = GOLDEN["T1a"]["poses"][1]
    crossed = GOLDEN["T1a"]["assemblies"]["x"][1]
    _, *found = run("T1a", [start(), start([1.5], pose["x"]), start([1.5], [2.9]), go(1.6)], [1.0])
    assert found[0] == CONVERGED
    assert found[1] == NOT_CONVERGED
    began, here = run("T1a", [start([1.5], crossed), go(1.5)], [1.0])
    assert began == CONVERGED
    np.testing.assert_allclose(here.x, crossed, rtol=0, atol=1e-13)


def test_parameters_are_the_callers(run):
    """T1b is the crank-rocker with other lengths."""
    p = [GOLDEN["T1b"]["parameters"][x] for x in "abcd"]
    pose, other = GOLDEN["T1b"]["poses"][1:3]
    calls = [start(pose["u"], pose["x"], p), go(*other["u"])]
    began, here = run("T1a", calls, other["tau_x"])
    assert began == CONVERGED
    np.testing.assert_allclose(here.x, other["x"], rtol=0, atol=1e-13)
    np.testing.assert_allclose(here.J, other["J"], rtol=1e-10)


def test_an_input_that_is_no_number_is_not_finite(run):
    calls = [start(), go(1e200), go(1.6)]
    _, far, back = run("T1a", calls, [1.0])
    assert far.status != CONVERGED
    assert np.isnan(far.x).all()
    assert back.status == CONVERGED


def test_angular_velocities_have_slopes_and_no_value(target, tmp_path, quick_compiler):
    """omega = e_y pitch_dot + Ry(pitch) e_x roll_dot, by hand."""
    spins = [f"omega_{axis}_foot" for axis in "xyz"]
    wanted = ["left", "right"], ["pitch", "roll", *spins]
    files = kc.emit(models.ankle(), target, transmission=wanted)
    poses = joined("T3-SPU")
    calls = [start(), *(go(*x["u"]) for x in poses)]
    _, *found = called(target, files, calls, [0.0, 0.0, 1.0, 2.0, 3.0], tmp_path, quick_compiler)
    for here, pose in zip(found, poses, strict=True):
        pitch, _ = pose["x"]
        by_hand = np.array([[0, math.cos(pitch)], [1, 0], [0, -math.sin(pitch)]]) @ pose["J"]
        assert here.status == CONVERGED
        assert np.isnan(here.x).tolist() == [False, False, True, True, True]
        np.testing.assert_allclose(here.J[2:], by_hand, rtol=0, atol=1e-9)
        np.testing.assert_allclose(here.effort, by_hand.T @ [1, 2, 3], rtol=1e-9)


@LONG
def test_rods_that_spin_give_what_distances_give(target, tmp_path, quick_compiler):
    wanted = (["left", "right"], ["pitch", "roll"])
    files = kc.emit(models.ankle_with_rods(), target, transmission=wanted)
    poses = joined("T3-SPU")
    calls = [start(), *(go(*(-length for length in x["u"])) for x in poses)]  # against its axis
    _, *found = called(target, files, calls, [1.0, 1.0], tmp_path, quick_compiler)
    for here, pose in zip(found, poses, strict=True):
        np.testing.assert_allclose(here.x, pose["x"], rtol=0, atol=1e-12)
        np.testing.assert_allclose(-here.J, pose["J"], rtol=0, atol=1e-8)

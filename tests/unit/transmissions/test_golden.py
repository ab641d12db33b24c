"""Loops as functions against `transmission_golden.json`: closed forms in 60 digits, two ways each.

The table was made outside of this project's code, by circles and acos, and by Newton's method on
other equations; it has x, J, second derivatives, J_dot, rates, efforts, assemblies and singular
poses.
"""

import json
from pathlib import Path

import numpy as np
import pytest

import kincompile as kc
from tests import transmission_models as models

GOLDEN = json.loads((Path(__file__).parents[2] / "data" / "transmission_golden.json").read_text())
MOTORS = ["m_1", "m_2"], ["x_1", "x_2"]
ANKLE = ["left", "right"], ["pitch", "roll"]

# Model, its inputs and outputs, and which poses are on the assembly of its guess.
CASES = {
    "T1a": (models.crank_rocker, ["motor"], ["rocker.phi"], slice(None)),
    "T1b": (
        lambda: models.crank_rocker(0.06, 0.30, 0.05, 0.305),
        ["motor"], ["rocker.phi"], slice(None),
    ),
    "T3-SPU": (models.ankle, *ANKLE, slice(None)),
    "T6": (models.five_bar, ["motor_1", "motor_2"], ["end"], [0, 1, 2]),
    "T6, other side": (
        lambda: models.five_bar(end=(-0.0016, 0.042)), ["motor_1", "motor_2"], ["end"], [3],
    ),
    "T6, crossed arms": (
        lambda: models.five_bar(first=0.6, second=2.4, end=(-0.0442, -0.0534)),
        ["motor_1", "motor_2"], ["end"], [4],
    ),
    "T7a": (models.differential, *MOTORS, slice(None)),
    "T7b": (models.remote_drive, *MOTORS, slice(None)),
    "T7c": (models.bevel_wrist, *MOTORS, slice(None)),
}  # fmt: skip


@pytest.fixture(scope="module", params=CASES)
def case(request):
    model, inputs, outputs, some = CASES[request.param]
    poses = GOLDEN[request.param.split(",")[0]]["poses"]
    poses = [poses[k] for k in some] if isinstance(some, list) else poses
    table = {key: np.array([pose[key] for pose in poses]) for key in poses[0] if key != "branch"}
    return kc.transmission(model(), inputs, outputs), table


def close(found, wanted):
    np.testing.assert_allclose(found, wanted, rtol=1e-10, atol=1e-11 * np.abs(wanted).max() + 1e-15)


def test_that_outputs_and_derivatives_are_those_of_the_table(case):
    f, table = case
    u = table["u"]
    close(f(u), table["x"])
    close(f.J(u), table["J"])
    close(f.second(u), table["d2x_du2"])
    close(f.at(u).determinant, np.linalg.det(table["J"]))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::kincompile.RedundantConstraintWarning")
def test_that_cylinders_and_balled_rods_have_second_derivatives_too():
    """A pivot that is planned at a generic state vanishes wherever the rods are assembled."""
    f = kc.transmission(models.ankle_with_rods(), *ANKLE)
    poses = GOLDEN["T3-SPU"]["poses"]
    u, first, second = (np.array([x[key] for x in poses]) for key in ("u", "J", "d2x_du2"))
    close(f.second(-u), second)  # the rods are measured against their axes
    close(f.J(-u), -first)


def test_that_rates_and_efforts_are_those_of_the_table(case):
    f, table = case
    u, u_dot = table["u"], table["u_dot"]
    close(f.J_dot(u, u_dot), table["J_dot"])
    x_dot, x_ddot = f.rates(u, u_dot, table["u_ddot"])
    close(x_dot, table["x_dot"])
    close(x_ddot, table["x_ddot"])
    close(f.effort(u, table["tau_x"]), table["tau_u"])
    close(np.sum(f.effort(u, table["tau_x"]) * u_dot, axis=-1), table["power"])


def test_that_the_inverse_has_the_inputs_and_the_inverse_jacobian(case):
    f, table = case
    same = np.sign(np.linalg.det(table["J"])) == np.sign(f.at(f.home.u).determinant)
    assert same.any()  # the rest is beyond a dead point, on another working mode
    close(f.inverse(table["x"][same]), table["u"][same])
    close(f.inverse.J(table["x"][same]), table["J_inv"][same])


def test_that_all_assemblies_are_found():
    for name, model in (("T1a", models.crank_rocker), ("T3-SPU", models.ankle)):
        f = kc.transmission(model(), *CASES[name][1:3])
        wanted = np.array(GOLDEN[name]["assemblies"]["x"])
        found = f.assemblies(GOLDEN[name]["assemblies"]["u"])
        assert found.shape == wanted.shape
        for x in wanted:  # angles but for whole turns
            apart = np.remainder(found - x + np.pi, 2 * np.pi) - np.pi
            assert np.abs(apart).max(axis=1).min() < 1e-8


def test_that_all_working_modes_are_found():
    f = kc.transmission(models.five_bar(), *CASES["T6"][1:3])
    inverse = GOLDEN["T6"]["inverse"]
    found = f.modes(inverse["x"])
    assert len(found) == 4
    for solution in inverse["solutions"]:
        assert np.abs(found - solution["u"]).max(axis=1).min() < 1e-9


def test_that_a_dead_point_of_the_output_is_an_input_singularity():
    f = kc.transmission(models.crank_rocker(), *CASES["T1a"][1:3])
    for pose in GOLDEN["T1a"]["singular"][:2]:
        poses = f.at(pose["u"])
        close(poses.x, np.array(pose["x"]))
        assert abs(poses.determinant) < 1e-12
        assert poses.singularity == "input"
        near = f.at(np.array(pose["u"]) + 1e-3)
        assert near.singularity == ""
        assert near.to_input == pytest.approx(1e-3, rel=0.01)
        assert near.to_output > 1


def test_that_the_end_of_the_input_is_an_output_singularity():
    f = kc.transmission(models.crank_rocker(0.06, 0.30, 0.05, 0.305), *CASES["T1b"][1:3])
    for pose, sign in zip(GOLDEN["T1b"]["singular"][:2], (1, -1), strict=True):
        end = np.array(pose["u"])
        poses = f.at([end - 1e-3 * sign, end + 1e-3 * sign])
        assert poses.status.tolist()[0] == 0
        assert poses.status[1] != 0
        assert poses.to_output[0] == pytest.approx(1e-3, rel=0.02)
        assert poses.to_input[0] > 0.1
        assert poses.singularity.tolist() == ["", "output"]
        assert np.isnan(poses.x[1]).all()
        assert np.isnan(poses.J[1]).all()


def test_that_a_stretched_arm_is_an_input_singularity():
    pose = GOLDEN["T6"]["singular"][2]
    model = models.five_bar(first=0.9, end=(0.05, 0.17))
    poses = kc.transmission(model, *CASES["T6"][1:3]).at(pose["u"])
    close(poses.x, np.array(pose["x"]))
    np.testing.assert_allclose(poses.J, pose["J"], rtol=0, atol=1e-13)
    assert poses.singularity == "input"


def test_that_distal_links_in_one_line_end_both_assemblies():
    f = kc.transmission(models.five_bar(), *CASES["T6"][1:3])
    pose = GOLDEN["T6"]["singular"][3]
    for u, end, sign in zip(pose["u"], pose["x"], (-1, 1), strict=True):
        poses = f.at([[u[0], u[1] + 1e-6 * sign], [u[0], u[1] - 1e-6 * sign]])
        assert (poses.status != 0).tolist() == [False, True]
        np.testing.assert_allclose(poses.x[0], end, rtol=0, atol=2e-4)  # a root of the distance
        assert 0 < poses.to_output[0] < 2e-6
        assert poses.singularity[1] == "output"


def test_that_the_points_of_the_curve_are_singular_for_the_inverse():
    """All 22, each on one working mode, in which J^-1 has a kernel: type 2."""
    points = np.array(GOLDEN["T6"]["singular"][0]["points"])
    modes = np.zeros(len(points), dtype=int)
    for mode in GOLDEN["T6"]["inverse"]["solutions"]:
        model = models.five_bar(first=mode["u"][0], second=mode["u"][1], end=(0.02, 0.15))
        inverse = kc.transmission(model, *CASES["T6"][1:3]).inverse
        x = points[:, 2:]
        first, found = inverse.at(x), np.zeros(len(points), dtype=bool)
        for poses in (first, inverse.at(x, near=first.pose(0))):  # no straight way leads to one
            apart = np.remainder(poses.x - points[:, :2] + np.pi, 2 * np.pi) - np.pi
            here = np.abs(apart).max(axis=1) < 1e-9
            assert (np.abs(poses.determinant[here]) < 1e-10).all()
            assert (poses.singularity[here] == "input").all()  # of the inverse
            found |= here
        modes += found
    assert modes.tolist() == [1] * len(points)


@pytest.fixture(scope="module")
def inverse():
    return kc.transmission(models.ankle(), *ANKLE).inverse


@pytest.mark.parametrize("pose", GOLDEN["T3-SPU"]["singular"][:8])
def test_that_an_ankle_meets_its_assemblies_at_output_singularities(inverse, pose):
    found = inverse.at(pose["x"])
    close(found.x, np.array(pose["u"]))
    np.testing.assert_allclose(found.J, pose["J_inv"], atol=1e-10)
    assert found.singularity == "input"  # of the inverse, whose inputs are the outputs
    assert abs(found.determinant) < 1e-12

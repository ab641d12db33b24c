"""Paths of points in one call, and splines, in all languages: as `kc.transmission` has them."""

import math

import numpy as np
import pytest

import kincompile as kc
from kincompile.emitters.registry import TARGETS
from tests import transmission_models as models
from tests.targets.transmission_calls import called, go, path, start

CONVERGED, SINGULAR = 0, 2


def same(found, poses):
    """Compare points with poses; x and J of what was not found are NaN."""
    reached = np.array([here.status for here in found]) == CONVERGED
    assert (reached == (poses.status == 0)).all()
    x, slopes = (np.array([getattr(here, name) for here in found]) for name in ("x", "J"))
    np.testing.assert_allclose(x, poses.x, rtol=0, atol=1e-11)
    np.testing.assert_allclose(slopes, poses.J, rtol=0, atol=1e-8 * np.nanmax(np.abs(poses.J)))
    for here in found:
        assert here.status in (CONVERGED, SINGULAR)
        assert np.isnan([*here.x, *here.J.ravel()]).all() == (here.status == SINGULAR)


@pytest.mark.parametrize("target", list(TARGETS))
def test_a_path_out_of_reach_and_back_has_a_status_each(target, tmp_path, quick_compiler):
    ends = ["motor_1", "motor_2"], ["end"]
    f = kc.transmission(models.five_bar(), *ends)
    turn = np.linspace(0, 2 * math.pi, 240)
    u = f.home.u + np.outer(1 - np.cos(turn), [0.5, -0.3])
    poses = f.at(u)
    assert 0 < (poses.status != 0).sum() < 220  # the two rods come in line
    files = kc.emit(models.five_bar(), target, transmission=ends)
    calls = [start(), path(*u.tolist()), go(*u[-1].tolist()), path(u[3].tolist())]
    began, found, last, (again,) = called(
        target, files, calls, [1.0, 2.0], tmp_path, quick_compiler
    )
    assert began == CONVERGED
    same(found, poses)
    np.testing.assert_allclose(last.x, found[-1].x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(again.x, found[3].x, rtol=0, atol=1e-12)


@pytest.mark.parametrize("target", list(TARGETS))
def test_a_cam_by_table_is_a_function_of_its_angle(target, tmp_path, quick_compiler, example_named):
    """Two turns, by steps that meet all pieces of the spline, and back in one call."""
    model, ends = example_named("cam_by_table").model, (["motor"], ["follower.y", "cam.phi"])
    f = kc.transmission(model, *ends)
    u = np.linspace(0, 4 * math.pi, 240)[:, np.newaxis]
    calls = [start(), *(go(*point) for point in u[::4].tolist()), path(*u[::-1].tolist()), go(0.5)]
    files = kc.emit(model, target, transmission=ends)
    began, *found, back, last = called(target, files, calls, [3.0, 0.0], tmp_path, quick_compiler)
    assert began == CONVERGED
    found += [*back, last]
    same(found, f.at(np.concatenate((u[::4], u[::-1], [[0.5]]))))
    assert np.ptp([here.x[0] for here in found]) > 0.019  # radii from 40 to 60 mm
    for here in found:
        np.testing.assert_allclose(here.effort, 3 * here.J[0], rtol=1e-12)

"""Laws that derivatives by parameters keep, on mechanisms of many kinds."""

import numpy as np
import pytest

import kincompile as kc


@pytest.mark.parametrize(
    "name",
    ["cam_flat_follower", "four_bar", "gear_train", "rack_and_pinion", "swing_and_dwell", "jansen"],
)
def test_that_angles_stay_and_lengths_grow_with_all_lengths(name, example_named):
    # Euler: with all lengths times s, lengths are s times as long.
    example = example_named(name)
    solution = kc.solve(example.module, np.linspace(0, example.model.end, 6))
    lengths = [x for x in solution.parameters if solution.units[x] in ("m", "mm")]
    sizes = np.array([solution.parameters[x] for x in lengths])
    found, seen = kc.sensitivities(solution, lengths), solution.observed
    is_length = np.array([found.units[x] in ("m", "mm") for x in found.coordinates])
    parts = {
        "q": (found.q_p, found.q_dot_p, found.q_ddot_p),
        "y": (found.y_p, found.y_dot_p, found.y_ddot_p),
    }
    known = [x * is_length for x in (solution.q, solution.q_dot, solution.q_ddot)]
    for own, part in zip(known, parts["q"], strict=True):
        assert np.abs(part @ sizes - own).max() <= 1e-11 * max(1, np.abs(own).max())
    for own, part in zip((seen.y, seen.y_dot, seen.y_ddot), parts["y"], strict=True):
        assert np.abs(part @ sizes - own).max(initial=0) <= 1e-11 * np.abs(own).max(initial=1)


@pytest.mark.parametrize(
    "name", ["cam_by_table", "cam_flat_follower", "gear_train", "slot_follower"]
)
def test_that_the_speed_of_a_driver_moves_along_the_motion(name, example_named):
    # q(t, w) is a function of w t alone where w turns the only driver.
    example = example_named(name)
    solution = kc.solve(example.module, np.linspace(0, example.model.end, 6))
    found, w = kc.sensitivities(solution, "omega"), solution.parameters["omega"]
    t, q_dot, q_ddot = solution.t[:, np.newaxis], solution.q_dot, solution.q_ddot
    for part, known in (
        (found.q_p, t * q_dot / w),
        (found.q_dot_p, q_dot / w + t * q_ddot / w),
    ):
        assert np.abs(part[..., 0] - known).max() <= 1e-11 * np.abs(known).max()

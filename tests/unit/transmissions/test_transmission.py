"""A loop as a function: balance of energy, batches, branches, parameters, bad input."""

import math
import warnings

import mpmath
import numpy as np
import pytest

import kincompile as kc
from tests import transmission_models as models


@pytest.fixture(scope="module")
def crank():
    return kc.transmission(models.crank_rocker(), "motor", "rocker.phi")


@pytest.fixture(scope="module")
def five_bar():
    return kc.transmission(models.five_bar(), ["motor_1", "motor_2"], "end")


@pytest.fixture(scope="module")
def ankle():
    return kc.transmission(models.ankle(), ["left", "right"], ["pitch", "roll"])


def test_that_power_in_is_power_out_at_1e5_random_poses(ankle):
    rng = np.random.default_rng(1)
    u = 0.225 + rng.uniform(-0.01, 0.01, (100_000, 2))
    u_dot, tau_x = rng.normal(size=(2, *u.shape))
    poses = ankle.at(u)
    assert poses.success
    tau_u, x_dot = ankle.effort(u, tau_x), np.einsum("kij,kj->ki", poses.J, u_dot)
    terms = np.abs(tau_x[:, :, np.newaxis] * poses.J * u_dot[:, np.newaxis]).sum(axis=(1, 2))
    apart = (tau_u * u_dot).sum(axis=1) - (tau_x * x_dot).sum(axis=1)
    assert (np.abs(apart) <= 1e-13 * terms).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "middle", "far"), [("crank", [0.0], np.pi), ("five_bar", [1.9, 1.3], 0.2)]
)
def test_that_power_of_rates_is_power_of_efforts_at_1e5_random_poses(name, middle, far, request):
    """Velocities are those of `rates`; of the crank with lengths that differ from pose to pose."""
    f, rng = request.getfixturevalue(name), np.random.default_rng(2)
    u = middle + rng.uniform(-far, far, (100_000, len(f.inputs)))
    p = {"b": rng.uniform(0.118, 0.122, len(u))} if name == "crank" else None
    u_dot, tau_x = rng.normal(size=u.shape), rng.normal(size=(len(u), len(f.outputs)))
    (x_dot, _), tau_u = f.rates(u, u_dot, p=p), f.effort(u, tau_x, p=p)
    assert np.isfinite(x_dot).all()
    terms = np.abs(tau_x[:, :, np.newaxis] * f.J(u, p=p) * u_dot[:, np.newaxis]).sum(axis=(1, 2))
    apart = (tau_u * u_dot).sum(axis=1) - (tau_x * x_dot).sum(axis=1)
    assert (np.abs(apart) <= 1e-13 * terms).all()


def psi(theta):
    """Return the rocker's angle by circles, in as many digits as are set."""
    a, b, c, d = (mpmath.mpf(text) for text in ("0.04", "0.12", "0.08", "0.13"))
    x, y = d - a * mpmath.cos(theta), -a * mpmath.sin(theta)
    r = mpmath.sqrt(x**2 + y**2)
    along = mpmath.acos((c**2 + r**2 - b**2) / (2 * c * r))
    return mpmath.atan2(-y, -x) - along


def test_that_second_derivatives_are_those_of_differences_in_40_digits(crank):
    for theta in np.linspace(0.1, 6.2, 12):
        with mpmath.workdps(40):
            exact, h = mpmath.mpf(float(theta)), mpmath.mpf(10) ** -10
            before, here, after = (psi(exact + k * h) for k in (-1, 0, 1))
            second = float((after - 2 * here + before) / h**2)
        assert crank.second([theta])[0, 0, 0] == pytest.approx(second, rel=1e-10, abs=1e-11)


def end(first, second):
    """Return the point of the five-bar by circles about its elbows, in any number of digits."""
    arm, rod, half = (mpmath.mpf(text) for text in ("0.09", "0.12", "0.059"))
    one = -half + arm * mpmath.expj(first)
    other = half + arm * mpmath.expj(second)
    along = (other - one) / 2
    height = mpmath.sqrt(rod**2 - abs(along) ** 2)
    return one + along + 1j * along / abs(along) * height


def test_that_mixed_second_derivatives_are_those_of_differences_in_40_digits(five_bar):
    for u in ([2.3, 0.9], [2.1, 1.1], [1.8, 1.4]):
        with mpmath.workdps(40):
            exact, h = [mpmath.mpf(x) for x in u], mpmath.mpf(10) ** -10
            wanted = np.empty((2, 2, 2))
            for j, k in np.ndindex(2, 2):
                total = 0
                for one, other in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                    at = [*exact]
                    at[j] += one * h
                    at[k] += other * h
                    total += one * other * end(*at)
                slope = total / (4 * h**2)
                wanted[:, j, k] = float(slope.real), float(slope.imag)
            place = end(*exact)
        np.testing.assert_allclose(five_bar(u), [float(place.real), float(place.imag)], atol=1e-14)
        np.testing.assert_allclose(five_bar.second(u), wanted, rtol=1e-10, atol=1e-11)


def test_that_a_full_turn_stays_on_its_assembly_and_comes_back(crank):
    u = np.linspace(0, 2 * np.pi, 5001)[:, np.newaxis]
    x = crank(u)[:, 0]
    with mpmath.workdps(20):
        wanted = [float(psi(mpmath.mpf(float(theta)))) for theta in u[::50, 0]]
    np.testing.assert_allclose(np.sin(x[::50] - wanted), 0, atol=1e-12)
    assert np.abs(np.diff(x)).max() < 1e-3
    assert x[0] == pytest.approx(x[-1], abs=1e-12)


def test_that_a_closed_path_of_two_inputs_comes_back(five_bar):
    s = np.linspace(0, 2 * np.pi, 301)
    u = np.array([1.9, 1.2]) + 0.25 * np.stack((np.cos(s), np.sin(s)), axis=-1)
    x = five_bar(u)
    np.testing.assert_allclose(x[0], x[-1], atol=1e-13)
    steps = np.einsum("kij,kj->ki", five_bar.J((u[1:] + u[:-1]) / 2), np.diff(u, axis=0))
    np.testing.assert_allclose(np.diff(x, axis=0), steps, atol=1e-6)


def test_that_a_warm_start_and_a_batch_follow_one_branch_around_what_no_pose_has(five_bar):
    # Around (pi, 0), where the elbows are too far apart: no straight way leads to the other side.
    angles = np.linspace(0.8, 0.8 + np.pi, 41)
    path = [np.pi, 0] + 2.1 * np.stack((-np.cos(angles), np.sin(angles)), axis=-1)
    assert five_bar.at([np.pi, 0]).singularity == "output"
    poses, near = five_bar.at(path), five_bar.home
    assert poses.success
    for u, x in zip(path, poses.x, strict=True):
        near = five_bar.at(u, near=near).pose()
        np.testing.assert_allclose(near.x, x, atol=1e-12)
    assert np.abs(np.diff(poses.x, axis=0)).max() < 0.02


def test_that_bodies_whose_spin_is_held_give_the_same_function(ankle):
    full = kc.transmission(models.ankle_with_rods(), ["left", "right"], ["pitch", "roll"])
    assert len(full.held) == 2
    assert "no output sees" in full.to_text()
    u = 0.2251 + np.random.default_rng(2).uniform(-0.02, 0.02, (50, 2))
    np.testing.assert_allclose(full(-u), ankle(u), atol=1e-9)
    np.testing.assert_allclose(full.J(-u[:5]), -ankle.J(u[:5]), rtol=1e-9)


SPINS = [f"omega_{axis}_foot" for axis in ("x", "y", "z", "xi", "eta", "zeta")]


def spins_by_hand(x):
    """Return omega = e_y p + Ry e_x r by the rates of pitch and roll, and about the foot's axes."""
    (c, s), (cr, sr) = ((np.cos(a), np.sin(a)) for a in x.T)
    zero, one = np.zeros(len(x)), np.ones(len(x))
    axes = np.array([[zero, c], [one, zero], [zero, -s], [zero, one], [cr, zero], [-sr, zero]])
    return np.moveaxis(axes, -1, 0)


def test_that_an_angular_velocity_has_a_jacobian_and_no_value(ankle):
    f = kc.transmission(models.ankle(), ["left", "right"], ["roll", *SPINS])
    assert f.twists == tuple(SPINS)
    assert "velocities, without x: omega_x_foot" in f.to_text()
    u = 0.2251 + np.random.default_rng(4).uniform(-0.01, 0.01, (20, 2))
    slopes = spins_by_hand(ankle(u)) @ ankle.J(u)
    np.testing.assert_allclose(f.J(u)[:, 1:], slopes, rtol=0, atol=1e-10)
    np.testing.assert_allclose(f.J(u)[:, 0], ankle.J(u)[:, 1], rtol=1e-10)
    np.testing.assert_allclose(f.effort(u, [0, 1, 0, 0, 0, 0, 0]), slopes[:, 0], atol=1e-10)
    found = f.at(u[0])
    assert np.isnan(found.x).tolist() == [False] + [True] * 6
    assert found.success


@pytest.mark.slow
def test_that_an_angular_velocity_has_an_acceleration(ankle):
    """Its J is no gradient: derivatives of J are not symmetric."""
    f = kc.transmission(models.ankle(), ["left", "right"], ["omega_x_foot", "omega_eta_foot"])
    u = 0.2251 + np.random.default_rng(4).uniform(-0.01, 0.01, (20, 2))
    u_dot, u_ddot = np.array([0.08, -0.05]), np.array([0.6, 0.9])
    x, (x_dot, x_ddot) = ankle(u), ankle.rates(u, u_dot, u_ddot)
    (pitch, roll), (p, r), (p2, r2) = x.T, x_dot.T, x_ddot.T
    omega, alpha = f.rates(u, u_dot, u_ddot)
    np.testing.assert_allclose(omega, np.transpose([np.cos(pitch) * r, np.cos(roll) * p]))
    by_hand = [
        np.cos(pitch) * r2 - np.sin(pitch) * p * r,
        np.cos(roll) * p2 - np.sin(roll) * r * p,
    ]
    np.testing.assert_allclose(alpha, np.transpose(by_hand), rtol=0, atol=1e-8)
    apart = (f.second(u) - f.second(u).swapaxes(-1, -2))[:, 0, 0, 1]
    np.testing.assert_allclose(apart, np.sin(pitch) * np.linalg.det(ankle.J(u)), atol=1e-8)


def test_that_velocities_have_no_inverse_and_no_derivatives_by_parameters():
    m = models.five_bar()
    m.point("other", "rod_2", (m.parameter("length", 0.1, "m"), 0))
    m.output("drift", kc.outputs.rate(m.system().body_points[0].x), "m/s")
    f = kc.transmission(m, ["motor_1", "motor_2"], ["y_end", "drift"])
    with pytest.raises(kc.InputError, match="velocities among its outputs, drift, which no pos"):
        f.inverse([0.0, 0.0])
    assert len(f.assemblies([2.3, 0.9])) == 2
    assert np.isnan(f.by([2.3, 0.9], "length")[1]).all()
    with pytest.raises(kc.InputError, match="has no parameter 'v_motor_1'"):
        f([2.3, 0.9], p={"v_motor_1": 1.0})


def test_that_left_and_right_mirror_each_other(ankle):
    u = np.array([0.21, 0.22])
    sides = np.diag([1, -1])
    np.testing.assert_allclose(ankle(u[::-1]), sides @ ankle(u), atol=1e-12)
    np.testing.assert_allclose(ankle.J(u[::-1]), sides @ ankle.J(u)[:, ::-1], rtol=1e-10)


def test_that_parameters_may_differ_from_pose_to_pose(crank):
    u, a = np.full((3, 1), 1.0), np.array([0.039, 0.04, 0.041])
    x = crank(u, p={"a": a})
    slope = crank.by(u, ["a", "d"])
    assert slope.shape == (3, 1, 2)
    assert slope[1, 0, 0] == pytest.approx((x[2, 0] - x[0, 0]) / 0.002, rel=1e-3)
    np.testing.assert_allclose(crank(u[0], p={"a": a}), x)


def test_shapes_of_batches(five_bar):
    u = np.broadcast_to([2.3, 0.9], (2, 3, 2))
    assert five_bar(u).shape == (2, 3, 2)
    assert five_bar.J(u).shape == (2, 3, 2, 2)
    assert five_bar.second(u).shape == (2, 3, 2, 2, 2)
    assert five_bar.J_dot(u, [1, 1]).shape == (2, 3, 2, 2)
    assert five_bar.effort(u, [1, 1]).shape == (2, 3, 2)
    assert five_bar.at(u).pose((1, 2)).x.shape == (2,)


def test_that_fewer_outputs_have_a_jacobian_and_no_inverse(five_bar):
    height = kc.transmission(models.five_bar(), ["motor_1", "motor_2"], ["y_end"])
    np.testing.assert_allclose(height.J([2.3, 0.9]), five_bar.J([2.3, 0.9])[1:])
    assert np.isnan(height.at([2.3, 0.9]).determinant)
    with pytest.raises(kc.InputError, match="2 inputs and 1 outputs, and an inverse needs as many"):
        height.inverse([0.1])


def test_that_what_is_not_reached_is_nan_with_a_warning():
    knee = kc.transmission(models.crank_rocker(0.06, 0.30, 0.05, 0.305), "motor", "rocker.phi")
    with pytest.warns(kc.SingularConfigurationWarning, match="1 of 2 poses were not reached") as w:
        x = knee([[1.0], [2.5]])
    assert np.isnan(x).ravel().tolist() == [False, True]
    assert "motor = 2.5" in str(w[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not knee.at([[1.0], [2.5]]).success


def test_that_compiled_code_gives_the_same(five_bar):
    compiled = kc.transmission(models.five_bar(), ["motor_1", "motor_2"], "end", target="c")
    u = np.array([1.9, 1.2]) + np.random.default_rng(3).uniform(-0.2, 0.2, (100, 2))
    np.testing.assert_allclose(compiled(u), five_bar(u), atol=1e-14)
    np.testing.assert_allclose(compiled.second(u), five_bar.second(u), rtol=1e-9)


def test_that_a_loop_with_redundant_equations_is_a_function_too():
    m = kc.Mechanism("parallelogram")
    arms = []
    for k, x in enumerate((0, 1, 2)):
        arms.append(m.body(f"arm_{k}", (x, 0, 1)))
        m.add(kc.Revolute(f"O{k}", m.ground, (x, 0), arms[-1], (0, 0)))
    bar = m.body("bar", (0.54, 0.84, 0))
    for k, arm in enumerate(arms):
        m.add(kc.Revolute(f"P{k}", arm, (1, 0), bar, (k, 0)))
    m.add(kc.AbsoluteAngle("motor", arms[0], 1.0))
    with pytest.warns(kc.RedundantConstraintWarning):
        f = kc.transmission(m, "motor", ["arm_2.phi", "bar.x"])
    u = np.linspace(0.3, 2.8, 20)[:, np.newaxis]
    np.testing.assert_allclose(f(u), np.hstack((u, np.cos(u))), atol=1e-12)
    np.testing.assert_allclose(f.second(u)[:, 1, 0, 0], -np.cos(u[:, 0]), atol=1e-10)


WRONG = [
    (lambda f: f([1.0, 2.0]), "u has the shape (2,): its last axis is motor of four_bar"),
    (lambda f: f(1.0), "u has the shape ()"),
    (lambda f: f(np.empty((0, 1))), "u has the shape (0, 1): give at least one pose"),
    (lambda f: f([np.nan]), "u is not finite everywhere"),
    (lambda f: f(["a"]), "u is ['a']: give numbers"),
    (lambda f: f.effort([1.0], [1.0, 2.0]), "tau_x has the shape (2,)"),
    (lambda f: f.rates([1.0], 3.0), "u_dot has the shape ()"),
    (lambda f: f([1.0], p={"q": 1}), "four_bar has no parameter 'q'"),
    (lambda f: f([1.0], p={"u_motor": 1}), "inputs are given by u"),
    (lambda f: f([1.0], p=[1, 2]), "give values by name"),
    (lambda f: f(np.ones((2, 1)), p={"a": np.ones(3)}), "u has the batch (2,), and parameters"),
    (lambda f: f.by([1.0], "e"), "has no parameter 'e'"),
    (lambda f: f.at([1.0], near=3), "near is 3: give a pose of four_bar"),
    (lambda f: f.assemblies([[1.0]]), "assemblies are those of one pose"),
]


@pytest.mark.parametrize(("call", "message"), WRONG)
def test_that_bad_input_is_named(crank, call, message):
    with pytest.raises(kc.InputError) as error:
        call(crank)
    assert message in str(error.value)


def test_that_what_cannot_be_assembled_at_first_is_said():
    with pytest.raises(kc.SolveError, match="cannot be assembled at the first values of its input"):
        kc.transmission(
            models.crank_rocker(0.06, 0.3, 0.05, 0.305, motor=3.0), "motor", "rocker.phi"
        )


def test_angles_are_not_wound_up_where_another_turn_of_the_crank_is_given():
    """A double rocker cannot follow its crank to the next turn, where it stands as in this one."""
    m = models.crank_rocker(0.09, 0.05, 0.08, 0.13, motor=1.2)
    f = kc.transmission(m, ["motor"], ["phi_rocker"])
    crank = np.linspace(-1.1, 1.1, 12)[:, np.newaxis]
    for turn in (math.tau, -math.tau):
        np.testing.assert_allclose(f(crank + turn), f(crank), rtol=0, atol=1e-9)

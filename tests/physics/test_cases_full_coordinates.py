"""R5, R6, R11, R12 and R13: mechanisms in full coordinates, every figure to the digits printed."""

import numpy as np
import pytest

import kincompile as kc


def at(solution, t):
    """Return the index of a time of the grid."""
    return np.flatnonzero(np.isclose(solution.t, t, rtol=0, atol=1e-9)).item()


def named(solution, t, names):
    """Return columns by name at one time."""
    return [solution[name][at(solution, t)] for name in names.split()]


# name of the example, time, quantity, figures
STATES = [
    ("slider_crank", 0, "q_dot", "0, 0, 0, 0, 0, 0, 0, 0, 0"),
    ("slider_crank", 0, "q_ddot", "0, 4, 2, 0, 4, -1.3333333333, 0, 0, 0"),
    (
        "slider_crank", 1, "q",
        "1.0806046117, 1.6829419696, 1, 4.6446959512, 1.6829419696, -0.5955699378, "
        "7.128182679, 0, 0",
    ),
    (
        "slider_crank", 1, "q_dot",
        "-3.3658839392, 2.1612092235, 2, -8.1963175645, 2.1612092235, -0.8702318395, "
        "-9.6608672505, 0, 0",
    ),
    (
        "slider_crank", 1, "q_ddot",
        "-7.6883023862, -4.570558655, 2, -15.0237726493, -4.570558655, 1.3271908607, "
        "-14.6709405263, 0, 0",
    ),
    ("double_pendulum", 0, "q", "1.2, 0.5, 0, 5.1895651858, 0.25, -0.0834300866"),
    ("double_pendulum", 0, "q_dot", "0, 10, 10, -0.83624201, 10, -3.34496804"),
    ("double_pendulum", 0, "q_ddot", "-100, 0, 0, -233.6835942492, 0, -0.9356553958"),
    (
        "double_pendulum", 0.1, "q",
        "0.8663667454, 1.2456241417, 0.8414709848, 4.3627039091, 0.9956241417, -0.3382902322",
    ),
    (
        "double_pendulum", 0.1, "q_dot",
        "-4.0286244305, 3.6003948909, 5.4030230587, -9.323919371, 3.6003948909, -1.2722376416",
    ),
    (
        "double_pendulum", 0.1, "q_ddot",
        "43.2890914625, -77.8395788418, -84.1470984808, 108.8157532945, -77.8395788418, "
        "26.9359963787",
    ),
    (
        "double_pendulum", 0.5, "q",
        "0.7744008792, -0.3185741445, -0.9589242747, 4.2944296103, -0.5685741445, 0.1906780656",
    ),
    (
        "four_bar", 0, "q",
        "5, 0, 0, 21.3, 6.4272855857, 0.5171520074, 26.3, 6.4272855857, 3.9369914838",
    ),
    ("four_bar", 0, "q_dot", "0, 7.5, 1.5, 9.6409283785, -1.95, -1.5, 9.6409283785, -9.45, -1.5"),
    (
        "four_bar", 0, "q_ddot",
        "-11.25, 0, 0, -76.275, 35.3815770232, 4.4108822647, -65.025, 35.3815770232, 7.9115824748",
    ),
    (
        "four_bar", 1, "q",
        "0.3536860083, 4.987474933, 1.5, 13.2144771695, 13.5206967122, 0.2762500015, "
        "22.8607911611, 8.5332217792, 4.3889114103",
    ),
    (
        "inverted_slider_crank", 0, "q",
        "0.3472963553, 1.969615506, 1.3962634016, -0.4941631166, 5.54760273, 0.6364918669, "
        "-1.5665131281, 4.755023309, 0.6364918669",
    ),
]  # fmt: skip

# name of the example, time, columns, figures
COLUMNS = [
    (
        "slider_crank", 2, "x_slider x_slider_dot x_slider_ddot",
        "2.5657729691, 5.9973842394, 44.8122168458",
    ),
    (
        "slider_crank", 2, "phi_rod phi_rod_dot phi_rod_ddot",
        "0.528843303, 2.0188410197, -5.9587032698",
    ),
    ("four_bar", 1, "phi_coupler_dot phi_rocker_dot", "0.1747221947, 0.9493170669"),
    ("four_bar", 1, "phi_coupler_ddot phi_rocker_ddot", "0.2801072825, -0.0477375696"),
    ("four_bar", 5, "phi_coupler phi_rocker", "0.2485432987, 4.2099970133"),
    ("four_bar", 10, "phi_coupler", "0.4383041956"),
    ("four_bar", 10, "phi_rocker_dot phi_rocker_ddot", "0.7766003938, -0.4745376691"),
    ("inverted_slider_crank", 0, "phi_guide_dot phi_guide_ddot", "0.466060831, -0.2048920341"),
    (
        "inverted_slider_crank", 1, "phi_guide phi_guide_dot phi_guide_ddot",
        "0.7237138263, -0.9104862349, -3.9587029394",
    ),
    (
        "inverted_slider_crank", 2, "phi_guide phi_guide_dot phi_guide_ddot",
        "-0.2516059509, -0.0516473067, 1.2823519368",
    ),
    (
        "inverted_slider_crank", 4, "phi_guide phi_guide_dot phi_guide_ddot",
        "0.5454609412, 0.4954155995, -0.1127686852",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("name", "t", "quantity", "figures"), STATES)
def test_the_printed_states(example_named, printed, name, t, quantity, figures):
    solution = example_named(name).solution
    printed(figures, getattr(solution, quantity)[at(solution, t)])


@pytest.mark.parametrize(("name", "t", "columns", "figures"), COLUMNS)
def test_the_printed_columns(example_named, printed, name, t, columns, figures):
    printed(figures, named(example_named(name).solution, t, columns))


@pytest.mark.parametrize(
    ("name", "guess"),
    [
        ("slider_crank", (2, 0, 0, 7, 0, 0, 10, 0, 0)),
        ("double_pendulum", (1, 0, 0, 5, 0, 0)),
        ("four_bar", (5, 0, 0, 20, 10, np.pi / 4, 20, 9, 1.5 * np.pi)),
        (
            "inverted_slider_crank",
            (
                *(0.724, 1.864, 80 * np.pi / 180),
                *(1.45, 2, 15 * np.pi / 180),
                *(-0.174821119075, 1.663292392775, 15 * np.pi / 180),
            ),
        ),
    ],
)
def test_that_the_examples_start_from_the_guesses_of_their_sources(example_named, name, guess):
    np.testing.assert_allclose(example_named(name).module.GUESS, guess, rtol=1e-15)


def test_r5_at_the_start_nu_vanishes_and_the_second_derivative_of_the_driver_does_not(
    example_named,
):
    example = example_named("slider_crank")
    q, q_dot = example.solution.q[0], example.solution.q_dot[0]
    assert not example.module.nu(q, 0.0).any()
    gamma = dict(zip(example.module.EQUATIONS, example.module.gamma(q, q_dot, 0.0), strict=True))
    assert gamma["motor"] == 2.0


def test_r11_over_its_whole_time_with_the_step_printed(example_named):
    solution = example_named("four_bar").solution
    assert solution.success
    np.testing.assert_allclose(np.diff(solution.t), 0.01, rtol=1e-9)


def test_r11_at_the_end_against_two_circles(example_named, printed):
    # The joint between coupler and rocker is where two circles meet. The reference case prints
    # 4.9395936155 for the rocker; this construction and its own rates say 4.9395937155.
    solution = example_named("four_bar").solution
    crank_pin, ground_pin = 10 * np.exp(15j), 20 + 0j
    base = ground_pin - crank_pin
    foot = (26**2 - 18**2 + abs(base) ** 2) / (2 * abs(base))
    joint = crank_pin + base / abs(base) * (foot + 1j * np.sqrt(26**2 - foot**2))
    coupler, rocker = np.angle(joint - crank_pin), np.angle(ground_pin - joint) + 2 * np.pi
    printed("0.4383041956, 4.9395937155", [coupler, rocker])
    np.testing.assert_allclose(
        named(solution, 10, "phi_coupler phi_rocker"), [coupler, rocker], rtol=0, atol=1e-13
    )


def test_r12_the_condition_number_at_the_printed_times(example_named, printed):
    example = example_named("inverted_slider_crank")
    solution, rows = example.solution, [at(example.solution, t) for t in (0, 1, 2, 4)]
    conditions = np.linalg.cond(example.module.Phi_q(solution.q[rows], solution.t[rows]))
    printed("449", conditions.max())


@pytest.fixture(scope="module")
def lut_slider_crank():
    """R13, the slider-crank of LUT course BK70A0600."""
    m = kc.Mechanism("lut_slider_crank")
    degree = kc.pi / 180
    crank = m.body("crank", guess=(-0.1, 0.02, -31 * degree))
    rod = m.body("rod", guess=(-0.4, 0.02, 10 * degree))
    slider = m.body("slider", guess=(-0.5, 0.0001, 0.1))
    m.add(kc.Revolute("main_bearing", crank, (0.1, 0), m.ground, (0, 0)))
    m.add(kc.Revolute("crank_pin", crank, (-0.1, 0), rod, (0.3, 0)))
    m.add(kc.Revolute("wrist_pin", rod, (-0.2, 0), slider, (0, 0)))
    m.add(kc.AbsoluteY("guide_height", slider, (0, 0), 0))
    m.add(kc.AbsoluteAngle("guide_angle", slider, 0))
    m.add(kc.AbsoluteAngle("motor", crank, -kc.pi / 6 - 1.2 * kc.t))
    return kc.compile(m)


def test_r13(lut_slider_crank, printed):
    solution = kc.solve(lut_slider_crank, np.linspace(0, 1, 101), throw=True)
    slider, rod = "x_slider x_slider_dot x_slider_ddot", "phi_rod phi_rod_dot phi_rod_ddot"
    printed("-0.6631030293, 0.1624264069, 0.3118773047", named(solution, 0, slider))
    printed("0.2013579208, 0.4242640687, -0.257196423", named(solution, 0, rod))
    printed("-0.5528357849, 0.2565320099, 0.0506786209", named(solution, 0.5, slider))
    printed("-0.4288258617, 0.221481012, -0.1629037076", named(solution, 1, slider))


def test_r13_the_teacher_s_rough_guess_converges_in_four_iterations(lut_slider_crank):
    result = kc.newton(lut_slider_crank, 0.0, None)
    assert result.status == kc.Status.CONVERGED
    assert result.iterations == 4

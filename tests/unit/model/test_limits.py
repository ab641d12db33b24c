"""Limits of joints: which a motion leaves and when, by closed forms; in Python and in files."""

from pathlib import Path

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import kincompile as kc
from kincompile import spatial
from kincompile.errors import KincompileWarning
from kincompile.files.model_file import read_data_model

T = np.linspace(0, 1, 11)


def arm():
    """An elbow of -2 t on an arm of t, and a slider that is at t along it."""
    m = kc.Mechanism("arm", length_unit="cm")
    a, b, slide = (m.body(name, (x, 0, 0)) for name, x in (("a", 1), ("b", 2.5), ("s", 1)))
    m.add(kc.Revolute("A", m.ground, (0, 0), a, (-1, 0)))
    m.add(kc.AbsoluteAngle("shoulder", a, kc.t))
    m.add(kc.Revolute("B", a, (1, 0), b, (-0.5, 0)))
    m.add(kc.RelativeAngle("elbow", a, b, -2 * kc.t))
    m.add(kc.Translational("guide", a, (0, 0), (2, 0), slide, (0, 0), (1, 0)))
    rest = (a, (-1, 0), slide, (0, 0))
    m.add(kc.Distance("stroke", *rest, 1 + kc.t))
    return m


def hinges(sign=1):
    """A door of 4 t about z, in crosses that are a quarter turn apart, and a bolt of 1 + t."""
    m = spatial.Mechanism("door")
    door, bolt = m.body("door"), m.body("bolt", (0, 0, 1))
    z, x, y = (0, 0, 1), (1, 0, 0), (0, 1, 0)
    m.add(spatial.Revolute("hinge", m.ground, (0, 0, 0), z, door, (0, 0, 0), z))
    m.add(spatial.RelativeRotation("motor", m.ground, z, x, door, z, x, sign * 4 * kc.t))
    origin = (0, 0, 0)
    m.add(spatial.Translational("guide", door, origin, z, x, bolt, origin, z, y))
    m.add(spatial.RelativeTranslation("bolted", door, origin, z, bolt, origin, 1 + kc.t))
    return m


def said(m, t=T, p=None):
    """Return what a solution says of limits, and check that it warns of it."""
    module = kc.compile(m)
    with pytest.warns(KincompileWarning, match="leaves its limit of"):
        message = kc.solve(module, t, p).message
    return message[message.index("Joint ") :]


def read_back(m):
    return read_data_model(Path("m.toml"), m.to_toml().encode())


LEFT = {
    "hinge": ("B", -1.5, 9,
              "Joint B leaves its limit of -1.5 rad at t = 0.8; it is -2 rad at t = 1."),
    "slider": ("guide", 0, 0.55,
               "Joint guide leaves its limit of 0.55 cm at t = 0.6; it is 1 cm at t = 1."),
    "angle": ("shoulder", 0, 0.75,
              "Joint shoulder leaves its limit of 0.75 rad at t = 0.8; it is 1 rad at t = 1."),
    "cylinder": ("stroke", 1.05, 9,
                 "Joint stroke leaves its limit of 1.05 cm at t = 0; it is 1 cm at t = 0."),
}  # fmt: skip


@pytest.mark.parametrize("case", LEFT)
def test_a_limit_that_a_motion_leaves_in_the_plane(case):
    joint, least, greatest, words = LEFT[case]
    m = arm()
    m.limit(joint, least, greatest)
    assert said(m) == said(read_back(m)) == words


def test_that_angles_of_hinges_in_space_are_counted_over_a_turn():
    m = hinges()
    m.limit("hinge", -1, 3.7, cross_i=(1, 0, 0), cross_j=(0, 1, 0))
    m.limit("guide", greatest=1.55)
    expected = (
        "Joint hinge leaves its limit of 3.7 rad at t = 0.6; "
        f"it is {4 + np.pi / 2:.6g} rad at t = 1. "
        "Joint guide leaves its limit of 1.55 m at t = 0.6; it is 2 m at t = 1."
    )
    assert said(m) == said(read_back(m)) == expected


def test_that_an_angle_counts_from_the_turn_nearest_to_the_middle_of_its_limits():
    m = hinges(-1)
    m.limit("hinge", 5, 7)
    last = 2 * np.pi - 4
    assert (
        said(m)
        == f"Joint hinge leaves its limit of 5 rad at t = 0.4; it is {last:.6g} rad at t = 1."
    )


def test_that_the_value_of_a_driver_is_what_it_drives_however_long_the_steps_are():
    m = hinges()
    m.limit("motor", greatest=30)
    assert said(m, np.array([0, 2 * np.pi, 4 * np.pi])).endswith(
        "it is 50.2655 rad at t = 12.56637061."
    )


def test_that_limits_may_be_formulas_of_parameters():
    m = arm()
    most = m.parameter("most", 0.5)
    m.limit("A", greatest=2 * most)
    assert "limit" not in kc.solve(kc.compile(m), T).message
    assert said(read_back(m), T, {"most": 0.2}).startswith("Joint A leaves its limit of 0.4 rad")


WRONG = {
    "unknown": (("elbo",), r"limit of 'elbo': there is no joint 'elbo'; did you mean 'elbow'\?"),
    "no value": (
        ("ball", 0, 1),
        "limit of 'ball': a Spherical has no value of its own;",
    ),
    "order": (("A", 2, 1), "limit of 'A': it goes from 2 to 1; give the least value first"),
    "degrees": (("guide", kc.deg, 3), "limit of 'guide': .*deg"),
    "no number": (
        ("A", kc.t, 3),
        "^limit of 'A': t is not a number at the default parameters[^\n]*$",
    ),
    "no joint": ((3, 0, 1), "limit of '3': there is no joint '3'; constraints are: A, "),
    "equation": (("free", 0, 1), "limit of 'free': a free equation has no value of its own;"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_limit_that_cannot_be_used(case):
    given_, message = WRONG[case]
    m = hinges() if case == "no value" else arm()
    if case == "no value":
        m.add(spatial.Spherical("ball", m.ground, (0, 0, 0), "door", (0, 0, 0)))
    if case == "equation":
        m.add(kc.Equation("free", m.bodies[0].phi - kc.t))
    m.limit(*given_)
    with pytest.raises(kc.ModelError, match=message):
        m.system()


def test_that_bodies_of_a_hinge_may_have_guesses_that_are_turns_apart():
    m = kc.Mechanism("turned", length_unit="")
    a = m.body("a", (0.5, 0.8, 1 + 4 * np.pi))
    m.add(kc.Revolute("A", m.ground, (0, 0), a, (-1, 0)))
    m.add(kc.AbsoluteX("x", a, (0, 0), sympy.cos(1 + kc.t)))
    m.limit("A", -1, 1.45)
    m.limit("x", greatest=0.4)
    assert said(m) == (
        f"Joint x leaves its limit of 0.4 at t = 0; it is {np.cos(1):.6g} at t = 0. "
        "Joint A leaves its limit of 1.45 rad at t = 0.5; it is 2 rad at t = 1."
    )


def test_that_the_unit_of_length_changes_nothing():
    m = kc.Mechanism("small")
    s = m.body("s", (2e-9, 0, 0))
    m.add(kc.Translational("guide", m.ground, (0, 0), (1, 0), s, (0, 0), (1, 0)))
    m.add(kc.AbsoluteX("x", s, (0, 0), 1e-9 * (1 + kc.t)))
    m.limit("guide", 1e-9 * (1 + 1e-15), 1.45e-9)
    assert (
        said(m) == "Joint guide leaves its limit of 1.45e-09 m at t = 0.5; it is 2e-09 m at t = 1."
    )


def test_a_limit_that_is_no_number_with_some_parameters():
    m = arm()
    most = m.parameter("most", 4.0)
    m.limit("A", greatest=sympy.sqrt(most))
    assert "limit" not in kc.solve(kc.compile(m), T).message
    with pytest.warns(KincompileWarning):
        message = kc.solve(kc.compile(m), T, {"most": -1.0}).message
    assert message.endswith(" The limit of A is no number with these parameters.")


def test_that_a_simulation_says_which_limits_it_leaves():
    """By free fall: a slider without friction is at 5 t^2."""
    m = kc.Mechanism("fall")
    m.gravity = (10, 0)
    s = m.body("s", mass=1, inertia=1)
    m.add(kc.Translational("guide", m.ground, (0, 0), (1, 0), s, (0, 0), (1, 0)))
    m.limit("guide", greatest=1.0)
    with pytest.warns(KincompileWarning, match="leaves its limit of"):
        message = kc.simulate(kc.compile(m), T).message
    assert message.endswith(" Joint guide leaves its limit of 1 m at t = 0.5; it is 5 m at t = 1.")


def test_that_inspect_lists_limits_as_they_are_written():
    m = arm()
    m.limit("A", -30 * kc.deg, m.parameter("most", 0.5))
    m.limit("guide", greatest=np.float64(0.7))
    lines = kc.inspect(m).to_text().splitlines()
    first = lines.index("Limits")
    assert [line.split() for line in lines[first + 1 : first + 4]] == [
        ["joint", "least", "greatest"], ["A", "-30*deg", "most"], ["guide", "0.7"],
    ]  # fmt: skip


ENDS = st.floats(-1e3, 1e3).map(lambda x: x + 0.0)


@given(
    st.dictionaries(
        st.sampled_from(["hinge", "motor", "guide", "bolted"]),
        st.tuples(ENDS, st.floats(1e-3, 1e3), st.sampled_from(["", "least", "greatest", "most"])),
    ),
    st.tuples(ENDS, ENDS),
)
@settings(max_examples=40, deadline=None)
def test_that_limits_are_read_as_they_were_written(limits, slant):
    m = hinges()
    most = m.parameter("most", 2e3)
    for joint, (least, size, form) in limits.items():
        ends = {"least": least, "greatest": most if form == "most" else least + size}
        ends.pop(form, None)
        crosses = {"cross_i": (1, *slant), "cross_j": (slant[1], 0.5, slant[0])}
        m.limit(joint, **ends, **(crosses if joint == "hinge" else {}))
    found = read_back(m)
    assert found.limits == m.limits
    assert found.to_toml() == m.to_toml()

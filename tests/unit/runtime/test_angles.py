"""Angles of vectors as outputs: against closed forms, and where they have no rate."""

import numpy as np
import pytest

import kincompile as kc
from kincompile import outputs

W = 1.3


def spun(build, **body):
    """Return the motion of an output of an arm that turns about the origin, over a turn."""
    m = kc.Mechanism("spun")
    arm = m.body("arm", guess=(0, 0, 0.1))
    m.add(kc.Revolute("O", m.ground, (0, 0), arm, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", arm, W * kc.t + 0.1))
    tip = m.point("tip", arm, (2, 0))
    m.output("y", build(arm, tip), "rad")
    return kc.solve(kc.compile(m), np.linspace(0, 2 * np.pi / W, 61))


FIXED = (5.0, 1.0)
F = complex(*FIXED)

# How an output is written, and the number of which it is the angle, with two derivatives by phi;
# e is exp(i phi).
CASES = {
    "body": (lambda arm, tip: outputs.angle(arm, (tip, FIXED)),
             lambda e: (F / e - 2, -1j * F / e, -F / e), True),
    "points": (lambda arm, tip: outputs.angle((FIXED, (0, 0)), (FIXED, tip)),
               lambda e: (1 - 2 * e / F, -2j * e / F, 2 * e / F), True),
    "unsigned": (lambda arm, tip: outputs.transmission_angle((0, 0), tip, FIXED),
                 lambda e: (2 - F / e, 1j * F / e, F / e), False),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_that_rates_are_those_of_the_angle_of_a_complex_number(name):
    build, number, is_signed = CASES[name]
    found = spun(build)
    z, z_dot, z_ddot = number(np.exp(1j * (W * found.t + 0.1)))
    sign = 1 if is_signed else np.sign(np.angle(z))
    slope = z_dot / z
    np.testing.assert_allclose(found["y"], sign * np.angle(z), atol=1e-13)
    np.testing.assert_allclose(found["y_dot"], sign * W * slope.imag, atol=1e-13)
    bend = (z_ddot / z - slope**2).imag
    np.testing.assert_allclose(found["y_ddot"], sign * W**2 * bend, atol=1e-12)


def test_that_a_small_angle_between_vectors_is_as_precise_as_a_large_one():
    m = kc.Mechanism("small")
    arm = m.body("arm")
    m.add(kc.Revolute("O", m.ground, (0, 0), arm, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", arm, kc.t))
    m.output("y", outputs.transmission_angle((1, 0), (0, 0), m.point("tip", arm, (1, 0))), "rad")
    t = np.array([1e-9, 1e-5, 0.3])
    found = kc.solve(kc.compile(m), t)
    np.testing.assert_allclose(found["y"], t, rtol=1e-15)
    np.testing.assert_allclose(found["y_dot"], 1, rtol=1e-15)
    folded = kc.solve(kc.compile(m), [0.0, 0.1])
    assert folded["y"][0] == 0
    assert np.isnan(folded["y_dot"][0])  # it falls to one side and rises to the other


def test_that_vectors_along_one_line_keep_their_angle():
    m = kc.Mechanism("line")
    arm = m.body("slider")
    for name, joint in (("y", kc.AbsoluteY), ("x", kc.AbsoluteX)):
        m.add(joint(name, arm, (0, 0), kc.t + 1 if name == "x" else 0))
    m.add(kc.AbsoluteAngle("phi", arm, 0))
    m.output("y", outputs.transmission_angle((1, 0), (0, 0), (arm.x, 0)), "rad")
    m.output("d", outputs.distance((1, 2), (4, 6)), "m")
    found = kc.solve(kc.compile(m), [0.0, 1.0])
    np.testing.assert_array_equal(found["y"], 0)
    np.testing.assert_array_equal(found["y_dot"], 0)
    np.testing.assert_array_equal(found["d"], 5)


def test_that_an_angle_reads_as_elementary_functions():
    m = kc.Mechanism("text")
    a, b = m.body("a"), m.body("b")
    assert str(outputs.distance((a.x, a.y), (b.x, b.y))) == (
        "sqrt((-x_a + x_b)**2 + (-y_a + y_b)**2)"
    )
    assert "atan2(" in str(outputs.angle(a, ((0, 0), (b.x, b.y))))


def test_what_is_said_of_what_is_no_point():
    m = kc.Mechanism("wrong")
    b = m.body("b")
    foot = m.point("foot", b, (1, 0))
    for call, said in (
        (lambda: outputs.distance(b, foot), "is no point: give one of a body"),
        (lambda: outputs.distance(foot, 5), "5 is no point"),
        (lambda: outputs.distance(foot, (1, "x_b")), "'x_b' is not a number"),
        (lambda: outputs.distance(foot, (1, 2, 3)), "one is in the plane"),
        (lambda: outputs.angle(b, foot), "is no direction: give a body, or two points"),
        (lambda: outputs.angle(((0, 0, 0), (1, 0, 0)), b), "spatial.outputs.angle"),
        (lambda: outputs.speed(b), "is no point of a body"),
        (lambda: outputs.velocity_ratio("x_b", b.x), "'x_b' is not a number"),
    ):
        with pytest.raises(kc.ModelError, match=said):
            call()

import numpy as np
import pytest

import kincompile as kc

SLOT = """
import kincompile as kc
import sympy

m = kc.Mechanism("slot")
mean = m.parameter("mean", 0.05, unit="m")
disc = m.body("disc")
rocker = m.body("rocker", guess=(0.06, 0.02, 2.6))
wave = mean + sympy.cos(2 * kc.alpha) / 100
m.add(kc.Revolute("shaft", disc, (0, 0), m.ground, (0, 0)))
m.add(kc.Revolute("pivot", rocker, (-0.04, 0), m.ground, (0.1, 0)))
m.add(kc.PointFollower("pin", rocker, (0.04, 0), disc, (0, 0), wave, guess=1.0))
m.add(kc.AbsoluteAngle("motor", disc, 2 * kc.t))
"""

SLOT_TEXT = """\
slot: 7 coordinates, 7 equations

Bodies
  body    columns  coordinates                                   guess
  disc    0-2      x_disc [m], y_disc [m], phi_disc [rad]        0, 0, 0
  rocker  3-5      x_rocker [m], y_rocker [m], phi_rocker [rad]  0.06, 0.02, 2.6

Other coordinates
  column  coordinate       guess
       6  alpha_pin [rad]  1

Parameters
  parameter  default  unit
  mean       0.05     m

Constraints
  rows  constraint  type                    source       between
  0-1   shaft       Revolute                Haug 3.3.10  disc (0, 0) - ground (0, 0)
  2-3   pivot       Revolute                Haug 3.3.10  rocker (-0.04, 0) - ground (0.1, 0)
  4-5   pin         PointFollower           Haug 3.4.32  rocker (0.04, 0) - disc (0, 0) profile
  6     motor       AbsoluteAngle (driver)  Haug 3.2.6   disc angle 2*t

Mobility
   7  coordinates         3 for each of 2 bodies, 1 that belong to no body
  -6  joint equations
   1  degrees of freedom  by Gruebler's count
  -1  driver equations    motor
   0  left over

Structure of Phi_q
  7 x 7, 17 of 49 entries are not identically zero
  structural rank 7 of 7
  rank 7 at generic assembled states: nothing may move by itself

Order of solution
  step  coordinates                                by equations
     1  x_disc                                     shaft.x
     2  y_disc                                     shaft.y
     3  phi_disc                                   motor
     4  x_rocker, y_rocker, phi_rocker, alpha_pin  pivot.x, pivot.y, pin.x, pin.y

Pattern of Phi_q
           disc     rocker   alpha_pin
           x y phi  x y phi
  shaft.x  * . .    . . .    .
  shaft.y  . * .    . . .    .
  pivot.x  . . .    * . *    .
  pivot.y  . . .    . * *    .
  pin.x    * . *    * . *    *
  pin.y    . * *    . * *    *
  motor    . . *    . . .    .
"""


def test_the_text_of_a_mechanism(kincompile, tmp_path):
    (tmp_path / "slot.py").write_text(SLOT)
    done = kincompile("inspect", tmp_path / "slot.py")
    assert (done.exit_code, done.stderr) == (0, "")
    assert done.stdout == SLOT_TEXT


def test_the_text_of_free_equations(kincompile, stopping):
    done = kincompile("inspect", stopping)
    assert done.stdout.startswith("stops: 1 coordinate, 1 equation\n\nOther coordinates\n")
    assert "x**2 + t - 1 = 0" in done.stdout or "t + x**2 - 1 = 0" in done.stdout
    assert done.stdout.endswith("Pattern of Phi_q\n              x\n  equation_1  *\n")


def test_that_a_mechanism_that_cannot_be_compiled_is_shown_with_the_reason(kincompile, pendulum):
    undriven = pendulum.read_text().replace("mechanism.add(kc.AbsoluteAngle", "(kc.AbsoluteAngle")
    pendulum.write_text(undriven)
    done = kincompile("inspect", pendulum)
    assert (done.exit_code, done.stderr) == (0, "")
    assert "1  left over" in done.stdout
    assert "structural rank 2 of 2" in done.stdout
    assert "'pendulum' has 2 equations for 3 coordinates" in done.stdout


def chain(links: int) -> kc.Mechanism:
    """Return an open chain of driven links."""
    mechanism = kc.Mechanism("chain")
    before, end = mechanism.ground, (0, 0)
    for k in range(links):
        link = mechanism.body(f"link{k}")
        mechanism.add(kc.Revolute(f"R{k}", before, end, link, (-1, 0)))
        mechanism.add(kc.AbsoluteAngle(f"M{k}", link, k + kc.t))
        before, end = link, (1, 0)
    return mechanism


def test_that_a_wide_pattern_is_a_list(kincompile):
    text = str(kc.inspect(chain(16)))
    assert "  R1.x      x_link0, phi_link0, x_link1, phi_link1\n" in text
    assert max(len(line) for line in text.splitlines()) < 120


def test_the_counts_of_a_mechanism():
    found = kc.inspect(chain(3))
    assert [body.name for body in found.bodies] == ["link0", "link1", "link2"]
    assert [item.first_row for item in found.constraints] == [0, 2, 3, 5, 6, 8]
    assert [item.is_driver for item in found.constraints] == [False, True] * 3
    assert found.equations[:4] == ("R0.x", "R0.y", "M0", "R1.x")
    mobility = found.mobility
    assert (mobility.coordinates, mobility.joint_equations, mobility.driver_equations) == (9, 6, 3)
    assert (mobility.degrees_of_freedom, mobility.undriven) == (3, 0)
    assert (found.rank, found.problem) == (9, "")


def test_that_the_pattern_is_that_of_the_emitted_module():
    mechanism = chain(2)
    pattern = kc.inspect(mechanism).pattern
    np.testing.assert_array_equal(pattern, kc.compile(mechanism).PATTERN)


def test_that_equations_which_repeat_others_lower_the_rank():
    mechanism = chain(2)
    link = mechanism.bodies[0]
    mechanism.constraints[-1] = kc.AbsoluteAngle("again", link, 3)
    found = kc.inspect(mechanism)
    assert found.rank == 5
    assert set(found.unmatched_equations) <= {"M0", "again"}
    assert len(found.unmatched_equations) == 1
    assert len(found.unmatched_coordinates) == 1
    assert "only repeat what others fix" in found.problem
    assert found.problem in str(found)


def test_that_too_many_drivers_are_counted():
    mechanism = chain(1)
    mechanism.add(kc.AbsoluteX("pull", mechanism.bodies[0], (0, 0), kc.t))
    found = kc.inspect(mechanism)
    assert found.mobility.undriven == -1
    assert "-1  left over" in str(found)
    assert "1 equation is too many" in found.problem


def test_that_what_is_wrong_in_a_model_is_still_an_error():
    mechanism = chain(1)
    mechanism.body("link0")
    with pytest.raises(kc.ModelError, match="2 bodies are named 'link0'"):
        kc.inspect(mechanism)

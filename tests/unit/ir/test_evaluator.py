"""Entries of a position, as they are sampled while a solve is planned."""

import kincompile as kc


def test_that_a_division_by_zero_in_a_driver_or_a_parameter_is_no_error_of_the_compiler():
    m = kc.Mechanism("pendulum")
    a, arm = m.parameter("a", 0.0), m.body("arm")
    m.add(kc.Revolute("A", m.ground, (0, 0), arm, (1, 0)))
    m.add(kc.AbsoluteAngle("motor", arm, 1 / kc.t + kc.t / (2 * a)))
    module = kc.compile(m)
    solution = kc.solve(module, [1.0], {"a": 0.5})
    assert solution.success
    assert solution["arm.phi"][0] == 2.0

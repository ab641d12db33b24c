"""The pendulum of docs/checker.md, for tests of what is read beside a model."""

import kincompile as kc


def pendulum() -> kc.Mechanism:
    """Return a bob at the end of a bar of length 1, whose angle is t^2."""
    m = kc.Mechanism("pendulum")
    bob = m.body("bob", guess=(1, 0, 0))
    m.add(kc.Revolute("pin", bob, (-1, 0), m.ground, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", bob, kc.t**2))
    return m

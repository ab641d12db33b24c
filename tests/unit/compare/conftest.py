"""A mechanism for each joint type with every attribute a parameter: two bodies, one constraint."""

from collections.abc import Callable
from functools import cache
from types import SimpleNamespace
from typing import Any

import pytest
import sympy

import kincompile as kc

NUMBERS = {
    "a": 0.25, "b": -0.15, "c": -0.35, "d": 0.45, "e": 0.6, "f": 0.9, "g": -0.4, "h": 0.7,
    "reach": 2.0, "omega": 1.3, "R_i": 0.5, "R_j": 0.8, "theta_i": 0.2, "theta_j": -0.3,
    "k": 1.05, "l": 0.2, "u": 0.15,
}  # fmt: skip

ADD: dict[str, Callable[[Any], Any]] = {
    "AbsoluteX": lambda a: kc.AbsoluteX("K", a.i, a.s_i, a.C),
    "AbsoluteY": lambda a: kc.AbsoluteY("K", a.i, a.s_i, a.C),
    "AbsoluteAngle": lambda a: kc.AbsoluteAngle("K", a.i, a.C),
    "AbsoluteDistance": lambda a: kc.AbsoluteDistance("K", a.i, a.s_i, a.s_Q, a.C),
    "RelativeX": lambda a: kc.RelativeX("K", a.i, a.s_i, a.j, a.s_j, a.C),
    "RelativeY": lambda a: kc.RelativeY("K", a.i, a.s_i, a.j, a.s_j, a.C),
    "RelativeAngle": lambda a: kc.RelativeAngle("K", a.i, a.j, a.C),
    "Distance": lambda a: kc.Distance("K", a.i, a.s_i, a.j, a.s_j, a.C),
    "Revolute": lambda a: kc.Revolute("K", a.i, a.s_i, a.j, a.s_j),
    "Translational": lambda a: kc.Translational("K", a.i, a.s_i, a.v_i, a.j, a.s_j, a.v_j),
    "RevoluteTranslational": lambda a: kc.RevoluteTranslational(
        "K", a.i, a.s_i, a.v_i, a.j, a.s_j, a.C
    ),
    "TranslationalDistance": lambda a: kc.TranslationalDistance(
        "K", a.i, a.s_i, a.v_i, a.j, a.s_j, a.C
    ),
    "Gear": lambda a: kc.Gear("K", a.i, a.s_i, a.R_i, a.theta_i, a.j, a.s_j, a.R_j, a.theta_j),
    "RackAndPinion": lambda a: kc.RackAndPinion(
        "K", a.i, a.s_i, a.s_Q, a.theta_i, a.j, a.s_j, a.R_j, a.theta_j
    ),
    "CamFollower": lambda a: kc.CamFollower("K", a.i, a.s_i, a.rho_i, a.j, a.s_j, a.rho_j),
    "CamFlatFollower": lambda a: kc.CamFlatFollower("K", a.i, a.s_i, a.rho_i, a.j, a.s_j, a.v_j),
    "PointFollower": lambda a: kc.PointFollower("K", a.i, a.s_i, a.j, a.s_j, a.rho_j),
}


@cache
def mechanism(kind: str) -> kc.Mechanism:
    m = kc.Mechanism("bench")
    p = SimpleNamespace(**{name: m.parameter(name, value) for name, value in NUMBERS.items()})
    made = ADD[kind](
        SimpleNamespace(
            i=m.body("i", guess=(0.3, -0.7, 0.4)), j=m.body("j", guess=(1.1, 0.5, -0.9)),
            s_i=(p.a, p.b), s_j=(p.c, p.d), v_i=(p.e, p.f), v_j=(p.g, p.h), s_Q=(p.k, p.l),
            R_i=p.R_i, R_j=p.R_j, theta_i=p.theta_i, theta_j=p.theta_j,
            C=p.reach + p.l * sympy.sin(p.omega * kc.t),
            rho_i=1 + p.l * sympy.cos(kc.alpha) + p.u * sympy.sin(2 * kc.alpha),
            rho_j=p.R_j + p.u * sympy.cos(3 * kc.alpha),
        )
    )  # fmt: skip
    m.add(made)
    return m


@pytest.fixture(params=ADD)
def joint(request: pytest.FixtureRequest) -> kc.Mechanism:
    """Each joint type alone in a mechanism, all of its attributes parameters."""
    return mechanism(request.param)


@pytest.fixture(scope="session")
def joint_types() -> dict[str, Callable[[], kc.Mechanism]]:
    """Each joint type alone in a mechanism, made when it is asked for."""
    return {kind: lambda kind=kind: mechanism(kind) for kind in ADD}  # type: ignore[misc]

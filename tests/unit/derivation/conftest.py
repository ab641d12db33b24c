"""A mechanism with every constraint type, and the parts of its derivation."""

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import pytest
import sympy

import kincompile as kc
from kincompile.report.document import Chapter

V, W = (0.6, 0.9), (-0.4, 0.7)
S, P, Q = (0.25, -0.15), (-0.35, 0.45), (1.05, 0.2)
RHO_I = 1 + sympy.cos(kc.alpha) / 3 + sympy.sin(2 * kc.alpha) / 10
TABLE = [k * 0.7853981633974483 for k in range(8)], [0.7, 0.75, 0.9, 0.8, 0.7, 0.65, 0.6, 0.65]


@cache
def make_gallery() -> kc.Mechanism:
    """Return two bodies with every constraint between them, all attributes generic."""
    m = kc.Mechanism("gallery")
    a = m.parameter("a", 2.0, unit="m")
    crane_arm = m.parameter("crane_arm", 0.3)
    i = m.body("i", guess=(0.3, -0.7, 0.4))
    j = m.body("rocker", guess=(1.1, 0.5, -0.9))
    value = a + crane_arm * sympy.sin(2 * kc.t)
    for constraint in (
        kc.AbsoluteX("ax", i, S, value),
        kc.AbsoluteY("ay", i, S, a),
        kc.AbsoluteAngle("aphi", i, value),
        kc.AbsoluteDistance("ad", i, S, (0.15, 0.6), value),
        kc.RelativeX("rx", i, S, j, P, value),
        kc.RelativeY("ry", i, S, j, P, 1.5),
        kc.RelativeAngle("rphi", i, j, value),
        kc.Distance("rd", i, S, j, P, a),
        kc.Revolute("revolute", i, (a / 2, crane_arm), j, P),
        kc.Revolute("grounded", m.ground, (0, 0), j, P),
        kc.Translational("slide", i, S, V, j, P, W),
        kc.RevoluteTranslational("rt", i, S, V, j, P, value),
        kc.TranslationalDistance("tdd", i, S, V, j, P, value),
        kc.Gear("gear", i, S, 0.5, 0.2, j, P, a, -0.3),
        kc.RackAndPinion("rack", i, S, Q, 0.2, j, P, 0.8, -0.3),
        kc.CamFollower("cams", i, S, RHO_I, j, P, TABLE, guess=(0.8, -0.5)),
        kc.CamFlatFollower("flat", i, S, RHO_I, j, P, W, guess=0.8),
        kc.PointFollower("slot", i, S, j, P, RHO_I, guess=-0.5),
        kc.Equation(
            "free", i.x * sympy.sin(j.phi) - value * j.y**2, sympy.exp(i.phi / 4) - value * i.x
        ),
        kc.Equation("pieces", i.y - sympy.Piecewise((kc.t**2, kc.t < 1), (2 * kc.t - 1, True))),
    ):
        m.add(constraint)
    return m


@pytest.fixture(scope="session")
def gallery() -> kc.Mechanism:
    """Return a mechanism with every constraint type."""
    return make_gallery()


def all_sections(sections: tuple[Chapter, ...]) -> Iterator[Chapter]:
    """Yield sections and their parts."""
    for section in sections:
        yield section
        yield from all_sections(section.sections)


@pytest.fixture(scope="session")
def sections_of() -> Callable[[Any], list[Chapter]]:
    """Return the function that gives all sections of a derivation, by depth first."""
    return lambda derivation: list(all_sections(derivation.sections))

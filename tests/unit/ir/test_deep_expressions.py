"""Long sums and deep nests compile; what is nested beyond all measure is refused by its name."""

import math
from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc

TERMS, DEEP, TOO_DEEP = 700, 40, 120
x = sympy.Symbol("x")


def nested(inner: Any, depth: int) -> Any:
    for k in range(depth):
        inner = 1.01 * sympy.sin(inner) + kc.t / (k + 3)
    return inner


@pytest.mark.parametrize("form", ["inline", "grouped"])
@pytest.mark.slow
def test_that_a_long_sum_compiles(form: str) -> None:
    series = sympy.Add(*(sympy.sin(k * kc.t) / k**2 for k in range(1, TERMS)))
    module = kc.compile(kc.ConstraintSystem("long", "x", [x - series]), form=form)
    t = 0.4
    expected = (
        2.0 - sum(math.sin(k * t) / k**2 for k in range(1, TERMS)),
        sum(math.cos(k * t) / k for k in range(1, TERMS)),
        -sum(math.sin(k * t) for k in range(1, TERMS)),
    )
    q = np.array([2.0])
    found = module.Phi(q, t)[0], module.nu(q, t)[0], module.gamma(q, q, t)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("form", ["inline", "grouped"])
def test_that_a_deep_nest_compiles(form: str) -> None:
    system = kc.ConstraintSystem("deep", "x", [kc.Equation("tower", nested(x, DEEP) - kc.t)])
    module = kc.compile(system, form=form)
    q, t, step = np.array([0.3]), 0.4, 1e-30
    by_x = module.Phi(q + 1j * step, t).imag / step
    by_t = module.Phi(q, t + 1j * step).imag / step
    np.testing.assert_allclose(module.Phi_q(q, t)[0], by_x, rtol=1e-13)
    np.testing.assert_allclose(module.nu(q, t), -by_t, rtol=1e-13)


@pytest.mark.parametrize("form", ["inline", "grouped"])
def test_that_an_equation_nested_too_deeply_is_named(form: str) -> None:
    system = kc.ConstraintSystem("deep", "x", [kc.Equation("tower", nested(x, TOO_DEEP) - kc.t)])
    with pytest.raises(kc.ModelError, match=r"'tower': .* nested too deeply.* u - \(inner part\)"):
        kc.compile(system, form=form)


def test_that_a_driver_nested_too_deeply_is_named() -> None:
    m = kc.Mechanism("deep")
    crank = m.body("crank")
    m.add(kc.Revolute("bearing", m.ground, (0, 0), crank, (-1, 0)))
    m.add(kc.AbsoluteAngle("tower", crank, nested(kc.t, TOO_DEEP)))
    with pytest.raises(kc.ModelError, match=r"'tower': .* nested too deeply"):
        kc.compile(m)

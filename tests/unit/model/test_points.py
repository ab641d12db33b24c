"""Points of bodies as expressions, and their derivatives from the vectors."""

import cmath

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.ir.lower import lower

STATE = {"x_rod": 0.3, "y_rod": -0.2, "phi_rod": 0.7, "L": 1.5}
PLACE = complex(0.3, -0.2) + complex(1.5 / 2, 0.4) * cmath.exp(0.7j)


L = sympy.Symbol("L")
LOCAL = L / 2, 0.4


def hung(name="rod", local=LOCAL, factor=2.0):
    """Return a body that turns about a pin, with a point, and a distance to it."""
    m = kc.Mechanism(f"hung_{name}")
    m.parameter("L", 1.5)
    body = m.body(name)
    foot = m.point("foot", body, local)
    m.add(kc.Revolute("A", m.ground, (0, 0), body, (0, 0)))
    m.add(kc.AbsoluteAngle("motor", body, kc.t))
    m.output("reach", factor * kc.outputs.distance(foot, (1, 2)), "m")
    return m, foot


@pytest.fixture
def foot():
    return hung()[1]


def test_that_coordinates_of_a_point_are_expressions(foot):
    """By the complex plane: as numbers, in slopes, in functions and in print."""
    numbers = {sympy.Symbol(name): value for name, value in STATE.items()}
    for coordinate, part in ((foot.x, "real"), (foot.y, "imag")):
        expected = getattr(PLACE, part)
        assert float(coordinate.subs(numbers)) == pytest.approx(expected, abs=1e-15)
        assert float(coordinate.evalf(subs=numbers)) == pytest.approx(expected, abs=1e-14)
        made = sympy.lambdify(sympy.symbols(" ".join(STATE)), 2 * coordinate, "numpy")
        assert made(*STATE.values()) == pytest.approx(2 * expected, abs=1e-15)
        printed = sympy.parse_expr(str(3 * coordinate))
        assert float(printed.subs(numbers)) == pytest.approx(3 * expected, abs=1e-15)
        slope = coordinate.diff(sympy.Symbol("phi_rod")).subs(numbers)
        turned = 1j * complex(0.75, 0.4) * cmath.exp(0.7j)
        assert float(slope) == pytest.approx(getattr(turned, part), abs=1e-15)
        assert r"\cos" in sympy.latex(coordinate)


def test_that_a_point_of_the_ground_is_a_number():
    m = kc.Mechanism("still")
    assert m.point("P", m.ground, (1, 2)).y == 2


def test_that_points_are_derived_once_for_all_mechanisms():
    first = lower(hung()[0].system()).observers
    other = lower(hung("arm", (0.7, L))[0].system()).observers
    assert [item.kernel.name for item in other] == ["Point", "Output"]
    assert all(a.kernel is b.kernel for a, b in zip(first, other, strict=True))


def test_that_what_was_compiled_before_does_not_decide_how_a_number_is_printed():
    half, quarter = sympy.Rational(1, 2), 0.5
    sources = [kc.emit(hung(factor=factor)[0]).source for factor in (half, quarter, half)]
    assert sources[0] == sources[2] != sources[1]


def test_that_points_of_a_large_mechanism_are_one_group():
    m, _ = hung()
    for k in range(5):
        m.point(f"P_{k}", "rod", (k + 1, 2.5))
    source = kc.emit(m, form="grouped").source
    assert "def Point_1" in source.replace("_Point_1", "Point_1")
    assert "Point_2" not in source
    found = kc.compile(m, form="grouped").outputs(*np.zeros((3, 3)), 0.0)
    np.testing.assert_allclose(found[2:12:2], 1 + np.arange(5), atol=0)
    np.testing.assert_allclose(found[3:12:2], 2.5, atol=0)

"""Tables of radii as periodic splines: through the points, smooth, close to what they sample."""

from typing import Any

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile.model.spline import PeriodicSpline, SplineTable, fit, fit_between

TURN = 2 * np.pi


def smooth(angle: Any) -> Any:
    return 1 + 0.2 * np.cos(angle) + 0.05 * np.sin(3 * angle)


def sampled(count: int, start: float = 0.0) -> SplineTable:
    angles = start + np.linspace(0, TURN, count, endpoint=False)
    return fit(angles, smooth(angles))


uneven = np.sort(np.random.default_rng(6).uniform(-1, TURN - 1.2, 17))
TABLES = {
    "even": sampled(16),
    "from -1": sampled(13, -1.0),
    "uneven": fit(uneven, smooth(uneven)),
    "six points": sampled(6),
    "closed": fit(np.linspace(0, TURN, 21), smooth(np.linspace(0, TURN, 21))),
    "coarse and fine": fit([0, 0.1, 0.2, 2, 4, 4.1, 6], [1, 1.1, 1.1, 0.8, 1, 1.2, 1]),
}


@pytest.fixture(params=TABLES)
def table(request: pytest.FixtureRequest) -> SplineTable:
    return TABLES[request.param]


def scipys(x: Any, y: Any, ends: Any) -> Any:
    from scipy.interpolate import make_interp_spline

    return make_interp_spline(x, y, k=5, bc_type=ends)


@pytest.mark.parametrize("count", [6, 7, 40])
def test_that_it_is_the_spline_of_scipy(count: int) -> None:
    """Periodic, and with slopes but no curvature at its ends."""
    rng = np.random.default_rng(count)
    x, y = np.cumsum(rng.uniform(0.3, 1, count + 1)), rng.uniform(1, 2, count + 1)
    x, y[-1] = x * (TURN / (x[-1] - x[0])), y[0]
    tables = [
        (fit(x, y), scipys(x, y, "periodic")),
        (fit_between(x, y, (0.3, -2)), scipys(x, y, ([(1, 0.3), (2, 0.0)], [(1, -2), (2, 0.0)]))),
    ]
    for found, expected in tables:
        for order in range(5):
            for at in np.linspace(x[0], x[-1], 57)[:-1].tolist():
                size = np.abs(expected.derivative(order)(x[:-1])).max()
                assert found(at, order) == pytest.approx(expected(at, order), abs=1e-10 * size)


def test_that_it_passes_through_the_points() -> None:
    for angles in (np.linspace(0, TURN, 12, endpoint=False), uneven):
        found = [fit(angles, smooth(angles))(angle) for angle in angles.tolist()]
        np.testing.assert_allclose(found, smooth(angles), rtol=1e-13)


@pytest.mark.parametrize("order", range(5))
def test_that_derivatives_up_to_the_fourth_are_continuous(table: SplineTable, order: int) -> None:
    """The third is what the gamma of a pair of cams needs; across the turn as everywhere."""
    pieces = [np.polyder(np.array(row), order) for row in table.coefficients]
    lengths = np.diff(table.breaks)
    ends = np.array([np.polyval(p, length) for p, length in zip(pieces, lengths, strict=True)])
    starts = np.array([np.polyval(p, 0.0) for p in pieces])
    # Coefficients carry rounding errors of 1e-16 times radius / length^order.
    scale = np.abs(starts).max() + 1 / lengths.min() ** order
    np.testing.assert_allclose(ends, np.roll(starts, -1), atol=1e-12 * scale)


def test_that_it_has_a_turn_for_its_period(table: SplineTable) -> None:
    assert table.breaks[-1] - table.breaks[0] == pytest.approx(TURN, abs=1e-12)
    assert len(table.coefficients) == len(table.breaks) - 1
    for angle in (-7.3, -1.0, 0.0, 0.4, 3.1, 6.2):
        for order in range(4):
            expected = table(angle, order)
            for turns in (-2, 1, 5):
                found = table(angle + turns * TURN, order)
                assert found == pytest.approx(expected, rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("order", range(4))
def test_that_each_order_is_the_derivative_of_the_one_before(order: int) -> None:
    table, step = TABLES["uneven"], 1e-5
    for angle in (0.35, 1.9, 4.4, 6.0):
        slope = (table(angle + step, order) - table(angle - step, order)) / (2 * step)
        assert slope == pytest.approx(table(angle, order + 1), rel=1e-6, abs=1e-5)


def test_that_it_comes_closer_with_more_points() -> None:
    """The error of a quintic spline falls with the sixth power of the distance of the points."""
    angles = np.linspace(0, TURN, 200)
    errors = [
        max(abs(table(angle) - smooth(angle)) for angle in angles.tolist())
        for table in (sampled(count) for count in (16, 32, 64))
    ]
    assert errors[0] < 1e-4
    assert np.log2(errors[0] / errors[1]) > 5.5
    assert np.log2(errors[1] / errors[2]) > 5.5


def test_that_a_closed_table_is_the_open_one() -> None:
    angles = np.linspace(0, TURN, 21)
    assert TABLES["closed"].breaks == pytest.approx(sampled(20).breaks)
    opened = sampled(20)
    for angle in angles.tolist():
        assert TABLES["closed"](angle) == pytest.approx(opened(angle), rel=1e-13)


def test_that_sympy_can_differentiate_and_evaluate_it() -> None:
    alpha, k = sympy.symbols("alpha k")
    table = TABLES["even"]
    rho = PeriodicSpline.of("rho", table)
    second = (k * rho(alpha)).diff(alpha, 2)
    assert second == k * PeriodicSpline.of("rho", table, 2)(alpha)
    assert float(second.subs({k: 2, alpha: 0.7})) == pytest.approx(2 * table(0.7, 2))
    assert rho(alpha).subs(alpha, 0.7).evalf() == pytest.approx(table(0.7))
    assert not rho(alpha).evalf().is_number
    inner = rho(2 * alpha).diff(alpha)
    assert float(inner.subs(alpha, 0.3)) == pytest.approx(2 * table(0.6, 1))


def slotted(profile: Any) -> kc.Mechanism:
    m = kc.Mechanism("slotted")
    pin = m.body("pin")
    m.add(kc.PointFollower("slot", pin, (0.1, 0.2), m.ground, (0, 0), profile))
    m.add(kc.AbsoluteAngle("turn", pin, 0.3))
    m.add(kc.Equation("drive", sympy.Symbol("alpha_slot") - kc.t))
    return m


def test_that_the_emitted_spline_is_the_table() -> None:
    """At breakpoints, over the turn, far away, point by point and in a batch."""
    angles = np.linspace(0, TURN, 24, endpoint=False)
    table = sampled(24)
    module = kc.compile(slotted((angles, smooth(angles))))
    contacts = np.hstack([angles, angles - 1e-9, np.linspace(-20, 20, 31), 1e4])
    q = np.zeros((len(contacts), 4))
    q[:, 3] = contacts
    batch = module.Phi(q, 0.0)[:, :2]
    offset = module.Phi(np.zeros(4), 0.0)[:2] + np.array([table(0.0), 0])
    for k, contact in enumerate(contacts.tolist()):
        expected = offset - table(contact) * np.array([np.cos(contact), np.sin(contact)])
        np.testing.assert_allclose(batch[k], expected, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(module.Phi(q[k], 0.0)[:2], expected, rtol=1e-12, atol=1e-12)


def test_that_a_fine_table_moves_as_the_formula_does() -> None:
    angles = np.linspace(0, TURN, 90, endpoint=False)
    rho = 1 + sympy.cos(kc.alpha) / 5 + sympy.sin(3 * kc.alpha) / 20
    tabled = kc.compile(slotted((angles, smooth(angles))))
    formula = kc.compile(slotted(rho))
    rng = np.random.default_rng(9)
    q, q_dot = rng.normal(size=(2, 40, 4))
    for found, expected, tolerance in zip(
        tabled.kinematics(q, q_dot, 0.2),
        formula.kinematics(q, q_dot, 0.2),
        (1e-9, 1e-7, 1e-12, 1e-5),
        strict=True,
    ):
        np.testing.assert_allclose(found, expected, atol=tolerance)


def test_that_two_cams_have_each_their_own_table() -> None:
    angles = np.linspace(0, TURN, 12, endpoint=False)
    m = kc.Mechanism("cams")
    i, j = m.body("i"), m.body("j")
    m.add(
        kc.CamFollower(
            "pair", i, (0, 0), (angles, smooth(angles)), j, (0, 0), (angles, 2 * smooth(angles))
        )
    )
    for k, name in enumerate(("x_i", "y_i", "phi_i", "x_j", "y_j")):
        m.add(kc.Equation(f"hold_{k}", sympy.Symbol(name)))
    gap = kc.compile(m).Phi(np.zeros(8), 0.0)[:2]
    np.testing.assert_allclose(gap, [smooth(0.0) - 2 * smooth(0.0), 0], atol=1e-13)


def test_that_the_radii_may_be_lists() -> None:
    angles = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert fit(angles, [1] * 6)(2.5) == pytest.approx(1.0)

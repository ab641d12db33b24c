"""The code of a module on numbers of other kinds: 40 digits, intervals, dual numbers."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
import sympy

import kincompile as kc


@dataclass(frozen=True)
class Dual:
    """A number a + b epsilon, with epsilon^2 = 0: b is a derivative."""

    a: float
    b: float = 0.0

    def __add__(self, other):
        other = dual(other)
        return Dual(self.a + other.a, self.b + other.b)

    def __mul__(self, other):
        other = dual(other)
        return Dual(self.a * other.a, self.a * other.b + self.b * other.a)

    def __truediv__(self, other):
        other = dual(other)
        return Dual(self.a / other.a, (self.b * other.a - self.a * other.b) / other.a**2)

    def __pow__(self, n):
        return Dual(self.a**n, n * self.a ** (n - 1) * self.b)

    def __mod__(self, turn):
        return Dual(self.a % turn, self.b)

    def __ge__(self, other):
        return self.a >= dual(other).a

    def __abs__(self):
        return self if self.a >= 0 else -self

    def __gt__(self, other):
        return self.a > dual(other).a

    def __neg__(self):
        return Dual(-self.a, -self.b)

    def __sub__(self, other):
        return self + -dual(other)

    def __rsub__(self, other):
        return dual(other) - self

    def __rtruediv__(self, other):
        return dual(other) / self

    __radd__, __rmul__ = __add__, __mul__


def dual(x):
    """Return a number as a dual number."""
    return x if isinstance(x, Dual) else Dual(float(x))


DUALS = SimpleNamespace(
    cos=lambda x: Dual(math.cos(x.a), -math.sin(x.a) * x.b),
    sin=lambda x: Dual(math.sin(x.a), math.cos(x.a) * x.b),
    atan2=lambda y, x: Dual(math.atan2(y.a, x.a), (x.a * y.b - y.a * x.b) / (x.a**2 + y.a**2)),
    sqrt=lambda x: Dual(math.sqrt(x.a), x.b / (2 * math.sqrt(x.a))),
)


@pytest.mark.parametrize("name", ["four_bar", "cam_by_table", "rssr"])
def test_that_dual_numbers_give_phi_q_and_nu(name, example_named):
    module = kc.compile(example_named(name).model)
    lanes, m = module.lanes(DUALS), module.N_EQUATIONS
    rng = np.random.default_rng(1)
    q, p = rng.uniform(-1, 1, module.N_COORDINATES), [Dual(x) for x in module.DEFAULTS]
    columns = [
        [dual(x).b for x in lanes["position"]([*map(Dual, q, e)], Dual(0.3), p)[:m]]
        for e in np.eye(len(q))
    ]
    np.testing.assert_allclose(np.transpose(columns), module.Phi_q(q, 0.3), rtol=1e-13, atol=1e-13)
    rate = [dual(x).b for x in lanes["position"]([*map(Dual, q)], Dual(0.3, 1.0), p)[:m]]
    np.testing.assert_allclose(rate, -module.nu(q, 0.3), rtol=1e-13, atol=1e-13)


def four_bar_angles(a, b, c, d, angle):
    """Return angles of coupler and rocker by the closed form, on mpmath's numbers."""
    x, y = d - a * mpmath.cos(angle), -a * mpmath.sin(angle)
    away = mpmath.sqrt(x**2 + y**2)
    turn = mpmath.acos((b**2 + away**2 - c**2) / (2 * b * away))
    coupler = mpmath.atan2(y, x) + turn
    tip = a * mpmath.cos(angle) + b * mpmath.cos(coupler), a * mpmath.sin(angle)
    return coupler, mpmath.atan2(-(tip[1] + b * mpmath.sin(coupler)), d - tip[0])


def newton(module, lanes, q, t, p, steps):
    """Return q after steps of Newton's method with the planned solve."""
    for _ in range(steps):
        values = lanes["position"](q, t, p)
        factors, _ = lanes["factor"](values[module.N_EQUATIONS :])
        change = lanes["solve"](factors, values[: module.N_EQUATIONS])
        q = [x - y for x, y in zip(q, change, strict=True)]
    return q


def test_that_forty_digits_are_the_closed_form(example_named):
    module = kc.compile(example_named("four_bar").model)
    start, t = kc.solve(module, [0.0, 0.7]).q[1], 0.7
    with mpmath.workdps(45):
        p = [mpmath.mpf(x) for x in module.DEFAULTS.tolist()]
        given = [mpmath.mpf(x) for x in start.tolist()], mpmath.mpf(t)
        q = newton(module, module.lanes(mpmath.mp), *given, p, 3)
        coupler, rocker = four_bar_angles(p[0], p[1], p[2], p[3], p[4] * given[1])
        assert abs(q[5] - coupler) < mpmath.mpf(10) ** -40
        assert abs(mpmath.sin(q[8] - rocker)) < mpmath.mpf(10) ** -40


def test_that_intervals_hold_what_they_must(example_named):
    module = kc.compile(example_named("four_bar").model)
    iv, q = mpmath.iv, kc.solve(module, 0.7).q[0].tolist()
    lanes, p = module.lanes(iv), [iv.mpf(x) for x in module.DEFAULTS.tolist()]
    bounds = lanes["position"]([iv.mpf(x) for x in q], iv.mpf(0.7), p)[: module.N_EQUATIONS]
    with mpmath.workdps(40):
        given = [mpmath.mpf(x) for x in q], mpmath.mpf(0.7), [*map(mpmath.mpf, module.DEFAULTS)]
        exact = module.lanes(mpmath.mp)["position"](*given)[: module.N_EQUATIONS]
        for bound, value in zip(map(iv.mpf, bounds), exact, strict=True):
            assert value in bound
            assert bound.delta < 1e-13


def large_block():
    """Return eight equations that can only be solved together."""
    x = sympy.symbols("x:8")
    equations = [
        x[k] + x[(k + 1) % 8] ** 2 / 7 - x[(k + 3) % 8] * x[k] / 5 - sympy.sin(kc.t + k) / 3
        for k in range(8)
    ]
    return kc.ConstraintSystem("ring", [str(item) for item in x], equations)


@pytest.mark.parametrize("library", ["array_api_strict", "mpmath"])
def test_that_a_large_block_is_solved(library):
    module = kc.compile(large_block())
    rng = np.random.default_rng(4)
    q, b = rng.uniform(-1, 1, (8, 5)), rng.uniform(-1, 1, (8, 5))
    expected = np.linalg.solve(module.Phi_q(q.T, 0.2), b.T[..., None])[..., 0]
    determinants = np.linalg.det(module.Phi_q(q.T, 0.2))
    xp = pytest.importorskip("array_api_strict") if library == "array_api_strict" else mpmath.mp
    lanes, take = module.lanes(xp), getattr(xp, "asarray", None)
    for k in range(1 if take else 5):
        given = [[take(x) if take else mpmath.mpf(x[k]) for x in rows] for rows in (q, b)]
        values = lanes["position"](given[0], 0.2, [])
        factors, found = lanes["factor"](values[8:])
        own = np.array([np.array(x, dtype=float) for x in lanes["solve"](factors, given[1])])
        np.testing.assert_allclose(own.T, expected if take else expected[k], rtol=1e-12, atol=1e-13)
        known = determinants if take else determinants[k]
        own = np.prod([np.array(x, dtype=float) for x in found], axis=0)
        np.testing.assert_allclose(abs(own), abs(known), rtol=1e-11)


def test_that_what_a_library_lacks_is_named(example_named):
    module = kc.compile(example_named("four_bar").model)
    lanes = module.lanes(SimpleNamespace(sin=math.sin))
    with pytest.raises(kc.InputError, match="SimpleNamespace has no function cos"):
        lanes["position"](module.GUESS, 0.0, module.DEFAULTS)


def test_that_intervals_which_cannot_choose_are_refused(example_named):
    iv = mpmath.iv
    cam = kc.compile(example_named("cam_by_table").model)
    given = [iv.mpf(x) for x in cam.GUESS.tolist()], iv.mpf(0), [*map(iv.mpf, cam.DEFAULTS)]
    with pytest.raises(kc.InputError, match="no remainder or no order, which a spline needs"):
        cam.lanes(iv)["position"](*given)
    equation = sympy.Symbol("x") - sympy.Piecewise((kc.t**2, kc.t < 1), (2 * kc.t - 1, True))
    m = kc.ConstraintSystem("two", ["x"], [equation])
    lanes = kc.compile(m).lanes(iv)
    assert 0.75 in lanes["position"]([iv.mpf(1)], iv.mpf(0.5), [])[0]
    with pytest.raises(kc.InputError, match="cannot be compared, and a choice depends on it"):
        lanes["position"]([iv.mpf(1)], iv.mpf([0.5, 1.5]), [])

"""What is wrong with a mechanism: the class of the error, and who, what and how to mend it."""

import re
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy
from sympy.physics.mechanics import dynamicsymbols

import kincompile as kc

t, alpha = kc.t, kc.alpha
nan, inf = float("nan"), float("inf")
L, x = sympy.Symbol("L"), sympy.Symbol("x")


def problems_of(add: Callable[..., Any]) -> tuple[str, ...]:
    """Return what is said of a mechanism with bodies crank and rod, a parameter L and one joint."""
    m = kc.Mechanism("m")
    m.parameter("L", 0.5)
    m.add(add(m, m.body("crank"), m.body("rod")))
    with pytest.raises(kc.ModelError) as caught:
        m.system()
    problems: tuple[str, ...] = caught.value.problems
    return problems


def bodies(first: Any, second: Any) -> Callable[..., Any]:
    return lambda m, i, j: kc.Revolute("A", first(m, i, j), (0, 0), second(m, i, j), (0, 1))


def revolute(point: Any) -> Callable[..., Any]:
    return lambda m, i, j: kc.Revolute("A", i, point, j, (0, 1))


def slide(axis: Any) -> Callable[..., Any]:
    return lambda m, i, j: kc.Translational("S", i, (0, 0), (1, 0), j, (0, 0), axis)


def distance(value: Any) -> Callable[..., Any]:
    return lambda m, i, j: kc.Distance("rope", i, (0, 0), j, (0, 0), value)


def driver(value: Any) -> Callable[..., Any]:
    return lambda m, i, j: kc.AbsoluteAngle("motor", i, value)


def equation(*expressions: Any) -> Callable[..., Any]:
    return lambda m, i, j: kc.Equation("e", *expressions)


def profile(rho: Any) -> Callable[..., Any]:
    return lambda m, i, j: kc.CamFlatFollower("cam", i, (0, 0), rho, j, (0, 0), (1, 0))


def foreign(*_: Any) -> Any:
    return kc.Mechanism("other").body("pillar")


crank_of, rod_of = (lambda m, i, j: i), (lambda m, i, j: j)
crank_x, crank_phi = sympy.Symbol("x_crank"), sympy.Symbol("phi_crank")
f = sympy.Function("f")

BAD = {
    # bodies
    "unknown body": (
        bodies(crank_of, lambda m, i, j: "rode"),
        r"Revolute 'A', j: there is no body 'rode' in this mechanism; did you mean 'rod'\?; bodies "
        r"are: ground, crank, rod",
    ),
    "foreign body": (bodies(foreign, rod_of), r"Revolute 'A', i: there is no body 'pillar'"),
    "no body": (bodies(lambda m, i, j: None, rod_of), "i: there is no body None .* are: ground"),
    "array for a body": (bodies(crank_of, lambda m, i, j: np.ones(2)), "j: there is no body array"),
    "equal bodies": (
        bodies(rod_of, rod_of),
        "Revolute 'A': bodies i and j are both 'rod'; a joint connects two different bodies",
    ),
    "ground twice": (bodies(lambda m, i, j: m.ground, lambda m, i, j: "ground"), "both 'ground'"),
    "ground driven": (
        lambda m, i, j: kc.AbsoluteX("slide", m.ground, (0, 0), 1),
        "AbsoluteX 'slide': the ground cannot be constrained; name a body of the mechanism",
    ),
    # points and axes
    "three numbers": (
        revolute((1, 2, 3)),
        r"Revolute 'A', point_i: \(1, 2, 3\) is not a pair \(xi, eta\) of coordinates in the body",
    ),
    "one number": (revolute(1.5), "point_i: 1.5 is not a pair"),
    "no point": (revolute(None), "point_i: None is not a pair"),
    "text": (revolute("12"), "point_i: no joint '12' is drawn on this body; give one"),
    "set": (revolute({1, 2}), r"point_i: {1, 2} is not a pair"),
    "generator": (revolute(k for k in (1, 2)), "point_i: <generator .* is not a pair"),
    "matrix": (revolute(np.ones((2, 2))), "point_i: array.* is not a number or a SymPy expression"),
    "texts": (revolute(("a", 0)), "point_i: 'a' is not a number or a SymPy expression; give a"),
    "nan": (revolute((nan, 0)), "Revolute 'A', point_i: nan is not finite; give a finite number"),
    "numpy's nan": (revolute(np.array([0, nan])), "point_i: nan is not finite"),
    "infinity": (revolute((0, inf)), "point_i: inf is not finite"),
    "SymPy's infinity": (revolute((0, sympy.oo)), "point_i: oo is not finite"),
    "complex": (revolute((0, 1j)), "point_i: 1j is not a number"),
    "SymPy's i": (revolute((sympy.I, 0)), "point_i: I is not real"),
    "not real": (revolute((sympy.asin(2), 0)), r"point_i: asin\(2\) is not real"),
    "truth": (revolute((True, 0)), "point_i: True is a truth value, not a number"),
    "beyond floats": (revolute((10**400, 0)), "point_i: the number is beyond 1e308"),
    "fraction": (revolute((Fraction(10**400, 3), 0)), "point_i: the number is beyond 1e308"),
    "moving point": (
        revolute((t, 0)),
        "point_i: t depends on t; an attribute is fixed in its body, so only parameters may occur",
    ),
    "coordinate": (revolute((crank_x, 0)), "point_i: x_crank depends on x_crank; an attribute is"),
    "undeclared": (
        revolute((sympy.Symbol("LL"), 0)),
        r"Revolute 'A', point_i contains LL, which is not declared; did you mean 'L'\?; declare it "
        "as a parameter or use one of: L, phi_crank",
    ),
    "zero axis": (
        slide((0, 0)),
        r"Translational 'S', axis_j: the axis has length zero; give a direction such as \(1, 0\)",
    ),
    "axis zero by default": (slide((L - 0.5, 0)), "axis_j: the axis has length zero"),
    # values
    "no distance": (
        distance(0),
        r"Distance 'rope', distance: the distance is 0, but must be positive: at distance 0 the "
        r"Jacobian row 2 d\^T \[I, B s\] vanishes; .* use a Revolute \(or AbsoluteX",
    ),
    "negative distance": (distance(-2.5), "the distance is -2.5, but must be positive"),
    "distance 0 by default": (distance(2 * L - 1), "the distance is 0, but must be positive"),
    "distance to ground": (
        lambda m, i, j: kc.AbsoluteDistance("rope", i, (0, 0), (1, 1), 0.0),
        "AbsoluteDistance 'rope', distance: the distance is 0",
    ),
    "driver of q": (
        driver(t + crank_phi),
        "AbsoluteAngle 'motor', angle: the value phi_crank . t depends on phi_crank; a driver is a "
        "function of t and parameters only; write a coordinate-dependent condition as an Equation",
    ),
    "text in Python": (driver("2*pi*t"), r"'2\*pi\*t' is not a number .* as 2\*kc\.pi\*kc\.t"),
    "nobody's symbol": (driver(sympy.Symbol("omega") * t), "angle contains omega, which is not"),
    "undefined function": (driver(f(t)), "angle contains f, which is not declared"),
    "function of another": (driver(f(L)), r"angle: the function f\(L\) is not defined; give it"),
    "rate": (
        driver(dynamicsymbols("s").diff(t)),
        r"angle: Derivative\(s\(t\), t\) contains a time derivative; a constraint Phi\(q, t\) ",
    ),
    "Abs": (
        driver(sympy.Abs(t - 1)),
        r"angle: Abs\(t - 1\) has no continuous derivative; write a smooth function, or a "
        "sympy.Piecewise whose pieces meet with equal value and slope",
    ),
    "sign": (driver(sympy.sign(t)), r"sign\(t\) has no continuous derivative"),
    "Min": (driver(sympy.Min(t, 1)), "Min.* has no continuous derivative"),
    "Max": (driver(sympy.Max(t, L)), "Max.* has no continuous derivative"),
    "floor": (driver(sympy.floor(t)), "floor.* has no continuous derivative"),
    "ceiling": (driver(sympy.ceiling(t)), "ceiling.* has no continuous derivative"),
    "Heaviside": (driver(sympy.Heaviside(t - 1)), "Heaviside.* has no continuous derivative"),
    "Mod": (driver(sympy.Mod(t, 2)), "Mod.* has no continuous derivative"),
    "gamma": (driver(sympy.gamma(t)), "the function gamma is not supported; write it"),
    "conjugate": (driver(sympy.conjugate(t)), "the function conjugate is not supported"),
    "integral": (driver(sympy.Integral(sympy.exp(-(t**2)), t)), "Integral in .* is not supported"),
    "open pieces": (
        driver(sympy.Piecewise((t, t < 1))),
        r"angle: .* has no value where none of its conditions holds; end it with a piece "
        r"\(expression, True\)",
    ),
    "jump": (driver(sympy.Piecewise((0, t < 1), (1, True))), "the pieces do not meet at t = 1: 0"),
    "matrix driver": (driver(sympy.Matrix([t])), r"angle: Matrix\(\[\[t\]\]\) is not a number"),
    "comparison": (driver(t < 1), "angle: t < 1 is not a number or a SymPy expression"),
    "text driver": (driver("2*t"), r"angle: '2\*t' is not a number or a SymPy expression"),
    "lambda": (driver(lambda time: time), "angle: <function .* is not a number"),
    # gears
    "no radius": (
        lambda m, i, j: kc.Gear("G", i, (0, 0), 0, 0, j, (0, 0), 1, 0),
        r"Gear 'G', radius_i: the radius is zero; give the pitch radius \(negative for an",
    ),
    "radii that cancel": (
        lambda m, i, j: kc.Gear("G", i, (0, 0), -L, 0, j, (0, 0), 0.5, 0),
        "Gear 'G': the radii -0.5 and 0.5 add to zero; an internal gear needs two different radii",
    ),
    "no pitch line": (
        lambda m, i, j: kc.RackAndPinion("R", i, (1, L), (1, 0.5), 0, j, (0, 0), 1, 0),
        "RackAndPinion 'R': point_p and point_q are equal; two different points fix the pitch line",
    ),
    # profiles
    "profile that is none": (
        profile("round"),
        r"CamFlatFollower 'cam', profile: 'round' is neither a radius rho\(alpha\) nor a table "
        r"\(angles, radii\)",
    ),
    "pairs": (profile([(0, 1), (1, 1), (2, 1)]), r"profile: \[\(0, 1\), .* nor a table"),
    "profile of time": (profile(1 + t**2), "profile contains t, which is not declared"),
    "profile of a coordinate": (profile(1 + crank_phi), "profile contains phi_crank, which is"),
    "profile of two": (profile(x * sympy.Symbol("y")), "profile contains x, y, which are"),
    "profile with a kink": (profile(1 + sympy.Abs(alpha)), r"Abs\(alpha\) has no continuous"),
    "profile of numbers": (
        profile(np.cos),
        r"profile: the function cannot be called with the symbol alpha \(.*\); write it as "
        r"rho\(alpha\) with SymPy's functions, sympy.cos instead of math.cos",
    ),
    "profile that fails": (profile(lambda a: 1 / 0), r"called with the symbol alpha \(division"),
    "short table": (profile(([0, 1, 2], [1, 1, 1])), "profile: a table needs at least 6 points"),
    "uneven table": (
        profile((range(8), range(7))),
        r"profile: angles and radii must be two lists of equal length, not of shapes \(8,\) and",
    ),
    "falling table": (profile(([0, 1, 2, 1.5, 3, 4], [1] * 6)), "increase, but 1.5 follows 2"),
    "table in degrees": (
        profile((np.linspace(0, 350, 36), np.ones(36))),
        r"the angles span 350 rad, more than one revolution \(are they in degrees\?\)",
    ),
    "open table": (
        profile((np.linspace(0, 2 * np.pi, 9), np.linspace(1, 2, 9))),
        "the table closes after one revolution, but its radius there is 2, not 1",
    ),
    "table with nan": (profile((range(6), [1, 1, nan, 1, 1, 1])), "values that are not finite"),
    "complex table": (profile((np.arange(6) * 1j, np.ones(6))), "contains complex numbers"),
    "table of text": (profile((range(6), ["a"] * 6)), "profile: could not convert string to float"),
    # free equations
    "no expression": (equation(), "Equation 'e' has no expression; give at least one"),
    "no coordinate": (
        equation(t - L),
        "equation 'e' contains no coordinate, so it cannot constrain anything; coordinates are: "
        "x_crank, y_crank, phi_crank",
    ),
    "velocity": (
        equation(crank_x.diff(crank_x) + sympy.Derivative(dynamicsymbols("x_crank"), t)),
        "equation 'e': .* contains a time derivative; a constraint Phi.q, t. may contain",
    ),
    "rate by name": (equation(crank_x - sympy.Symbol("x_rod_dot")), "contains x_rod_dot, which"),
    "second of two": (equation(crank_x, sympy.Abs(crank_x)), "equation 'e.2': Abs"),
    "an equation that always holds": (equation(sympy.Eq(crank_x, crank_x)), "'e': True is not a"),
    "text equation": (equation("x_crank - 1"), "equation 'e': 'x_crank - 1' is not a number"),
    "constant beyond floats": (equation(10**400), "equation 'e': the number is beyond 1e308"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_that_a_mistake_is_named(case: str) -> None:
    add, message = BAD[case]
    (problem,) = problems_of(add)
    assert re.search(message, problem, re.DOTALL), problem


@pytest.mark.parametrize("case", BAD)
def test_that_a_message_is_a_sentence_for_a_person(case: str) -> None:
    """No trace of the program in it, and no line as long as a page."""
    (problem,) = problems_of(BAD[case][0])
    assert "kincompile" not in problem.replace("m.ground", "")
    assert not re.search(r"KeyError|NoneType|__|Traceback", problem)
    assert len(problem) < 600


# ---- names ---------------------------------------------------------------------------------------


def named(**names: Any) -> kc.Mechanism:
    m = kc.Mechanism(names.get("mechanism", "m"))
    body = m.body(names.get("body", "crank"))
    m.parameter(names.get("parameter", "L"), 1.0)
    m.add(kc.AbsoluteAngle(names.get("constraint", "motor"), body, t))
    return m


@pytest.mark.parametrize("what", ["mechanism", "body", "parameter", "constraint"])
@pytest.mark.parametrize(
    "name",
    ["", "two words", "2nd", "a-b", "naïve", "a.b", "_a", "a\n", None, 5, 1.5, (), ["a"], {}],
)
def test_that_a_malformed_name_is_refused(what: str, name: Any) -> None:
    article = {"mechanism": "the system"}.get(what, f"a {what}")
    message = (
        rf"{article} is named {re.escape(repr(name))}: a name is an ASCII letter followed by "
        "letters, digits or underscores; rename it"
    )
    with pytest.raises(kc.ModelError, match=message):
        named(**{what: name}).system()


@pytest.mark.parametrize("name", ["t", "pi", "alpha"])
def test_that_a_name_with_a_meaning_is_refused_where_it_stands_in_formulas(name: str) -> None:
    with pytest.raises(kc.ModelError, match=rf"is named '{name}', which is reserved \(t is time,"):
        named(parameter=name).system()


@pytest.mark.parametrize("what", ["mechanism", "body", "constraint"])
@pytest.mark.parametrize("name", ["t", "pi", "alpha"])
def test_that_it_may_be_the_name_of_anything_else(what: str, name: str) -> None:
    assert named(**{what: name}).system().coordinates


def test_that_no_body_may_be_called_ground() -> None:
    message = "body 'ground': this is the name of the fixed frame; use m.ground, or another name"
    with pytest.raises(kc.ModelError, match=message):
        named(body="ground").system()


def twice(m: kc.Mechanism, what: str) -> None:
    crank = m.body("crank")
    m.parameter("L", 1.0)
    m.add(kc.AbsoluteAngle("motor", crank, t))
    if what == "body":
        m.body("crank")
    elif what == "parameter":
        m.parameter("L", 2.0)
    elif what == "constraint":
        m.add(kc.AbsoluteX("motor", crank, (0, 0), 1))
    elif what == "parameter and coordinate":
        m.parameter("phi_crank", 2.0)
    elif what == "parameter and rate":
        m.parameter("phi_crank_dot", 2.0)
    elif what == "coordinates of two bodies":
        m.body("crank_dot")


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("body", "2 bodies are named 'crank'; give each a name of its own"),
        ("parameter", "2 coordinates, rates and parameters are named 'L'; give each a name"),
        ("constraint", "2 constraints are named 'motor'; give each a name of its own"),
        ("parameter and coordinate", "2 coordinates, rates and parameters are named 'phi_crank'"),
        ("parameter and rate", "2 coordinates, rates and parameters are named 'phi_crank_dot'"),
        ("coordinates of two bodies", "rates and parameters are named 'x_crank_dot'"),
    ],
)
def test_that_a_name_used_twice_is_refused(what: str, message: str) -> None:
    m = kc.Mechanism("m")
    twice(m, what)
    with pytest.raises(kc.ModelError, match=message):
        m.system()


@pytest.mark.parametrize("unit", ['"""', "m\n", "\\", "'", None, 5, "/* x */"])
def test_that_a_unit_cannot_end_the_text_it_stands_in(unit: Any) -> None:
    m = named()
    m.parameter("h", 1.0, unit=unit)
    with pytest.raises(kc.ModelError, match=r"the unit of parameter 'h' is .*: a unit consists of"):
        m.system()
    other = kc.Mechanism("m", length_unit=unit)
    other.add(kc.AbsoluteAngle("motor", other.body("crank"), t))
    with pytest.raises(
        kc.ModelError, match=r"the unit of lengths is .*: a unit consists of letters"
    ):
        other.system()


# ---- parameters and guesses ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("default", "message"),
    [
        (None, r"parameter 'h' has no value; give a default: parameter\('h', 1.0\)"),
        (nan, "parameter 'h': nan is not finite; give a finite number"),
        (inf, "parameter 'h': inf is not finite"),
        ("long", "parameter 'h': 'long' is not a number"),
        (1j, "parameter 'h': 1j is not a number"),
        (True, "parameter 'h': True is a truth value"),
        (10**400, "parameter 'h': the number is beyond 1e308"),
        (sympy.Float("1e500"), "parameter 'h': the number is beyond 1e308"),
        (2 * L, r"parameter 'h': 2\*L is not a number at the default parameters; give a finite"),
        ([1.0], r"parameter 'h': \[1.0\] is not a number"),
    ],
)
def test_that_a_parameter_needs_a_number(default: Any, message: str) -> None:
    m = named()
    m.parameter("h", default)
    with pytest.raises(kc.ModelError, match=message):
        m.system()


@pytest.mark.parametrize(
    ("ends", "message"),
    [
        ((2, 1), "parameter 'h': its range goes from 2 to 1; give the least value first"),
        ((1, 1), "parameter 'h': its range goes from 1 to 1; give the least value first"),
        ((2, 3), "parameter 'h': its default 1 is outside its range from 2 to 3"),
        ((-1, 0.9), "parameter 'h': its default 1 is outside its range from -1 to 0.9"),
        (5, r"parameter 'h': its range is 5; give \(least, greatest\) value"),
        ((0, 1, 2), r"parameter 'h': its range is \(0, 1, 2\); give \(least, greatest\) value"),
        (("a", 2), "parameter 'h', range: 'a' is not a number"),
        ((0, nan), "parameter 'h', range: nan is not finite"),
        ((0, 2 * L), r"parameter 'h', range: 2\*L is not a number at the default parameters"),
        ((0, 90 * kc.deg), "parameter 'h', range: 90.deg is in degrees"),
    ],
)
def test_that_a_range_is_two_numbers_around_the_default(ends: Any, message: str) -> None:
    m = named()
    m.parameter("h", 1.0, unit="m", range=ends)
    with pytest.raises(kc.ModelError, match=message):
        m.system()


@pytest.mark.parametrize(
    ("guess", "message"),
    [
        ((1, 2), r"body 'rod': the guess \(1, 2\) is not \(x, y, phi\)"),
        (0, r"body 'rod': the guess 0 is not \(x, y, phi\)"),
        (None, r"body 'rod': the guess None is not \(x, y, phi\)"),
        ((0, nan, 0), "guess of y_rod: nan is not finite; give a finite number"),
        ((0, 0, "a"), "guess of phi_rod: 'a' is not a number"),
        ((0, t, 0), "guess of y_rod: t is not a number at the default parameters"),
        (np.array([0, 0, inf]), "guess of phi_rod: inf is not finite"),
    ],
)
def test_that_a_guess_is_three_numbers(guess: Any, message: str) -> None:
    m = named()
    m.body("rod", guess)
    with pytest.raises(kc.ModelError, match=message):
        m.system()


@pytest.mark.parametrize(
    ("guess", "message"),
    [
        (
            (1, 2, 3),
            "CamFollower 'cam': the guess has 3 values; give one for each of alpha_i_cam, a",
        ),
        (
            1.0,
            "CamFollower 'cam': the guess has 1 values; give one for each of alpha_i_cam, alpha_",
        ),
        ((0, nan), "guess of alpha_j_cam: nan is not finite"),
    ],
)
def test_that_a_cam_takes_a_guess_for_each_contact(guess: Any, message: str) -> None:
    m = kc.Mechanism("m")
    i, j = m.body("i"), m.body("j")
    m.add(kc.CamFollower("cam", i, (0, 0), 1, j, (0, 0), 1, guess=guess))
    with pytest.raises(kc.ModelError, match=message):
        m.system()


# ---- everything at once --------------------------------------------------------------------------


def test_that_an_empty_mechanism_says_what_it_needs() -> None:
    with pytest.raises(kc.ModelError) as caught:
        kc.Mechanism("empty").system()
    assert caught.value.problems == (
        "'empty' has no constraints; add joints and drivers, or equations",
        "'empty' has no coordinates; add a body, or name coordinates",
    )


def test_that_all_problems_are_told_at_once_and_each_once() -> None:
    m = kc.Mechanism("all at once")
    crank = m.body("crank", guess=(0, nan, 0))
    m.parameter("L")
    m.add(kc.Revolute("A", m.ground, (0, 0, 0), "rod", (inf, 0)))
    m.add(kc.Translational("S", crank, (0, 0), (0, 0), crank, (0, 0), (0, 0)))
    m.add(kc.Distance("rope", m.ground, (0, 0), crank, (0, 0), -1))
    m.add(kc.AbsoluteAngle("motor", crank, t + crank.phi))
    m.add(kc.Equation("e", sympy.Abs(crank.x)))
    with pytest.raises(kc.ModelError) as caught:
        m.system()
    found = caught.value.problems
    assert len(found) == len(set(found)) == 12
    for words in (
        "the system is named 'all at once'", "parameter 'L' has no value", "guess of y_crank",
        "'A', point_i", "'A', j: there is no body 'rod'", "'A', point_j: inf", "'S', axis_i",
        "'S', axis_j", "'S': bodies i and j", "'rope', distance", "'motor', angle", "equation 'e'",
    ):  # fmt: skip
        assert len([problem for problem in found if words in problem]) == 1
    text = str(caught.value)
    assert text.startswith("12 problems:\n  - ")
    assert len(text.splitlines()) == 13


@pytest.mark.parametrize(
    "use",
    [kc.compile, kc.emit, lambda m: m.Phi, lambda m: m.q],
    ids=["compile", "emit", "Phi", "q"],
)
def test_that_every_use_of_a_bad_mechanism_says_so(use: Callable[..., Any]) -> None:
    with pytest.raises(kc.ModelError, match="'empty' has no constraints"):
        use(kc.Mechanism("empty"))


def test_that_a_model_error_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="no constraints"):
        kc.Mechanism("empty").system()

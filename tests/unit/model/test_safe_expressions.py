"""Text to SymPy through a whitelist: what is read, what is refused, where a message points."""

import random
from contextlib import suppress
from keyword import kwlist
from pathlib import Path

import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

from kincompile.files.formula_text import GRAMMAR, ExpressionError
from kincompile.files.safe_expressions import (
    FUNCTIONS,
    MAX_DEPTH,
    MAX_LENGTH,
    MAX_NODES,
    parse_expression,
)
from kincompile.files.text_places import TextPlace
from kincompile.model.expressions import SMOOTH
from kincompile.model.spline import PeriodicSpline

x, y, phi3 = sympy.symbols("x y phi3")
STEP = "Piecewise((x*{0}, y < {0}), (y, True))"
NAMES = {"x": x, "y": y, "phi3": phi3, "w": 2 * y, "step": sympy.Piecewise((x, y < 1), (y, True))}


def nested(levels):
    """Return Piecewise of so many levels, each in the condition of the next."""
    return "Piecewise((1, x < " * levels + "3" + "), (2, True))" * levels


def test_that_names_which_python_keeps_are_read_where_they_are_declared() -> None:
    names = {word: sympy.Symbol(f"_{word}") for word in kwlist if word not in GRAMMAR}
    for word, value in names.items():
        read = parse_expression(f"2^{word} - {word}^2*y", {**NAMES, **names})
        assert read == 2**value - value**2 * y
    with pytest.raises(ExpressionError, match=r"column 22: there is no 'z'; .* lambda, "):
        parse_expression("lambda^2*lambda^2 + (z)", {**NAMES, **names})
    with pytest.raises(ExpressionError, match="'lambda' is not a function; write "):
        parse_expression("lambda(2)", names)
    with pytest.raises(ExpressionError, match="column 8: found '2'"):
        parse_expression("lambda^2", NAMES)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0.25*cos(phi3)", sympy.Float(0.25) * sympy.cos(phi3)),
        ("x^2 + y**2", x**2 + y**2),
        ("-x^2", -(x**2)),
        ("2^-x", 2 ** (-x)),
        ("x^2^3", x**8),
        ("x - y - 1", x - y - 1),
        ("x/y/2", x / y / 2),
        ("(x + y)*3 - 1", 3 * (x + y) - 1),
        ("1/3", sympy.Rational(1, 3)),
        ("+x", x),
        ("3*pi/2", 3 * sympy.pi / 2),
        ("sqrt(x) + ln(y) + arctan2(x, y)", sympy.sqrt(x) + sympy.log(y) + sympy.atan2(x, y)),
        ("x +\n   y", x + y),
        ("w*x", 2 * x * y),
        ("Piecewise((x, x < 1), (1, True))", sympy.Piecewise((x, x < 1), (1, True))),
        (
            "Piecewise((x, 0 <= x < 1 or y > 2), (1, True))",
            sympy.Piecewise((x, ((x >= 0) & (x < 1)) | (y > 2)), (1, True)),
        ),
    ],
)
def test_that_a_formula_is_read_as_it_is_meant(text: str, expected: sympy.Expr) -> None:
    assert parse_expression(text, NAMES) == expected


def test_that_every_smooth_function_can_be_called() -> None:
    readable = {function for function, *_ in FUNCTIONS.values()} | {sympy.Piecewise, PeriodicSpline}
    assert set(SMOOTH) <= readable


@pytest.mark.parametrize(
    ("text", "where", "message"),
    [
        ("x + zeta", (1, 5), "there is no 'zeta'; the names are: x, y, phi3, w"),
        ("phi33", (1, 1), "did you mean 'phi3'"),
        ("x +\n  zeta", (2, 3), "there is no 'zeta'"),
        ("x^2 + y^2 + zeta", (1, 13), "there is no 'zeta'"),
        ("2x", (1, 1), "write a product as"),
        ("cos phi3", (1, 1), "operator"),
        ("x +", (1, 4), "ends too early"),
        ("(x", (1, 1), "never closed"),
        ("x)", (1, 2), "never opened"),
        ("[x)", (1, 3), "opened with"),
        ("x)+(y", (1, 2), "never opened"),
        ("cos(x, y)", (1, 1), "cos takes 1 argument, not 2"),
        ("cos", (1, 1), "write cos"),
        ("y(x)", (1, 1), "for a product"),
        ("cosh2(x)", (1, 1), "did you mean 'cosh'"),
        ("x < 1", (1, 1), "a comparison stands in Piecewise"),
        ("Piecewise((x, x < 1))", (1, 1), "the last piece"),
        ("Piecewise((x, x == 1), (1, True))", (1, 15), "a condition is"),
        ("x/0", (1, 3), "divides by zero"),
        ("log(0)", (1, 1), "not finite"),
        ("sqrt(-1)", (1, 1), "not real"),
        ("(-8)^(1/3)", (1, 1), "not real"),
        ("1e999", (1, 1), "too large"),
        ("10^64*10^64*10^64*10^64*10^64", (1, 1), "too large"),
        ("exp(exp(exp(100.0)))", (1, 5), "too large"),
        ("y + 1e308*x*10", (1, 1), "too large"),
        ("9^9^9", (1, 3), "exponent is beyond"),
        ("True", (1, 1), "not a real number"),
        ("", (1, 1), "empty"),
        ("x−y", (1, 2), "write -"),  # noqa: RUF001 - the minus of a word processor
    ],
)
def test_that_a_mistake_is_shown_with_its_place(
    text: str, where: tuple[int, int], message: str
) -> None:
    with pytest.raises(ExpressionError, match=message) as caught:
        parse_expression(text, NAMES)
    assert (caught.value.line, caught.value.column) == where


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('touch pwned')",
        "x.__class__.__mro__",
        "().__class__",
        "[k for k in (1,)]",
        "(lambda: 1)()",
        "open('pwned', 'w')",
        "exec('1')",
        "cos(*x)",
        "cos(x=1)",
        "f'{x}'",
        "x if y else 1",
        "(x := 1)",
        "x[0]",
        "x @ y",
        "x; y",
        "x # y",
        "x\\",
        "1j",
        "...",
        "None",
        "not x",
        "~x",
        "x // y",
        "x % y",
    ],
)
def test_that_code_is_refused(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ExpressionError, match="line 1, column"):
        parse_expression(text, NAMES)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x" * (MAX_LENGTH + 1), "characters"),
        ("-" * (MAX_DEPTH + 2) + "x", "levels deep"),
        ("-" * 10_000 + "x", "too deeply"),
        ("(" * 300 + "x" + ")" * 300, "brackets|nested|parentheses|operator"),
        ("+".join(["x"] * MAX_NODES), "more than"),
        ("(((((7^64)^64)^64)^64)^64)", "too large"),
        ("((((1/3)^-64)^64)^-64)^64", "too large"),
        ("((((2*x)^64)^64)^64)^64", "too large"),
        ("((7^(1/3))^64)^64", "too large"),
        ("((x^8)^8)^2", "exponent is beyond 64"),
        ("+".join(f"x/{p}^60" for p in range(3, 400, 2)), "too many digits"),
        (nested(20), "values in conditions have more than 6 pieces"),
        (f"Piecewise((1, {'+'.join(map(STEP.format, range(20)))} < 3), (2, True))", "6 pieces"),
        (f"Piecewise((1, {' and '.join(['step < 3'] * 20)}), (2, True))", "6 pieces"),
    ],
)
def test_that_the_limits_hold(text: str, message: str) -> None:
    with pytest.raises(ExpressionError, match=message):
        parse_expression(text, NAMES)


def test_that_pieces_are_free_outside_of_conditions() -> None:
    value = "x"
    for k in range(20):
        value = f"Piecewise((y, x < {k}), (sin({value}), True))"
    assert parse_expression(value, NAMES).subs(x, 2.5) == y
    assert parse_expression(nested(2), NAMES).subs(x, 5) == 2


def test_that_a_long_sum_is_one_level() -> None:
    assert parse_expression("+".join(["x"] * 1000), NAMES) == 1000 * x


def test_that_a_refused_name_comes_with_its_reason() -> None:
    with pytest.raises(ExpressionError, match="column 5: 'a' cannot stand here: no accelerations"):
        parse_expression("x + a", NAMES, refused={"a": "no accelerations"})


def test_that_places_count_from_where_the_text_begins() -> None:
    with pytest.raises(ExpressionError, match="line 7, column 14") as first:
        parse_expression("x + zeta", NAMES, TextPlace(7, 10))
    with pytest.raises(ExpressionError, match="line 8, column 3"):
        parse_expression("x +\n  zeta", NAMES, TextPlace(7, 10))
    assert first.value.problem.startswith("there is no 'zeta'")


@given(st.text(alphabet="xy012.+-*/^() ,<>=_cosin\n[]", max_size=25))
def test_that_any_text_is_an_expression_or_an_expression_error(text: str) -> None:
    with suppress(ExpressionError):
        assert parse_expression(text, NAMES).free_symbols <= {x, y}


_ATOMS = st.sampled_from([x, y, sympy.Integer(2), sympy.Rational(3, 7), sympy.pi])


def _larger(inner: st.SearchStrategy[sympy.Expr]) -> st.SearchStrategy[sympy.Expr]:
    pairs = st.tuples(inner, inner)
    return st.one_of(
        pairs.map(lambda pair: pair[0] + pair[1]),
        pairs.map(lambda pair: pair[0] * pair[1]),
        inner.map(sympy.cos),
        inner.map(lambda item: -item),
        inner.map(lambda item: item**2),
    )


@given(st.recursive(_ATOMS, _larger, max_leaves=8))
def test_that_what_sympy_prints_is_read_back(expression: sympy.Expr) -> None:
    assert parse_expression(str(expression), NAMES) == expression


# Exact numbers whose size SymPy does not know without evaluating them.
EXACT_ONE = "(sin(1)^2+cos(1)^2)"


@pytest.mark.parametrize("base", ["2", "x"])
def test_that_an_exponent_is_evaluated_where_its_size_is_not_known(base):
    assert parse_expression(f"{base}^(2+{EXACT_ONE}-1)", NAMES).is_Pow
    for exponent in (
        f"64+{EXACT_ONE}",
        f"-65-{EXACT_ONE}",
        f"1/({EXACT_ONE}-1)",
        "exp(exp(exp(9)))",
    ):
        with pytest.raises(ExpressionError, match="the exponent is beyond 64, or not a number"):
            parse_expression(f"{base}^({exponent})", NAMES)


def test_that_random_exact_numbers_never_bring_another_error():
    rng = random.Random(12)
    parts = [EXACT_ONE, f"({EXACT_ONE}-1)", "sqrt(2)", "asin(1)", "log(2)", "pi", "64", "1/3", "x"]
    forms = ["({a}+{b})", "({a}-{b})", "({a}*{b})", "({a}/{b})", "({a})^({b})", "asin({a})",
             "sqrt({a})", "atan2({a}, {b})", "acosh({a})", "log({a})",
             "Piecewise(({a}, {a} < {b}), ({b}, True))"]  # fmt: skip
    refused = 0
    for _ in range(300):
        text = rng.choice(parts)
        for _ in range(rng.randint(1, 4)):
            text = rng.choice(forms).format(a=text, b=rng.choice(parts))
        with suppress(ExpressionError):
            parse_expression(text, NAMES)
            continue
        refused += 1
    assert 0 < refused < 300

"""How J follows from Phi_q: every line of the page holds, and the last is f.J."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from click.testing import CliRunner

import kincompile as kc
from kincompile.calculus.expressions import Symbol
from kincompile.cli import cli
from kincompile.errors import InputError
from kincompile.names import rate
from kincompile.report.document import Display, Math, Table
from kincompile.report.formulas import (
    Decimal,
    DerivativeSymbol,
    Differential,
    Equated,
    Glyph,
    Joined,
    Matrix,
)
from tests.goldens.test_goldens import is_pinned
from tests.transmission_models import ankle, crank_rocker, differential, five_bar
from tests.unit.derivation.test_derivation_is_the_code import evaluate

ANKLE = Path(__file__).resolve().parents[3] / "examples" / "transmissions" / "ankle.toml"
MODELS = {
    "crank_rocker": (crank_rocker, ["motor"], ["phi_rocker"]),
    "five_bar": (five_bar, ["motor_1", "motor_2"], ["end"]),
    "ankle": (ankle, ["left", "right"], ["pitch", "roll"]),
    "spin": (ankle, ["left", "right"], ["omega_x_foot", "omega_eta_foot", "pitch"]),
    "differential": (differential, ["m_1", "m_2"], ["x_1", "x_2"]),
}


def total(formula: Any, values: dict[Any, Any]) -> Any:
    """Return the number of a part of a line."""
    if isinstance(formula, Joined):
        terms, parts = [], [*formula.parts, "+"]
        while parts:
            k = parts.index("+")
            terms.append(math.prod(total(part, values) for part in parts[:k]))
            del parts[: k + 1]
        return sum(terms)
    if isinstance(formula, sympy.Expr):
        return float(formula.subs({x: values[str(x)] for x in formula.free_symbols}))
    return evaluate(formula, values, {})


def lines_of(page: Any) -> list[Equated]:
    """Return the lines with scalars of all steps, in order."""
    (chapter,) = (item for item in page.sections if item.anchor == "transmission")
    blocks = [block for step in chapter.sections for block in step.blocks]
    return [x.formula for x in blocks if isinstance(x, Display) and isinstance(x.formula, Equated)]


def tabulated(page: Any) -> dict[Any, float]:
    """Return the derivatives that are in tables."""
    (chapter,) = (item for item in page.sections if item.anchor == "transmission")
    tables = [x for step in chapter.sections for x in step.blocks if isinstance(x, Table)]
    rows = [row for table in tables for row in table.rows if isinstance(row[0][0], Math)]
    return {row[0][0].formula: row[1][0].formula.value for row in rows}  # type: ignore[union-attr]


def is_of_scalars(line: Equated) -> bool:
    """Return whether a line is about numbers, and not about matrices or small rotations."""
    text = repr(line)
    return not any(word in text for word in ("bold=True", "theta", "Matrix", "'det'"))


def jacobian_of(page: Any) -> list[list[float]]:
    """Return the numbers of the matrix J."""
    first: Any = [line.parts for line in lines_of(page) if line.parts[0] == Glyph("J")]
    matrix: Any = next(x[-1] for x in first if isinstance(x[-1], Matrix))
    return [[x.value for x in row] for row in matrix.rows]


def numbers_at(f: Any, model: Any, inputs: Any) -> dict[Any, Any]:
    """Return numbers of names and derivatives, of J from sensitivities alone."""
    coordinates = tuple(f.module.COORDINATES)
    others = [name for name in coordinates if name not in f.outputs]
    slopes = dict(zip(f.outputs, f.J(f.home.u), strict=True))
    slopes |= dict(zip(others, kc.transmission(model, inputs, others).J(f.home.u), strict=True))
    values: dict[Any, Any] = dict(zip(coordinates, f.home.q, strict=True))
    values |= dict(zip(f.module.PARAMETERS, f.home.p, strict=True))
    values |= {x: y for x, y in zip(f.outputs, f.home.x, strict=True) if x not in f.twists}
    Phi_q = f.module.Phi_q(f.home.q, 0.0, f.home.p)
    for row, name in enumerate(f.module.EQUATIONS):
        symbol = Glyph("Phi", name, bold=False)
        values[symbol] = 0.0
        for column, given in enumerate(coordinates):
            values[DerivativeSymbol(symbol, Symbol(given))] = Phi_q[row, column]
    way = [0.7, -1.3][: len(f.inputs)]  # a change of all inputs at once
    for name, row in slopes.items():
        values[name if name in f.twists else rate(name)] = float(row @ way)
        values[Differential(Symbol(name))] = float(row @ way)
        for parameter, slope in zip(f.loop.parameters, row, strict=True):
            by = rate(parameter) if name in f.twists else parameter
            values[DerivativeSymbol(Symbol(name), Symbol(by), "d")] = slope
    for parameter, change in zip(f.loop.parameters, way, strict=True):
        values[Differential(Symbol(parameter))] = change
    return values


@pytest.fixture(scope="module", params=MODELS)
def case(request: pytest.FixtureRequest) -> Any:
    make, inputs, outputs = MODELS[request.param]
    model: Any = make()  # type: ignore[operator]
    page = kc.derivation(model, transmission=(inputs, outputs))
    return kc.transmission(model, inputs, outputs), page, model, inputs


@pytest.mark.every(5)
def test_that_every_line_holds(case: Any) -> None:
    f, page, model, inputs = case
    # Derivatives of outputs too long for a line are in a table; the others are known.
    values = tabulated(page) | numbers_at(f, model, inputs)
    seen = 0
    for line in filter(is_of_scalars, lines_of(page)):
        left, *others = line.parts
        if left not in values and isinstance(left, Symbol) and left.name not in values:
            values[left.name] = total(others[0], values)  # an intermediate value, D or w
        if isinstance(left, DerivativeSymbol) and left not in values:
            values[left] = total(others[0], values)
        numbers = [
            total(part, values)
            for part in (left, *others)
            if "Glyph(letter='det'" not in repr(part)
        ]
        assert np.ptp(numbers) < 1e-9 * max(1.0, *np.abs(numbers)), line
        seen += 1
    assert seen > len(f.module.EQUATIONS)


def test_that_the_numbers_are_those_of_the_function(case: Any) -> None:
    f, page, _, _ = case
    known = f.J(f.home.u)
    shown: Any = {}
    for line in lines_of(page):
        if isinstance(line.parts[0], DerivativeSymbol) and isinstance(line.parts[-1], Decimal):
            symbol: Any = line.parts[0]
            shown[symbol.numerator.name, symbol.denominator.name] = line.parts[-1].value
    by = {x: [rate(u) if x in f.twists else u for u in f.loop.parameters] for x in f.outputs}
    names = [(x, u) for x in f.outputs for u in by[x]]
    np.testing.assert_allclose([shown[name] for name in names], known.ravel(), 1e-12, 1e-13)
    np.testing.assert_allclose(jacobian_of(page), known, 1e-12, 1e-13)


def test_that_a_four_bar_comes_out_as_in_the_textbook() -> None:
    """The ratio of the rates of rocker and crank, and both kinds of singular positions."""
    page = kc.derivation(crank_rocker(), transmission=(["motor"], ["phi_rocker"]))
    a, b, c = sympy.symbols("a b c")
    crank, coupler, rocker = sympy.symbols("phi_crank phi_coupler phi_rocker")
    ratio = a * sympy.sin(coupler - crank) / (c * sympy.sin(coupler - rocker))
    found = [x for line in lines_of(page) for x in line.parts if isinstance(x, sympy.Expr)]
    assert found == [
        b * c * sympy.sin(coupler - rocker),
        ratio,
        b * c * sympy.sin(coupler - rocker),
        ratio,
    ]
    text = page.to_markdown()
    order = ["O.x", "O.y", "D.x", "D.y", "motor", "B.x", "B.y"]
    order = [f"({k}) `{name}` gives" for k, name in enumerate(order, start=1)]
    order.append("With these, `C.x`, `C.y` become")
    places = [text.index(item) for item in order]
    assert places == sorted(places)
    assert (
        r"- b \, \sin {\phi}_{\mathrm{coupler}} \, d {\phi}_{\mathrm{coupler}} {} + c \, "
        r"\sin {\phi}_{\mathrm{rocker}} \, d {\phi}_{\mathrm{rocker}} {} = "
        r"a \, \sin {\phi}_{\mathrm{crank}} \, d {u}_{\mathrm{motor}}"
    ) in text


def test_that_a_five_bar_is_singular_where_links_are_in_line() -> None:
    page = kc.derivation(five_bar(), transmission=(["motor_1", "motor_2"], ["end"]))
    arms, rods = sympy.symbols("phi_arm_1:3"), sympy.symbols("phi_rod_1:3")
    found = [x for line in lines_of(page) for x in line.parts if isinstance(x, sympy.Expr)]
    folded = sympy.sin(rods[0] - rods[1])
    stretched = [sympy.sin(arm - rod) for arm, rod in zip(arms, rods, strict=True)]
    wanted = -0.0081 * stretched[0] * stretched[1] / folded
    values = dict(zip((*arms, *rods), (0.3, 1.1, -0.4, 2.0), strict=True))
    assert sympy.count_ops(found[-1]) == sympy.count_ops(wanted)
    assert float(found[-1].subs(values)) == pytest.approx(float(wanted.subs(values)), rel=1e-12)
    assert found[0].equals(0.0144 * folded)


GOLDENS = Path(__file__).resolve().parents[2] / "data" / "derivations"


@pytest.mark.skipif(not is_pinned(), reason="the bytes are those of the pinned SymPy")
@pytest.mark.parametrize("name", ["crank_rocker", "five_bar"])
def test_that_the_page_is_that_of_the_golden_file(
    name: str, request: pytest.FixtureRequest
) -> None:
    """The part from Phi_q to J, as text."""
    make, *ends = MODELS[name]
    page = kc.derivation(make(), transmission=ends).to_markdown()  # type: ignore[operator]
    text = page[page.index("## From Phi\\_q to the Jacobian J") :]
    if request.config.getoption("--update-goldens"):
        (GOLDENS / f"{name}.md").write_text(text, encoding="utf-8")
    assert (GOLDENS / f"{name}.md").read_text(encoding="utf-8") == text


def test_that_the_state_is_a_pose_on_the_branch() -> None:
    model = ankle()
    ends = ["left", "right"], ["pitch", "roll"]
    f = kc.transmission(model, *ends)
    page = kc.derivation(model, {"left": 0.2464, "right": 0.2580}, transmission=ends)
    np.testing.assert_allclose(jacobian_of(page), f.J([0.2464, 0.2580]), 1e-10)


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ({"lift": 1}, "no input and no parameter 'lift'; did you mean"),
        ({"x_foot": 1}, "no input and no parameter 'x_foot'"),
        ({"left": 0.35}, "the branch of the first pose of ankle has none at this state"),
        ({"left": float("nan")}, "not a finite number"),
        (0.5, "a transmission has no time"),
    ],
)
def test_that_what_is_no_state_is_named(state: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        kc.derivation(ankle(), state, transmission=(["left", "right"], ["pitch", "roll"]))


def test_that_a_page_of_constraints_and_one_of_a_transmission_are_two() -> None:
    with pytest.raises(InputError, match="leave out constraint, levels and form"):
        kc.derivation(ankle(), constraint="left", transmission=(["left", "right"], ["pitch"]))


@pytest.mark.slow
def test_the_command(tmp_path: Any) -> None:
    options = "--transmission", "left,right:pitch,roll", "--set", "left=0.23"
    for ending in ("md", "html", "slides.html", "tex", "ipynb"):
        path = tmp_path / f"page.{ending}"
        result = CliRunner().invoke(cli, ["derive", str(ANKLE), "-o", str(path), *options])
        assert result.exit_code == 0, result.output
        assert "Efforts, from power" in path.read_text(encoding="utf-8")

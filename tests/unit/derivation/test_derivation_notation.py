"""The textbook's notation in LaTeX and MathML."""

import xml.etree.ElementTree as ET
from fractions import Fraction
from typing import Any

import pytest
import sympy

import kincompile as kc
from kincompile.calculus.expressions import Number, Power, Product, Sum, Symbol, VectorSymbol
from kincompile.calculus.rotations import turned
from kincompile.calculus.symbols import i, j, s_i, s_j, unit
from kincompile.derivations.joint_terms import abbreviations
from kincompile.derive.derivation import derive
from kincompile.derive.partials import partials
from kincompile.report.formulas import (
    Call,
    Choice,
    Decimal,
    DerivativeSymbol,
    Equated,
    Glyph,
    Matrix,
    Relation,
)
from kincompile.report.mathml import MathMLPrinter
from kincompile.report.notation import split_name
from kincompile.report.tex import TexPrinter, escape


def tex(formula: Any, names: Any = None) -> str:
    """Return a formula in LaTeX, without the braces and spaces that show nothing."""
    text = TexPrinter(names).math(formula)
    for base in ("\\mathbf{r}", "\\mathbf{A}", "\\mathbf{B}", "\\mathbf{s}", "\\mathbf{v}"):
        text = text.replace(f"{{{base}}}", base)
    return text.replace("\\mathbf", "").replace("^{\\prime}", "'")


def test_that_a_revolute_joint_reads_as_in_the_textbook() -> None:
    (block,) = derive(kc.Revolute.template())
    assert tex(block.Phi) == "{r}_{i} + {A}_{i} {s}_{i}' - {r}_{j} - {A}_{j} {s}_{j}'"
    (row,) = partials(kc.Revolute.template())
    assert tex(row[1].entry) == "{B}_{i} {s}_{i}'"
    rates = [f"{{{{\\dot{{\\phi}}}}_{{{index}}}}}^{{2}}" for index in "ij"]
    centripetal = [f"{{A}}_{{{index}}} {{s}}_{{{index}}}'" for index in "ij"]
    first, second = (f"{a} \\, {rate}" for a, rate in zip(centripetal, rates, strict=True))
    assert tex(block.gamma) == f"{first} - {second}"


def test_that_a_distance_is_written_with_d() -> None:
    template = kc.Distance.template()
    (block,) = derive(template)
    names = abbreviations(template)
    assert tex(block.Phi, names) == "{{d}}^{T} {d} - {C}^{2}"
    assert tex(block.nu, names) == "2 \\, C \\, \\dot{C}"
    velocity = tex(block.velocity, names)
    assert velocity == "2 \\, {{d}}^{T} \\dot{{d}}"
    (d, _) = names
    assert tex(Equated((names[d], d)), names).startswith("{d} = {r}_{j} +")


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        (Symbol("phi_crank_dot"), "{\\dot{\\phi}}_{\\mathrm{crank}}"),
        (Symbol("x2"), "{x}_{2}"),
        (Symbol("phi_rod_ddot"), "{\\ddot{\\phi}}_{\\mathrm{rod}}"),
        (Symbol("cylinder_length"), "\\mathrm{cylinder\\_length}"),
        (Number(Fraction(-3, 2)), "- \\frac{3}{2}"),
        (Decimal(-1.5e-7), "- 1.5 \\times {10}^{-7}"),
        (Decimal(-0.0), "0"),
        (unit(Symbol("theta_i")), "{u} ( {\\theta}_{i} )"),
        (turned(Symbol("phi_i"), VectorSymbol("v_i"), 1), "{B}_{i} {v}_{i}'"),
        (Sum((Symbol("a"), Sum((Symbol("b"), Symbol("c"))))), "a + ( b + c )"),
        (Product((Symbol("x_dot"), Number(Fraction(2)), Symbol("a"))), "2 \\, a \\, \\dot{x}"),
        (Call("cos", (Symbol("phi"),)), "\\cos \\phi"),
        (Call("sqrt", (Symbol("a"),)), "\\sqrt{a}"),
        (Relation("<=", Symbol("t"), Number(Fraction(1))), "t \\le 1"),
        (Matrix(((Symbol("a"), Symbol("b")),)), "\\begin{bmatrix} a & b \\end{bmatrix}"),
        (sympy.Symbol("phi3") ** 2 / 2, "\\frac{{\\phi}_{3}^{2}}{2}"),
    ],
)
def test_that_a_formula_is_written_in_latex(formula: Any, expected: str) -> None:
    assert tex(formula) == expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("phi_crank", ("phi", "crank", 0)),
        ("phi_crank_dot", ("phi", "crank", 1)),
        ("alpha_i_cam_ddot", ("alpha", "i_cam", 2)),
        ("x12", ("x", "12", 0)),
        ("r1_arm", ("r", "1,arm", 0)),
        ("length", ("length", "", 0)),
        ("R_sun", ("R", "sun", 0)),
    ],
)
def test_that_a_name_is_split_into_letter_index_and_dots(name: str, expected: Any) -> None:
    assert split_name(name) == expected


def test_that_vectors_are_bold_and_names_upright_in_mathml() -> None:
    printer = MathMLPrinter()
    element = ET.fromstring(printer.math(i.A(s_i)))
    letters = [item.text for item in element.iter("mi")]
    assert letters[0] == "\N{MATHEMATICAL BOLD CAPITAL A}"
    assert letters[2] == "\N{MATHEMATICAL BOLD SMALL S}"
    element = ET.fromstring(printer.math(Symbol("phi_crank_dot")))
    assert [item.text for item in element.iter("mi")] == [
        "\N{MATHEMATICAL ITALIC SMALL PHI}",
        "crank",
    ]
    assert element.find("./msub/mover/mo").text == "\N{DOT ABOVE}"  # type: ignore[union-attr]


def test_that_a_derivative_has_its_sign_above_and_below() -> None:
    formula = DerivativeSymbol(Glyph("Phi"), Symbol("phi"))
    element = ET.fromstring(MathMLPrinter().math(formula))
    above, below = element.findall("./mfrac/mrow")
    for part in (above, below):
        assert part[0].text == "\N{PARTIAL DIFFERENTIAL}"
    assert tex(formula) == "\\frac{\\partial \\boldsymbol{\\Phi}}{\\partial \\phi}"
    assert tex(DerivativeSymbol(Glyph("A"), Symbol("phi"), "d")) == "\\frac{d {A}}{d \\phi}"


def test_that_functions_of_sympy_are_upright() -> None:
    x = sympy.Symbol("x")
    element = ET.fromstring(MathMLPrinter().math(sympy.sin(x) + sympy.atan2(x, 2) - sympy.exp(x)))
    upright = {item.text for item in element.iter("mi") if (item.text or "").isascii()}
    assert upright == {"sin", "atan2", "e"}
    assert [item.text for item in element.iter("mo")].count("\N{MINUS SIGN}") == 1


def test_that_a_relation_is_escaped_in_mathml() -> None:
    choice = Choice(Relation("<", Symbol("t"), Symbol("a")), Symbol("b"), Symbol("c"))
    text = MathMLPrinter().math(choice)
    assert "&lt;" in text
    assert ET.fromstring(text).tag == "math"


def test_that_a_long_sum_is_in_pieces_between_which_a_line_may_break() -> None:
    formula = Equated((Glyph("Phi"), i.point(s_i) - j.point(s_j)))
    pieces = MathMLPrinter().display(formula).split("<wbr>")
    assert len(pieces) == 5
    assert [piece.count("<math") for piece in pieces] == [1] * 5
    assert 'form="infix">=<' in pieces[1]
    assert "&#8722;" in pieces[3]


def test_that_long_brackets_and_products_are_broken_and_nothing_is_lost() -> None:
    letters = [Symbol(name) for name in "abcdefgh"]
    inner = Sum((*letters, Product((Number(Fraction(-2)), *letters[:3]))))
    long = Sum(
        (
            Product((letters[0], inner, Power(inner, 2))),
            Product((letters[1], Call("sin", (inner,)))),
        )
    )
    pieces = MathMLPrinter().display(Equated((Symbol("u"), long))).split("<wbr>")
    plain, *broken = (
        "".join(ET.fromstring(text).itertext()) for text in (MathMLPrinter().math(long), *pieces)
    )
    assert max(map(len, broken)) <= 8
    assert "".join(broken) == f"{letters_of('u')}={plain}"
    for text in (TexPrinter().pieces(Equated((Symbol("u"), long))), broken):
        joined = "".join(text)
        assert joined.count("(") == joined.count(")") == 3


def letters_of(name: str) -> str:
    """Return a name as MathML writes it."""
    return "".join(ET.fromstring(MathMLPrinter().math(Symbol(name))).itertext())


def test_that_text_is_escaped_for_latex() -> None:
    assert escape("a_b & 50% {#}") == r"a\_b \& 50\% \{\#\}"

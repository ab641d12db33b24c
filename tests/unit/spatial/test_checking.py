"""Derivations and comparisons of mechanisms in space."""

import math
from typing import Any
from zlib import crc32

import numpy as np
import pytest
import sympy

import kincompile as kc
from kincompile import spatial
from kincompile.calculus.expand import Expansion
from kincompile.derive.derivation import derive
from kincompile.derive.partials import partials
from kincompile.space.catalogue import CONSTRAINTS

X, Y, Z = np.eye(3)


def pendulum() -> spatial.Mechanism:
    m = spatial.Mechanism("pendulum")
    rod = m.body("rod", (0.1, 0.2, -0.3))
    m.add(spatial.Revolute("A", m.ground, (0, 0, 0), Y, rod, (-0.1, 0.2, 0.3), Y))
    m.add(spatial.RelativeRotation("motor", m.ground, Y, X, rod, Y, X, kc.t**2))
    return m


class Numbers:
    """The leaves of a template as numbers that belong to their names."""

    def symbol(self, symbol: Any) -> Any:
        return 0.5 + crc32(symbol.name.encode()) / 2**32

    def vector(self, symbol: Any) -> Any:
        return tuple(0.5 + crc32(f"{symbol.name} {k}".encode()) / 2**32 for k in range(symbol.size))

    def number(self, value: Any) -> float:
        return float(value)

    def pi(self) -> float:
        return math.pi

    def time_function(self, function: Any) -> float:
        return 0.3 + float(function.order)

    def entries(self, rotation: Any, expand: Expansion) -> Any:
        return expand.entries(rotation)

    def profile(self, profile: Any) -> float:
        raise AssertionError(profile)

    def call(self, function: str, *values: float) -> float:
        return float(getattr(math, function)(*values))


@pytest.mark.parametrize("name", CONSTRAINTS)
def test_that_the_blocks_of_the_book_are_the_columns_of_the_code(name: str) -> None:
    template = CONSTRAINTS[name].template()
    expansion = Expansion(Numbers(), template.dimension)
    for block, row in zip(derive(template), partials(template), strict=True):
        columns = [column for item in row for column in item.columns(item.entry)]
        for read_off, column in zip(columns, block.Phi_q, strict=True):
            found, expected = expansion.components(read_off), expansion.components(column)
            assert found == pytest.approx(expected, rel=1e-12, abs=1e-13)


def test_that_a_derivation_has_the_matrices_of_the_textbook() -> None:
    page = kc.derivation(pendulum()).to_markdown()
    assert "B(p, s) = 2 [(e0 I + e~) s, e s^T - (e0 I + e~) s~]" in page
    slope = r"\mathbf{B} ( {\mathbf{p}}_{j} , {\mathbf{s}}_{j}^{\prime} )"
    assert rf"\begin{{bmatrix}} \mathbf{{I}} & {slope} \\" in page
    assert r"\mathbf{B} ( {\dot{\mathbf{p}}}_{j} , {\mathbf{s}}_{j}^{\prime} )" in page


@pytest.mark.parametrize("form", ["to_html", "to_latex", "to_notebook", "to_slides"])
def test_that_every_format_takes_mechanisms_in_space(form: str) -> None:
    assert "rod" in getattr(kc.derivation(pendulum()), form)()


@pytest.fixture(scope="module")
def right() -> dict[str, Any]:
    m = pendulum()
    return {name: sympy.Matrix(getattr(m, name)) for name in ("Phi_q", "nu", "gamma")}


def test_that_right_answers_are_equal(right: dict[str, Any]) -> None:
    assert kc.compare(pendulum(), **right).equal


def extended(change: Any) -> Any:
    """Return Phi_q of the joint A with another rotation matrix, by SymPy."""
    m = pendulum()
    e0, e1, e2, e3 = p = sympy.symbols("e0_rod e1_rod e2_rod e3_rod")
    e, square = sympy.Matrix([e1, e2, e3]), sum(item**2 for item in p)
    skew = sympy.Matrix([[0, -e3, e2], [e3, 0, -e1], [-e2, e1, 0]])
    usual = (e0**2 - e.dot(e)) * sympy.eye(3) + 2 * e * e.T + 2 * e0 * skew
    matrix = change(usual, square)
    s, h = sympy.Matrix([-0.1, 0.2, 0.3]), sympy.Matrix([0, 1, 0])
    place = sympy.Matrix(m.q.flat()[:3]) + matrix * s
    # the ground's triad about y, as the package chooses it: f = x, g = h x f = -z
    rows = [*place, (matrix * h)[0], -(matrix * h)[2]]
    found = sympy.Matrix(m.Phi_q)
    found[:5, :] = sympy.Matrix(rows).jacobian(m.q.flat())
    return found


@pytest.mark.parametrize(
    ("text", "change"),
    [
        ("A = (2 e0^2 - 1) I", lambda usual, n: usual + (n - 1) * sympy.eye(3)),
        ("A = (1 - 2 e^T e) I", lambda usual, n: usual + (1 - n) * sympy.eye(3)),
        ("A = E G^T/(p^T p)", lambda usual, n: usual / n),
    ],
)
def test_that_other_rotation_matrices_are_conventions(text: str, change: Any) -> None:
    report = kc.compare(pendulum(), Phi_q=extended(change))
    assert "different" not in {entry.verdict for entry in report.entries}
    assert text in str(report)


def wrong_half(Phi_q: Any) -> None:
    Phi_q[:3, 3:] /= 2


def wrong_order(Phi_q: Any) -> None:
    Phi_q[:5, 3:] = Phi_q[:5, [4, 5, 6, 3]]


def wrong_sign(Phi_q: Any) -> None:
    Phi_q[0, 3] *= -1


def wrong_tilde(Phi_q: Any) -> None:
    e0, *e = sympy.symbols("e0_rod e1_rod e2_rod e3_rod")
    e, s = sympy.Matrix(e), sympy.Matrix([-0.1, 0.2, 0.3])
    inner = e0 * sympy.eye(3) + tilde(e)
    Phi_q[:3, 4:] = 2 * (e * s.T + inner * tilde(s))


def tilde(v: Any) -> Any:
    return sympy.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (wrong_half, "half what it should be"),
        (wrong_order, "e0 stands last"),
        (wrong_sign, "the entry has the wrong sign"),
        (wrong_tilde, "the sign of s_j~ is wrong in B_j"),
    ],
)
def test_that_slips_of_the_field_are_named(right: dict[str, Any], spoil: Any, named: str) -> None:
    Phi_q = right["Phi_q"].copy()
    spoil(Phi_q)
    report = kc.compare(pendulum(), Phi_q=Phi_q)
    assert not report.equal
    assert named in str(report)


def test_that_half_the_norm_row_is_a_convention(right: dict[str, Any]) -> None:
    half = {name: item.copy() for name, item in right.items()}
    for item in half.values():
        item[6, :] /= 2  # ME751 has p^T p/2 - 1/2
    report = kc.compare(pendulum(), **half)
    assert report.equal
    assert "norm_rod" in next(c.text for c in report.conventions if c.kind == "row scale")
    half["gamma"] = right["gamma"]
    report = kc.compare(pendulum(), **half)
    assert {entry.row for entry in report.different} == {"norm_rod"}
    assert "half what it should be" in str(report)


def test_that_a_transposed_rotation_is_named() -> None:
    turned = extended(lambda usual, _: usual.T)
    report = kc.compare(pendulum(), Phi_q=turned)
    assert not report.equal
    assert "the rotations of all bodies are transposed" in str(report)
